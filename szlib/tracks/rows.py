"""From the columns of a file to its rows: t [s], id, x, y [m], as a recipe says."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import Any
from zoneinfo import ZoneInfo

import numpy as np
import polars as pl

from ..core.errors import DataError
from .columns import (
    ask_about_recordings,
    column_of,
    find_columns,
    suggest_reading,
    to_ids,
    to_numbers,
    to_times,
)
from .recipe import DEGREES, Recipe, advise
from .shapes import SHAPES, Shape, recognise
from .sources import (
    CONTAINERS,
    Source,
    open_arrow,
    open_database,
    open_json,
    read_head,
    read_text,
)

EXPECTED = (
    "expected a table (text, Parquet, Feather, SQLite, JSON lines) with columns t or frame, id, x, y; or one "
    f"of {', '.join(name for name in SHAPES if name != 'tidy')}; plain, .gz or .zip"
)
"""What can be read, for error messages."""
_DAY = 86_400  # [s]
# why a row is rejected
MISSING, NO_ID = "missing or not a number", "id not a whole number"
LAST_SECOND = (
    4_102_444_800.0  # 2100-01-01; later time stamps are not seconds since 1970
)
FARTHEST = 2e7  # farther [m] from the origin of any grid is no place on Earth


@dataclass(frozen=True)
class Rows:
    """The rows of a file.

    Attributes
    ----------
    table : line, ragged, t [s], id, x, y [m], and speed [m/s] and day, where the file has them.
    recipe : how the file is read, with its columns.
    source : the columns of the file; None where it is streamed.
    """

    table: pl.LazyFrame
    recipe: Recipe
    source: Source | None = None

    def suggest_reading(self) -> str:
        """Advice how to read the file, if people walk then; empty if there is none."""
        return suggest_reading(self.source, self.recipe) if self.source else ""

    def show_field(self, line: int, name: str) -> str:
        """The column that holds `name`, and what is in it at a `line`, for people."""
        columns = self.recipe.columns or {}
        if self.source is None:
            return f"column {name}"
        at = columns["frame" if name == "t" and "frame" in columns else name]
        shown = f"column {at!r}" if at in self.source.names else f"column {name}"
        value = column_of(self.source, at)[line - self.source.first_line]
        return f"{shown} holds {value[:80]!r}" if isinstance(value, str) else shown


def open_rows(plain: Path, path: Path, recipe: Recipe) -> Rows:
    """The rows of the unpacked file `plain`, given as `path`, read with a `recipe`; scanned if large."""
    streamed = scan_streamed(plain, path, recipe)
    return streamed or load_rows(*open_source(plain, path, recipe), path)


def open_source(
    plain: Path, path: Path, recipe: Recipe, *, size: int | None = None
) -> tuple[Source, Recipe]:
    """The columns of the unpacked file `plain`, given as `path`, and the `recipe` over that of its shape.

    Of a text only `size` bytes are read.
    """
    head, where = read_head(plain), f"{path}"
    shape = recognise(head, path, recipe)
    kinds = [kind for magic, kind in CONTAINERS.items() if head.startswith(magic)]
    is_free, tables = recipe.file_format is None, list[Source]()
    try:
        if is_free and shape.name == "jupedsim":
            tables = open_database(plain, path)
        if any({"frame", "id", "pos_x"} <= set(table.names) for table in tables):
            tables = []  # PedPy reads them
        if kinds:
            source = open_arrow(plain, where, kinds[0])
        elif tables:
            source = _choose_table(tables, recipe, path)
        elif head.lstrip().startswith(("{", "[")) and not shape.parse:
            source = open_json(read_text(plain, where), where)
        else:
            source, recipe = shape.open(plain, path, recipe, size)
            return source, _complete(shape, source, recipe)
    except (pl.exceptions.PolarsError, pl.exceptions.PanicException) as error:
        raise DataError(
            f"{path}: cannot be read as {shape.name} ({error}); {EXPECTED}"
        ) from error
    if is_free:
        shape = recognise(",".join(source.names), path, recipe)
    return source, _complete(SHAPES["tidy"] if shape.parse else shape, source, recipe)


def _complete(shape: Shape, source: Source, recipe: Recipe) -> Recipe:
    """The `recipe` over that of a shape, without a column of recordings that the file has not."""
    columns = dict(shape.recipe.columns or {})
    if columns.get("day") not in source.names:
        columns.pop("day", None)
    base = replace(shape.recipe, columns=columns or None)
    return replace(recipe.over(base), file_format=shape.name)


def _choose_table(tables: list[Source], recipe: Recipe, path: Path) -> Source:
    """The one of the tables of a database that can be tracks."""
    readable, refused = [], []
    for table in tables:
        try:
            find_columns(table, recipe)
            readable.append(table)
        except DataError as error:
            refused.append(error)
    if len(readable) > 1:
        command = f"sqlite3 -header -csv {path.name} 'SELECT * FROM NAME' > tracks.csv"
        raise DataError(
            f"{path}: several of the tables {len(tables)} can be tracks; write one to a file: {command}"
        )
    if not readable:
        raise refused[0]
    return readable[0]


def load_rows(
    source: Source, recipe: Recipe, path: Path, *, is_head: bool = False
) -> Rows:
    """The rows of a `source` of file `path`, read with a `recipe`; all, or those of its head (`is_head`).

    Raises DataError where columns are missing or unclear, or a value of the recipe does not fit.
    """
    named = recipe.names_people
    recipe = find_columns(source, recipe)
    values = {k: column_of(source, at) for k, at in (recipe.columns or {}).items()}
    if len({len(each) for each in values.values()}) > 1:
        raise DataError(
            f"{path}: damaged: its columns differ in length; fetch it again"
        )
    n_fields, is_ragged = source.n_fields, pl.lit(False)
    if n_fields is not None:
        is_ragged = pl.lit((n_fields != len(source.names)).fill_null(True))
    t, day = _read_times(values, recipe, source, path)
    numbers: dict[str, pl.Series] = {
        name: to_numbers(values[name], source.decimal)
        for name in ("x", "y", "speed")
        if name in values
    }
    ids = to_ids(values["id"], source.where)
    table = pl.DataFrame({"t": t, "id": ids} | numbers)
    table = table.with_row_index("line", source.first_line)
    if "day" in values:
        text = values["day"].cast(pl.String).str.strip_chars(' "')
        day = text.set(text == "", None)
    elif not is_head and recipe.file_format == "tidy":
        ask_about_recordings(source, recipe, table, by_name=not named)
    table = to_metres(table.with_columns(ragged=is_ragged), recipe, path)
    if day is not None:
        table = table.with_columns(day=day)
    if recipe.where:
        wanted = column_of(source, recipe.where).fill_null(False)
        table = table.filter(wanted | table["ragged"])
    return Rows(table.lazy(), recipe, source)


def _read_times(
    values: dict[str, pl.Series], recipe: Recipe, source: Source, path: Path
) -> tuple[pl.Series, pl.Series | None]:
    """The times [s]; and the local date of each, where the file states its zone."""
    if "frame" in values:
        frames = to_numbers(values["frame"], source.decimal)
        return frames * (1 / (recipe.frame_rate or 1.0)), None
    t, day = to_times(values["t"], recipe.tz or "UTC", recipe.time_unit, source.decimal)
    if recipe.file_format == "lace-lhmp":  # may count from midnight of the day MMDD
        with suppress(ValueError):
            date = datetime.strptime(f"2012{path.name[:4]}", "%Y%m%d")
            midnight = date.replace(tzinfo=ZoneInfo("Asia/Tokyo")).timestamp()
            t += midnight * (t < _DAY).cast(pl.Float64)
    return t, day if recipe.tz is None else None


def to_metres(table: pl.DataFrame, recipe: Recipe, path: Path) -> pl.DataFrame:
    """The `table` of file `path` with x, y (and speed) in metres, as a `recipe` says."""
    x, y = pl.col("x"), pl.col("y")
    if recipe.homography:
        u, v, w = (a * x + b * y + c for a, b, c in recipe.homography)
        return table.with_columns(x=u / w, y=v / w)
    if recipe.unit == DEGREES:
        if recipe.origin is None:
            middle = table.select(x.median(), y.median()).row(0)
            advice = advise(origin=[round(degree or 0.0, 2) for degree in middle])
            raise DataError(
                f"{path}: positions are longitude and latitude; pass origin=, the longitude and latitude of "
                f"the point (0, 0), the same for all files of one place: {advice}"
            )
        lon, lat = recipe.origin
        east, north = metres_in_degree(lat)
        return table.with_columns(x=(x - lon) * east, y=(y - lat) * north)
    return table.with_columns(pl.col("^(x|y|speed)$") * (recipe.metres or 1.0))


def metres_in_degree(latitude: float) -> tuple[float, float]:
    """Metres in a degree of longitude, and of latitude, at a `latitude` on the ellipsoid of WGS 84."""
    phi, axis, eccentricity = np.radians(latitude), 6_378_137.0, 6.694_379_990_14e-3
    root = np.sqrt(1 - eccentricity * np.sin(phi) ** 2)
    north = axis * (1 - eccentricity) / root**3
    return float(np.radians(axis * np.cos(phi) / root)), float(np.radians(north))


# What a recipe may say that a scan of rows cannot do: the file is then read as a whole.
_NOT_STREAMED = {"where", "homography", "origin", "frame_rate", "time_unit"}


def scan_streamed(plain: Path, path: Path, recipe: Recipe) -> Rows | None:
    """Scan the unpacked file `plain`, given as `path`, if its shape is streamed and its `recipe` simple."""
    head = read_head(plain)
    shape = recognise(head, path, recipe)
    is_plain = not _NOT_STREAMED & recipe.as_json().keys()
    if not (shape.is_streamed and is_plain) or head.startswith(tuple(CONTAINERS)):
        return None
    recipe = replace(recipe.over(shape.recipe), file_format=shape.name)
    columns, metres = recipe.columns or {}, recipe.metres or 1.0
    types: dict[Any, pl.DataType] = dict.fromkeys(columns.values(), pl.Float64())
    types[columns["id"]] = pl.Int64()
    schema = {f"f{k}": types.get(k, pl.String()) for k in range(shape.n_fields)}
    scan = pl.scan_csv(
        plain, schema={**schema, "extra": pl.String()}, has_header=False, quote_char=None,
        encoding="utf8-lossy", ignore_errors=True, truncate_ragged_lines=True, missing_columns="insert",
        extra_columns="ignore", raise_if_empty=False, glob=False, row_index_name="line", row_index_offset=1,
    )  # fmt: skip
    last = pl.col(f"f{shape.n_fields - 1}")
    ragged = pl.col("extra").is_not_null() | last.is_null()
    named = {name: pl.col(f"f{at}") for name, at in columns.items()}
    table = scan.select("line", ragged=ragged, **named)
    return Rows(table.with_columns(pl.col("^(x|y|speed)$") * metres), recipe)


def rejection_reason(table: pl.DataFrame | pl.LazyFrame) -> pl.Expr:
    """Why a row of a `table` as in `Rows` is rejected; null where it is usable."""
    numbers, places = pl.col("t", "x", "y"), pl.col("x", "y")
    reasons = {
        "missing or extra fields": pl.col("ragged"),
        MISSING: pl.any_horizontal(numbers.is_null()),
        NO_ID: pl.col("id").is_null(),
        "not finite": ~pl.all_horizontal(numbers.is_finite()),
        "time not in seconds since 1970": pl.col("t").abs() > LAST_SECOND,
        "position not on Earth": pl.any_horizontal(places.abs() > FARTHEST),
    }
    if "day" in table.collect_schema():
        reasons["no day"] = pl.col("day").is_null()
    whens = [pl.when(holds).then(pl.lit(name)) for name, holds in reasons.items()]
    return pl.coalesce(whens)


def select_usable(scan: pl.LazyFrame) -> pl.LazyFrame:
    """The usable rows of a `scan` as in `Rows`."""
    return scan.filter(rejection_reason(scan).is_null())
