"""The verdict on a zone: whether it can be used, and why not.

usable              the data shows respect, and the zone and its interval can be relied on
undecided           something is missing; the reasons say what
no respect shown    enough people met, and they came as near as people who ignore each other

A zone alone cannot tell: every method returns one for people who ignore each other as well.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any, Self

import numpy as np

from ..tracks import funnels
from .uncertainty import MIN_ENCOUNTERS

USABLE, UNDECIDED, NO_RESPECT = "usable", "undecided", "no respect shown"
# Encounters that a zone needs: on real people, the intervals of fewer hold the truth too rarely (measured).
MIN_TOTAL = 600
# Encounters within r_max from which on the test finds a core of 0.8 m in more than 90 % of crowds.
MIN_TESTED = 60


FittedZone = Any
"""A `szlib.SocialZone`; it imports this module, so it cannot be imported here."""


class Verdict(str):
    """One of "usable", "undecided", "no respect shown", with its `reasons`, sentences without a full stop.

    Examples
    --------
    >>> from szlib.zones.verdict import Verdict
    >>> verdict = Verdict("undecided", ["52 encounters were found, 600 are needed"])
    >>> verdict == "undecided", len(verdict.reasons)
    (True, 1)
    """

    reasons: tuple[str, ...]

    def __new__(cls, outcome: str, reasons: Iterable[str] = ()) -> Self:
        verdict = super().__new__(cls, outcome)
        verdict.reasons = tuple(reasons)
        return verdict

    @property
    def sentence(self) -> str:
        """The verdict and its reasons in one line."""
        return f"{self}: {'; '.join(self.reasons)}" if self.reasons else str(self)


def judge(zone: FittedZone, speed: float) -> Verdict:
    """Judge a `zone` at a `speed` of the reference pedestrian [m/s]."""
    test = zone.null_test
    if test is not None and not test.is_significant and test.n_encounters >= MIN_TESTED:
        compared = f"p = {test.p_value:.3g} ({test.n_shifts} shifts, {test.n_encounters} encounters)"
        return Verdict(
            NO_RESPECT,
            [f"people came as near as people who ignore each other would: {compared}"],
        )
    reasons = [
        *filter(
            None,
            (describe_missing_encounters(zone.provenance), zone.missing_data(speed)),
        )
    ]
    reasons += funnels.warnings(zone.provenance.get("funnel", []))
    reasons += [*_null_model(zone, speed), *_intervals(zone, speed)]
    return Verdict(UNDECIDED, reasons) if reasons else Verdict(USABLE, [f"{test}"])


def describe_missing_encounters(provenance: Mapping[str, Any]) -> str:
    """Describe how many encounters, and hours, a zone of this `provenance` lacks; "" if none."""
    n, hours = provenance.get("encounters"), provenance.get("hours")
    if not n or n >= MIN_TOTAL:
        return ""
    more = (
        ""
        if not hours
        else f": {(MIN_TOTAL / n - 1) * hours:.2g} more hours of recording at this rate"
    )
    return f"{n} encounters were found, {MIN_TOTAL} are needed{more}"


def _null_model(zone: FittedZone, speed: float) -> Iterator[str]:
    """What is missing in the comparison with people who ignore each other."""
    test = zone.null_test
    if test is None:
        yield "no null model: fit the zone with null=szlib.null_encounters(tracks)"
        return
    if not test.is_significant:
        yield f"{test}, and {MIN_TESTED} encounters within {zone.r_max:g} m are needed to tell"
    q = zone.provenance.get("parameters", {}).get("q")
    if q is not None and test.respect.careless_high >= q:
        yield (
            f"up to {test.respect.careless_high:.1%} of the encounters may be of careless people who enter "
            f"the zone; it holds only if these are fewer than q = {q:.1%}"
        )
    for fitted in _neighbours(zone, speed):
        area, null = (
            _interval(zone, fitted, "area")[0],
            zone.null_radii.get(fitted, np.nan),
        )
        if not np.sqrt(max(area, 0.0) / np.pi) > null:
            yield (
                f"at {fitted:g} m/s the same method gives people who ignore each other a zone with a mean "
                f"radius of {null:.2f} m, and this one is not clearly larger"
            )


def _intervals(zone: FittedZone, speed: float) -> Iterator[str]:
    """What is wrong with the intervals."""
    counts = (
        {}
        if zone.side_counts is None
        else zone.side_counts.set_index("speed")["encounters"]
    )
    for fitted in _neighbours(zone, speed):
        for name in ("a", "b"):
            low, high = _interval(zone, fitted, name)
            if not (low > 0 and np.isfinite(high)):
                yield f"at {fitted:g} m/s the interval of the semi-axis {name} cannot be given"
        if counts.get(fitted, MIN_ENCOUNTERS) < MIN_ENCOUNTERS:
            yield f"at {fitted:g} m/s the interval rests on fewer than {MIN_ENCOUNTERS} encounters"


def _interval(zone: FittedZone, speed: float, quantity: str) -> tuple[float, float]:
    """Low and high end of the interval of a `quantity` at a fitted `speed`; NaN if there is none."""
    if zone.uncertainty is None:
        return np.nan, np.nan
    rows = zone.uncertainty.intervals
    row = rows[(rows["speed"] == speed) & (rows["quantity"] == quantity)]
    return (
        (float(row["low"].iloc[0]), float(row["high"].iloc[0]))
        if len(row)
        else (np.nan, np.nan)
    )


def _neighbours(zone: FittedZone, speed: float) -> list[float]:
    """The fitted speeds next to `speed` [m/s], below and above; one if it was fitted itself."""
    fitted = sorted(zone.ellipses)
    below, above = [v for v in fitted if v <= speed], [v for v in fitted if v >= speed]
    return sorted({*below[-1:], *above[:1]})
