"""Files and tables as columns, whatever they mean: text, Parquet, Feather, SQLite, JSON, of libraries."""

from __future__ import annotations

import codecs
import csv
import errno
import gzip
import io
import json
import shutil
import sqlite3
import sys
import zipfile
import zlib
from collections.abc import Callable, Iterable, Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa  # type: ignore[import-untyped]
import pyarrow.dataset  # type: ignore[import-untyped]
import pyarrow.parquet as pq  # type: ignore[import-untyped]
import shapely

from ..core import memory
from ..core.errors import DataError, StorageError
from ..core.files import temporary_folder
from ..core.input_files import printable, readable_path, unchanged_files

LONGEST_LINE = 100_000
_BYTES = 6  # memory for each byte of a text while it is read (measured: 5.8 with its columns)
_RESERVE = 0.02  # share of a disk that unpacking leaves free
# rows that are read before the size of all is checked, of a table and of a database
_ROWS_AT_ONCE, _VALUES_AT_ONCE = 4096, 100
CONTAINERS = {"PAR1": "Parquet", "ARROW1": "Feather"}  # by their first letters


@dataclass(frozen=True)
class Source:
    """The columns of a file or table.

    Attributes
    ----------
    where : its name in messages.
    names : names of the columns; empty texts where there is no header.
    column : gives a column: texts, or values of a type.
    first_line : line of the first row.
    n_fields : number of fields of each row; None where every row has all columns.
    decimal : the point of numbers that are text.
    head : what the first line is, for messages.
    """

    where: str
    names: tuple[str, ...]
    column: Callable[[int], pl.Series]
    first_line: int = 1
    n_fields: pl.Series | None = None
    decimal: str = "."
    head: str = ""


@contextmanager
def unpacked(path: Path) -> Iterator[Path]:
    """Give the `readable_path` of file `path`, or a temporary file with its content where it is packed.

    Raises DataError where it is no regular file, cannot be opened, changes, or packs several files;
    StorageError where there is no room.
    """
    if not path.is_file():
        what = "is no regular file; only those are read"
        if path.is_dir():
            what = "is a folder; pass the files in it"
        elif not path.exists():
            what = "no such file"
        raise DataError(f"{printable(path)}: {what}")
    if printable(path.name) != path.name:
        raise DataError(
            f"{printable(path)}: its name is no readable text (UTF-8); rename the file"
        )
    with unchanged_files([path]):
        plain = readable_path(path)
        with plain.open("rb") as stream:
            magic = stream.read(4)
        member = _find_member(plain, path) if magic == b"PK\3\4" else None
        if member is None and not magic.startswith(b"\x1f\x8b"):
            yield plain
            return
        with temporary_folder() as folder:
            unpack(plain, path, folder / "unpacked", member)
            yield folder / "unpacked"


def _find_member(plain: Path, path: Path) -> str:
    """The one file in a zip archive."""
    try:
        with zipfile.ZipFile(plain) as archive:
            names = [each for each in archive.namelist() if not each.endswith("/")]
    except (zipfile.BadZipFile, OSError) as error:
        raise DataError(
            f"{path}: damaged zip ({error}); fetch the file again"
        ) from error
    if any(name.startswith("xl/") for name in names):
        command = f"polars.read_excel({path.name!r}).write_csv({path.stem + '.csv'!r})"
        raise DataError(
            f"{path}, line 1: is a sheet of Excel; save the sheet as CSV in Excel, or by: "
            f'pip install fastexcel; python -c "import polars; {command}"'
        )
    tracks = [name for name in names if not name.startswith("__MACOSX/")]
    if len(tracks) != 1:
        raise DataError(
            f"{path}, line 1: is packed by zip and holds {len(tracks)} files; unpack it, and pass those that "
            f"are tracks: unzip {path.name}"
        )
    return tracks[0]


def unpack(plain: Path, path: Path, target: Path, member: str | None = None) -> None:
    """Unpack the gzipped file `plain`, given as `path`, or a `member` of a zip archive, into `target`.

    Failure to read means damage, failure to write a lack of room.  The disk is never filled.
    """
    kind = ".gz" if member is None else "zip"
    damage = EOFError, zlib.error, gzip.BadGzipFile, zipfile.BadZipFile, RuntimeError
    try:
        with _open_packed(plain, member) as packed, target.open("wb") as unpacked:
            while block := packed.read(1 << 22):
                disk = shutil.disk_usage(target.parent)
                if disk.free < _RESERVE * disk.total:
                    raise OSError(errno.ENOSPC, "the disk is nearly full")
                unpacked.write(block)
    except damage as error:
        raise DataError(
            f"{path}: damaged {kind} ({error}); fetch the file again"
        ) from error
    except OSError as error:
        raise StorageError(
            f"{path}: no room to unpack it in {target.parent.parent} ({error.strerror or error}); make "
            "room, or name another folder in $TMPDIR"
        ) from error


