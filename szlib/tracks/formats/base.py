"""What all formats of track files share: recognition by the first line, and scans of text and of tables."""

from __future__ import annotations

import codecs
import csv
import io
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from datetime import datetime
from itertools import islice
from pathlib import Path
from typing import Self
from zoneinfo import ZoneInfo

import polars as pl

from ...core.errors import DataError
from ..options import ReadOptions
from .unpack import LONGEST_LINE

EXPECTED = (
    "expected a table (text, Parquet, Feather, SQLite) with columns t or frame, id, x, y; or atc-raw (8 "
    "numbers, commas), atc-1hz (6 numbers, commas), ewap (8 numbers, blanks), vsp, TrajNet++, THOR-MAGNI; "
    "or, by PedPy, files of Juelich's archive, Viswalk, Vadere, JuPedSim, Pathfinder; plain or .gz; "
    "Grand Central and Edinburgh are read by szlib.tracks.sites"
)
"""The formats, for error messages."""
# why a row is rejected, where a value cannot be read
MISSING = "missing or not a number"
# A clock that stays below this (1973) does not count from 1970, and gives no calendar day.
CALENDAR_BEGINS = 1e8
# 2100-01-01; later time stamps are not seconds since 1970
_LAST_SECOND = 4_102_444_800.0
_FARTHEST = 2e7  # farther [m] from the origin of any grid is no place on Earth
_END = "\x1f"  # field at the end of each line
_DAY, _MINUTE = 86_400, 60  # [s]

# the format of a file, and a scan of its rows
Opened = tuple["TrackFormat", pl.LazyFrame]


