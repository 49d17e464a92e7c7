"""Who is in whose attentional space, at every tick of a day at once."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pandas as pd

from ..tracks.clock import clock_index
from .geometry import AttentionalSpace

_PAIRS_AT_ONCE = 4_000_000
"""Pairs of people held in memory at a time."""
_TOUCH = 1e-3
"""Covers every rounding of a position, however many ticks there are [m]."""


@dataclass(frozen=True, eq=False)
class Rows:
    """The rows of a track table by person and time, as arrays.

    order : where each row stands in the table; tick, piece : as from `clock_index`; day : its number;
    person : id; x, y [m]; vx, vy [m/s], NaN where unknown; speed [m/s] and heading [rad], of these.
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
    def of(cls, tracks: pd.DataFrame) -> Rows:
        """Those of a track table; DataError as `clock_index`."""
        order, tick, piece = clock_index(tracks)
        x, y, vx, vy = (tracks[name].to_numpy(float)[order] for name in ("x", "y", "vx", "vy"))
        day, person = pd.factorize(tracks["day"])[0][order], tracks["id"].to_numpy()[order]
        return cls(order, tick, piece, day, person, x, y, vx, vy, np.hypot(vx, vy), np.arctan2(vy, vx))

    def __len__(self) -> int:
        return len(self.x)


def occupants(
    rows: Rows, inside: np.ndarray, ready: np.ndarray, space: AttentionalSpace
) -> tuple[np.ndarray, np.ndarray]:
    """How many people are in the space of each ready row, and the row of one of them (-1: nobody).

    The space lies inside the square, so only the rows `inside` the square (their indices) can be in it.
    """
    people, other = np.zeros(len(rows), np.int64), np.full(len(rows), -1)
    reach = float(np.hypot(*space.corners.T).max())
    for ref, oth in _simultaneous(rows, inside, ready, reach):
        dx, dy = rows.x[oth] - rows.x[ref], rows.y[oth] - rows.y[ref]
        cos, sin = np.cos(rows.heading[ref]), np.sin(rows.heading[ref])
        seen = space.contains(cos * dx + sin * dy, cos * dy - sin * dx) & (ref != oth)
        people += np.bincount(ref[seen], minlength=len(rows))
        other[ref[seen]] = oth[seen]
    return people, other


def changes_of_occupant(rows: Rows, other: np.ndarray, alone: np.ndarray) -> np.ndarray:
    """Rows whose only occupant is not the last one seen in the same gap-free piece of the reference."""
    row = np.flatnonzero(alone)
    who = rows.person[other[row]]
    changed = np.zeros(len(other), bool)
    changed[row[1:]] = (rows.piece[row[1:]] == rows.piece[row[:-1]]) & (who[1:] != who[:-1])
    return changed


def _simultaneous(
    rows: Rows, inside: np.ndarray, ready: np.ndarray, reach: float
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Blocks of pairs (ready row, row inside the square) that share a tick, itself included.

    Pairs farther apart than `reach` along y [m] are left out; in a hall that saves most of them.
    """
    if len(inside) == 0:
        return
    at = inside[np.lexsort((rows.y[inside], rows.tick[inside], rows.day[inside]))]
    fresh = np.r_[True, (np.diff(rows.tick[at]) != 0) | (np.diff(rows.day[at]) != 0)]
    beyond = reach + _TOUCH
    place = rows.y[at] - rows.y[at].min()
    place += (np.cumsum(fresh) - 1) * (place.max() + 2 * beyond)  # nobody is within reach of another tick
    of_ready = np.flatnonzero(ready[at])
    first = np.searchsorted(place, place[of_ready] - beyond)
    count = np.searchsorted(place, place[of_ready] + beyond, side="right") - first
    block = np.cumsum(count) // _PAIRS_AT_ONCE
    for b in range(int(block[-1]) + 1 if len(block) else 0):
        mine = block == b
        size = count[mine]
        offset = np.arange(size.sum()) - np.repeat(np.cumsum(size) - size, size)
        yield np.repeat(at[of_ready[mine]], size), at[np.repeat(first[mine], size) + offset]
