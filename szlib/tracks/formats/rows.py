"""Rows of a file: why some are rejected; the others in seconds and metres, with their day."""

from __future__ import annotations

from pathlib import Path

import polars as pl

from ...errors import DataError
from .base import TrackFormat

_LAST_SECOND = 4_102_444_800.0
"""2100-01-01; later time stamps are not seconds since 1970."""
_FARTHEST = 2e7
"""Farther [m] from the origin of any grid is no place on Earth."""
CALENDAR_BEGINS = 1e8
"""A clock that stays below this (1973) does not count from 1970, and gives no calendar day."""
_MINUTES_PER_DAY = 24 * 60


def to_metres(good: pl.DataFrame, path: Path, layout: TrackFormat, tz: str) -> pl.DataFrame:
    """Convert the `good` rows of file `path`, in units of `layout`, to day, id, t [s], x, y [m].

    The day is the date in time zone `tz`, or the file's name where its clock does not count from 1970.
    """
    if "day" not in good.columns:
        last = good["t"].max()
        is_named = layout.is_sequence or (isinstance(last, float) and last * layout.seconds < CALENDAR_BEGINS)
        try:
            good = good.with_columns(day=pl.lit(file_stem(path)) if is_named else _find_days(good["t"], tz))
        except pl.exceptions.PolarsError as error:
            raise DataError(f"unknown time zone {tz!r} ({error}); expected one like 'Asia/Tokyo'") from error
    return good.select(
        "day",
        pl.col("id").cast(pl.Int64),
        *(
            pl.col(name) if unit == 1 else pl.col(name) * unit
            for name, unit in (("t", layout.seconds), ("x", layout.metres), ("y", layout.metres))
        ),
    )


def rejection_reason(metres: float, seconds: float, has_day: bool) -> pl.Expr:
    """Why a row is rejected; null where it is usable.

    `metres` and `seconds` are the units of position and time, `has_day` whether rows have a column day.
    """
    limit, person = value_limits(metres, seconds), pl.col("id")
    numbers = list(limit)
    beyond = {name: pl.col(name).abs() * unit > most for name, (unit, most) in limit.items()}
    reasons = {
        "missing or extra fields": pl.col("ragged"),
        "missing or not a number": pl.any_horizontal(pl.col(numbers).is_null()),
        "not finite": ~pl.all_horizontal(pl.col(numbers).is_finite()),
        "id not a whole number": (person != person.floor()) | beyond["id"],
        "time not in seconds since 1970": beyond["t"],
        "position not on Earth": beyond["x"] | beyond["y"],
    }
    if has_day:
        reasons["no day"] = pl.col("day").is_null()
    return pl.coalesce(pl.when(holds).then(pl.lit(reason)) for reason, holds in reasons.items())


def value_limits(metres: float, seconds: float) -> dict[str, tuple[float, float]]:
    """Unit [s, 1 or m] and greatest magnitude [s, 1 or m] of t, id, x and y, in `metres` and `seconds`."""
    place = (metres, _FARTHEST)
    return {"t": (seconds, _LAST_SECOND), "id": (1.0, 2.0**53), "x": place, "y": place}


def file_stem(path: Path) -> str:
    """The name of file `path` without its endings."""
    return path.name.split(".")[0]


def _find_days(t: pl.Series, tz: str) -> pl.Series | pl.Expr:
    """The local date of each time [s since 1970]; a single one where all minutes have the same date."""
    first, last = (int(moment) // 60 for moment in (t.min(), t.max()))  # type: ignore[arg-type]
    if last - first < _MINUTES_PER_DAY:
        days = _local_date(pl.Series(range(60 * first, 60 * last + 1, 60)), tz).unique()
        if len(days) == 1:
            return pl.lit(days[0])
    return _local_date(t.floor().cast(pl.Int64), tz)


def _local_date(t: pl.Series, tz: str) -> pl.Series:
    return pl.from_epoch(t, time_unit="s").dt.convert_time_zone(tz).dt.date()
