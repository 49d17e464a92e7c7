"""How sure a zone is: who was seen where, and what other people might have given.

Samples of one encounter are no independent evidence, nor are two encounters of the same two people.  So
*pairs of people* are drawn anew (or whole days, where there are many), and the zone is estimated again.

- A quantile moves to both sides: drawn with replacement, as many as there are, the middle 95 % of the
  zones are the interval, moved against their bias: the zone itself is to be their median (bootstrap, BC
  percentiles; Efron, J. Am. Stat. Assoc. 82, 1987).
- An extreme does not: no resample of the hull's people has nearer ones than they had, so the bootstrap's
  zones all lie on one side, and so does the hull of all people seen of the one of all people there are.
  A hull's distance from its limit falls as n^-`RATE`.  So the hulls of a share of the pairs, drawn without
  replacement, differ from the hull of all by (share^-RATE - 1) times what that one still differs from its
  limit: the interval is where the differences, divided by this and taken back, lead (subsampling with a
  finite share; Politis & Romano, Ann. Statist. 22, 1994; for a quarter and rate 1/2 the factor is 1).

What an interval is to hold is the *limit*: the zone that the same method would give of all the people there
are. Those of the quantile hold it in 90 to 98 % of 400 plazas of 600 pairs, each quantity at each speed
(notebook 16); of 300 pairs in 91 %, of 150 in 81 %. They hold the edge that the plaza's people keep to less
often, semi-axes in 33 to 87 %: the limit lies up to 2 cm outside of it, by how much hangs on how far people
keep clear of it, which no data tells; and its centre up to 3 cm behind, for both people's zones mix. A
hull's limit is that edge itself; its intervals hold it in 91 to 100 % of 200 centred plazas, those
of the respect zone in 40 to 100 % of 20.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.stats import norm

from ..checks import Array
from ..errors import DataError
from .outliers import encounter_numbers
from .polar import DIRECTIONS, PolarZone, ellipse_reach
from .quantile import BAND

SECTORS = (
    "ahead", "ahead left", "left", "behind left", "behind", "behind right", "right", "ahead right"
)  # fmt: skip
"""Sides of the reference pedestrian, 45 deg each."""
NEEDED = 20
"""Encounters that must be seen on each side: a share of 5 % of fewer is less than one (assumed)."""
DAYS_NEEDED = 10
"""Days from which on whole days are drawn instead of pairs of people (assumed)."""
LEVEL = 0.95
"""Share of data sets whose interval is to hold the truth."""
RESAMPLES = 200
"""Zones estimated anew for the intervals (assumed)."""
QUANTITIES = ("center_x", "center_y", "a", "b", "angle_deg", "area")
"""What has an interval: centre and semi-axes [m], angle [deg], area [m2]."""
SUBSAMPLE, RATE = 0.25, 0.5
"""Share of the pairs in a subsample; rate at which a hull in d = 3 dimensions nears a body without corners,
n^-(2 / (d + 1)) (Barany, Math. Ann. 285, 1989); measured on plazas: 0.49."""

_BIAS = 1.0  # at most corrected [standard deviations]: of more, as where few were seen, no interval is left
_FAILED = 0.1  # share of resamples without a zone beyond which there is no interval


class Estimate(Protocol):
    """A way to zones that can be gone again with other people."""

    @property
    def extreme(self) -> bool:
        """Whether the zone is set by the nearest people alone."""
        ...

    @property
    def parameters(self) -> dict[str, Any]:
        """For the provenance."""
        ...

    @property
    def funnel(self) -> list[dict[str, Any]]:
        """Row counts of every stage."""
        ...

    @property
    def encounters(self) -> pd.DataFrame:
        """One row an encounter, in the order of the weights: encounter, and where known day and ids."""
        ...

    @property
    def vertices(self) -> NDArray[np.float64] | None:
        """Of the hull, where there is one."""
        ...

    def radii(self, speeds: Sequence[float]) -> PolarZone | None:
        """By direction at speeds, ascending [m/s]; None where the vertices tell all."""
        ...

    def refit(self, weights: Array, speeds: Sequence[float], rng: np.random.Generator | None = None) -> Array:
        """Ellipses (k, s, 5) for weights (k, n) of the encounters: centre, semi-axes, angle; NaN: none.

        What else is known from a draw only (a null model's shifts) is drawn anew by rng, if there is one.
        """
        ...

    def leave_one_out(self, speeds: Sequence[float]) -> tuple[NDArray[np.intp], Array]:
        """The encounters that matter most (k,), and the ellipses (k, s, 5) without each of them."""
        ...


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """Intervals of a zone by speed.

    Parameters
    ----------
    level : share of data sets whose interval is to hold the truth.
    resamples : zones estimated anew.
    unit : what was drawn: "pairs" of people, "encounters" where people have no ids, or "days".
    how : how, in words.
    intervals : speed [m/s], quantity (one of `QUANTITIES`), low, high; NaN where too few resamples had a
        zone.  An angle's low and high may leave (-90, 90] deg.
    bands : speed [m/s], direction [rad], low, high [m] of how far the ellipse reaches there.
    influence : speed [m/s], encounter (its number), metres: which encounter's absence moves centre or
        semi-axes most, and how far.
    """

    level: float
    resamples: int
    unit: str
    how: str
    intervals: pd.DataFrame
    bands: pd.DataFrame
    influence: pd.DataFrame


def count_seen(samples: pd.DataFrame, speeds: Sequence[float], *, r_max: float) -> pd.DataFrame:
    """Encounters seen within r_max [m] on each side, by speed of the reference pedestrian (+-`BAND`).

    One row a speed: speed [m/s], encounters, and one column for each of `SECTORS`.
    """
    close = samples[samples["distance"] <= r_max]
    number = encounter_numbers(close)[0]
    side = np.rint(close["los_angle"].to_numpy(float) / (2 * np.pi / len(SECTORS))).astype(int) % len(SECTORS)
    rows = []
    for speed in speeds:
        band = np.abs(close["speed"].to_numpy(float) - speed) <= BAND
        sides = np.unique(np.column_stack([side[band], number[band]]), axis=0)[:, 0]
        rows.append(
            [speed, len(np.unique(number[band])), *np.bincount(sides, minlength=len(SECTORS)).tolist()]
        )
    table = pd.DataFrame(rows, columns=["speed", "encounters", *SECTORS])
    return table.astype({"speed": float, **dict.fromkeys(table.columns[1:], int)})


def missing_sides(seen: pd.DataFrame, speed: float) -> str:
    """Which sides fewer than `NEEDED` encounters were seen on, at a speed counted or between; "": none."""
    known = seen["speed"].to_numpy(float)
    if not known.min() <= speed <= known.max():
        return f"at {speed:g} m/s nobody was counted (only at {known.min():g} to {known.max():g} m/s)"
    rows = seen.iloc[[np.flatnonzero(known <= speed)[-1], np.flatnonzero(known >= speed)[0]]]
    fewest = rows[list(SECTORS)].min()
    few = [f"{side} ({count})" for side, count in fewest.items() if count < NEEDED]
    return f"at {speed:g} m/s fewer than {NEEDED} encounters were seen {', '.join(few)}" if few else ""


def resampling_units(encounters: pd.DataFrame) -> tuple[str, NDArray[np.intp]]:
    """What is drawn anew, and which of them each encounter (one row each) belongs to, shape (n,)."""
    if "day" in encounters and encounters["day"].nunique() >= DAYS_NEEDED:
        return "days", pd.factorize(encounters["day"])[0]
    if not {"ref_id", "other_id"} <= set(encounters):
        return "encounters", np.arange(len(encounters))
    day = pd.factorize(encounters["day"])[0] if "day" in encounters else np.zeros(len(encounters), int)
    people = np.sort(np.column_stack([encounters["ref_id"], encounters["other_id"]]), axis=1)
    return "pairs", np.unique(np.column_stack([day, people]), axis=0, return_inverse=True)[1].ravel()


def measure(estimate: Estimate, speeds: Sequence[float], *, resamples: int, seed: int) -> Uncertainty:
    """Intervals, bands and influence of the zones of an estimate at speeds [m/s].

    `resamples` zones, at least 2, are estimated anew, from draws of the `seed`.  Raises DataError where
    `resamples` has no meaning.
    """
    if not (isinstance(resamples, int | np.integer) and resamples >= 2):
        raise DataError(f"resamples must be a whole number, 0 (no intervals) or at least 2; got {resamples}")
    rng = np.random.default_rng(seed)
    unit, member = resampling_units(estimate.encounters)
    n = int(member.max()) + 1
    if estimate.extreme:
        size = max(1, round(SUBSAMPLE * n))
        drawn = (np.argsort(rng.random((resamples, n)), axis=1) < size).astype(int)
        nearer = (size / n) ** RATE
        back = nearer / (1 - nearer)
        how = f"subsampling: {size} of {n} {unit}; {back:.2f} of the differences taken back (rate {RATE:g})"
    else:
        drawn = rng.multinomial(n, np.full(n, 1 / n), size=resamples)
        back, how = 0.0, f"bootstrap: {n} of {n} {unit}, bias-corrected percentiles"
    ellipses = estimate.refit(np.ones((1, len(member))), speeds)
    others = estimate.refit(drawn[:, member].astype(float), speeds, rng)
    reach = ellipse_reach(ellipses)
    known = _quantities(ellipses)
    away = _quantities(others) - known
    angle = QUANTITIES.index("angle_deg")
    away[..., angle] = (away[..., angle] + 90) % 180 - 90
    return Uncertainty(
        LEVEL,
        int(resamples),
        unit,
        how,
        _table(speeds, "quantity", QUANTITIES, _interval(known, away, back)),
        _table(
            speeds,
            "direction",
            DIRECTIONS,
            np.maximum(_interval(reach, ellipse_reach(others) - reach, back), 0),
        ),
        _influence(estimate, speeds, ellipses[0]),
    )


def _influence(estimate: Estimate, speeds: Sequence[float], ellipses: Array) -> pd.DataFrame:
    """Whose absence moves centre or semi-axes most, by speed; infinitely far where no zone is left."""
    tried, without = estimate.leave_one_out(speeds)
    moved = np.abs(without - ellipses)[..., :4].max(axis=-1)
    moved[np.isnan(moved)] = np.inf
    who = estimate.encounters["encounter"].to_numpy()[tried[np.argmax(moved, axis=0)]]
    return pd.DataFrame({"speed": list(speeds), "encounter": who, "metres": np.max(moved, axis=0)})


def _quantities(ellipses: Array) -> Array:
    """`QUANTITIES` (..., 6) of ellipses (..., 5)."""
    m, n, a, b, angle = np.moveaxis(ellipses, -1, 0)
    return np.stack([m, n, a, b, np.degrees(angle), np.pi * a * b], axis=-1)


def _interval(known: Array, away: Array, back: float) -> Array:
    """Low and high (2, s, k) of what is known (1, s, k), from how far away (r, s, k) others are.

    `back` 0: bias-corrected percentiles.  Else: as far on the other side, times `back`.
    """
    enough = np.isnan(away).mean(axis=0) <= _FAILED
    tails, ends = np.full((2, *enough.shape), np.nan), np.array([(1 - LEVEL) / 2, (1 + LEVEL) / 2])
    for at in zip(*np.nonzero(enough), strict=True):
        others = away[:, *at][~np.isnan(away[:, *at])]
        below = np.mean(others < 0) + np.mean(others == 0) / 2
        bias = 0.0 if back else np.clip(norm.ppf(below), -_BIAS, _BIAS)
        tails[:, *at] = np.quantile(others, norm.cdf(2 * bias + norm.ppf(ends)))
    return np.asarray(known - back * tails[::-1] if back else known + tails)


def _table(
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
