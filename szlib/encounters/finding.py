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
from typing import Any

import numpy as np
import pandas as pd
import polars as pl

from ..tracks import funnels
from ..tracks.clock import VELOCITY_SPAN
from ..tracks.readers import sort_rows
from .areas import AUTO, area_for, as_area, place_apart
from .geometry import Area
from .kinds import REACH, kinds_of_pairs, of_kind
from .occupants import TrackRows, find_occupants, occupant_changes, sample_rows
from .settings import EncounterSettings

_TIME_ROUNDING = 0.1  # larger than every rounding error of a time [s]
_POSITION_ROUNDING = 1e-6  # and of a position [m]


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
    steps = settings.steps
    at_opening, throughout, other = _check_rows(rows, area, settings)
    first, missed = _apply_conditions(at_opening)
    windows = _check_windows(rows, first, other, steps, throughout)
    chosen, rejected = _apply_conditions(windows)
    ref = first[chosen]

    pairs = np.stack([ref, other[ref]])
    sampled = (pairs[..., None] + np.arange(steps + 1)).reshape(2, -1)
    number = np.arange(len(ref)).repeat(steps + 1)
    samples = sample_rows(tracks, rows, number, *sampled)
    near = rows.select(rows.within(area.grown(REACH)))
    samples["kind"] = kinds_of_pairs(rows.person[pairs], near)[number]
    samples.attrs |= {"area": str(area), "area_reason": area.reason}
    stages = [
        *funnels.get(tracks),
        funnels.stage(
            "encounters: ticks that open a window", len(rows), len(first), missed
        ),
        funnels.stage("encounters: windows", len(first), len(chosen), rejected),
    ]
    funnels.attach(samples, stages)
    return of_kind(samples, kinds)


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
    if str(area) == AUTO:
        tracks = place_apart(tracks)
    return tracks, area_for(tracks, area, settings.space)


Conditions = dict[str, np.ndarray]
"""Whether each row, or window, meets a condition, by the reason for which it is rejected otherwise."""


def _check_rows(
    rows: TrackRows, area: Area, settings: EncounterSettings
) -> tuple[Conditions, Conditions, np.ndarray]:
    """Check the four conditions at each row by itself.

    Returns those that must hold at the opening of a window, those that must hold throughout, and the row of
    one person in the space of each row (-1 if it is empty).
    """
    inside = rows.within(area)
    at = np.flatnonzero(inside)
    corners = settings.space.corners @ np.array([1, 1j])
    corners = rows.place[at] + corners[:, None] * rows.ahead[at]
    has_room = inside.copy()
    has_room[at] = settings.has_walls or area.covers(corners.real, corners.imag)
    ready = has_room & (rows.speed >= settings.min_speed)
    people, other = find_occupants(rows, at, ready, settings.space)
    one = people == 1
    nearest = settings.min_distance
    far = one & (rows.distance(np.arange(len(rows)), other) >= nearest)
    at_opening = {
        "not in the area": inside,
        "velocity unknown": np.isfinite(rows.speed),
        "a corner of the space outside the area": has_room,
        f"slower than {settings.min_speed} m/s": ready,
        "nobody in the space": people >= 1,
        "several people in the space": one,
        f"other person nearer than {nearest} m": far,
    }
    throughout = {
        "a corner leaves the area within the window": has_room,
        "too slow within the window": ready,
        "somebody else enters the space": (people <= 1)
        & ~occupant_changes(rows, other, one),
    }
    if settings.throughout:
        throughout["the other person leaves the space"] = one
    return at_opening, throughout, other


def _check_windows(
    rows: TrackRows,
    first: np.ndarray,
    other: np.ndarray,
    steps: int,
    throughout: Conditions,
) -> Conditions:
    """Check the windows of so many `steps` that open at the rows `first`.

    Both people are tracked, the conditions hold `throughout`, and no two windows of one person overlap.
    """
    last = np.minimum(first + steps, len(rows) - 1)
    both = np.stack([first, other[first]])
    piece = np.r_[rows.piece, -np.ones(steps)]
    tracked = (piece[both + steps] == piece[both]).all(axis=0)
    found = {"a track ends within the window": tracked}
    for reason, condition in throughout.items():
        failures = np.cumsum(~condition)  # the opening itself was checked
        found[reason] = failures[last] == failures[first]
    valid = np.all(list(found.values()), axis=0)
    return found | {"overlaps an earlier window": _drop_overlaps(first, valid, steps)}


