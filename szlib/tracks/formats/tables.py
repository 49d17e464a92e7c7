"""Tables in memory as if they were files: pandas DataFrames, and PedPy's TrajectoryData."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pandas as pd
import polars as pl

from ...errors import DataError
from ..options import ReadOptions
from .layouts import Format, chosen_columns, scan_of


def is_table(source: object) -> bool:
    """Whether this is a DataFrame or a TrajectoryData, and not a path."""
    return isinstance(source, pd.DataFrame) or (hasattr(source, "data") and hasattr(source, "frame_rate"))


def recognise_table(source: Any, where: Path, options: ReadOptions) -> tuple[Format, pl.LazyFrame]:
    """Layout and scan of a table, as from `layouts.recognise`; `where` stands for its name in messages.

    Times may be datetimes (without a zone: those of `tz`).  Raises DataError for columns as `chosen_columns`.
    """
    if not isinstance(source, pd.DataFrame):  # PedPy's, which counts frames
        options = replace(
            options,
            columns={"frame": "frame"} | dict(options.columns or {}),
            frame_rate=float(options.frame_rate or source.frame_rate),
        )
        source = source.data
    names = [str(name) for name in source.columns]
    shown = f"{where}: a table of {', '.join(names[:12])}"
    found, seconds = chosen_columns(names, options.columns, options.frame_rate, shown)
    rows = {name: source.iloc[:, at] for name, at in found.items()}
    rows["t"] = _seconds(rows["t"], options.tz)
    rows |= {name: pd.to_numeric(rows[name], errors="coerce") for name in ("t", "id", "x", "y")}
    if "day" in rows:
        rows["day"] = rows["day"].astype("string")
    try:
        table = pl.DataFrame(
            {name: pl.from_pandas(values.reset_index(drop=True)) for name, values in rows.items()}
        )
    except (pl.exceptions.PolarsError, TypeError, ValueError) as error:
        raise DataError(f"{shown}: cannot be read ({error}); expected numbers in t, id, x and y") from error
    return Format("tidy", len(names), found, seconds=seconds, header=True), scan_of(table)


def _seconds(times: pd.Series[Any], tz: str) -> pd.Series[Any]:
    """Times as numbers: datetimes [s since 1970], durations [s], anything else as it is."""
    if pd.api.types.is_timedelta64_dtype(times):
        return times.dt.total_seconds()  # type: ignore[no-any-return]
    if not pd.api.types.is_datetime64_any_dtype(times):
        return times
    local = times.dt.tz_localize(tz, ambiguous="NaT", nonexistent="NaT") if times.dt.tz is None else times
    return (local - pd.Timestamp(0, tz="UTC")).dt.total_seconds()
