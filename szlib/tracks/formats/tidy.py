"""Tables of t (or frame), id, x, y and perhaps day: CSV, Parquet, DataFrames, PedPy's TrajectoryData."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Self

import pandas as pd
import polars as pl
import pyarrow as pa  # type: ignore[import-untyped]
import pyarrow.parquet as pq  # type: ignore[import-untyped]

from ... import memory
from ...errors import DataError
from ..options import ReadOptions
from .base import EXPECTED, TrackFormat, decode_first_line, is_number, scan_table
from .unpack import BYTES_PER_ROW


@dataclass(frozen=True)
class _TidyText(TrackFormat):
    """Text whose first line names the columns, or whose columns `ReadOptions.columns` counts."""

    is_ambiguous = True
    has_optional_end = True

    def recognises(self, head: bytes) -> bool:
        """True for any `head`: what no other format recognises is read as a table."""
        return True

    def open(self, plain: Path, path: Path, head: bytes, options: ReadOptions) -> tuple[Self, pl.LazyFrame]:
        """As `TrackFormat.open`, with the separator and the header of the file."""
        first = decode_first_line(head, path)
        separator = max(",;\t", key=first.count)
        separator = separator if separator in first else " "
        parts = [part.strip().strip('"') for part in first.split(None if separator == " " else separator)]
        numbers = [k for k in (options.columns or {}).values() if isinstance(k, int) and 0 <= k < len(parts)]
        has_header = not (numbers and all(is_number(parts[k]) for k in numbers))
        shown = first if len(first) <= 80 else first[:77] + "..."
        names = parts if has_header else [""] * len(parts)
        found = self.with_columns(names, options, f"{path}, line 1: {shown!r}")
        found = replace(found, separator=separator, has_header=has_header)
        return found, found.scan(plain)

    def with_columns(self, names: Sequence[str], options: ReadOptions, where: str) -> Self:
        """The format of a table with column `names`, read with `options`.

        Raises DataError, beginning with `where`, for a column that is missing, doubled or unknown, for frames
        without a frame rate, and for a frame rate without frames.
        """
        given = dict(options.columns or {})
        has_frames = "frame" in given or ("t" not in given and "t" not in names and "frame" in names)
        time = "frame" if has_frames else "t"
        wanted = {"t": given.get(time, time)} | {name: given.get(name, name) for name in ("id", "x", "y")}
        if "day" in given or "day" in names:
            wanted["day"] = given.get("day", "day")
        numbered = {name: k for name, k in wanted.items() if isinstance(k, int)}
        texts = {name: str(k) for name, k in wanted.items() if not isinstance(k, int)}
        if missing := [text for text in texts.values() if text not in names]:
            raise DataError(
                f"{where} has no column {', '.join(missing)}; name the right ones with "
                f"columns={{'t': ..., 'id': ..., 'x': ..., 'y': ...}}; {EXPECTED}"
            )
        if doubled := [text for text in texts.values() if list(names).count(text) > 1]:
            raise DataError(f"{where} names {', '.join(doubled)} twice; rename one of them")
        if beyond := [k for k in numbered.values() if not 0 <= k < len(names)]:
            raise DataError(f"{where} has no field {beyond[0]}; it has {len(names)}, the first is 0")
        if not has_frames and options.frame_rate is not None:
            raise DataError(
                f"{where}: is tidy, whose times are in seconds; leave frame_rate out, or name the column "
                "that counts frames: columns={'frame': ...}"
            )
        if has_frames and options.frame_rate is None:
            raise DataError(f"{where}: {wanted['t']!r} counts frames; pass frame_rate=, frames a second")
        return replace(
            self,
            n_fields=len(names),
            columns=numbered | {name: list(names).index(text) for name, text in texts.items()},
            seconds=1 / options.frame_rate if options.frame_rate else 1.0,
        )


@dataclass(frozen=True)
class _TidyParquet(_TidyText):
    """A Parquet file."""

    def recognises(self, head: bytes) -> bool:
        """Whether `head` begins as Parquet does."""
        return head.startswith(b"PAR1")

    def open(self, plain: Path, path: Path, head: bytes, options: ReadOptions) -> tuple[Self, pl.LazyFrame]:
        """As `TrackFormat.open`; by pyarrow, as a damaged file can make Polars abort the process."""
        try:
            with pq.ParquetFile(plain) as file:
                names = file.schema_arrow.names
                found = self.with_columns(names, options, f"{path}")
                n_rows = file.metadata.num_rows
                memory.require(n_rows * BYTES_PER_ROW, f"{path}: to read {n_rows:,} rows")
                table = file.read([names[at] for at in found.columns.values()])
            table.validate(full=True)
            named = pa.table({name: table[names[at]] for name, at in found.columns.items()})  # no metadata
        except DataError:
            raise
        except (pa.ArrowException, OSError, ValueError, MemoryError) as error:
            raise DataError(f"{path}: damaged Parquet ({error}); fetch or write the file again") from error
        rows = pl.DataFrame(named)
        if isinstance(rows["t"].dtype, pl.Datetime | pl.Duration | pl.Date):
            times = _convert_times(rows["t"].to_pandas(), options.tz or self.tz)
            rows = rows.with_columns(t=pl.Series(times))
        return found, scan_table(rows)


TIDY = _TidyText("tidy", has_header=True)
PARQUET = _TidyParquet("tidy", has_header=True)


def is_table(source: object) -> bool:
    """Whether `source` is a DataFrame or a TrajectoryData, and not a path."""
    return isinstance(source, pd.DataFrame) or (hasattr(source, "data") and hasattr(source, "frame_rate"))


def open_table(source: Any, where: Path, options: ReadOptions) -> tuple[TrackFormat, pl.LazyFrame]:
    """The format and a scan of table `source`, as from `TrackFormat.open`; `where` is its name in messages.

    Times may be datetimes; without a zone they are those of the time zone in `options`.
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
    found = TIDY.with_columns(names, options, shown)
    rows = {name: source.iloc[:, at] for name, at in found.columns.items()}
    rows["t"] = _convert_times(rows["t"], options.tz or found.tz)
    rows |= {name: pd.to_numeric(rows[name], errors="coerce") for name in ("t", "id", "x", "y")}
    if "day" in rows:
        rows["day"] = rows["day"].astype("string")
    try:
        table = pl.DataFrame(
            {name: pl.from_pandas(values.reset_index(drop=True)) for name, values in rows.items()}
        )
    except (pl.exceptions.PolarsError, TypeError, ValueError) as error:
        raise DataError(f"{shown}: cannot be read ({error}); expected numbers in t, id, x and y") from error
    return found.in_unit(options.unit), scan_table(table)


def _convert_times(times: pd.Series[Any], tz: str) -> pd.Series[Any]:
    """Times as numbers: datetimes [s since 1970], durations [s], anything else as it is."""
    if pd.api.types.is_timedelta64_dtype(times):
        return times.dt.total_seconds()  # type: ignore[no-any-return]
    if not pd.api.types.is_datetime64_any_dtype(times):
        return times
    local = times.dt.tz_localize(tz, ambiguous="NaT", nonexistent="NaT") if times.dt.tz is None else times
    return (local - pd.Timestamp(0, tz="UTC")).dt.total_seconds()
