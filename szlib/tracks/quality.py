"""The quality of a file of tracks before it is used: frames, gaps, visits, and the sensor's speed.

Files are streamed: a full raw day is reduced to one row a person and second.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pandas as pd
import polars as pl

from ..errors import DataError
from .clock import TICKS_PER_SECOND, clock_index, nearest_tick, to_clock
from .formats import TrackFormat, open_file
from .formats.base import readable
from .formats.rows import rejection_reason
from .formats.unpack import unpacked
from .options import ReadOptions

STANDING = 0.1
"""A person who moves less than this within a second stands [m] (measured: sensor noise is smaller)."""


def summarise_seconds(path: str | Path) -> pd.DataFrame:
    """Summarise a file by person and second.

    Parameters
    ----------
    path : a file that `szlib.read_tracks` reads, plain or .gz.

    Returns
    -------
    One row a person and second: id, second [s], x, y [m] when first seen in it, rows, sensor_speed [m/s], the
    mean of the file's own speed (NaN without one), and moved [m], the displacement until the next second (NaN
    where the person is not seen then).  Unusable rows are left out.

    Raises
    ------
    DataError : as in `szlib.read_tracks`.

    Examples
    --------
    >>> import numpy as np, pandas as pd
    >>> from szlib.tracks import summarise_seconds
    >>> walk = pd.DataFrame({"t": np.arange(6) / 2, "id": 1, "x": 0.6 * np.arange(6), "y": 0.0})
    >>> walk.to_csv("walk.csv", index=False)
    >>> summarise_seconds("walk.csv")[["second", "rows", "moved"]]
       second  rows  moved
    0     0.0     2    1.2
    1     1.0     2    1.2
    2     2.0     2    NaN
    """
    with _open(path) as (plain, layout, scan):
        recording = _scan_speeds(plain, layout)
        rows = _usable_rows(layout, scan).group_by("id", second=pl.col("t").floor())
        summary = rows.agg(pl.col("x", "y").sort_by("t").first(), rows=pl.len()).sort("id", "second")
        table = summary.collect(engine="streaming").to_pandas()
        recorded = None if recording is None else recording.collect(engine="streaming").to_pandas()
    table = (
        table.assign(sensor_speed=np.nan)
        if recorded is None
        else table.merge(recorded, how="left", on=["id", "second"])
    )
    step = table[["id", "second", "x", "y"]].diff()
    is_next_second = ((step["id"] == 0) & (step["second"] == 1)).to_numpy()
    moved = np.where(is_next_second, np.hypot(step["x"], step["y"]), np.nan)
    return table.assign(moved=np.r_[moved[1:], np.nan])


def measure_frame_intervals(path: str | Path) -> np.ndarray:
    """Times from one frame of file `path` to the next [s]; a frame is a time at which somebody was seen.

    Examples
    --------
    >>> import pandas as pd
    >>> from szlib.tracks import measure_frame_intervals
    >>> pd.DataFrame({"t": [0.0, 0.5, 1.5], "id": 1, "x": 0.0, "y": 0.0}).to_csv("stand.csv", index=False)
    >>> measure_frame_intervals("stand.csv")
    array([0.5, 1. ])
    """
    with _open(path) as (_, layout, scan):
        frames = scan.select(pl.col("t").drop_nulls().unique()).collect(engine="streaming")["t"]
    return np.asarray(np.diff(np.sort(frames.to_numpy())) * layout.seconds)


def summarise_people(path: str | Path) -> pd.DataFrame:
    """Summarise the file `path` by person: id, first_seen, last_seen, longest_gap [s], rows.

    Examples
    --------
    >>> import pandas as pd
    >>> from szlib.tracks import summarise_people
    >>> pd.DataFrame({"t": [0.0, 0.5, 1.5], "id": 1, "x": 0.0, "y": 0.0}).to_csv("stand.csv", index=False)
    >>> summarise_people("stand.csv")
       id  first_seen  last_seen  longest_gap  rows
    0   1         0.0        1.5          1.0     3
    """
    time = pl.col("t")
    with _open(path) as (_, layout, scan):
        summary = (
            _usable_rows(layout, scan)
            .group_by("id")
            .agg(
                first_seen=time.min(),
                last_seen=time.max(),
                longest_gap=time.sort().diff().max(),
                rows=pl.len(),
            )
        )
        return summary.sort("id").collect(engine="streaming").to_pandas()


@contextmanager
def _open(path: str | Path) -> Iterator[tuple[Path, TrackFormat, pl.LazyFrame]]:
    """The unpacked file, its format and a scan."""
    path = Path(path)
    with unpacked(path) as plain:
        layout, scan = open_file(plain, path, ReadOptions())
        with readable(path, layout):
            yield plain, layout, scan


def _usable_rows(layout: TrackFormat, scan: pl.LazyFrame) -> pl.LazyFrame:
    """Usable rows: id, t [s], x, y [m]."""
    reason = rejection_reason(layout.metres, layout.seconds, "day" in layout.columns)
    place = pl.col("x", "y") * layout.metres
    return scan.filter(reason.is_null()).select(
        pl.col("id").cast(pl.Int64), pl.col("t") * layout.seconds, place
    )


def _scan_speeds(plain: Path, layout: TrackFormat) -> pl.LazyFrame | None:
    """The sensor's mean speed by person and second; None where the format has none."""
    if layout.speed_field is None:
        return None
    column, unit = layout.speed_field
    names = [f"f{i}" for i in range(layout.n_fields)]
    scan = pl.scan_csv(
        plain, schema=dict.fromkeys(names, pl.Float64), has_header=False, ignore_errors=True,
        truncate_ragged_lines=True, missing_columns="insert", glob=False,
    )  # fmt: skip
    is_whole = pl.col("f1").is_not_null() & (pl.col("f1") % 1 == 0) & pl.col("f0").is_finite()
    keys = [pl.col("f1").cast(pl.Int64).alias("id"), (pl.col("f0") + layout.start).floor().alias("second")]
    return scan.filter(is_whole).group_by(keys).agg(sensor_speed=pl.col(f"f{column}").mean() * unit)


