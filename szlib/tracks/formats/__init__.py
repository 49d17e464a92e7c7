"""Formats of track files: each recognises a file by its first line, and scans it.

base       what all formats share: `TrackFormat`
atc        the ATC mall's files, raw and 1 Hz
ewap       EWAP files, whose frame rate is estimated
tidy       tables: text, Parquet, Feather, SQLite, those of other libraries
columns    which column of a table holds what
values     times, ids and numbers of a table
parsed     formats that are read as a whole: UCY's splines, TrajNet++, THOR-MAGNI, those that PedPy reads
unpack     files on disk, plain or .gz
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import polars as pl

from ...core.errors import DataError
from ..options import ReadOptions
from .atc import ATC_1HZ, ATC_RAW
from .base import EXPECTED, TrackFormat
from .ewap import EWAP
from .parsed import PARSED_FORMATS
from .tidy import ARROW, TIDY
from .unpack import LONGEST_LINE, read_first_line, require_memory, unpacked

FORMATS: dict[str, TrackFormat] = {
    each.name: each for each in (*PARSED_FORMATS, ATC_RAW, ATC_1HZ, EWAP, TIDY)
}
"""Formats by name, in the order of recognition."""


@contextmanager
def open_file(
    path: Path, options: ReadOptions, *, is_whole: bool = False
) -> Iterator[tuple[TrackFormat, pl.LazyFrame, Path]]:
    """Open file `path`, plain or .gz, read with `options`: its format, a scan of its rows, the unpacked file.

    The scan has columns line, t, id, x, y (, day) and ragged, which marks lines with missing or extra fields.
    Raises DataError where the file has no format that szlib knows, cannot be read, or an option does not fit,
    and, if it `is_whole` in memory, MemoryLimitError where it has more rows than memory can take.
    """
    with unpacked(path) as plain:
        if is_whole:
            require_memory(plain, path)
        with plain.open("rb") as stream:
            head = stream.readline(LONGEST_LINE)
        found = recognise(head, options)
        try:
            found, scan = found.open(plain, path, head, options)
            yield found.in_metres(options.metres), scan, plain
        except (pl.exceptions.PolarsError, pl.exceptions.PanicException) as error:
            raise DataError(
                f"{path}: cannot be read as {found.name} ({error}); {EXPECTED}"
            ) from error


def find_format(path: Path, options: ReadOptions) -> TrackFormat:
    """The format of file `path`, plain or .gz, read with `options`; tidy where the file cannot be read."""
    return recognise(read_first_line(path), options)


def recognise(head: bytes, options: ReadOptions) -> TrackFormat:
    """The format in `options`, or else the one of a file whose first line is `head`."""
    if ARROW.recognises(head):
        return ARROW
    if options.file_format:
        return FORMATS[options.file_format]
    found = next(each for each in FORMATS.values() if each.recognises(head))
    return TIDY if options.columns and not found.has_known_columns else found
