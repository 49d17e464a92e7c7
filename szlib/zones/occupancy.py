"""The pair correlation: how often people were at each place, divided by its null model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd
from scipy.ndimage import gaussian_filter

from ..core.checks import Array, check_columns
from ..core.errors import ZoneError
from ..encounters.null_model import NullEncounters

_N_DISTANCES, _N_DIRECTIONS = 80, 36
# standard deviations of the Gaussians that smooth the map of g [deg, m]
_BLUR = (15.0, 0.1)


@dataclass(frozen=True, eq=False)
class PairCorrelation:
    """A smooth map of the frequency of people, relative to the null model.

    Parameters
    ----------
    distance, direction : centres of the cells [m], (n,), and [rad], (m,).
    g : shape (m, n): 1 where people are as frequent as in the null model; NaN where the null model has none.

    Examples
    --------
    >>> import numpy as np
    >>> import szlib
    >>> szlib.PairCorrelation(np.array([0.5, 1.0]), np.array([0.0]), np.array([[0.1, 1.0]])).g.shape
    (1, 2)
    """

    distance: Array
    direction: Array
    g: Array


def pair_correlation(samples: pd.DataFrame, null: NullEncounters) -> PairCorrelation:
    """Compute the map of the pair correlation g, smoothed over 15 deg and 0.1 m.

    Parameters
    ----------
    samples : as from `szlib.find_encounters`.
    null : the null model of the same tracks, with the same parameters and kinds of encounter.

    Raises
    ------
    DataError : the samples lack a column or are empty.
    ZoneError : the null model has no encounter.

    Examples
    --------
    >>> import szlib
    >>> path = szlib.make_plaza("plaza.csv", settings=szlib.PlazaSettings(n_encounters=100))
    >>> tracks = szlib.read_tracks(path)
    >>> null = szlib.null_encounters(tracks, shifts=3, minutes=(0.5, 2.0), progress=False)
    >>> szlib.pair_correlation(szlib.find_encounters(tracks), null).g.shape
    (36, 80)
    """
    check_columns(samples, ["encounter", "los_angle", "distance", "speed"])
    if len(null.encounters) == 0:
        raise ZoneError(
            "the null model has no encounter: nothing to compare; use more shifts"
        )
    real = _smooth_density(samples, samples["encounter"].nunique(), null.r_max)
    model = _smooth_density(null.samples, len(null.encounters), null.r_max)
    g = np.divide(real, model, out=np.full(real.shape, np.nan), where=model > 0)
    turn = (np.arange(_N_DIRECTIONS) + 0.5) / _N_DIRECTIONS
    distance: Array = (np.arange(_N_DISTANCES) + 0.5) / _N_DISTANCES * null.r_max
    return PairCorrelation(distance, 2 * np.pi * turn, g)


def _smooth_density(samples: pd.DataFrame, n_encounters: int, r_max: float) -> Array:
    """Smoothed samples per encounter within `r_max` [m], by direction (from 0 rad on) and distance."""
    # the last bin holds its upper end
    ranges = [(0, 2 * np.pi), (0, np.nextafter(r_max, 0))]
    turn = np.mod(samples["los_angle"].to_numpy(float), 2 * np.pi)
    bins = (_N_DIRECTIONS, _N_DISTANCES)
    counts = np.histogram2d(
        turn, samples["distance"].to_numpy(float), bins=bins, range=ranges
    )[0]
    blur = np.divide(_BLUR, (360 / _N_DIRECTIONS, r_max / _N_DISTANCES))
    return np.asarray(
        gaussian_filter(counts / n_encounters, blur, mode=("wrap", "nearest"))
    )
