"""EWAP files (ETH, hotel, zara, students): frames, and the frame rate estimated from their velocities.

EWAP files count frames, 15 or 25 a second, and do not state the rate.  It follows from their velocity
columns: displacement per frame against velocity.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import polars as pl

from ..core.errors import DataError, warn

FRAME_RATES = (
    1.0,
    240.0,
)  # lowest and highest number of frames a second that a video can have
# Sampling intervals without a sample after which a track ends: 0.9 s where samples are 0.4 s apart.
_GAP = 2.25
# frames a second of EWAP files: ETH 15; hotel, zara and students 25
_USUAL_RATES = (15.0, 25.0)
# A rate needs at least so many steps, and quartiles of their rates at most this share of the median apart;
# it is rounded to a whole number within 1 % of one.
_FEWEST_STEPS, _SPREAD, _WHOLE = 10, 0.1, 0.01
_FARTHEST_NUMBER = 1e12  # larger numbers are damage
_STEP = 0.02  # shorter steps [m] are ignored


def measure_frames(
    rows: pl.DataFrame, path: Path, given: float | None
) -> tuple[float, float | None]:
    """The frame rate [1/s], and the longest gap within a track [s], which follows the sampling interval.

    `rows` of file `path` have id, t [frames], x, y, and vx, vy in the same unit of length a second.  `given`
    is the frame rate; None estimates it.  Raises DataError where the velocities give no rate.
    """
    sane = pl.all_horizontal(pl.col("t", "x", "y", "vx", "vy").abs() < _FARTHEST_NUMBER)
    # drops NaN as well
    rows = rows.filter(sane, pl.col("id").is_not_null()).sort("id", "t")
    estimated, reason = estimate_frame_rate(rows)
    rate = estimated if given is None else float(given)
    if rate is None:
        raise DataError(
            f"{path}: the frame rate cannot be estimated from the file's velocities ({reason}); pass "
            "frame_rate=15 (ETH) or 25 (hotel, zara, students), or what the video has"
        )
    if (
        given is not None
        and estimated is not None
        and abs(given - estimated) > _SPREAD * estimated
    ):
        warn(
            f"{path.name}: read at {rate:g} frames/s as given; its velocities suggest {estimated:.4g}"
        )
    elif given is None and rate not in _USUAL_RATES:
        warn(
            f"{path.name}: its velocities suggest {rate:.4g} frames/s, EWAP files have 15 or 25; if that "
            "is wrong, pass frame_rate"
        )
    frames = rows.select(pl.col("t").diff().over("id"))["t"].drop_nulls()
    interval = frames.filter(frames > 0).median()
    gap = _GAP * float(interval) / rate if isinstance(interval, float | int) else None
    return rate, gap


def estimate_frame_rate(rows: pl.DataFrame) -> tuple[float | None, str]:
    """Frames a second, from displacement per frame against velocity; or None, and the reason.

    `rows` are sorted by person and frame.  The velocity of a row may be that to the next sample (students),
    from the last one (zara) or over both (ETH, hotel): the convention with the smallest spread counts.
    """
    person, frame = rows["id"].to_numpy(), rows["t"].to_numpy()
    position, velocity = (
        rows.select("x", "y").to_numpy(),
        rows.select("vx", "vy").to_numpy(),
    )
    here = np.arange(len(rows))
    conventions = [
        (here[:-1], here[1:], here[:-1]),
        (here[:-1], here[1:], here[1:]),
        (here[:-2], here[2:], here[1:-1]),
    ]
    found = []
    for before, after, at in conventions:
        frames, step = frame[after] - frame[before], position[after] - position[before]
        length = np.einsum("ij,ij->i", step, step)
        usable = (person[after] == person[before]) & (frames > 0) & (length >= _STEP**2)
        rates = (
            np.einsum("ij,ij->i", velocity[at], step)[usable]
            * frames[usable]
            / length[usable]
        )
        if len(rates) >= _FEWEST_STEPS:
            low, rate, high = np.quantile(rates, [0.25, 0.5, 0.75])
            found.append(((high - low) / abs(rate) if rate else np.inf, rate))
    if not found:
        return None, f"fewer than {_FEWEST_STEPS} steps with a velocity"
    spread, rate = min(found)
    if not (spread <= _SPREAD and FRAME_RATES[0] <= rate <= FRAME_RATES[1]):
        return None, f"they give {rate:.3g} frames/s, with quartiles {spread:.0%} apart"
    return (
        float(np.rint(rate))
        if abs(rate - np.rint(rate)) <= _WHOLE * rate
        else float(rate)
    ), ""