def _open_packed(plain: Path, member: str | None) -> Any:
    if member is None:
        return gzip.open(plain)
    return zipfile.Path(plain, member).open("rb")


def read_head(plain: Path) -> str:
    """The first two lines of the unpacked file `plain`."""
    with plain.open("rb") as stream:
        text = decode(stream.read(LONGEST_LINE))
    return "\n".join(text.splitlines()[:2])


def decode(content: bytes) -> str:
    """The `content` of a file as text: UTF-16 with its mark, else UTF-8."""
    is_wide = content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    return content.decode("utf-16" if is_wide else "utf-8-sig", errors="replace")


def require_memory(
    size: float, where: str, what: str = "text", factor: float = _BYTES
) -> None:
    """Raise MemoryLimitError where `size` bytes of `where` need more memory than is allowed.

    They need `factor` bytes each; `what` they are stands in the message.
    """
    memory.require(factor * size, f"{where}: to read {size / 1e6:,.3g} MB of {what}")


def read_text(plain: Path, where: str) -> str:
    """The whole text of file `plain`, called `where` in messages."""
    require_memory(plain.stat().st_size, where)
    return decode(plain.read_bytes())


# --- text ---------------------------------------------------------------------------------------------


def split_line(line: str, separator: str) -> list[str]:
    """The fields of a `line`; a blank as `separator` stands for any run of blanks.

    None where a quotation mark is not closed.
    """
    if separator == " ":
        return line.replace('"', "").split()
    try:
        fields = next(csv.reader([line], delimiter=separator, strict=True), [])
    except csv.Error:
        return []
    return [field.strip(" \"'") for field in fields]


def find_separator(first: str) -> str:
    """The character between the fields of a table, by its `first` line."""
    found = max(",;\t|", key=first.count)
    return found if found in first else " "


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def open_text(
    plain: Path,
    where: str,
    *,
    has_header: bool | None = None,
    n_fields: int = 0,
    size: int | None = None,
) -> Source:
    """The text table `plain`, called `where`: each line is a row of `n_fields`, or as many as the first.

    `has_header` says whether the first names the columns; None looks at it.  Only `size` bytes are read.
    """
    lines = _read_lines(plain, where, size)
    first = (lines[0] or "").strip() if len(lines) else ""
    if not first:
        raise DataError(
            f"{where}, line 1: the file is empty or begins with a blank line"
        )
    if "\0" in first or len(first) > LONGEST_LINE:
        raise DataError(f"{where}, line 1: is binary, or too long for a table of text")
    separator = find_separator(first)
    names = split_line(first, separator)
    if has_header is None:
        has_header = not all(map(_is_number, names))
    rows = lines.slice(int(has_header))
    if rows.str.contains('"', literal=True).any():
        fields = [split_line(row or "", separator) for row in rows]
        parts = pl.Series(fields, dtype=pl.List(pl.String))
    elif separator == " ":
        parts = rows.str.replace_all(r"\s+", " ").str.strip_chars().str.split(" ")
    else:
        parts = rows.str.split(separator)
    return Source(
        where,
        tuple(names if has_header else [""] * (n_fields or len(names))),
        lambda k: parts.list.get(k, null_on_oob=True).str.strip_chars(" \t\"'"),
        1 + has_header,
        parts.list.len(),
        decimal="." if separator == "," else ",",
        head=f", line 1: {first[:80]!r}",
    )


def _read_lines(plain: Path, where: str, size: int | None) -> pl.Series:
    """The lines of a text, or the whole ones among its first `size` bytes, by Polars."""
    if size is None:
        require_memory(plain.stat().st_size, where)
    with plain.open("rb") as stream:
        content = stream.read(size)
        if size is not None and stream.read(1):
            content = content[: content.rfind(b"\n") + 1]
    return pl.read_csv(
        io.BytesIO(decode(content).replace("\x1f", "?").encode()),
        has_header=False, separator="\x1f", quote_char=None,
        schema={"line": pl.String}, raise_if_empty=False,
    )["line"]  # fmt: skip


# --- tables -------------------------------------------------------------------------------------------


def open_frame(table: pl.DataFrame, where: str) -> Source:
    """The `table` of Polars, called `where` in messages."""
    return Source(where, tuple(table.columns), table.to_series)


def is_table(source: object) -> bool:
    """Whether `source` is a table of pandas, Polars, Arrow, GeoPandas, MovingPandas or PedPy, and no path."""
    names = "__arrow_c_stream__", "to_point_gdf", "frame_rate"
    return any(hasattr(source, name) for name in names)


def open_table(source: Any, where: str) -> Source:
    """The table `source` of another library, called `where` in messages; see `is_table`."""
    if hasattr(source, "to_point_gdf"):  # MovingPandas
        source = source.to_point_gdf()
    if not isinstance(source, pd.DataFrame):
        return open_frame(pl.DataFrame(source), where)
    table = _with_points(source, where)

    def column(at: int) -> pl.Series:
        """A column of the table; one of mixed types as text."""
        values = table.iloc[:, at].reset_index(drop=True)
        is_mixed = values.dtype == object or isinstance(
            values.dtype, pd.CategoricalDtype
        )
        return pl.Series(values.astype("string") if is_mixed else values)

    return Source(where, tuple(map(str, table.columns)), column)


