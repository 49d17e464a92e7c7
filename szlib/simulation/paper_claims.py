"""What data says of the paper's claims: each an effect with its 95 % interval, and a verdict.

An effect is written so that above 0 it is as the paper says.  Nothing is decided where the interval holds 0.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from math import log2, sqrt
from typing import Any

import numpy as np
import pandas as pd
from scipy.stats import binomtest, chi2

from ..checks import check_columns
from ..control.mpc import MPCCBF
from ..errors import DataError, ZoneError
from ..zones.ellipses import Ellipse
from ..zones.social_zone import SocialZone
from .closed_loop import simulate
from .scenarios.paper import SCENARIOS

PAPERS_RATE = 16_181 / 92
"""Encounters a day in the paper (sec. 2)."""
LEVEL = 0.95
"""Of every interval here."""
LARGER_AHEAD = "the zone reaches farther ahead than behind"
GROWS = "the zone grows with walking speed"
AS_MANY = "as many encounters a day as in the paper, within a factor of two"
LATER = "a larger zone makes the robot later"
OPPOSITE = "opposite"
"""The kind of encounter in which people pass each other."""


@dataclass(frozen=True)
class Finding:
    """One claim on one data set.

    Parameters
    ----------
    claim : the paper's sentence.
    effect, low, high : what was measured and its interval, in `unit`; above 0: as the paper says.
    unit : of the effect.
    n : encounters, pairs, days or runs it rests on.
    adequate : whether enough people were seen on every side; if not, nothing is decided.
    """

    claim: str
    effect: float
    low: float
    high: float
    unit: str
    n: int
    adequate: bool = True

    @property
    def verdict(self) -> str:
        """ "supported", "contradicted", or "not decidable" with the n it rests on."""
        if self.adequate and self.low > 0:
            return "supported"
        if self.adequate and self.high < 0:
            return "contradicted"
        return f"not decidable with n = {self.n:,}"

    def __str__(self) -> str:
        return f"{self.effect:+.2f} [{self.low:+.2f}, {self.high:+.2f}] {self.unit}: {self.verdict}"


def findings_table(findings: Iterable[Finding], *, data: str) -> pd.DataFrame:
    """One row a finding: data, claim, effect, low, high, unit, n, verdict."""
    rows = [(data, f.claim, f.effect, f.low, f.high, f.unit, f.n, f.verdict) for f in findings]
    return pd.DataFrame(rows, columns=["data", "claim", "effect", "low", "high", "unit", "n", "verdict"])


def as_cell(row: pd.Series[Any]) -> str:
    """A row of the table in few words: effect [low, high] unit, verdict."""
    return f"{row['effect']:+.2f} [{row['low']:+.2f}, {row['high']:+.2f}] {row['unit']}: {row['verdict']}"


def larger_ahead(zone: SocialZone, *, speed: float = 1.1) -> Finding:
    """The zone reaches farther ahead than behind, by twice the offset of its centre (sec. 1 and 4)."""
    center, low, high = _interval(zone, speed, "center_x")
    n, adequate = _encounters(zone, speed), zone.adequate(speed)
    return Finding(LARGER_AHEAD, 2 * center, 2 * low, 2 * high, "m", n, adequate)


def grows_with_speed(zone: SocialZone, *, slow: float = 0.7, fast: float = 1.3) -> Finding:
    """The zone's area grows with walking speed (fig. 5).

    The interval of the difference is recovered from those of both areas as if they were independent
    (MOVER; Zou and Donner, Statist. Med. 27, 2008): too wide rather than too narrow, for both rest on the
    same people.
    """
    area, low, high = _interval(zone, fast, "area")
    other, other_low, other_high = _interval(zone, slow, "area")
    effect = area - other
    down = sqrt((area - low) ** 2 + (other_high - other) ** 2)
    up = sqrt((high - area) ** 2 + (other - other_low) ** 2)
    n, adequate = min(_encounters(zone, v) for v in (slow, fast)), all(map(zone.adequate, (slow, fast)))
    return Finding(GROWS, effect, effect - down, effect + up, "m2", n, adequate)


def passes_on_the_right(samples: pd.DataFrame) -> Finding:
    """People who walk towards each other pass on the right: share of pairs, less one half (abstract).

    A pair passes on the right if each has the other to the left where they are closest.
    """
    check_columns(samples, ["day", "encounter", "ref_id", "other_id", "los_angle", "distance", "kind"])
    met = samples[samples["kind"] == OPPOSITE]
    closest = met.loc[met.groupby("encounter")["distance"].idxmin()] if len(met) else met
    people = np.sort(closest[["ref_id", "other_id"]].to_numpy(), axis=1).reshape(-1, 2)
    pairs = closest.assign(one=people[:, 0], two=people[:, 1]).drop_duplicates(["day", "one", "two"])
    return _share("people pass each other on the right", int((pairs["los_angle"] > 0).sum()), len(pairs))


def outliers_are_intruders(intruders: int, removed: int) -> Finding:
    """LOF finds the outliers: share of known intruders' samples among those removed, less one half."""
    return _share("what LOF removes are outliers", intruders, removed)


