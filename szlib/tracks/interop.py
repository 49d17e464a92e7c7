"""What a track table must be, and the conversion to PedPy.

A loader for a new data set is a function that returns a **track table**; everything after it
(`find_encounters`, `SocialZone.fit`, every plot) needs only

    day  str or category   recording: a calendar day "YYYY-MM-DD" in local time, or any other name
    id   integer           person, unique within the day
    t    float [s]         on the clock: multiples of 0.1 s, seconds since 1970 or since any moment
    x y  float [m]         position in the world, finite, right-handed (y is to the left of x)
    vx vy  float [m/s]     displacement over +-0.5 s within a gap-free piece; NaN in a piece of one tick

sorted by day, id, t, without duplicates.  Its funnel is in ``.attrs["funnel"]``; each stage adds up.
Positions are not interpolated across a gap: while a person is not seen, ticks are missing.

The short way: collect day, id, t [s], x, y [m] in any order and at any rate, count rejected rows with
`funnels.stage`, and call `clock.to_clock`.  `check_tracks` checks the result; use it in your test.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from ..core.checks import check_rows
from ..core.errors import DataError
from . import funnels
from .clock import (
    COLUMNS,
    TICKS_PER_SECOND,
    clock_index,
    compute_velocities,
    nearest_tick,
)

if TYPE_CHECKING:
    from pedpy import TrajectoryData

# greatest difference between velocities and those from positions [m/s]
_TOLERANCE = 1e-6


def check_tracks(tracks: pd.DataFrame) -> None:
    """Check that a table is a track table.

    Parameters
    ----------
    tracks : the table.

    Raises
    ------
    DataError : says what is wrong, and where.

    Examples
    --------
    >>> import pandas as pd
    >>> from szlib.tracks import check_tracks, to_clock
    >>> raw = pd.DataFrame({"day": "any", "id": 1, "t": [0.0, 0.4], "x": [0.0, 0.5], "y": 0.0})
    >>> check_tracks(to_clock(raw))
    >>> check_tracks(to_clock(raw).iloc[::-1])
    Traceback (most recent call last):
    ...
    szlib.core.errors.DataError: row 4: got {...}; this row is out of order; ...
    """
    order = clock_index(tracks)[0]
    expected = "this row is out of order; expected rows sorted by day, id, t"
    check_rows(tracks, order == np.arange(len(order)), ["day", "id", "t"], expected)
    if list(tracks.columns[: len(COLUMNS)]) != COLUMNS:
        raise DataError(
            f"columns are {list(tracks.columns)}; expected {COLUMNS} first, in this order"
        )
    if not pd.api.types.is_integer_dtype(tracks["id"]):
        raise DataError(f"id is {tracks['id'].dtype}; expected whole numbers")
    right, given = compute_velocities(tracks), tracks[["vx", "vy"]].to_numpy(float)
    is_right = np.isclose(given, right, rtol=0, atol=_TOLERANCE, equal_nan=True).all(
        axis=1
    )
    table = tracks.assign(expected_vx=right[:, 0], expected_vy=right[:, 1])
    advice = "let szlib.tracks.clock.to_clock compute velocities from positions, and never bridge a gap"
    columns = ["day", "id", "t", "vx", "vy", "expected_vx", "expected_vy"]
    check_rows(table, is_right, columns, f"expected velocities over +-0.5 s; {advice}")
    stages = funnels.get(tracks)
    if not stages:
        raise DataError(
            'the table has no funnel; expected its stages in .attrs["funnel"]'
        )
    for stage in stages:
        funnels.stage(
            stage["stage"], stage["entered"], stage["kept"], stage["rejected"]
        )


def to_pedpy(tracks: pd.DataFrame) -> TrajectoryData:
    """Convert the track table `tracks` of one day to PedPy's TrajectoryData, at 10 frames/s.

    The frame is t in ticks of 0.1 s.  `szlib.read_tracks` converts back.  Needs the extra `pedpy`.  Raises
    DataError for a table of several days, which PedPy does not distinguish.

    Examples
    --------
    >>> import pandas as pd
    >>> from szlib.tracks import to_clock, to_pedpy
    >>> raw = pd.DataFrame({"day": "any", "id": 1, "t": [0.0, 0.4], "x": [0.0, 0.5], "y": 0.0})
    >>> to_pedpy(to_clock(raw)).frame_rate  # doctest: +SKIP
    10.0
    """
    from pedpy import TrajectoryData

    clock_index(tracks)
    days = tracks["day"].unique()
    if len(days) > 1:
        raise DataError(
            f"PedPy has no days, and the table has {len(days)}: {list(days)[:5]}; pass one of them"
        )
    frame = nearest_tick(tracks["t"].to_numpy(float))
    data = tracks[["id", "x", "y"]].assign(frame=frame).reset_index(drop=True)
    return TrajectoryData(
        data=data[["id", "frame", "x", "y"]], frame_rate=float(TICKS_PER_SECOND)
    )
