"""Formats of track files: how each is laid out, and how a file is recognised by its first line."""

from __future__ import annotations

import gzip
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from datetime import datetime
from pathlib import Path
from zoneinfo import ZoneInfo

import polars as pl
import pyarrow as pa  # type: ignore[import-untyped]
import pyarrow.parquet as pq  # type: ignore[import-untyped]

from .. import memory
from ..errors import DataError, StorageError
from ..files import printable, temporary_folder
from .frame_rates import frame_clock


@dataclass(frozen=True)
class Format:
    """How a file of tracks is laid out.

    `columns` says in which field t, id, x, y (and day) stand, `fields` how many a row has, `metres`
    and `seconds` what one unit of position and time is, `max_gap` [s] which silence ends a track.  EWAP
    files count frames: `recognise` says how long one is, and how long a gap.  `start` [s since 1970] is when
    the clock of a file begins: 0, or midnight where it counts from the start of its day.
    """

    name: str
    fields: int = 0
    columns: dict[str, int] = field(default_factory=dict)
    metres: float = 1.0
    seconds: float = 1.0
    max_gap: float | None = None
    separator: str = ","
    header: bool = False
    start: float = 0.0


_TIXY = {"t": 0, "id": 1, "x": 2, "y": 3}

FORMATS = {
    "atc-raw": Format("atc-raw", fields=8, columns=_TIXY, metres=1e-3, max_gap=0.5),
    "atc-1hz": Format("atc-1hz", fields=6, columns=_TIXY, max_gap=1.6),
    # obsmat counts frames, of 15 or 25 a second; its z is the height, its third position is y
    "ewap": Format("ewap", 8, {"t": 0, "id": 1, "x": 2, "y": 4, "vx": 5, "vy": 7}, separator=" "),
    "tidy": Format("tidy", header=True),
}

EXPECTED = (
    "expected one of: atc-raw (8 numbers, commas, no header), atc-1hz (6 numbers, commas, no header), "
    "ewap (8 numbers, blanks), or tidy CSV with a header or Parquet with columns t, id, x, y; plain or .gz"
)

LONGEST_LINE = 100_000
_ROW = 130
"""Bytes that a row takes while its file is read as a whole (measured: 100 at 1 Hz, 126 tidy)."""
_DAY, _JAPAN = 86_400.0, ZoneInfo("Asia/Tokyo")


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
    if (limit := memory.ceiling()) is None or most * _ROW <= limit:
        return
    with plain.open("rb") as stream:
        if stream.read(4) == b"PAR1":
            return  # its rows are counted before they are read
        rows = 0
        while block := stream.read(1 << 22):
            rows += block.count(b"\n")
    memory.require(rows * _ROW, f"{path}: to read {rows:,} rows")


@contextmanager
def readable(path: Path, layout: Format) -> Iterator[None]:
    """Raise DataError where Polars cannot read the file."""
    try:
        yield
    except (pl.exceptions.PolarsError, pl.exceptions.PanicException) as error:
        raise DataError(f"{path}: cannot be read as {layout.name} ({error}); {EXPECTED}") from error


def recognise(
    plain: Path, path: Path, name: str | None, frame_rate: float | None = None
) -> tuple[Format, pl.LazyFrame]:
    """Recognise the layout by the first line; a scan gives line, t, id, x, y (, day) and `ragged`.

    Where frames are counted (EWAP) the layout says how long one is: 1 / `frame_rate`, or as the file's own
    velocities tell.  Raises DataError where they do not, and for a rate where no frames are counted.
    """
    with plain.open("rb") as stream:
        head = stream.readline(LONGEST_LINE)
    if head[:4] == b"PAR1":
        return FORMATS["tidy"], _scan_parquet(plain, path)
    if b"\0" in head:
        raise DataError(f"{path}, line 1: is binary, not text; {EXPECTED}")
    first = head.decode("utf-8", errors="replace").lstrip("\ufeff").strip()
    if not first:
        raise DataError(f"{path}, line 1: the file is empty or begins with a blank line; {EXPECTED}")
    layout = layout_of(first, name)
    if layout.header:
        names = [part.strip().strip('"') for part in first.split(",")]
        shown = first if len(first) <= 80 else first[:77] + "..."
        if missing := [column for column in _TIXY if column not in names]:
            raise DataError(f"{path}, line 1: {shown!r} has no column {', '.join(missing)}; {EXPECTED}")
        if doubled := [column for column in (*_TIXY, "day") if names.count(column) > 1]:
            raise DataError(f"{path}, line 1: {shown!r} names {', '.join(doubled)} twice; rename one of them")
        columns = {column: names.index(column) for column in (*_TIXY, "day") if column in names}
        layout = Format("tidy", len(names), columns, header=True)
    if frame_rate is not None and layout.name != "ewap":
        raise DataError(f"{path}: is {layout.name}, whose times are in seconds; leave frame_rate out")
    if layout.name != "ewap":
        layout = replace(layout, start=start_of_day(path, layout, first))
        return layout, _scan_csv(plain, layout)
    rows = _scan_lines(plain, layout).collect()
    second, gap = frame_clock(rows, path, frame_rate)
    return replace(layout, seconds=second, max_gap=gap), rows.lazy()


