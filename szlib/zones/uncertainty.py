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

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.stats import norm

from ..core.checks import Array, require
from .ellipses import DIRECTIONS, ellipse_reach
from .estimators import Estimator
from .outliers import encounter_numbers, pair_numbers

# Sides of the reference pedestrian, 45 deg each.
SIDES = (
    "ahead", "ahead left", "left", "behind left", "behind", "behind right", "right", "ahead right"
)  # fmt: skip
# Encounters of reference pedestrians up to this much slower or faster are pooled [m/s] (assumed).
SPEED_BAND = 0.2
MIN_ENCOUNTERS = 20  # encounters needed on each side: a share of 5 % of fewer is less than one (assumed)
MIN_DAYS = 10  # number of days from which on whole days are resampled instead of pairs of people (assumed)
LEVEL = 0.95  # share of data sets whose interval contains the limit
N_RESAMPLES = 200  # zones estimated again for the intervals (assumed)
# Quantities with intervals: centre and semi-axes [m], angle [deg], area [m2].
QUANTITIES = ("center_x", "center_y", "a", "b", "angle_deg", "area")
# Share of the pairs in a subsample, and rate at which a hull in d = 3 dimensions approaches a smooth body,
# n^-(2 / (d + 1)) (Barany, Math. Ann. 285, 1989); measured on plazas: 0.49.
SUBSAMPLE, RATE = 0.25, 0.5

