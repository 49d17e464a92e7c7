"""What moves a zone most: each parameter of the method varied alone, the others at their defaults."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np
import pandas as pd

from ..encounters.finding import find_encounters
from ..encounters.geometry import Area
from ..encounters.near_rows import select_near_rows
from ..errors import DataError, DataWarning, ZoneError
from .social_zone import SocialZone

SEARCH: Mapping[str, Sequence[Any]] = MappingProxyType(
    {
        "min_distance": (0.0, 0.5, 2.0),
        "min_speed": (0.2, 0.6),
        "duration": (2.0, 4.0),
        "kinds": ("strangers", ("opposite", "crossing")),
    }
)
"""Values of `szlib.find_encounters`, beside its defaults."""
FIT: Mapping[str, Sequence[Any]] = MappingProxyType(
    {"r_max": (1.5, 2.5), "fraction": (0.0, 0.002, 0.01), "n_neighbours": (10, 50)}
)
"""Values of `szlib.SocialZone.fit`, beside its defaults."""
SPEEDS = (0.9, 1.3)
"""Speeds, beside the one looked at [m/s]."""
NARROWER = 1.0
"""By so much the square is made narrower on each side [m]."""


def sensitivity(
    tracks: pd.DataFrame,
    *,
    square: Area,
    speed: float = 1.1,
    method: str = "hull",
    fit: Mapping[str, Sequence[Any]] = FIT,
) -> pd.DataFrame:
    """The zone at a speed [m/s] with each parameter varied alone.

    Parameters
    ----------
    tracks, square : as for `szlib.find_encounters`.
    fit : keywords of `SocialZone.fit` to vary, and their values; those of the search are `SEARCH`.
    method : of every fit.

    Returns
    -------
    One row a variation, the first with every default: parameter, value, encounters, a, b [m], area [m2]
    (NaN where there is no zone).

    Raises
    ------
    ZoneError : there is no zone with the defaults.
    """
    rows: list[tuple[str, str, int, float, float, float]] = []

    def add(parameter: str, value: Any, samples: pd.DataFrame, at: float = speed, **keywords: Any) -> None:
        """One row: the zone of these samples at this speed."""
        count, sizes = int(samples["encounter"].nunique()), (np.nan, np.nan, np.nan)
        try:
            with warnings.catch_warnings():  # few encounters, told by their number here
                warnings.simplefilter("ignore", DataWarning)
                zone = SocialZone.fit(samples, speeds=(at,), method=method, n_resamples=0, **keywords)
            ellipse = zone.ellipses[at]
            sizes = (*ellipse.semi_axes, ellipse.area)
        except (ZoneError, DataError):
            if not rows:
                raise
        text = ", ".join(value) if isinstance(value, tuple) else str(value)
        rows.append((parameter, text, count, *sizes))

    tracks = select_near_rows(tracks, square, max(SEARCH["duration"]))  # searched many times
    usual = find_encounters(tracks, square=square)
    add("default", "", usual)
    for name, values in SEARCH.items():
        for value in values:
            add(name, value, find_encounters(tracks, square=square, **{name: value}))
    smaller = square.grown(-NARROWER)
    add("square", f"{NARROWER:g} m narrower", find_encounters(tracks, square=smaller))
    for name, values in fit.items():
        for value in values:
            add(name, value, usual, **{name: value})
    for value in SPEEDS:
        add("speed", value, usual, at=value)
    return pd.DataFrame(rows, columns=["parameter", "value", "encounters", "a", "b", "area"])
