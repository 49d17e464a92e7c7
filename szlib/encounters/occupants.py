"""The people inside the attentional space of each reference pedestrian, at every tick of a day at once."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pandas as pd

from ..tracks.clock import clock_index
from .geometry import AttentionalSpace

_PAIRS_AT_ONCE = 4_000_000  # pairs of people held in memory at a time
_ROUNDING = 1e-3  # larger than every rounding error of a position, for any number of ticks [m]


@dataclass(frozen=True, eq=False)
class TrackRows:
    """The rows of a track table by person and time, as arrays of one length.

    Attributes
    ----------
    order : position of each row in the table.
    tick, piece : number of the tick and of the gap-free piece, as from `clock_index`.
    day, person : number of the day and of the person, each from 0.
    x, y : position [m].
    vx, vy : velocity [m/s], NaN where unknown.
    speed, heading : magnitude [m/s] and direction [rad] of the velocity.
    """

    order: np.ndarray
    tick: np.ndarray
    piece: np.ndarray
    day: np.ndarray
    person: np.ndarray
    x: np.ndarray
    y: np.ndarray
    vx: np.ndarray
    vy: np.ndarray
    speed: np.ndarray
    heading: np.ndarray

    @classmethod
    def from_tracks(cls, tracks: pd.DataFrame) -> TrackRows:
        """The rows of the table `tracks`.  Raises DataError as `clock_index`."""
        order, tick, piece = clock_index(tracks)
        x, y, vx, vy = (tracks[name].to_numpy(float)[order] for name in ("x", "y", "vx", "vy"))
        day, ids = pd.factorize(tracks["day"], sort=True)[0][order], tracks["id"].to_numpy()[order]
        person = np.cumsum(np.r_[False, (np.diff(day) != 0) | (ids[1:] != ids[:-1])])
        return cls(order, tick, piece, day, person, x, y, vx, vy, np.hypot(vx, vy), np.arctan2(vy, vx))

    def __len__(self) -> int:
        return len(self.x)


def find_occupants(
    rows: TrackRows, inside: np.ndarray, ready: np.ndarray, space: AttentionalSpace
) -> tuple[np.ndarray, np.ndarray]:
    """Count the people in the `space` of each of `rows`, and give the row of one of them (-1 if it is empty).

    Only rows that are `ready` (booleans) have a space.  The space lies inside the area, so only the rows
    `inside` the area (their indices) can be in it.
    """
    people, other = np.zeros(len(rows), np.int64), np.full(len(rows), -1)
    reach = float(np.hypot(*space.corners.T).max())
    for ref, oth in _simultaneous(rows, inside, ready, reach):
        dx, dy = rows.x[oth] - rows.x[ref], rows.y[oth] - rows.y[ref]
        cos, sin = np.cos(rows.heading[ref]), np.sin(rows.heading[ref])
        within = space.contains(cos * dx + sin * dy, cos * dy - sin * dx) & (ref != oth)
        people += np.bincount(ref[within], minlength=len(rows))
        other[ref[within]] = oth[within]
    return people, other


def occupant_changes(rows: TrackRows, other: np.ndarray, one: np.ndarray) -> np.ndarray:
    """Whether the only occupant of each of `rows` differs from the last one in the same gap-free piece.

    `other` is as from `find_occupants`; `one` says which rows have exactly one occupant.
    """
    row = np.flatnonzero(one)
    person = rows.person[other[row]]
    changed = np.zeros(len(other), bool)
    changed[row[1:]] = (rows.piece[row[1:]] == rows.piece[row[:-1]]) & (person[1:] != person[:-1])
    return changed


def _simultaneous(
    rows: TrackRows, inside: np.ndarray, ready: np.ndarray, reach: float
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield blocks of pairs (ready row, row inside the area) that share a tick.

    A ready row is also paired with itself.  Pairs farther apart than `reach` along y [m] are left out; in a
    hall these are most pairs.
    """
    if len(inside) == 0:
        return
    at = inside[np.lexsort((rows.y[inside], rows.tick[inside], rows.day[inside]))]
    new_tick = np.r_[True, (np.diff(rows.tick[at]) != 0) | (np.diff(rows.day[at]) != 0)]
    beyond = reach + _ROUNDING
    place = rows.y[at] - rows.y[at].min()
    place += (np.cumsum(new_tick) - 1) * (place.max() + 2 * beyond)  # ticks lie out of reach of each other
    ready_rows = np.flatnonzero(ready[at])
    first = np.searchsorted(place, place[ready_rows] - beyond)
    count = np.searchsorted(place, place[ready_rows] + beyond, side="right") - first
    block = np.cumsum(count) // _PAIRS_AT_ONCE
    for b in range(int(block[-1]) + 1 if len(block) else 0):
        chosen = block == b
        size = count[chosen]
        offset = np.arange(size.sum()) - np.repeat(np.cumsum(size) - size, size)
        yield np.repeat(at[ready_rows[chosen]], size), at[np.repeat(first[chosen], size) + offset]
