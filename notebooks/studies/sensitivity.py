"""The sensitivity of a zone: each parameter of the method varied alone, the others at their defaults."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
import pandas as pd

from szlib.core.errors import DataError, DataWarning, ZoneError
from szlib.encounters.finding import find_encounters
from szlib.encounters.geometry import Area
from szlib.zones.outliers import FRACTION, N_NEIGHBOURS
from szlib.zones.social_zone import SocialZone

# Values of `szlib.find_encounters`, besides its defaults.
SEARCH: Mapping[str, Sequence[Any]] = {
    "min_distance": (0.0, 0.5, 2.0),
    "min_speed": (0.2, 0.6),
    "duration": (2.0, 4.0),
    "kinds": ("strangers", ("opposite", "crossing")),
}
# Values of `szlib.SocialZone.fit`, besides the paper's.
FIT: Mapping[str, Sequence[Any]] = {
    "r_max": (1.5, 2.5), "fraction": (0.0, 0.01), "n_neighbours": (10, 50)
}  # fmt: skip
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
    usual: dict[str, Any] = {"method": method, "speeds": (speed,), "n_resamples": 0}
    if method == "paper":  # whose options are those of the hull
        usual |= {"method": "hull", "fraction": FRACTION, "n_neighbours": N_NEIGHBOURS}
    rows: list[tuple[Any, ...]] = []
    for parameter, value, samples, options in _variations(tracks, area, has_walls, fit):
        sizes: tuple[float, ...] = (np.nan, np.nan, np.nan)
        try:
            # The number of encounters is in the table.
            with warnings.catch_warnings(action="ignore", category=DataWarning):
                (ellipse,) = SocialZone.fit(samples, **(usual | options)).ellipses.values()
            sizes = (*ellipse.semi_axes, ellipse.area)
        except (ZoneError, DataError):
            if not rows:
                raise
        text = ", ".join(value) if isinstance(value, tuple) else str(value)
        rows.append((parameter, text, samples["encounter"].nunique(), *sizes))
    return pd.DataFrame(rows, columns=["parameter", "value", "encounters", "a", "b", "area"])


def _variations(
    tracks: pd.DataFrame, area: Area, has_walls: bool, fit: Mapping[str, Sequence[Any]]
) -> Iterator[tuple[str, Any, pd.DataFrame, dict[str, Any]]]:
    """Parameter, value, samples and options of the fit, for each variation."""
    search = partial(find_encounters, tracks)
    samples = search(area=area, has_walls=has_walls)
    yield "default", "", samples, {}
    for name, values in SEARCH.items():
        for value in values:
            yield (
                name,
                value,
                search(area=area, has_walls=has_walls, **{name: value}),
                {},
            )
    smaller = search(area=area.grown(-NARROWER), has_walls=has_walls)
    yield "area", f"{NARROWER:g} m narrower", smaller, {}
    for name, values in fit.items():
        yield from ((name, value, samples, {name: value}) for value in values)
    yield from (("speed", value, samples, {"speeds": (value,)}) for value in SPEEDS)