def _with_points(table: pd.DataFrame, where: str) -> pd.DataFrame:
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


def open_arrow(plain: Path, where: str, kind: str) -> Source:
    """The file `plain` of a `kind`, Parquet or Feather, called `where` in messages.

    By pyarrow: a damaged file can make Polars abort the process.
    """

    @contextmanager
    def explained() -> Iterator[None]:
        """Raise what pyarrow raises as DataError."""
        try:
            yield
        except DataError:
            raise
        except (pa.ArrowException, OSError, ValueError, MemoryError) as error:
            raise DataError(
                f"{where}: damaged {kind} ({error}); fetch or write the file again"
            ) from error

    with explained():
        is_parquet = kind == "Parquet"
        schema = pq.read_schema(plain) if is_parquet else pa.ipc.open_file(plain).schema
        data, names = pa.dataset.dataset(plain, schema, kind.lower()), schema.names

    def column(k: int) -> pl.Series:
        """A column of the file."""
        with explained():
            batches = data.to_batches(columns=[names[k]], batch_size=_ROWS_AT_ONCE)
            charged = _charged(batches, lambda batch: int(batch.nbytes), where)
            table = pa.Table.from_batches(charged, pa.schema([schema.field(k)]))
            table.validate(full=True)
            # without metadata
            return pl.DataFrame(pa.table({"c": table[0]})).to_series()

    return Source(where, tuple(names), column)


def _charged(
    batches: Iterable[Any], measure: Callable[[Any], int], where: str
) -> Iterator[Any]:
    """The batches of a column, as long as memory is allowed for all of them; `measure` gives their bytes."""
    size = 0
    for batch in batches:
        size += measure(batch)
        require_memory(size, where, "a column")
        yield batch


def open_json(content: str, where: str) -> Source:
    """The `content` of a JSON file, called `where`: an object a line, a list, or points of GeoJSON."""
    try:
        if content.lstrip().startswith("["):
            rows = json.loads(content)
        elif '"FeatureCollection"' in content[:1000]:
            rows = [
                each["properties"]
                | dict(zip("xy", each["geometry"]["coordinates"], strict=False))
                for each in json.loads(content)["features"]
            ]
        else:
            rows = [json.loads(line) for line in content.splitlines() if line.strip()]
        names = list(dict.fromkeys(name for row in rows for name in row))
        texts = {name: _as_text(row.get(name) for row in rows) for name in names}
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        expected = "an object a line, a list of objects, or GeoJSON of points"
        raise DataError(
            f"{where}, line 1: cannot be read as JSON ({error}); expected {expected}"
        ) from error
    return open_frame(pl.DataFrame(texts), where)


def _as_text(values: Iterable[Any]) -> pl.Series:
    texts = [None if value is None else str(value) for value in values]
    return pl.Series(texts, dtype=pl.String)


# --- databases ----------------------------------------------------------------------------------------


def open_database(plain: Path, path: Path) -> list[Source]:
    """The tables of the SQLite file `plain`, given as `path`; none where it is damaged.

    Nothing is written, not even a journal.
    """
    journal = path.with_name(f"{path.name}-wal")
    if journal.is_file() and journal.stat().st_size:
        raise DataError(
            f"{path}: {journal.name} holds changes that are not in the file yet; close the program that "
            f"writes it, or run: sqlite3 {path.name} 'PRAGMA wal_checkpoint(TRUNCATE)'"
        )

    address = f"{plain.absolute().as_uri()}?mode=ro&immutable=1"

    def size_of(rows: list[Any]) -> int:
        """Bytes of all values in some rows."""
        return sum(map(sys.getsizeof, chain.from_iterable(rows)))

    def query(text: str) -> Iterator[Any]:
        """The rows that a query gives, as long as memory is allowed for all of them."""
        with closing(sqlite3.connect(address, uri=True)) as file:
            found = file.execute(text)
            some = iter(lambda: found.fetchmany(_VALUES_AT_ONCE), [])
            yield from chain.from_iterable(_charged(some, size_of, f"{path}"))

    def open_one(table: str) -> Source:
        """One of the tables."""
        names = [row[1] for row in query(f'PRAGMA table_xinfo("{table}")')]

        def column(k: int) -> pl.Series:
            """A column of the table, as text."""
            rows = query(f'SELECT "{names[k]}" FROM "{table}"')
            return _as_text(value for (value,) in rows)

        return Source(f"{path}", tuple(names), column)

    try:
        tables = query("SELECT name FROM sqlite_master WHERE type = 'table'")
        return [open_one(name) for (name,) in tables]
    except sqlite3.DatabaseError:
        return []
