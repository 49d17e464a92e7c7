"""What a track table must be, whichever reader made it."""

import numpy as np
import pandas as pd

from szlib.core.checks import check_rows
from szlib.core.errors import DataError
from szlib.tracks import funnels
from szlib.tracks.clock import COLUMNS, clock_index, compute_velocities


def check_tracks(tracks: pd.DataFrame) -> None:
    """Raise DataError where a table is no track table: what is wrong, and where."""
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
    is_near = np.isclose(given, right, rtol=0, atol=1e-6, equal_nan=True)
    advice = "let szlib.tracks.clock.to_clock compute velocities from positions, and never bridge a gap"
    expected = f"expected velocities over +-0.5 s; {advice}"
    check_rows(tracks, is_near.all(axis=1), ["day", "id", "t", "vx", "vy"], expected)
    stages = funnels.get(tracks)
    if not stages:
        raise DataError(
            'the table has no funnel; expected its stages in .attrs["funnel"]'
        )
    for stage in stages:
        funnels.stage(*(stage[key] for key in ("stage", "entered", "kept", "rejected")))
