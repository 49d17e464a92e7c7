"""Samples of encounters: measurements in each window, in the reference pedestrian's frame."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from ..tracks.clock import TICKS_PER_SECOND
from .geometry import wrap_angle
from .kinds import KINDS

SAMPLE_COLUMNS = [
    "encounter", "day", "ref_id", "other_id", "t", "los_angle", "distance", "speed", "other_los_angle",
    "other_speed",
]  # fmt: skip
"""Columns of a table of samples; the column kind follows them."""


def sample_windows(
    tracks: pd.DataFrame,
    order: np.ndarray,
    ref: np.ndarray,
    other: np.ndarray,
    steps: int,
) -> pd.DataFrame:
    """The samples of windows of `steps` that open at rows `ref` and `other` of `tracks` in `order`."""
    window = np.arange(steps + 1)
    samples = sample_rows(
        tracks,
        order[(ref[:, None] + window).ravel()],
        order[(other[:, None] + window).ravel()],
    )
    samples.insert(0, "encounter", np.repeat(np.arange(len(ref)), steps + 1))
    return samples


def sample_rows(
    tracks: pd.DataFrame, ref: np.ndarray, other: np.ndarray
) -> pd.DataFrame:
    """Measure two people at rows `ref` and `other` of `tracks`: `SAMPLE_COLUMNS` without the encounter.

    The time is that of the reference pedestrian: in a shifted crowd they differ.
    """
    of_ref, of_other = (
        tracks.iloc[rows].reset_index(drop=True) for rows in (ref, other)
    )
    dx, dy = of_other["x"] - of_ref["x"], of_other["y"] - of_ref["y"]
    bearing = np.arctan2(dy, dx) - np.arctan2(of_ref["vy"], of_ref["vx"])
    from_other = np.arctan2(-dy, -dx) - np.arctan2(of_other["vy"], of_other["vx"])
    return pd.DataFrame(
        {
            "day": of_ref["day"].astype("category"),
            "ref_id": of_ref["id"],
            "other_id": of_other["id"],
            "t": np.rint(of_ref["t"] * TICKS_PER_SECOND) / TICKS_PER_SECOND,
            "los_angle": wrap_angle(np.asarray(bearing)),
            "distance": np.hypot(dx, dy),
            "speed": np.hypot(of_ref["vx"], of_ref["vy"]),
            "other_los_angle": wrap_angle(np.asarray(from_other)),
            "other_speed": np.hypot(of_other["vx"], of_other["vy"]),
        }
    )


def no_samples() -> pd.DataFrame:
    """A table of samples, with their kind, without a row."""
    types: dict[str, Any] = dict.fromkeys(SAMPLE_COLUMNS, "float64")
    types |= dict.fromkeys(("encounter", "ref_id", "other_id"), "int64")
    types |= {"day": "category", "kind": pd.CategoricalDtype(list(KINDS))}
    return pd.DataFrame(columns=list(types)).astype(types)
