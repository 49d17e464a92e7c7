"""Sheet 3, from samples to a zone: a slice by hand, its zone, the smallest ellipse, a zone of your own."""

from __future__ import annotations

import tempfile
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from ...encounters.finding import find_encounters
from ...plaza.generation import make_plaza
from ...plaza.settings import SLOW_INTRUDERS, PlazaSettings
from ...tracks.clock import read_tracks
from ...zones.ellipses import Ellipse
from ...zones.enclosing_ellipse import minimum_enclosing_ellipse
from ...zones.hulls import Slice
from .task import Case, Rng, Task, formula

CLOSE_ENOUGH = 0.08
"""A zone of one's own may be off by that, in centre and semi-axes [m]."""
SPEED = 1.1
"""Walking speed whose zone is sought [m/s] (paper, sec. 4)."""
_R_MAX = 2.0  # paper, sec. 2 [m]
_PAIRS = 800  # of people on a fresh plaza: few enough to wait for


def _edge(rng: Rng) -> tuple[Any, ...]:
    speeds = [rng.uniform(0.5, 0.9), rng.uniform(1.2, 1.6)]
    ends = np.column_stack([rng.uniform(-1, 1, (2, 2)), speeds]).round(2)
    return ends[0], ends[1], round(rng.uniform(0.95, 1.15), 2)


def _crossing(a: Any, b: Any, speed: float) -> Any:
    share = (speed - a[2]) / (b[2] - a[2])
    return a[:2] + share * (b[:2] - a[:2])


def _section(rng: Rng) -> tuple[Any, ...]:
    corner = np.radians(np.arange(0, 360, 60) + rng.uniform(5, 55, 6))
    polygon = np.column_stack([1.3 * np.cos(corner), 1.0 * np.sin(corner)]).round(2)
    return polygon, round(rng.uniform(-np.pi, np.pi), 2), _R_MAX


def _reach(polygon: Any, theta: float) -> float:
    return float(Slice(np.asarray(polygon), SPEED, _R_MAX).reach(theta))


def _nearest_edge(polygon: Any) -> float:
    """The distance from the origin to the nearest of the polygon's edges' lines [m]."""
    along = np.roll(polygon, -1, axis=0) - polygon
    doubled = np.abs(polygon[:, 0] * along[:, 1] - polygon[:, 1] * along[:, 0])
    return float((doubled / np.hypot(*along.T)).min())


def _nearest_corner(polygon: Any, theta: float) -> float:
    """The distance of the corner nearest to a direction [m]."""
    off = np.angle(np.exp(1j * (np.arctan2(polygon[:, 1], polygon[:, 0]) - theta)))
    return float(np.hypot(*polygon[np.abs(off).argmin()]))


def _triangle(rng: Rng) -> tuple[Any, ...]:
    turn = rng.uniform(0, 2 * np.pi) + np.radians([0, 110, 250])
    return ((np.column_stack([np.cos(turn), 0.5 * np.sin(turn)]) + rng.uniform(-1, 1, 2)).round(2),)


def _area(triangle: Any) -> float:
    (ax, ay), (bx, by) = triangle[1:] - triangle[0]
    return float(abs(ax * by - ay * bx) / 2)


def _smallest(triangle: Any) -> float:
    return minimum_enclosing_ellipse(triangle).area


def _circumscribed(triangle: Any) -> float:
    sides = np.prod(np.hypot(*(np.roll(triangle, 1, axis=0) - triangle).T))
    return float(np.pi * (sides / (4 * _area(triangle))) ** 2)


@lru_cache(maxsize=2)
def _plaza(seed: int, a: float, b: float) -> tuple[pd.DataFrame, Ellipse]:
    """What people did on a plaza whose zone nobody knows, and that zone."""
    slow, fast = (Ellipse((0.05, 0.0), (a + grow, b + grow)) for grow in (-0.04, 0.04))
    settings = PlazaSettings(encounters=_PAIRS, slow=slow, fast=fast, intruders=0.01, pace=SLOW_INTRUDERS)
    with tempfile.TemporaryDirectory() as folder:
        file = make_plaza(Path(folder) / "plaza.csv", seed=seed, settings=settings)
        return find_encounters(read_tracks(file)), settings.true_zone(SPEED)


def _strangers(rng: Rng) -> Case:
    b = round(rng.uniform(0.64, 0.76), 2)
    samples, zone = _plaza(int(rng.integers(2**31)), round(b + rng.uniform(0.18, 0.24), 2), b)
    return (samples,), zone


def _near_the_truth(_: tuple[Any, ...], truth: Ellipse, got: Any) -> str:
    if not isinstance(got, Ellipse):
        return f"expected a szlib.Ellipse in the person's frame; got {type(got).__name__}"
    (a, b), (true_a, true_b) = got.semi_axes, truth.semi_axes
    off = np.subtract([*got.center, a, b], [*truth.center, true_a, true_b])
    if np.abs(off).max() <= CLOSE_ENOUGH:
        return ""
    told = f"semi-axes {a:.2f} x {b:.2f} m, off by {off[2]:+.2f} and {off[3]:+.2f} m"
    if abs(got.angle) > np.pi / 4 and min(off[2:]) > 0:  # r_max - R' is long where R' is short
        return f"{told}: this is an ellipse around the slice; map to r_max - R' first, enclose second"
    if max(off[2:]) < 0:
        return f"{told}: too small; a few people walk right through zones, and may not set yours"
    if min(off[2:]) > 0:
        return f"{told}: too large; most people keep farther away than they must"
    return f"{told}, centre off by {off[0]:+.2f} and {off[1]:+.2f} m; allowed are {CLOSE_ENOUGH} m"


