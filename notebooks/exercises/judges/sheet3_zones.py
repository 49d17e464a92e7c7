"""Sheet 3: a point of a slice, the zone's radius, the smallest ellipse, a zone of your own."""

from __future__ import annotations

import tempfile
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import shapely

from szlib.encounters.finding import find_encounters
from szlib.plaza.generation import make_plaza
from szlib.plaza.settings import SLOW_INTRUDERS, PlazaSettings
from szlib.tracks.clock import read_tracks
from szlib.zones.ellipses import Ellipse
from szlib.zones.enclosing_ellipse import minimum_enclosing_ellipse
from szlib.zones.hulls import Slice

from .task import Case, Rng, formula, make_task

_TOLERANCE = 0.08  # largest error of the learner's zone, in centre and semi-axes [m]
_SPEED = 1.1  # walking speed of the zone [m/s] (paper, sec. 4)
_R_MAX = 2.0  # paper, sec. 2 [m]
_ORIGIN = shapely.Point(0, 0)


def _draw_edge(rng: Rng) -> tuple[Any, ...]:
    speeds = [rng.uniform(0.5, 0.9), rng.uniform(1.2, 1.6)]
    ends = np.column_stack([rng.uniform(-1, 1, (2, 2)), speeds]).round(2)
    return ends[0], ends[1], round(rng.uniform(0.95, 1.15), 2)


def _crossing(a: Any, b: Any, speed: float) -> Any:
    share = (speed - a[2]) / (b[2] - a[2])
    return a[:2] + share * (b[:2] - a[:2])


def _draw_polygon(rng: Rng) -> tuple[Any, ...]:
    corner = np.radians(np.arange(0, 360, 60) + rng.uniform(5, 55, 6))
    polygon = np.column_stack([1.3 * np.cos(corner), 1.0 * np.sin(corner)]).round(2)
    return polygon, round(rng.uniform(-np.pi, np.pi), 2), _R_MAX


def _reach(polygon: Any, theta: float) -> float:
    return float(Slice(np.asarray(polygon), _SPEED, _R_MAX).reach(theta))


def _nearest_corner(polygon: Any, theta: float) -> float:
    """Distance of the corner nearest to the direction theta [m]."""
    off = np.angle(np.exp(1j * (np.arctan2(polygon[:, 1], polygon[:, 0]) - theta)))
    return float(np.hypot(*polygon[np.abs(off).argmin()]))


def _draw_triangle(rng: Rng) -> tuple[Any, ...]:
    turn = rng.uniform(0, 2 * np.pi) + np.radians([0, 110, 250])
    return ((np.column_stack([np.cos(turn), 0.5 * np.sin(turn)]) + rng.uniform(-1, 1, 2)).round(2),)


def _smallest(triangle: Any) -> float:
    return minimum_enclosing_ellipse(triangle).area


def _circumscribed(triangle: Any) -> float:
    sides = np.prod(np.hypot(*(np.roll(triangle, 1, axis=0) - triangle).T))
    return float(np.pi * (sides / (4 * shapely.Polygon(triangle).area)) ** 2)


@lru_cache(maxsize=2)
def _plaza(seed: int, a: float, b: float) -> tuple[pd.DataFrame, Ellipse]:
    """Samples from a plaza with a random zone, and that zone."""
    slow, fast = (Ellipse((0.05, 0.0), (a + grow, b + grow)) for grow in (-0.04, 0.04))
    settings = PlazaSettings(
        n_encounters=800, slow_zone=slow, fast_zone=fast, intruders=0.01, intruder_speeds=SLOW_INTRUDERS
    )
    with tempfile.TemporaryDirectory() as folder:
        file = make_plaza(Path(folder) / "plaza.csv", seed=seed, settings=settings)
        return find_encounters(read_tracks(file)), settings.true_zone(_SPEED)


def _draw_plaza(rng: Rng) -> Case:
    b = round(rng.uniform(0.64, 0.76), 2)
    samples, zone = _plaza(int(rng.integers(2**31)), round(b + rng.uniform(0.18, 0.24), 2), b)
    return (samples,), zone


def _judge_zone(_: tuple[Any, ...], truth: Ellipse, got: Any) -> str:
    """Accept an ellipse whose centre and semi-axes are near those of the true zone."""
    if not isinstance(got, Ellipse):
        return f"expected a szlib.Ellipse in the person's frame; got {type(got).__name__}"
    (a, b), (true_a, true_b) = got.semi_axes, truth.semi_axes
    off = np.subtract([*got.center, a, b], [*truth.center, true_a, true_b])
    if np.abs(off).max() <= _TOLERANCE:
        return ""
    found = f"semi-axes {a:.2f} x {b:.2f} m, off by {off[2]:+.2f} and {off[3]:+.2f} m"
    if abs(got.angle) > np.pi / 4 and min(off[2:]) > 0:  # r_max - R' is long where R' is short
        return f"{found}: this is an ellipse around the slice; map to r_max - R' first, then enclose"
    if max(off[2:]) < 0:
        return f"{found}: too small; a few people walk through zones, and must not determine yours"
    if min(off[2:]) > 0:
        return f"{found}: too large; most people keep farther away than the zone"
    return f"{found}, centre off by {off[0]:+.2f} and {off[1]:+.2f} m; at most {_TOLERANCE} m is allowed"


TASKS = (
    make_task(
        "crossing",
        formula(_draw_edge, _crossing),
        middle=lambda a, b, speed: (a + b)[:2] / 2,
        wrong_end=lambda a, b, speed: _crossing(b, a, a[2] + b[2] - speed),
        nearest_end=lambda a, b, speed: min(a, b, key=lambda end: abs(speed - end[2]))[:2],
    ),
    make_task(
        "zone_radius",
        formula(_draw_polygon, lambda polygon, theta, r_max: r_max - _reach(polygon, theta)),
        reach=lambda polygon, theta, r_max: _reach(polygon, theta),
        corner=lambda polygon, theta, r_max: r_max - _nearest_corner(polygon, theta),
        any_direction=lambda polygon, theta, r_max: r_max - shapely.LinearRing(polygon).distance(_ORIGIN),
        degrees=lambda polygon, theta, r_max: r_max - _reach(polygon, np.radians(theta)),
    ),
    make_task(
        "triangle_ellipse",
        formula(_draw_triangle, _smallest),
        circle=_circumscribed,
        triangle=lambda triangle: shapely.Polygon(triangle).area,
        inside=lambda triangle: _smallest(triangle) / 4,
        box=lambda triangle: np.pi / 4 * float(np.prod(np.ptp(triangle, axis=0))),
    ),
    make_task("my_zone", _draw_plaza, judge=_judge_zone),
)
