"""Outliers of the distance data, by local outlier factor on complementary coordinates (paper, sec. 2).

LOF takes what lies in a sparse place for an outlier, and people are sparse where they are close to
each other, which is just where the zone ends.  The complementary distance r' = r_max - r turns the
data inside out: the many who keep their distance gather around the origin, and the few who come
close lie on the outside.

The paper removes a quota of samples.  Among 20 neighbours an intruder's samples, 31 a window, have
each other for company, and a quota can neither grow with the intruders nor stop when none is left.  So
by default *whole encounters* are judged, each by its nearest approach, against a share of all others.
"""

from __future__ import annotations

import math
import warnings

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ..checks import check_columns
from ..errors import DataError, DataWarning
from ..tracks import funnels

R_MAX = 2.0
"""Longest distance that counts as close [m] (paper, sec. 2)."""
FRACTION = 0.002
"""Share of samples taken for outliers in the paper's way (paper, sec. 2)."""
NEIGHBOURS = 20
"""Neighbours that LOF compares a sample with, and at least an encounter (assumed; scikit-learn's default)."""
SHARE = 0.02
"""Neighbours of an encounter, as a share of all (measured: 1 % miss crowds of intruders, 5 % near ones)."""
FACTOR = 2.0
"""Encounters of a larger local outlier factor are outliers (measured: up to 1.7 at the edge of a zone)."""
JITTER = 1e-3
"""Spread of the noise that parts identical samples before LOF [m] (assumed; the sensor's resolution)."""


def complementary_points(samples: pd.DataFrame, *, r_max: float = R_MAX) -> np.ndarray:
    """Samples as points (x', y') = (r_max - distance) (cos los_angle, sin los_angle), shape (n, 2) [m].

    Raises DataError where a distance is not within [0, r_max], or a value is not finite.
    """
    check_columns(samples, ["los_angle", "distance"])
    angle, distance = samples["los_angle"].to_numpy(float), samples["distance"].to_numpy(float)
    bad = ~(np.isfinite(angle) & (distance >= 0) & (distance <= r_max))
    if bad.any():
        row = int(np.flatnonzero(bad)[0])
        raise DataError(
            f"row {samples.index[row]}: expected 0 <= distance <= r_max = {r_max} m and a finite los_angle; "
            f"got {distance[row]} m, {angle[row]} rad"
        )
    return np.asarray((r_max - distance)[:, None] * np.column_stack([np.cos(angle), np.sin(angle)]))


def encounter_numbers(samples: pd.DataFrame) -> tuple[NDArray[np.intp], pd.DataFrame]:
    """Which encounter each sample belongs to (n,), and the first sample of each, in order of appearance.

    Encounters are told apart by `encounter` and, where there is one, `day`; without either, each sample
    counts as one.
    """
    number: NDArray[np.intp] = np.arange(len(samples))
    if "encounter" in samples:
        keys = [name for name in ("day", "encounter") if name in samples]
        groups = samples.groupby(keys, sort=False, observed=True, dropna=False)
        number = np.asarray(groups.ngroup(), np.intp)
    return number, samples.iloc[np.unique(number, return_index=True)[1]]


def nearest_approaches(samples: pd.DataFrame) -> pd.DataFrame:
    """The nearest sample of each encounter, as `encounter_numbers` tells them apart, one row an encounter."""
    check_columns(samples, ["los_angle", "distance"])
    number = encounter_numbers(samples)[0]
    order = np.lexsort((samples["los_angle"].to_numpy(), samples["distance"].to_numpy(), number))
    return samples.iloc[order[np.r_[True, np.diff(number[order]) > 0]]]


def local_outlier_factors(points: np.ndarray, neighbours: int) -> np.ndarray:
    """How many times farther each of points (n, d) is from its neighbours than they from theirs, (n,).

    About 1 among others (Breunig et al., 2000).  Raises DataError unless 1 <= neighbours < n.
    """
    _check_neighbours(neighbours, len(points))
    return _factors(points, neighbours)[0]


