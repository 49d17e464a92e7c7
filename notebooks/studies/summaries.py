"""Means of comparisons with their intervals, for the tables of several notebooks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from studies.literature_zones import ZONES

from szlib.core.errors import SolverError
from szlib.simulation import METHOD

METRICS = (
    "success",
    "time_to_goal",
    "path_length",
    "time_stopped",
    "jerk",
    "min_clearance",
    *(f"inside {name}" for name in ZONES),
    "flagged_steps",
    "unflagged_violations",
)
"""Columns that are compared; seconds, metres, m2/s6, steps."""


def summarise(
    rows: pd.DataFrame,
    by: Sequence[str] = METHOD,
    metrics: Sequence[str] = METRICS,
    *,
    against: Mapping[str, str] | None = None,
    level: float = 0.95,
    resamples: int = 2000,
    seed: int = 0,
) -> pd.DataFrame:
    """Means over worlds, with percentile bootstrap intervals.

    A bootstrap sample draws worlds, each with the runs of all methods: comparisons are paired.

    Parameters
    ----------
    rows : rows of `compare`.
    by : columns that name a method.
    metrics : columns to average; worlds without a value (no time to a goal that is not reached) are left out.
    against : the method, such as {"zone": "fitted"}, that is subtracted from all others in each world;
        columns that are not named keep their own value.
    level : level of the intervals.
    resamples : number of bootstrap samples.
    seed : seed of the bootstrap.

    Returns
    -------
    One row for each method and metric: `by`, metric, mean, low, high, n (number of worlds with a value), and
    first, the value in the first world; NaN without a value.

    Raises
    ------
    SolverError : the level is not in (0, 1), or the number of samples is not positive.
    """
    if not 0 < level < 1 or resamples < 1:
        raise SolverError(f"level must be in (0, 1) and resamples positive; got {level}, {resamples}")
    values = rows.set_index(["seed", *by])[list(metrics)].astype(float)
    if against is not None:
        rest = [name for name in by if name not in against]
        base = rows[(rows[list(against)] == pd.Series(against)).all(axis=1)]
        values = values - base.set_index(["seed", *rest])[list(metrics)].astype(float)
        values = values.reorder_levels(["seed", *by])
    wide = values.unstack(list(by))
    drawn = np.random.default_rng(seed).integers(len(wide), size=(resamples, len(wide)))
    counts = np.stack([np.bincount(row, minlength=len(wide)) for row in drawn])
    weight = counts @ wide.notna().to_numpy()
    means = np.full(weight.shape, np.nan)
    np.divide(counts @ wide.fillna(0.0).to_numpy(), weight, out=means, where=weight > 0)
    low, high = pd.DataFrame(means).quantile([(1 - level) / 2, (1 + level) / 2]).to_numpy()
    table = pd.DataFrame(wide.columns.tolist(), columns=["metric", *by])
    table = table.assign(mean=np.asarray(wide.mean()), low=low, high=high, n=np.asarray(wide.count()))
    return table.assign(first=wide.iloc[0].to_numpy())[[*by, "metric", "mean", "low", "high", "n", "first"]]
