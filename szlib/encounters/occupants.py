"""People near each other: rows at one moment, people in the attentional space of a row, and their samples."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any

import numpy as np
import pandas as pd

from ..tracks.clock import COLUMNS, TICKS_PER_SECOND, clock_index
from .geometry import Area, AttentionalSpace, wrap_angle

SAMPLE_COLUMNS = [
    "encounter",
    "day",
    "ref_id",
    "other_id",
    "t",
    "los_angle",
    "distance",
    "speed",
    "other_los_angle",
    "other_speed",
]
"""Columns of a table of samples; the column kind follows them."""
_AT_ONCE = 500_000  # rows searched at a time


def find_neighbours(
    place: np.ndarray, moment: np.ndarray, reach: float
) -> Iterator[np.ndarray]:
    """Yield blocks of pairs of rows at one moment, at most `reach` [m] apart along both axes, each once.

    There is one block at least; without a row it is empty.

    Parameters
    ----------
    place : positions x + iy, shape (n,) [m].
    moment : number of the moment of each row, shape (n,).
    reach : largest distance along an axis [m].

    Yields
    ------
    The rows of the two people of each pair, shape (2, n).
    """
    if len(place) == 0:
        yield np.empty((2, 0), int)
        return
    # All moments one after the other on a line, farther apart than the reach.
    length = np.ptp(place.real) + 2 * reach
    along = place.real + length * (moment - moment.min())
    order = np.argsort(along)
    along = along[order]
    across = place.imag[order]
    last = np.searchsorted(along, along + reach, side="right")
    for rows in np.array_split(np.arange(len(order)), 1 + len(order) // _AT_ONCE):
        number, other = spans(rows + 1, last[rows])
        one = rows[number]
        near = np.flatnonzero(np.abs(across[other] - across[one]) <= reach)
        yield order[np.stack([one[near], other[near]])]


def spans(first: np.ndarray, last: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """List the integers of ranges, from each `first` up to the one before its `last`.

    Returns, of each integer, the number of its range, and the integer.
    """
    n = last - first
    position = np.repeat(np.arange(len(n)), n)
    return position, np.arange(len(position)) + np.repeat(last - np.cumsum(n), n)


def firsts(numbers: np.ndarray) -> np.ndarray:
    """Positions at which sorted `numbers`, at least 0, change: the first one of each."""
    return np.flatnonzero(np.diff(numbers, prepend=-1))


_ROUNDING = 1e-3  # larger than every rounding error of a position [m]


@dataclass(frozen=True, eq=False)
class TrackRows:
    """The rows of a track table by person and time, as arrays of one length.

    Attributes
    ----------
    order : position of each row in the table.
    tick, piece : number of the tick and of the gap-free piece, as from `clock_index`.
    day, person : number of the day and of the person, each from 0.
    place : position x + iy [m].
    velocity : vx + i vy [m/s], NaN where unknown.
    """

    order: np.ndarray
    tick: np.ndarray
    piece: np.ndarray
    day: np.ndarray
    person: np.ndarray
    place: np.ndarray
    velocity: np.ndarray

    @classmethod
    def from_tracks(cls, tracks: pd.DataFrame) -> TrackRows:
        """The rows of the table `tracks`.  Raises DataError as `clock_index`."""
        order, tick, piece = clock_index(tracks)
        day = pd.factorize(tracks["day"], sort=True)[0][order]
        ids = tracks["id"].to_numpy()[order]
        person = np.cumsum(np.r_[False, (np.diff(day) != 0) | (ids[1:] != ids[:-1])])
        x, y, vx, vy = (tracks[name].to_numpy(float)[order] for name in COLUMNS[3:])
        return cls(order, tick, piece, day, person, x + 1j * y, vx + 1j * vy)

    @cached_property
    def recorded(self) -> tuple[np.ndarray, np.ndarray]:
        """First second of each day, and the seconds of a circle that holds its recording."""
        second = self.tick // TICKS_PER_SECOND
        begins = firsts(self.day)
        first = np.minimum.reduceat(second, begins)
        return first, np.maximum.reduceat(second, begins) - first + 2

    @cached_property
    def speed(self) -> np.ndarray:
        """Magnitude of the velocity [m/s]."""
        return np.asarray(np.abs(self.velocity))

    @cached_property
    def ahead(self) -> np.ndarray:
        """Direction of the velocity, a complex number of length 1."""
        return np.asarray(np.exp(1j * np.angle(self.velocity)))

    @cached_property
    def moment(self) -> np.ndarray:
        """Number of the moment, a tick of a day, of each row."""
        tick = self.tick - self.tick.min(initial=2**62)
        return np.asarray(self.day * (tick.max(initial=0) + 1) + tick)

    def __len__(self) -> int:
        return len(self.tick)

    def within(self, area: Area) -> np.ndarray:
        """Whether each row is in the `area`."""
        return area.contains(self.place.real, self.place.imag)

    def distance(self, one: np.ndarray, other: np.ndarray) -> np.ndarray:
        """Distance between the positions of rows `one` and `other` [m]."""
        return np.asarray(np.abs(self.place[other] - self.place[one]))

    def around(
        self, values: np.ndarray, at: np.ndarray, steps: np.ndarray
    ) -> np.ndarray:
        """The `values` that lie `steps` [ticks] after the rows `at`; NaN past a gap."""
        start = at[..., None]
        there = (start + steps) % len(self)  # beyond the ends: another piece
        return np.where(self.piece[there] == self.piece[start], values[there], np.nan)

    def approach(self, pairs: np.ndarray, begin: Any, end: Any) -> np.ndarray:
        """Nearest approach of `pairs` of rows (2, n) from `begin` to `end` [s], if both walk on [m]."""
        apart, relative = (
            each[pairs[1]] - each[pairs[0]] for each in (self.place, self.velocity)
        )
        square = np.maximum(np.abs(relative) ** 2, 1e-9)
        time = -(apart * relative.conj()).real / square
        return np.asarray(np.abs(apart + np.clip(time, begin, end) * relative))

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
    people = np.zeros(len(rows), np.intp)
    other = np.full(len(rows), -1)
    reach = float(np.hypot(*space.corners.T).max()) + _ROUNDING
    for pairs in find_neighbours(rows.place[inside], rows.moment[inside], reach):
        both = inside[np.hstack([pairs, pairs[::-1]])]
        ref, oth = both[:, ready[both[0]]]
        seen = (rows.place[oth] - rows.place[ref]) * rows.ahead[ref].conj()
        within = space.contains(seen.real, seen.imag)
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
    changed[row[1:]] = (np.diff(rows.piece[row]) == 0) & (np.diff(person) != 0)
    return changed


def sample_rows(
    tracks: pd.DataFrame,
    rows: TrackRows,
    encounter: np.ndarray,
    ref: np.ndarray,
    other: np.ndarray,
) -> pd.DataFrame:
    """Measure two people at the `rows` `ref` and `other` of `tracks`: one row a sample of an `encounter`.

    The time is that of the reference pedestrian: in a shifted crowd they differ.
    """
    at = rows.order[ref]
    ids = tracks["id"].to_numpy()
    seen = rows.place[other] - rows.place[ref]
    heading, other_heading = (np.angle(rows.velocity[each]) for each in (ref, other))
    columns = [
        encounter,
        tracks["day"].astype("category").iloc[at].array,
        ids[at],
        ids[rows.order[other]],
        rows.tick[ref] / TICKS_PER_SECOND,
        wrap_angle(np.angle(seen) - heading),
        np.abs(seen),
        rows.speed[ref],
        wrap_angle(np.angle(-seen) - other_heading),
        rows.speed[other],
    ]
    return pd.DataFrame(dict(zip(SAMPLE_COLUMNS, columns, strict=True)))
