"""Meetings: people as the controller sees them, and what to do when one is met head-on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import atan2, cos, sin
from typing import Protocol

import numpy as np

from .barriers import Array, barrier, finite, segment_distance
from .ellipses import Ellipse
from .errors import SolverError, ZoneError
from .settings import MPCSettings


class SpeedZone(Protocol):
    """Anything that has a zone for each walking speed, such as `SocialZone`."""

    def ellipse(self, speed: float) -> Ellipse: ...


def as_ellipse(zone: Ellipse | SpeedZone, speed: float) -> Ellipse:
    """The zone at a walking speed [m/s]; ZoneError for what is none."""
    if isinstance(zone, Ellipse):
        return zone
    if not hasattr(zone, "ellipse"):
        raise ZoneError(f"a zone must be an Ellipse or have .ellipse(speed); got {type(zone).__name__}")
    return zone.ellipse(speed)


@dataclass(frozen=True)
class Person:
    """A person as the controller sees them: here, and at constant velocity from now on.

    Parameters
    ----------
    position : (x, y) [m].
    velocity : (vx, vy) [m/s].
    heading : where they face, counter-clockwise from x [rad]; None: where they walk.
    zone : their social zone, in their own frame; None: the controller's.

    Raises
    ------
    SolverError : a number is not finite, or a standing person has no heading.
    """

    position: tuple[float, float]
    velocity: tuple[float, float] = (0.0, 0.0)
    heading: float | None = None
    zone: Ellipse | SpeedZone | None = None

    def __post_init__(self) -> None:
        x, y = finite("a person's position", self.position, (2,)).tolist()
        vx, vy = finite("a person's velocity", self.velocity, (2,)).tolist()
        object.__setattr__(self, "position", (x, y))
        object.__setattr__(self, "velocity", (vx, vy))
        if self.heading is None and vx == vy == 0:
            raise SolverError(f"a person who stands needs a heading; got none for the one at {(x, y)}")
        heading = atan2(vy, vx) if self.heading is None else self.heading
        object.__setattr__(self, "heading", float(finite("a person's heading", heading, ())))

    @property
    def stands(self) -> bool:
        """True if the velocity is zero."""
        return self.velocity == (0.0, 0.0)

    def after(self, seconds: float) -> Person:
        """The same person, so many seconds later."""
        (x, y), (vx, vy) = self.position, self.velocity
        return Person((x + vx * seconds, y + vy * seconds), self.velocity, self.heading, self.zone)


def steer(
    state: Array,
    goal: Array,
    placed: Sequence[Ellipse],
    people: Sequence[Person],
    walls: Array,
    s: MPCSettings,
) -> Array:
    """Where to be drawn to, shape (2,) [m]: the goal, or around a person whom the robot meets head-on.

    A person blocks the way where the line to the goal enters the set h < 0, itself an ellipse with
    the foci of the zone. Its two tangents from the robot lie at the angles +-w about -grad h, the
    bisector of the directions to the foci (so it is for all confocal ellipses). Let the goal lie at
    the angle b from there. At b = 0 both ways around are equally long, the optimum is to stand still
    in front of the person, and every solver does so for ever. So where |b| <= tie * w the robot is
    drawn along the tangent on `pass_side`, at the goal's distance. Once it is on that side, what is
    drawn turns back to the goal between |b| = tie * w and 2 tie * w, without a jump. Where a wall
    leaves no room beside the person on that side, the same holds for the other side, and where
    there is no room at all the goal stays the goal: then the robot yields.

    Only where the barrier can be felt yet, h <= closing speed * dt / gamma, and for people who do
    not walk across the way: those open it by themselves. The nearest such person counts.
    """
    position = state[:2]
    way = goal - position
    distance = float(np.hypot(*way))
    if distance == 0 or s.tie == 0:
        return goal
    nearest, target = np.inf, goal
    for person, zone in zip(people, placed, strict=True):
        to_foci = zone.foci - position
        r1, r2 = np.hypot(to_foci[:, 0], to_foci[:, 1])
        h = float(barrier((r1 + r2) / 2 - zone.semi_axes[0], s.r_robot, s.eps))
        if h > nearest or h > distance or min(r1, r2) == 0:
            continue
        inward = to_foci[0] / r1 + to_foci[1] / r2
        inward /= np.hypot(*inward)
        pace = float(np.hypot(*person.velocity))
        across = abs(_cross(way / distance, np.asarray(person.velocity))) > s.tie * pace
        if across or h > (s.v_max + pace) * s.dt / s.gamma:
            continue
        reach = zone.semi_axes[0] + s.r_robot + s.eps
        w = np.arccos(np.clip((r1**2 + r2**2 - 4 * reach**2) / (2 * r1 * r2), -1, 1)) / 2
        b = atan2(_cross(inward, way), inward @ way)
        nearest, target = h, goal
        for left in (s.pass_side == "left", s.pass_side != "left"):
            lead = (b if left else -b) / (s.tie * w)
            beside = np.array([-way[1], way[0]]) / distance * (1 if left else -1)
            if -1 <= lead < 2 and _has_room(zone, reach, beside, walls, s):
                turn = ((w if left else -w) - b) * min(1.0, 2 - lead)
                rotation = np.array([[cos(turn), -sin(turn)], [sin(turn), cos(turn)]])
                target = position + rotation @ way
                break
    return target


def _has_room(zone: Ellipse, reach: float, beside: Array, walls: Array, s: MPCSettings) -> bool:
    """True if no wall stands between the zone's centre and where the robot passes, in direction `beside`."""
    major = np.array([cos(zone.angle), sin(zone.angle)])
    c2 = zone.semi_axes[0] ** 2 - zone.semi_axes[1] ** 2
    width = np.sqrt(reach**2 - c2 * _cross(major, beside) ** 2)
    points = np.asarray(zone.center) + np.linspace(0, width, 20)[:, None] * beside
    return all((barrier(segment_distance(points, *wall), s.r_robot, s.eps) >= 0).all() for wall in walls)


def _cross(u: Array, v: Array) -> float:
    return float(u[0] * v[1] - u[1] * v[0])
