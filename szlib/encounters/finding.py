"""Encounters of two people in an open area (paper, sec. 2; the four conditions).

The *attentional space* is a rectangle ahead of the reference pedestrian that turns with them.  Over
a window of 3 s (31 ticks of 0.1 s):

1. the space stays inside the area (in any convex area: its four corners do), unless walls bound the area;
2. one other person is inside the space when the window opens, and no third person enters it;
3. at the opening that person is at least 1 m away;
4. the reference pedestrian walks at 0.4 m/s or more throughout.

Both people are tracked for the whole window.  Windows of one reference pedestrian do not overlap.
Every window is one encounter of 31 samples.  All rows are computed at once, in arrays.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from ..tracks import funnels
from ..tracks.clock import clock_index
from .areas import AUTO, area_for, place_apart
from .geometry import Area
from .kinds import REACH, kinds_of_pairs, of_kind
from .occupants import TrackRows, find_occupants, occupant_changes
from .samples import sample_windows
from .settings import EncounterSettings


def find_encounters(
    tracks: pd.DataFrame,
    *,
    settings: EncounterSettings | None = None,
    kinds: str | Iterable[str] | None = None,
    **parameters: Any,
) -> pd.DataFrame:
    """Find the encounters of two people, and sample each at 10 Hz.

    Parameters
    ----------
    tracks : a track table as from `szlib.read_tracks` (any row order, left untouched).
    settings : what counts as an encounter; None takes the paper's.
    kinds : None keeps all (paper); "strangers" all but companions; else one or several of
        `szlib.encounters.KINDS`.  Encounters keep the numbers that they have among all.
    parameters : single values in place of those of `settings`: area (or square, its older name), space,
        duration [s], min_distance [m], min_speed [m/s], throughout, has_walls: `szlib.EncounterSettings`.

    Returns
    -------
    One row a sample: encounter (number), day, ref_id, other_id, t [s], los_angle [rad] (bearing of
    the other person in the reference pedestrian's frame, in (-pi, pi]), distance [m], speed of the
    reference pedestrian [m/s], other_los_angle and other_speed (the same with the two people exchanged), kind
    (category, see `szlib.encounters.kinds`).  Empty if there is no encounter.  ``.attrs["funnel"]`` counts,
    by reason, the ticks that open no encounter; ``"area"`` and ``"area_reason"`` say which area was searched,
    and why where it was found.

    Raises
    ------
    DataError : a column is missing, a time is off the clock, a row is doubled, a parameter has no meaning.

    Examples
    --------
    Two people walk towards each other.  Each of them sees the other:

    >>> import numpy as np, pandas as pd, szlib
    >>> t = np.arange(0, 4, 0.1).round(1)
    >>> left = pd.DataFrame({"day": "a", "id": 1, "t": t, "x": t, "y": 0.0, "vx": 1.0, "vy": 0.0})
    >>> right = left.assign(id=2, x=5 - t, y=1.0, vx=-1.0)
    >>> samples = szlib.find_encounters(pd.concat([left, right]), area="-5 15 -5 5")
    >>> samples["encounter"].nunique(), len(samples), samples["kind"].iloc[0]
    (2, 62, 'opposite')
    """
    settings = (settings or EncounterSettings()).with_parameters(parameters)
    tracks, area = find_place(tracks, settings)
    rows = TrackRows.from_tracks(tracks)
    openings = _find_openings(rows, area, settings)
    chosen, reasons = _find_windows(rows, openings, settings)
    ref, other = openings.rows[chosen], openings.other[openings.rows[chosen]]

    samples = sample_windows(tracks, rows.order, ref, other, settings.steps)
    counts = area.grown(REACH).contains(rows.x, rows.y)
    kind = kinds_of_pairs(rows.person[ref], rows.person[other], rows, counts)
    samples["kind"] = kind.repeat(settings.steps + 1)
    samples.attrs |= {"area": str(area), "area_reason": area.reason}
    n_rows, n_openings, opening = (
        len(rows),
        len(openings.rows),
        "encounters: ticks that open a window",
    )
    stages = [
        funnels.stage(opening, n_rows, n_openings, openings.reasons),
        funnels.stage("encounters: windows", n_openings, len(chosen), reasons),
    ]
    return of_kind(funnels.attach(samples, [*funnels.get(tracks), *stages]), kinds)


def find_place(
    tracks: pd.DataFrame, settings: EncounterSettings
) -> tuple[pd.DataFrame, Area]:
    """The `tracks`, and the area in which the `settings` find encounters.

    Without one it is that of the files (`szlib.read_tracks`), or "auto". With "auto" recordings without a
    calendar get each their own area, and are placed side by side.
    """
    area = settings.area
    if area is None:
        area = tracks.attrs.get("area", AUTO)
    if isinstance(area, str) and area == AUTO:
        clock_index(tracks)  # raises DataError for a table that is no track table
        tracks = place_apart(tracks)
    return tracks, area_for(tracks, area, settings.space)


@dataclass(frozen=True, eq=False)
class _Openings:
    """Ticks at which an encounter may open, and conditions at every row.

    Attributes
    ----------
    rows : the ticks at which an encounter may open.
    other : row of one person in the space of each row; -1 if the space is empty.
    people : number of other people in the space of each row.
    space_inside : whether the corners of the space are inside the area.
    ready : whether they are, and the reference pedestrian is fast enough.
    reasons : number of rejected ticks, by reason.
    """

    rows: np.ndarray
    other: np.ndarray
    people: np.ndarray
    space_inside: np.ndarray
    ready: np.ndarray
    reasons: dict[str, int]


def _find_openings(
    rows: TrackRows, area: Area, settings: EncounterSettings
) -> _Openings:
    """Find the ticks that meet the four conditions by themselves."""
    inside = area.contains(rows.x, rows.y)
    at = np.flatnonzero(inside)
    cos, sin = np.cos(rows.heading[at]), np.sin(rows.heading[at])
    ahead, side = settings.space.corners.T[..., None]
    corners = (
        rows.x[at] + ahead * cos - side * sin,
        rows.y[at] + ahead * sin + side * cos,
    )
    space_inside = inside.copy()
    space_inside[at] = settings.has_walls or area.covers(*corners)
    ready = space_inside & (rows.speed >= settings.min_speed)
    people, other = find_occupants(rows, at, ready, settings.space)
    one, partner = people == 1, other[people == 1]
    far = np.zeros(len(rows), bool)
    distance = np.hypot(rows.x[partner] - rows.x[one], rows.y[partner] - rows.y[one])
    far[one] = distance >= settings.min_distance
    found, reasons = _apply_conditions(
        np.arange(len(rows)),
        [
            ("not in the area", inside),
            ("velocity unknown", np.isfinite(rows.speed)),
            ("a corner of the space outside the area", space_inside),
            (f"slower than {settings.min_speed} m/s", ready),
            ("nobody in the space", people >= 1),
            ("several people in the space", one),
            (f"other person nearer than {settings.min_distance} m", far),
        ],
    )
    return _Openings(found, other, people, space_inside, ready, reasons)


def _find_windows(
    rows: TrackRows, openings: _Openings, settings: EncounterSettings
) -> tuple[np.ndarray, dict[str, int]]:
    """Find the openings whose window meets the conditions throughout, and count the others by reason."""
    steps, first, partner = settings.steps, openings.rows, openings.other[openings.rows]
    last, partner_last = (
        np.minimum(row + steps, len(rows) - 1) for row in (first, partner)
    )
    tracked = np.ones(len(first), bool)
    for start, end in ((first, last), (partner, partner_last)):
        tracked &= (rows.piece[end] == rows.piece[start]) & (
            rows.tick[end] - rows.tick[start] == steps
        )
    one = openings.people == 1
    third_person = occupant_changes(rows, openings.other, one) | (openings.people > 1)
    conditions = [
        ("a track ends within the window", tracked),
        (
            "a corner leaves the area within the window",
            _holds_throughout(openings.space_inside, first, last),
        ),
        ("too slow within the window", _holds_throughout(openings.ready, first, last)),
        (
            "somebody else enters the space",
            _holds_throughout(~third_person, first + 1, last),
        ),
    ]
    if settings.throughout:
        conditions.append(
            ("the other person leaves the space", _holds_throughout(one, first, last))
        )
    valid = np.logical_and.reduce([condition for _, condition in conditions])
    conditions.append(
        ("overlaps an earlier window", _drop_overlaps(first, valid, steps))
    )
    return _apply_conditions(np.arange(len(first)), conditions)


def _holds_throughout(
    condition: np.ndarray, first: np.ndarray, last: np.ndarray
) -> np.ndarray:
    """Whether the condition holds at every row from `first` to `last` (inclusive)."""
    failures = np.r_[0, np.cumsum(~condition)]
    return np.asarray(failures[last + 1] == failures[np.minimum(first, last + 1)])


def _drop_overlaps(first: np.ndarray, valid: np.ndarray, steps: int) -> np.ndarray:
    """Which valid windows are taken: the earliest one, then the next that begins after its end, and so on."""
    taken = np.zeros(len(first), bool)
    candidates = np.flatnonzero(valid)
    following = np.searchsorted(
        first[candidates], first[candidates] + steps, side="right"
    )
    at = 0
    while at < len(candidates):
        taken[candidates[at]] = True
        at = int(following[at])
    return taken


def _apply_conditions(
    rows: np.ndarray, conditions: list[tuple[str, np.ndarray]]
) -> tuple[np.ndarray, dict[str, int]]:
    """The rows that meet all conditions, and how many rows each condition was the first to reject."""
    reasons: dict[str, int] = {}
    for reason, condition in conditions:
        passing = rows[condition[rows]]
        reasons[reason] = len(rows) - len(passing)
        rows = passing
    return rows, reasons
