"""Tasks: distances to a zone and to a wall, the barrier row, the margin at the end of a wall."""

from __future__ import annotations

from typing import Any

import numpy as np

from szlib.control.obstacles import Wall, barrier, cbf_residual, ellipse_distance, segment_distance
from szlib.zones.ellipses import Ellipse

from .task import Args, Rng, make_task, repeat


def _draw_zone(rng: Rng) -> Args:
    b = rng.uniform(0.5, 0.8)
    axes = (round(float(b * rng.uniform(1.3, 1.8)), 2), round(float(b), 2))
    points, center = rng.uniform(-3, 3, (5, 2)).round(2), rng.uniform(-1, 1, 2).round(2)
    return points, center, axes, round(rng.uniform(0.4, 1.2), 2)


def _focal(points: Any, center: Any, axes: Any, angle: float) -> Any:
    return ellipse_distance(points, Ellipse(center, axes, angle))


def _foci_at(c: float, points: Any, center: Any, axes: Any, angle: float) -> Any:
    """The distance with foci at a wrong distance `c` from the centre [m]."""
    offset = c * np.array([np.cos(angle), np.sin(angle)])
    to_foci = [np.hypot(*(points - center - side * offset).T) for side in (1, -1)]
    return (to_foci[0] + to_foci[1]) / 2 - axes[0]


def _draw_wall(rng: Rng) -> Args:
    a = rng.uniform(-2, 0, 2).round(2)
    b = (a + rng.uniform(0.8, 2.0, 2)).round(2)
    beside = (a + b) / 2 + 0.3 * (b - a)[::-1] * [1, -1]
    return np.vstack([beside, b + rng.uniform(0.4, 1.5, (3, 2)), rng.uniform(-3, 3, (3, 2))]).round(2), a, b


def _g_and_t(points: Any, a: Any, b: Any) -> tuple[Any, Any]:
    """The signed distance to the line, and the trimming term (paper, eq. 3 and 4)."""
    (dx, dy), length = b - a, np.hypot(*(b - a))
    g = ((points[:, 0] - a[0]) * dy - (points[:, 1] - a[1]) * dx) / length
    return g, ((length / 2) ** 2 - ((points - (a + b) / 2) ** 2).sum(axis=1)) / length


def _euclidean(points: Any, a: Any, b: Any) -> Any:
    return Wall.gap(*points.T, 0.0, *a, *b)


def _trimmed(g: Any, t: Any, side: int = -1) -> Any:
    return np.sqrt(g**2 + ((np.abs(t) + side * t) / 2) ** 2)


def _wrong_trim(points: Any, a: Any, b: Any, *, side: int = -1, times: float = 1.0) -> Any:
    g, t = _g_and_t(points, a, b)
    return _trimmed(g, times * t, side)


def _draw_distances(rng: Rng) -> Args:
    now, radius, eps = rng.uniform(0.9, 2.0), rng.uniform(0.3, 0.6), rng.uniform(0.02, 0.1)
    after = now - rng.uniform(0.01, 0.2)
    return round(now, 3), round(after, 3), round(rng.uniform(0.03, 0.3), 3), round(radius, 2), round(eps, 2)


def _row(now: float, after: float, gamma: float, radius: float, eps: float) -> Any:
    return cbf_residual(barrier(after, radius, eps), barrier(now, radius, eps), gamma)


def _draw_robot_and_wall(rng: Rng) -> Args:
    return round(rng.uniform(0.2, 0.6), 2), round(rng.uniform(0.5, 8.0), 2)


TASKS = (
    make_task(globals(), "focal_distance", repeat(_draw_zone), solution=_focal),
    make_task(globals(), "wall_distance", repeat(_draw_wall), solution=segment_distance),
    make_task(globals(), "barrier_row", repeat(_draw_distances), solution=_row),
    make_task(
        globals(),
        "end_margin",
        repeat(_draw_robot_and_wall),
        solution=lambda radius, length: radius**2 / length,
    ),
)
