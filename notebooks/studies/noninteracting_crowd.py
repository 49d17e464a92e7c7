"""A crowd of people who do not avoid each other: every encounter is chance, and no zone is true.

The counterpart of `szlib.make_plaza`: whatever claims to find respect must find none here.
"""

from __future__ import annotations

import numpy as np
import pandas as pd

from szlib.core.errors import DataError
from szlib.encounters.geometry import ATC_SQUARE, Area
from szlib.tracks import funnels
from szlib.tracks.clock import TICKS_PER_SECOND, to_clock

_DAY = "indifferent"
_AROUND = 6.0  # people come into view so far outside the square [m]
_SPEEDS = (0.6, 1.6)  # slowest and fastest [m/s]
_BUNCH = 20.0  # a bunch comes within so many seconds


def noninteracting_crowd(
    *,
    seed: int = 0,
    people: int = 1000,
    minutes: float = 60.0,
    bunch: int = 1,
    square: Area = ATC_SQUARE,
) -> pd.DataFrame:
    """People who cross the square on straight paths, with random times, paths and speeds.

    Parameters
    ----------
    seed : the same seed gives the same crowd.
    people : how many come; moments are even over the recording, entrances and exits along its edges.
    minutes : length of the recording [min]; later samples are cut off.
    bunch : so many come by one side and leave by one other, all within 20 s, as from a train; they mind each
        other no more than anybody else.
    square : that they cross; they come into view 6 m outside of it.

    Returns
    -------
    A track table, as from `szlib.read_tracks`, with times since the recording began.

    Raises
    ------
    DataError : nobody comes, or nothing is recorded.
    """
    if not (people >= 1 and 0 < minutes < np.inf and bunch >= 1):
        raise DataError(
            "expected people >= 1, minutes > 0 and bunch >= 1; "
            f"got {people} people, {minutes} minutes, bunches of {bunch}"
        )
    rng = np.random.default_rng(seed)
    view, of = square.grown(_AROUND), np.arange(people) // bunch
    side = rng.integers(4, size=people)[of]
    begin = _on_edge(view, side, rng.uniform(size=people))
    end = _on_edge(view, (side + rng.integers(1, 4, size=people)[of]) % 4, rng.uniform(size=people))
    duration = np.hypot(*(end - begin).T) / rng.uniform(*_SPEEDS, people)
    arrival = rng.uniform(0, 60 * minutes, people)[of] + rng.uniform(0, _BUNCH if bunch > 1 else 0.0, people)
    first, last = (
        np.ceil(arrival * TICKS_PER_SECOND),
        np.floor(np.minimum(arrival + duration, 60 * minutes) * TICKS_PER_SECOND),
    )
    count = np.maximum(last - first + 1, 0).astype(int)
    person = np.repeat(np.arange(people), count)
    tick = first[person] + np.arange(len(person)) - np.repeat(np.cumsum(count) - count, count)
    share = ((tick / TICKS_PER_SECOND - arrival[person]) / duration[person])[:, None]
    where = begin[person] + share * (end - begin)[person]
    rows = pd.DataFrame({"day": _DAY, "id": person, "t": tick / TICKS_PER_SECOND})
    rows[["x", "y"]] = where
    stage = funnels.stage("indifferent crowd", len(rows), len(rows), {})
    return to_clock(funnels.attach(rows, [stage]), max_gap=1.5 / TICKS_PER_SECOND)


def _on_edge(square: Area, side: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Points on the sides (left, lower, right, upper) of a square, shape (n, 2) [m]."""
    (x0, x1), (y0, y1) = square.x, square.y
    x = np.select([side == 0, side == 2], [x0, x1], x0 + share * (x1 - x0))
    y = np.select([side == 1, side == 3], [y0, y1], y0 + share * (y1 - y0))
    return np.column_stack([x, y])
