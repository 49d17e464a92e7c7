"""Which column of a table holds what, and its values as numbers, times and ids.

Columns are found by the names given, by usual names, or by how people would walk.
"""

from __future__ import annotations

import re
import tomllib
import unicodedata
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import polars as pl

from ..core.errors import DataError
from .plausibility import suggest_columns
from .recipe import DEGREES, PIXELS, TIME_UNITS, Recipe, advise
from .sources import Source

# Usual names of columns and units.
_NAMES = tomllib.loads(Path(__file__).with_name("names.toml").read_text("utf-8"))
_CLOCK = re.compile(r"(time|sec|stamp|frame|zeit|hour|minute)")  # in names of times
_LONGEST_SHARE = (
    5  # people have so many rows under each value that tells recordings apart
)
_FRAMES = 25.0  # a usual frame rate [1/s], to find columns
_LISTED = 40  # number of columns that are looked at
_PIXEL = 0.02  # metres in a pixel that an error message shows as an example
_TRIED = 8  # number of columns that are tried out, with those that are known
_SAMPLE = 2000  # rows in which columns are guessed

# Times without a unit whose median is larger count in this unit since 1970: as seconds they would be
# later than the year 5000.
_SINCE_1970 = {1e17: "ns", 1e14: "us", 1e11: "ms"}
_DATE = r"^(?:19|20)\d{2}-\d{2}-\d{2}"  # beginning of an ISO time
_ZONE = r"(?:Z|[+-]\d{2}:?\d{2})$"  # end of an ISO time that states its zone
_EXCEL_1970 = 25_569  # number of the day 1970-01-01 in Excel
_SHORT = 11  # bits of a hash that are left out: a float holds the others exactly
_EXACT = 2.0**53  # floats hold smaller whole numbers exactly


def find_columns(source: Source, recipe: Recipe) -> Recipe:
    """Complete a `recipe` with the columns of a `source`, and with the units that their names state.

    Raises
    ------
    DataError : a column is missing, doubled or ambiguous, frames have no rate, pixels no scale, degrees no
        origin; it says which columns look like what.
    """
    names, where = source.names, source.where + source.head
    given = dict(recipe.columns or {})
    for k in given.values():
        if isinstance(k, int) and not 0 <= k < len(names):
            raise DataError(
                f"{where} has no field {k}; it has {len(names)}, the first is 0"
            )
    at = {
        quantity: _candidates(quantity, given, names) for quantity in _NAMES["columns"]
    }
    is_free = "t" not in given and bool(at["frame"])
    is_frame = is_free and (not at["t"] or recipe.frame_rate is not None)
    time = "frame" if "frame" in given or is_frame else "t"
    needed = [time, "id", "x", "y", *(["day"] if at["day"] else [])]
    for quantity in needed:
        same = sorted(map(str, set(at[quantity])))
        if len(same) > 1:
            advice = advise(columns={**given, quantity: at[quantity][0]})
            raise DataError(
                f"{where}: {', '.join(same)} can all be {quantity}; {advice}"
            )
        if len(at[quantity]) > 1:
            raise DataError(f"{where} names {same[0]} twice; rename one of them")
    found = given | {quantity: at[quantity][0] for quantity in needed if at[quantity]}
    if missing := [quantity for quantity in needed if quantity not in found]:
        known = ", ".join(map(repr, [n or k for k, n in enumerate(names)][:12]))
        advice = suggest_reading(source, replace(recipe, columns=found or None))
        columns = given | dict.fromkeys(missing, "...")
        advice = advice or f"it has {known}; {advise(columns=columns)}"
        raise DataError(f"{where} has no column {', '.join(missing)}; {advice}")
    keys = {q: _split_unit(at) for q, at in found.items() if at in names}
    units = {_NAMES["units"].get(keys[c][1]) if c in keys else None for c in "xy"}
    if all(
        c in keys and keys[c][0] in _NAMES["kinds"]["degrees"].split() for c in "xy"
    ):
        units = {DEGREES}
    recipe = Recipe(columns=found).over(recipe)
    clock = _NAMES["time_units"].get(keys.get("t", ("", ""))[1])
    if clock and not recipe.time_unit and recipe.frame_rate is None:
        recipe = replace(recipe, time_unit=clock)
    if not (recipe.unit or recipe.has_places) and len(units) == 1:
        recipe = replace(recipe, unit=units.pop())
    _require_known(where, recipe)
    return recipe


