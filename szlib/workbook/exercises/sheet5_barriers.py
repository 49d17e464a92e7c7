"""Sheet 5, barriers: distances to a zone and to a wall, the barrier row, the margin at the end of a wall."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...control.barriers import barrier, cbf_residual, ellipse_distance, segment_distance
from ...control.distances import euclidean_to_segment, required_margin
from ...zones.ellipses import Ellipse
from .task import Rng, Task, formula


def _around_a_zone(rng: Rng) -> tuple[Any, ...]:
    b = rng.uniform(0.5, 0.8)
    axes = (round(float(b * rng.uniform(1.3, 1.8)), 2), round(float(b), 2))
    return (
        rng.uniform(-3, 3, (5, 2)).round(2),
        rng.uniform(-1, 1, 2).round(2),
        axes,
        round(rng.uniform(0.4, 1.2), 2),
    )


def _focal(points: Any, center: Any, axes: Any, angle: float) -> Any:
    return ellipse_distance(points, Ellipse(center, axes, angle))


def _focal_sum(points: Any, center: Any, axes: Any, angle: float) -> Any:
    return 2 * (_focal(points, center, axes, angle) + axes[0])


def _around_a_wall(rng: Rng) -> tuple[Any, ...]:
    a = rng.uniform(-2, 0, 2).round(2)
    b = (a + rng.uniform(0.8, 2.0, 2)).round(2)
    beside = (a + b) / 2 + 0.3 * (b - a)[::-1] * [1, -1]
    return np.vstack([beside, b + rng.uniform(0.4, 1.5, (3, 2)), rng.uniform(-3, 3, (3, 2))]).round(2), a, b


def _g_and_t(points: Any, a: Any, b: Any) -> tuple[Any, Any]:
    """The signed distance to the line, and the trimming term (paper, eq. 3 and 4)."""
    (dx, dy), length = b - a, np.hypot(*(b - a))
    g = ((points[:, 0] - a[0]) * dy - (points[:, 1] - a[1]) * dx) / length
    return g, ((length / 2) ** 2 - ((points - (a + b) / 2) ** 2).sum(axis=1)) / length


def _trimmed(points: Any, a: Any, b: Any, sign: float) -> Any:
    g, t = _g_and_t(points, a, b)
    return np.sqrt(g**2 + ((np.abs(t) + sign * t) / 2) ** 2)


def _two_distances(rng: Rng) -> tuple[Any, ...]:
    now = round(rng.uniform(0.8, 2.0), 3)
    return now, round(now - rng.uniform(0.01, 0.2), 3), round(rng.uniform(0.03, 0.3), 3), 0.5, 0.05


def _row(now: float, after: float, gamma: float, radius: float, eps: float) -> Any:
    return cbf_residual(barrier(after, radius, eps), barrier(now, radius, eps), gamma)


def _robot_and_wall(rng: Rng) -> tuple[Any, ...]:
    return round(rng.uniform(0.2, 0.6), 2), round(rng.uniform(0.5, 8.0), 2)


TASKS = (
    Task(
        "focal_distance",
        15,
        (
            "Where are the foci? c = sqrt(a^2 - b^2) from the centre, along the longer axis.",
            "On the ellipse the distances to the foci add up to 2 a.",
            "(np.hypot(*(points - fa).T) + np.hypot(*(points - fb).T)) / 2 - a",
        ),
        formula(_around_a_zone, _focal),
        {
            "the half is forgotten: on the ellipse both distances add up to 2 a": lambda p, c, s, t: (
                _focal_sum(p, c, s, t) - s[0]
            ),
            "take away a, the longer semi-axis, not b": lambda p, c, s, t: _focal_sum(p, c, s, t) / 2 - s[1],
            "the foci are not turned: they lie along the direction angle": lambda p, c, s, t: _focal(
                p, c, s, 0.0
            ),
            "this is the level of the ellipse equation, which has no unit": lambda p, c, s, t: (
                Ellipse(c, s, t).level(p) - 1
            ),
            "this is the distance to the centre less a: right for a circle only": lambda p, c, s, t: (
                np.hypot(*(p - c).T) - s[0]
            ),
        },
        unit="m",
    ),
    Task(
        "wall_distance",
        15,
        (
            "Eq. 3: g is the distance to the whole line. Eq. 4: t is positive in the disc around the wall.",
            "(|t| - t) / 2 is 0 in that disc, and -t outside of it.",
            "np.sqrt(g**2 + ((abs(t) - t) / 2) ** 2)",
        ),
        formula(_around_a_wall, segment_distance),
        {
            "this is the distance to the whole line: beyond its ends the wall is trimmed": lambda p, a, b: (
                np.abs(_g_and_t(p, a, b)[0])
            ),
            "the sign in the trimming term is turned around: |t| - t, which is 0 beside the wall": (
                lambda p, a, b: _trimmed(p, a, b, 1.0)
            ),
            "this is the Euclidean distance; asked is the paper's (eq. 5)": euclidean_to_segment,
            "this is the squared distance: the root is forgotten": lambda p, a, b: (
                segment_distance(p, a, b) ** 2
            ),
        },
        unit="m",
    ),
    Task(
        "barrier_row",
        10,
        (
            "First from distances to barriers: h = d - r_robot - eps, now and after the step.",
            "The condition: h_next - h_now >= -gamma h_now. Bring everything to the left.",
            "h_next - (1 - gamma) * h_now",
        ),
        formula(_two_distances, _row),
        {
            "the size of the robot is forgotten: h is d - r_robot - eps, not d": lambda d, e, g, r, m: _row(
                d, e, g, 0.0, 0.0
            ),
            "the margin eps is forgotten: h is d - r_robot - eps": lambda d, e, g, r, m: _row(
                d, e, g, r, 0.0
            ),
            "gamma and 1 - gamma are swapped: a step may use up the share gamma": lambda d, e, g, r, m: _row(
                d, e, 1 - g, r, m
            ),
            "the sign is turned around: what is left over is positive where the step is allowed": (
                lambda d, e, g, r, m: -_row(d, e, g, r, m)
            ),
            "this only asks that the next h is positive; it may not fall faster than by the share gamma": (
                lambda d, e, g, r, m: barrier(e, r, m)
            ),
        },
        unit="m",
    ),
    Task(
        "end_margin",
        20,
        (
            "Stand straight ahead of the end of the wall, at the true distance r: g = 0 there. What is d?",
            "d = -t = (|x - xc|^2 - (L/2)^2) / L with |x - xc| = L/2 + r.",
            "d = r + r^2 / L, so h >= 0 would still allow an overlap if eps were less than r^2 / L.",
        ),
        formula(_robot_and_wall, lambda radius, length: required_margin([(0.0, 0.0), (length, 0.0)], radius)),
        {
            "this is the distance d at the end; the margin is what exceeds the radius": lambda r, n: (
                r + r**2 / n
            ),
            "r / L has no unit; the margin is a length": lambda r, n: r / n,
            "half of it: with |x - xc| = L/2 + r the square has the term L r": lambda r, n: r**2 / (2 * n),
            "this is the paper's margin of 5 cm, whatever the wall": lambda r, n: 0.05,
        },
        unit="m",
    ),
)