def first_line(path: Path) -> str:
    """The first line of a file, plain or .gz; empty where it cannot be read (reading it will tell why)."""
    try:
        with path.open("rb") as stream:
            packed = stream.read(2) == b"\x1f\x8b"
        with gzip.open(path) if packed else path.open("rb") as stream:
            return stream.readline(LONGEST_LINE).decode("utf-8", errors="replace").lstrip("\ufeff").strip()
    except (OSError, EOFError, zlib.error):
        return ""


def layout_of(first: str, name: str | None) -> Format:
    """The layout of that name, or the one that a file's first line looks like."""
    return (
        FORMATS[name]
        if name
        else next(filter(lambda f: _looks_like(first, f), FORMATS.values()), FORMATS["tidy"])
    )


def start_of_day(path: Path, layout: Format, first: str) -> float:
    """When the clock of a file begins [s since 1970]: 0, or midnight of the day in the file's name.

    The ATC days of LaCE-LHMP, ``MMDD.csv`` of 2012, may count from the start of the day, in Japan.
    """
    if layout.name != "atc-1hz":
        return 0.0
    try:
        day = datetime.strptime(f"2012{path.name.split('.')[0]}", "%Y%m%d").replace(tzinfo=_JAPAN)
        since = float(first.split(layout.separator)[layout.columns["t"]])
    except ValueError:  # named otherwise, or the first row is damaged
        return 0.0
    return day.timestamp() if 0 <= since < _DAY else 0.0


def _looks_like(first: str, layout: Format) -> bool:
    parts = first.split(None if layout.separator == " " else layout.separator)
    return len(parts) == layout.fields and sum(map(_is_number, parts)) * 2 > len(parts)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _scan_csv(plain: Path, layout: Format) -> pl.LazyFrame:
    numbers = {index for name, index in layout.columns.items() if name != "day"}
    fields = {f"f{i}": pl.Float64 if i in numbers else pl.String for i in range(layout.fields)}
    scan = pl.scan_csv(
        plain, schema={**fields, "extra": pl.String}, has_header=False, skip_lines=int(layout.header),
        quote_char=None, encoding="utf8-lossy", ignore_errors=True, truncate_ragged_lines=True,
        missing_columns="insert", extra_columns="ignore", raise_if_empty=False, glob=False,
        row_index_name="line", row_index_offset=1 + layout.header,
    )  # fmt: skip
    ragged = pl.col("extra").is_not_null()
    if not layout.header:  # in a tidy table the last column may be an empty one that nobody needs
        ragged |= pl.col(f"f{layout.fields - 1}").is_null()
    named = {name: pl.col(f"f{index}") for name, index in layout.columns.items()}
    if "day" in named:
        named["day"] = named["day"].str.strip_chars(' "')
    if layout.start:
        named["t"] = named["t"] + layout.start
    return scan.select("line", ragged=ragged, **named)


def _scan_lines(plain: Path, layout: Format) -> pl.LazyFrame:
    """Fields parted by any run of blanks."""
    text = plain.read_bytes().decode("utf-8", errors="replace").removeprefix("\ufeff").removesuffix("\n")
    lines = pl.LazyFrame({"text": text.split("\n")})
    parts = pl.col("text").str.extract_all(r"\S+")
    numbers = {
        name: parts.list.get(i, null_on_oob=True).cast(pl.Float64, strict=False)
        for name, i in layout.columns.items()
    }
    return lines.with_row_index("line", offset=1).select(
        "line", ragged=parts.list.len() != layout.fields, **numbers
    )


def _scan_parquet(plain: Path, path: Path) -> pl.LazyFrame:
    """Read by pyarrow, as damaged files can make polars abort the whole process."""
    try:
        with pq.ParquetFile(plain) as file:
            names = file.schema_arrow.names
            if doubled := [column for column in (*_TIXY, "day") if names.count(column) > 1]:
                raise DataError(f"{path}: names {', '.join(doubled)} twice; rename one of them")
            memory.require(file.metadata.num_rows * _ROW, f"{path}: to read {file.metadata.num_rows:,} rows")
            table = file.read([name for name in (*_TIXY, "day") if name in names])
        table.validate(full=True)
        columns = pa.table({name: table[name] for name in table.column_names})  # without their metadata
    except DataError:
        raise
    except (pa.ArrowException, OSError, ValueError, MemoryError) as error:
        raise DataError(f"{path}: damaged Parquet ({error}); fetch or write the file again") from error
    if missing := [column for column in _TIXY if column not in names]:
        raise DataError(f"{path}: has no column {', '.join(missing)}; found {names}; {EXPECTED}")
    day = [pl.col("day").cast(pl.String)] if "day" in names else []
    numbers = [pl.col(name).cast(pl.Float64, strict=False) for name in _TIXY]
    scan = pl.LazyFrame(pl.from_arrow(columns))
    return scan.select(*numbers, *day, ragged=pl.lit(False)).with_row_index("line", offset=1)
