"""The verdict on a zone: whether it can be used, and why not.

usable              the data shows respect, and the zone and its interval can be relied on
undecided           something is missing; the reasons say what
no respect shown    enough people met, and they came as near as people who ignore each other

A zone alone cannot tell: every method returns one for people who ignore each other as well.

What no verdict can tell (each measured on crowds of straight walkers):

- Somebody who cleans the tracks removes whole people because they come near others, or a tracker pushes two
  near estimates apart. No track ends then. "No two people pass within 0.6 m" is all that the verdict says.
- A tracker loses people near others, and somebody then cuts 2 s or more off both ends of each track. Losses
  are looked for up to 2 s from an end (`encounters.sensor.AHEAD`). Give the tracks as the tracker made them.
- Streams whose *places* change during the recording avoid each other by plan: lanes or gates that change
  their direction, traffic lights. The null model moves streams in time, so it mixes places that never were
  used at once. Then p is small although nobody reacts. Give each part as a recording of its own.
- People who step aside by far more than is needed: if the mean excess is 0.3 m, the zone's axis along the
  motion is 8 % too short, at 0.5 m 12 to 28 %, and its interval misses the true one. The radius stays right.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from ..core.errors import DataError
from .ellipses import find_neighbours

if TYPE_CHECKING:
    import pandas as pd

USABLE = "usable"
UNDECIDED = "undecided"
NO_RESPECT = "no respect shown"
# Encounters that a description needs (paper, hull): on real people the intervals of fewer hold the
# truth too rarely (measured).
MIN_TOTAL = 600
# Largest share of careless people, unless the method states its own: then most people keep the zone.
MOST_CARELESS = 0.2
# Distance of two people whose bodies touch, shoulder to shoulder or chest to chest [m] (assumed).
BODY_CONTACT = 0.4
# Farthest centre ahead of a person or behind [m] (measured). It is enough that one of two people is in the
# other's zone, so a shorter zone that is shifted to the front or the back keeps nearly the same pairs out.
# It fits better than the true one where positions err by 10 cm, or one in 500 is wrong.
FARTHEST_CENTER = 0.25
# Widest interval of a semi-axis, as a share of it.
WIDEST = 0.6
# How much nearer two people seem where positions are dt apart, divided by dt^2, in one pair of 20 [m/s2]: at
# least 3, 7 and 10 cm with 0.5, 0.8 and 1 s (measured on THOR-MAGNI, recorded every 0.4 s: notebook 06).
HIDDEN = 0.1
# Fewest positions of a track (measured: plazas of which one position every 0.3 s is kept).
FEWEST_POSITIONS = 12
SIGNIFICANCE = 0.05
MIN_SHIFTS = 19  # with fewer, p is above 0.05 whatever people do
# Encounters within r_max from which on the test finds a core of 0.8 m in more than 90 % of crowds.
MIN_TESTED = 60

# Advice by a word of the condition that rejected everything; the last one fits all others.
_ADVICE = {
    "corner": 'the space ahead of a person, 4 m x 5 m, has no room there: give a larger area, or "auto"',
    "not in the area": 'give an area in which people walked: four numbers or a polygon, or "auto"',
    "slow": "are unit and frame rate right? else pass a smaller min_speed",
    "velocity": "tracks are single points: pass a longer max_gap, or join the ids of one person",
    "ends": "tracks are short or broken: pass a longer max_gap, or a shorter duration",
    "nobody": "people were never near each other: more data, or a larger space",
    "several": "it was crowded: a smaller space",
    "nearer": "people came into view late: pass a smaller min_distance",
    "": "more data, or other conditions (szlib.find_encounters)",
}


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
    from ..tracks import funnels  # reads tracks, which a robot does not

    test = zone.null_test
    if (
        test is not None
        and not test.is_significant
        and test.n_encounters >= MIN_TESTED
        and test.n_shifts >= MIN_SHIFTS
    ):
        return Verdict(
            NO_RESPECT,
            [
                "people came as near as people who ignore each other would: "
                f"p = {test.p_value:.3g} ({test.n_shifts} shifts, {test.n_encounters} encounters)"
            ],
        )
    missing = describe_missing_encounters(zone.provenance), zone.missing_data(speed)
    reasons = [
        *filter(None, missing),
        *funnels.warnings(zone.provenance.get("funnel", [])),
        *_null_model(zone),
        *_place(zone, speed),
        *_width(zone, speed),
    ]
    if reasons:
        return Verdict(UNDECIDED, reasons)
    sensor = [] if test.sensor is None else [f"sensor: {test.sensor}"]
    return Verdict(USABLE, [f"{test}", *sensor])


def describe_missing_encounters(provenance: Mapping[str, Any]) -> str:
    """Describe how many encounters, and hours, a zone of this `provenance` lacks; "" if none.

    The interval of the respect zone itself says whether there were enough: see `_width`.
    """
    n = provenance.get("encounters")
    hours = provenance.get("hours")
    method = provenance.get("parameters", {}).get("method")
    if not n or n >= MIN_TOTAL or method == "respect":
        return ""
    message = f"{n} encounters were found, {MIN_TOTAL} are needed"
    if not hours:
        return message
    return f"{message}: {(MIN_TOTAL / n - 1) * hours:.2g} more hours of recording at this rate"


def _null_model(zone: FittedZone) -> Iterator[str]:
    """What is missing in the comparison with people who ignore each other, or explained by the sensor."""
    test = zone.null_test
    if test is None:
        yield "no null model: fit the zone with SocialZone.from_tracks(tracks)"
        return
    if not test.is_significant:
        yield (
            f"{test}: at least {MIN_TESTED} encounters within {zone.r_max:g} m, and {MIN_SHIFTS} shifts, are "
            "needed to tell"
        )
    limit = zone.provenance.get("parameters", {}).get("q", MOST_CARELESS)
    if test.respect.careless_high >= limit:
        yield (
            f"up to {test.respect.careless_high:.1%} of the encounters may be of careless people who enter "
            f"the zone; it holds only if these are fewer than q = {limit:.1%}"
        )
    if test.respect.low <= BODY_CONTACT:
        yield f"the radius, {test.respect}, may be that of two bodies that touch"
    if (test.p_beyond or 0.0) > SIGNIFICANCE:
        yield (
            f"the tracker loses people nearer than {test.sensor.resolved:.1f} m to each other "
            f"({test.sensor}), and beyond that no respect shows (p = {test.p_beyond:.2g})"
        )


def _place(zone: FittedZone, speed: float) -> Iterator[str]:
    """Why the zone is not surely larger than what other things than respect explain."""
    test = zone.null_test
    sensor = test and test.sensor
    resolved = sensor.resolved if sensor else 0.0
    shifted = test.null_radius if test else 0.0
    for fitted in find_neighbours(zone.ellipses, speed):
        ahead, _ = zone.ellipses[fitted].center
        if abs(ahead) > FARTHEST_CENTER:
            yield (
                f"at {fitted:g} m/s the zone's centre is {ahead:.2f} m ahead of the person, "
                "as where positions err: look at the tracks"
            )
        low = np.sqrt(max(_interval(zone, fitted, "area")[0], 0.0) / np.pi)
        for least, what in (
            (BODY_CONTACT, "two bodies that touch are so near"),
            (resolved, "the tracker loses people who are nearer"),
            (shifted, "people who ignore each other have a radius so large"),
        ):
            if low <= least:  # without an interval, `_width` says so
                yield (
                    f"at {fitted:g} m/s the mean radius may be as small as {low:.2f} m, which is not clearly "
                    f"larger than {least:.2f} m: {what}"
                )


def _width(zone: FittedZone, speed: float) -> Iterator[str]:
    """What is wrong with the intervals: missing, of draws that disagree, or too wide."""
    if zone.uncertainty is not None and not zone.uncertainty.has_converged:
        yield f"the draws of the posterior do not agree ({zone.uncertainty.description})"
    hidden = 0.0
    for stage in zone.provenance.get("funnel", []):
        if sums := stage.get("recorded"):
            hidden = HIDDEN * sums["cubes"] / sums["seconds"]
            positions = sums["squares"] / stage["entered"]
            if positions < FEWEST_POSITIONS:
                yield (
                    f"a track has {positions:.0f} positions (mean, by position), too few to tell how near "
                    "people came: record people for longer, or more often"
                )
    for fitted in find_neighbours(zone.ellipses, speed):
        for name, value in zip("ab", zone.ellipses[fitted].semi_axes, strict=True):
            low, high = _interval(zone, fitted, name)
            if not (low > 0 and np.isfinite(high)):
                yield f"at {fitted:g} m/s the interval of the semi-axis {name} cannot be given"
            elif (width := (high - low) / value) > WIDEST:
                hours = zone.provenance.get("hours")
                lacking = (
                    f"{((width / WIDEST) ** 2 - 1) * hours:.2g} more hours of recording"
                    if hours
                    else f"{(width / WIDEST) ** 2:.2g} times the data"
                )
                yield (
                    f"at {fitted:g} m/s the semi-axis {name} is {low:.2f} to {high:.2f} m, wider than "
                    f"{WIDEST:.0%} of it: {lacking} would do"
                )
            elif (half := (high - low) / 2) < hidden:
                yield (
                    f"at {fitted:g} m/s the semi-axis {name} is known to {100 * half:.0f} cm, but positions "
                    f"are {np.sqrt(hidden / HIDDEN):.1f} s apart: a person who steps aside between two of "
                    f"them seems up to {100 * hidden:.0f} cm nearer; record one every "
                    f"{np.sqrt(half / HIDDEN):.1f} s"
                )


def _interval(zone: FittedZone, speed: float, quantity: str) -> Any:
    """Low and high end of the interval of a `quantity` at a fitted `speed`; NaN if there is none."""
    if zone.uncertainty is None:
        return np.nan, np.nan
    intervals = zone.uncertainty.intervals.set_index(["speed", "quantity"])
    return intervals.loc[(speed, quantity), "low":"high"].to_numpy()


def require_encounters(samples: pd.DataFrame) -> pd.DataFrame:
    """Return the `samples` if there are any; else raise DataError: the stage that rejected everything, why,
    and what to do."""
    from ..tracks import funnels  # a robot needs no Polars

    if len(samples):
        return samples
    stages = funnels.get(samples)
    emptied = next((s for s in stages if s["entered"] and not s["kept"]), None)
    if emptied is None:
        raise DataError(
            "the table of samples is empty, and has no funnel that says why"
        )
    rejected = emptied["rejected"]
    *_, last = rejected
    advice = next(text for words, text in _ADVICE.items() if words in last)
    raise DataError(
        f"there is no encounter in the area {samples.attrs.get('area', '')}: of {emptied['entered']:,} "
        f"({emptied['stage']}) none is left: "
        f"{', '.join(f'{count:,} {reason}' for reason, count in rejected.items())}.  "
        f"The last condition: {last}; {advice}"
    )
