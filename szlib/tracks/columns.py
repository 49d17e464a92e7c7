"""From the columns of a file or table to its rows: t [s], id, x, y [m], as a recipe says.

Columns are found by the names given or by usual names.  Where that fails, the error says which columns there
are.  Values are converted here, too: numbers, times and ids.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import polars as pl
from polars import Float64, Int64, Series, String, col, exceptions

from ..core.errors import DataError
from ..core.input_files import explain_errors
from .recipe import DEGREES, NAMES, PIXELS, SHAPES, TIME_UNITS, Recipe, advise
from .shapes import open_arrow, open_database, open_json, open_shape
from .sources import CONTAINERS, File, Rows, Source, recognise

# parts of names of columns that hold times, not recordings
_TIMES = re.compile(r"(time|sec|stamp|frame|zeit|hour|minute)")
# mean number of rows of a person in a recording, at least, where a column tells recordings apart
_MIN_ROWS = 5
_FRAMES = 25.0  # a usual frame rate [1/s], for advice
_PIXEL = 0.02  # metres in a pixel that an error message shows as an example

# Times without a unit whose median is larger count in this unit since 1970: as seconds they would be
# later than the year 5000.
_SINCE_1970 = {1e17: "ns", 1e14: "us", 1e11: "ms", 0.0: "s"}
_DATE = r"^(?:19|20)\d{2}-\d{2}-\d{2}"  # beginning of an ISO time
# end of an ISO time that states its zone
_ZONE = r"(?:Z|[+-]\d{2}:?\d{2}|:\d{2}(?:\.\d+)?[+-]\d{2})$"
_EXCEL_1970 = 25_569  # number of the day 1970-01-01 in Excel
_DROPPED_BITS = 11  # bits of a hash that are left out: a float holds the others exactly
_LARGEST_EXACT = 2.0**53  # floats hold smaller whole numbers exactly
_NO_IDS = "", "nan", "none", "null"  # what programs write for nobody
_FARTHEST_ORIGIN = 0.5  # from the middle of the positions [degrees]


def open_source(file: File) -> tuple[Source, Recipe]:
    """The columns of a `file`, and its recipe completed by that of its shape.

    A database gives the columns of the one table that can hold tracks.
    """
    path = file.path
    recipe = file.recipe
    head = file.head
    shape = recognise(head, path, recipe)
    readable = list[Source]()
    is_unknown = recipe.file_format is None
    tables = open_database(file) if is_unknown and shape.name == "jupedsim" else []
    if any({"frame", "id", "pos_x"} <= set(table.names) for table in tables):
        tables = []  # PedPy reads them
    for table in tables:
        with suppress(DataError):
            find_columns(table, recipe)
            readable.append(table)
    if len(readable) > 1:
        raise DataError(
            f"{path}: several of the {len(tables)} tables can be tracks; write one to a file: "
            f"sqlite3 -header -csv {path.name} 'SELECT * FROM NAME' > tracks.csv"
        )
    if head.startswith(CONTAINERS):
        source = open_arrow(file)
    elif tables:
        source = (readable or tables)[0]
    elif head.lstrip().startswith(("{", "[")) and not shape.parse:
        source = open_json(file)
    else:
        source, recipe = open_shape(shape, file)
        is_unknown = False
    if is_unknown:
        shape = recognise(",".join(source.names), path, recipe)
        shape = SHAPES["tidy"] if shape.parse else shape
    columns = dict(shape.recipe.columns)
    if columns.get("day") not in source.names:
        columns.pop("day", None)
    recipe = recipe.over(replace(shape.recipe, columns=columns))
    return source, replace(recipe, file_format=shape.name)


def load_rows(source: Source, recipe: Recipe, *, ask: bool = True) -> Rows:
    """The rows of a `source`, read with a `recipe`.

    Raises DataError where columns are missing or unclear, or a value of the recipe does not fit.  With `ask`
    a column that may tell recordings apart is such an error, too.
    """
    named = recipe.has_people
    path = source.where
    decimal = source.decimal
    recipe = find_columns(source, recipe)
    values = {name: column_of(source, at) for name, at in recipe.columns.items()}
    numbers = {
        name: to_numbers(column, decimal)
        for name, column in values.items()
        if name in ("frame", "x", "y", "speed")
    }
    if "frame" in numbers:
        t = numbers.pop("frame") * (1 / (recipe.frame_rate or 1.0))
        day = None
    else:
        t, day = to_times(values["t"], recipe.tz or "UTC", recipe.time_unit, decimal)
    table = pl.DataFrame({"t": t, "id": to_ids(values["id"], path), **numbers})
    table = table.with_row_index("line", source.first_line)
    if "day" in values:
        text = values["day"].cast(String).str.strip_chars(' "')
        day = text.set(text == "", None)
    else:
        day = None if recipe.tz else day
        if ask and recipe.file_format == "tidy":
            ask_about_recordings(source, recipe, table, by_name=not named)
    table = to_metres(table.with_columns(ragged=source.ragged), recipe, path)
    if day is not None:
        table = table.with_columns(day=day)
    if recipe.where:
        table = table.filter(column_of(source, recipe.where) | table["ragged"])
    return Rows(path, recipe, table.lazy(), source)


def to_metres(table: pl.DataFrame, recipe: Recipe, path: Path) -> pl.DataFrame:
    """The `table` of file `path` with x, y (and speed) in metres, as a `recipe` says."""
    x = col.x
    y = col.y
    origin = recipe.origin
    if recipe.homography:
        u, v, w = (a * x + b * y + c for a, b, c in recipe.homography)
        return table.with_columns(x=u / w, y=v / w)
    if origin or recipe.unit == DEGREES:
        middle = table.select(col("x", "y").median().fill_null(np.nan).round(2)).row(0)
        if not origin or np.abs(np.subtract(origin, middle)).max() > _FARTHEST_ORIGIN:
            raise DataError(
                f"{path}: positions are longitude and latitude; pass origin=, the longitude and latitude of "
                f"the point (0, 0), near them, the same for all files of a place: {advise(origin=[*middle])}"
            )
        east, north = metres_in_degree(origin[1])
        return table.with_columns(x=(x - origin[0]) * east, y=(y - origin[1]) * north)
    return table.with_columns(col("^(x|y|speed)$") * recipe.metres)


def metres_in_degree(latitude: float) -> tuple[float, float]:
    """Metres in a degree of longitude, and of latitude, at a `latitude` on the ellipsoid of WGS 84."""
    phi = np.radians(latitude)
    degree = np.radians(6_378_137.0)  # of the equator
    eccentricity = 6.694_379_990_14e-3
    root = np.sqrt(1 - eccentricity * np.sin(phi) ** 2)
    north = degree * (1 - eccentricity) / root**3
    return float(degree * np.cos(phi) / root), float(north)


# --- which column holds what --------------------------------------------------------------------------


def find_columns(source: Source, recipe: Recipe) -> Recipe:
    """Complete a `recipe` with the columns of a `source`, and with the units that their names state.

    Raises
    ------
    DataError : a column is missing, doubled or ambiguous, frames have no rate, pixels no scale, degrees no
        origin; it says which columns look like what.
    """
    names = source.names
    where = f"{source.where}{source.head}"
    given = recipe.columns
    at = {name: _candidates(name, recipe, names) for name in NAMES["columns"]}
    is_frame = "frame" in given or not at["t"] or recipe.frame_rate is not None
    time = "frame" if at["frame"] and "t" not in given and is_frame else "t"
    needed = [time, "id", "x", "y", *(["day"] if at["day"] else [])]
    for quantity in needed:
        if len(at[quantity]) > 1:
            same = sorted(map(str, set(at[quantity])))
            chosen = {**given, quantity: at[quantity][0]}
            unclear = (
                f"{', '.join(same)} can all be {quantity}; {advise(columns=chosen)}"
            )
            if len(same) == 1:
                unclear = f"names {same[0]} twice; rename one of them"
            raise DataError(f"{where}: {unclear}")
    found = {**given, **{name: at[name][0] for name in needed if at[name]}}
    if missing := [name for name in needed if not at[name]]:
        columns = found | dict.fromkeys(missing, "...")
        guess = ""
        if not any(names):
            columns = {name: given.get(name, k) for k, name in enumerate(needed)}
            guess = "name its format, such as petrack, or its fields; this is only a guess: "
        raise DataError(
            f"{where} has no column {', '.join(str(given.get(name, name)) for name in missing)}; "
            f"it has {', '.join(repr(name or k) for k, name in enumerate(names[:12]))}; "
            f"{guess}{advise(columns=columns)}"
        )
    stated = {q: _split_unit(name)[1] for q, name in found.items() if name in names}
    units = {NAMES["units"].get(stated.get(name)) for name in "xy"}
    unit = units.pop() if len(units) == 1 else None
    time_unit = NAMES["time_units"].get(stated.get("t"))
    recipe = recipe.over(Recipe(columns=found, time_unit=time_unit, unit=unit))
    _check_units(where, recipe)
    return recipe


def _check_units(where: str, recipe: Recipe) -> None:
    """Raise DataError where frames have no rate, times have one, or pixels no scale."""
    columns = recipe.columns
    guesses = dict[str, float]()
    if "t" in columns and recipe.frame_rate is not None:
        raise DataError(
            f"{where}: its times are in seconds; leave frame_rate out, or name the column that counts "
            f"frames: {advise(columns={'frame': columns['t']})}"
        )
    missing = []
    if "frame" in columns and recipe.frame_rate is None:
        guesses["frame_rate"] = _FRAMES
        missing.append(
            f"{columns['frame']!r} counts frames; pass frame_rate=, frames a second of the video"
        )
    if recipe.unit == PIXELS and not recipe.has_metres:
        guesses["scale"] = _PIXEL
        missing.append(
            "positions are in pixels; pass scale=, metres in a pixel, or homography=, 3 x 3 numbers that map "
            "pixels to the floor"
        )
    if missing:
        raise DataError(
            f"{where}: {'; '.join(missing)}; this is only a guess: {advise(**guesses)}"
        )


def column_of(source: Source, at: str | int) -> Series:
    """The column of a `source` whose number or name is `at`, or the sum of columns that `at` is in SQL."""
    names = [name or f"f{k}" for k, name in enumerate(source.names)]
    if at in source.names:
        at = source.names.index(at)
    if isinstance(at, int):
        if not 0 <= at < len(names):
            raise DataError(
                f"{source.where} has no field {at}; it has {len(names)}, the first is 0"
            )
        return source.column(at)
    lacks = f"{source.where} has no column {at}"
    advice = "it is no sum of columns and no condition either"
    with explain_errors(lacks, advice, faults=exceptions.PolarsError):
        sum_ = pl.sql_expr(at)
        roots = sum_.meta.root_names()
        if not roots or not set(roots) <= set(names):
            raise DataError(f"{lacks}; it has {names[:12]}")
        columns = {root: source.column(names.index(root)) for root in roots}
        for root, values in columns.items():
            name = rf'"?\b{re.escape(root)}\b"?\s*'
            beside = (
                rf"[.\d]\s*[<>=!]+\s*{name}|{name}([<>=!]+|between|in\s*\()\s*[-.\d]"
            )
            if not re.search(r"\|\||'", at) or re.search(beside, at, re.IGNORECASE):
                columns[root] = to_numbers(values, source.decimal)
        return pl.DataFrame(columns).select(sum_.alias("c")).to_series()


def ask_about_recordings(
    source: Source, recipe: Recipe, rows: pl.DataFrame, *, by_name: bool
) -> None:
    """Raise DataError where a column of `source` that the `recipe` does not use tells recordings apart.

    Such a column has few values.  It changes where a person has two rows at one time, or where times go back.
    With `by_name` a column with a usual name of recordings is meant, too, if people are seen under several of
    its values.  `rows` has id and t of all rows.
    """
    step = col.t.diff()
    is_mixed = rows.select((step.over("id") <= 0).any()).item()
    used = " ".join(map(str, recipe.columns.values()))
    for k, name in enumerate(source.names):
        key = _split_unit(name)[0]
        shown = name or f"f{k}"
        is_usual = by_name and key in NAMES["kinds"]["recordings"].split()
        is_used = shown in used or k in recipe.columns.values() or _TIMES.search(key)
        if is_used or not (is_mixed or is_usual):
            continue
        table = rows.select("id", "t", c=source.column(k).cast(String))
        n_pieces = table.select("id", "c").n_unique()
        if table["c"].n_unique() < 2 or n_pieces * _MIN_ROWS > len(rows):
            continue
        is_still = table.select((step.over("id", "c") <= 0).any()).item()
        if n_pieces > rows["id"].n_unique() and (is_usual or not is_still):
            raise DataError(
                f"{source.where}: column {name or k!r} changes where people or times begin again, so it "
                f"seems to tell recordings apart; {advise(columns={'day': name or k})}; "
                "if it does not, name the columns of id, x and y"
            )


def _split_unit(name: object) -> tuple[str, str]:
    """A name without blanks, accents and capitals, and its unit: ("posx", "mm") of "Pos X [mm]"."""
    words = re.findall(r"[^\W_]+", unicodedata.normalize("NFKD", str(name).casefold()))
    is_unit = words[-1:] and words[-1] in NAMES["units"] | NAMES["time_units"]
    unit = words.pop() if is_unit and len(words) > 1 else ""
    key = "".join(words)
    return key, "deg" if key in NAMES["kinds"]["degrees"].split() else unit


def _candidates(quantity: str, recipe: Recipe, names: Sequence[str]) -> list[str | int]:
    """The columns that can hold a quantity: the one given, those with its name, or with a usual one."""
    at = recipe.columns.get(quantity, quantity)
    if same := [name for name in names if name == at]:
        return list(same)
    if quantity in recipe.columns:
        is_sum = isinstance(at, int) or re.search(r"[-+*/|(]", at)
        return [at] if is_sum else []
    usual = {_split_unit(each)[0] for each in NAMES["columns"][quantity].split()}
    return [name for name in names if _split_unit(name)[0] in usual]


# --- values -------------------------------------------------------------------------------------------


def to_numbers(values: Series, decimal: str = ".") -> Series:
    """The numbers in a column of `values`; null where one is no number.  `decimal` is their decimal point."""
    if values.dtype == String:
        values = values.str.strip_chars(" \"'").str.replace(decimal, ".", literal=True)
    try:
        return values.cast(Float64, strict=False)
    except exceptions.PolarsError:  # a list, an object
        return pl.repeat(None, len(values), dtype=Float64, eager=True)


def to_times(
    values: Series, tz: str, unit: str | None = None, decimal: str = "."
) -> tuple[Series, Series | None]:
    """The times in a column of `values`: numbers (`decimal` is their point), dates, durations, ISO texts.

    Numbers are in a `unit` of time; None takes seconds, or a shorter unit for counts since 1970.  Times
    without a zone are those of `tz`.  Returns seconds, since 1970 where times are dates; and the local date
    of each where the column states its zone, else None.
    """
    if values.dtype == pl.Duration:
        return values.dt.total_nanoseconds() / 1e9, None
    numbers = to_numbers(values, decimal)
    day = None
    if values.dtype == String and 2 * numbers.null_count() > len(values):
        text = values.str.strip_chars(" \"'")
        dates = text.set(~text.str.contains(_DATE).fill_null(False), None).to_pandas()
        parsed = pd.to_datetime(dates, format="ISO8601", utc=True, errors="coerce")
        has_zone = text.str.contains(_ZONE).fill_null(False).to_numpy()
        values = Series(parsed).dt.replace_time_zone(None)
        if has_zone.any():
            values = Series(parsed.where(has_zone)).dt.replace_time_zone("UTC")
            day = text.str.slice(0, 10).str.to_date("%Y-%m-%d", strict=False)
    elif unit == "days" and values.dtype not in (pl.Date, pl.Datetime):
        values = ((numbers - _EXCEL_1970) * 86_400_000).round()
        values = values.cast(Int64, strict=False).cast(pl.Datetime("ms"))
    if values.dtype in (pl.Date, pl.Datetime):
        zone = getattr(values.dtype, "time_zone", None)
        moments = values.cast(pl.Datetime("ns", zone), strict=False)
        if zone is None:
            moments = moments.dt.replace_time_zone(
                tz, ambiguous="null", non_existent="null"
            )
        elif day is None:
            day = moments.dt.date()
        return moments.dt.epoch("ns") / 1e9, day
    middle = numbers.drop_nans().abs().quantile(0.5) or 0.0
    unit = unit or next(name for least, name in _SINCE_1970.items() if middle >= least)
    return numbers * TIME_UNITS[unit], None


def to_ids(values: Series, where: Path) -> Series:
    """The ids in a column of `values` as whole numbers; null where one is missing or no whole number.

    Where most are no numbers, each text gets a number, the same in every file: 53 bits of a hash, so that two
    of 100,000 people share one with a probability below 1e-6.  Raises DataError, beginning with `where`, if
    two texts are one number.
    """
    if values.dtype.is_nested():
        return pl.repeat(None, len(values), dtype=Int64, eager=True)
    if not values.dtype.is_numeric():
        values = values.cast(String).str.strip_chars(" \"'")
        values = values.set(values.str.to_lowercase().is_in(_NO_IDS), None)
    number = values.cast(Float64, strict=False)
    if values.dtype == String and 2 * number.count() < values.count():
        names = values.drop_nulls().unique()
        for name in names.filter(names.str.contains("\ufffd")):
            raise DataError(f"{where}: the id {name!r} is not UTF-8; save it as UTF-8")
        hashes = pd.util.hash_array(names.to_numpy().astype(object), categorize=False)
        numbers = (hashes >> _DROPPED_BITS).astype("int64")
        return values.replace_strict(names, Series(numbers), default=None)
    is_whole = (number == number.floor()) & (number.abs() < _LARGEST_EXACT)
    whole = number.set(~is_whole, None).cast(Int64, strict=False)
    if not values.dtype.is_float():
        whole = values.cast(Int64, strict=False).fill_null(whole)
    if values.dtype == String:
        known = pl.DataFrame({"text": values, "id": whole}).drop_nulls().unique()
        alike = known.filter(col.id.is_duplicated()).sort("id", "text")["text"]
        if len(alike):
            raise DataError(
                f"{where}: the ids {alike[0]!r} and {alike[1]!r} are the same number; write them alike if "
                f"they are one person, else as names, such as 'p{alike[0]}' and 'p{alike[1]}'"
            )
    return whole
