"""What the robot gives up among people who leave it no way: graded decay.

With hard barriers around everybody the robot is safe and stuck: people come faster than gamma h / dt, so it
backs away from each of them, and it waits as long as zones cover its goal. With `MPCSettings.crowding` it
counts the people near it:

    alone    fewer than `few`     the decay of h is hard, as in the paper
    few      fewer than `many`    h >= 0 is hard; a faster decay has a price
    crowd    more                 a gap to bodies is hard; h has a price, and the robot may enter zones

So each person has up to two barriers: one around the zone, and one that is hard, with gamma = 1. In a crowd
the second is a circle around the body, whose distance is Euclidean.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import hypot
from typing import Literal

from ..zones.ellipses import BODY_RADIUS
from .person import Person, PlacedZone
from .settings import MPCSettings

Level = Literal["alone", "few", "crowd"]


def count_near(
    position: Sequence[float], people: Iterable[Person], radius: float
) -> int:
    """Number of `people` within `radius` of a `position`, (x, y, ...) [m]."""
    offsets = (
        (person.position[0] - position[0], person.position[1] - position[1])
        for person in people
    )
    return sum(hypot(*offset) <= radius for offset in offsets)


def find_level(
    position: Sequence[float], people: Iterable[Person], settings: MPCSettings
) -> Level:
    """How many `people` are near a `position`, (x, y, ...) [m]; "alone" without `settings.crowding`."""
    if settings.crowding is None:
        return "alone"
    near = count_near(position, people, settings.crowding.radius)
    return (
        "alone"
        if near < settings.crowding.few
        else "few"
        if near < settings.crowding.many
        else "crowd"
    )


def list_barriers(
    level: Level,
    zones: Sequence[PlacedZone],
    people: Sequence[Person],
    settings: MPCSettings,
) -> Sequence[Sequence[float]]:
    """Foci, a, velocity, gamma and price of each barrier of people: first one for each zone, then the others.

    Parameters
    ----------
    level : of the crowd around the robot.
    zones, people : everybody, in the same order.
    settings : of the controller.
    """
    s, hard = settings, settings.slack_weight
    if level == "alone" or s.crowding is None:
        return [(*zone, s.gamma, hard) for zone in zones]
    around_zones = [(*zone, s.crowding.gamma, s.crowding.price) for zone in zones]
    if level == "few":
        return around_zones + [(*zone, 1.0, hard) for zone in zones]
    radius = BODY_RADIUS + s.crowding.gap - s.eps  # the barrier adds eps
    centres = [person.position * 2 for person in people]
    bodies = [
        (*at, radius, *zone[5:], 1.0, hard)
        for at, zone in zip(centres, zones, strict=True)
    ]
    return around_zones + bodies
