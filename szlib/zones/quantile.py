"""The quantile zone: all but a share q of encounters keep out of it, in each direction.

In each direction the radius is the q-quantile, over the encounters in which somebody was seen there, of
the nearest approach there.  An extreme shrinks as encounters are added; a quantile does not, and up to a
share q of people who care for nobody do not set it.  Paths are smoothed first: the nearest of several
noisy samples is too near, by 8 cm for a noise of 5 cm.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ..checks import Array, check_columns
from ..errors import DataError, ZoneError
from ..tracks import funnels
from .outliers import encounter_numbers
from .polar import DIRECTIONS, PolarZone, closed, fit_ellipses

SHARE = 0.05
"""Share q of encounters that may enter the zone (assumed)."""
SECTOR = 7
"""Directions, 5 deg apart, over which the nearest approach is taken: 35 deg (assumed; 25-45 do as well)."""
BAND = 0.2
"""Encounters of reference pedestrians up to so much slower or faster are taken together [m/s] (assumed)."""
SMOOTHING = 0.7
"""Paths are smoothed over so much time before and after [s] (measured: 0.5 leaves 5 cm of noise felt)."""

_DEGREE = 2  # of the polynomial that smooths
_TICK = 0.1  # from one sample to the next [s]
_DEEPEST = 50  # encounters that are left out one by one


@dataclass(frozen=True, eq=False)
class Approaches:
    """Where people were within r_max, on smoothed paths.

    Parameters
    ----------
    encounter : which of `encounters` each sample belongs to, shape (n,).
    direction : which of `DIRECTIONS` it is nearest to, shape (n,).
    distance : of the other person [m], shape (n,).
    speed : of the reference pedestrian [m/s], shape (n,).
    encounters : the first of each encounter's samples.
    """

    encounter: NDArray[np.intp]
    direction: NDArray[np.intp]
    distance: Array
    speed: Array
    encounters: pd.DataFrame

    def nearest(self, speed: float) -> tuple[NDArray[np.intp], Array]:
        """The encounters (k,) of a speed [m/s] (+-`BAND`), and how near each came around every direction.

        Nearest approaches (k, 72) [m] are over `SECTOR` directions; inf where nobody was seen.
        """
        band = np.abs(self.speed - speed) <= BAND
        encounters, row = np.unique(self.encounter[band], return_inverse=True)
        here = np.full((len(encounters), len(DIRECTIONS)), np.inf)
        np.minimum.at(here, (row, self.direction[band]), self.distance[band])
        turns = range(-(SECTOR // 2), SECTOR // 2 + 1)
        return encounters, np.minimum.reduce([np.roll(here, turn, axis=1) for turn in turns])


def smoothed(samples: pd.DataFrame) -> tuple[Array, Array]:
    """Line-of-sight angle [rad] and distance [m] of samples (n,) along smoothed paths, in their order.

    Local polynomials of degree 2 over +-`SMOOTHING` (Savitzky & Golay, 1964), by encounter, never across a
    gap in time; straight and evenly bent paths stay as they are.  Samples without `t` stay as they are.
    """
    angle, distance = samples["los_angle"].to_numpy(float), samples["distance"].to_numpy(float)
    if "t" not in samples:
        return angle, distance
    number, t = encounter_numbers(samples)[0], samples["t"].to_numpy(float)
    order = np.lexsort([t, number])
    path = (distance * np.exp(1j * angle))[order]
    ends = (np.diff(number[order]) != 0) | (np.abs(np.diff(t[order]) - _TICK) > _TICK / 2)
    starts = np.flatnonzero(np.append(True, ends))
    lengths = np.diff(np.append(starts, len(path)))
    for length in np.unique(lengths[lengths > _DEGREE + 1]):
        rows = starts[lengths == length][:, None] + np.arange(length)
        path[rows] = path[rows] @ _smoother(int(length)).T
    out = np.empty_like(path)
    out[order] = path
    return np.angle(out), np.abs(out)


def approaches(samples: pd.DataFrame, *, r_max: float) -> Approaches:
    """Approaches within r_max [m] of samples as from `szlib.find_encounters`.

    Raises DataError where columns are missing, a value is not finite, or nobody was within r_max.
    """
    check_columns(samples, ["los_angle", "distance", "speed"])
    values = samples[["los_angle", "distance", "speed"]].to_numpy(float)
    if not np.isfinite(values).all():
        row = int(np.flatnonzero(~np.isfinite(values).all(axis=1))[0])
        raise DataError(
            f"row {samples.index[row]}: los_angle, distance, speed must be finite; got {values[row].tolist()}"
        )
    angle, distance = smoothed(samples)
    close = distance <= r_max
    if not close.any():
        raise DataError(
            f"none of {len(samples)} samples is within r_max = {r_max} m (nearest: {distance.min():.2f} m); "
            "are distances in metres?"
        )
    step = 2 * np.pi / len(DIRECTIONS)
    direction = np.rint((angle[close] - DIRECTIONS[0]) / step).astype(int) % len(DIRECTIONS)
    number, encounters = encounter_numbers(samples[close])
    return Approaches(number, direction, distance[close], values[close, 2], encounters)


def quantile_radii(known: Approaches, speed: float, q: float, weights: Array | None = None) -> Array:
    """Radii (k, 72) [m] at a speed [m/s]: the least that at least a share q of encounters reach; NaN: unseen.

    `weights` (k, n) weigh the encounters, each row giving one line of radii; None: one line, all alike.
    """
    who, nearest = known.nearest(speed)
    weights = np.ones((1, len(who))) if weights is None else weights[:, who]
    radii = np.full((len(weights), len(DIRECTIONS)), np.nan)
    order, seen = np.argsort(nearest, axis=0, kind="stable"), np.isfinite(nearest)
    enough = q * (weights @ seen) * (1 - 1e-12)
    for d, count in enumerate(seen.sum(axis=0)):
        if count:
            likely = int(q * count + 8 * np.sqrt(q * count) + 8)  # the quantile lies among the first of them
            for first in (order[: min(likely, count), d], order[:count, d]):
                below = np.cumsum(weights[:, first], axis=1)
                if (below[:, -1] >= enough[:, d]).all():
                    break
            at = np.argmax(below >= enough[:, d : d + 1], axis=1)
            radii[:, d] = np.where(enough[:, d] > 0, nearest[first[at], d], np.nan)
    return radii


@dataclass(frozen=True, eq=False)
class QuantileEstimator:
    """The quantile's way to zones, to go again with other people.

    Parameters
    ----------
    known : the approaches.
    q : share of encounters that may enter.
    parameters, funnel : for the provenance.

    Raises ZoneError unless 0 < q < 1.
    """

    known: Approaches
    q: float
    parameters: dict[str, Any]
    funnel: list[dict[str, Any]]
    extreme = False
    vertices = None

    def __post_init__(self) -> None:
        if not 0 < self.q < 1:
            raise ZoneError(f"q must be a share of encounters, 0 < q < 1; got {self.q}")

    @classmethod
    def of(cls, samples: pd.DataFrame, *, r_max: float, q: float = SHARE) -> QuantileEstimator:
        """From samples; errors as in `approaches`."""
        known = approaches(samples, r_max=r_max)
        entered, kept = len(encounter_numbers(samples)[1]), len(known.encounters)
        near = funnels.stage("encounters: near", entered, kept, {f"never within {r_max} m": entered - kept})
        sector = 360 * SECTOR / len(DIRECTIONS)
        parameters = {"q": float(q), "sector_deg": sector, "speed_band": BAND, "smoothing": SMOOTHING}
        return cls(known, float(q), parameters, [*funnels.get(samples), near])

    @property
    def encounters(self) -> pd.DataFrame:
        """The first of each encounter's samples within r_max."""
        return self.known.encounters

    def radii(self, speeds: Sequence[float]) -> PolarZone:
        """Radii at speeds, ascending [m/s]."""
        lines = [quantile_radii(self.known, speed, self.q)[0] for speed in speeds]
        return PolarZone(np.array(speeds), DIRECTIONS, np.array(lines))

    def refit(self, weights: Array, speeds: Sequence[float], rng: np.random.Generator | None = None) -> Array:
        """Ellipses (k, s, 5) for weights (k, n) of the encounters; NaN: no zone.  Nothing else is drawn."""
        radii = np.stack([quantile_radii(self.known, v, self.q, weights) for v in speeds], axis=1)
        return fit_ellipses(closed(radii.reshape(-1, radii.shape[-1]))).reshape(*radii.shape[:2], 5)

    def leave_one_out(self, speeds: Sequence[float]) -> tuple[NDArray[np.intp], Array]:
        """The encounters that enter the zones most (k,), and the ellipses (k, s, 5) without each of them."""
        depth = np.zeros(len(self.encounters))
        for speed in speeds:
            who, nearest = self.known.nearest(speed)
            depth[who] += (nearest <= quantile_radii(self.known, speed, self.q)[0]).sum(axis=1)
        deepest = np.argsort(-depth, kind="stable")[:_DEEPEST]
        weights = np.ones((len(deepest), len(depth)))
        weights[np.arange(len(deepest)), deepest] = 0
        return deepest, self.refit(weights, speeds)


def _smoother(length: int) -> Array:
    """Matrix (length, length) that puts, for each of evenly spaced samples, the local polynomial there."""
    half = round(SMOOTHING / _TICK)
    matrix = np.zeros((length, length))
    for i in range(length):
        near = np.arange(max(0, i - half), min(length, i + half + 1))
        matrix[i, near] = np.linalg.pinv(np.vander((near - i) / half, _DEGREE + 1, increasing=True))[0]
    return matrix
