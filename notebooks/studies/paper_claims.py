"""The claims of the paper, tested on data: each is an effect with an interval, and a verdict.

An effect above 0 supports the claim.  Where the interval contains 0, the data decide nothing.  The interval
is a 95 % interval, but for the delay of the robot: its runs are deterministic, so it is the range over the
scenarios.

Any zone has a shape, also that of people who ignore each other: at Grand Central the quantile zone of a
time-shifted crowd reaches farther ahead than behind.  So a claim about the shape is decided by
`measure_shape`, which compares with the null model.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import log2, sqrt
from typing import Any

import numpy as np
import pandas as pd
from scipy.stats import binomtest, chi2

from szlib.control.mpc import MPCCBF
from szlib.control.settings import MPCSettings
from szlib.core.checks import check_columns
from szlib.core.errors import DataError, ZoneError
from szlib.encounters.kinds import OPPOSITE
from szlib.encounters.null_model import NullEncounters
from szlib.simulation.catalogue import SCENARIOS
from szlib.simulation.closed_loop import simulate
from szlib.simulation.robot_run import Run
from szlib.simulation.scenario import Claim, Scenario
from szlib.workbook.claims import judge_effect
from szlib.workbook.record import NotebookRecord
from szlib.zones.ellipses import Ellipse
from szlib.zones.outliers import R_MAX
from szlib.zones.respect import MIN_COMPARED, RespectEstimator
from szlib.zones.respect_likelihood import zone_ellipses
from szlib.zones.social_zone import SocialZone

PAPER_RATE = 16_181 / 92  # encounters a day in the paper (sec. 2)
LEVEL = 0.95  # level of all confidence intervals here
# What `Finding.low` and `high` are, if people are a sample of all people.
CONFIDENCE = "95 % interval"
# What they are, if the runs are deterministic: the smallest and the largest effect.
RANGE = "range over scenarios"
# Attributes of a `Finding` that are columns of a table of findings.
COLUMNS = ("claim", "effect", "low", "high", "interval", "unit", "n", "verdict")
LARGER_AHEAD = "the zone reaches farther ahead than behind"
GROWS_WITH_SPEED = "the zone grows with walking speed"
# What the number is that decides a claim about a scenario.
UNITS = {
    "Avoidance starts farther away head-on than from behind.": "{:.2f} m farther",
    "Avoidance starts well before the zone.": "at h = {:.2f} m",
    "The robot slows down while passing.": "to {:.0%} of its greatest speed",
    "The robot waits.": "{:.1f} s",
    "The robot is in the way and goes back to make room.": "{:.2f} m back",
    "The robot enters the pathway after the person has left it.": "{:.1f} s later",
    "The robot goes on to its goal.": "{:.1f} s in all",
}
ENCOUNTER_RATE = "as many encounters a day as in the paper, within a factor of two"


@dataclass(frozen=True)
class Finding:
    """The result for one claim on one data set.

    Parameters
    ----------
    claim : the claim of the paper.
    effect, low, high : measured effect and its interval, in `unit`; above 0 supports the claim.
    unit : unit of the effect.
    n : number of encounters, pairs, days or runs.
    adequate : False if there are too few people on some side; then nothing is decided.
    interval : what `low` and `high` are: `CONFIDENCE` or `RANGE`.
    reason : why nothing can be decided; "": the interval says it.

    Examples
    --------
    >>> from studies import paper_claims
    >>> finding = paper_claims.measure_encounter_rate(encounters=16_181, days=92)
    >>> finding.verdict
    'supported'
    """

    claim: str
    effect: float
    low: float
    high: float
    unit: str
    n: int
    adequate: bool = True
    interval: str = CONFIDENCE
    reason: str = ""

    @property
    def verdict(self) -> str:
        """That of `judge_effect`; "not decidable" with n, and the reason."""
        found = judge_effect(self.low, self.high) if self.adequate else "not decidable"
        because = f": {self.reason}" if self.reason else ""
        return f"{found} with n = {self.n:,}{because}" if found == "not decidable" else found

    def __str__(self) -> str:
        return format_finding(self._row())

    def _row(self) -> dict[str, Any]:
        return {name: getattr(self, name) for name in COLUMNS}


def tabulate_findings(findings: Iterable[Finding], *, data: str) -> pd.DataFrame:
    """One row for each of `findings` on `data`: data, then the columns of `COLUMNS`."""
    rows = [{"data": data} | finding._row() for finding in findings]
    return pd.DataFrame(rows, columns=["data", *COLUMNS])


def format_finding(row: Mapping[str, Any] | pd.Series[Any]) -> str:
    """A `row` of `tabulate_findings` in few words: effect and unit (interval): verdict, or the verdict alone."""
    if np.isnan(row["effect"]):
        return str(row["verdict"])
    interval = f"{row['interval']} {row['low']:+.2f} to {row['high']:+.2f}"
    return f"{row['effect']:+.2f} {row['unit']} ({interval}): {row['verdict']}"


def measure_reach_ahead(zone: SocialZone, *, speed: float = 1.1) -> Finding:
    """The `zone` at a `speed` [m/s] reaches farther ahead than behind: twice its offset (sec. 1 and 4)."""
    center, low, high = _read_interval(zone, speed, "center_x")
    n, adequate = _count_encounters(zone, speed), zone.adequate(speed)
    return Finding(LARGER_AHEAD, 2 * center, 2 * low, 2 * high, "m", n, adequate)


def measure_growth_with_speed(zone: SocialZone, *, slow: float = 0.7, fast: float = 1.3) -> Finding:
    """The area of a `zone` grows from a `slow` to a `fast` walking speed [m/s] (fig. 5).

    Notes
    -----
    The interval of the difference follows from those of both areas as if they were independent (MOVER; Zou
    and Donner, Statist. Med. 27, 2008).  Both depend on the same people: the interval is rather too wide.
    """
    area, low, high = _read_interval(zone, fast, "area")
    other, other_low, other_high = _read_interval(zone, slow, "area")
    effect = area - other
    down = sqrt((area - low) ** 2 + (other_high - other) ** 2)
    up = sqrt((high - area) ** 2 + (other - other_low) ** 2)
    n, adequate = min(_count_encounters(zone, v) for v in (slow, fast)), all(map(zone.adequate, (slow, fast)))
    return Finding(GROWS_WITH_SPEED, effect, effect - down, effect + up, "m2", n, adequate)


def measure_shape(
    samples: pd.DataFrame,
    null: NullEncounters | None,
    *,
    r_max: float = R_MAX,
    speed: float = 1.1,
    slow: float = 0.7,
    fast: float = 1.3,
) -> list[Finding]:
    """The zone reaches farther ahead than behind, and grows with speed: differences from the null model.

    Both come from the posterior of the respect zone (`szlib.zones.respect`), which compares people with those
    of the null model.  Effects and intervals are as in `measure_reach_ahead` and `measure_growth_with_speed`.
    With fewer than `MIN_COMPARED` encounters within r_max, the interval would be that of the prior.

    Parameters
    ----------
    samples, null, r_max : as in `szlib.SocialZone.fit`.
    speed : at which the reach ahead and behind are compared [m/s].
    slow, fast : speeds at which the areas are compared [m/s].
    """
    claims, n = {LARGER_AHEAD: "m", GROWS_WITH_SPEED: "m2"}, 0
    try:
        estimator = RespectEstimator.from_samples(samples, r_max=r_max, null=null)
        n = len(estimator.data.kind)
        if n < MIN_COMPARED:
            raise ZoneError(
                f"{MIN_COMPARED} encounters of people who cross or come towards each other needed"
            )
        middle = zone_ellipses(estimator.middle[None], (slow, speed, fast))
        ellipses = np.vstack([middle, estimator.posterior((slow, speed, fast)).values])
    except ZoneError as error:
        return [
            Finding(each, np.nan, np.nan, np.nan, unit, n, False, reason=str(error))
            for each, unit in claims.items()
        ]
    areas = np.pi * ellipses[..., 2] * ellipses[..., 3]
    effects = np.stack([2 * ellipses[:, 1, 0], areas[:, 2] - areas[:, 0]])
    lows, highs = np.quantile(effects[:, 1:], [(1 - LEVEL) / 2, (1 + LEVEL) / 2], axis=1)
    return [
        Finding(each, best, min(low, best), max(high, best), unit, n)
        for (each, unit), best, low, high in zip(
            claims.items(), *map(np.ndarray.tolist, (effects[:, 0], lows, highs)), strict=True
        )
    ]


def measure_passing_side(samples: pd.DataFrame) -> Finding:
    """People who walk towards each other pass on the right: fraction of pairs in `samples` - 1/2 (abstract).

    A pair passes on the right if each has the other to the left where they are closest.
    """
    check_columns(samples, ["day", "encounter", "ref_id", "other_id", "los_angle", "distance", "kind"])
    opposite = samples[samples["kind"] == OPPOSITE]
    rows = opposite.groupby("encounter")["distance"].idxmin()
    closest = opposite.loc[rows] if len(opposite) else opposite
    people = np.sort(closest[["ref_id", "other_id"]].to_numpy(), axis=1).reshape(-1, 2)
    pairs = closest.assign(one=people[:, 0], two=people[:, 1]).drop_duplicates(["day", "one", "two"])
    return _measure_share(
        "people pass each other on the right", int((pairs["los_angle"] > 0).sum()), len(pairs)
    )


def measure_intruders_removed(intruders: int, removed: int) -> Finding:
    """LOF removes outliers: fraction of `intruders` among the `removed` samples - 1/2."""
    return _measure_share("what LOF removes are outliers", intruders, removed)


def measure_encounter_rate(encounters: int, days: float) -> Finding:
    """As many `encounters` in these `days` as in the paper, within a factor of two: 1 - number of
    doublings.
    """
    if not (encounters >= 0 and days > 0):
        raise DataError(f"expected encounters >= 0 in days > 0; got {encounters} in {days}")
    low = chi2.ppf((1 - LEVEL) / 2, 2 * encounters) / 2 if encounters else 0.0
    high = chi2.ppf((1 + LEVEL) / 2, 2 * encounters + 2) / 2

    def effect(count: float) -> float:
        """1 - number of doublings between this `count` and the paper's."""
        return 1 - abs(log2(max(count, 1e-9) / days / PAPER_RATE))

    ends = sorted(map(effect, (low, high)))
    top = 1.0 if low / days <= PAPER_RATE <= high / days else ends[1]
    return Finding(ENCOUNTER_RATE, effect(encounters), ends[0], top, "doublings", encounters)


