"""Outliers of the distance data, by local outlier factor on complementary coordinates (paper, sec. 2).

LOF takes what lies in a sparse place for an outlier, and people are sparse where they are close to
each other, which is just where the zone ends.  The complementary distance r' = r_max - r turns the
data inside out: the many who keep their distance gather around the origin, and the few who come
close lie on the outside.
"""

from __future__ import annotations

import warnings

import numpy as np
import pandas as pd

from ..errors import DataError, DataWarning
from ..tracks import funnels
from ..tracks.clock import check_columns

R_MAX = 2.0
"""Longest distance that counts as close [m] (paper, sec. 2)."""
FRACTION = 0.002
"""Share of samples taken for outliers (paper, sec. 2)."""
NEIGHBOURS = 20
"""Neighbours that LOF compares a sample with (assumed; scikit-learn's default)."""
JITTER = 1e-3
"""Spread of the noise that parts identical points before LOF [m] (assumed; the sensor's resolution)."""


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


def is_outlier(
    samples: pd.DataFrame,
    *,
    fraction: float = FRACTION,
    r_max: float = R_MAX,
    neighbours: int = NEIGHBOURS,
    speed_scale: float | None = None,
) -> np.ndarray:
    """Which samples, all within r_max, LOF calls outliers; booleans, shape (n,).

    Parameters
    ----------
    samples : a table with los_angle [rad], distance [m] (and speed [m/s]).
    fraction : the share called outliers: a quota, not a detection; 0 calls none.
    r_max : longest distance [m].
    neighbours : compared with each sample.
    speed_scale : None compares (x', y'); a number compares (x', y', speed_scale * speed), so it is
        the distance [m] that a difference of 1 m/s is worth.

    Raises
    ------
    DataError : a parameter has no meaning, or there are too few samples for the neighbours.
    """
    from sklearn.neighbors import LocalOutlierFactor

    if not 0 <= fraction <= 0.5:
        raise DataError(f"fraction must be within [0, 0.5]; got {fraction}")
    points = complementary_points(samples, r_max=r_max)
    if fraction == 0:
        return np.zeros(len(points), bool)
    if not (isinstance(neighbours, int | np.integer) and 1 <= neighbours < len(points)):
        raise DataError(
            f"LOF needs a whole number >= 1 of neighbours, and more samples than that within {r_max} m; "
            f"got {neighbours} neighbours, {len(points)} samples; add data, or pass fewer neighbours"
        )
    if speed_scale is not None:
        points = np.column_stack([points, speed_scale * _speeds(samples, speed_scale)])
    copies = int(np.unique(points, axis=0, return_counts=True)[1].max())
    if copies > neighbours // 2:
        warnings.warn(
            f"up to {copies} samples coincide, so that LOF has no density to compare; "
            f"it sees them with {JITTER * 1e3:g} mm of noise (the samples stay as they are)",
            DataWarning,
            stacklevel=2,
        )
        points = points + np.random.default_rng(0).normal(0, JITTER, points.shape)
    labels = LocalOutlierFactor(n_neighbors=neighbours, contamination=fraction).fit_predict(points)
    return np.asarray(labels == -1)


def remove_outliers(
    samples: pd.DataFrame,
    fraction: float = FRACTION,
    r_max: float = R_MAX,
    *,
    neighbours: int = NEIGHBOURS,
    speed_scale: float | None = None,
) -> pd.DataFrame:
    """The samples within r_max that are no outliers; parameters and errors as in `is_outlier`."""
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
    stages = [
        *funnels.of(samples),
        funnels.stage(
            "samples: close", len(samples), len(close), {f"farther than {r_max} m": len(samples) - len(close)}
        ),
        funnels.stage("samples: inliers", len(close), len(kept), {"outlier (LOF)": int(outlier.sum())}),
    ]
    return funnels.carry(kept, stages)


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
