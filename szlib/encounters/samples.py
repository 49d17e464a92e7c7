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
    at, ids = rows.order[ref], tracks["id"].to_numpy()
    seen = rows.place[other] - rows.place[ref]
    heading, other_heading = (np.angle(rows.velocity[each]) for each in (ref, other))
    columns = [
        encounter,
        days.iloc[at].array,
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
