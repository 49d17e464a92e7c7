"""The sensitivity of a zone: each parameter of the method varied alone, the others at their defaults."""

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
from .outliers import FRACTION, N_NEIGHBOURS
from .social_zone import SocialZone

# Values of `szlib.find_encounters`, besides its defaults.
SEARCH: Mapping[str, Sequence[Any]] = MappingProxyType(
    {
        "min_distance": (0.0, 0.5, 2.0),
        "min_speed": (0.2, 0.6),
        "duration": (2.0, 4.0),
        "kinds": ("strangers", ("opposite", "crossing")),
    }
)
# Values of `szlib.SocialZone.fit`, besides the paper's.
FIT: Mapping[str, Sequence[Any]] = MappingProxyType(
    {"r_max": (1.5, 2.5), "fraction": (0.0, 0.01), "n_neighbours": (10, 50)}
)
SPEEDS = (0.9, 1.3)
"""Speeds besides `speed` [m/s]."""
NARROWER = 1.0  # the area is made narrower by this on each side [m]


def sensitivity(
    tracks: pd.DataFrame,
    *,
    area: Area,
    has_walls: bool = False,
    speed: float = 1.1,
    method: str = "paper",
    fit: Mapping[str, Sequence[Any]] = FIT,
) -> pd.DataFrame:
    """Fit the zone at one speed with each parameter varied alone.

    Parameters
    ----------
    tracks, area, has_walls : as for `szlib.find_encounters`.
    speed : speed of the zone [m/s].
    method : of every fit, as for `szlib.SocialZone.fit`.
    fit : options of `SocialZone.fit` to vary, and their values. `SEARCH` are those of the search.

    Returns
    -------
    One row for each variation, the first with all defaults: parameter, value, encounters, a, b [m], area [m2]
    (NaN: no zone).

    Raises
    ------
    ZoneError : there is no zone with the defaults.
    """
    usual_fit: dict[str, Any] = {"method": method, "n_resamples": 0}
    if method == "paper":  # whose options are those of the hull
        usual_fit |= {"method": "hull", "fraction": FRACTION, "n_neighbours": N_NEIGHBOURS}
    rows: list[tuple[str, str, int, float, float, float]] = []

    def add(parameter: str, value: Any, samples: pd.DataFrame, at: float = speed, **keywords: Any) -> None:
        """One row: the zone of these samples at this speed."""
        count, sizes = int(samples["encounter"].nunique()), (np.nan, np.nan, np.nan)
        try:
            # The number of encounters is in the table.
            with warnings.catch_warnings(action="ignore", category=DataWarning):
                zone = SocialZone.fit(samples, speeds=(at,), **{**usual_fit, **keywords})
            ellipse = zone.ellipses[at]
            sizes = (*ellipse.semi_axes, ellipse.area)
        except (ZoneError, DataError):
            if not rows:
                raise
        text = ", ".join(value) if isinstance(value, tuple) else str(value)
        rows.append((parameter, text, count, *sizes))

    tracks = select_near_rows(tracks, area, max(SEARCH["duration"]))  # searched many times
    usual = find_encounters(tracks, area=area, has_walls=has_walls)
    add("default", "", usual)
    for name, values in SEARCH.items():
        for value in values:
            add(name, value, find_encounters(tracks, area=area, has_walls=has_walls, **{name: value}))
    smaller = area.grown(-NARROWER)
    add("area", f"{NARROWER:g} m narrower", find_encounters(tracks, area=smaller, has_walls=has_walls))
    for name, values in fit.items():
        for value in values:
            add(name, value, usual, **{name: value})
    for value in SPEEDS:
        add("speed", value, usual, at=value)
    return pd.DataFrame(rows, columns=["parameter", "value", "encounters", "a", "b", "area"])
