"""Track files on disk: plain or .gz, no larger than memory allows."""

from __future__ import annotations

import gzip
import shutil
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ...core import memory
from ...core.errors import DataError, StorageError
from ...core.files import temporary_folder
from ...core.input_files import printable, readable_path, unchanged_files

LONGEST_LINE = 100_000
# Bytes that a row takes while its file is read as a whole (measured: 100 at 1 Hz, 126 tidy).
BYTES_PER_ROW = 130


@contextmanager
def unpacked(path: Path) -> Iterator[Path]:
    """Give the `readable_path` of file `path`, or a temporary file with its content where it is gzipped.

    Raises DataError where it is no regular file, cannot be opened or changes, StorageError where there is no
    room.
    """
    if not path.is_file():
        raise DataError(f"{printable(path)}: {_describe_missing(path)}")
    if printable(path.name) != path.name:
        raise DataError(
            f"{printable(path)}: its name is no readable text (UTF-8); rename the file"
        )
    with unchanged_files([path]):
        if not _is_packed(readable_path(path)):
            yield readable_path(path)
            return
        with temporary_folder() as folder:
            unpacked = folder / "unpacked"
            _unpack(path, unpacked)
            yield unpacked


def _is_packed(path: Path) -> bool:
    """Whether a file is gzipped."""
    with path.open("rb") as stream:
        return stream.read(2) == b"\x1f\x8b"


def _unpack(path: Path, unpacked: Path) -> None:
    """Unpack a gzipped file; failure to read means damage, failure to write a lack of room."""
    try:
        with gzip.open(readable_path(path)) as source, unpacked.open("wb") as target:
            shutil.copyfileobj(source, target, 1 << 22)
    except (EOFError, zlib.error, gzip.BadGzipFile) as error:
        raise DataError(
            f"{path}: damaged .gz ({error}); fetch the file again"
        ) from error
    except OSError as error:
        raise StorageError(
            f"{path}: no room to unpack it in {unpacked.parent.parent} ({error.strerror or error}); make "
            "room, or name another folder in $TMPDIR"
        ) from error


def _describe_missing(path: Path) -> str:
    if path.is_dir():
        return "is a folder; pass the files in it"
    return (
        "is no regular file; only those are read" if path.exists() else "no such file"
    )


def require_memory(plain: Path, path: Path) -> None:
    """Raise MemoryLimitError where the unpacked file `plain` of `path` has more rows than memory can take."""
    most = plain.stat().st_size / 2  # a row has at least two bytes
    if most * BYTES_PER_ROW <= memory.limit():
        return
    with plain.open("rb") as stream:
        if stream.read(4) in (b"PAR1", b"ARRO"):
            return  # its rows are counted before they are read
        rows = 0
        while block := stream.read(1 << 22):
            rows += block.count(b"\n")
    memory.require(rows * BYTES_PER_ROW, f"{path}: to read {rows:,} rows")


def read_first_line(path: Path) -> bytes:
    """The first line of file `path`, plain or .gz; empty where it cannot be read."""
    try:
        plain = readable_path(path)
        with gzip.open(plain) if _is_packed(plain) else plain.open("rb") as stream:
            return stream.readline(LONGEST_LINE)
    except (OSError, EOFError, zlib.error):
        return b""
