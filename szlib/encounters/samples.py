"""Samples of encounters: measurements in each window, in the reference pedestrian's frame."""

from __future__ import annotations

import numpy as np
import pandas as pd

from ..tracks.clock import TICKS_PER_SECOND
from .geometry import wrap_angle
from .occupants import TrackRows

SAMPLE_COLUMNS = [
    "encounter", "day", "ref_id", "other_id", "t", "los_angle", "distance", "speed", "other_los_angle",
    "other_speed",
]  # fmt: skip
"""Columns of a table of samples; the column kind follows them."""


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
    days = tracks["day"].astype("category")
    ids = tracks["id"].to_numpy()[rows.order]
    seen, heading = rows.place[other] - rows.place[ref], np.angle(rows.velocity)
    columns = [
        encounter,
        days.iloc[rows.order[ref]].array,
        ids[ref],
        ids[other],
        rows.tick[ref] / TICKS_PER_SECOND,
        wrap_angle(np.angle(seen) - heading[ref]),
        np.abs(seen),
        rows.speed[ref],
        wrap_angle(np.angle(-seen) - heading[other]),
        rows.speed[other],
    ]
    return pd.DataFrame(dict(zip(SAMPLE_COLUMNS, columns, strict=True)))