def count_visits_by_hour(rows: pd.DataFrame, *, tz: str = "Asia/Tokyo") -> pd.DataFrame:
    """Count visits and standing people in each hour.

    Parameters
    ----------
    rows : a table from `summarise_seconds`.
    tz : time zone of the hours.

    Returns
    -------
    day, hour, visits (people seen in the hour) and standing (mean number of people who stand).

    Examples
    --------
    >>> import pandas as pd
    >>> from szlib.tracks import count_visits_by_hour
    >>> rows = pd.DataFrame({"id": [1, 1, 2], "second": [0.0, 1.0, 1.0], "moved": [0.0, 0.0, 1.3]})
    >>> count_visits_by_hour(rows, tz="UTC")
              day  hour  visits  standing
    0  1970-01-01     0       2       1.0
    """
    local = pd.to_datetime(rows["second"], unit="s", utc=True).dt.tz_convert(tz)
    keyed = rows.assign(
        day=local.dt.strftime("%Y-%m-%d"), hour=local.dt.hour, is_standing=rows["moved"] < STANDING
    )
    grouped = keyed.groupby(["day", "hour"], as_index=False)
    table = grouped.agg(
        visits=("id", "nunique"), standing=("is_standing", "sum"), seconds=("second", "nunique")
    )
    return table.assign(standing=table["standing"] / table["seconds"]).drop(columns="seconds")


def measure_thinning_error(tracks: pd.DataFrame, *, every: float = 1.0) -> tuple[float, float]:
    """Measure the error of tracks that are sampled more coarsely and interpolated linearly.

    Parameters
    ----------
    tracks : a track table; one tick in `every` seconds of each gap-free piece is used.
    every : sampling interval [s], a multiple of 0.1 s.

    Returns
    -------
    RMS and 95 % quantile of the error [m].

    Raises
    ------
    DataError : `every` is no multiple of 0.1 s, or no piece is that long.

    Notes
    -----
    Measured at 1 s: THOR-MAGNI 5.3 and 9.5 cm, the ETH sequence 5.6 and 11.6 cm (both are sampled every
    0.4 s, so their error is a little larger), the plaza 2.9 and 3.6 cm.

    Examples
    --------
    >>> import numpy as np, pandas as pd
    >>> from szlib.tracks import measure_thinning_error, to_clock
    >>> t = np.arange(100) / 10
    >>> bend = pd.DataFrame({"day": "any", "id": 1, "t": t, "x": 2 * np.cos(t / 2), "y": 2 * np.sin(t / 2)})
    >>> error, _ = measure_thinning_error(to_clock(bend))
    >>> round(error, 3)
    0.044
    """
    step = round(every * TICKS_PER_SECOND)
    if step < 2 or abs(every * TICKS_PER_SECOND - step) > 1e-6:
        raise DataError(f"every must be a multiple of 0.1 s, at least 0.2 s; got {every}")
    order, tick, piece = clock_index(tracks)
    begin = np.searchsorted(piece, piece)
    known = pd.DataFrame({"day": "", "id": piece, "t": tick / TICKS_PER_SECOND})
    known[["x", "y"]] = tracks[["x", "y"]].to_numpy(float)[order]
    thinned = to_clock(known[(tick - tick[begin]) % step == 0], max_gap=every)
    matched = known.assign(tick=tick).merge(
        thinned.assign(tick=nearest_tick(thinned["t"].to_numpy())), on=["id", "tick"], suffixes=("", "_thin")
    )
    if matched["id"].duplicated().sum() == 0:
        raise DataError(
            f"no piece of these tracks is longer than {every} s; expected some that can be thinned"
        )
    error = np.hypot(*(matched[[name, f"{name}_thin"]].diff(axis=1).to_numpy()[:, 1] for name in "xy"))
    return float(np.sqrt((error**2).mean())), float(np.quantile(error, 0.95))