def is_outlier(
    samples: pd.DataFrame,
    *,
    fraction: float | None = None,
    r_max: float = R_MAX,
    neighbours: int | None = None,
    speed_scale: float | None = None,
) -> np.ndarray:
    """Which samples, all within r_max, are outliers; booleans, shape (n,).

    By default encounters are judged as a whole, each by its nearest approach: all samples of one that is
    nearer than half of the others, and whose local outlier factor exceeds `FACTOR`, are outliers.  That
    is repeated with those that are left until none is found, for a crowd of intruders hides the ones in
    its middle.  Copies count once.

    Parameters
    ----------
    samples : a table with los_angle [rad], distance [m] (encounter and day, and speed [m/s]).
    fraction : None judges encounters.  A number is the paper's way (`FRACTION`, with `NEIGHBOURS`): that
        share of samples, whatever the data: a quota, not a detection; 0 calls none an outlier.
    r_max : longest distance [m].
    neighbours : compared with each encounter (None: a share of `SHARE`, at least `NEIGHBOURS`), or with
        each sample (None: `NEIGHBOURS`).
    speed_scale : None compares (x', y'); a number compares (x', y', speed_scale * speed), so it is
        the distance [m] that a difference of 1 m/s is worth.

    Warns (DataWarning) where `NEIGHBOURS` encounters or fewer leave nothing to compare: none is an outlier.

    Raises
    ------
    DataError : a parameter has no meaning, or there are too few samples for the neighbours.
    """
    points = complementary_points(samples, r_max=r_max)
    if fraction is None:
        nearest = nearest_approaches(samples)
        places, place = np.unique(_features(nearest, r_max, speed_scale), axis=0, return_inverse=True)
        far = _far(places, neighbours)[place.ravel()]
        return np.asarray(far[encounter_numbers(samples)[0]])
    if not 0 <= fraction <= 0.5:
        raise DataError(
            f"fraction must be within [0, 0.5], or None to judge whole encounters; got {fraction}"
        )
    if fraction == 0:
        return np.zeros(len(points), bool)
    neighbours = NEIGHBOURS if neighbours is None else neighbours
    _check_neighbours(neighbours, len(points))
    points = _parted(_features(samples, r_max, speed_scale), neighbours)
    factors, limit = _factors(points, neighbours, fraction)
    return np.asarray(factors > limit)


def remove_outliers(
    samples: pd.DataFrame,
    fraction: float | None = None,
    r_max: float = R_MAX,
    *,
    neighbours: int | None = None,
    speed_scale: float | None = None,
) -> pd.DataFrame:
    """The samples within r_max that are no outliers; parameters, warnings and errors as in `is_outlier`.

    `remove_outliers(samples, fraction=0.002, r_max=2.0)` is the paper's way.
    """
    if not 0 < r_max < np.inf:
        raise DataError(f"r_max must be a positive distance in metres; got {r_max}")
    check_columns(samples, ["los_angle", "distance"])
    if samples["distance"].isna().any():
        raise DataError(f"row {samples.index[samples['distance'].isna()][0]}: distance is NaN; drop it first")
    close = samples[samples["distance"] <= r_max]
    if len(close) == 0:
        raise DataError(
            f"none of {len(samples)} samples is within r_max = {r_max} m (nearest: "
            f"{samples['distance'].min():.2f} m); are distances in metres?"
        )
    outlier = is_outlier(
        close, fraction=fraction, r_max=r_max, neighbours=neighbours, speed_scale=speed_scale
    )
    kept = close[~outlier].copy()
    why = "outlier (LOF)" if fraction is not None else "of an outlying encounter (LOF)"
    stages = [
        *funnels.get(samples),
        funnels.stage(
            "samples: close", len(samples), len(close), {f"farther than {r_max} m": len(samples) - len(close)}
        ),
        funnels.stage("samples: inliers", len(close), len(kept), {why: int(outlier.sum())}),
    ]
    return funnels.attach(kept, stages)


