"""How often people were where, and the map of the pair correlation: the data over its null model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from scipy.ndimage import gaussian_filter

from ..checks import Array, check_columns
from ..encounters.null_model import NullEncounters
from ..errors import ZoneError

_DISTANCES, _DIRECTIONS = 80, 36
_SPEED_STEP, _SPEEDS = 0.1, 40  # [m/s]; faster samples count as of the last bin
_BLUR = (15.0, 0.1)
"""Standard deviations of the Gaussians that smooth the map of g [deg, m]."""


@dataclass(frozen=True, eq=False)
class OccupancyHistogram:
    """How often people were where: weights of samples by speed, direction and distance.

    Parameters
    ----------
    counts : shape (speeds, directions, distances), from 0 m/s, from 0 rad counter-clockwise, from 0 m.
    r_max : the farthest distance [m].
    """

    counts: Array
    r_max: float

    @classmethod
    def from_samples(
        cls, samples: pd.DataFrame, *, r_max: float, weights: ArrayLike | None = None
    ) -> OccupancyHistogram:
        """Count samples within r_max, each once or with its weight (n,), as resampling gives them."""
        check_columns(samples, ["los_angle", "distance", "speed"])
        distance = samples["distance"].to_numpy(float)
        close = distance < r_max
        turn = np.mod(samples["los_angle"].to_numpy(float)[close] / (2 * np.pi), 1.0)
        cells = [
            np.minimum(samples["speed"].to_numpy(float)[close] / _SPEED_STEP, _SPEEDS - 1),
            np.minimum(turn * _DIRECTIONS, _DIRECTIONS - 1),
            distance[close] / r_max * _DISTANCES,
        ]
        shape = (_SPEEDS, _DIRECTIONS, _DISTANCES)
        at = np.ravel_multi_index([cell.astype(int) for cell in cells], shape)
        weight = None if weights is None else np.asarray(weights, float)[close]
        return cls(np.bincount(at, weight, minlength=int(np.prod(shape))).reshape(shape).astype(float), r_max)

    def at(self, speed: float | None, width: float) -> Array:
        """By direction and distance: all speeds alike (None), or weighed by nearness to one [m/s]."""
        if speed is None:
            return np.asarray(self.counts.sum(axis=0))
        middle = (np.arange(_SPEEDS) + 0.5) * _SPEED_STEP
        return np.asarray(np.tensordot(np.exp(-(((middle - speed) / width) ** 2) / 2), self.counts, axes=1))


@dataclass(frozen=True, eq=False)
class PairCorrelation:
    """How often people were where, over how often the null model was: a smooth map to look at.

    Parameters
    ----------
    distance, direction : middles of the cells [m], (n,), and [rad], (m,).
    g : shape (m, n); NaN where the null model never was.  1: as often as nobody minds.
    """

    distance: Array
    direction: Array
    g: Array


def pair_correlation(samples: pd.DataFrame, null: NullEncounters) -> PairCorrelation:
    """The map of g within r_max, per encounter, smoothed over 15 deg and 0.1 m; errors as `null_test`."""
    check_columns(samples, ["encounter", "los_angle", "distance", "speed"])
    if len(null.encounters) == 0:
        raise ZoneError("the null model has no encounter: nothing to compare; more shifts are needed")
    real, model = (
        OccupancyHistogram.from_samples(each, r_max=null.r_max).at(None, 1.0) / encounters
        for each, encounters in (
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
