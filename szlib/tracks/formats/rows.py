"""Rows of a file: why some cannot be used, and the others in seconds and metres, under their day."""

from __future__ import annotations

from pathlib import Path

import polars as pl

from ...errors import DataError
from .layouts import Format

_LAST_SECOND = 4_102_444_800.0
"""2100-01-01; later time stamps are not seconds since 1970."""
_FARTHEST = 2e7
"""Farther [m] from the origin of any grid is no place on Earth."""
CALENDAR_BEGINS = 1e8
"""A clock that has not come so far (1973) does not count from 1970: it tells no calendar day."""
_MINUTES = 24 * 60
"""Of a day."""


def in_metres(good: pl.DataFrame, path: Path, layout: Format, metres: float, tz: str) -> pl.DataFrame:
    """Usable rows as day, id, t [s], x, y [m]."""
    if "day" not in good.columns:
        # the name stands for the day where frames are counted, or seconds since some other moment than 1970
        last = good["t"].max()
        named = layout.name == "ewap" or (isinstance(last, float) and last * layout.seconds < CALENDAR_BEGINS)
        try:
            good = good.with_columns(day=pl.lit(stem(path)) if named else _calendar_day(good["t"], tz))
        except pl.exceptions.PolarsError as error:
            raise DataError(f"unknown time zone {tz!r} ({error}); expected one like 'Asia/Tokyo'") from error
    return good.select(
        "day",
        pl.col("id").cast(pl.Int64),
        *(
            pl.col(name) if unit == 1 else pl.col(name) * unit
            for name, unit in (("t", layout.seconds), ("x", metres), ("y", metres))
        ),
    )


def faults(metres: float, seconds: float, with_day: bool) -> dict[str, pl.Expr]:
    """Why a row cannot be used: reasons, and where each holds; the first one counts."""
    limit, person = limits(metres, seconds), pl.col("id")
    numbers = list(limit)
    beyond = {name: pl.col(name).abs() * unit > most for name, (unit, most) in limit.items()}
    found = {
        "missing or extra fields": pl.col("ragged"),
        "missing or not a number": pl.any_horizontal(pl.col(numbers).is_null()),
        "not finite": ~pl.all_horizontal(pl.col(numbers).is_finite()),
        "id not a whole number": (person != person.floor()) | beyond["id"],
        "time not in seconds since 1970": beyond["t"],
        "position not on Earth": beyond["x"] | beyond["y"],
    }
    return found | ({"no day": pl.col("day").is_null()} if with_day else {})


def limits(metres: float, seconds: float) -> dict[str, tuple[float, float]]:
    """Of each number of a row: its unit, in s, 1 or m, and how far from 0 it may be, in these."""
    place = (metres, _FARTHEST)
    return {"t": (seconds, _LAST_SECOND), "id": (1.0, 2.0**53), "x": place, "y": place}


def fault(metres: float, seconds: float, with_day: bool) -> pl.Expr:
    """Why a row cannot be used; null where it can."""
    reasons = faults(metres, seconds, with_day).items()
    return pl.coalesce(pl.when(holds).then(pl.lit(reason)) for reason, holds in reasons)


def stem(path: Path) -> str:
    """A file's name without its endings."""
    return path.name.split(".")[0]


def _calendar_day(t: pl.Series, tz: str) -> pl.Series | pl.Expr:
    """The local date of each time [s since 1970]; looked up once where every minute has the same."""
    first, last = (int(moment) // 60 for moment in (t.min(), t.max()))  # type: ignore[arg-type]
    if last - first < _MINUTES:
        days = _local_date(pl.Series(range(60 * first, 60 * last + 1, 60)), tz).unique()
        if len(days) == 1:
            return pl.lit(days[0])
    return _local_date(t.floor().cast(pl.Int64), tz)


def _local_date(t: pl.Series, tz: str) -> pl.Series:
    return pl.from_epoch(t, time_unit="s").dt.convert_time_zone(tz).dt.date()
