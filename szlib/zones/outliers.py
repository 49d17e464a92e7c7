"""Outliers of the distances, by local outlier factor (LOF) on complementary coordinates (paper, sec. 2).

LOF finds points in sparse places, and people are sparse close to each other, which is exactly where the zone
ends. The complementary distance r' = r_max - r turns the data inside out: the many people who keep their
distance gather around the origin, and the few who come close lie on the outside.

The paper removes a fixed share of the samples. But the samples of slow intruders lie near each other: they
are a group, in which LOF finds nobody alone. And a fixed share can neither grow with the number of
intruders nor stop when there are none. So by default *whole encounters* are judged: the nearest approach of
each is compared with those of a share of all others.

The nearest of several noisy positions is too near, by 8 cm for a noise of 5 cm: `smooth_paths`.
"""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ..core.checks import Array, check_columns, check_rows, require
from ..core.errors import DataError, warn
from ..tracks import funnels
from .ellipses import unit_vectors

R_MAX = 2.0
"""Longest distance that counts as close [m] (paper, sec. 2)."""
# Share of samples that the paper removes as outliers (paper, sec. 2).
FRACTION = 0.002
N_NEIGHBOURS = 20
"""Neighbours that LOF compares a sample with, and the minimum for an encounter (assumed; scikit-learn's
default)."""
NEIGHBOUR_SHARE = 0.02
"""Neighbours of an encounter, as a share of all (measured: 1 % misses crowds of intruders, 5 % near ones)."""
OUTLIER_FACTOR = 2.0
"""Local outlier factor above which an encounter is an outlier (measured: up to 1.7 at the edge of a zone)."""
# Spread of the noise that separates identical samples for LOF [m] (assumed; the sensor's resolution).
JITTER = 1e-3
# Paths are smoothed over this time before and after [s] (measured: 0.5 s leaves an effect of 5 cm noise).
SMOOTHING = 0.7

_DEGREE = 2  # of the smoothing polynomial
_TICK = 0.1  # time between samples [s]


def complementary_points(samples: pd.DataFrame, *, r_max: float = R_MAX) -> Array:
    """Points (x', y') = (r_max - distance) (cos los_angle, sin los_angle) of `samples`, shape (n, 2) [m].

    Raises DataError if a distance is not within [0, `r_max`], or a value is not finite.

    Examples
    --------
    >>> import pandas as pd
    >>> from szlib.zones import complementary_points
    >>> samples = pd.DataFrame({"los_angle": [0.0], "distance": [0.5]})
    >>> complementary_points(samples, r_max=2.0).tolist()
    [[1.5, 0.0]]
    """
    columns = ["los_angle", "distance"]
    check_columns(samples, columns)
    angle, distance = samples[columns].to_numpy(float).T
    is_valid = np.isfinite(angle) & (distance >= 0) & (distance <= r_max)
    check_rows(
        samples,
        is_valid,
        columns,
        f"expected 0 <= distance <= r_max = {r_max} m and a finite los_angle",
    )
    return (r_max - distance)[:, None] * unit_vectors(angle)


def is_close(distance: Array, r_max: float) -> NDArray[np.bool_]:
    """Whether each `distance` (n,) is at most `r_max` [m]; raises DataError if none is."""
    close: NDArray[np.bool_] = distance <= r_max
    if not close.any():
        raise DataError(
            f"none of {len(distance)} samples is within r_max = {r_max} m (nearest: "
            f"{distance.min():.2f} m); are distances in metres?"
        )
    return close


def encounter_numbers(samples: pd.DataFrame) -> tuple[NDArray[np.intp], pd.DataFrame]:
    """The number of the encounter of each of `samples` (n,), and the first sample of each encounter.

    Numbers follow the order of appearance. The columns `encounter` and, if there is one, `day` identify an
    encounter; without `encounter`, each sample counts as one.
    """
    number: NDArray[np.intp] = np.arange(len(samples))
    if "encounter" in samples:
        keys = [name for name in ("day", "encounter") if name in samples]
        groups = samples.groupby(keys, sort=False, observed=True, dropna=False)
        number = np.asarray(groups.ngroup(), np.intp)
    return number, samples.iloc[np.unique(number, return_index=True)[1]]


def pair_numbers(samples: pd.DataFrame) -> NDArray[np.intp]:
    """The number of the pair of people of each of `samples` (n,), on each day, whoever is the reference."""
    people = pd.DataFrame(np.sort(samples[["ref_id", "other_id"]].to_numpy(), axis=1))
    day = np.asarray(samples.get("day", np.zeros(len(samples))))
    return np.asarray(
        people.groupby([day, 0, 1], observed=True, dropna=False).ngroup(), np.intp
    )