def measure_delay_by_size(
    zone: Ellipse, *, scales: Sequence[float] = (0.8, 1.2), names: Iterable[str] = tuple(SCENARIOS)
) -> Finding:
    """A larger zone makes the robot later at its goal (sec. 4): mean and range over scenarios of the paper.

    The robot has szlib's default settings. The runs are deterministic: the claim is supported if the robot is
    later in every scenario.

    Parameters
    ----------
    zone : the zone.
    scales : factors of its size; the first and the last are compared.
    names : names of the scenarios.
    """
    delays = []
    for name in names:
        times = [run_scenario(name, zone.scaled(scale))["time_to_goal"] for scale in scales]
        delays.append(times[-1] - times[0])
    claim = f"a zone {scales[-1] / scales[0]:.1f} times as large makes the robot later"
    mean, low, high = float(np.mean(delays)), float(np.min(delays)), float(np.max(delays))
    return Finding(claim, mean, low, high, "s", len(delays), interval=RANGE)


def drive(scenario: Scenario, zone: Ellipse, settings: MPCSettings) -> Run:
    """The run of a `scenario` with the controller of szlib."""
    return simulate(scenario, MPCCBF(zone, walls=scenario.walls, settings=settings))


def run_scenario(name: str, zone: Ellipse) -> dict[str, float]:
    """Metrics of the paper's scenario of this `name` with a `zone` and szlib's default settings."""
    return drive(replace(SCENARIOS[name], claims=()), zone, MPCSettings()).metrics()


