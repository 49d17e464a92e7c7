"""Files of tracks as they are: one sorted table day, id, t, x, y in seconds and metres.

Rows that cannot be used are set aside, counted by reason in the funnel of each file, and told in a
DataWarning; a file that cannot be used raises a DataError that names the file and the line.
"""

from __future__ import annotations

import gzip
import shutil
import tempfile
import warnings
import zlib
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa  # type: ignore[import-untyped]
import pyarrow.parquet as pq  # type: ignore[import-untyped]

from . import funnels
from .errors import DataError, DataWarning


@dataclass(frozen=True)
class Format:
    """How a file of tracks is laid out.

    `columns` says in which field t, id, x, y (and day) stand, `fields` how many a row has, `metres`
    and `seconds` what one unit of position and time is, `max_gap` [s] which silence ends a track.
    """

    name: str
    fields: int = 0
    columns: dict[str, int] = field(default_factory=dict)
    metres: float = 1.0
    seconds: float = 1.0
    max_gap: float | None = None
    separator: str = ","
    header: bool = False


_TIXY = {"t": 0, "id": 1, "x": 2, "y": 3}
FORMATS = {
    "atc-raw": Format("atc-raw", fields=8, columns=_TIXY, metres=1e-3, max_gap=0.5),
    "atc-1hz": Format("atc-1hz", fields=6, columns=_TIXY, max_gap=1.6),
    # obsmat counts the frames of a 15 Hz video; its z is the height, its third position is y
    "ewap": Format("ewap", 8, {"t": 0, "id": 1, "x": 2, "y": 4}, seconds=1 / 15, max_gap=0.9, separator=" "),
    "tidy": Format("tidy", header=True),
}
_EXPECTED = (
    "expected one of: atc-raw (8 numbers, commas, no header), atc-1hz (6 numbers, commas, no header), "
    "ewap (8 numbers, blanks), or tidy CSV with a header or Parquet with columns t, id, x, y; plain or .gz"
)
_MAX_SITE = 1000.0
"""A site wider than this [m] means that millimetres were read as metres."""
_MIN_SITE = 0.5
"""A site that reaches less far than this [m] means that metres were read as millimetres."""
_LAST_SECOND = 4_102_444_800.0
"""2100-01-01; later time stamps are not seconds since 1970."""
_FARTHEST = 2e7
"""Farther [m] from the origin of any grid is no place on Earth."""
_LONGEST_LINE = 100_000


def read_raw(
    paths: str | Path | Iterable[str | Path],
    *,
    file_format: str | None = None,
    unit: str | None = None,
    tz: str = "Asia/Tokyo",
    exclude: Iterable[str] = (),
) -> pd.DataFrame:
    """Read files as they are: day, id, t [s], x, y [m], sorted, without duplicates.

    Parameters and errors are those of `szlib.read_tracks`.  ``.attrs["max_gap"]`` keeps the format's
    longest gap [s] for `to_clock`, ``.attrs["funnel"]`` counts every row.
    """
    files = [Path(paths)] if isinstance(paths, str | Path) else [Path(p) for p in paths]
    excluded = [exclude] if isinstance(exclude, str) else sorted(map(str, exclude))
    if not files:
        raise DataError("no track file was given; pass at least one path")
    if unit not in (None, "m", "mm"):
        raise DataError(f"unit must be 'm' or 'mm'; got {unit!r}")
    if file_format is not None and file_format not in FORMATS:
        raise DataError(f"unknown file_format {file_format!r}; expected one of {list(FORMATS)}")
    parts, stages, layouts = zip(*(_read_file(file, file_format, unit, tz) for file in files), strict=True)
    _check_sequences([_stem(f) for f, layout in zip(files, layouts, strict=True) if layout.name == "ewap"])
    return merge(parts, stages, layouts, excluded)


def merge(
    parts: Sequence[pl.DataFrame],
    stages: Sequence[dict[str, Any]],
    layouts: Sequence[Format],
    excluded: Sequence[str],
) -> pd.DataFrame:
    """Rows (day, id, t, x, y) of all files as one table as from `read_raw`: sorted, without duplicates."""
    if len({part.schema["day"] for part in parts}) > 1:
        parts = [part.with_columns(pl.col("day").cast(pl.String)) for part in parts]
    merged = pl.concat(parts)
    wanted = merged.filter(~pl.col("day").cast(pl.String).is_in(excluded)) if excluded else merged
    keys = ["day", "id", "t"]
    rows = wanted.sort(keys, maintain_order=True)
    rows = rows.filter(pl.any_horizontal(pl.col(keys).ne_missing(pl.col(keys).shift())))
    doubled = {"duplicate (day, id, t)": wanted.height - rows.height}
    _warn("all files", doubled)
    if rows.height == 0:
        raise DataError(f"all {merged.height} rows lie on excluded days {excluded}; check `exclude`")
    frame = pd.DataFrame({name: rows[name].to_numpy() for name in ("id", "t", "x", "y")})
    days = rows["day"].unique().sort()
    codes = rows["day"].replace_strict(days, range(len(days)), return_dtype=pl.Int32).to_numpy()
    names = pd.Index(days.cast(pl.String).to_list())
    frame.insert(0, "day", pd.Series(pd.Categorical.from_codes(codes, names)))
    gaps = [layout.max_gap for layout in layouts if layout.max_gap is not None]
    frame.attrs["max_gap"] = max(gaps) if len(gaps) == len(layouts) else None
    reasons = {"excluded day": merged.height - wanted.height, **doubled}
    return funnels.carry(frame, [*stages, funnels.stage("merge files", merged.height, rows.height, reasons)])