def _require_known(where: str, recipe: Recipe) -> None:
    """Raise DataError where frames have no rate, times have one, or pixels no scale."""
    columns, guesses, missing = dict(recipe.columns or {}), dict[str, object](), []
    if "t" in columns and recipe.frame_rate is not None:
        raise DataError(
            f"{where}: its times are in seconds; leave frame_rate out, or name the column that counts "
            f"frames: {advise(columns={'frame': columns['t']})}"
        )
    if "frame" in columns and recipe.frame_rate is None:
        guesses["frame_rate"] = _FRAMES
        missing.append(
            f"{columns['frame']!r} counts frames; pass frame_rate=, frames a second of the video"
        )
    if recipe.unit == PIXELS and not recipe.has_places:
        guesses["scale"] = _PIXEL
        missing.append(
            "positions are in pixels; pass scale=, metres in a pixel, or homography=, 3 x 3 numbers that map "
            "pixels to the floor"
        )
    if missing:
        numbers = " and ".join(f"{value:g}" for value in guesses.values())
        verb = "are only guesses" if len(guesses) > 1 else "is only a guess"
        raise DataError(
            f"{where}: {'; '.join(missing)}; {numbers} {verb}: {advise(**guesses)}"
        )


def column_of(source: Source, at: str | int) -> pl.Series:
    """The column of a `source` `at` a number or a name; or the sum of columns that it says, in SQL."""
    if isinstance(at, int):
        return source.column(at)
    if at in source.names:
        return source.column(source.names.index(at))
    known = {name or f"f{k}": k for k, name in enumerate(source.names)}
    try:
        sum_ = pl.sql_expr(at)
        roots = sum_.meta.root_names()
        if not roots or not set(roots) <= known.keys():
            raise DataError(
                f"{source.where} has no column {at}; it has {list(known)[:12]}"
            )
        columns = {root: source.column(known[root]) for root in roots}
        if not re.search(r"\|\||'", at):
            columns = {k: to_numbers(v, source.decimal) for k, v in columns.items()}
        return pl.DataFrame(columns).select(sum_.alias("c")).to_series()
    except pl.exceptions.PolarsError as error:
        raise DataError(
            f"{source.where} has no column {at}, and it is no sum of columns ({error})"
        ) from error


def ask_about_recordings(
    source: Source, recipe: Recipe, rows: pl.DataFrame, *, by_name: bool
) -> None:
    """Raise DataError where a column of `source` that the `recipe` does not use tells recordings apart.

    Such a column has few values, and changes where people are at one time twice, or go back in time.  With
    `by_name` one is also asked about if it has a usual name, and people are seen under several of its values.
    `rows` has id and t of all rows.
    """
    step = pl.col("t").diff()
    is_mixed = rows.select((step.over("id") <= 0).any()).item()
    columns = recipe.columns or {}
    used = " ".join(map(str, columns.values()))
    for k, name in enumerate(source.names):
        key = _split_unit(name)[0]
        is_usual = by_name and key in _NAMES["kinds"]["recordings"].split()
        if (name or f"f{k}") in used or k in columns.values() or _CLOCK.search(key):
            continue
        if not (is_mixed or is_usual):
            continue
        table = rows.select("id", "t", c=source.column(k).cast(pl.String))
        n_pieces = table.select("id", "c").n_unique()
        if table["c"].n_unique() < 2 or n_pieces * _LONGEST_SHARE > len(rows):
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
    letters = unicodedata.normalize("NFKD", str(name).casefold())
    words = re.findall(r"[^\W_]+", letters)
    units = _NAMES["units"] | _NAMES["time_units"]
    has_unit = len(words) > 1 and words[-1] in units
    unit = words.pop() if has_unit else ""
    return "".join(words), unit


def _candidates(
    quantity: str, given: Mapping[str, str | int], names: Sequence[str]
) -> list[str | int]:
    """The columns that can hold a quantity: the one given, those with its name, or with a usual one."""
    at = given.get(quantity, quantity)
    if same := [name for name in names if name == at]:
        return list(same)
    if quantity in given:
        is_sum = isinstance(at, int) or re.search(r"[-+*/|(]", at)
        return [at] if is_sum else []
    usual = {_split_unit(each)[0] for each in _NAMES["columns"][quantity].split()}
    return [name for name in names if _split_unit(name)[0] in usual]


def suggest_reading(source: Source, recipe: Recipe) -> str:
    """As which columns of a `source` people would walk, and how to read them; empty where there are none.

    The columns in the `recipe` are taken as they are.  A constant column is none of the others.
    """
    found = recipe.columns or {}
    quantities = ("frame" if "frame" in found else "t", "id", "x", "y")
    given = [found[quantity] for quantity in quantities if quantity in found]
    others = (
        [name or k for k, name in enumerate(source.names)] if len(given) < 4 else []
    )
    columns = dict[str | int, np.ndarray]()
    for at in dict.fromkeys([*given, *others[:_LISTED]]):
        unit = recipe.time_unit if at == found.get("t") else None
        numbers = _as_floats(column_of(source, at).head(_SAMPLE), unit)
        usable = numbers[np.isfinite(numbers)]
        is_varied = 2 * len(usable) > len(numbers) and np.ptp(usable) > 0
        if at in given or (is_varied and len(columns) < _TRIED):
            columns[at] = numbers
    shown = list(columns)
    known = [shown.index(found[q]) if q in found else None for q in quantities]
    values = np.array(list(columns.values()))
    return suggest_columns(values, shown, known, recipe) if shown else ""