def nearest_approaches(samples: pd.DataFrame) -> pd.DataFrame:
    """The nearest of the `samples` of each encounter (see `encounter_numbers`), one row for each."""
    check_columns(samples, ["los_angle", "distance"])
    number = encounter_numbers(samples)[0]
    order = np.lexsort((samples["los_angle"], samples["distance"], number))
    return samples.iloc[order[np.r_[True, np.diff(number[order]) > 0]]]


def smooth_paths(
    samples: pd.DataFrame, column: str = "los_angle"
) -> tuple[Array, Array]:
    """Line-of-sight angle [rad] and distance [m] of `samples` (n,) along smoothed paths, in the same order.

    The angle is that of a `column`: los_angle, or other_los_angle.

    Local polynomials of degree 2 over +-`SMOOTHING` (Savitzky & Golay, 1964) smooth each encounter, but not
    across a gap in time. Straight and evenly curved paths do not change. Without a column `t`, no path does.
    """
    angle, distance = samples[[column, "distance"]].to_numpy(float).T
    if "t" not in samples:
        return angle, distance
    number = encounter_numbers(samples)[0]
    t = samples["t"].to_numpy(float)
    order = np.lexsort([t, number])
    path = (distance * np.exp(1j * angle))[order]
    is_gap = np.abs(np.diff(t[order]) - _TICK) > _TICK / 2
    is_end = is_gap | (np.diff(number[order]) != 0)
    starts = np.flatnonzero(np.append(True, is_end))
    lengths = np.diff(np.append(starts, len(path)))
    for length in np.unique(lengths[lengths > _DEGREE + 1]):
        rows = starts[lengths == length][:, None] + np.arange(length)
        path[rows] = path[rows] @ _smoothing_matrix(length).T
    path = path[np.argsort(order)]
    return np.angle(path), np.abs(path)


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


def local_outlier_factors(points: Array, n_neighbours: int) -> Array:
    """The local outlier factor of each of `points` (n, d), shape (n,).

    It compares the distance of a point from its `n_neighbours` nearest neighbours with their distances from
    their own neighbours, and is about 1 for an inlier (Breunig et al., 2000). Raises DataError unless
    1 <= n_neighbours < n.

    The points are sorted into narrow strips along y, so that successive points have the same neighbours and
    these are in the processor's cache. The order does not change the factors; at the paper's 500,000 samples
    it halves the time.
    """
    _check_neighbours(n_neighbours, len(points))
    from sklearn.neighbors import LocalOutlierFactor

    across = points[:, 0]
    width = np.ptp(across) / math.sqrt(len(points)) or 1.0
    order = np.lexsort((points[:, 1], np.floor((across - across.min()) / width)))
    lof = LocalOutlierFactor(n_neighbors=n_neighbours).fit(points[order])
    factors = np.empty(len(points))
    factors[order] = -lof.negative_outlier_factor_
    return factors


def is_outlier(
    samples: pd.DataFrame,
    *,
    fraction: float | None = None,
    r_max: float = R_MAX,
    n_neighbours: int | None = None,
) -> NDArray[np.bool_]:
    """Find the outliers among samples within r_max.

    By default whole encounters are judged by their nearest approach. All samples of an encounter are
    outliers if it is nearer than half of the others, and its local outlier factor exceeds `OUTLIER_FACTOR`.
    This is repeated for the remaining encounters until there are no more outliers, because a crowd of
    intruders hides those in its middle. Copies count once.

    Parameters
    ----------
    samples : a table with los_angle [rad], distance [m] (encounter and day, and speed [m/s]).
    fraction : None judges encounters. A number is the paper's method (`FRACTION`, with `N_NEIGHBOURS`): this
        share of the samples is removed, whatever the data; 0 removes none.
    r_max : longest distance [m].
    n_neighbours : number of neighbours of each encounter (None: a share of `NEIGHBOUR_SHARE`, at least
        `N_NEIGHBOURS`), or of each sample (None: `N_NEIGHBOURS`).

    Returns
    -------
    Whether each sample is an outlier, shape (n,).

    Raises
    ------
    DataError : a parameter is invalid, or there are too few samples for the neighbours.

    Warns
    -----
    DataWarning : there are `N_NEIGHBOURS` encounters or fewer, so that none can be judged.

    Examples
    --------
    >>> import numpy as np
    >>> import pandas as pd
    >>> from szlib.zones import is_outlier
    >>> samples = pd.DataFrame({"los_angle": np.linspace(0, 6, 100), "distance": [0.1] + 99 * [1.5]})
    >>> np.flatnonzero(is_outlier(samples, fraction=0.01)).tolist()
    [0]
    """
    points = complementary_points(samples, r_max=r_max)
    if fraction is None:
        nearest = nearest_approaches(samples)
        places, place = np.unique(
            complementary_points(nearest, r_max=r_max), axis=0, return_inverse=True
        )
        is_far = _find_far(places, n_neighbours)[place.ravel()]
        return is_far[encounter_numbers(samples)[0]]
    require(
        0 <= fraction <= 0.5,
        "fraction",
        fraction,
        "within [0, 0.5], or None to judge whole encounters",
    )
    if fraction == 0:
        return np.zeros(len(points), bool)
    n_neighbours = N_NEIGHBOURS if n_neighbours is None else n_neighbours
    _check_neighbours(n_neighbours, len(points))
    factors = local_outlier_factors(
        _separate_copies(points, n_neighbours), n_neighbours
    )
    return factors > np.quantile(factors, 1 - fraction)


