"""Histograms of where people were, and the pair correlation: the data divided by its null model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from scipy.ndimage import gaussian_filter

from ..checks import Array, check_columns
from ..encounters.null_model import NullEncounters
from ..errors import ZoneError

_N_DISTANCES, _N_DIRECTIONS = 80, 36
_SPEED_STEP, _N_SPEEDS = 0.1, 40  # [m/s]; the last bin holds all faster samples
_BLUR = (15.0, 0.1)  # standard deviations of the Gaussians that smooth the map of g [deg, m]


@dataclass(frozen=True, eq=False)
class OccupancyHistogram:
    """A histogram of samples over speed, direction and distance.

    Parameters
    ----------
    counts : shape (speeds, directions, distances), from 0 m/s, from 0 rad counter-clockwise, from 0 m.
    r_max : largest distance [m].

    Examples
    --------
    >>> import pandas as pd
    >>> import szlib
    >>> samples = pd.DataFrame({"los_angle": [0.0, 1.0], "distance": [0.5, 3.0], "speed": [1.0, 1.0]})
    >>> float(szlib.OccupancyHistogram.from_samples(samples, r_max=2.0).counts.sum())
    1.0
    """

    counts: Array
    r_max: float

    @classmethod
    def from_samples(
        cls, samples: pd.DataFrame, *, r_max: float, weights: ArrayLike | None = None
    ) -> OccupancyHistogram:
        """Count `samples` nearer than `r_max` [m], each once or with its weight from `weights` (n,)."""
        check_columns(samples, ["los_angle", "distance", "speed"])
        distance = samples["distance"].to_numpy(float)
        is_close = distance < r_max
        turn = np.mod(samples["los_angle"].to_numpy(float)[is_close] / (2 * np.pi), 1.0)
        cells = [
            np.minimum(samples["speed"].to_numpy(float)[is_close] / _SPEED_STEP, _N_SPEEDS - 1),
            np.minimum(turn * _N_DIRECTIONS, _N_DIRECTIONS - 1),
            distance[is_close] / r_max * _N_DISTANCES,
        ]
        shape = (_N_SPEEDS, _N_DIRECTIONS, _N_DISTANCES)
        bins = np.ravel_multi_index([cell.astype(int) for cell in cells], shape)
        weight = None if weights is None else np.asarray(weights, float)[is_close]
        counts = np.bincount(bins, weight, minlength=int(np.prod(shape)))
        return cls(counts.reshape(shape).astype(float), r_max)

    def weighted_sum(self, speed: float | None, width: float) -> Array:
        """Sum over speeds, shape (directions, distances).

        A Gaussian of the standard deviation `width` around `speed` gives the weights [m/s]; None: equal
        weights.
        """
        if speed is None:
            return np.asarray(self.counts.sum(axis=0))
        middle = (np.arange(_N_SPEEDS) + 0.5) * _SPEED_STEP
        return np.asarray(np.tensordot(np.exp(-(((middle - speed) / width) ** 2) / 2), self.counts, axes=1))


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
        raise ZoneError("the null model has no encounter: nothing to compare; use more shifts")
    real, model = (
        OccupancyHistogram.from_samples(each, r_max=null.r_max).weighted_sum(None, 1.0) / n_encounters
        for each, n_encounters in (
            (samples, samples["encounter"].nunique()),
            (null.samples, len(null.encounters)),
        )
    )
    directions, distances = real.shape
    cell = (360 / directions, null.r_max / distances)
    real, model = (
        gaussian_filter(each, np.divide(_BLUR, cell), mode=("wrap", "nearest")) for each in (real, model)
    )
    g = np.divide(real, model, out=np.full(real.shape, np.nan), where=model > 0)
    turn = (np.arange(directions) + 0.5) / directions
    return PairCorrelation((np.arange(distances) + 0.5) * cell[1], 2 * np.pi * turn, g)
