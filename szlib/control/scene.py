"""What a step was asked: the robot, its goal, people and walls, as the controller took them."""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot
from typing import NamedTuple

from ..zones.ellipses import Ellipse
from .barriers import barrier, euclidean_segment_formula, segment_formula
from .person import BODY_RADIUS, Person, PlacedZone
from .settings import MPCSettings
from .tracker import Seen


class Scene(NamedTuple):
    """What was asked.

    The robot's state (x, y, vx, vy) and its goal (x, y); people as the tracker sees them, the zone that is
    kept of each, in their own frame, and in the world; the ends of walls (xa, ya, xb, yb) and their margins;
    and the settings [m, m/s].
    """

    state: tuple[float, ...]
    goal: tuple[float, float]
    seen: Seen
    kept: Sequence[Ellipse]
    zones: Sequence[PlacedZone]
    walls: Sequence[Sequence[float]]
    margins: Sequence[float]
    settings: MPCSettings

    @property
    def people(self) -> tuple[Person, ...]:
        """Everybody to be respected, in the order of `Step.h`."""
        return self.seen.people

    @property
    def goal_blocked(self) -> bool:
        """True if h < 0 at the goal, for a wall or for somebody who stands there."""
        if any(zone.blocks(self.goal, self.settings) for zone in self.zones):
            return True
        h = (
            barrier(segment_formula(*self.goal, *wall), self.settings.r_robot, margin)
            for wall, margin in zip(self.walls, self.margins, strict=True)
        )
        return any(each < 0 for each in h)

    def gaps(self, x: float, y: float, seconds: float) -> list[float]:
        """Euclidean gaps from the robot's disc at (x, y) to bodies, so many seconds ahead, and walls [m]."""
        gaps, radius = [], self.settings.r_robot
        for person in self.people:
            (px, py), (vx, vy) = person.position, person.velocity
            gaps.append(hypot(x - px - seconds * vx, y - py - seconds * vy) - BODY_RADIUS - radius)
        for xa, ya, xb, yb in self.walls:
            gaps.append(euclidean_segment_formula(x, y, xa, ya, xb, yb) - radius)
        return gaps
