"""Formats of track files: how each is laid out, and how a file is recognised by its first line."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from datetime import datetime
from pathlib import Path
from types import MappingProxyType
from zoneinfo import ZoneInfo

import polars as pl
import pyarrow as pa  # type: ignore[import-untyped]
import pyarrow.parquet as pq  # type: ignore[import-untyped]

from ... import memory
from ...errors import DataError
from ..options import UNITS, Columns, ReadOptions
from .foreign import LOADERS, foreign_format, load
from .frame_rates import frame_clock
from .plain import LONGEST_LINE, ROW, first_line


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

    def metres_in(self, unit: str | None) -> float:
        """Metres in a unit of position, of `unit` where it is given; PedPy's loaders give metres."""
        return self.metres if unit is None or self.name in LOADERS else UNITS[unit]


_TIXY = {"t": 0, "id": 1, "x": 2, "y": 3}
_PEDPY = {"t": "frame", "id": "id", "x": "x", "y": "y"}

FORMATS = {
    "atc-raw": Format("atc-raw", fields=8, columns=_TIXY, metres=1e-3, max_gap=0.5),
    "atc-1hz": Format("atc-1hz", fields=6, columns=_TIXY, max_gap=1.6),
    # obsmat counts frames, of 15 or 25 a second; its z is the height, its third position is y
    "ewap": Format("ewap", 8, {"t": 0, "id": 1, "x": 2, "y": 4, "vx": 5, "vy": 7}, separator=" "),
    "tidy": Format("tidy", header=True),
    **{name: Format(name) for name in LOADERS},
}

EXPECTED = (
    "expected one of: atc-raw (8 numbers, commas, no header), atc-1hz (6 numbers, commas, no header), "
    "ewap (8 numbers, blanks), or tidy CSV with a header or Parquet with columns t, id, x, y; or, by "
    "PedPy, texts or HDF5 of Juelich's archive, Viswalk, Vadere, JuPedSim; plain or .gz; "
    "Grand Central, Edinburgh and THOR-MAGNI are read by szlib.tracks.sites"
)

_DAY, _JAPAN = 86_400.0, ZoneInfo("Asia/Tokyo")


@contextmanager
def readable(path: Path, layout: Format) -> Iterator[None]:
    """Raise DataError where Polars cannot read the file."""
    try:
        yield
    except (pl.exceptions.PolarsError, pl.exceptions.PanicException) as error:
        raise DataError(f"{path}: cannot be read as {layout.name} ({error}); {EXPECTED}") from error


def recognise(plain: Path, path: Path, options: ReadOptions) -> tuple[Format, pl.LazyFrame]:
    """Recognise the layout by the first line; a scan gives line, t, id, x, y (, day) and `ragged`.

    Where frames are counted the layout says how long one is: 1 / `frame_rate`, or (EWAP) as the file's own
    velocities tell.  Raises DataError where frames have no length, and for a rate
    where no frames are counted.
    """
    name, columns, frame_rate = options.file_format, options.columns, options.frame_rate
    with plain.open("rb") as stream:
        head = stream.readline(LONGEST_LINE)
    if head[:4] == b"PAR1":
        return _parquet(plain, path, columns, frame_rate)
    if foreign := name if name in LOADERS else foreign_format(head) if name is None else None:
        if columns:
            raise DataError(f"{path}: is {foreign}, whose columns are known; leave columns out")
        data, rate = load(foreign, plain, path, frame_rate=frame_rate, unit=options.unit)
        rows = pl.DataFrame({to: data[name].to_numpy().astype(float) for to, name in _PEDPY.items()})
        return replace(FORMATS[foreign], seconds=1 / rate), scan_of(rows)
    if b"\0" in head:
        raise DataError(f"{path}, line 1: is binary, not text; {EXPECTED}")
    first = head.decode("utf-8", errors="replace").lstrip("\ufeff").strip()
    if not first:
        raise DataError(f"{path}, line 1: the file is empty or begins with a blank line; {EXPECTED}")
    layout = FORMATS["tidy"] if columns else layout_of(first, name)
    if layout.name == "tidy":
        layout = _tidy(path, first, columns, frame_rate)
        scan = _scan_lines(plain, layout) if layout.separator == " " else _scan_csv(plain, layout)
        return layout, scan
    if frame_rate is not None and layout.name != "ewap":
        raise DataError(f"{path}: is {layout.name}, whose times are in seconds; leave frame_rate out")
    if layout.name != "ewap":
        layout = replace(layout, start=start_of_day(path, layout, first))
        return layout, _scan_csv(plain, layout)
    rows = _scan_lines(plain, layout).collect()
    second, gap = frame_clock(rows, path, frame_rate)
    return replace(layout, seconds=second, max_gap=gap), rows.lazy()


def _tidy(path: Path, first: str, columns: Columns | None, frame_rate: float | None) -> Format:
    """The layout of a table whose first line names its columns, or, where `columns` are numbers, does not."""
    separator = max(",;\t", key=first.count)
    separator = separator if separator in first else " "
    parts = [part.strip().strip('"') for part in first.split(None if separator == " " else separator)]
    chosen = [parts[k] for k in (columns or {}).values() if isinstance(k, int) and 0 <= k < len(parts)]
    header = not (chosen and all(map(_is_number, chosen)))
    shown = first if len(first) <= 80 else first[:77] + "..."
    where = f"{path}, line 1: {shown!r}"
    found, seconds = chosen_columns(parts if header else [""] * len(parts), columns, frame_rate, where)
    return Format("tidy", len(parts), found, seconds=seconds, separator=separator, header=header)


