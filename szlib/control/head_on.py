"""People whom the robot meets head-on: on which side it passes them."""

from __future__ import annotations

from collections.abc import Sequence
from math import acos, atan2, cos, hypot, inf, sin, sqrt

import numpy as np

from .barriers import barrier, compute_h
from .person import PlacedZone
from .settings import MPCSettings

# Where free space is looked for, from the zone's centre to where the robot passes.
_ALONG = np.linspace(0, 1, 20)
_Walls = Sequence[Sequence[float]]


def find_target(
    position: tuple[float, float],
    goal: tuple[float, float],
    zones: Sequence[PlacedZone],
    walls: _Walls,
    settings: MPCSettings,
) -> tuple[float, float]:
    """Find the point that attracts the plan [m]: the goal, or one beside a person who is met head-on.

    Parameters
    ----------
    position, goal : (x, y) of the robot and of its goal [m].
    zones : the zone of each person, in the world.
    walls : end points and margin of each wall, (xa, ya, xb, yb, margin) [m].
    settings : `head_on_share`, `pass_side`, and what the barriers need.

    Notes
    -----
    A person blocks the way if the line to the goal enters the set h < 0, itself an ellipse with the foci of
    the zone. Its two tangents from the robot lie at the angles +-w about -grad h, the bisector of the
    directions to the foci (this holds for all confocal ellipses). Let the goal lie at the angle b from there.
    At b = 0 both ways around are equally long, the optimum is to stand still in front of the person, and
    every solver stays there for ever. So for |b| <= share * w, with share = `head_on_share`, the target lies
    along the tangent on `pass_side`, as far away as the goal. Once the robot is on that side, the target
    turns back to the goal between |b| = share * w and 2 share * w, without a jump. If a wall leaves no space
    beside the person on that side, the same holds for the other side. If there is no space at all, the
    target stays the goal, and the robot yields. The paper has no such rule.

    The rule holds only if the barrier is active now, h <= closing speed * dt / gamma, or may become so
    within the horizon, h <= closing speed * horizon. (With the first condition alone and gamma > 1/N, the
    slightest tilt of the zone would decide the side before this rule does.) It does not hold for people who
    walk across the way, because they clear it themselves, nor for a person who stands on the goal. The
    nearest person counts.
    """
    s = settings
    (x, y), way = position, (goal[0] - position[0], goal[1] - position[1])
    distance = hypot(*way)
    if distance == 0 or s.head_on_share == 0:
        return goal
    nearest, target = inf, goal
    for zone in zones:
        speed = hypot(zone.vx, zone.vy)
        if (
            abs(way[0] * zone.vy - way[1] * zone.vx)
            > s.head_on_share * speed * distance
        ):
            continue
        h, closing = (
            barrier(zone.distance(x, y), s.r_robot, s.eps),
            (s.v_max + speed) * s.dt,
        )
        if h > min(
            nearest, distance, max(closing / s.gamma, closing * sum(s.step_lengths))
        ):
            continue
        angles = _find_angles(zone, position, way, s)
        if angles is None:
            continue
        nearest, target = h, goal
        turn = _find_turn(zone, goal, way, *angles, walls, s)
        if turn is not None:
            c, d = cos(turn), sin(turn)
            target = (x + c * way[0] - d * way[1], y + d * way[0] + c * way[1])
    return target


def _find_angles(
    zone: PlacedZone,
    position: tuple[float, float],
    way: tuple[float, float],
    s: MPCSettings,
) -> tuple[float, float] | None:
    """w, half the angle between the tangents, and b, that of the way from their middle; None on a focus."""
    x, y = position
    to_a, to_b = (zone.xa - x, zone.ya - y), (zone.xb - x, zone.yb - y)
    ra, rb = hypot(*to_a), hypot(*to_b)
    if ra * rb == 0:
        return None
    inward = (to_a[0] / ra + to_b[0] / rb, to_a[1] / ra + to_b[1] / rb)
    cosine = (ra**2 + rb**2 - 4 * _unsafe_semi_axis(zone, s) ** 2) / (2 * ra * rb)
    w = acos(max(-1.0, min(1.0, cosine))) / 2
    return w, atan2(_cross(inward, way), inward[0] * way[0] + inward[1] * way[1])


def _find_turn(
    zone: PlacedZone,
    goal: tuple[float, float],
    way: tuple[float, float],
    w: float,
    b: float,
    walls: _Walls,
    s: MPCSettings,
) -> float | None:
    """Angle by which the way is turned to a free side, `pass_side` first [rad]; None if it is not turned."""
    if s.head_on_share * w == 0:
        return None
    for left in (s.pass_side == "left", s.pass_side != "left"):
        lead = (b if left else -b) / (s.head_on_share * w)
        if not -1 <= lead < 2:
            continue
        if _is_side_free(zone, way, left, walls, s) and not zone.blocks(goal, s):
            return ((w if left else -w) - b) * min(1.0, 2 - lead)
    return None


def _unsafe_semi_axis(zone: PlacedZone, s: MPCSettings) -> float:
    """Semi-major axis of the set h < 0 [m]."""
    return zone.a + s.r_robot + s.eps


def _is_side_free(
    zone: PlacedZone,
    way: tuple[float, float],
    left: bool,
    walls: _Walls,
    s: MPCSettings,
) -> bool:
    """True if no wall stands between the zone's centre and where the robot passes on that side.

    The approximate distance to a wall is never below the Euclidean one, so walls far away are skipped.
    """
    if not walls:
        return True
    length = hypot(*way) if left else -hypot(*way)
    beside = (-way[1] / length, way[0] / length)
    half = ((zone.xa - zone.xb) / 2, (zone.ya - zone.yb) / 2)
    width = sqrt(_unsafe_semi_axis(zone, s) ** 2 - _cross(half, beside) ** 2)
    along = width * beside[0], width * beside[1]
    x, y = (zone.xa + zone.xb) / 2, (zone.ya + zone.yb) / 2
    middle, near = (x + along[0] / 2, y + along[1] / 2), []
    for wall in walls:
        xa, ya, xb, yb, margin = wall
        offset = hypot((xa + xb) / 2 - middle[0], (ya + yb) / 2 - middle[1])
        if offset <= (hypot(xb - xa, yb - ya) + width) / 2 + s.r_robot + margin:
            near.append(wall)
    points = x + along[0] * _ALONG, y + along[1] * _ALONG
    return all(
        bool((h >= 0).all())
        for h in compute_h(*points, (), near, r_robot=s.r_robot, eps=s.eps)
    )


def _cross(u: tuple[float, float], v: tuple[float, float]) -> float:
    return u[0] * v[1] - u[1] * v[0]
