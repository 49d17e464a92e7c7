"""Formats of track files: a class each, which recognises a file by its first line and scans it.

base    what all formats share: `TrackFormat`
atc     the ATC mall's files, raw and 1 Hz
ewap    EWAP files, whose frame rate is estimated
tidy    tables: CSV, Parquet, DataFrames, PedPy's TrajectoryData
pedpy   formats of other programs, read by PedPy's loaders
rows    why rows are rejected; usable rows in seconds and metres
unpack  files on disk, plain or .gz
"""

from __future__ import annotations

from pathlib import Path

import polars as pl

from ..options import ReadOptions
from .atc import ATC_1HZ, ATC_RAW
from .base import TrackFormat
from .ewap import EWAP
from .pedpy import PEDPY_FORMATS, PedPyFormat
from .tidy import PARQUET, TIDY
from .unpack import LONGEST_LINE, read_first_line

__all__ = ["FORMATS", "TrackFormat", "find_format", "open_file"]

FORMATS: dict[str, TrackFormat] = {each.name: each for each in (*PEDPY_FORMATS, ATC_RAW, ATC_1HZ, EWAP, TIDY)}
"""Formats by name, in the order of recognition."""


def open_file(plain: Path, path: Path, options: ReadOptions) -> tuple[TrackFormat, pl.LazyFrame]:
    """The format of the unpacked file `plain` of `path`, read with `options`, and a scan of its rows.

    The scan has columns line, t, id, x, y (, day) and ragged, which marks lines with missing or extra fields.
    Raises DataError where the file has no format that szlib knows, or an option does not fit it.
    """
    with plain.open("rb") as stream:
        head = stream.readline(LONGEST_LINE)
    found, scan = recognise(head, options).open(plain, path, head, options)
    return found.in_unit(options.unit), scan


def find_format(path: Path, options: ReadOptions) -> TrackFormat:
    """The format of file `path`, plain or .gz, read with `options`; tidy where the file cannot be read."""
    return recognise(read_first_line(path), options)


def recognise(head: bytes, options: ReadOptions) -> TrackFormat:
    """The format in `options`, or else the one of a file whose first line is `head`."""
    if PARQUET.recognises(head):
        return PARQUET
    if options.file_format:
        return FORMATS[options.file_format]
    found = next(each for each in FORMATS.values() if each.recognises(head))
    return TIDY if options.columns and not isinstance(found, PedPyFormat) else found
