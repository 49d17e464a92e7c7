"""What a file of tracks is like before anybody uses it: frames, gaps, visits, and what it says of speed.

Everything is streamed; a full raw day is one row a person and second when it arrives here.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import polars as pl

from ..errors import DataError
from .clock import TICKS_PER_SECOND, clock_index, nearest_tick, to_clock
from .formats.layouts import Format, readable, recognise
from .formats.plain import plain_file
from .formats.rows import fault
from .options import ReadOptions

STANDING = 0.1
"""Who moves less than that within a second is standing [m] (measured: sensor noise stays below it)."""
_SENSOR_SPEED = {"atc-raw": ("f5", 1e-3), "atc-1hz": ("f4", 1.0)}
"""Field of the file's own speed, and what one unit of it is [m/s]."""


def seconds(path: str | Path) -> pd.DataFrame:
    """One row a person and second: id, second [s], x, y [m] when first seen in it, rows, sensor_speed, moved.

    `sensor_speed` [m/s] is the mean of the file's own speed (NaN where it has none), `moved` [m] the
    displacement until the next second (NaN where the person is not seen then).  Unusable rows are left out.

    Raises DataError as `szlib.read_tracks`.
    """
    path = Path(path)
    with plain_file(path) as plain:
        layout, scan = recognise(plain, path, ReadOptions())
        recording = _sensor_speed(plain, layout)
        usable = scan.filter(fault(layout.metres, layout.seconds, "day" in scan.collect_schema()).is_null())
        time = pl.col("t") * layout.seconds
        grouped = usable.group_by(pl.col("id").cast(pl.Int64), second=time.floor()).agg(
            pl.col("x", "y").sort_by("t").first() * layout.metres, rows=pl.len()
        )
        with readable(path, layout):
            rows = grouped.sort("id", "second").collect(engine="streaming").to_pandas()
            recorded = None if recording is None else recording.collect(engine="streaming").to_pandas()
    rows = (
        rows.assign(sensor_speed=np.nan)
        if recorded is None
        else rows.merge(recorded, how="left", on=["id", "second"])
    )
    step = rows[["id", "second", "x", "y"]].diff()
    followed = ((step["id"] == 0) & (step["second"] == 1)).to_numpy()
    moved = np.where(followed, np.hypot(step["x"], step["y"]), np.nan)
    return rows.assign(moved=np.r_[moved[1:], np.nan])


def _sensor_speed(plain: Path, layout: Format) -> pl.LazyFrame | None:
    if layout.name not in _SENSOR_SPEED:
        return None
    column, unit = _SENSOR_SPEED[layout.name]
    names = [f"f{i}" for i in range(layout.fields)]
    scan = pl.scan_csv(
        plain, schema=dict.fromkeys(names, pl.Float64), has_header=False, ignore_errors=True,
        truncate_ragged_lines=True, missing_columns="insert", glob=False,
    )  # fmt: skip
    whole = pl.col("f1").is_not_null() & (pl.col("f1") % 1 == 0) & pl.col("f0").is_finite()
    keys = [pl.col("f1").cast(pl.Int64).alias("id"), (pl.col("f0") + layout.start).floor().alias("second")]
    return scan.filter(whole).group_by(keys).agg(sensor_speed=pl.col(column).mean() * unit)


def frame_intervals(path: str | Path) -> np.ndarray:
    """Times from one frame to the next [s]; a frame is a time at which anybody was seen."""
    path = Path(path)
    with plain_file(path) as plain:
        layout, scan = recognise(plain, path, ReadOptions())
        with readable(path, layout):
            frames = scan.select(pl.col("t").drop_nulls().unique()).collect(engine="streaming")["t"]
    return np.asarray(np.diff(np.sort(frames.to_numpy())) * layout.seconds)


def people(path: str | Path) -> pd.DataFrame:
    """One row a person: id, first_seen, last_seen, longest_gap [s], rows."""
    path = Path(path)
    with plain_file(path) as plain:
        layout, scan = recognise(plain, path, ReadOptions())
        usable = scan.filter(fault(layout.metres, layout.seconds, "day" in scan.collect_schema()).is_null())
        time = pl.col("t") * layout.seconds
        grouped = usable.group_by(pl.col("id").cast(pl.Int64)).agg(
            first_seen=time.min(), last_seen=time.max(), longest_gap=time.sort().diff().max(), rows=pl.len()
        )
        with readable(path, layout):
            return grouped.sort("id").collect(engine="streaming").to_pandas()


def by_hour(rows: pd.DataFrame, *, tz: str = "Asia/Tokyo") -> pd.DataFrame:
    """From `seconds`: for each day and hour the visits (people seen) and the mean number who stand."""
    local = pd.to_datetime(rows["second"], unit="s", utc=True).dt.tz_convert(tz)
    keyed = rows.assign(
        day=local.dt.strftime("%Y-%m-%d"), hour=local.dt.hour, stands=rows["moved"] < STANDING
    )
    grouped = keyed.groupby(["day", "hour"], as_index=False)
    table = grouped.agg(visits=("id", "nunique"), standing=("stands", "sum"), seconds=("second", "nunique"))
    return table.assign(standing=table["standing"] / table["seconds"]).drop(columns="seconds")


def thinning_error(tracks: pd.DataFrame, *, every: float = 1.0) -> tuple[float, float]:
    """What reading samples so many seconds apart at 10 Hz costs: RMS and 95 % quantile of the error [m].

    Each gap-free piece of a track table is thinned to one tick in `every` seconds and brought back to the
    clock by straight lines, as `to_clock` does.  Measured at 1 s: THOR-MAGNI 5.3 and 9.5 cm, the ETH sequence
    5.6 and 11.6 cm (both are sampled every 0.4 s, so a little more in truth), the plaza 2.9 and 3.6 cm.

    Raises DataError where `every` is no multiple of 0.1 s, or no piece is that long.
    """
    step = round(every * TICKS_PER_SECOND)
    if step < 2 or abs(every * TICKS_PER_SECOND - step) > 1e-6:
        raise DataError(f"every must be a multiple of 0.1 s, at least 0.2 s; got {every}")
    order, tick, piece = clock_index(tracks)
    begin = np.searchsorted(piece, piece)
    known = pd.DataFrame({"day": "", "id": piece, "t": tick / TICKS_PER_SECOND})
    known[["x", "y"]] = tracks[["x", "y"]].to_numpy(float)[order]
    thinned = to_clock(known[(tick - tick[begin]) % step == 0], max_gap=every)
    both = known.assign(tick=tick).merge(
        thinned.assign(tick=nearest_tick(thinned["t"].to_numpy())), on=["id", "tick"], suffixes=("", "_thin")
    )
    if both["id"].duplicated().sum() == 0:
        raise DataError(
            f"no piece of these tracks is longer than {every} s; expected some that can be thinned"
        )
    error = np.hypot(*(both[[name, f"{name}_thin"]].diff(axis=1).to_numpy()[:, 1] for name in "xy"))
    return float(np.sqrt((error**2).mean())), float(np.quantile(error, 0.95))
