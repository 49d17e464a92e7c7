"""Files as they are on disk: plain or .gz, no larger than memory allows."""

from __future__ import annotations

import gzip
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ... import memory
from ...errors import DataError, StorageError
from ...files import printable, temporary_folder

LONGEST_LINE = 100_000
ROW = 130
"""Bytes that a row takes while its file is read as a whole (measured: 100 at 1 Hz, 126 tidy)."""


@contextmanager
def plain_file(path: Path) -> Iterator[Path]:
    """The file itself, or its content in a temporary file where it is gzipped.

    Raises DataError where it is no regular file or cannot be opened, StorageError where there is no room.
    """
    if not path.is_file():
        raise DataError(f"{printable(path)}: {_what_it_is(path)}")
    if printable(path.name) != path.name:
        raise DataError(f"{printable(path)}: its name is no readable text (UTF-8); rename the file")
    try:
        with path.open("rb") as stream:
            packed = stream.read(2) == b"\x1f\x8b"
    except OSError as error:
        raise DataError(f"{path}: cannot be opened ({error})") from error
    if not packed:
        yield path
        return
    with temporary_folder() as folder:
        unpacked = folder / "unpacked"
        _unpack(path, unpacked)
        yield unpacked


def _unpack(path: Path, unpacked: Path) -> None:
    """Unpack a gzipped file; what fails in reading is damage, what fails in writing a lack of room."""
    done = 0
    try:
        with gzip.open(path) as source, unpacked.open("wb") as target:
            while True:
                try:
                    block = source.read(1 << 22)
                except (EOFError, zlib.error, OSError) as error:
                    raise DataError(
                        f"{path}: damaged .gz, could be unpacked up to byte {done} of its content ({error}); "
                        "fetch the file again"
                    ) from error
                if not block:
                    break
                done += target.write(block)
    except OSError as error:
        raise StorageError(
            f"{path}: no room to unpack it in {unpacked.parent.parent} ({error.strerror or error}, after "
            f"{done} bytes); make room, or name another folder in $TMPDIR"
        ) from error


def _what_it_is(path: Path) -> str:
    if path.is_dir():
        return "is a folder; pass the files in it"
    return "is no regular file; only those are read" if path.exists() else "no such file"


def check_rows(plain: Path, path: Path) -> None:
    """Raise MemoryLimitError where a file has more rows than memory can take."""
    most = plain.stat().st_size / 2  # a row and its end are two bytes or more
    if most * ROW <= memory.limit():
        return
    with plain.open("rb") as stream:
        if stream.read(4) == b"PAR1":
            return  # its rows are counted before they are read
        rows = 0
        while block := stream.read(1 << 22):
            rows += block.count(b"\n")
    memory.require(rows * ROW, f"{path}: to read {rows:,} rows")


def first_line(path: Path) -> str:
    """The first line of a file, plain or .gz; empty where it cannot be read (reading it will tell why)."""
    try:
        with path.open("rb") as stream:
            packed = stream.read(2) == b"\x1f\x8b"
        with gzip.open(path) if packed else path.open("rb") as stream:
            return stream.readline(LONGEST_LINE).decode("utf-8", errors="replace").lstrip("\ufeff").strip()
    except (OSError, EOFError, zlib.error):
        return ""