def _factors(points: np.ndarray, neighbours: int, fraction: float | str = "auto") -> tuple[np.ndarray, float]:
    """Local outlier factors of points (n, d), and what those of `fraction` of them exceed.

    Points are handed over in narrow strips along y: who comes next then has the same neighbours, which the
    processor's cache still holds.  In any order the factors are the same; at the paper's 500,000 samples
    they take half the time.
    """
    from sklearn.neighbors import LocalOutlierFactor

    across = points[:, 0]
    width = np.ptp(across) / math.sqrt(len(points)) or 1.0
    order = np.lexsort((points[:, 1], np.floor((across - across.min()) / width)))
    found = LocalOutlierFactor(n_neighbors=neighbours, contamination=fraction).fit(points[order])
    factors = np.empty(len(points))
    factors[order] = -found.negative_outlier_factor_
    return factors, -float(found.offset_)


def _far(places: np.ndarray, neighbours: int | None) -> np.ndarray:
    """Which places of nearest approaches (n, d), all different, lie apart, outside of most others; (n,)."""
    far = np.zeros(len(places), bool)
    reach = np.hypot(*places[:, :2].T)
    if neighbours is None and len(places) <= NEIGHBOURS:
        warnings.warn(
            f"{len(places)} encounters are too few to tell an outlier (LOF compares each with {NEIGHBOURS} "
            "others), so none is removed; add data, or pass fewer neighbours",
            DataWarning,
            stacklevel=3,
        )
        return far
    while True:
        left = np.flatnonzero(~far)
        compared = max(NEIGHBOURS, math.ceil(SHARE * len(left))) if neighbours is None else neighbours
        if far.any() and len(left) <= compared:
            return far
        found = local_outlier_factors(places[left], compared) > FACTOR
        found &= reach[left] > np.median(reach)
        if not found.any():
            return far
        far[left[found]] = True


def _check_neighbours(neighbours: int, n: int) -> None:
    """Raise DataError unless each of n can be compared with that many others."""
    if not (isinstance(neighbours, int | np.integer) and 1 <= neighbours < n):
        raise DataError(
            "LOF needs a whole number >= 1 of neighbours, and more samples (or encounters) than that within "
            f"r_max; got {neighbours} neighbours, {n} samples; add data, or pass fewer neighbours"
        )


def _parted(points: np.ndarray, neighbours: int) -> np.ndarray:
    """The points, with a little noise (and a DataWarning) where so many coincide that LOF has no density."""
    copies = int(np.unique(points, axis=0, return_counts=True)[1].max())
    if copies <= neighbours // 2:
        return points
    warnings.warn(
        f"up to {copies} samples coincide, so that LOF has no density to compare; "
        f"it sees them with {JITTER * 1e3:g} mm of noise (the samples stay as they are)",
        DataWarning,
        stacklevel=3,
    )
    return points + np.random.default_rng(0).normal(0, JITTER, points.shape)


def _features(samples: pd.DataFrame, r_max: float, speed_scale: float | None) -> np.ndarray:
    """What LOF compares: (x', y'), and the speed in metres where there is a scale; (n, 2) or (n, 3)."""
    points = complementary_points(samples, r_max=r_max)
    if speed_scale is None:
        return points
    return np.column_stack([points, speed_scale * _speeds(samples, speed_scale)])


def _speeds(samples: pd.DataFrame, speed_scale: float) -> np.ndarray:
    """The samples' speeds [m/s]; raises DataError where one is not finite, or the scale has no meaning."""
    check_columns(samples, ["speed"])
    speed = samples["speed"].to_numpy(float)
    if not 0 < speed_scale < np.inf:
        raise DataError(f"speed_scale must be a positive number of m per m/s, or None; got {speed_scale}")
    if not np.isfinite(speed).all():
        row = int(np.flatnonzero(~np.isfinite(speed))[0])
        raise DataError(f"row {samples.index[row]}: speed is {speed[row]}, expected a finite number; drop it")
    return speed