def _drop_overlaps(first: np.ndarray, valid: np.ndarray, steps: int) -> np.ndarray:
    """Which valid windows are taken: the earliest one, then the next that begins after its end, and so on."""
    taken = np.zeros(len(first), bool)
    end = -1
    for window in np.flatnonzero(valid):
        if first[window] > end:
            taken[window] = True
            end = first[window] + steps
    return taken


def _apply_conditions(conditions: Conditions) -> tuple[np.ndarray, dict[str, int]]:
    """The rows that meet all conditions, and how many rows each condition was the first to reject."""
    met = np.stack(list(conditions.values()))
    kept = met.all(axis=0)
    first = np.bincount(met.argmin(axis=0)[~kept], minlength=len(met))
    return np.flatnonzero(kept), dict(zip(conditions, first.tolist(), strict=True))


def select_near(
    settings: EncounterSettings,
    rows: pl.DataFrame,
    area: object,
    max_gap: float | None,
) -> pl.DataFrame:
    """Select the rows on which encounters can depend, and sort them.

    All rows are selected where the area or the longest gap is unknown, or nobody comes near.

    Parameters
    ----------
    settings : what counts as an encounter, and where.
    rows : day, id, t [s], x, y [m], in any order.
    area : that of the files, where the settings have none.
    max_gap : the longest gap within a track [s]; None: unknown.

    Notes
    -----
    A raw day has 15 million rows, most of them far from the area. `szlib.find_encounters` finds the same
    encounters in the selected rows as in all rows, but for the last digits of positions: `to_clock` adds up
    the times of all people. The proof uses these terms: g is the longest gap [s] within a track; "the
    rectangle" is the smallest one along the axes around the area, grown by the 5 m in which kinds of
    encounter are decided. A person comes near at time F: until then all rows are beyond one edge of the
    rectangle, and F is the latest such time of its four edges. In the same way L is the time after which all
    rows are beyond one edge.

    1. A tick of the clock lies between two rows at most g apart. If both are before F, both are beyond the
       same edge, and the tick is too. So ticks inside lie from F - g to L + g. No speed is assumed.
    2. Of the rows outside the rectangle `find_encounters` uses these only: rows of a person who is inside,
       from 0.5 s before (velocity of the reference pedestrian) to 0.5 s after the end of a window of 3 s
       (both people are tracked, and the other person is sampled), and g further to interpolate. All these
       rows are selected. (Kinds need only ticks inside and their velocities.)
    3. All rows of a person from the first selected one to the last are selected. So `to_clock` interpolates
       between the same two rows as in the whole day: no tick is new, and no tick has moved.
    """
    area = area if settings.area is None else settings.area
    if max_gap is None or area in (None, AUTO):
        return sort_rows(rows)
    box = as_area(area).grown(REACH + _POSITION_ROUNDING)
    t, x, y = map(pl.col, "txy")
    # on the inner side of each edge
    inner = [
        x >= box.x[0],
        x <= box.x[1],
        y >= box.y[0],
        y <= box.y[1],
    ]
    times = {str(k): pl.when(each).then(t) for k, each in enumerate(inner)}
    margin = 2 * max_gap + VELOCITY_SPAN + _TIME_ROUNDING
    spans = (
        rows.lazy()
        .select("day", "id", **times)
        .group_by("day", "id")
        .agg(pl.all().min().name.prefix("first "), pl.all().max().name.prefix("last "))
        .drop_nulls()
        .with_columns(
            begin=pl.max_horizontal("^first .$") - margin,
            end=pl.min_horizontal("^last .$") + margin + settings.duration,
        )
    )
    near = (
        rows.lazy()
        .with_row_index()
        .join(spans, ["day", "id"])
        .filter(t.is_between("begin", "end"))
        .sort("index")
        .select(rows.columns)
        .collect()
    )
    return sort_rows(near if near.height else rows)