_MAX_BIAS = 1.0  # largest bias that is corrected [standard deviations]
_MAX_FAILED = 0.1  # share of resamples without a zone beyond which there is no interval


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """Intervals of a zone by speed.

    Parameters
    ----------
    level : share of data sets whose interval contains the limit.
    n_resamples : number of zones estimated again.
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
    number = encounter_numbers(close)[0]
    side = np.rint(
        close["los_angle"].to_numpy(float) / (2 * np.pi / len(SIDES))
    ).astype(int) % len(SIDES)
    rows = []
    for speed in speeds:
        in_band = np.abs(close["speed"].to_numpy(float) - speed) <= SPEED_BAND
        seen = np.zeros((len(SIDES), number.max(initial=-1) + 1), bool)
        seen[side[in_band], number[in_band]] = True
        rows.append([speed, seen.any(axis=0).sum(), *seen.sum(axis=1)])
    table = pd.DataFrame(rows, columns=["speed", "encounters", *SIDES])
    return table.astype({"speed": float, **dict.fromkeys(table.columns[1:], int)})


def describe_missing_sides(counts: pd.DataFrame, speed: float) -> str:
    """Describe the sides with fewer than `MIN_ENCOUNTERS` encounters; "" if there are none.

    `counts` are as from `count_by_side`. If `speed` [m/s] lies between two of its rows, both must suffice.
    """
    known = counts["speed"].to_numpy(float)
    if not known.min() <= speed <= known.max():
        return f"at {speed:g} m/s no encounters were counted (only at {known.min():g} to {known.max():g} m/s)"
    rows = counts.iloc[
        [np.flatnonzero(known <= speed)[-1], np.flatnonzero(known >= speed)[0]]
    ]
    fewest = rows[list(SIDES)].min()
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
    estimator: Estimator, speeds: Sequence[float], *, n_resamples: int, seed: int
) -> Uncertainty:
    """Estimate intervals and bands by resampling.

    Parameters
    ----------
    estimator : of the zone.
    speeds : speeds that have a zone [m/s].
    n_resamples : number of zones estimated again, at least 2.
    seed : of the resampling.

    Raises
    ------
    DataError : `n_resamples` is not a whole number of at least 2.
    """
    is_count = isinstance(n_resamples, int | np.integer) and n_resamples >= 2
    require(
        is_count,
        "n_resamples",
        n_resamples,
        "a whole number, 0 (no intervals) or at least 2",
    )
    rng = np.random.default_rng(seed)
    unit, member = resampling_units(estimator.encounters)
    n = int(member.max()) + 1
    factor, resampled = 0.0, estimator.draw_posterior(n_resamples, speeds, rng)
    is_posterior = resampled is not None
    if is_posterior:
        description = f"posterior: {estimator.describe_posterior()}"
    elif estimator.is_extreme:
        size = max(1, round(SUBSAMPLE * n))
        drawn = (np.argsort(rng.random((n_resamples, n)), axis=1) < size).astype(int)
        ratio = (size / n) ** RATE
        factor = ratio / (1 - ratio)
        description = (
            f"subsampling: {size} of {n} {unit}; "
            f"differences times {factor:.2f} subtracted (rate {RATE:g})"
        )
    else:
        drawn = rng.multinomial(n, np.full(n, 1 / n), size=n_resamples)
        description = f"bootstrap: {n} of {n} {unit}, bias-corrected percentiles"
    ellipses = estimator.refit(np.ones((1, len(member))), speeds)
    if resampled is None:
        resampled = estimator.refit(drawn[:, member].astype(float), speeds)
    reach = ellipse_reach(ellipses)
    values = _quantities(ellipses)
    differences = _quantities(resampled) - values
    angle = QUANTITIES.index("angle_deg")
    differences[..., angle] = (differences[..., angle] + 90) % 180 - 90
    intervals = _interval(values, differences, factor, not is_posterior)
    bands = np.maximum(
        _interval(reach, ellipse_reach(resampled) - reach, factor, not is_posterior), 0
    )
    tables = (
        _interval_table(speeds, "quantity", QUANTITIES, intervals),
        _interval_table(speeds, "direction", DIRECTIONS, bands),
    )
    converged = estimator.has_converged()
    return Uncertainty(
        LEVEL, int(n_resamples), unit, description, *tables, has_converged=converged
    )


def _quantities(ellipses: Array) -> Array:
    """`QUANTITIES` (..., 6) of ellipses (..., 5)."""
    m, n, a, b, angle = np.moveaxis(ellipses, -1, 0)
    return np.stack([m, n, a, b, np.degrees(angle), np.pi * a * b], axis=-1)


def _interval(
    values: Array, differences: Array, factor: float, corrects: bool = True
) -> Array:
    """Low and high (2, s, k) around values (1, s, k), from the differences (r, s, k) of the resamples.

    With `factor` 0 the ends are percentiles: bias-corrected if `corrects`, else moved outwards to the value
    where it is outside. Otherwise the quantiles of the differences, times `factor`, are subtracted.
    """
    has_interval = np.isnan(differences).mean(axis=0) <= _MAX_FAILED
    tails, ends = (
        np.full((2, *has_interval.shape), np.nan),
        np.array([(1 - LEVEL) / 2, (1 + LEVEL) / 2]),
    )
    for at in zip(*np.nonzero(has_interval), strict=True):
        known = differences[:, *at][~np.isnan(differences[:, *at])]
        below = np.mean(known < 0) + np.mean(known == 0) / 2
        bias = (
            0.0
            if factor or not corrects
            else np.clip(norm.ppf(below), -_MAX_BIAS, _MAX_BIAS)
        )
        tails[:, *at] = np.quantile(known, norm.cdf(2 * bias + norm.ppf(ends)))
    if not corrects:
        tails = np.stack([np.minimum(tails[0], 0), np.maximum(tails[1], 0)])
    return np.asarray(values - factor * tails[::-1] if factor else values + tails)


def _interval_table(
    speeds: Sequence[float], name: str, values: Sequence[str] | Array, interval: Array
) -> pd.DataFrame:
    return pd.DataFrame(
        {
            "speed": np.repeat(np.asarray(speeds, float), len(values)),
            name: np.tile(np.asarray(values), len(speeds)),
            "low": interval[0].ravel(),
            "high": interval[1].ravel(),
        }
    )
