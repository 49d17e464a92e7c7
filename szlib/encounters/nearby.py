"""The rows that encounters in a square can depend on, one in six of a mall's: for who searches many times."""

from __future__ import annotations

import numpy as np
import pandas as pd

from ..tracks import funnels
from ..tracks.clock import TICKS_PER_SECOND, VELOCITY_SPAN
from .geometry import Area
from .kinds import REACH, number_people
from .occupants import Rows


def near_square(tracks: pd.DataFrame, square: Area, duration: float) -> pd.DataFrame:
    """The rows of a track table, by person and time, that its encounters can depend on.

    `find_encounters` finds the same in them as in the whole, in this square or one within it, in windows of
    `duration` [s] or less.  Their funnel says how many are elsewhere.  DataError as `find_encounters`.
    """
    rows = Rows.of(tracks)
    kept = may_matter(rows.x, rows.y, number_people(rows.day, rows.person)[0], square, duration)
    stage = funnels.stage("near the square", len(kept), kept.sum(), {"elsewhere": (~kept).sum()})
    table = tracks.iloc[rows.order[kept]].reset_index(drop=True)
    return funnels.attach(table, [*funnels.get(tracks), stage])


def may_matter(x: np.ndarray, y: np.ndarray, person: np.ndarray, square: Area, duration: float) -> np.ndarray:
    """Which rows, by person (numbered from 0) and time, `find_encounters` can depend on; (n,) booleans.

    Of people who are in the square at all, those in the square grown by `REACH` (kinds), half a second around
    (velocity), and the `duration` [s] after (both people must be tracked).
    """
    came = np.zeros(person[-1] + 1 if len(person) else 0, bool)
    came[person[square.contains(x, y)]] = True
    there = square.grown(REACH).contains(x, y) & came[person]
    so_far, row = np.r_[0, np.cumsum(there)], np.arange(len(there))
    after = row + round(VELOCITY_SPAN * TICKS_PER_SECOND)
    before = row - round(max(duration, VELOCITY_SPAN) * TICKS_PER_SECOND)
    return np.asarray(so_far[np.minimum(after + 1, len(row))] > so_far[np.maximum(before, 0)])
