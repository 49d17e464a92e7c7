"""The people inside the attentional space of each reference pedestrian, at every tick of a day at once."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
import pandas as pd

from ..tracks.clock import clock_index
from .geometry import AttentionalSpace
from .neighbours import find_neighbours

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