def _read_file(
    path: Path, name: str | None, unit: str | None, tz: str
) -> tuple[pl.DataFrame, dict[str, Any], Format]:
    """One file: its usable rows (day, id, t, x, y), its funnel stage, its layout."""
    if not path.is_file():
        raise DataError(
            f"{path}: " + ("is a folder; pass the files in it" if path.is_dir() else "no such file")
        )
    with plain_file(path) as plain:
        layout, scan = recognise(plain, path, name)
        with readable(path, layout):
            rows = scan.collect()
    metres = {"m": 1.0, "mm": 1e-3, None: layout.metres}[unit]
    rows = rows.with_columns(reason=fault(metres, layout.seconds, "day" in rows.columns))
    bad, good = rows.filter(pl.col("reason").is_not_null()), rows.filter(pl.col("reason").is_null())
    reasons = dict(bad.group_by("reason", maintain_order=True).len().iter_rows())
    first = bad.select("line", "reason").row(0) if bad.height else None
    stage = read_stage(path, layout, good.height, reasons, first)
    if unit is None:
        check_unit(good, layout, path)
    return in_metres(good, path, layout, metres, tz), stage, layout


def read_stage(
    path: Path, layout: Format, good: int, reasons: dict[str, int], first: tuple[int, str] | None
) -> dict[str, Any]:
    """Funnel stage of one file; `first` is the line of the first bad row and its reason.

    Warns of rows set aside; raises DataError where they are more than the good ones, or there are none.
    """
    bad = sum(reasons.values())
    if first and bad > good:
        raise DataError(
            f"{path}, line {first[0]}: {first[1]}; {bad} of {bad + good} rows cannot be used "
            f"as {layout.name}; {_EXPECTED}"
        )
    if good == 0:
        raise DataError(f"{path}: holds no row; {_EXPECTED}")
    if first:
        _warn(f"{path.name}, first at line {first[0]}", reasons)
    return funnels.stage(f"read {path.name}", good + bad, good, reasons)


def in_metres(good: pl.DataFrame, path: Path, layout: Format, metres: float, tz: str) -> pl.DataFrame:
    """Usable rows as day, id, t [s], x, y [m]."""
    if "day" not in good.columns:
        # the name stands for the day where frames are counted, not time of day
        try:
            good = good.with_columns(day=pl.lit(_stem(path)) if layout.name == "ewap" else _calendar_day(tz))
        except pl.exceptions.PolarsError as error:
            raise DataError(f"unknown time zone {tz!r} ({error}); expected one like 'Asia/Tokyo'") from error
    return good.select(
        "day",
        pl.col("id").cast(pl.Int64),
        pl.col("t") * layout.seconds,
        pl.col("x") * metres,
        pl.col("y") * metres,
    )


def faults(metres: float, seconds: float, with_day: bool) -> dict[str, pl.Expr]:
    """Why a row cannot be used: reasons, and where each holds; the first one counts."""
    numbers, position, person = ["t", "id", "x", "y"], pl.col("x", "y"), pl.col("id")
    found = {
        "missing or extra fields": pl.col("ragged"),
        "missing or not a number": pl.any_horizontal(pl.col(numbers).is_null()),
        "not finite": ~pl.all_horizontal(pl.col(numbers).is_finite()),
        "id not a whole number": (person != person.floor()) | (person.abs() > 2**53),
        "time not in seconds since 1970": pl.col("t").abs() * seconds > _LAST_SECOND,
        "position not on Earth": pl.any_horizontal(position.abs() * metres > _FARTHEST),
    }
    return found | ({"no day": pl.col("day").is_null()} if with_day else {})


def fault(metres: float, seconds: float, with_day: bool) -> pl.Expr:
    """Why a row cannot be used; null where it can."""
    reasons = faults(metres, seconds, with_day).items()
    return pl.coalesce(pl.when(holds).then(pl.lit(reason)) for reason, holds in reasons)


@contextmanager
def plain_file(path: Path) -> Iterator[Path]:
    """The file itself, or its content in a temporary file where it is gzipped."""
    try:
        with path.open("rb") as stream:
            packed = stream.read(2) == b"\x1f\x8b"
    except OSError as error:
        raise DataError(f"{path}: cannot be opened ({error})") from error
    if not packed:
        yield path
        return
    with tempfile.TemporaryDirectory(prefix="szlib-", ignore_cleanup_errors=True) as folder:
        unpacked = Path(folder) / "unpacked"
        try:
            with gzip.open(path) as source, unpacked.open("wb") as target:
                shutil.copyfileobj(source, target, 1 << 22)
        except (EOFError, zlib.error, OSError) as error:
            raise DataError(
                f"{path}: damaged .gz, could be unpacked up to byte {unpacked.stat().st_size} of its content "
                f"({error}); fetch the file again"
            ) from error
        yield unpacked