def remove_outliers(
    samples: pd.DataFrame,
    *,
    fraction: float | None = None,
    r_max: float = R_MAX,
    n_neighbours: int | None = None,
) -> pd.DataFrame:
    """Select the samples within r_max that are not outliers.

    `remove_outliers(samples, fraction=0.002, r_max=2.0)` is the method of the paper.

    Parameters
    ----------
    samples : as from `szlib.find_encounters`.
    fraction, r_max, n_neighbours : as in `szlib.zones.is_outlier`; so are warnings and errors.

    Examples
    --------
    >>> import szlib
    >>> path = szlib.make_plaza("plaza.csv", settings=szlib.PlazaSettings(n_encounters=100))
    >>> samples = szlib.find_encounters(szlib.read_tracks(path))
    >>> inliers = szlib.remove_outliers(samples, fraction=0.002, r_max=2.0)
    >>> len(inliers) < len(samples)
    True
    """
    require(0 < r_max < np.inf, "r_max", r_max, "a positive distance in metres")
    check_columns(samples, ["los_angle", "distance"])
    check_rows(
        samples,
        samples["distance"].notna(),
        ["distance"],
        "expected a distance; drop the row",
    )
    near = is_close(samples["distance"].to_numpy(float), r_max)
    close = funnels.select(samples, near, "samples: close", f"farther than {r_max} m")
    outlier = is_outlier(
        close,
        fraction=fraction,
        r_max=r_max,
        n_neighbours=n_neighbours,
    )
    return funnels.select(
        close,
        ~outlier,
        "samples: inliers",
        "outlier (LOF)" if fraction is not None else "of an outlying encounter (LOF)",
    )


def _find_far(places: Array, n_neighbours: int | None) -> NDArray[np.bool_]:
    """Which places of nearest approaches (n, 2), all different, are outliers and nearer than most others."""
    is_far = np.zeros(len(places), bool)
    reach = np.hypot(*places.T)
    if n_neighbours is None and len(places) <= N_NEIGHBOURS:
        warn(
            f"{len(places)} encounters are too few to find outliers (LOF compares each with {N_NEIGHBOURS} "
            "others), so none is removed; add data, or pass a smaller n_neighbours",
            3,
        )
        return is_far
    while True:
        rest = np.flatnonzero(~is_far)
        usual = max(N_NEIGHBOURS, math.ceil(NEIGHBOUR_SHARE * len(rest)))
        n = usual if n_neighbours is None else n_neighbours
        if is_far.any() and len(rest) <= n:
            return is_far
        is_new = local_outlier_factors(places[rest], n) > OUTLIER_FACTOR
        is_new &= reach[rest] > np.median(reach)
        if not is_new.any():
            return is_far
        is_far[rest[is_new]] = True


def _check_neighbours(n_neighbours: int, n: int) -> None:
    """Raise DataError unless each of n samples has this number of neighbours."""
    if not (isinstance(n_neighbours, int | np.integer) and 1 <= n_neighbours < n):
        raise DataError(
            "n_neighbours must be a whole number >= 1, and smaller than the number of samples (or "
            f"encounters) within r_max; got {n_neighbours} neighbours, {n} samples; add data, or pass a "
            "smaller n_neighbours"
        )


def _separate_copies(points: Array, n_neighbours: int) -> Array:
    """Add a little noise, with a DataWarning, if so many points coincide that LOF has no density."""
    copies = np.unique(points, axis=0, return_counts=True)[1].max()
    if copies <= n_neighbours // 2:
        return points
    warn(
        f"up to {copies} samples coincide, so that LOF has no density to compare; "
        f"it compares them with {JITTER * 1e3:g} mm of noise (the samples do not change)",
        3,
    )
    return points + np.random.default_rng(0).normal(0, JITTER, points.shape)
