"""Tables of t (or frame), id, x, y and perhaps day: text, Parquet, Feather, SQLite, and of other libraries.

However a table comes, its columns are found by `columns.find_columns`, and their values read by `values`.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import Any, Self

import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa  # type: ignore[import-untyped]
import pyarrow.dataset  # type: ignore[import-untyped]
import pyarrow.parquet as pq  # type: ignore[import-untyped]
import shapely

from ...core import memory
from ...core.errors import DataError
from ..options import ReadOptions
from .base import TrackFormat, decode_first_line, decode_line, is_number, scan_table
from .columns import ask_about_recordings, find_columns
from .unpack import BYTES_PER_ROW, LONGEST_LINE, require_memory
from .values import require_distinct_ids, to_ids, to_numbers, to_times

_SAMPLE = 2000  # rows in which columns are guessed
_FIRST = 20  # lines of a text that show what its columns hold


@dataclass(frozen=True)
class _Table(TrackFormat):
    """Text whose first line names the columns, or whose columns `ReadOptions.columns` counts."""

    is_ambiguous: bool = True

    def recognises(self, head: bytes) -> bool:
        """True for any `head`: what no other format recognises is read as a table."""
        return True

    def open(
        self, plain: Path, path: Path, head: bytes, options: ReadOptions
    ) -> tuple[Self, pl.LazyFrame]:
        """As `TrackFormat.open`, with the separator and the header of the file."""
        require_memory(plain, path)
        first = decode_first_line(head, path)
        separator = max(",;\t", key=first.count)
        separator = separator if separator in first else " "
        with plain.open("rb") as stream:
            lines = [
                decode_line(line[:LONGEST_LINE])
                for line in islice(stream, 1, _FIRST + 1)
            ]
        found = replace(
            self,
            separator=separator,
            quote='"' if any('"' in line for line in lines) else None,
        )
        parts = found.split(first)
        has_header = not all(map(is_number, parts))
        names = parts if has_header else [""] * len(parts)
        found = replace(found, has_header=has_header, n_fields=len(parts))

        def sample() -> pl.DataFrame:
            """All columns of the first rows."""
            every = {f"f{k}": k for k in range(len(parts))}
            whole = replace(found, columns=every, texts=frozenset(every))
            rows = whole.scan_rows(plain).head(_SAMPLE).collect()
            return rows.select(
                pl.col(name).str.replace(",", ".", literal=True) for name in every
            )

        shown = first if len(first) <= 80 else first[:77] + "..."
        found = find_columns(
            found, names, options, f"{path}, line 1: {shown!r}", sample
        )
        fields = [found.split(line) for line in lines if line]
        is_text = {
            k for row in fields for k, text in enumerate(row) if not is_number(text)
        }
        texts = {name for name, k in found.columns.items() if k in is_text}
        found = replace(found, texts=frozenset(texts | {"day", "id"}))

        def column(k: int) -> pl.Series:
            """The texts of a column."""
            one = replace(found, columns={"c": k}, texts=frozenset("c"))
            return one.scan_rows(plain).collect()["c"]

        rows = found.scan_rows(plain).collect()
        n_lines = _count_lines(plain) - has_header
        if found.quote and len(rows) != n_lines:
            raise DataError(
                f"{path}: {n_lines:,} lines below the header are {len(rows):,} rows: a quotation mark is not "
                "closed in its line; remove it, or the line ends within quoted texts"
            )
        return found.with_values(rows, options, f"{path}", column)

    def with_values(
        self,
        rows: pl.DataFrame,
        options: ReadOptions,
        where: str,
        column: Callable[[int], pl.Series],
    ) -> tuple[Self, pl.LazyFrame]:
        """The format completed with what its times are, and a scan of `rows` as from `TrackFormat.open`.

        `where` is the name of the table in messages; `column` gives another one of its columns.
        """
        decimal = "," if self.separator in (";", "\t", " ") else "."
        found, t = self, rows["t"]
        if self.time_unit is not None and 2 * to_numbers(
            t, decimal
        ).null_count() <= len(t):
            t = to_numbers(t, decimal) * self.time_unit
        else:
            times = to_times(t, options.tz or self.tz, decimal)
            t = times.seconds
            if times.kind:
                found = replace(self, text=f"{self.text}; t: {times.kind}")
            if (
                times.day is not None
                and options.tz is None
                and "day" not in rows.columns
            ):
                rows = rows.with_columns(day=times.day)
        x, y = (to_numbers(rows[name], decimal) for name in "xy")
        ids = to_ids(rows["id"])
        require_distinct_ids(ids, where)
        if "day" not in rows.columns:
            is_told = {"id", "x", "y"} <= set(options.columns or {})
            ask_about_recordings(found, t, ids, column, where, by_name=not is_told)
        return found, scan_table(rows.with_columns(t=t, id=ids, x=x, y=y))


@dataclass(frozen=True)
class _ArrowTable(_Table):
    """A Parquet or a Feather file; by pyarrow, as a damaged file can make Polars abort the process."""

    def recognises(self, head: bytes) -> bool:
        """Whether `head` begins as Parquet and Feather do."""
        return head.startswith((b"PAR1", b"ARROW1"))

    def open(
        self, plain: Path, path: Path, head: bytes, options: ReadOptions
    ) -> tuple[Self, pl.LazyFrame]:
        """As `TrackFormat.open`."""
        kind = "Parquet" if head.startswith(b"PAR1") else "Feather"
        try:
            schema = (
                pq.read_schema(plain)
                if kind == "Parquet"
                else pa.ipc.open_file(plain).schema
            )
            data, names = pa.dataset.dataset(plain, schema, kind.lower()), schema.names
            found = find_columns(
                self,
                names,
                options,
                f"{path}",
                lambda: pl.DataFrame(data.head(_SAMPLE)),
            )
            n_rows = data.count_rows()
            memory.require(n_rows * BYTES_PER_ROW, f"{path}: to read {n_rows:,} rows")
            table = data.to_table(columns=[names[at] for at in found.columns.values()])
            table.validate(full=True)
        except DataError:
            raise
        except (pa.ArrowException, OSError, ValueError, MemoryError) as error:
            raise DataError(
                f"{path}: damaged {kind} ({error}); fetch or write the file again"
            ) from error
        named = {name: table[names[at]] for name, at in found.columns.items()}

        def column(k: int) -> pl.Series:
            """A column of the file."""
            return pl.DataFrame(data.to_table(columns=[names[k]])).to_series()

        # without metadata
        rows = pl.DataFrame(pa.table(named))
        return found.with_values(rows, options, f"{path}", column)


def _count_lines(plain: Path) -> int:
    """Number of lines of a text."""
    n, last = 0, b"\n"
    with plain.open("rb") as stream:
        while block := stream.read(1 << 22):
            n, last = n + block.count(b"\n"), block[-1:]
    return n + (last != b"\n")


TIDY = _Table("tidy", has_header=True)
TABLE = replace(TIDY, separator="")
ARROW = _ArrowTable("tidy", has_header=True, separator="")


def is_table(source: object) -> bool:
    """Whether `source` is a table of pandas, Polars, Arrow, GeoPandas, MovingPandas or PedPy, and no path."""
    names = ("__arrow_c_stream__", "to_point_gdf")
    is_known = isinstance(source, pd.DataFrame) or any(
        hasattr(source, name) for name in names
    )
    return is_known or (hasattr(source, "data") and hasattr(source, "frame_rate"))


def open_table(
    source: Any, where: Path, options: ReadOptions
) -> tuple[TrackFormat, pl.LazyFrame]:
    """The format and a scan of table `source`, as from `TrackFormat.open`; `where` is its name in messages.

    Times may be datetimes; without a zone they are those of the time zone in `options`.
    """
    if hasattr(source, "to_point_gdf"):  # MovingPandas
        source = source.to_point_gdf()
    elif hasattr(source, "frame_rate"):  # PedPy's, which counts frames
        rate = float(options.frame_rate or source.frame_rate)
        columns = {"frame": "frame"} | dict(options.columns or {})
        source, options = (
            source.data,
            replace(options, columns=columns, frame_rate=rate),
        )
    if isinstance(source, pd.DataFrame):
        source = _with_points(source, where)
        names = [str(name) for name in source.columns]
    else:
        source = pl.DataFrame(source)
        names = source.columns
    shown = f"{where}: a table of {', '.join(names[:12])}"

    def column(at: int) -> pl.Series:
        """A column of the table; one of mixed types as text."""
        if isinstance(source, pl.DataFrame):
            return source.to_series(at)
        values = source.iloc[:, at].reset_index(drop=True)
        is_mixed = values.dtype == object or isinstance(
            values.dtype, pd.CategoricalDtype
        )
        return pl.Series(values.astype("string") if is_mixed else values)

    def sample() -> pl.DataFrame:
        """The first rows."""
        return pl.DataFrame(
            {f"f{k}": column(k).head(_SAMPLE) for k in range(len(names))}
        )

    try:
        found = find_columns(TABLE, names, options, shown, sample)
        rows = pl.DataFrame({name: column(at) for name, at in found.columns.items()})
        found, scan = found.with_values(rows, options, f"{where}", column)
    except DataError:
        raise
    except (
        pl.exceptions.PolarsError,
        pa.ArrowException,
        TypeError,
        ValueError,
    ) as error:
        raise DataError(
            f"{shown}: cannot be read ({error}); expected numbers in t, id, x and y"
        ) from error
    return found.in_metres(options.metres), scan


def _with_points(table: pd.DataFrame, where: Path) -> pd.DataFrame:
    """A table with x, y of its points, as in GeoPandas, and with t of its index if this holds dates."""
    name = str(table.index.name or "t")
    if isinstance(table.index, pd.DatetimeIndex) and name not in table.columns:
        table = table.reset_index(names=name)
    points = getattr(table, "geometry", None)
    if points is None or {"x", "y"} <= set(table.columns):
        return table
    if getattr(getattr(table, "crs", None), "is_geographic", False):
        advice = "project them to metres: table.to_crs(table.estimate_utm_crs())"
        raise DataError(f"{where}: its points are in degrees; {advice}")
    shapes = np.asarray(points, object)
    flat = pd.DataFrame(table.drop(columns=points.name))
    return flat.assign(x=shapely.get_x(shapes), y=shapely.get_y(shapes))


def open_database(
    plain: Path, path: Path, options: ReadOptions
) -> tuple[TrackFormat, pl.LazyFrame] | None:
    """The format and a scan of the tracks in the SQLite file `plain`, given as `path`.

    None where it is JuPedSim's, or damaged.

    Raises DataError where not exactly one of its tables can be read with `options`.
    """
    readable, refused = [], []
    journal = path.with_name(f"{path.name}-wal")
    if journal.is_file() and journal.stat().st_size:
        raise DataError(
            f"{path}: {journal.name} holds changes that are not in the file yet; close the program that "
            f"writes it, or run: sqlite3 {path.name} 'PRAGMA wal_checkpoint(TRUNCATE)'"
        )
    # nothing is written, not even a journal
    address = f"{plain.absolute().as_uri()}?mode=ro&immutable=1"
    with closing(sqlite3.connect(address, uri=True)) as file:
        try:
            names = [
                name
                for (name,) in file.execute(
                    "SELECT name FROM sqlite_master WHERE type = 'table'"
                )
            ]
        except sqlite3.DatabaseError:
            return None
        for name in [] if "trajectory_data" in names else names:
            try:
                readable.append(
                    open_table(
                        pd.read_sql(f'SELECT * FROM "{name}"', file), path, options
                    )
                )
            except DataError as error:
                refused.append(error)
    if len(readable) > 1:
        command = (
            f"sqlite3 -header -csv {path.name} 'SELECT * FROM {names[0]}' > tracks.csv"
        )
        raise DataError(
            f"{path}: several of the tables {names} can be tracks; write one to a file: {command}"
        )
    if refused and not readable:
        raise refused[0]
    return readable[0] if readable else None
