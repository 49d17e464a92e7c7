"""Files of tracks as they are: one sorted table day, id, t, x, y in seconds and metres.

Rows that cannot be used are rejected, and counted by reason in the funnel of each file and in a DataWarning.
A file that cannot be used raises a DataError that names the file and the line.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from math import ceil
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import polars as pl

from ..core.errors import DataError, warn
from ..core.input_files import printable
from . import funnels
from .plausibility import (
    MOST_SHOWN,
    check_people,
    check_unit,
    describe_rows,
    find_implausible,
    first_rows,
    is_table_known,
    suggest_reading,
)
from .recipe import Recipe, advise, find_recipe
from .rows import (
    EXPECTED,
    FARTHEST,
    LAST_SECOND,
    Rows,
    load_rows,
    open_source,
    scan_streamed,
)
from .shapes import SHAPES, require_format
from .sources import is_table, open_table, require_memory, unpacked

# why a row is rejected
MISSING, NO_ID = "missing or not a number", "id not a whole number"
MAX_REJECTED = 0.05
"""Share of the rows of a file that may be unusable, unless a `Recipe` gives another (assumed)."""
_SCANNED = (
    2  # bytes of memory for each of a text that is scanned (measured: 1.3 to 1.9)
)
MOST_DOUBLED = 0.2
"""Share of rows up to which a person may have a second place at one time (assumed)."""
# A clock that stays below this (1973) does not count from 1970, and gives no calendar day.
CALENDAR_BEGINS = 1e8
_DAY, _MINUTE = 86_400, 60  # [s]
_HEAD = 1 << 16  # bytes of a text by which its day is found

# A person who is in two files walks from one place to the other at most this fast [m/s], give or take this
# distance [m]; pairs of rows that are farther apart than this time [s] are not compared.
_FASTEST, _BLUR, _SOON = 5.0, 0.5, 5.0


class LoadedFile(NamedTuple):
    """A file that has been read.

    Attributes
    ----------
    path : the file.
    rows : its usable rows: day, id, t [s], x, y [m].
    stages : its funnel.
    recipe : how it was read, with its columns.
    """

    path: Path
    rows: pl.DataFrame
    stages: list[dict[str, Any]]
    recipe: Recipe

    @property
    def is_sequence(self) -> bool:
        """Whether each file of this shape is a recording of its own, without a calendar."""
        return SHAPES[self.recipe.file_format or "tidy"].is_sequence

    def with_day(self, day: pl.Expr) -> LoadedFile:
        """The same rows under another `day`."""
        return self._replace(rows=self.rows.with_columns(day=day))


Select = Callable[[pl.DataFrame, str | None, float | None], pl.DataFrame]
"""The needed rows of some, given their area and the longest gap within a track [s]."""


def read_raw(
    paths: Any,
    *,
    recipe: Recipe | None = None,
    exclude: Iterable[str] = (),
    select: Select | None = None,
) -> pd.DataFrame:
    """Read files as they are: day, id, t [s], x, y [m], sorted, without duplicates.

    Parameters
    ----------
    paths : as in `szlib.read_tracks`.
    recipe : how files are read; None takes that beside the files, or finds one.
    exclude : days "YYYY-MM-DD" to leave out.
    select : a function of the rows, their area and longest gap [s], that gives those that are needed.

    Returns
    -------
    A table for `to_clock`.  ``.attrs["max_gap"]`` is the longest gap [s] of the format, ``.attrs["funnel"]``
    counts every row, and states the frame rate; ``.attrs["recipe"]`` says how the first file was read.

    Raises
    ------
    DataError : as in `szlib.read_tracks`.

    Examples
    --------
    >>> from pathlib import Path
    >>> from szlib.tracks import read_raw
    >>> _ = Path("walk.csv").write_text("t,id,x,y\\n0.0,1,0.0,0.0\\n0.4,1,0.5,0.0\\n")
    >>> read_raw("walk.csv")
        day  id    t    x    y
    0  walk   1  0.0  0.0  0.0
    1  walk   1  0.4  0.5  0.0
    """
    sources = (
        [paths] if isinstance(paths, str | Path) or is_table(paths) else list(paths)
    )
    excluded = [exclude] if isinstance(exclude, str) else sorted(map(str, exclude))
    if not sources:
        raise DataError("no track file was given; pass at least one path")
    recipe = find_recipe(sources, recipe)
    names = (
        Path(f"table-{k}") if is_table(each) else Path(each)
        for k, each in enumerate(sources, start=1)
    )
    files = [
        _read_file(source, path, recipe)
        for source, path in zip(sources, names, strict=True)
    ]
    return merge(separate_recordings(files), excluded, select)


def merge(
    files: Sequence[LoadedFile],
    excluded: Sequence[str] = (),
    select: Select | None = None,
) -> pd.DataFrame:
    """Merge the rows of `files` into one table as from `read_raw`: sorted, without duplicates.

    Days `excluded` are left out, and rows that `select` leaves out.
    """
    parts = [file.rows for file in files]
    if len({part.schema["day"] for part in parts}) > 1:
        parts = [part.with_columns(pl.col("day").cast(pl.String)) for part in parts]
    merged = pl.concat(parts)
    wanted = (
        merged.filter(~pl.col("day").cast(pl.String).is_in(excluded))
        if excluded
        else merged
    )
    gaps = [file.recipe.max_gap for file in files if file.recipe.max_gap is not None]
    max_gap = max(gaps) if len(gaps) == len(files) else None
    areas = {file.recipe.area for file in files}
    area = areas.pop() if len(areas) == 1 else None
    near = wanted if select is None else select(wanted, area, max_gap)
    keys = ["day", "id", "t"]
    rows = _sort(near)
    again = pl.all_horizontal(pl.col(keys).eq_missing(pl.col(keys).shift()))
    elsewhere = again & pl.any_horizontal(pl.col("x", "y").diff() != 0)
    if rows.select(again.any()).item():
        if (n := rows.select(elsewhere.sum()).item()) > MOST_DOUBLED * rows.height:
            names = ", ".join(printable(file.path.name) for file in files[:3])
            raise DataError(
                f"{names}: {n:,} of {rows.height:,} rows give a person a second place at one time; name the "
                "column of the recording, as columns={'day': ...}, or one with the whole time: seconds "
                "without their fraction are not enough"
            )
        rows = rows.filter(~again)
    doubled = {"duplicate (day, id, t)": near.height - rows.height}
    _warn_rejected("all files", doubled)
    if rows.height == 0:
        raise DataError(
            f"all {merged.height} rows lie on excluded days {excluded}; check `exclude`"
        )
    frame = pd.DataFrame(
        {name: rows[name].to_numpy() for name in ("id", "t", "x", "y")}
    )
    days = rows["day"].unique().sort()
    codes = (
        rows["day"]
        .replace_strict(days, range(len(days)), return_dtype=pl.Int32)
        .to_numpy()
    )
    names = pd.Index(days.cast(pl.String).to_list())
    frame.insert(0, "day", pd.Series(pd.Categorical.from_codes(codes, names)))
    frame.attrs["max_gap"] = max_gap
    if area is not None:
        frame.attrs["area"] = area
    frame.attrs["recipe"] = files[0].recipe.as_json()
    far = {"never near the area": wanted.height - near.height}
    reasons = {"excluded day": merged.height - wanted.height, **far, **doubled}
    stages = [stage for file in files for stage in file.stages]
    for text in find_implausible(rows):
        warn(f"{', '.join(file.path.name for file in files[:3])}: {text}")
        stages.append(
            funnels.stage(f"{funnels.WARNING}{text}", merged.height, merged.height, {})
        )
    return funnels.attach(
        frame,
        [*stages, funnels.stage("merge files", merged.height, rows.height, reasons)],
    )


def _sort(rows: pl.DataFrame) -> pl.DataFrame:
    """Rows by day, id and t; rows of one day in the order of time are sorted by person only."""
    if rows.height and rows["day"].n_unique() == 1:
        if is_sorted(rows["id"].to_numpy(), rows["t"].to_numpy()):
            return rows
        if rows["t"].is_sorted():
            return rows[order_by_person(rows["id"].to_numpy())]
    return rows.sort("day", "id", "t", maintain_order=True)


def order_by_person(person: np.ndarray) -> np.ndarray:
    """The stable order of rows by `person`, in linear time for up to 65,536 people."""
    number, people = pd.factorize(person, sort=True)
    return np.argsort(number.astype(np.min_scalar_type(len(people))), kind="stable")


def is_sorted(person: np.ndarray, time: np.ndarray) -> bool:
    """Whether rows are in the order of `person`, then `time`."""
    same = person[1:] == person[:-1]
    return bool(((person[1:] > person[:-1]) | (same & (time[1:] >= time[:-1]))).all())


def _read_file(source: Any, path: Path, recipe: Recipe) -> LoadedFile:
    """The usable rows of one file or table."""
    if not is_table(source):
        with unpacked(path) as plain:
            if streamed := scan_streamed(plain, path, recipe):
                found, scan = streamed
                require_memory(plain.stat().st_size, f"{path}", _SCANNED)
                return _accept(Rows(scan.collect(), found), path, recipe)
            rows = load_rows(*open_source(plain, path, recipe), path)
            return _accept(rows, path, recipe)
    if not hasattr(source, "to_point_gdf") and hasattr(source, "frame_rate"):  # PedPy's
        stated = Recipe(columns={"frame": "frame"}, frame_rate=float(source.frame_rate))
        source, recipe = source.data, recipe.over(stated)
    found = replace(recipe, file_format="tidy")
    return _accept(load_rows(open_table(source, f"{path}"), found, path), path, recipe)


def _accept(rows: Rows, path: Path, recipe: Recipe) -> LoadedFile:
    """The usable `rows` of file `path`, for which `recipe` was given."""
    good, reasons, first = reject_rows(rows.table, rows)
    is_known = is_table_known(rows.recipe)
    is_doubtful = 2 * good.height < rows.table.height and not is_known
    hint = suggest_reading(first_rows(rows.table), rows.recipe) if is_doubtful else ""
    stage = read_stage(path, rows.recipe, good.height, reasons, first, hint)
    check_people(good, rows.recipe, path, is_unit_given=recipe.has_places)
    if not recipe.has_places:
        check_unit(good, rows.recipe, path)
    return LoadedFile(path, with_days(good, path, rows.recipe), [stage], rows.recipe)


@contextmanager
def open_file(path: Path, recipe: Recipe) -> Iterator[tuple[Recipe, pl.LazyFrame]]:
    """Open file `path` without reading it as a whole, where its shape allows that.

    Gives the `recipe` completed by the file, and a scan of its rows: line, ragged, t [s], id, x, y
    [m], and, where the file has it, speed [m/s].  Raises DataError where the file cannot be read.
    """
    with unpacked(path) as plain:
        if (streamed := scan_streamed(plain, path, recipe)) is not None:
            yield streamed
            return
        rows = load_rows(*open_source(plain, path, recipe), path)
        yield rows.recipe, rows.table.lazy()


def describe_file(path: Path, recipe: Recipe) -> tuple[str, Recipe]:
    """A description of file `path`, read with a `recipe`, by its first rows; and this recipe, completed."""
    with open_file(path, recipe) as (found, scan):
        usable = scan.filter(rejection_reason(scan).is_null())
        rows = usable.head(MOST_SHOWN).select("t", "id", "x", "y").collect()
    return describe_rows(rows, found, path.name), found


def find_format(path: Path, recipe: Recipe) -> Recipe:
    """The `recipe` completed by that of the shape of file `path`; itself where the file cannot be read."""
    require_format(recipe)
    with suppress(DataError, OSError), unpacked(path) as plain:
        return open_source(plain, path, recipe, size=_HEAD)[1]
    return recipe


def find_day(path: Path, recipe: Recipe) -> str | None:
    """The day on which file `path`, read with a `recipe`, begins; None where it has none."""
    require_format(recipe)
    with suppress(DataError, OSError), unpacked(path) as plain:
        source, found = open_source(plain, path, recipe, size=_HEAD)
        if SHAPES[found.file_format or "tidy"].is_sequence or "day" in (
            found.columns or {}
        ):
            return None
        rows = load_rows(source, found, path, is_head=True)
        good = reject_rows(rows.table)[0]
        has_own = "day" in (rows.recipe.columns or {})
        if good.height and not has_own and good["t"][0] >= CALENDAR_BEGINS:
            return str(with_days(good.head(1), path, rows.recipe)["day"][0])
    return None


def rejection_reason(table: pl.DataFrame | pl.LazyFrame) -> pl.Expr:
    """Why a row of a `table` as from `open_file` is rejected; null where it is usable."""
    numbers = pl.col("t", "x", "y")
    reasons = {
        "missing or extra fields": pl.col("ragged"),
        MISSING: pl.any_horizontal(numbers.is_null()),
        NO_ID: pl.col("id").is_null(),
        "not finite": ~pl.all_horizontal(numbers.is_finite()),
        "time not in seconds since 1970": pl.col("t").abs() > LAST_SECOND,
        "position not on Earth": pl.max_horizontal(pl.col("x", "y").abs()) > FARTHEST,
    }
    if "day" in table.collect_schema():
        reasons["no day"] = pl.col("day").is_null()
    return pl.coalesce(
        pl.when(holds).then(pl.lit(reason)) for reason, holds in reasons.items()
    )


def reject_rows(
    table: pl.DataFrame, rows: Rows | None = None
) -> tuple[pl.DataFrame, dict[str, int], tuple[int, str] | None]:
    """The usable rows of a `table` as from `open_file`.

    Also returns the number of the other rows by reason, and line and reason of the first one, with what the
    file holds there if its `rows` are given.
    """
    marked = table.with_columns(reason=rejection_reason(table))
    bad = marked.filter(pl.col("reason").is_not_null())
    counts = dict(bad.group_by("reason", maintain_order=True).len().iter_rows())
    first = bad.select("line", "reason").row(0) if bad.height else None
    if first and first[1] in (MISSING, NO_ID) and rows is not None:
        name = next(name for name in ("t", "x", "y", "id") if bad[name][0] is None)
        first = (first[0], f"{first[1]} ({rows.show_field(first[0], name)})")
    good = marked.filter(pl.col("reason").is_null())
    return good.drop("reason"), counts, first


def read_stage(
    path: Path,
    recipe: Recipe,
    n_good: int,
    reasons: dict[str, int],
    first: tuple[int, str] | None,
    hint: str = "",
) -> dict[str, Any]:
    """The funnel stage of file `path`, read with a `recipe`, of which `n_good` rows are usable.

    `hint` says what to do if most are not, `reasons` count the others, `first` is line and reason of the
    first of these.  Raises DataError where there is no row, or more than `Recipe.max_rejected` are rejected.
    Fewer are a DataWarning.
    """
    n_bad = sum(reasons.values())
    most = MAX_REJECTED if recipe.max_rejected is None else recipe.max_rejected
    if first and n_bad > most * (n_bad + n_good):
        share = ceil(100 * n_bad / (n_bad + n_good)) / 100
        advice = (
            f"if the others are right: {advise(max_rejected=share)}"
            if n_good
            else EXPECTED
        )
        raise DataError(
            f"{path}, line {first[0]}: {first[1]}; {n_bad} of {n_bad + n_good} rows cannot be used "
            f"as {recipe.file_format}; {hint or advice}"
        )
    if n_good == 0:
        raise DataError(f"{path}: holds no row; {EXPECTED}")
    if first:
        detail = first[1].partition(" (")[2]
        _warn_rejected(
            f"{path.name}, first at line {first[0]}{detail and f' ({detail}'}", reasons
        )
    rate = f" at {recipe.frame_rate:g} frames/s" if recipe.frame_rate else ""
    return funnels.stage(f"read {path.name}{rate}", n_good + n_bad, n_good, reasons)


def with_days(good: pl.DataFrame, path: Path, recipe: Recipe) -> pl.DataFrame:
    """The `good` rows of file `path` as day, id, t, x, y.

    The day is the date in the time zone of the `recipe`, or the file's name if its clock does not count from
    1970.
    """
    if "day" not in good.columns:
        last = good["t"].max()
        is_named = SHAPES[recipe.file_format or "tidy"].is_sequence or (
            isinstance(last, float) and last < CALENDAR_BEGINS
        )
        day = (
            pl.lit(file_stem(path))
            if is_named
            else _find_days(good["t"], recipe.tz or "UTC")
        )
        good = good.with_columns(day=day)
    return good.select("day", "id", "t", "x", "y")


def _find_days(t: pl.Series, tz: str) -> pl.Series | pl.Expr:
    """The local date of each time [s since 1970]; a single one where all minutes have the same date."""
    first, last = (int(moment) // _MINUTE * _MINUTE for moment in (t.min(), t.max()))  # type: ignore[arg-type]
    if last - first < _DAY:
        days = _local_date(pl.Series(range(first, last + 1, _MINUTE)), tz).unique()
        if len(days) == 1:
            return pl.lit(days[0])
    return _local_date(t.floor().cast(pl.Int64), tz)


def _local_date(t: pl.Series, tz: str) -> pl.Series:
    return pl.from_epoch(t, time_unit="s").dt.convert_time_zone(tz).dt.date()


def _warn_rejected(where: str, reasons: dict[str, int]) -> None:
    counts = ", ".join(
        f"{count} x {reason}" for reason, count in reasons.items() if count
    )
    if counts:
        warn(f"{where}: rejected rows: {counts}")


# --- several files ------------------------------------------------------------------------------------


def separate_recordings(files: Sequence[LoadedFile]) -> list[LoadedFile]:
    """Give different recordings among `files` another `day`, so that no person is in two of them.

    Files without a calendar (see `to_metres`) are recordings of their own, called by their names, unless
    people continue from one to the other, as in pieces of one recording (not for EWAP).  Files of a calendar
    day are its pieces.  If most of the people in both of two files are in two places at once, the files are
    separate recordings after all, with a DataWarning; if only some are, a DataError is raised.
    """
    found = list(files)
    if len(files) < 2:
        return found
    check_names([file_stem(file.path) for file in files if file.is_sequence])
    names = name_recordings([file.path for file in files])
    has_text_day = [file.rows["day"].dtype == pl.String for file in files]
    is_named = [
        is_text and file.rows["day"].unique().to_list() == [file_stem(file.path)]
        for file, is_text in zip(files, has_text_day, strict=True)
    ]
    candidates = [
        file.rows.with_columns(day=pl.lit(""))
        if named and not file.is_sequence
        else file.rows.head(0)
        for file, named in zip(files, is_named, strict=True)
    ]
    joined = {
        (j, k) for j, k, _, n_apart, _ in _find_shared_people(candidates) if not n_apart
    }
    for k in (k for k, named in enumerate(is_named) if named):
        first = next((j for j in range(k) if (j, k) in joined), None)
        found[k] = files[k].with_day(
            pl.lit(names[k] if first is None else found[first].rows["day"][0])
        )
    for j, k, n_together, n_apart, example in _find_shared_people(
        [file.rows for file in found]
    ):
        where = f"{printable(files[j].path.name)} and {printable(files[k].path.name)}"
        if n_apart and (n_apart <= n_together or has_text_day[k]):
            raise DataError(
                f"{where}: person {example} is in two places at once ({n_apart} of {n_together + n_apart} "
                "people in both files are); read these files one by one, or correct them"
            )
        if n_apart:
            warn(
                f"{where}: {n_apart} people are in two places at once; read as two recordings"
            )
            found[k] = files[k].with_day(
                pl.format("{} {}", pl.col("day").cast(pl.String), pl.lit(names[k]))
            )
    return found


def _find_shared_people(
    parts: Sequence[pl.DataFrame],
) -> list[tuple[int, int, int, int, int]]:
    """Pairs of files that share people.

    For each: the numbers of both files, how many people continue from one to the other, how many are in two
    places at once, and one of the latter.
    """
    keys = [pl.col("day").cast(pl.String), pl.col("id", "t", "x", "y")]
    rows = pl.concat(
        [part.select(*keys, file=pl.lit(k, pl.Int32)) for k, part in enumerate(parts)]
    )
    rows = rows.filter((pl.col("file").min() != pl.col("file").max()).over("day", "id"))
    rows = rows.sort("day", "id", "t", "file")
    step = [
        pl.col(name).diff().over("day", "id").alias(f"d{name}")
        for name in ("t", "x", "y", "file")
    ]
    steps = rows.with_columns(step).filter(
        (pl.col("dfile") != 0) & (pl.col("dt") <= _SOON)
    )
    before = pl.col("file") - pl.col("dfile")
    steps = steps.with_columns(
        j=pl.min_horizontal("file", before),
        k=pl.max_horizontal("file", before),
        apart=(pl.col("dx") ** 2 + pl.col("dy") ** 2).sqrt()
        > _BLUR + _FASTEST * pl.col("dt"),
    )
    people = (
        steps.group_by("j", "k", "day", "id")
        .agg(pl.col("apart").any())
        .sort("j", "k", "apart", "day", "id")
    )
    found = people.group_by("j", "k", maintain_order=True).agg(
        (~pl.col("apart")).sum().alias("together"),
        pl.col("apart").sum(),
        pl.col("id").last(),
    )
    return list(found.iter_rows())


def name_recordings(files: Sequence[Path]) -> list[str]:
    """A name for each of `files`: without its ending, with its folder where two files have the same name."""
    names = [file_stem(file) for file in files]
    names = [
        f"{file.parent.name}-{name}" if names.count(name) > 1 else name
        for file, name in zip(files, names, strict=True)
    ]
    return [
        f"{n} ({names[:k].count(n) + 1})" if n in names[:k] else n
        for k, n in enumerate(names)
    ]


def file_stem(path: Path) -> str:
    """The name of file `path` without its endings."""
    return path.name.split(".")[0]


def check_names(names: Sequence[str]) -> None:
    """Raise DataError where two files of one name in `names` would become one day."""
    if doubled := sorted({name for name in names if names.count(name) > 1}):
        raise DataError(
            f"several files are called {', '.join(doubled)}: their people would be mixed; "
            "pass each file once, and rename those that are other recordings"
        )
