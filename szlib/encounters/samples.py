"""Samples of encounters: measurements in each window, in the reference pedestrian's frame."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from ..core.checks import check_columns, check_rows
from ..tracks.clock import COLUMNS, TICKS_PER_SECOND, nearest_tick
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


def reference_frame(tracks: pd.DataFrame, samples: pd.DataFrame) -> pd.DataFrame:
    """Transform both people's paths of each encounter to the reference pedestrian's frame *at the opening*.

    Parameters
    ----------
    tracks : the track table in which the encounters were found.
    samples : samples as from `szlib.find_encounters`, before outliers are removed: the first sample of an
        encounter is its opening.

    Returns
    -------
    One row for each row of `samples`, in their order: encounter, t [s], ref_x, ref_y, other_x, other_y [m].
    x points along the motion at the opening, y to the left (paper, fig. 2).

    Raises
    ------
    DataError : a table lacks a column or is empty, or a sample is not in `tracks`.

    Examples
    --------
    >>> import szlib
    >>> from szlib.encounters import reference_frame
    >>> plaza = szlib.make_plaza("plaza.csv", settings=szlib.PlazaSettings(n_encounters=20))
    >>> tracks = szlib.read_tracks(plaza)
    >>> paths = reference_frame(tracks, szlib.find_encounters(tracks))
    >>> list(paths.columns)
    ['encounter', 't', 'ref_x', 'ref_y', 'other_x', 'other_y']
    """
    ref, oth = match_rows(tracks, samples)
    opening = ref.groupby("encounter")["tick"].transform("idxmin").to_numpy()
    x, y, vx, vy = (ref[name].to_numpy()[opening] for name in ("x", "y", "vx", "vy"))
    cos, sin = np.cos(np.arctan2(vy, vx)), np.sin(np.arctan2(vy, vx))
    out = {"encounter": samples["encounter"].to_numpy(), "t": samples["t"].to_numpy()}
    for person, rows in (("ref", ref), ("other", oth)):
        dx, dy = rows["x"].to_numpy() - x, rows["y"].to_numpy() - y
        out |= {f"{person}_x": cos * dx + sin * dy, f"{person}_y": cos * dy - sin * dx}
    return pd.DataFrame(out)


def match_rows(
    tracks: pd.DataFrame, samples: pd.DataFrame
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """The rows of `tracks` of the reference pedestrian and of the other person, for each of `samples`.

    Both tables have the columns encounter, tick, x, y [m], vx, vy [m/s], in the order of the samples.  Raises
    DataError as `reference_frame`.
    """
    check_columns(tracks, COLUMNS)
    check_columns(samples, SAMPLE_COLUMNS[:5])
    people = tracks[
        tracks["id"].isin(samples["ref_id"]) | tracks["id"].isin(samples["other_id"])
    ]
    people = people[["day", "id", "x", "y", "vx", "vy"]].assign(
        tick=nearest_tick(people["t"].to_numpy(float))
    )
    keys = samples[["encounter", "day", "ref_id", "other_id"]].assign(
        tick=nearest_tick(samples["t"].to_numpy(float))
    )
    ref, oth = (
        keys.merge(
            people,
            how="left",
            left_on=["day", column, "tick"],
            right_on=["day", "id", "tick"],
        )
        for column in ("ref_id", "other_id")
    )
    is_known = ref["x"].notna() & oth["x"].notna()
    expected = "this sample is not in these tracks; pass the tracks it was found in"
    check_rows(samples, is_known, SAMPLE_COLUMNS[:5], expected)
    return ref, oth
