"""Meetings: what to do when somebody is met head-on."""

from __future__ import annotations

from collections.abc import Sequence
from math import acos, atan2, cos, hypot, inf, sin, sqrt

import numpy as np

from .barriers import barrier, segment_formula
from .person import PlacedZone
from .settings import MPCSettings

_ALONG = np.linspace(0, 1, 20)
"""Where room is looked for, from the zone's centre to where the robot passes."""


def subgoal(
    position: tuple[float, float],
    goal: tuple[float, float],
    people: Sequence[PlacedZone],
    walls: Sequence[Sequence[float]],
    margins: Sequence[float],
    s: MPCSettings,
) -> tuple[float, float]:
    """Where to be drawn to [m]: the goal, or around a person whom the robot meets head-on.

    Walls are given by their ends (xa, ya, xb, yb), each with its margin [m].

    A person blocks the way where the line to the goal enters the set h < 0, itself an ellipse with
    the foci of the zone. Its two tangents from the robot lie at the angles +-w about -grad h, the
    bisector of the directions to the foci (so it is for all confocal ellipses). Let the goal lie at
    the angle b from there. At b = 0 both ways around are equally long, the optimum is to stand still
    in front of the person, and every solver does so for ever. So where |b| <= tie * w the robot is
    drawn along the tangent on `pass_side`, at the goal's distance. Once it is on that side, what is
    drawn turns back to the goal between |b| = tie * w and 2 tie * w, without a jump. Where a wall
    leaves no room beside the person on that side, the same holds for the other side, and where
    there is no room at all the goal stays the goal: then the robot yields.

    Only where the barrier can be felt yet, h <= closing speed * dt / gamma, or could be within the
    horizon, h <= closing speed * dt * N: else, for gamma > 1/N, the slightest tilt of the zone would turn
    the plan to a side before this rule does. And only for people who do not walk across the way: those
    open it by themselves. Nor for who stands on the goal: there is nothing behind them to go to. The
    nearest such person counts.
    """
    (x, y), way = position, (goal[0] - position[0], goal[1] - position[1])
    distance = hypot(*way)
    if distance == 0 or s.tie == 0:
        return goal
    nearest, target = inf, goal
    for zone in people:
        pace = hypot(zone.vx, zone.vy)
        if abs(way[0] * zone.vy - way[1] * zone.vx) > s.tie * pace * distance:
            continue
        h, closing = barrier(zone.distance(x, y), s.r_robot, s.eps), (s.v_max + pace) * s.dt
        if h > min(nearest, distance, max(closing / s.gamma, closing * s.N)):
            continue
        angles = _angles(zone, position, way, s)
        if angles is None:
            continue
        nearest, target = h, goal
        turn = _turn(zone, goal, way, *angles, walls, margins, s)
        if turn is not None:
            c, d = cos(turn), sin(turn)
            target = (x + c * way[0] - d * way[1], y + d * way[0] + c * way[1])
    return target


def _angles(
    zone: PlacedZone, position: tuple[float, float], way: tuple[float, float], s: MPCSettings
) -> tuple[float, float] | None:
    """w, half the angle between the tangents, and b, that of the way from their middle; None on a focus."""
    x, y = position
    to_a, to_b = (zone.xa - x, zone.ya - y), (zone.xb - x, zone.yb - y)
    ra, rb = hypot(*to_a), hypot(*to_b)
    if ra * rb == 0:
        return None
    inward = (to_a[0] / ra + to_b[0] / rb, to_a[1] / ra + to_b[1] / rb)
    cosine = (ra**2 + rb**2 - 4 * _reach(zone, s) ** 2) / (2 * ra * rb)
    w = acos(max(-1.0, min(1.0, cosine))) / 2
    return w, atan2(_cross(inward, way), inward[0] * way[0] + inward[1] * way[1])


def _turn(
    zone: PlacedZone,
    goal: tuple[float, float],
    way: tuple[float, float],
    w: float,
    b: float,
    walls: Sequence[Sequence[float]],
    margins: Sequence[float],
    s: MPCSettings,
) -> float | None:
    """By how much the way is turned to a side with room, the one to pass on first; None where it is not."""
    if s.tie * w == 0:
        return None
    for left in (s.pass_side == "left", s.pass_side != "left"):
        lead = (b if left else -b) / (s.tie * w)
        if not -1 <= lead < 2:
            continue
        if _has_room(zone, way, left, walls, margins, s) and not zone.blocks(goal, s):
            return ((w if left else -w) - b) * min(1.0, 2 - lead)
    return None


def _reach(zone: PlacedZone, s: MPCSettings) -> float:
    """The semi-major axis of the set h < 0 [m]."""
    return zone.a + s.r_robot + s.eps


def _has_room(
    zone: PlacedZone,
    way: tuple[float, float],
    left: bool,
    walls: Sequence[Sequence[float]],
    margins: Sequence[float],
    s: MPCSettings,
) -> bool:
    """True if no wall stands between the zone's centre and where the robot passes on that side.

    The distance to a wall is never less than the Euclidean one, so most walls are plainly too far to count.
    """
    if not walls:
        return True
    length = hypot(*way) if left else -hypot(*way)
    beside = (-way[1] / length, way[0] / length)
    half = ((zone.xa - zone.xb) / 2, (zone.ya - zone.yb) / 2)
    width = sqrt(_reach(zone, s) ** 2 - _cross(half, beside) ** 2)
    along = width * beside[0], width * beside[1]
    x, y = (zone.xa + zone.xb) / 2, (zone.ya + zone.yb) / 2
    middle, near = (x + along[0] / 2, y + along[1] / 2), []
    for (xa, ya, xb, yb), margin in zip(walls, margins, strict=True):
        apart = hypot((xa + xb) / 2 - middle[0], (ya + yb) / 2 - middle[1])
        if apart <= (hypot(xb - xa, yb - ya) + width) / 2 + s.r_robot + margin:
            near.append((xa, ya, xb, yb, margin))
    if not near:
        return True
    *ends, margin_of = np.array(near).T[:, :, None]
    distances = segment_formula(x + along[0] * _ALONG, y + along[1] * _ALONG, *ends)
    return bool((barrier(distances, s.r_robot, margin_of) >= 0).all())


def _cross(u: tuple[float, float], v: tuple[float, float]) -> float:
    return u[0] * v[1] - u[1] * v[0]