def _by_share(samples: pd.DataFrame, share: float, complement: bool = False) -> Ellipse:
    """An ellipse along the axes, at that quantile of the approaches ahead, behind and to the sides."""
    close = samples[(samples["distance"] <= _R_MAX) & (samples["speed"] - SPEED).abs().le(0.2)]
    turn = np.radians([0, 90, 180, -90])
    off = np.angle(np.exp(1j * (close["los_angle"].to_numpy()[:, None] - turn)))
    radii = []
    for side in (np.abs(off) < np.radians(15)).T:
        approach = close[side].groupby("encounter")["distance"].min()
        radii.append(float(np.quantile(approach, share)))
    ahead, left, behind, right = (_R_MAX - r if complement else r for r in radii)
    a, b = sorted([(ahead + behind) / 2, (left + right) / 2], reverse=True)
    return Ellipse(((ahead - behind) / 2, (left - right) / 2), (a, b), np.pi / 2 if complement else 0.0)


TASKS = (
    Task(
        "crossing",
        10,
        (
            "On its way from a to b the edge goes evenly through all speeds between theirs.",
            "What share of the way has it gone when its speed is the one asked for?",
            "share = (speed - a[2]) / (b[2] - a[2]); the point is a[:2] + share * (b[:2] - a[:2])",
        ),
        formula(_edge, _crossing),
        {
            "this is the middle of the edge; its share of the way depends on the speed": lambda a, b, v: (
                (a + b)[:2] / 2
            ),
            "the share is taken from the wrong end": lambda a, b, v: _crossing(b, a, a[2] + b[2] - v),
            "this is the end that is nearer in speed; the plane cuts between the two": lambda a, b, v: (
                a if abs(v - a[2]) < abs(v - b[2]) else b
            )[:2],
        },
        unit="m",
    ),
    Task(
        "zone_radius",
        25,
        (
            "Follow the ray from the origin in the direction theta. Which edge does it leave the polygon by?",
            "Each edge lies on a line n . p = d, n its outward normal. The ray along u meets it "
            "at d / (n . u), if n . u > 0.",
            "R' is the smallest of these; the zone reaches r_max - R'.",
        ),
        formula(_section, lambda polygon, theta, r_max: r_max - _reach(polygon, theta)),
        {
            "this is R', how far the slice reaches; the zone is what is left to r_max": lambda p, t, r: (
                _reach(p, t)
            ),
            "this is the distance of a corner; the ray meets an edge between two of them": lambda p, t, r: (
                r - _nearest_corner(p, t)
            ),
            "this is the nearest edge in any direction; follow the direction theta": lambda p, t, r: (
                r - _nearest_edge(p)
            ),
            "theta is in radians already: do not convert it": lambda p, t, r: r - _reach(p, np.radians(t)),
        },
        unit="m",
    ),
    Task(
        "triangle_ellipse",
        20,
        (
            "Of an equilateral triangle the smallest ellipse is a circle. How do their areas compare?",
            "Stretching the plane changes all areas by the same factor, and makes any triangle of any other.",
            "So the ratio is always that of a circle to its equilateral triangle: 4 pi / (3 sqrt(3)).",
        ),
        formula(_triangle, _smallest),
        {
            "this is the circle through the three corners; an ellipse can be smaller": _circumscribed,
            "this is the area of the triangle; the ellipse around it is larger": _area,
            "this is the largest ellipse inside the triangle, a quarter of what is asked": lambda t: (
                _smallest(t) / 4
            ),
            "this is the ellipse in the box around the triangle; it leaves corners outside": lambda t: (
                np.pi / 4 * float(np.prod(np.ptp(t, axis=0)))
            ),
        },
        unit="m2",
    ),
    Task(
        "my_zone",
        150,
        (
            "In each direction: how near did people come, encounter by encounter? A few may come nearer.",
            "Take speeds of 0.9 to 1.3 m/s, sectors of 30 degrees, in each the 5 % quantile of the "
            "nearest approaches of the encounters: points of the zone's edge.",
            "Through these points p x^2 + q x y + r y^2 + s x + t y = 1 by np.linalg.lstsq; the centre "
            "is where the gradient vanishes, the axes come from np.linalg.eigh.",
        ),
        _strangers,
        {
            "expected a szlib.Ellipse": lambda samples: 1.0,
            "too small; a few people walk right through": lambda samples: _by_share(samples, 0.0),
            "too large; most people keep farther away": lambda samples: _by_share(samples, 0.4),
            "this is an ellipse around the slice": lambda samples: _by_share(samples, 0.05, complement=True),
        },
        judge=_near_the_truth,
        cases=1,
    ),
)
