"""From the columns of a file to its rows: t [s], id, x, y [m], as a recipe says."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from zoneinfo import ZoneInfo

import numpy as np
import polars as pl

from ..core.errors import DataError
from .columns import (
    ask_about_recordings,
    column_of,
    find_columns,
    to_ids,
    to_numbers,
    to_times,
)
from .recipe import DEGREES, Recipe, advise
from .shapes import ATC_YEAR, SHAPES, Shape, recognise
from .sources import (
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
LAST_SECOND = (
    4_102_444_800.0  # 2100-01-01; later time stamps are not seconds since 1970
)
FARTHEST = 2e7  # farther [m] from the origin of any grid is no place on Earth
_CONTAINERS = {b"PAR1": "Parquet", b"ARROW1": "Feather"}
_DAY = 86_400  # [s]


@dataclass(frozen=True)
class Rows:
    """The rows of a file.

    Attributes
    ----------
    table : line, ragged, t [s], id, x, y [m], and day, where the file tells it.
    recipe : how the file was read, with its columns.
    source : the columns of the file; None where it was streamed.
    """

    table: pl.DataFrame
    recipe: Recipe
    source: Source | None = None

    def show_field(self, line: int, name: str) -> str:
        """The column that holds `name`, and what is in it at a `line`, for people."""
        columns = self.recipe.columns or {}
        if self.source is None:
            return f"column {name}"
        at = columns["frame" if name == "t" and "frame" in columns else name]
        column = column_of(self.source, at)
        shown = f"column {at!r}" if at in self.source.names else f"column {name}"
        value = column[line - self.source.first_line]
        return f"{shown} holds {value[:80]!r}" if isinstance(value, str) else shown


def open_source(
    plain: Path, path: Path, recipe: Recipe, *, size: int | None = None
) -> tuple[Source, Recipe]:
    """The columns of the unpacked file `plain`, given as `path`, and the `recipe` over that of its shape.

    Of a text only `size` bytes are read.
    """
    head, where = read_head(plain), f"{path}"
    kind = next(
        (kind for magic, kind in _CONTAINERS.items() if head.startswith(magic)), None
    )
    shape = recognise(head, path, recipe)
    try:
        if kind:
            source = open_arrow(plain, where, kind)
        elif (
            shape.name == "jupedsim"
            and recipe.file_format is None
            and (tables := open_database(plain, path))
        ):
            if any(
                table.names[:2] == ("frame", "id") and "pos_x" in table.names
                for table in tables
            ):
                return _open_shape(shape, plain, path, recipe, size)
            source = _choose_table(tables, recipe, path)
        elif head.lstrip().startswith((b"{", b"[")) and shape.parse is None:
            source = open_json(read_text(plain, where), where)
        else:
            return _open_shape(shape, plain, path, recipe, size)
    except (pl.exceptions.PolarsError, pl.exceptions.PanicException) as error:
        raise DataError(
            f"{path}: cannot be read as {shape.name} ({error}); {EXPECTED}"
        ) from error
    if recipe.file_format is None:
        found = (
            each
            for each in SHAPES.values()
            if each.header and each.header <= set(source.names)
        )
        shape = next((each for each in found if each.parse is None), SHAPES["tidy"])
    return source, _complete(shape, source, recipe)


def _open_shape(
    shape: Shape, plain: Path, path: Path, recipe: Recipe, size: int | None
) -> tuple[Source, Recipe]:
    source, recipe = shape.open(plain, path, recipe, size)
    return source, _complete(shape, source, recipe)


def _complete(shape: Shape, source: Source, recipe: Recipe) -> Recipe:
    """The `recipe` over that of a shape, without a column of recordings that the file has not."""
    base = shape.recipe
    if (
        base.columns
        and "day" in base.columns
        and base.columns["day"] not in source.names
    ):
        base = replace(
            base, columns={k: v for k, v in base.columns.items() if k != "day"}
        )
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
    is_told = {"id", "x", "y"} <= set(recipe.columns or {})
    recipe = find_columns(source, recipe)
    columns = recipe.columns or {}
    values = {name: column_of(source, at) for name, at in columns.items()}
    height = len(values["id"])
    if len({len(each) for each in values.values()}) > 1:
        raise DataError(
            f"{path}: damaged: its columns differ in length; fetch it again"
        )
    table = pl.DataFrame({"ragged": source.ragged(height)}).with_row_index(
        "line", offset=source.first_line
    )
    t, day = _read_times(values, recipe, source, path)
    ids = to_ids(values["id"], source.where)
    numbers = {
        name: to_numbers(values[name], source.decimal)
        for name in ("x", "y", "speed")
        if name in values
    }
    if day is None and "day" in values:
        text = values["day"].cast(pl.String).str.strip_chars(' "')
        day = text.set(text == "", None)
    elif not is_head and recipe.file_format == "tidy":
        ask_about_recordings(source, recipe, t, ids, by_name=not is_told)
    table = to_metres(table.with_columns(t, id=ids, **numbers), recipe, path)
    if day is not None:
        table = table.with_columns(day=day)
    if recipe.where:
        wanted = column_of(source, recipe.where).fill_null(False)
        table = table.filter(wanted | table["ragged"])
    return Rows(table, recipe, source)


def _read_times(
    values: dict[str, pl.Series], recipe: Recipe, source: Source, path: Path
) -> tuple[pl.Series, pl.Series | None]:
    """The times [s]; and the local date of each, where the file states its zone."""
    if "frame" in values:
        frames = to_numbers(values["frame"], source.decimal)
        return (frames * (1 / (recipe.frame_rate or 1.0))).alias("t"), None
    t, day = to_times(values["t"], recipe.tz or "UTC", recipe.time_unit, source.decimal)
    if recipe.file_format == "atc-1hz":
        t = t + _midnight(path, t)
    return t.alias("t"), day if recipe.tz is None and "day" not in values else None


def _midnight(path: Path, t: pl.Series) -> float:
    """Midnight of the day that names file `path` [s since 1970], if its clock `t` counts from it."""
    with suppress(ValueError):
        day = datetime.strptime(f"{ATC_YEAR}{path.name.split('.')[0]}", "%Y%m%d")
        if len(t) and t[0] is not None and 0 <= t[0] < _DAY:
            return day.replace(tzinfo=ZoneInfo("Asia/Tokyo")).timestamp()
    return 0.0


def to_metres(table: pl.DataFrame, recipe: Recipe, path: Path) -> pl.DataFrame:
    """The `table` of file `path` with x, y (and speed) in metres, as a `recipe` says."""
    x, y = pl.col("x"), pl.col("y")
    if recipe.homography:
        (a, b, c), (d, e, f), (g, h, i) = recipe.homography
        w = g * x + h * y + i
        return table.with_columns(x=(a * x + b * y + c) / w, y=(d * x + e * y + f) / w)
    if recipe.unit == DEGREES:
        if recipe.origin is None:
            lon, lat = (
                round(float(np.nanmedian(table[name].to_numpy())), 2) for name in "xy"
            )
            raise DataError(
                f"{path}: positions are longitude and latitude; pass origin=, the longitude and latitude of "
                f"the point (0, 0), the same for all files of one place: {advise(origin=[lon, lat])}"
            )
        lon, lat = recipe.origin
        per_lon, per_lat = metres_in_degree(lat)
        return table.with_columns(x=(x - lon) * per_lon, y=(y - lat) * per_lat)
    if (metres := recipe.metres or 1.0) != 1.0:
        names = [name for name in ("x", "y", "speed") if name in table.columns]
        return table.with_columns(pl.col(names) * metres)
    return table


def metres_in_degree(latitude: float) -> tuple[float, float]:
    """Metres in a degree of longitude, and of latitude, at a `latitude` on the ellipsoid of WGS 84."""
    phi, axis, eccentricity = np.radians(latitude), 6_378_137.0, 6.694_379_990_14e-3
    root = 1 - eccentricity * np.sin(phi) ** 2
    east = axis * np.cos(phi) / np.sqrt(root)
    north = axis * (1 - eccentricity) / root**1.5
    return float(np.radians(1) * east), float(np.radians(1) * north)


# What a recipe may say that a scan of rows cannot do: the file is then read as a whole.
_NOT_STREAMED = {"where", "homography", "origin", "frame_rate", "time_unit"}


def scan_streamed(
    plain: Path, path: Path, recipe: Recipe
) -> tuple[Recipe, pl.LazyFrame] | None:
    """Scan the unpacked file `plain`, given as `path`, if its shape is streamed; else None.

    As from `readers.open_file` with a `recipe`.
    """
    head = read_head(plain)
    shape = recognise(head, path, recipe)
    is_plain = not _NOT_STREAMED & recipe.as_json().keys()
    if not (shape.is_streamed and is_plain) or head.startswith(tuple(_CONTAINERS)):
        return None
    recipe = replace(recipe.over(shape.recipe), file_format=shape.name)
    n, columns = shape.n_fields, recipe.columns or {}
    types = {
        at: pl.Int64 if name == "id" else pl.Float64 for name, at in columns.items()
    }
    schema = {f"f{k}": types.get(k, pl.String) for k in range(n)}
    scan = pl.scan_csv(
        plain, schema={**schema, "extra": pl.String}, has_header=False, separator=shape.separator,
        quote_char=None, encoding="utf8-lossy", ignore_errors=True, truncate_ragged_lines=True,
        missing_columns="insert", extra_columns="ignore", raise_if_empty=False, glob=False,
        row_index_name="line", row_index_offset=1,
    )  # fmt: skip
    ragged = pl.col("extra").is_not_null() | pl.col(f"f{n - 1}").is_null()
    factors = dict.fromkeys(("x", "y", "speed"), recipe.metres or 1.0)
    named = {
        name: pl.col(f"f{at}") * factors.get(name, 1.0)
        if name != "id"
        else pl.col(f"f{at}")
        for name, at in columns.items()
    }
    return recipe, scan.select("line", ragged=ragged, **named)