@dataclass(frozen=True)
class TrackFormat:
    """A format of track files; `open_file` returns it completed with what one file says.

    Attributes
    ----------
    name : one of `szlib.tracks.options.FORMAT_NAMES`.
    n_fields : number of fields of a row.
    columns : the number of the field that holds t, id, x, y (and day).
    metres, seconds : one unit of position [m] and of time [s].
    max_gap : a longer gap between samples ends a track [s]; None takes a multiple of the sampling interval.
    separator : character between two fields; a blank stands for any run of blanks, "" for a file without
        lines.
    has_header : whether the first line names the columns.
    texts : columns whose fields are read as text.
    quote : character around a field that may hold separators; None: there is none.
    time_unit : seconds in a unit of t by the name of its column, 1 for frames; None where nothing says it.
    names : names of all columns, if the file has any.
    text : what the file was taken for, for people.
    start : time at which the clock of the file begins [s since 1970]; not 0 where it counts from midnight.
    year : the year of files named ``MMDD.csv``, which may count from midnight; None where they do not.
    tz : time zone of its calendar, unless `ReadOptions` give one.
    area : area in which encounters are looked for unless another is given: (lowest, highest) x and y [m].
    is_ambiguous : whether a file in other units or with other columns can look the same; speeds are checked.
    is_streamed : whether files are too large to be read as a whole.
    is_sequence : whether each file is a recording of its own, without a calendar.
    is_in_metres : whether positions are in metres, whatever unit is given.
    has_known_columns : whether `ReadOptions.columns` is refused.
    speed_field : number of the field that holds the sensor's speed, and its unit [m/s].
    """

    name: str
    n_fields: int = 0
    columns: Mapping[str, int] = field(default_factory=dict)
    metres: float = 1.0
    seconds: float = 1.0
    max_gap: float | None = None
    separator: str = ","
    has_header: bool = False
    texts: frozenset[str] = frozenset({"day", "id"})
    quote: str | None = None
    time_unit: float | None = None
    names: tuple[str, ...] = ()
    text: str = ""
    start: float = 0.0
    year: int | None = None
    tz: str = "UTC"
    area: tuple[tuple[float, float], tuple[float, float]] | None = None
    is_ambiguous: bool = False
    is_streamed: bool = False
    is_sequence: bool = False
    is_in_metres: bool = False
    has_known_columns: bool = False
    speed_field: tuple[int, float] | None = None

    def recognises(self, head: bytes) -> bool:
        """Whether `head`, the first line of a file, looks like this format: numbers, as many as fields."""
        parts = self.split(decode_line(head))
        return len(parts) == self.n_fields and sum(map(is_number, parts)) * 2 > len(
            parts
        )

    def open(
        self, plain: Path, path: Path, head: bytes, options: ReadOptions
    ) -> Opened:
        """Complete the format with what a file says, and scan the file.

        Parameters
        ----------
        plain : the unpacked file.
        path : the file as it was given, for messages.
        head : its first line.
        options : how it is read.

        Returns
        -------
        The format of this file, and a scan with columns line, t, id, x, y (, day) and ragged.

        Raises
        ------
        DataError : the file does not have this format, or an option does not fit it.
        """
        first = decode_first_line(head, path)
        if options.frame_rate is not None:
            raise DataError(
                f"{path}: is {self.name}, whose times are in seconds; leave frame_rate out"
            )
        found = replace(self, start=self.clock_start(path, first))
        return found, found.scan(plain)

    def in_metres(self, metres: float | None) -> Self:
        """The format with positions in units of `metres`, if they are given."""
        return (
            self
            if metres is None or self.is_in_metres
            else replace(self, metres=metres)
        )

    def split(self, line: str) -> list[str]:
        """The fields of a `line`."""
        if self.separator == " ":
            return line.split()
        fields = next(
            csv.reader([line.replace("\r", " ")], delimiter=self.separator), []
        )
        return [field.strip(" \"'") for field in fields]

    def name_columns(self, **quantities: str) -> dict[str, str | int]:
        """The columns that hold `quantities`, as for `ReadOptions.columns`; "t" stands for the time's.

        A file without names needs all of them.
        """
        names = self.names if any(self.names) else range(self.n_fields)
        whole = (
            {}
            if any(self.names)
            else {name: name for name in self.columns if name not in ("t", "day")}
        )
        return {
            name: names[self.columns[of]]
            for name, of in {**quantities, **whole, **quantities}.items()
        }

    def show_field(self, plain: Path | None, line: int, name: str) -> str:
        """The column that holds `name`, and what is in it at a `line` of file `plain`, for people."""
        k = self.columns.get(name)
        shown = name if k is None or not any(self.names) else repr(self.names[k])
        if k is None or plain is None or not self.separator:
            return f"column {shown}"
        with plain.open("rb") as stream:
            fields = self.split(
                decode_line(next(islice(stream, line - 1, None), b"")[:LONGEST_LINE])
            )
        return (
            f"column {shown} holds {fields[k][:80]!r}"
            if k < len(fields)
            else f"column {shown} is missing"
        )

    def clock_start(self, path: Path, first: str) -> float:
        """Midnight of the day that names file `path` [s since 1970], if its `first` line counts from it."""
        if self.year is None:
            return 0.0
        try:
            day = datetime.strptime(f"{self.year}{file_stem(path)}", "%Y%m%d")
            since = float(self.split(first)[self.columns["t"]])
        except ValueError:  # named otherwise, or the first row is damaged
            return 0.0
        return (
            day.replace(tzinfo=ZoneInfo(self.tz)).timestamp()
            if 0 <= since < _DAY
            else 0.0
        )

    def rejection_reason(self) -> pl.Expr:
        """Why a row is rejected; null where it is usable."""
        numbers, place = ["t", "id", "x", "y"], (self.metres, _FARTHEST)
        limit = {"t": (self.seconds, _LAST_SECOND), "x": place, "y": place}
        beyond = {
            name: pl.col(name).abs() * unit > most
            for name, (unit, most) in limit.items()
        }
        reasons = {
            "missing or extra fields": pl.col("ragged"),
            MISSING: pl.any_horizontal(pl.col(numbers).is_null()),
            "not finite": ~pl.all_horizontal(pl.col(numbers).is_finite()),
            "id not a whole number": pl.col("exact_id").is_null(),
            "time not in seconds since 1970": beyond["t"],
            "position not on Earth": beyond["x"] | beyond["y"],
        }
        if "day" in self.columns:
            reasons["no day"] = pl.col("day").is_null()
        return pl.coalesce(
            pl.when(holds).then(pl.lit(reason)) for reason, holds in reasons.items()
        )

    def to_metres(self, good: pl.DataFrame, path: Path, tz: str | None) -> pl.DataFrame:
        """Convert the `good` rows of file `path` to day, id, t [s], x, y [m].

        The day is the date in time zone `tz` (None: the format's), or the file's name where its clock does
        not count from 1970.
        """
        if "day" not in good.columns:
            last = good["t"].max()
            is_named = self.is_sequence or (
                isinstance(last, float) and last * self.seconds < CALENDAR_BEGINS
            )
            day = (
                pl.lit(file_stem(path))
                if is_named
                else _find_days(good["t"], tz or self.tz)
            )
            good = good.with_columns(day=day)
        units = {"t": self.seconds, "x": self.metres, "y": self.metres}
        numbers = (
            pl.col(name) if unit == 1 else pl.col(name) * unit
            for name, unit in units.items()
        )
        return good.select("day", "id", *numbers)

    def scan(self, plain: Path) -> pl.LazyFrame:
        """Scan the lines of file `plain`, with exact ids."""
        return _with_exact_ids(self.scan_rows(plain))

    def scan_rows(self, plain: Path) -> pl.LazyFrame:
        """Scan the lines of file `plain`: line, ragged and `columns`, as numbers or as `texts`.

        A row is ragged if it has not exactly `n_fields` fields. To tell a blank field from a missing one,
        each line of what is read as a whole gets one more field, `_END`.
        """
        source: Path | io.BytesIO = plain
        if not self.is_streamed:
            text = plain.read_bytes().removeprefix(codecs.BOM_UTF8)
            text = text.replace(b"\r\n", b"\n").removesuffix(b"\n")
            if self.separator == " ":  # any run of blanks
                text = re.sub(rb"^[ \t\r]+|[ \t\r]+$", b"", text, flags=re.MULTILINE)
                text = re.sub(rb"[ \t]+", b" ", text)
            end = f"{self.separator}{_END}".encode()
            source = io.BytesIO(text.replace(b"\n", end + b"\n") + end)
        numbers = {
            index for name, index in self.columns.items() if name not in self.texts
        }
        fields = {
            f"f{i}": pl.Float64 if i in numbers else pl.String
            for i in range(self.n_fields)
        }
        scan = pl.scan_csv(
            source, schema={**fields, "extra": pl.String}, has_header=False, skip_lines=int(self.has_header),
            separator=self.separator, quote_char=self.quote, encoding="utf8-lossy", ignore_errors=True,
            truncate_ragged_lines=True,
            missing_columns="insert", extra_columns="ignore", raise_if_empty=False, glob=False,
            row_index_name="line", row_index_offset=1 + self.has_header,
        )  # fmt: skip
        ragged = pl.col("extra").ne_missing(_END)
        if self.is_streamed:
            last = pl.col(f"f{self.n_fields - 1}")
            ragged = pl.col("extra").is_not_null() | last.is_null()
        named = {name: pl.col(f"f{index}") for name, index in self.columns.items()}
        if "day" in named:
            named["day"] = named["day"].str.strip_chars(' "')
        if self.start:
            named["t"] = named["t"] + self.start
        return scan.select("line", ragged=ragged, **named)