@contextmanager
def readable(path: Path, layout: Format) -> Iterator[None]:
    """Raise DataError where Polars cannot read the file."""
    try:
        yield
    except (pl.exceptions.PolarsError, pl.exceptions.PanicException) as error:
        raise DataError(f"{path}: cannot be read as {layout.name} ({error}); {_EXPECTED}") from error


def recognise(plain: Path, path: Path, name: str | None) -> tuple[Format, pl.LazyFrame]:
    """Recognise the layout by the first line; a scan gives line, t, id, x, y (, day) and `ragged`."""
    with plain.open("rb") as stream:
        head = stream.readline(_LONGEST_LINE)
    if head[:4] == b"PAR1":
        return FORMATS["tidy"], _scan_parquet(plain, path)
    if b"\0" in head:
        raise DataError(f"{path}, line 1: is binary, not text; {_EXPECTED}")
    first = head.decode("utf-8", errors="replace").lstrip("\ufeff").strip()
    if not first:
        raise DataError(f"{path}, line 1: the file is empty or begins with a blank line; {_EXPECTED}")
    layout = layout_of(first, name)
    if layout.header:
        names = [part.strip().strip('"') for part in first.split(",")]
        shown = first if len(first) <= 80 else first[:77] + "..."
        if missing := [column for column in _TIXY if column not in names]:
            raise DataError(f"{path}, line 1: {shown!r} has no column {', '.join(missing)}; {_EXPECTED}")
        if doubled := [column for column in (*_TIXY, "day") if names.count(column) > 1]:
            raise DataError(f"{path}, line 1: {shown!r} names {', '.join(doubled)} twice; rename one of them")
        columns = {column: names.index(column) for column in (*_TIXY, "day") if column in names}
        layout = Format("tidy", len(names), columns, header=True)
    return layout, _scan_lines(plain, layout) if layout.separator == " " else _scan_csv(plain, layout)


def layout_of(first: str, name: str | None) -> Format:
    """The layout of that name, or the one that a file's first line looks like."""
    return (
        FORMATS[name]
        if name
        else next(filter(lambda f: _looks_like(first, f), FORMATS.values()), FORMATS["tidy"])
    )


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
            table = file.read([name for name in (*_TIXY, "day") if name in names])
        table.validate(full=True)
        columns = pa.table({name: table[name] for name in table.column_names})  # without their metadata
    except (pa.ArrowException, OSError, ValueError, MemoryError) as error:
        raise DataError(f"{path}: damaged Parquet ({error}); fetch or write the file again") from error
    if missing := [column for column in _TIXY if column not in names]:
        raise DataError(f"{path}: has no column {', '.join(missing)}; found {names}; {_EXPECTED}")
    day = [pl.col("day").cast(pl.String)] if "day" in names else []
    numbers = [pl.col(name).cast(pl.Float64, strict=False) for name in _TIXY]
    scan = pl.LazyFrame(pl.from_arrow(columns))
    return scan.select(*numbers, *day, ragged=pl.lit(False)).with_row_index("line", offset=1)


def check_unit(rows: pl.DataFrame, layout: Format, path: Path) -> None:
    """Raise DataError where a site of that size cannot be."""
    positions = rows.select("x", "y").to_numpy()
    if layout.metres < 1 and (reach := float(np.abs(positions).max())) * layout.metres < _MIN_SITE:
        raise DataError(
            f"{path}: positions reach only {reach:.3g}, expected millimetres as in {layout.name}; if they "
            "are metres, pass unit='m' (if the site is that small, unit='mm')"
        )
    if layout.metres == 1:
        low, high = np.quantile(positions, [0.01, 0.99], axis=0)
        if (spread := float((high - low).max())) > _MAX_SITE:
            raise DataError(
                f"{path}: positions spread over {spread:.3g}, expected metres as in {layout.name}; if they "
                "are millimetres, pass unit='mm' (if the site is that wide, unit='m')"
            )


def _stem(path: Path) -> str:
    return path.name.split(".")[0]


def _check_sequences(names: list[str]) -> None:
    """Raise DataError where two EWAP files of one name would be taken for one day."""
    if doubled := sorted({name for name in names if names.count(name) > 1}):
        raise DataError(
            f"several EWAP files are called {', '.join(doubled)}: their people would be mixed; "
            "pass each file once, and rename those that are other recordings"
        )


def _calendar_day(tz: str) -> pl.Expr:
    local = pl.from_epoch(pl.col("t").floor().cast(pl.Int64), time_unit="s").dt.convert_time_zone(tz)
    return local.dt.date()


def _warn(where: str, reasons: dict[str, int]) -> None:
    told = ", ".join(f"{count} x {reason}" for reason, count in reasons.items() if count)
    if told:
        warnings.warn(f"{where}: rows set aside: {told}", DataWarning, stacklevel=2)
