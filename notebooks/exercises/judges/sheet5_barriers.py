"""Sheet 5: distances to a zone and to a wall, the barrier row, the margin at the end of a wall."""

from __future__ import annotations

from typing import Any

import numpy as np

from szlib.control.barriers import barrier, cbf_residual, ellipse_distance, segment_distance
from szlib.control.distances import euclidean_to_segment, required_margin
from szlib.zones.ellipses import Ellipse

from .task import Rng, formula, make_task


def _draw_zone(rng: Rng) -> tuple[Any, ...]:
    b = rng.uniform(0.5, 0.8)
    axes = (round(float(b * rng.uniform(1.3, 1.8)), 2), round(float(b), 2))
    points, center = rng.uniform(-3, 3, (5, 2)).round(2), rng.uniform(-1, 1, 2).round(2)
    return points, center, axes, round(rng.uniform(0.4, 1.2), 2)


def _focal(points: Any, center: Any, axes: Any, angle: float) -> Any:
    return ellipse_distance(points, Ellipse(center, axes, angle))


def _draw_wall(rng: Rng) -> tuple[Any, ...]:
    a = rng.uniform(-2, 0, 2).round(2)
    b = (a + rng.uniform(0.8, 2.0, 2)).round(2)
    beside = (a + b) / 2 + 0.3 * (b - a)[::-1] * [1, -1]
    return np.vstack([beside, b + rng.uniform(0.4, 1.5, (3, 2)), rng.uniform(-3, 3, (3, 2))]).round(2), a, b


def _g_and_t(points: Any, a: Any, b: Any) -> tuple[Any, Any]:
    """The signed distance to the line, and the trimming term (paper, eq. 3 and 4)."""
    (dx, dy), length = b - a, np.hypot(*(b - a))
    g = ((points[:, 0] - a[0]) * dy - (points[:, 1] - a[1]) * dx) / length
    return g, ((length / 2) ** 2 - ((points - (a + b) / 2) ** 2).sum(axis=1)) / length


def _wrong_sign(points: Any, a: Any, b: Any) -> Any:
    g, t = _g_and_t(points, a, b)
    return np.sqrt(g**2 + ((np.abs(t) + t) / 2) ** 2)


def _draw_distances(rng: Rng) -> tuple[Any, ...]:
    now = round(rng.uniform(0.8, 2.0), 3)
    return now, round(now - rng.uniform(0.01, 0.2), 3), round(rng.uniform(0.03, 0.3), 3), 0.5, 0.05


def _row(now: float, after: float, gamma: float, radius: float, eps: float) -> Any:
    return cbf_residual(barrier(after, radius, eps), barrier(now, radius, eps), gamma)


def _draw_robot_and_wall(rng: Rng) -> tuple[Any, ...]:
    return round(rng.uniform(0.2, 0.6), 2), round(rng.uniform(0.5, 8.0), 2)


TASKS = (
    make_task(
        "focal_distance",
        formula(_draw_zone, _focal),
        not_halved=lambda points, center, axes, angle: 2 * _focal(points, center, axes, angle) + axes[0],
        shorter_axis=lambda points, center, axes, angle: (
            _focal(points, center, axes, angle) + axes[0] - axes[1]
        ),
        not_turned=lambda points, center, axes, angle: _focal(points, center, axes, 0.0),
        level=lambda points, center, axes, angle: Ellipse(center, axes, angle).level(points) - 1,
        centre=lambda points, center, axes, angle: np.hypot(*(points - center).T) - axes[0],
    ),
    make_task(
        "wall_distance",
        formula(_draw_wall, segment_distance),
        line=lambda points, a, b: np.abs(_g_and_t(points, a, b)[0]),
        sign=_wrong_sign,
        euclidean=euclidean_to_segment,
        squared=lambda points, a, b: segment_distance(points, a, b) ** 2,
    ),
    make_task(
        "barrier_row",
        formula(_draw_distances, _row),
        no_radius=lambda now, after, gamma, radius, eps: _row(now, after, gamma, 0.0, 0.0),
        no_margin=lambda now, after, gamma, radius, eps: _row(now, after, gamma, radius, 0.0),
        swapped=lambda now, after, gamma, radius, eps: _row(now, after, 1 - gamma, radius, eps),
        sign=lambda now, after, gamma, radius, eps: -_row(now, after, gamma, radius, eps),
        only_next=lambda now, after, gamma, radius, eps: barrier(after, radius, eps),
    ),
    make_task(
        "end_margin",
        formula(_draw_robot_and_wall, lambda radius, length: required_margin([(0, 0), (length, 0)], radius)),
        distance=lambda radius, length: radius + radius**2 / length,
        no_unit=lambda radius, length: radius / length,
        halved=lambda radius, length: radius**2 / (2 * length),
        paper=lambda radius, length: 0.05,
    ),
)
