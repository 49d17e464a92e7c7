"""How files of tracks are read: the options that all readers share."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from zoneinfo import ZoneInfo

import polars as pl

from ..checks import require
from ..errors import DataError

# Which column holds t [s] or frame, id, x, y and day: its name, or the number of the field from 0.
Columns = Mapping[str, str | int]
COLUMN_NAMES = ("t", "id", "x", "y", "frame", "day")  # what a column can hold
# Formats of files that szlib reads.
FORMAT_NAMES = (
    "atc-raw", "atc-1hz", "ewap", "tidy",
    "juelich-text", "juelich-hdf5", "viswalk", "vadere", "jupedsim",
)  # fmt: skip
FRAME_RATES = (1.0, 240.0)  # lowest and highest number of frames a second that a video can have
SHORTEST_GAP = 0.1  # one step of the common clock [s]; a track cannot end after a shorter gap
UNITS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3}  # metres in a unit of position


@dataclass(frozen=True)
class ReadOptions:
    """Options of `szlib.read_tracks`, checked when they are built.

    Attributes
    ----------
    file_format : one of `FORMAT_NAMES`; None recognises the format by the content of the file.
    unit : unit of the positions, "m", "cm" or "mm"; None takes the format's.  The speeds and the extent of
        the tracks are checked: a given unit that cannot be right is a warning, an assumed one an error.
    frame_rate : frames a second, where `columns` (or a table without t) name a column frame.  EWAP files:
        None estimates it from their velocities (15 for the ETH sequence, 25 for hotel, zara and students).
        The funnel states the rate.  An unusual rate is a warning; an uncertain one is an error.
    columns : the column of a table, CSV or Parquet file that holds each quantity, such as {"frame": "Frame",
        "id": "ped", "x": "X", "y": "Y"}: a name, or the number of the field from 0 where the file has no
        header.  Times are in column t [s] (in a DataFrame or Parquet file also as datetimes), or counted in
        column frame.
    max_gap : a longer gap between two samples ends a track [s], more than 0.1; None takes the format's (ATC
        raw 0.5, ATC 1 Hz 1.6; EWAP 2.25 sampling intervals; tidy 4 of them, at least 0.5 and at most 5).
    tz : time zone whose calendar gives the day of a time stamp, and of times without a zone; None takes the
        format's (ATC: Asia/Tokyo; others: UTC).

    Raises
    ------
    DataError : an option has no meaning.

    Examples
    --------
    >>> import szlib
    >>> options = szlib.ReadOptions(unit="cm", columns={"frame": "Frame", "id": "ped"}, frame_rate=25)
    >>> options.unit
    'cm'
    >>> szlib.ReadOptions(unit="feet")
    Traceback (most recent call last):
    ...
    szlib.errors.DataError: unit must be one of ['m', 'cm', 'mm']; got 'feet'
    """

    file_format: str | None = None
    unit: str | None = None
    frame_rate: float | None = None
    columns: Columns | None = None
    max_gap: float | None = None
    tz: str | None = None

    def __post_init__(self) -> None:
        rate, gap = self.frame_rate, self.max_gap
        lowest, highest = FRAME_RATES
        is_known = self.file_format in (None, *FORMAT_NAMES)
        require(is_known, "file_format", self.file_format, f"one of {list(FORMAT_NAMES)}")
        require(self.unit in (None, *UNITS), "unit", self.unit, f"one of {list(UNITS)}")
        is_possible = rate is None or lowest <= rate <= highest
        require(is_possible, "frame_rate", rate, f"frames a second from {lowest:g} to {highest:g}")
        if unknown := sorted(set(self.columns or ()) - set(COLUMN_NAMES)):
            raise DataError(f"columns: {unknown} are unknown; expected some of {list(COLUMN_NAMES)}")
        if {"t", "frame"} <= set(self.columns or ()):
            raise DataError("columns: both t and frame are given; expected one of them")
        if self.columns and self.file_format not in (None, "tidy"):
            raise DataError(
                f"columns are for tidy tables; leave columns out, or file_format={self.file_format!r}"
            )
        require(gap is None or gap > SHORTEST_GAP, "max_gap", gap, "longer than the clock's 0.1 s")
        try:
            zone = "UTC" if self.tz is None else self.tz
            ZoneInfo(zone)
            pl.select(pl.from_epoch(pl.lit(0)).dt.convert_time_zone(zone))
        except (KeyError, ValueError, OSError, pl.exceptions.PolarsError) as error:
            raise DataError(f"unknown time zone {self.tz!r}; expected one like 'Asia/Tokyo'") from error