def as_many_a_day(encounters: int, days: float) -> Finding:
    """As many encounters a day as in the paper, within a factor of two: one less the doublings between."""
    if not (encounters >= 0 and days > 0):
        raise DataError(f"expected encounters >= 0 in days > 0; got {encounters} in {days}")
    low = chi2.ppf((1 - LEVEL) / 2, 2 * encounters) / 2 if encounters else 0.0
    high = chi2.ppf((1 + LEVEL) / 2, 2 * encounters + 2) / 2

    def within(count: float) -> float:
        """One less the doublings between so many and the paper's."""
        return 1 - abs(log2(max(count, 1e-9) / days / PAPERS_RATE))

    ends = sorted(map(within, (low, high)))
    top = 1.0 if low / days <= PAPERS_RATE <= high / days else ends[1]
    return Finding(AS_MANY, within(encounters), ends[0], top, "doublings", encounters)


def size_trades_efficiency(
    zone: Ellipse, *, scales: Sequence[float] = (0.8, 1.2), names: Iterable[str] = tuple(SCENARIOS)
) -> Finding:
    """A larger zone makes the robot later at its goal (sec. 4): least and greatest over the scenarios."""
    late = []
    for name in names:
        times = [run_with(name, zone.scaled(scale))["time_to_goal"] for scale in scales]
        late.append(times[-1] - times[0])
    claim = f"a zone {scales[-1] / scales[0]:.1f} times as large makes the robot later"
    return Finding(claim, float(np.mean(late)), float(np.min(late)), float(np.max(late)), "s", len(late))


def run_with(name: str, zone: Ellipse) -> dict[str, float]:
    """Metrics of a scenario of the paper with a zone."""
    scenario = replace(SCENARIOS[name], claims=())
    return simulate(scenario, MPCCBF(zone, walls=scenario.walls)).metrics()


def _interval(zone: SocialZone, speed: float, quantity: str) -> tuple[float, float, float]:
    """Value, low, high of a quantity at a speed, NaN where there is no zone; ZoneError if not asked for."""
    if speed in zone.undefined:
        return np.nan, np.nan, np.nan
    table = zone.table().set_index("speed")
    if speed not in table.index or zone.uncertainty is None:
        raise ZoneError(
            f"no interval at {speed:g} m/s; fit with speeds that hold it, and with n_resamples > 0"
        )
    value, low, high = (table[f"{quantity}{end}"].to_dict()[speed] for end in ("", "_low", "_high"))
    return float(value), float(low), float(high)


def _encounters(zone: SocialZone, speed: float) -> int:
    return (
        0
        if zone.side_counts is None
        else int(zone.side_counts.set_index("speed")["encounters"].to_dict()[speed])
    )


def _share(claim: str, hits: int, of: int) -> Finding:
    """A share less one half, with Wilson's interval; nothing is known of no trials."""
    if of == 0:
        return Finding(claim, np.nan, -0.5, 0.5, "share", 0)
    ends = binomtest(hits, of).proportion_ci(LEVEL, method="wilson")
    return Finding(claim, hits / of - 0.5, ends.low - 0.5, ends.high - 0.5, "share", of)
