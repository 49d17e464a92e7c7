"""How certain a zone is: how many encounters each side has, and confidence intervals by resampling.

Samples of one encounter are not independent, and two encounters of the same two people are not either. So
*pairs of people* are resampled (or whole days, if there are many), and the zone is estimated again.

- An estimate such as a quantile (`notebooks/studies/quantile_zone.py`) varies to both sides. As many pairs as
  there are are drawn with replacement, and the middle 95 % of the zones are the interval, corrected for their
  bias so that the zone itself is the median (bootstrap, BC percentiles; Efron, J. Am. Stat. Assoc. 82, 1987).
- An extreme does not: no resample has nearer people than the data, so all its zones lie on one side. The same
  holds for the hull of the data and the hull of all people there are. A hull's distance from its limit falls
  as n^-`RATE`. So the hulls of a share of the pairs, drawn without replacement, differ from the hull of all
  pairs by (share^-RATE - 1) times its difference from the limit. The interval comes from these differences,
  divided by this factor and subtracted (subsampling with a finite share; Politis & Romano, Ann. Statist. 22,
  1994; for a quarter and rate 1/2 the factor is 1).

An interval is meant to contain the *limit*: the zone that the same method would give for all people there
are. Those of the quantile contain it in 90 to 98 % of 400 plazas of 600 pairs, for each quantity and speed
(notebook 25); for 300 pairs in 91 %, for 150 in 81 %. They contain the true edge of the plaza's zones less
often, the semi-axes in 33 to 87 %: the limit lies up to 2 cm outside of it, depending on people's clearance,
which cannot be observed. The centre lies up to 3 cm behind, because both people's zones mix. The limit of a
hull is the true edge. Its intervals contain it in 91 to 100 % of 200 centred plazas.

The respect zone has a posterior distribution, and its intervals are the middle 95 % of that. They are meant
to contain the *truth*, not the limit (see `szlib.zones.respect`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.stats import norm, percentileofscore

from ..core.checks import Array, require
from .ellipses import DIRECTIONS, Ellipse, ellipse_reach, find_neighbours
from .estimators import Estimator
from .outliers import encounter_numbers, pair_numbers

# Sides of the reference pedestrian, 45 deg each.
SIDES = (
    "ahead",
    "ahead left",
    "left",
    "behind left",
    "behind",
    "behind right",
    "right",
    "ahead right",
)
# Encounters of reference pedestrians up to this much slower or faster are pooled [m/s] (assumed).
SPEED_BAND = 0.2
MIN_ENCOUNTERS = 20  # encounters needed on each side: a share of 5 % of fewer is less than one (assumed)
MIN_DAYS = 10  # number of days from which on whole days are resampled instead of pairs of people (assumed)
LEVEL = 0.95  # share of data sets whose interval contains the limit
N_RESAMPLES = 200  # zones estimated again for the intervals (assumed)
# Quantities with intervals: centre and semi-axes [m], angle [deg], area [m2].
QUANTITIES = ("center_x", "center_y", "a", "b", "angle_deg", "area")
SUBSAMPLE = 0.25  # share of the pairs in a subsample
# Rate at which a hull in d = 3 dimensions approaches a smooth body, n^-(2 / (d + 1)) (Barany, Math. Ann. 285,
# 1989); measured on plazas: 0.49.
RATE = 0.5

_MAX_BIAS = 1.0  # largest bias that is corrected [standard deviations]
_MAX_FAILED = 0.1  # share of resamples without a zone beyond which there is no interval


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """Intervals of a zone by speed.

    Parameters
    ----------
    level : share of data sets whose interval contains the limit.
    n_resamples : number of zones estimated again, or of draws from a posterior.
    unit : what is resampled: "pairs" of people, "encounters" if people have no ids, or "days".
    description : the method and its numbers.
    intervals : speed [m/s], quantity (one of `QUANTITIES`), low, high; NaN if too few resamples have a zone.
        Low and high of an angle may be outside (-90, 90] deg.
    bands : speed [m/s], direction [rad], low, high [m]: distance from the person to the ellipse.
    has_converged : whether the draws of a posterior agree and are enough.
    """

    level: float
    n_resamples: int
    unit: str
    description: str
    intervals: pd.DataFrame
    bands: pd.DataFrame
    has_converged: bool = True


def count_by_side(
    samples: pd.DataFrame, speeds: Sequence[float], *, r_max: float
) -> pd.DataFrame:
    """Count the encounters within `r_max` [m] on each side, by speed of the reference pedestrian.

    The table has one row for each of the `speeds` (+-`SPEED_BAND`): speed [m/s], encounters, and one column
    for each of `SIDES`. `samples` are as from `szlib.find_encounters`.

    Examples
    --------
    >>> import pandas as pd
    >>> from szlib.zones import count_by_side
    >>> samples = pd.DataFrame(
    ...     {"encounter": [0, 0, 1], "los_angle": [0.0, 0.1, 0.0], "distance": 1.0, "speed": 1.1}
    ... )
    >>> count_by_side(samples, [1.1], r_max=2.0)["ahead"].tolist()
    [2]
    """
    close = samples[samples["distance"] <= r_max]
    side = np.rint(close["los_angle"] / (2 * np.pi / len(SIDES))) % len(SIDES)
    met = pd.DataFrame({"side": side, "encounter": encounter_numbers(close)[0]})
    rows = []
    for speed in speeds:
        in_band = met[(close["speed"] - speed).abs() <= SPEED_BAND]
        by_side = in_band.groupby("side")["encounter"].nunique()
        counts = by_side.reindex(range(len(SIDES)), fill_value=0)
        rows.append([float(speed), in_band["encounter"].nunique(), *counts])
    return pd.DataFrame(rows, columns=["speed", "encounters", *SIDES])


def describe_missing_speed(counts: pd.DataFrame, speed: float) -> str:
    """Say if a `speed` [m/s] is slower or faster than all encounters; "" if not.

    `counts` are as from `count_by_side`.
    """
    seen = counts.loc[counts["encounters"] > 0, "speed"]
    if seen.min() <= speed <= seen.max():
        return ""
    if seen.empty:
        return f"at {speed:g} m/s no encounters were counted"
    return f"at {speed:g} m/s no encounters were counted (only at {seen.min():g} to {seen.max():g} m/s)"


def describe_missing_sides(counts: pd.DataFrame, speed: float) -> str:
    """Describe the sides with fewer than `MIN_ENCOUNTERS` encounters; "" if there are none.

    `counts` are as from `count_by_side`. If `speed` [m/s] lies between two of its rows, both must suffice.
    """
    if missing := describe_missing_speed(counts, speed):
        return missing
    known = counts["speed"]
    near = known.isin(find_neighbours(known, speed))
    fewest = counts.loc[near, list(SIDES)].min()
    few = [
        f"{side} ({count})" for side, count in fewest.items() if count < MIN_ENCOUNTERS
    ]
    if not few:
        return ""
    return f"at {speed:g} m/s fewer than {MIN_ENCOUNTERS} encounters were seen {', '.join(few)}"


def resampling_units(encounters: pd.DataFrame) -> tuple[str, NDArray[np.intp]]:
    """What is resampled, and the number of the unit of each row of `encounters`, shape (n,)."""
    if "day" in encounters and encounters["day"].nunique() >= MIN_DAYS:
        return "days", pd.factorize(encounters["day"])[0]
    if not {"ref_id", "other_id"} <= set(encounters):
        return "encounters", np.arange(len(encounters))
    return "pairs", pair_numbers(encounters)


def estimate_uncertainty(
    estimator: Estimator,
    ellipses: Mapping[float, Ellipse],
    *,
    n_resamples: int,
    seed: int,
) -> Uncertainty:
    """Estimate intervals and bands by resampling.

    Parameters
    ----------
    estimator : of the zone.
    ellipses : of the zone, by speed [m/s].
    n_resamples : number of zones estimated again, at least 2. A posterior has as many draws as it needs.
    seed : of the resampling; the draws of a posterior have their own.

    Raises
    ------
    DataError : `n_resamples` is not a whole number of at least 2.
    """
    require(
        isinstance(n_resamples, int | np.integer) and n_resamples >= 2,
        "n_resamples",
        n_resamples,
        "a whole number, 0 (no intervals) or at least 2",
    )
    rng = np.random.default_rng(seed)
    unit, member = resampling_units(estimator.encounters)
    n = member.max() + 1
    speeds = list(ellipses)
    estimate = _quantities(np.array([e.parameters for e in ellipses.values()]))
    posterior = estimator.posterior(speeds)
    if posterior is not None:
        description = f"posterior: {posterior}"
        n_resamples = posterior.n_evaluated
        low, high = _find_percentiles(_quantities(posterior.values) - estimate)
        ends = np.stack([np.minimum(low, 0), np.maximum(high, 0)])
    elif estimator.is_extreme:
        size = max(1, round(SUBSAMPLE * n))
        ratio = (size / n) ** RATE
        factor = ratio / (1 - ratio)
        description = (
            f"subsampling: {size} of {n} {unit}; "
            f"differences times {factor:.2f} subtracted (rate {RATE:g})"
        )
        chosen = np.argsort(rng.random((n_resamples, n)), axis=1) < size
        drawn = estimator.refit(chosen[:, member].astype(float), speeds)
        ends = -factor * _find_percentiles(_quantities(drawn) - estimate)[::-1]
    else:
        description = f"bootstrap: {n} of {n} {unit}, bias-corrected percentiles"
        counts = rng.multinomial(n, np.full(n, 1 / n), size=n_resamples)
        drawn = estimator.refit(counts[:, member].astype(float), speeds)
        ends = _find_percentiles(_quantities(drawn) - estimate, corrects_bias=True)
    intervals, bands = np.split(estimate + ends, [len(QUANTITIES)], axis=-1)
    return Uncertainty(
        LEVEL,
        n_resamples,
        unit,
        description,
        _table(speeds, "quantity", QUANTITIES, intervals),
        _table(speeds, "direction", DIRECTIONS, np.maximum(bands, 0)),
        has_converged=posterior is None or posterior.has_converged,
    )


def _quantities(ellipses: Array) -> Array:
    """`QUANTITIES` of ellipses (..., 5), and their reach in each of `DIRECTIONS`, shape (..., 6 + 72)."""
    m, n, a, b, angle = np.moveaxis(ellipses, -1, 0)
    numbers = np.stack(
        [
            m,
            n,
            a,
            b,
            np.degrees(angle),
            np.pi * a * b,
        ],
        axis=-1,
    )
    return np.concatenate([numbers, ellipse_reach(ellipses)], axis=-1)


def _find_percentiles(differences: Array, corrects_bias: bool = False) -> Array:
    """Low and high end (2, s, k) of the middle `LEVEL` of differences (r, s, k) of `_quantities`.

    NaN if too many of them are NaN. If it `corrects_bias`, both levels are moved by twice the normal quantile
    of the share below 0.
    """
    angle = QUANTITIES.index("angle_deg")
    differences[..., angle] = (differences[..., angle] + 90) % 180 - 90
    ends = np.full((2, *differences.shape[1:]), np.nan)
    for at in np.ndindex(differences.shape[1:]):
        drawn = differences[:, *at]
        known = drawn[~np.isnan(drawn)]
        if len(known) >= (1 - _MAX_FAILED) * len(drawn):
            bias = 0.0
            if corrects_bias:
                below = percentileofscore(known, 0, kind="mean") / 100
                bias = np.clip(norm.ppf(below), -_MAX_BIAS, _MAX_BIAS)
            levels = norm.cdf(2 * bias + norm.ppf([(1 - LEVEL) / 2, (1 + LEVEL) / 2]))
            ends[:, *at] = np.quantile(known, levels)
    return ends


def _table(
    speeds: Sequence[float], name: str, values: Sequence[str] | Array, ends: Array
) -> pd.DataFrame:
    """Rows speed, a value of `name`, low, high from the `ends` (2, speeds, values) of intervals."""
    index = pd.MultiIndex.from_product([speeds, values], names=["speed", name])
    table = pd.DataFrame(ends.reshape(2, -1).T, index, columns=["low", "high"])
    return table.reset_index()
