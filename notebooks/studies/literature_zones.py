"""Zones of the literature to compare with the fitted one, and the time that a robot spends in each.

Each zone is an `Ellipse` in the person's frame, made from the fitted one where it depends on it.

Sources: E. T. Hall, "The Hidden Dimension", 1966 (personal distance up to 1.2 m); R. Kirby, R. Simmons,
J. Forlizzi, "COMPANION: A constraint-optimizing method for person-acceptable navigation", RO-MAN 2009
(asymmetric Gaussian).
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache, partial
from math import pi
from typing import Any

import numpy as np
import pandas as pd
from studies.distances import euclidean_to_ellipse

import szlib
from szlib.control.people import as_ellipse
from szlib.core.checks import Array
from szlib.simulation import ZONES as SIMPLE_ZONES
from szlib.simulation import Run
from szlib.zones.ellipses import Ellipse
from szlib.zones.enclosing_ellipse import minimum_enclosing_ellipse_of_curve

HALL_PERSONAL = 1.2
"""Largest personal distance [m] (Hall 1966)."""
KIRBY_SPEED = 0.5
"""Walking speed of Kirby's zone [m/s]: that of the people (paper, sec. 4)."""


def use_hall_circle(fitted: Ellipse) -> Ellipse:
    """Hall's personal distance in place of the `fitted` ellipse."""
    return Ellipse((0.0, 0.0), (HALL_PERSONAL, HALL_PERSONAL))


def use_kirby_ellipse(fitted: Ellipse) -> Ellipse:
    """The smallest ellipse around `kirby_curve` at `KIRBY_SPEED`, in place of the `fitted` ellipse."""
    return _fit_kirby_ellipse()


def kirby_curve(angles: Array, speed: float) -> Array:
    """The one-sigma line of Kirby's asymmetric Gaussian, shape (n, 2) [m].

    Sigma is 2 v ahead, at least 1/2; 2/3 of this to the sides, and 1/2 of it behind.

    Parameters
    ----------
    angles : directions, shape (n,) [rad].
    speed : walking speed v [m/s].
    """
    ahead = max(2 * speed, 0.5)
    x = np.cos(angles)
    y = np.sin(angles)
    return np.column_stack([ahead * np.where(x > 0, x, x / 2), ahead * 2 / 3 * y])


@lru_cache
def _fit_kirby_ellipse() -> Ellipse:
    return minimum_enclosing_ellipse_of_curve(partial(kirby_curve, speed=KIRBY_SPEED), [-pi / 2, pi / 2])


ZONES = {
    "none": SIMPLE_ZONES["none"],
    "equal circle": SIMPLE_ZONES["equal circle"],
    "Hall": use_hall_circle,
    "Kirby": use_kirby_ellipse,
    "fitted": SIMPLE_ZONES["fitted"],
}
"""Zones that the robot keeps out of, by name."""


def measure_time_inside(run: Run) -> dict[str, float]:
    """Time for which the robot's disc of a `run` overlaps a zone of each kind, by Euclidean distance [s].

    The fitted zones are those of the scenario's people, whatever zones the robot keeps out of.  People
    without a zone in the scenario have the one that the robot keeps out of.
    """
    own = [person.zone for person in run.scenario.people] or [None] * len(run.zones)
    fitted = [
        as_ellipse(each or zone, run.settings.zone_speed) for each, zone in zip(own, run.zones, strict=True)
    ]
    inside = {}
    for name, zone in ZONES.items():
        gaps = run.distances_to_zones([zone(each) for each in fitted], euclidean_to_ellipse)
        # NaN, of absent people, is no overlap
        overlaps = (gaps < run.settings.r_robot).any(axis=1)
        inside[f"inside {name}"] = run.settings.dt * float(overlaps.sum())
    return inside


def compare(n: int, *, zones: Iterable[str] = tuple(ZONES), **options: Any) -> pd.DataFrame:
    """Drive through the same n worlds with each combination of methods, as `szlib.compare`.

    Parameters
    ----------
    n : number of worlds.
    zones : names in `ZONES`.
    options : as of `szlib.compare`.

    Returns
    -------
    The rows of `szlib.compare`, with the time in each of `ZONES`.
    """
    named = {name: ZONES[name] for name in zones}
    return szlib.compare(n, zones=named, measure=measure_time_inside, **options)
