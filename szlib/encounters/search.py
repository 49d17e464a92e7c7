"""Encounters of two people in an open square (paper, sec. 2; the four conditions).

The *attentional space* is a rectangle ahead of the reference pedestrian that turns with them.  Over
a window of 3 s (31 ticks of 0.1 s):

1. the space stays inside the square (in any convex area: its four corners do);
2. nobody but one and the same other person is ever inside the space, and that person is inside it
   when the window opens;
3. at the opening that person is at least 1 m away;
4. the reference pedestrian walks at 0.4 m/s or more throughout.

Both are tracked for the whole window.  Windows of one reference pedestrian do not overlap.  Every
window is one encounter of 31 samples.  Everything is vectorised over rows.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
import pandas as pd

from ..errors import DataError
from ..tracks import funnels
from ..tracks.clock import COLUMNS, TICKS_PER_SECOND, check_columns, clock_index, nearest_tick
from .areas import area_for
from .geometry import ATC_SQUARE, PAPER_SPACE, AttentionalSpace, wrap_angle
from .kinds import REACH, kinds_of_pairs, number_people, of_kind

SAMPLE_COLUMNS = ["encounter", "day", "ref_id", "other_id", "t", "los_angle", "distance", "speed"]
"""What is measured; the column kind follows them."""
_PAIRS_AT_ONCE = 4_000_000
"""Pairs of people held in memory at a time."""
_TOUCH = 1e-3
"""Covers every rounding of a position, however many ticks there are [m]."""
_LONGEST_WINDOW = 3600.0
"""No two people are watched for an hour [s]."""


def find_encounters(
    tracks: pd.DataFrame,
    *,
    square: object = ATC_SQUARE,
    space: AttentionalSpace = PAPER_SPACE,
    duration: float = 3.0,
    min_distance: float = 1.0,
    min_speed: float = 0.4,
    throughout: bool = False,
    kinds: str | Iterable[str] | None = None,
) -> pd.DataFrame:
    """Find the encounters of two people, and sample each at 10 Hz.

    Parameters
    ----------
    tracks : a track table as from `szlib.read_tracks` (any row order, left untouched).
    square : where the attentional space must stay: a `Square`, a Shapely polygon, PedPy's ``WalkableArea``,
        text or a file, as for `szlib.as_area`; or "auto", the `szlib.walked_area` of these tracks.
    space : the attentional space.
    duration : of a window [s], a multiple of 0.1 (paper: 3).
    min_distance : of the other person when the window opens [m] (paper: 1).
    min_speed : of the reference pedestrian, throughout [m/s] (paper: 0.4).
    throughout : also require that the other person stays inside the space for the whole window.
        That reading of the paper never sees two people pass each other (assumed: False).
    kinds : None keeps all (paper); "strangers" all but companions; else one or several of
        `szlib.encounters.kinds.KINDS`.  Encounters keep the numbers that they have among all.

    Returns
    -------
    One row a sample: encounter (number), day, ref_id, other_id, t [s], los_angle [rad] (bearing of
    the other person in the reference pedestrian's frame, in (-pi, pi]), distance [m], speed of the
    reference pedestrian [m/s], kind (category, see `szlib.encounters.kinds`).  Empty where nobody met.
    ``.attrs["funnel"]`` says why every other tick opened no encounter.

    Raises
    ------
    DataError : a column is missing, a time is off the clock, a row is doubled, a parameter has no meaning.
    """
    if not (0 < duration < _LONGEST_WINDOW and 0 <= min_distance < np.inf and 0 < min_speed < np.inf):
        raise DataError(
            f"expected 0 < duration < {_LONGEST_WINDOW:g} s, min_distance >= 0 m and min_speed > 0 m/s; "
            f"got {duration} s, {min_distance} m, {min_speed} m/s"
        )
    steps = round(duration * TICKS_PER_SECOND)
    if abs(duration * TICKS_PER_SECOND - steps) > 1e-6:
        raise DataError(f"duration must be a multiple of 0.1 s, the step of the clock; got {duration} s")
    check_columns(tracks, COLUMNS)
    order, tick, piece = clock_index(tracks)
    x, y, vx, vy = (tracks[name].to_numpy(float)[order] for name in ("x", "y", "vx", "vy"))
    speed, heading = np.hypot(vx, vy), np.arctan2(vy, vx)

    area = area_for(tracks, square)
    inside = area.contains(x, y)
    cornered = inside.copy()
    at = np.flatnonzero(inside)
    cos, sin = np.cos(heading[at]), np.sin(heading[at])
    ahead, side = space.corners.T[..., None]
    cornered[at] = area.covers(x[at] + ahead * cos - side * sin, y[at] + ahead * sin + side * cos)
    ready = cornered & (speed >= min_speed)
    days = pd.factorize(tracks["day"])[0][order]
    people, other = _occupants(at, ready, days, tick, x, y, heading, space)
    alone = people == 1
    far = np.zeros(len(x), bool)
    far[alone] = np.hypot(x[other[alone]] - x[alone], y[other[alone]] - y[alone]) >= min_distance
    openings, opened = _sift(
        np.arange(len(x)),
        [
            ("not in the square", inside),
            ("velocity unknown", np.isfinite(speed)),
            ("a corner of the space outside the square", cornered),
            (f"slower than {min_speed} m/s", ready),
            ("nobody in the space", people >= 1),
            ("several people in the space", alone),
            (f"other person nearer than {min_distance} m", far),
        ],
    )

    last = np.minimum(openings + steps, len(x) - 1)
    partner = other[openings]
    partner_last = np.minimum(partner + steps, len(x) - 1)
    tracked = (piece[last] == piece[openings]) & (piece[partner_last] == piece[partner])
    tracked &= (tick[last] - tick[openings] == steps) & (tick[partner_last] - tick[partner] == steps)
    person = tracks["id"].to_numpy()[order]
    intrusion = _changes_of_occupant(other, alone, person, piece) | (people > 1)
    conditions = [
        ("a track ends within the window", tracked),
        ("a corner leaves the square within the window", _always(cornered, openings, last)),
        ("too slow within the window", _always(ready, openings, last)),
        ("somebody else enters the space", _always(~intrusion, openings + 1, last)),
    ]
    if throughout:
        conditions.append(("the other person leaves the space", _always(alone, openings, last)))
    whole = np.logical_and.reduce([condition for _, condition in conditions])
    conditions.append(("overlaps an earlier window", _without_overlap(openings, whole, steps)))
    kept, tried = _sift(np.arange(len(openings)), conditions)

    samples = _sampled(tracks, order, openings[kept], partner[kept], steps)
    number, _ = number_people(days, person)
    met = number[openings[kept]], number[partner[kept]]
    near = area.grown(REACH).contains(x, y)
    kind = kinds_of_pairs(*met, number, tick, np.column_stack([x, y]), np.column_stack([vx, vy]), near)
    samples["kind"] = kind.repeat(steps + 1)
    samples.attrs["area"] = str(area)
    stages = [
        *funnels.of(tracks),
        funnels.stage("encounters: ticks that open a window", len(x), len(openings), opened),
        funnels.stage("encounters: windows", len(openings), len(kept), tried),
    ]
    return of_kind(funnels.carry(samples, stages), kinds)


def reference_frame(tracks: pd.DataFrame, samples: pd.DataFrame) -> pd.DataFrame:
    """Both people's paths of each encounter in the reference pedestrian's frame *at the opening*.

    Columns: encounter, t, ref_x, ref_y, other_x, other_y [m]: x along the motion at the opening, y
    to the left (paper, fig. 2); a row for each of `samples`, in their order.  The opening is the first
    sample of an encounter, so outliers must not have been removed.

    Raises
    ------
    DataError : a table lacks a column or is empty, or a sample is not in `tracks`.
    """
    check_columns(tracks, COLUMNS)
    check_columns(samples, SAMPLE_COLUMNS[:5])
    people = tracks[tracks["id"].isin(samples["ref_id"]) | tracks["id"].isin(samples["other_id"])]
    people = people[["day", "id", "x", "y", "vx", "vy"]].assign(
        tick=nearest_tick(people["t"].to_numpy(float))
    )
    keys = samples[["encounter", "day", "ref_id", "other_id"]].assign(
        tick=nearest_tick(samples["t"].to_numpy(float))
    )
    ref, oth = (
        keys.merge(people, how="left", left_on=["day", who, "tick"], right_on=["day", "id", "tick"])
        for who in ("ref_id", "other_id")
    )
    lost = ref["x"].isna() | oth["x"].isna()
    if lost.any():
        found = samples[SAMPLE_COLUMNS[:5]].iloc[int(np.flatnonzero(lost)[0])].to_dict()
        raise DataError(f"sample {found} is not in these tracks; pass the tracks it was found in")
    opening = ref.groupby("encounter")["tick"].transform("idxmin").to_numpy()
    x, y, vx, vy = (ref[name].to_numpy()[opening] for name in ("x", "y", "vx", "vy"))
    cos, sin = np.cos(np.arctan2(vy, vx)), np.sin(np.arctan2(vy, vx))
    out = {"encounter": samples["encounter"].to_numpy(), "t": samples["t"].to_numpy()}
    for who, rows in (("ref", ref), ("other", oth)):
        dx, dy = rows["x"].to_numpy() - x, rows["y"].to_numpy() - y
        out |= {f"{who}_x": cos * dx + sin * dy, f"{who}_y": cos * dy - sin * dx}
    return pd.DataFrame(out)


def _sampled(
    tracks: pd.DataFrame, order: np.ndarray, ref: np.ndarray, other: np.ndarray, steps: int
) -> pd.DataFrame:
    """The samples of windows that open at rows `ref` and `other` of the tracks in `order`."""
    window = np.arange(steps + 1)
    of_ref = tracks.iloc[order[(ref[:, None] + window).ravel()]].reset_index(drop=True)
    of_other = tracks.iloc[order[(other[:, None] + window).ravel()]].reset_index(drop=True)
    dx, dy = of_other["x"] - of_ref["x"], of_other["y"] - of_ref["y"]
    bearing = np.arctan2(dy, dx) - np.arctan2(of_ref["vy"], of_ref["vx"])
    return pd.DataFrame(
        {
            "encounter": np.repeat(np.arange(len(ref)), steps + 1),
            "day": of_ref["day"].astype("category"),
            "ref_id": of_ref["id"],
            "other_id": of_other["id"],
            "t": np.rint(of_ref["t"] * TICKS_PER_SECOND) / TICKS_PER_SECOND,
            "los_angle": wrap_angle(np.asarray(bearing)),
            "distance": np.hypot(dx, dy),
            "speed": np.hypot(of_ref["vx"], of_ref["vy"]),
        }
    )


def _occupants(
    inside: np.ndarray,
    ready: np.ndarray,
    days: np.ndarray,
    tick: np.ndarray,
    x: np.ndarray,
    y: np.ndarray,
    heading: np.ndarray,
    space: AttentionalSpace,
) -> tuple[np.ndarray, np.ndarray]:
    """How many people are in the space of each ready row, and the row of one of them (-1: nobody).

    The space lies inside the square, so only the rows `inside` the square can be in it.
    """
    people, other = np.zeros(len(x), np.int64), np.full(len(x), -1)
    reach = float(np.hypot(*space.corners.T).max())
    for ref, oth in _simultaneous(inside, ready, days, tick, y, reach):
        dx, dy = x[oth] - x[ref], y[oth] - y[ref]
        cos, sin = np.cos(heading[ref]), np.sin(heading[ref])
        seen = space.contains(cos * dx + sin * dy, cos * dy - sin * dx) & (ref != oth)
        people += np.bincount(ref[seen], minlength=len(x))
        other[ref[seen]] = oth[seen]
    return people, other


def _simultaneous(
    inside: np.ndarray, ready: np.ndarray, days: np.ndarray, tick: np.ndarray, y: np.ndarray, reach: float
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Blocks of pairs (ready row, row inside the square) that share a tick, itself included.

    Pairs farther apart than `reach` along y [m] are left out; in a hall that saves most of them.
    """
    if len(inside) == 0:
        return
    rows = inside[np.lexsort((y[inside], tick[inside], days[inside]))]
    fresh = np.r_[True, (np.diff(tick[rows]) != 0) | (np.diff(days[rows]) != 0)]
    beyond = reach + _TOUCH
    place = y[rows] - y[rows].min()
    place += (np.cumsum(fresh) - 1) * (place.max() + 2 * beyond)  # nobody is within reach of another tick
    of_ready = np.flatnonzero(ready[rows])
    first = np.searchsorted(place, place[of_ready] - beyond)
    count = np.searchsorted(place, place[of_ready] + beyond, side="right") - first
    block = np.cumsum(count) // _PAIRS_AT_ONCE
    for b in range(int(block[-1]) + 1 if len(block) else 0):
        mine = block == b
        size = count[mine]
        offset = np.arange(size.sum()) - np.repeat(np.cumsum(size) - size, size)
        yield np.repeat(rows[of_ready[mine]], size), rows[np.repeat(first[mine], size) + offset]


def _changes_of_occupant(
    other: np.ndarray, alone: np.ndarray, person: np.ndarray, piece: np.ndarray
) -> np.ndarray:
    """Rows whose only occupant is not the last one seen in the same gap-free piece of the reference."""
    row = np.flatnonzero(alone)
    who = person[other[row]]
    changed = np.zeros(len(other), bool)
    changed[row[1:]] = (piece[row[1:]] == piece[row[:-1]]) & (who[1:] != who[:-1])
    return changed


def _always(condition: np.ndarray, first: np.ndarray, last: np.ndarray) -> np.ndarray:
    """Whether the condition holds at every row from first to last (inclusive)."""
    failures = np.r_[0, np.cumsum(~condition)]
    return np.asarray(failures[last + 1] == failures[np.minimum(first, last + 1)])


def _without_overlap(openings: np.ndarray, whole: np.ndarray, steps: int) -> np.ndarray:
    """Earliest windows first: those of `whole` that begin after the end of the last one taken."""
    taken = np.zeros(len(openings), bool)
    candidates = np.flatnonzero(whole)
    following = np.searchsorted(openings[candidates], openings[candidates] + steps, side="right")
    at = 0
    while at < len(candidates):
        taken[candidates[at]] = True
        at = int(following[at])
    return taken


def _sift(rows: np.ndarray, conditions: list[tuple[str, np.ndarray]]) -> tuple[np.ndarray, dict[str, int]]:
    """Rows that meet all conditions, and how many each condition turned away first."""
    reasons: dict[str, int] = {}
    for reason, condition in conditions:
        passing = rows[condition[rows]]
        reasons[reason] = len(rows) - len(passing)
        rows = passing
    return rows, reasons
