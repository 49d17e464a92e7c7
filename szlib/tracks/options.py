"""How files of tracks are read: the options that all readers share."""

from __future__ import annotations

import os
import shlex
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any
from zoneinfo import ZoneInfo

import polars as pl

from ..core.checks import require
from ..core.errors import DataError

# Which column holds t [s] or frame, id, x, y and day: its name, or the number of the field from 0.
Columns = Mapping[str, str | int]
COLUMN_NAMES = ("t", "id", "x", "y", "frame", "day")  # what a column can hold
# Formats of files that szlib reads.
FORMAT_NAMES = (
    "atc-raw", "atc-1hz", "ewap", "tidy",
    "juelich-text", "juelich-hdf5", "viswalk", "vadere", "jupedsim", "pathfinder",
    "vsp", "trajnet", "magni",
)  # fmt: skip
# lowest and highest number of frames a second that a video can have
FRAME_RATES = (1.0, 240.0)
_FASTEST_COUNT = 1e9  # highest frame rate [1/s]: what counts time may count nanoseconds
FRAMES = 25.0  # a usual frame rate [1/s], for suggestions
# one step of the common clock [s]; a track cannot end after a shorter gap
SHORTEST_GAP = 0.1
UNITS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "ft": 0.3048}  # metres in a unit of position
# Environment variable of the command that reads files, such as "szlib inspect hall.csv"; unset in a program.
COMMAND_VARIABLE = "SZLIB_COMMAND"
_LONGEST_COMMAND = 400  # a longer one, of many files, is not repeated


@dataclass(frozen=True)
class ReadOptions:
    """Options of `szlib.read_tracks`, checked when they are built.

    Attributes
    ----------
    file_format : one of `FORMAT_NAMES`; None recognises the format by the content of the file.
    unit : unit of the positions, "m", "cm", "mm" or "ft"; None takes that of the format, or of the names of
        the columns ("x [mm]").  The speeds and the extent of the tracks are checked: a given unit that cannot
        be right is a warning, an assumed one an error.
    scale : metres in one unit of position, such as 0.02 for pixels of 2 cm, in place of `unit`.
    frame_rate : frames a second (1000 for milliseconds), where `columns` or a table name a column frame.
        EWAP files: None estimates it from their velocities (15 for the ETH sequence, 25 for hotel, zara and
        students).  The funnel states the rate.  An unusual rate is a warning; an uncertain one is an error.
    columns : the column of a table, CSV or Parquet file that holds each quantity, such as {"frame": "Frame",
        "id": "ped", "x": "X", "y": "Y"}: a name, or the number of the field from 0 where the file has no
        header.  Others are found by usual names in several languages (`szlib.tracks.formats.columns`).  Times
        are in column t: seconds, dates with times (ISO 8601), or milliseconds and less since 1970; or they
        are counted in column frame.  Ids may be text; each text has the same number in every file.
    max_gap : a longer gap between two samples ends a track [s], more than 0.1; None takes the format's (ATC
        raw 0.5, ATC 1 Hz 1.6; EWAP 2.25 sampling intervals; tidy 4 of them, at least 0.5 and at most 5).
    tz : time zone whose calendar gives the day of a time stamp, and of times without a zone; None takes that
        of the file's times, else UTC (ATC: Asia/Tokyo).
    max_rejected : share of the rows of a file that may be unusable, from 0 to 1; more are an error; None
        takes 0.05.

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
    szlib.core.errors.DataError: unit must be one of ['m', 'cm', 'mm', 'ft']; got 'feet'
    """

    file_format: str | None = None
    unit: str | None = None
    scale: float | None = None
    frame_rate: float | None = None
    columns: Columns | None = None
    max_gap: float | None = None
    tz: str | None = None
    max_rejected: float | None = None

    def __post_init__(self) -> None:
        rate, gap, most = self.frame_rate, self.max_gap, self.max_rejected
        length = "metres in one unit of position, more than 0"
        count = f"frames a second from 1 to {_FASTEST_COUNT:g}"
        for name, is_valid, expected in (
            (
                "file_format",
                self.file_format in (None, *FORMAT_NAMES),
                f"one of {list(FORMAT_NAMES)}",
            ),
            ("unit", self.unit in (None, *UNITS), f"one of {list(UNITS)}"),
            ("scale", self.scale is None or 0 < self.scale <= 1e3, length),
            ("frame_rate", rate is None or 1 <= rate <= _FASTEST_COUNT, count),
            (
                "max_gap",
                gap is None or gap > SHORTEST_GAP,
                "longer than the clock's 0.1 s",
            ),
            ("max_rejected", most is None or 0 <= most <= 1, "from 0 to 1"),
        ):
            require(is_valid, name, getattr(self, name), expected)
        if self.unit and self.scale:
            raise DataError("both unit and scale are given; expected one of them")
        if unknown := sorted(set(self.columns or ()) - set(COLUMN_NAMES)):
            raise DataError(
                f"columns: {unknown} are unknown; expected some of {list(COLUMN_NAMES)}"
            )
        if {"t", "frame"} <= set(self.columns or ()):
            raise DataError("columns: both t and frame are given; expected one of them")
        if self.columns and self.file_format not in (None, "tidy"):
            raise DataError(
                f"columns are for tidy tables; leave columns out, or file_format={self.file_format!r}"
            )
        try:
            zone = "UTC" if self.tz is None else self.tz
            ZoneInfo(zone)
            pl.select(pl.from_epoch(pl.lit(0)).dt.convert_time_zone(zone))
        except (KeyError, ValueError, OSError, pl.exceptions.PolarsError) as error:
            raise DataError(
                f"unknown time zone {self.tz!r}; expected one like 'Asia/Tokyo'"
            ) from error

    @property
    def metres(self) -> float | None:
        """Metres in one unit of position; None where neither unit nor scale is given."""
        return UNITS[self.unit] if self.unit else self.scale

    def as_json(self) -> dict[str, Any]:
        """The options that are given, as JSON values: ``ReadOptions(**options.as_json())`` is the same."""
        return {
            name: value for name, value in asdict(self).items() if value is not None
        }


def arguments(options: Mapping[str, Any]) -> str:
    """The `options` of a `ReadOptions`, by name, as the command line takes them.

    Examples
    --------
    >>> from szlib.tracks.options import arguments
    >>> arguments({"columns": {"t": "Zeit", "id": "Person"}, "file_format": "tidy"})
    '--columns t=Zeit,id=Person --format tidy'
    """
    words = []
    for name, value in options.items():
        text = f"{value:g}" if isinstance(value, float) else str(value)
        if isinstance(value, Mapping):
            text = ",".join(f"{key}={column}" for key, column in value.items())
        words += ["--" + name.removeprefix("file_").replace("_", "-"), text]
    return shlex.join(words)


def advise(**options: Any) -> str:
    """Advice to read again with `options`: as arguments, or from a shell as the whole command."""
    if command := os.environ.get(COMMAND_VARIABLE):
        command = (
            command if len(command) <= _LONGEST_COMMAND else "the same command with"
        )
        return f"try: {command} {arguments(options)}"
    return "pass " + " and ".join(
        f"{name}={value!r}" for name, value in options.items()
    )
