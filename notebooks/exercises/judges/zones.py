"""Tasks: a point of a slice, the zone's radius, the smallest ellipse, a zone of your own."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
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

from .answers import Other
from .task import Args, Rng, make_task, repeat

_TOLERANCE, _TURN = (0.10, 0.2)  # largest error of the learner's zone: centre, semi-axes [m]; angle [rad]
_SPEED = 1.1  # walking speed of a slice [m/s] (paper, sec. 4)
_R_MAX = 2.0  # paper, sec. 2 [m]
_WIDTHS = ((0.5, 0.58), (0.85, 0.92))  # shorter semi-axes of a narrow and of a wide zone [m]
_EXTRAS = ((0.0, 0.04), (0.46, 0.5))  # by which the longer semi-axis is longer: round and long zones [m]
_SPEEDS = ((0.7, 0.8), (1.25, 1.35))  # walking speeds of the zone that is asked for [m/s]
_GROWTH = 0.24  # of each semi-axis for each 1 m/s of speed, up or down [s]
_ORIGIN = shapely.Point(0, 0)


def _draw_edge(rng: Rng) -> Args:
    speeds = [rng.uniform(0.5, 0.9), rng.uniform(1.2, 1.6)]
    share = 0.5 + rng.uniform(0.1, 0.3) * rng.choice([-1, 1])  # nearer to one end than to the other
    ends = np.column_stack([rng.uniform(-1, 1, (2, 2)), speeds]).round(2)
    return ends[0], ends[1], round(speeds[0] + share * (speeds[1] - speeds[0]), 2)


def _at_share(a: Any, b: Any, share: float) -> Any:
    return (a + share * (b - a))[:2]


def _crossing(a: Any, b: Any, speed: float) -> Any:
    return _at_share(a, b, (speed - a[2]) / (b[2] - a[2]))


def _draw_polygon(rng: Rng) -> Args:
    corner = np.radians(np.arange(0, 360, 60) + rng.uniform(5, 55, 6))
    polygon = np.column_stack([1.3 * np.cos(corner), 1.0 * np.sin(corner)]).round(2)
    return (polygon, round(rng.uniform(-np.pi, np.pi), 2), round(_R_MAX + rng.uniform(-0.2, 0.5), 1))


def _reach(polygon: Any, theta: float) -> float:
    return float(Slice(np.asarray(polygon), _SPEED, _R_MAX).reach(theta))


def _nearest_corner(polygon: Any, theta: float) -> float:
    """Distance of the corner nearest to the direction theta [m]."""
    off = np.angle(np.exp(1j * (np.arctan2(polygon[:, 1], polygon[:, 0]) - theta)))
    return float(np.hypot(*polygon[np.abs(off).argmin()]))


def _draw_triangle(rng: Rng) -> Args:
    turn = rng.uniform(0, 2 * np.pi) + np.radians([0, 110, 250])
    return ((np.column_stack([np.cos(turn), 0.5 * np.sin(turn)]) + rng.uniform(-1, 1, 2)).round(2),)


def _smallest(triangle: Any) -> float:
    return minimum_enclosing_ellipse(triangle).area


def _sides(triangle: Any) -> Any:
    return np.hypot(*(np.roll(triangle, 1, axis=0) - triangle).T)


def _circumscribed(triangle: Any) -> float:
    return float(np.pi * (np.prod(_sides(triangle)) / (4 * shapely.Polygon(triangle).area)) ** 2)


@lru_cache(maxsize=4)
def _plaza(seed: int, zone: Ellipse, speed: float, growth: float) -> tuple[pd.DataFrame, float, Ellipse]:
    """Samples from a plaza where people who walk at `speed` have the `zone`, the speed, and the zone."""

    def at(other: float) -> Ellipse:
        axes = np.add(zone.semi_axes, growth * (other - speed))
        return Ellipse(zone.center, (axes[0], axes[1]), zone.angle)

    settings = PlazaSettings(
        n_encounters=1500,
        slow_zone=at(0.5),
        fast_zone=at(1.5),
        intruders=0.01,
        intruder_speeds=SLOW_INTRUDERS,
    )
    with tempfile.TemporaryDirectory() as folder:
        file = make_plaza(Path(folder) / "plaza.csv", seed=seed, settings=settings)
        return find_encounters(read_tracks(file)), speed, settings.true_zone(speed)


def _draw_plazas(rng: Rng) -> Iterator[Args]:
    """A narrow and a wide zone, a round and a long one; centre, angle, speed and growth for themselves.

    Semi-axes that differ by 0.46 m or by nothing: no fixed difference is within the tolerance of both.
    """
    kinds = [(0, 0), (1, 1), (0, 1), (1, 0)]
    for narrow, long in rng.permutation([kinds[0], kinds[1], kinds[int(rng.integers(2, 4))]]):
        b, extra = rng.uniform(*_WIDTHS[narrow]), rng.uniform(*_EXTRAS[long])
        angle = rng.uniform(0.28, 0.36) * rng.choice([-1, 1])
        zone = Ellipse(
            (round(rng.uniform(0, 0.06), 2), 0.0), (round(b + extra, 2), round(b, 2)), round(angle, 2)
        )
        speed = round(rng.uniform(*_SPEEDS[int(rng.integers(2))]), 2)
        yield _plaza(int(rng.integers(2**31)), zone, speed, _GROWTH * int(rng.choice([-1, 1])))


def _judge_zone(args: Args, got: Any) -> str:
    """Accept an ellipse whose centre and semi-axes are near those of the true zone."""
    if not isinstance(got, Ellipse):
        kind = got.kind if isinstance(got, Other) else type(got).__name__
        return f"expected a szlib.Ellipse in the person's frame; got {kind}"
    truth = args[-1]
    (a, b), (true_a, true_b) = got.semi_axes, truth.semi_axes
    off = np.subtract([*got.center, a, b], [*truth.center, true_a, true_b])
    turn = abs(float(np.arctan(np.tan(got.angle - truth.angle))))
    if np.abs(off).max() <= _TOLERANCE:
        is_turned = true_a - true_b > 0.3 and turn > _TURN
        return f"the angle is off by {turn:.2f} rad; at most {_TURN} rad is allowed" if is_turned else ""
    found = f"semi-axes {a:.2f} x {b:.2f} m, off by {off[2]:+.2f} and {off[3]:+.2f} m"
    if np.hypot(a - (_R_MAX - true_b), b - (_R_MAX - true_a)) < 0.2:
        return f"{found}: this is an ellipse around the slice; map to r_max - R' first, then enclose"
    if a * b < 0.9 * true_a * true_b:
        return f"{found}: too small; a few people walk through zones, and must not determine yours"
    if a * b > 1.1 * true_a * true_b:
        return f"{found}: too large; most people keep farther away than the zone"
    return f"{found}, centre off by {off[0]:+.2f} and {off[1]:+.2f} m; at most {_TOLERANCE} m is allowed"


TASKS = (
    make_task(globals(), "crossing", repeat(_draw_edge), solution=_crossing),
    make_task(
        globals(),
        "zone_radius",
        repeat(_draw_polygon),
        solution=lambda polygon, theta, r_max: r_max - _reach(polygon, theta),
    ),
    make_task(globals(), "triangle_ellipse", repeat(_draw_triangle), solution=_smallest),
    make_task(
        globals(),
        "my_zone",
        _draw_plazas,
        judge=_judge_zone,
        hidden=1,
        allowed=("szlib.zones.ellipses",),
        seconds=60.0,
    ),
)
