"""The people inside the attentional space of each reference pedestrian, at every tick of a day at once."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields

import numpy as np
import pandas as pd

from ..tracks.clock import clock_index
from .geometry import AttentionalSpace

# pairs of people held in memory at a time: they fit into a cache
_PAIRS_AT_ONCE = 250_000
# larger than every rounding error of a position, for any number of ticks [m]
_ROUNDING = 1e-3

Range = tuple[np.ndarray, np.ndarray]  # low and high end, for each row


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
        x, y, vx, vy = (
            tracks[name].to_numpy(float)[order] for name in ("x", "y", "vx", "vy")
        )
        day, ids = (
            pd.factorize(tracks["day"], sort=True)[0][order],
            tracks["id"].to_numpy()[order],
        )
        person = np.cumsum(np.r_[False, (np.diff(day) != 0) | (ids[1:] != ids[:-1])])
        return cls(
            order,
            tick,
            piece,
            day,
            person,
            x,
            y,
            vx,
            vy,
            np.hypot(vx, vy),
            np.arctan2(vy, vx),
        )

    def __len__(self) -> int:
        return len(self.x)

    def select(self, rows: np.ndarray) -> TrackRows:
        """Some of these `rows` (a mask or indices), with the numbers of their people and pieces."""
        return TrackRows(*(getattr(self, each.name)[rows] for each in fields(self)))


def find_occupants(
    rows: TrackRows, inside: np.ndarray, ready: np.ndarray, space: AttentionalSpace
) -> tuple[np.ndarray, np.ndarray]:
    """Count the people in the `space` of each of `rows`, and give the row of one of them (-1 if it is empty).

    Only rows that are `ready` (booleans) have a space.  The space lies inside the area, so only the rows
    `inside` the area (their indices) can be in it.
    """
    found = [(np.empty(0, np.intp),) * 2]
    cosines, sines = np.cos(rows.heading), np.sin(rows.heading)
    ahead, side = space.corners.T[..., None]
    x, y = ahead * cosines - side * sines, ahead * sines + side * cosines
    for ref, oth in _simultaneous(
        rows, inside, ready, (x.min(0), x.max(0)), (y.min(0), y.max(0))
    ):
        dx, dy = rows.x[oth] - rows.x[ref], rows.y[oth] - rows.y[ref]
        cos, sin = cosines[ref], sines[ref]
        within = space.contains(cos * dx + sin * dy, cos * dy - sin * dx) & (ref != oth)
        found.append((ref[within], oth[within]))
    ref, oth = map(np.concatenate, zip(*found, strict=True))
    other = np.full(len(rows), -1)
    other[ref] = oth
    return np.bincount(ref, minlength=len(rows)), other


def occupant_changes(rows: TrackRows, other: np.ndarray, one: np.ndarray) -> np.ndarray:
    """Whether the only occupant of each of `rows` differs from the last one in the same gap-free piece.

    `other` is as from `find_occupants`; `one` says which rows have exactly one occupant.
    """
    row = np.flatnonzero(one)
    person = rows.person[other[row]]
    changed = np.zeros(len(other), bool)
    changed[row[1:]] = (rows.piece[row[1:]] == rows.piece[row[:-1]]) & (
        person[1:] != person[:-1]
    )
    return changed


def _simultaneous(
    rows: TrackRows,
    inside: np.ndarray,
    ready: np.ndarray,
    along_x: Range,
    along_y: Range,
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield blocks of pairs (ready row, row inside the area) that share a tick.

    Pairs are left out that are outside the range of the space of the first along x or y: smallest and largest
    difference of each of the `rows` [m].  In a hall these are most pairs.
    """
    if len(inside) == 0:
        return
    at = inside[np.lexsort((rows.y[inside], rows.tick[inside], rows.day[inside]))]
    new_tick = np.r_[True, (np.diff(rows.tick[at]) != 0) | (np.diff(rows.day[at]) != 0)]
    x, (low_x, high_x), (low_y, high_y) = rows.x, along_x, along_y
    ready_rows = np.flatnonzero(ready[at])
    low, high = low_y[at[ready_rows]] - _ROUNDING, high_y[at[ready_rows]] + _ROUNDING
    beyond = max(-low.min(initial=0), high.max(initial=0))
    place = rows.y[at] - rows.y[at].min()
    # ticks lie out of reach of each other
    place += (np.cumsum(new_tick) - 1) * (place.max() + 2 * beyond)
    first = np.searchsorted(place, place[ready_rows] + low)
    count = np.searchsorted(place, place[ready_rows] + high, side="right") - first
    block = np.cumsum(count) // _PAIRS_AT_ONCE
    for chosen in map(
        slice,
        starts := np.flatnonzero(np.diff(block, prepend=-1)),
        [*starts[1:], len(block)],
    ):
        size = count[chosen]
        offset = np.arange(size.sum()) - np.repeat(np.cumsum(size) - size, size)
        one, other = (
            np.repeat(at[ready_rows[chosen]], size),
            at[np.repeat(first[chosen], size) + offset],
        )
        difference = x[other] - x[one]
        near = (difference >= low_x[one] - _ROUNDING) & (
            difference <= high_x[one] + _ROUNDING
        )
        yield one[near], other[near]
