"""The quantile zone: all but a share q of the encounters stay outside of it, in each direction.

In each direction, the radius is the q-quantile of the nearest approaches there, over the encounters in which
a person was seen there. The hull shrinks as encounters are added; a quantile does not. People who ignore
others do not determine it, up to a share q of them. Paths are smoothed first: the nearest of several noisy
samples is too near, by 8 cm for a noise of 5 cm.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ..core.checks import Array, check_columns, check_rows, require
from ..core.errors import ZoneError
from ..tracks import funnels
from .estimators import Estimator
from .outliers import encounter_numbers, is_close
from .polar import DIRECTIONS, PolarZone, fill_gaps, fit_ellipses

QUANTILE = 0.05  # share q of the encounters that may enter the zone (assumed)
# Number of directions, 5 deg apart, over which the nearest approach is taken: 35 deg (assumed; 25 to 45 deg
# do as well).
SECTOR = 7
# Encounters of reference pedestrians up to this much slower or faster are pooled [m/s] (assumed).
SPEED_BAND = 0.2
# Paths are smoothed over this time before and after [s] (measured: 0.5 s leaves an effect of 5 cm noise).
SMOOTHING = 0.7

_DEGREE = 2  # of the smoothing polynomial
_TICK = 0.1  # time between samples [s]


@dataclass(frozen=True, eq=False)
class Approaches:
    """Where people were within r_max, on smoothed paths.

    Parameters
    ----------
    number : row in `encounters` of each sample, shape (n,).
    direction : index of the nearest of `DIRECTIONS`, shape (n,).
    distance : distance of the other person [m], shape (n,).
    speed : speed of the reference pedestrian [m/s], shape (n,).
    encounters : the first sample of each encounter.
    """

    number: NDArray[np.intp]
    direction: NDArray[np.intp]
    distance: Array
    speed: Array
    encounters: pd.DataFrame

    @classmethod
    def from_samples(cls, samples: pd.DataFrame, *, r_max: float) -> Approaches:
        """Find the approaches within `r_max` [m] in `samples` as from `szlib.find_encounters`.

        Raises DataError if columns are missing, a value is not finite, or no person was within r_max.
        """
        check_columns(samples, ["los_angle", "distance", "speed"])
        values = samples[["los_angle", "distance", "speed"]].to_numpy(float)
        is_finite = np.isfinite(values).all(axis=1)
        check_rows(
            samples,
            is_finite,
            ["los_angle", "distance", "speed"],
            "expected finite numbers",
        )
        angle, distance = smooth_paths(samples)
        close = is_close(distance, r_max)
        step = 2 * np.pi / len(DIRECTIONS)
        direction = np.rint((angle[close] - DIRECTIONS[0]) / step).astype(int) % len(
            DIRECTIONS
        )
        number, encounters = encounter_numbers(samples[close])
        return cls(number, direction, distance[close], values[close, 2], encounters)

    def nearest(self, speed: float) -> tuple[NDArray[np.intp], Array]:
        """The encounters (k,) at a `speed` [m/s] (+-`SPEED_BAND`), and their nearest approaches (k, 72) [m].

        Each approach is the nearest within `SECTOR` directions; it is inf if no person was seen there.
        """
        in_band = np.abs(self.speed - speed) <= SPEED_BAND
        encounters, row = np.unique(self.number[in_band], return_inverse=True)
        distances = np.full((len(encounters), len(DIRECTIONS)), np.inf)
        np.minimum.at(distances, (row, self.direction[in_band]), self.distance[in_band])
        turns = range(-(SECTOR // 2), SECTOR // 2 + 1)
        return encounters, np.minimum.reduce(
            [np.roll(distances, turn, axis=1) for turn in turns]
        )


def smooth_paths(
    samples: pd.DataFrame, column: str = "los_angle"
) -> tuple[Array, Array]:
    """Line-of-sight angle [rad] and distance [m] of `samples` (n,) along smoothed paths, in the same order.

    The angle is that of a `column`: los_angle, or other_los_angle.

    Local polynomials of degree 2 over +-`SMOOTHING` (Savitzky & Golay, 1964) smooth each encounter, but not
    across a gap in time. Straight and evenly curved paths do not change. Without a column `t`, no path does.
    """
    angle, distance = (
        samples[column].to_numpy(float),
        samples["distance"].to_numpy(float),
    )
    if "t" not in samples:
        return angle, distance
    number, t = encounter_numbers(samples)[0], samples["t"].to_numpy(float)
    order = np.lexsort([t, number])
    path = (distance * np.exp(1j * angle))[order]
    is_end = (np.diff(number[order]) != 0) | (
        np.abs(np.diff(t[order]) - _TICK) > _TICK / 2
    )
    starts = np.flatnonzero(np.append(True, is_end))
    lengths = np.diff(np.append(starts, len(path)))
    for length in np.unique(lengths[lengths > _DEGREE + 1]):
        rows = starts[lengths == length][:, None] + np.arange(length)
        path[rows] = path[rows] @ _smoothing_matrix(int(length)).T
    out = np.empty_like(path)
    out[order] = path
    return np.angle(out), np.abs(out)


def quantile_radii(
    approaches: Approaches, speed: float, q: float, weights: Array | None = None
) -> Array:
    """Compute the radius in each direction that at least a share q of the encounters enter.

    Parameters
    ----------
    approaches : of all encounters.
    speed : speed of the reference pedestrian [m/s].
    q : share of the encounters.
    weights : weights of the encounters, shape (k, n), one row for each result; None: one result, equal
        weights.

    Returns
    -------
    Radii (k, 72) [m]; NaN where no person was seen.
    """
    encounters, nearest = approaches.nearest(speed)
    weights = (
        np.ones((1, len(encounters))) if weights is None else weights[:, encounters]
    )
    radii = np.full((len(weights), len(DIRECTIONS)), np.nan)
    order, is_seen = np.argsort(nearest, axis=0, kind="stable"), np.isfinite(nearest)
    needed = q * (weights @ is_seen) * (1 - 1e-12)
    for d, count in enumerate(is_seen.sum(axis=0)):
        if count:
            # the quantile lies among the first of them
            likely = int(q * count + 8 * np.sqrt(q * count) + 8)
            for first in (order[: min(likely, count), d], order[:count, d]):
                cumulated = np.cumsum(weights[:, first], axis=1)
                if (cumulated[:, -1] >= needed[:, d]).all():
                    break
            at = np.argmax(cumulated >= needed[:, d : d + 1], axis=1)
            radii[:, d] = np.where(needed[:, d] > 0, nearest[first[at], d], np.nan)
    return radii


@dataclass(frozen=True, eq=False, kw_only=True)
class QuantileEstimator(Estimator):
    """The estimator of the quantile zone.

    Parameters
    ----------
    approaches : of all encounters.
    q : share of the encounters that may enter the zone.
    encounters, parameters, funnel : see `Estimator`.

    Raises
    ------
    ZoneError : q is not in 0 < q < 1.
    """

    approaches: Approaches
    q: float

    def __post_init__(self) -> None:
        require(
            0 < self.q < 1, "q", self.q, "a share of encounters, 0 < q < 1", ZoneError
        )

    @classmethod
    def from_samples(
        cls, samples: pd.DataFrame, *, r_max: float, q: float = QUANTILE
    ) -> QuantileEstimator:
        """Prepare `samples` within `r_max` [m] for a share `q`; errors as in `Approaches.from_samples`."""
        approaches = Approaches.from_samples(samples, r_max=r_max)
        entered, kept = len(encounter_numbers(samples)[1]), len(approaches.encounters)
        near = funnels.stage(
            "encounters: near",
            entered,
            kept,
            {f"never within {r_max} m": entered - kept},
        )
        sector = 360 * SECTOR / len(DIRECTIONS)
        assumed = {
            "sector_deg": sector,
            "speed_band": SPEED_BAND,
            "smoothing": SMOOTHING,
        }
        return cls(
            approaches=approaches,
            q=float(q),
            encounters=approaches.encounters,
            parameters={"q": float(q), **assumed},
            funnel=[*funnels.get(samples), near],
        )

    def fit_shape(self, speeds: Sequence[float]) -> PolarZone:
        """Fit the radii at `speeds`, ascending [m/s]."""
        radii = [quantile_radii(self.approaches, speed, self.q)[0] for speed in speeds]
        return PolarZone(np.array(speeds), DIRECTIONS, np.array(radii))

    def refit(self, weights: Array, speeds: Sequence[float]) -> Array:
        """Fit ellipses to encounters with `weights` at `speeds` (see `Estimator`)."""
        radii = np.stack(
            [quantile_radii(self.approaches, v, self.q, weights) for v in speeds],
            axis=1,
        )
        return fit_ellipses(fill_gaps(radii.reshape(-1, radii.shape[-1]))).reshape(
            *radii.shape[:2], 5
        )


def _smoothing_matrix(length: int) -> Array:
    """Matrix (length, length) that replaces each of evenly spaced samples by its local polynomial."""
    half = round(SMOOTHING / _TICK)
    matrix = np.zeros((length, length))
    for i in range(length):
        near = np.arange(max(0, i - half), min(length, i + half + 1))
        matrix[i, near] = np.linalg.pinv(
            np.vander((near - i) / half, _DEGREE + 1, increasing=True)
        )[0]
    return matrix