def _as_floats(values: pl.Series, unit: str | None) -> np.ndarray:
    """A column as floats, whatever it holds: numbers, times, or texts of which each gets a number."""
    for decimal in ".,":
        times = to_times(values, "UTC", unit, decimal)[0]
        if 2 * times.null_count() <= len(values):
            return times.fill_null(np.nan).to_numpy()
    return to_ids(values, "").cast(pl.Float64).fill_null(np.nan).to_numpy()


# --- values -------------------------------------------------------------------------------------------


def to_numbers(values: pl.Series, decimal: str = ".") -> pl.Series:
    """The numbers in a column of `values`; null where one is no number.  `decimal` is the point of texts."""
    if values.dtype == pl.String:
        values = values.str.strip_chars(" \"'").str.replace(decimal, ".", literal=True)
    try:
        return values.cast(pl.Float64, strict=False)
    except pl.exceptions.PolarsError:  # a list, an object
        return pl.repeat(None, len(values), dtype=pl.Float64, eager=True)


def to_times(
    values: pl.Series, tz: str, unit: str | None = None, decimal: str = "."
) -> tuple[pl.Series, pl.Series | None]:
    """The times in a column of `values`: numbers with a point `decimal`, dates, durations, ISO texts.

    Numbers are in a `unit` of time; None takes seconds, or a shorter unit for counts since 1970.  Times
    without a zone are those of `tz`.  Returns seconds, since 1970 where times are dates; and the local date
    of each where the column states its zone, else None.
    """
    numbers, day = to_numbers(values, decimal), None
    if values.dtype == pl.String and 2 * numbers.null_count() > len(values):
        text = values.str.strip_chars(" \"'")
        dates = text.set(~text.str.contains(_DATE).fill_null(False), None).to_pandas()
        parsed = pd.to_datetime(dates, format="ISO8601", utc=True, errors="coerce")
        has_zone = text.str.contains(_ZONE).fill_null(False).to_numpy()
        zone = "UTC" if has_zone.any() else None
        if zone:
            parsed = parsed.where(has_zone)
            day = text.str.slice(0, 10).str.to_date("%Y-%m-%d", strict=False)
        if parsed.notna().any():
            values = pl.Series(parsed).dt.replace_time_zone(zone)
    elif unit == "days" and not values.dtype.is_temporal():
        ms = ((numbers - _EXCEL_1970) * 86_400_000).round()
        values = ms.cast(pl.Int64, strict=False).cast(pl.Datetime("ms"))
    if values.dtype == pl.Duration:
        return values.dt.total_nanoseconds() / 1e9, None
    if isinstance(values.dtype, pl.Datetime | pl.Date):
        moments = values.cast(
            pl.Datetime("ns", getattr(values.dtype, "time_zone", None))
        )
        if moments.dtype.time_zone is None:  # type: ignore[attr-defined]
            moments = moments.dt.replace_time_zone(
                tz, ambiguous="null", non_existent="null"
            )
        elif day is None:
            day = moments.dt.date()
        return moments.dt.epoch("ns") / 1e9, day
    middle = numbers.drop_nans().abs().quantile(0.5) or 0.0
    usual = next((name for least, name in _SINCE_1970.items() if middle >= least), "s")
    return numbers * TIME_UNITS[unit or usual], None


def to_ids(values: pl.Series, where: str) -> pl.Series:
    """The ids in a column of `values` as whole numbers; null where one is missing or no whole number.

    Where most are no numbers, each text gets a number, the same in every file: 53 bits of a hash, so that two
    of 100,000 people share one with a probability below 1e-6.  Raises DataError, beginning with `where`, if
    two texts are one number.
    """
    if values.dtype.is_nested():
        return pl.repeat(None, len(values), dtype=pl.Int64, eager=True)
    if not values.dtype.is_numeric():
        values = values.cast(pl.String).str.strip_chars(" \"'")
        values = values.set(values == "", None)
    number = values.cast(pl.Float64, strict=False)
    if values.dtype == pl.String and 2 * number.count() < values.count():
        names = values.drop_nulls().unique()
        hashes = pd.util.hash_array(names.to_numpy().astype(object), categorize=False)
        numbers = pl.Series((hashes >> _SHORT).astype("int64"))
        return values.replace_strict(names, numbers, default=None)
    is_whole = (number == number.floor()) & (number.abs() < _EXACT)
    whole = number.set(~is_whole, None).cast(pl.Int64, strict=False)
    if not values.dtype.is_float():
        whole = values.cast(pl.Int64, strict=False).fill_null(whole)
    if values.dtype == pl.String:
        known = pl.DataFrame({"text": values, "id": whole}).drop_nulls().unique()
        alike = known.filter(pl.col("id").is_duplicated()).sort("id", "text")["text"]
        if len(alike):
            raise DataError(
                f"{where}: the ids {alike[0]!r} and {alike[1]!r} are the same number; write them alike if "
                f"they are one person, else as names, such as 'p{alike[0]}' and 'p{alike[1]}'"
            )
    return whole