def chosen_columns(
    names: Sequence[str], columns: Columns | None, frame_rate: float | None, where: str
) -> tuple[dict[str, int], float]:
    """In which field t, id, x, y (and day) stand, and the length of a unit of time [s].

    `names` are those of the table, `columns` and `frame_rate` as in `szlib.read_tracks`.  Raises DataError,
    beginning with `where`, for a column that is missing, doubled or unknown, or frames of no length.
    """
    given = dict(columns or {})
    frames = "frame" in given or ("t" not in given and "t" not in names and "frame" in names)
    wanted = {name: given.get(name, name) for name in ("id", "x", "y")}
    wanted["t"] = given.get("frame", "frame") if frames else given.get("t", "t")
    if "day" in given or "day" in names:
        wanted["day"] = given.get("day", "day")
    numbered = {name: k for name, k in wanted.items() if isinstance(k, int)}
    texts = {name: str(k) for name, k in wanted.items() if not isinstance(k, int)}
    if missing := [texts[name] for name in (*_TIXY, "day") if name in texts and texts[name] not in names]:
        raise DataError(
            f"{where} has no column {', '.join(missing)}; name the right ones with "
            f"columns={{'t': ..., 'id': ..., 'x': ..., 'y': ...}}; {EXPECTED}"
        )
    if doubled := [text for text in texts.values() if list(names).count(text) > 1]:
        raise DataError(f"{where} names {', '.join(doubled)} twice; rename one of them")
    if beyond := [k for k in numbered.values() if not 0 <= k < len(names)]:
        raise DataError(f"{where} has no field {beyond[0]}; it has {len(names)}, the first is 0")
    if not frames and frame_rate is not None:
        raise DataError(
            f"{where}: is tidy, whose times are in seconds; leave frame_rate out, or say which column counts "
            "frames: columns={'frame': ...}"
        )
    if frames and frame_rate is None:
        raise DataError(f"{where}: {wanted['t']!r} counts frames; pass frame_rate=, frames a second")
    found = numbered | {name: list(names).index(text) for name, text in texts.items()}
    return found, 1 / frame_rate if frames and frame_rate else 1.0


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


def quick_scan(plain: Path, layout: Format) -> pl.LazyFrame:
    """A scan as from `recognise`, in two thirds of the time, of a file whose rows are all like its first one.

    Numbers are read as whole ones where they are whole in the first row, and the last field as a number.  A
    row has null where it is no such number, and is `ragged` where its last field is none.
    """
    first = first_line(plain).split(layout.separator) + [""] * layout.fields
    numbers = {*layout.columns.values(), layout.fields - 1}
    types = {f"f{k}": pl.Int64 if first[k].lstrip("-").isdecimal() else pl.Float64 for k in numbers}
    return _scan_csv(plain, layout, types)


def _scan_csv(
    plain: Path, layout: Format, types: Mapping[str, pl.datatypes.DataTypeClass] = MappingProxyType({})
) -> pl.LazyFrame:
    """A scan of fields parted by one character; `types` of some of f0, f1, ..., if not the usual ones."""
    numbers = {index for name, index in layout.columns.items() if name != "day"}
    fields = {f"f{i}": pl.Float64 if i in numbers else pl.String for i in range(layout.fields)}
    schema: dict[str, pl.datatypes.DataTypeClass] = {**fields, **types, "extra": pl.String}
    scan = pl.scan_csv(
        plain, schema=schema, has_header=False, skip_lines=int(layout.header),
        separator=layout.separator, quote_char=None, encoding="utf8-lossy", ignore_errors=True,
        truncate_ragged_lines=True,
        missing_columns="insert", extra_columns="ignore", raise_if_empty=False, glob=False,
        row_index_name="line", row_index_offset=1 + layout.header,
    )  # fmt: skip
    ragged = pl.col("extra").is_not_null()
    if layout.name != "tidy":  # in a tidy table the last column may be an empty one that nobody needs
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
    lines = pl.LazyFrame({"text": text.split("\n")[int(layout.header) :]})
    parts = pl.col("text").str.extract_all(r"\S+")
    fields = {name: parts.list.get(i, null_on_oob=True) for name, i in layout.columns.items()}
    numbers = {n: f if n == "day" else f.cast(pl.Float64, strict=False) for n, f in fields.items()}
    return lines.with_row_index("line", offset=1 + layout.header).select(
        "line", ragged=parts.list.len() != layout.fields, **numbers
    )


def _parquet(
    plain: Path, path: Path, columns: Columns | None, frame_rate: float | None
) -> tuple[Format, pl.LazyFrame]:
    """Read by pyarrow, as damaged files can make polars abort the whole process."""
    try:
        with pq.ParquetFile(plain) as file:
            names = file.schema_arrow.names
            found, seconds = chosen_columns(names, columns, frame_rate, f"{path}")
            memory.require(file.metadata.num_rows * ROW, f"{path}: to read {file.metadata.num_rows:,} rows")
            table = file.read([names[at] for at in found.values()])
        table.validate(full=True)
        named = pa.table({name: table[names[at]] for name, at in found.items()})  # without their metadata
    except DataError:
        raise
    except (pa.ArrowException, OSError, ValueError, MemoryError) as error:
        raise DataError(f"{path}: damaged Parquet ({error}); fetch or write the file again") from error
    layout = Format("tidy", len(names), found, seconds=seconds, header=True)
    return layout, scan_of(pl.from_arrow(named))  # type: ignore[arg-type]


def scan_of(rows: pl.DataFrame) -> pl.LazyFrame:
    """A scan of a table in memory with columns t, id, x, y (, day): numbers, and lines counted from 1."""
    day = [pl.col("day").cast(pl.String)] if "day" in rows.columns else []
    numbers = [pl.col(name).cast(pl.Float64, strict=False) for name in _TIXY]
    return rows.lazy().select(*numbers, *day, ragged=pl.lit(False)).with_row_index("line", offset=1)