def count_claims(run: Run) -> tuple[int, int]:
    """How many of the paper's claims about its scenario hold in a `run`, and how many there are."""
    held = [claim.check(run)[0] for claim in run.scenario.claims]
    return sum(held), len(held)


def record_claims(record: NotebookRecord, claims: Iterable[Claim], run: Run, *, prefix: str = "") -> None:
    """Record which `claims` of the paper hold in a `run`, with their numbers and units."""
    for claim in claims:
        holds, number = claim.check(run)
        record.claim(prefix + claim.text, holds, UNITS[claim.text].format(number))


def _read_interval(zone: SocialZone, speed: float, quantity: str) -> tuple[float, float, float]:
    """Value, low, high of a quantity at a speed; NaN where there is no zone; ZoneError if not fitted."""
    if speed in zone.undefined:
        return np.nan, np.nan, np.nan
    table = zone.table().set_index("speed")
    if speed not in table.index or zone.uncertainty is None:
        raise ZoneError(f"no interval at {speed:g} m/s; fit with this speed, and n_resamples > 0")
    value, low, high = (table[f"{quantity}{end}"].to_dict()[speed] for end in ("", "_low", "_high"))
    return float(value), float(low), float(high)


def _count_encounters(zone: SocialZone, speed: float) -> int:
    counts = zone.side_counts
    return 0 if counts is None else int(counts.set_index("speed")["encounters"].to_dict()[speed])


def _measure_share(claim: str, hits: int, trials: int) -> Finding:
    """A fraction - 1/2 with Wilson's interval; undecided without trials."""
    if trials == 0:
        return Finding(claim, np.nan, -0.5, 0.5, "share", 0)
    ends = binomtest(hits, trials).proportion_ci(LEVEL, method="wilson")
    return Finding(claim, hits / trials - 0.5, ends.low - 0.5, ends.high - 0.5, "share", trials)
