"""How long a frame is, in files that count frames: EWAP's are of 15 or 25 a second, and do not say so.

Their velocity columns give it away: displacement per frame against velocity.
"""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import polars as pl

from ...errors import DataError, DataWarning
from ..options import FRAME_RATES

_EWAP_GAP = 2.25
"""Intervals between samples after which an EWAP track ends: 0.9 s where they are 0.4 s apart."""
_USUAL_RATES = (15.0, 25.0)
"""Frames a second of EWAP files: ETH 15; hotel, zara and students 25."""
_FEWEST_STEPS, _SPREAD, _WHOLE = 10, 0.1, 0.01
"""A rate is told by so many steps at least, the quartiles of their rates apart by at most this share of the
median; it is a whole number if it is within 1 % of one."""
_FARTHEST_NUMBER = 1e12
"""Larger numbers are damage."""
_STEP = 0.02
"""Shorter steps [m] tell nothing of a velocity."""


def frame_clock(rows: pl.DataFrame, path: Path, given: float | None) -> tuple[float, float | None]:
    """Length of a frame and of the longest gap in a track [s]; the latter follows the sampling interval.

    `rows` has id, t [frames], x, y, and vx, vy in the same unit of length a second; `given` is the frame
    rate, or None to take what the velocities tell.  Raises DataError where they do not, or it has no meaning.
    """
    sane = pl.all_horizontal(pl.col("t", "id", "x", "y", "vx", "vy").abs() < _FARTHEST_NUMBER)
    rows = rows.filter(sane).sort("id", "t")  # what is no number, or NaN, is not sane
    told, why = told_rate(rows)
    rate = told if given is None else float(given)
    if rate is None:
        raise DataError(
            f"{path}: the frame rate cannot be told from the file's velocities ({why}); pass frame_rate=15 "
            "(ETH) or 25 (hotel, zara, students), or what the video has"
        )
    if given is not None and told is not None and abs(given - told) > _SPREAD * told:
        warnings.warn(
            f"{path.name}: read at {rate:g} frames/s as asked; its velocities tell {told:.4g}",
            DataWarning, stacklevel=2,
        )  # fmt: skip
    elif given is None and rate not in _USUAL_RATES:
        warnings.warn(
            f"{path.name}: {rate:.4g} frames/s by its velocities, EWAP files have 15 or 25; if that is "
            "wrong, pass frame_rate", DataWarning, stacklevel=2,
        )  # fmt: skip
    frames = rows.select(pl.col("t").diff().over("id"))["t"].drop_nulls()
    interval = frames.filter(frames > 0).median()
    gap = _EWAP_GAP * float(interval) / rate if isinstance(interval, float | int) else None
    return 1 / rate, gap


def told_rate(rows: pl.DataFrame) -> tuple[float | None, str]:
    """Frames a second as velocities tell: displacement per frame against velocity; None, and why, if not.

    `rows` are sorted by person and frame.  A row's velocity may be that to the next sample (students), from
    the last (zara) or over both (ETH, hotel): that which agrees best with itself counts.
    """
    person, frame = rows["id"].to_numpy(), rows["t"].to_numpy()
    position, velocity = rows.select("x", "y").to_numpy(), rows.select("vx", "vy").to_numpy()
    here = np.arange(len(rows))
    habits = [
        (here[:-1], here[1:], here[:-1]),
        (here[:-1], here[1:], here[1:]),
        (here[:-2], here[2:], here[1:-1]),
    ]
    found = []
    for before, after, at in habits:
        frames, step = frame[after] - frame[before], position[after] - position[before]
        length = np.einsum("ij,ij->i", step, step)
        tells = (person[after] == person[before]) & (frames > 0) & (length >= _STEP**2)
        rates = np.einsum("ij,ij->i", velocity[at], step)[tells] * frames[tells] / length[tells]
        if len(rates) >= _FEWEST_STEPS:
            low, rate, high = np.quantile(rates, [0.25, 0.5, 0.75])
            found.append(((high - low) / abs(rate) if rate else np.inf, rate))
    if not found:
        return None, f"fewer than {_FEWEST_STEPS} steps with a velocity"
    spread, rate = min(found)
    if not (spread <= _SPREAD and FRAME_RATES[0] <= rate <= FRAME_RATES[1]):
        return None, f"they give {rate:.3g} frames/s, with quartiles {spread:.0%} apart"
    return (float(np.rint(rate)) if abs(rate - np.rint(rate)) <= _WHOLE * rate else float(rate)), ""
