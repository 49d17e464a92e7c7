"""The values of a table as numbers: decimal commas, times of any kind, ids that are text."""

from __future__ import annotations

from typing import Any, NamedTuple

import pandas as pd
import polars as pl

from ..core.errors import DataError
from .recipe import TIME_UNITS

# Times without a unit that are larger than this are counts since 1970, in units of so many seconds: as
# seconds they would be later than the year 5000.
_SINCE_1970 = {
    1e17: ("nanoseconds", 1e-9),
    1e14: ("microseconds", 1e-6),
    1e11: ("milliseconds", 1e-3),
}
_DATE = r"^(?:19|20)\d{2}-\d{2}-\d{2}"  # beginning of an ISO time
_ZONE = r"(?:Z|[+-]\d{2}:?\d{2})$"  # end of an ISO time that states its zone
_EXCEL_1970 = 25_569  # number of the day 1970-01-01 in Excel
_SHORT = 11  # bits of a hash that are left out: a float holds the others exactly


class Times(NamedTuple):
    """Times of a table.

    Attributes
    ----------
    seconds : the times [s], since 1970 where they are dates.
    day : local date of each in the zone that the table states; None where it states none.
    kind : what the times were, for people; empty for seconds.
    """

    seconds: pl.Series
    day: pl.Series | None
    kind: str


def to_numbers(values: pl.Series, decimal: str = ".") -> pl.Series:
    """The numbers in a column of `values`; null where one is no number.  `decimal` is the point of texts."""
    if values.dtype == pl.String:
        values = values.str.strip_chars(" \"'")
        values = (
            values.str.replace(",", ".", literal=True) if decimal == "," else values
        )
    try:
        return values.cast(pl.Float64, strict=False)
    except pl.exceptions.PolarsError:  # a list, an object
        return pl.repeat(None, len(values), dtype=pl.Float64, eager=True)


def to_times(values: pl.Series, tz: str, decimal: str = ".") -> Times:
    """The times in a column of `values`: numbers with a point `decimal`, dates, durations, ISO texts.

    Without a zone they are those of `tz`.
    """
    if values.dtype == pl.Duration:
        return Times(values.dt.total_nanoseconds() / 1e9, None, "durations")
    if values.dtype == pl.String and 2 * (
        numbers := to_numbers(values, decimal)
    ).null_count() > len(values):
        text = values.str.strip_chars(" \"'")
        has_zone = text.str.contains(_ZONE).fill_null(False)
        dates = text.set(~text.str.contains(_DATE).fill_null(False), None).to_pandas()
        parsed = pd.to_datetime(dates, format="ISO8601", utc=True, errors="coerce")
        if not parsed.notna().any():
            return Times(numbers, None, "")
        if has_zone.any():
            day = text.str.slice(0, 10).str.to_date("%Y-%m-%d", strict=False)
            return Times(
                _since_1970(parsed.where(has_zone.to_numpy())),
                day,
                "ISO times with a zone",
            )
        return Times(
            _since_1970(_localize(parsed.dt.tz_localize(None), tz)),
            None,
            f"ISO times in {tz}",
        )
    if not isinstance(values.dtype, pl.Datetime | pl.Date):
        return _scale(to_numbers(values, decimal))
    dates = values.cast(
        pl.Datetime("ns", getattr(values.dtype, "time_zone", None))
    ).to_pandas()
    if dates.dt.tz is None:
        return Times(_since_1970(_localize(dates, tz)), None, f"times in {tz}")
    return Times(
        _since_1970(dates),
        values.dt.replace_time_zone(None).dt.date(),
        f"times in {dates.dt.tz}",
    )


def to_ids(values: pl.Series) -> pl.Series:
    """The ids in a column of `values`: as they are, or, where most are no numbers, a number for each text.

    A text has the same number in every file: 53 bits of a hash, so that two of 100,000 people share one
    with a probability below 1e-6.
    """
    if values.dtype.is_numeric():
        return values
    text = values.cast(pl.String).str.strip_chars(" \"'")
    text = text.set(text == "", None)
    if (
        2 * text.cast(pl.Float64, strict=False).null_count()
        <= len(text) + text.null_count()
    ):
        return text
    names = text.drop_nulls().unique()
    numbers = (
        pd.util.hash_array(names.to_numpy().astype(object), categorize=False) >> _SHORT
    )
    return text.replace_strict(names, pl.Series(numbers.astype("int64")), default=None)


def require_distinct_ids(ids: pl.Series, where: str) -> None:
    """Raise DataError, beginning with `where`, if two of `ids` that differ as texts are one number."""
    if ids.dtype != pl.String:
        return
    known = pl.DataFrame({"text": ids.drop_nulls().unique().sort()})
    whole = pl.col("text").cast(pl.Int64, strict=False)
    number = pl.col("text").cast(pl.Float64, strict=False)
    other = pl.when(number == number.floor()).then(number).cast(pl.Int64, strict=False)
    number = pl.coalesce(whole, other)
    alike = known.with_columns(number=number).drop_nulls()
    alike = alike.filter(pl.col("number").is_duplicated()).sort("number", "text")
    if alike.height:
        one, other = alike["text"].head(2)
        raise DataError(
            f"{where}: the ids {one!r} and {other!r} are the same number; write them alike if they are one "
            f"person, else as names, such as 'p{one}' and 'p{other}'"
        )


def scale_times(values: pl.Series, unit: str, tz: str, decimal: str = ".") -> Times:
    """The times in a column of `values`, numbers with a point `decimal`, in a `unit` of time.

    Days are those of Excel, in time zone `tz`.
    """
    numbers = to_numbers(values, decimal)
    if unit != "days":
        return Times(
            numbers * TIME_UNITS[unit] if unit != "s" else numbers,
            None,
            f"times in {unit}",
        )
    milliseconds = (
        ((numbers - _EXCEL_1970) * 86_400_000).round().cast(pl.Int64, strict=False)
    )
    local = milliseconds.cast(pl.Datetime("ms")).dt.cast_time_unit("ns").to_pandas()
    return Times(_since_1970(_localize(local, tz)), None, f"days of Excel in {tz}")


def _scale(numbers: pl.Series) -> Times:
    """Times without a unit: seconds, or counts of something shorter since 1970."""
    middle = numbers.drop_nans().abs().median()
    for least, (kind, seconds) in _SINCE_1970.items():
        if isinstance(middle, float) and middle >= least:
            return Times(numbers * seconds, None, f"{kind} since 1970")
    return Times(numbers, None, "")


def _localize(times: Any, tz: str) -> Any:
    """Times of the clock in `tz`; those that its changes make ambiguous are missing."""
    return times.dt.tz_localize(tz, ambiguous="NaT", nonexistent="NaT")


def _since_1970(times: Any) -> pl.Series:
    """Times with a zone as seconds since 1970; null where they are missing."""
    return pl.Series(
        ((times - pd.Timestamp(0, tz="UTC")).dt.total_seconds()).to_numpy()
    ).fill_nan(None)
