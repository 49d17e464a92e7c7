"""People near each other: rows at one moment, and the people in the attentional space of each row."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields

import numpy as np
import pandas as pd

from ..tracks.clock import clock_index
from .geometry import AttentionalSpace

_AT_ONCE = 2_000_000  # pairs of rows held in memory at a time


def find_neighbours(
    x: np.ndarray, y: np.ndarray, moment: np.ndarray, reach: float
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield blocks of pairs of rows at one moment that are at most `reach` [m] apart, each pair once.

    Only rows in the same or neighbouring cells of this width are compared.

    Parameters
    ----------
    x, y : positions, shape (n,) [m].
    moment : number of the moment of each row, at least 0, shape (n,).
    reach : largest distance [m].
    """
    if len(x) == 0:
        return
    ix, iy = (((v - v.min()) // reach).astype(np.int64) for v in (x, y))
    ny, nx = int(iy.max()) + 3, int(ix.max()) + 2
    key = (moment * np.int64(nx) + ix) * ny + iy
    order = np.argsort(key)
    key, x, y, row = key[order], x[order], y[order], np.arange(len(key))
    first, end = (key, key + ny - 1), (key + 1, key + ny + 1)
    for low_key, high_key in zip(first, end, strict=True):
        low = np.maximum(np.searchsorted(key, low_key), row + 1)
        high = np.searchsorted(key, high_key, side="right")
        count = np.maximum(high - low, 0)
        ends = np.cumsum(count)
        cuts = np.searchsorted(ends, np.arange(_AT_ONCE, ends[-1], _AT_ONCE))
        for start, end in zip(np.r_[0, cuts], np.r_[cuts, len(key)], strict=True):
            n = count[start:end]
            one = np.repeat(row[start:end], n)
            other = np.arange(n.sum()) - np.repeat(np.cumsum(n) - n, n) + low[one]
            near = np.hypot(x[one] - x[other], y[one] - y[other]) <= reach
            yield order[one[near]], order[other[near]]


_ROUNDING = 1e-3  # larger than every rounding error of a position [m]


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

    @property
    def moment(self) -> np.ndarray:
        """Number of the moment, a tick of a day, of each row."""
        tick = self.tick - self.tick.min()
        return np.asarray(self.day * (np.int64(tick.max()) + 1) + tick)

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
    reach = float(np.hypot(*space.corners.T).max()) + _ROUNDING
    places = rows.x[inside], rows.y[inside], rows.moment[inside]
    for pair in find_neighbours(*places, reach):
        for ref, oth in (pair, pair[::-1]):
            looks = ready[inside[ref]]
            ref, oth = inside[ref[looks]], inside[oth[looks]]
            dx, dy = rows.x[oth] - rows.x[ref], rows.y[oth] - rows.y[ref]
            cos, sin = cosines[ref], sines[ref]
            within = space.contains(cos * dx + sin * dy, cos * dy - sin * dx)
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