def decode_line(line: bytes) -> str:
    """The text of `line`, without a byte order mark and blanks around it."""
    return line.decode("utf-8", errors="replace").lstrip("\ufeff").strip()


def decode_first_line(head: bytes, path: Path) -> str:
    """The first line `head` of file `path` as text; raises DataError where it is binary or blank."""
    if head.startswith(b"PK\3\4"):
        command = f"pandas.read_excel({path.name!r}).to_csv({path.stem + '.csv'!r}, index=False)"
        raise DataError(
            f"{path}, line 1: is packed by zip, as Excel's files are; unpack it, or save the sheet as CSV in "
            f'Excel, or by: python -c "import pandas; {command}"'
        )
    if b"\0" in head:
        raise DataError(f"{path}, line 1: is binary, not text; {EXPECTED}")
    first = decode_line(head)
    if not first:
        raise DataError(
            f"{path}, line 1: the file is empty or begins with a blank line; {EXPECTED}"
        )
    return first


def is_number(text: str) -> bool:
    """Whether `text` is a number."""
    try:
        float(text)
    except ValueError:
        return False
    return True


def scan_table(rows: pl.DataFrame) -> pl.LazyFrame:
    """Scan table `rows` with columns t, id, x, y (, day) like a file; lines are counted from 1."""
    if "line" not in rows.columns:
        rows = rows.with_row_index("line", offset=1).with_columns(ragged=pl.lit(False))
    day = (
        [pl.col("day").cast(pl.String)]
        if rows.schema.get("day", pl.Date) != pl.Date
        else []
    )
    numbers = [pl.col(name).cast(pl.Float64, strict=False) for name in ("t", "x", "y")]
    return _with_exact_ids(rows.lazy().with_columns(*numbers, *day))


def _with_exact_ids(scan: pl.LazyFrame) -> pl.LazyFrame:
    """The `scan` with column id as floats, and exact_id: an integer, or null where id does not tell it."""
    number, text = (
        pl.col("id").cast(pl.Float64, strict=False),
        pl.col("id").cast(pl.Int64, strict=False),
    )
    whole = pl.when((number == number.floor()) & (number.abs() < 2.0**53)).then(number)
    texts = scan.with_columns(pl.col("id").cast(pl.String).str.strip_chars_start())
    return texts.with_columns(
        id=number, exact_id=pl.coalesce(text, whole.cast(pl.Int64, strict=False))
    )


def file_stem(path: Path) -> str:
    """The name of file `path` without its endings."""
    return path.name.split(".")[0]


def _find_days(t: pl.Series, tz: str) -> pl.Series | pl.Expr:
    """The local date of each time [s since 1970]; a single one where all minutes have the same date."""
    first, last = (int(moment) // _MINUTE * _MINUTE for moment in (t.min(), t.max()))  # type: ignore[arg-type]
    if last - first < _DAY:
        days = _local_date(pl.Series(range(first, last + 1, _MINUTE)), tz).unique()
        if len(days) == 1:
            return pl.lit(days[0])
    return _local_date(t.floor().cast(pl.Int64), tz)


def _local_date(t: pl.Series, tz: str) -> pl.Series:
    return pl.from_epoch(t, time_unit="s").dt.convert_time_zone(tz).dt.date()
