"""Files as they lie on the disk: unpacked, recognised, and read as text; large ones are scanned."""

from __future__ import annotations

import codecs
import csv
import errno
import gzip
import io
import re
import shutil
import zipfile
import zlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import polars as pl
from polars import Float64, Series, String, col

from ..core.errors import DataError, StorageError
from ..core.input_files import (
    explain_errors,
    opening,
    printable,
    require_memory,
    unchanged_files,
)
from .recipe import DEGREES, PIXELS, SHAPES, Recipe, Shape

LONGEST_LINE = 100_000
# bytes of memory for each byte of a text: where it is read (measured: 5.8 with its columns), or scanned (1.3
# to 1.9)
_READ_FACTOR = 6
SCAN_FACTOR = 2
_RESERVE = 0.02  # share of a disk that unpacking leaves free
CONTAINERS = ("PAR1", "ARROW1")  # first letters of Parquet and of Feather
# What a recipe may say that a scan of rows cannot do: the file is then read as a whole.
_NOT_STREAMED = {"columns", "where", "homography", "origin", "frame_rate", "time_unit"}


@dataclass(frozen=True)
class File:
    """A file to be read.

    Attributes
    ----------
    plain : where its unpacked content is.
    path : its path, as given.
    recipe : how it is read, as given.
    size : bytes that are read of a text; None: all.
    """

    plain: Path
    path: Path
    recipe: Recipe
    size: int | None = None

    @cached_property
    def head(self) -> str:
        """The first two lines."""
        with self.plain.open("rb") as stream:
            return "\n".join(decode(stream.read(LONGEST_LINE)).splitlines()[:2])

    def text(self) -> str:
        """The text, or the whole lines in its first `size` bytes."""
        if self.size is None:
            check_size(self.plain.stat().st_size, self.path)
        with self.plain.open("rb") as stream:
            content = stream.read(self.size)
            if stream.read(1):
                content = content[: content.rfind(b"\n") + 1]
        return decode(content)


@dataclass(frozen=True)
class Source:
    """The columns of a file or table, whatever they mean.

    Attributes
    ----------
    where : the path of the file, or a name of the table, for messages.
    names : names of the columns; empty texts where there is no header.
    column : gives a column: texts, or values of a type.
    first_line : line of the first row.
    ragged : whether each row has another number of fields than the table has columns.
    decimal : the point of numbers that are text.
    head : what the first line is, for messages.
    """

    where: Path
    names: Sequence[str]
    column: Callable[[int], Series]
    first_line: int = 1
    ragged: Any = False
    decimal: str = "."
    head: str = ""


@dataclass(frozen=True)
class Rows:
    """The rows of a file or table.

    Attributes
    ----------
    path : its path, or name.
    recipe : how it is read, with its columns.
    table : line, ragged, t [s], id, x, y [m], and speed [m/s] and day, where the file has them.
    source : the columns of the file; None where it is scanned.
    n_bytes : number of bytes that are still to be read.
    """

    path: Path
    recipe: Recipe
    table: pl.LazyFrame
    source: Source | None = None
    n_bytes: int = 0


def is_table(source: object) -> bool:
    """Whether `source` is a table of pandas, Polars, Arrow or PedPy, and no path."""
    return hasattr(source, "__arrow_c_stream__") or hasattr(source, "frame_rate")


# --- packed files -------------------------------------------------------------------------------------


