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

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from ..checks import check_columns
from ..errors import DataError
from ..tracks import funnels
from ..tracks.clock import COLUMNS, TICKS_PER_SECOND
from .areas import area_for
from .geometry import ATC_SQUARE, PAPER_SPACE, Area, AttentionalSpace
from .kinds import REACH, kinds_of_pairs, number_people, of_kind
from .occupants import Rows, changes_of_occupant, occupants
from .samples import sampled
from .windows import always, sift, without_overlap

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
    steps = _steps(duration, min_distance, min_speed)
    check_columns(tracks, COLUMNS)
    rows, area = Rows.of(tracks), area_for(tracks, square)
    opening = _openings(rows, area, space, min_distance, min_speed)
    kept, windows = _windows(rows, opening, steps, throughout)
    ref, other = opening.rows[kept], opening.other[opening.rows[kept]]

    samples = sampled(tracks, rows.order, ref, other, steps)
    number, _ = number_people(rows.day, rows.person)
    near = area.grown(REACH).contains(rows.x, rows.y)
    position, velocity = (rows.x, rows.y), (rows.vx, rows.vy)
    kind = kinds_of_pairs(number[ref], number[other], number, rows.tick, position, velocity, near)
    samples["kind"] = kind.repeat(steps + 1)
    samples.attrs["area"] = str(area)
    return of_kind(funnels.attach(samples, [*funnels.get(tracks), opening.stage, windows]), kinds)


def _steps(duration: float, min_distance: float, min_speed: float) -> int:
    """The steps of the clock in a window; DataError where a parameter has no meaning."""
    if not (0 < duration < _LONGEST_WINDOW and 0 <= min_distance < np.inf and 0 < min_speed < np.inf):
        raise DataError(
            f"expected 0 < duration < {_LONGEST_WINDOW:g} s, min_distance >= 0 m and min_speed > 0 m/s; "
            f"got {duration} s, {min_distance} m, {min_speed} m/s"
        )
    steps = round(duration * TICKS_PER_SECOND)
    if abs(duration * TICKS_PER_SECOND - steps) > 1e-6:
        raise DataError(f"duration must be a multiple of 0.1 s, the step of the clock; got {duration} s")
    return steps


@dataclass(frozen=True, eq=False)
class _Openings:
    """Ticks at which an encounter may open, and what holds at every row.

    rows : those ticks; other : the row of somebody in the space of each row (-1: nobody); alone, several :
    of exactly one, of more; cornered : its corners are in the square; ready : so, and fast enough.
    """

    rows: np.ndarray
    other: np.ndarray
    alone: np.ndarray
    several: np.ndarray
    cornered: np.ndarray
    ready: np.ndarray
    stage: dict[str, Any]


def _openings(
    rows: Rows, area: Area, space: AttentionalSpace, min_distance: float, min_speed: float
) -> _Openings:
    """Ticks that meet the four conditions by themselves."""
    inside = area.contains(rows.x, rows.y)
    at = np.flatnonzero(inside)
    cos, sin = np.cos(rows.heading[at]), np.sin(rows.heading[at])
    ahead, side = space.corners.T[..., None]
    cornered = inside.copy()
    cornered[at] = area.covers(rows.x[at] + ahead * cos - side * sin, rows.y[at] + ahead * sin + side * cos)
    ready = cornered & (rows.speed >= min_speed)
    people, other = occupants(rows, at, ready, space)
    alone, who = people == 1, other[people == 1]
    far = np.zeros(len(rows), bool)
    far[alone] = np.hypot(rows.x[who] - rows.x[alone], rows.y[who] - rows.y[alone]) >= min_distance
    found, reasons = sift(
        np.arange(len(rows)),
        [
            ("not in the square", inside),
            ("velocity unknown", np.isfinite(rows.speed)),
            ("a corner of the space outside the square", cornered),
            (f"slower than {min_speed} m/s", ready),
            ("nobody in the space", people >= 1),
            ("several people in the space", alone),
            (f"other person nearer than {min_distance} m", far),
        ],
    )
    stage = funnels.stage("encounters: ticks that open a window", len(rows), len(found), reasons)
    return _Openings(found, other, alone, people > 1, cornered, ready, stage)


def _windows(
    rows: Rows, opening: _Openings, steps: int, throughout: bool
) -> tuple[np.ndarray, dict[str, Any]]:
    """Which of the openings begin a window that meets the conditions throughout, and the funnel's stage."""
    first, partner = opening.rows, opening.other[opening.rows]
    last, partner_last = (np.minimum(row + steps, len(rows) - 1) for row in (first, partner))
    tracked = np.ones(len(first), bool)
    for begin, end in ((first, last), (partner, partner_last)):
        tracked &= (rows.piece[end] == rows.piece[begin]) & (rows.tick[end] - rows.tick[begin] == steps)
    intrusion = changes_of_occupant(rows, opening.other, opening.alone) | opening.several
    conditions = [
        ("a track ends within the window", tracked),
        ("a corner leaves the square within the window", always(opening.cornered, first, last)),
        ("too slow within the window", always(opening.ready, first, last)),
        ("somebody else enters the space", always(~intrusion, first + 1, last)),
    ]
    if throughout:
        conditions.append(("the other person leaves the space", always(opening.alone, first, last)))
    whole = np.logical_and.reduce([condition for _, condition in conditions])
    conditions.append(("overlaps an earlier window", without_overlap(first, whole, steps)))
    kept, reasons = sift(np.arange(len(first)), conditions)
    return kept, funnels.stage("encounters: windows", len(first), len(kept), reasons)