@contextmanager
def open_plain(path: Path, recipe: Recipe, size: int | None = None) -> Iterator[File]:
    """Open the file `path`, unpacked where it is packed; `recipe` and `size` are those of `File`.

    Raises DataError where it is no regular file, cannot be opened, changes, or packs several files;
    StorageError where there is no room.
    """
    shown = printable(path)
    faults = {
        "is a folder; pass the files in it": path.is_dir(),
        "no such file": not path.exists(),
        "is no regular file; only those are read": not path.is_file(),
        "its name is no readable text (UTF-8); rename the file": path.name not in shown,
    }
    for fault, holds in faults.items():
        if holds:
            raise DataError(f"{shown}: {fault}")
    plain = path
    advice = "make room, or name another one in $TMPDIR"
    with unchanged_files([path]), ExitStack() as stack:
        with opening(path), path.open("rb") as stream:
            is_packed = stream.read(4).startswith((b"PK\3\4", b"\x1f\x8b"))
        if is_packed:
            with explain_errors("no temporary folder", advice, StorageError):
                folder = TemporaryDirectory(prefix="szlib-")
            plain = Path(stack.enter_context(folder)) / "unpacked"
            unpack(path, plain)
        yield File(plain, path, recipe, size)


def unpack(path: Path, target: Path) -> None:
    """Unpack the file `path` into `target`.

    Failure to read means damage, failure to write a lack of room.  The disk is never filled.
    """
    damage = EOFError, zlib.error, gzip.BadGzipFile, zipfile.BadZipFile, RuntimeError
    full = f"{path}: no room to unpack it in {target.parent.parent}"
    advice = "make room, or name another folder in $TMPDIR"
    damaged = f"{path}: damaged .gz or .zip"
    with (
        explain_errors(full, advice, StorageError, OSError),
        explain_errors(damaged, "fetch the file again", faults=damage),
        _open_packed(path) as packed,
        target.open("wb") as unpacked,
    ):
        while block := packed.read(1 << 22):
            disk = shutil.disk_usage(target.parent)
            if disk.free < _RESERVE * disk.total:
                raise OSError(errno.ENOSPC, "the disk is nearly full")
            unpacked.write(block)


def _open_packed(path: Path) -> Any:
    """The content of a gzipped file, or the one file in a zip archive."""
    if not zipfile.is_zipfile(path):
        return gzip.open(path)
    archive = zipfile.ZipFile(path)
    names = [name for name in archive.namelist() if not name.endswith("/")]
    if any(name.startswith("xl/") for name in names):
        raise DataError(
            f"{path}, line 1: is a sheet of Excel; save the sheet as CSV in Excel, or by: "
            'pip install fastexcel; python -c "import polars; '
            f'polars.read_excel({path.name!r}).write_csv({path.stem + ".csv"!r})"'
        )
    tracks = [name for name in names if not name.startswith("__MACOSX/")]
    if len(tracks) != 1:
        raise DataError(
            f"{path}, line 1: is packed by zip and holds {len(tracks)} files; unpack it, and pass those that "
            f"are tracks: unzip {path.name}"
        )
    return archive.open(tracks[0])


# --- text ---------------------------------------------------------------------------------------------


def decode(content: bytes) -> str:
    """The `content` of a file as text: UTF-16 with its mark, else UTF-8."""
    is_wide = content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    return content.decode("utf-16" if is_wide else "utf-8-sig", errors="replace")


def check_size(
    size: float, where: Path, what: str = "text", factor: float = _READ_FACTOR
) -> None:
    """Raise MemoryLimitError where `size` bytes of `where` need more memory than is allowed.

    Each of them needs `factor` bytes of memory; the message calls them `what`.
    """
    require_memory(factor * size, f"{where}: to read {size / 1e6:,.3g} MB of {what}")


def split_line(line: str, separator: str) -> list[str]:
    """The fields of a `line`; a blank as `separator` stands for any run of blanks.

    There is none where a quotation mark is not closed.
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
    found = max(";\t,|", key=first.count)  # numbers between semicolons may have commas
    return found if found in first else " "


def open_text(file: File, has_header: bool | None = None, n_fields: int = 0) -> Source:
    """The text table `file`: each line is a row of `n_fields` fields, or of as many as the first line has.

    `has_header` says whether the first line names the columns; None: if it has a text that is no number.
    """
    where = file.path
    lines = pl.read_csv(
        io.BytesIO(file.text().replace("\x1f", "?").encode()),
        has_header=False,
        separator="\x1f",
        quote_char=None,
        schema={"line": String},
        raise_if_empty=False,
    )["line"]
    # a comment may name the columns
    first = str(lines.first() or "").strip().lstrip("# ")
    if not first:
        raise DataError(
            f"{where}, line 1: the file is empty or begins with a blank line"
        )
    if "\0" in first or len(first) > LONGEST_LINE:
        raise DataError(f"{where}, line 1: is binary, or too long for a table of text")
    separator = find_separator(first)
    names = split_line(first, separator)
    if has_header is None:
        has_header = Series(names).cast(Float64, strict=False).has_nulls()
    rows = lines.slice(int(has_header))
    if rows.str.contains('"', literal=True).any():
        fields = [split_line(row or "", separator) for row in rows]
        parts = Series(fields, dtype=pl.List(String))
    elif separator == " ":
        parts = rows.str.replace_all(r"\s+", " ").str.strip_chars().str.split(" ")
    else:
        parts = rows.str.split(separator)
    names = names if has_header else [""] * (n_fields or len(names))
    return Source(
        file.path,
        names,
        lambda k: parts.list.get(k, null_on_oob=True).str.strip_chars(" \t\"'"),
        1 + has_header,
        (parts.list.len() != len(names)).fill_null(True),
        decimal="." if separator == "," else ",",
        head=f", line 1: {first[:80]!r}",
    )


# --- shapes -------------------------------------------------------------------------------------------


def recognise(head: str, path: Path, recipe: Recipe) -> Shape:
    """The shape in the `recipe`, or else that of a file `path` whose first two lines are `head`."""
    first = head.partition("\n")[0].strip()
    fields = set(split_line(first, find_separator(first)))
    for shape in [recipe.shape] if recipe.file_format else SHAPES.values():
        found = re.match(shape.begins, head, re.MULTILINE)
        named = re.match(shape.file, path.name)
        is_given = recipe.has_people and "id" in shape.recipe.columns
        fits = fields.issuperset(shape.header) and (shape.parse or not is_given)
        if found and named and fits:
            break
    groups = found.groupdict() | named.groupdict() if found and named else {}
    if not groups:
        return shape
    columns = {
        name: at.format_map(groups) if isinstance(at, str) else at
        for name, at in shape.recipe.columns.items()
    }
    return replace(shape, recipe=replace(shape.recipe, columns=columns))


def scan_streamed(file: File) -> Rows | None:
    """Scan a `file` if its shape is streamed and its recipe simple; None for any other."""
    recipe = file.recipe
    shape = recognise(file.head, file.path, recipe)
    is_whole = not shape.is_streamed or file.head.startswith(CONTAINERS)
    is_whole |= recipe.unit in (PIXELS, DEGREES)
    if is_whole or recipe.as_json().keys() & _NOT_STREAMED:
        return None
    recipe = replace(recipe.over(shape.recipe), file_format=shape.name)
    types: dict[Any, Any] = dict.fromkeys(recipe.columns.values(), Float64)
    types[recipe.columns["id"]] = pl.Int64
    schema = {f"f{k}": types.get(k, String) for k in range(shape.n_fields)}
    content = file.plain if file.size is None else io.StringIO(file.text())
    scan = pl.scan_csv(
        content,
        schema={**schema, "extra": String()},
        has_header=False,
        quote_char=None,
        encoding="utf8-lossy",
        ignore_errors=True,
        truncate_ragged_lines=True,
        missing_columns="insert",
        extra_columns="ignore",
        raise_if_empty=False,
        glob=False,
        row_index_name="line",
        row_index_offset=1,
    )
    ragged = col("extra").is_not_null() | col(f"f{shape.n_fields - 1}").is_null()
    columns = {name: col(f"f{at}") for name, at in recipe.columns.items()}
    table = scan.select("line", ragged=ragged, **columns)
    table = table.with_columns(col("^(x|y|speed)$") * recipe.metres)
    return Rows(file.path, recipe, table, n_bytes=file.plain.stat().st_size)
