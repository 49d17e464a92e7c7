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
    describe_rows,
    find_implausible,
    is_table_known,
)
from .recipe import Recipe, advise, find_recipe
from .rows import (
    EXPECTED,
    MISSING,
    NO_ID,
    Rows,
    load_rows,
    open_rows,
    open_source,
    rejection_reason,
    select_usable,
)
from .shapes import SHAPES, require_format
from .sources import is_table, open_table, require_memory, unpacked

MAX_REJECTED = 0.05
"""Share of the rows of a file that may be unusable, unless a `Recipe` gives another (assumed)."""
MOST_DOUBLED = 0.2
"""Share of rows up to which a person may have a second place at one time (assumed)."""
# A clock that stays below this (1973) does not count from 1970, and gives no calendar day.
CALENDAR_BEGINS = 1e8
_HEAD = 1 << 16  # bytes of a text by which its day is found
# bytes of memory for each of a text that is scanned (measured: 1.3 to 1.9)
_SCANNED = 2

# A person who is in two files walks from one place to the other at most this fast [m/s], give or take this
# distance [m]; pairs of rows that are farther apart than this time [s] are not compared.
_FASTEST, _BLUR, _SOON = 5.0, 0.5, 5.0


class LoadedFile(NamedTuple):
    """A file that has been read.

    Attributes
    ----------
    path : the file.
    rows : its usable rows: day, id, t [s], x, y [m].
    stage : of its funnel.
    recipe : how it was read, with its columns.
    """

    path: Path
    rows: pl.DataFrame
    stage: dict[str, Any]
    recipe: Recipe

    @property
    def is_named(self) -> bool:
        """Whether its name is its day: it has no calendar, and can be a piece of a recording."""
        is_text, name = self.rows.schema["day"] == pl.String, file_stem(self.path)
        return (
            is_text and not self.is_sequence and bool((self.rows["day"] == name).all())
        )

    @property
    def is_sequence(self) -> bool:
        """Whether each file of this shape is a recording of its own, without a calendar."""
        return SHAPES[self.recipe.file_format or "tidy"].is_sequence

    def with_day(self, day: str | pl.Expr) -> LoadedFile:
        """The same rows under another `day`, or the same for all."""
        day = pl.lit(day) if isinstance(day, str) else day
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
    is_one = isinstance(paths, str | Path) or is_table(paths)
    sources = [paths] if is_one else list(paths)
    excluded = [exclude] if isinstance(exclude, str) else sorted(map(str, exclude))
    if not sources:
        raise DataError("no track file was given; pass at least one path")
    recipe = find_recipe(sources, recipe)
    files = [_read_file(source, k, recipe) for k, source in enumerate(sources, 1)]
    return merge(separate_recordings(files), excluded, select)


def merge(
    files: Sequence[LoadedFile],
    excluded: Sequence[str] = (),
    select: Select | None = None,
) -> pd.DataFrame:
    """Merge the rows of `files` into one table as from `read_raw`: sorted, without duplicates.

    Days `excluded` are left out, and rows that `select` leaves out.
    """
    parts, keys = [file.rows for file in files], ["day", "id", "t"]
    if len({part.schema["day"] for part in parts}) > 1:
        parts = [part.with_columns(pl.col("day").cast(pl.String)) for part in parts]
    merged = wanted = pl.concat(parts)
    if excluded:
        wanted = merged.filter(~pl.col("day").cast(pl.String).is_in(excluded))
    gaps = [file.recipe.max_gap for file in files]
    max_gap = None if None in gaps else max(filter(None, gaps))
    areas = {file.recipe.area for file in files}
    area = areas.pop() if len(areas) == 1 else None
    near = wanted if select is None else select(wanted, area, max_gap)
    day = near["day"].rank("dense").to_numpy().astype("int32") - 1
    order = np.lexsort((near["t"].to_numpy(), near["id"].to_numpy(), day))
    rows = near[order]  # several times as fast as Polars sorts by three columns
    again = pl.all_horizontal(pl.col(keys).eq_missing(pl.col(keys).shift()))
    elsewhere = again & pl.any_horizontal(pl.col("x", "y").diff() != 0)
    names = ", ".join(printable(file.path.name) for file in files[:3])
    if (n := rows.select(elsewhere.sum()).item()) > MOST_DOUBLED * rows.height:
        raise DataError(
            f"{names}: {n:,} of {rows.height:,} rows give a person a second place at one time; name the "
            "column of the recording, as columns={'day': ...}, or one with the whole time: seconds "
            "without their fraction are not enough"
        )
    is_first = ~rows.select(again).to_series()
    rows = rows.filter(is_first)
    doubled = {"duplicate (day, id, t)": near.height - rows.height}
    _warn_rejected("all files", doubled)
    if rows.height == 0:
        raise DataError(
            f"all {merged.height} rows lie on excluded days {excluded}; check `exclude`"
        )
    columns = {name: rows[name].to_numpy() for name in ("id", "t", "x", "y")}
    days = pd.Index(near["day"].unique().sort().cast(pl.String).to_list())
    frame = pd.DataFrame(
        {"day": pd.Categorical.from_codes(day[order][is_first], days), **columns}
    )
    frame.attrs |= {"max_gap": max_gap, "recipe": files[0].recipe.as_json()}
    if area is not None:
        frame.attrs["area"] = area
    stages = [file.stage for file in files]
    for text in find_implausible(rows):
        warn(f"{names}: {text}")
        name = f"{funnels.WARNING}{text}"
        stages.append(funnels.stage(name, merged.height, merged.height, {}))
    far = {"never near the area": wanted.height - near.height}
    reasons = {"excluded day": merged.height - wanted.height, **far, **doubled}
    last = funnels.stage("merge files", merged.height, rows.height, reasons)
    return funnels.attach(frame, [*stages, last])


def _read_file(source: Any, number: int, recipe: Recipe) -> LoadedFile:
    """The usable rows of one file or table, of which a table is called by its `number`."""
    if not is_table(source):
        path = Path(source)
        with unpacked(path) as plain:
            rows = open_rows(plain, path, recipe)
            if rows.source is None:
                require_memory(plain.stat().st_size, f"{path}", factor=_SCANNED)
            return _accept(rows, path, recipe)
    path = Path(f"table-{number}")
    if hasattr(source, "data") and hasattr(source, "frame_rate"):  # PedPy's
        rate = float(source.frame_rate)
        source = source.data
        recipe = recipe.over(Recipe(columns={"frame": "frame"}, frame_rate=rate))
    found = replace(recipe, file_format="tidy")
    return _accept(load_rows(open_table(source, f"{path}"), found, path), path, recipe)


def _accept(rows: Rows, path: Path, given: Recipe) -> LoadedFile:
    """The usable `rows` of file `path`, for which the recipe `given` was given.

    Raises DataError where there is none, too many are rejected, or people cannot move like this.
    """
    recipe, table = rows.recipe, rows.table.collect()
    marked = table.with_columns(reason=rejection_reason(table))
    bad = marked.filter(pl.col("reason").is_not_null())
    good = marked.filter(pl.col("reason").is_null()).drop("reason")
    reasons = dict(bad.group_by("reason", maintain_order=True).len().iter_rows())
    if bad.height:
        _report_rejected(rows, table, bad, reasons, path)
    if good.height == 0:
        raise DataError(f"{path}: holds no row; {EXPECTED}")
    rate = f" at {recipe.frame_rate:g} frames/s" if recipe.frame_rate else ""
    name = f"read {path.name}{rate}"
    stage = funnels.stage(name, table.height, good.height, reasons)
    check_people(good, recipe, given, path, rows.suggest_reading)
    return LoadedFile(path, with_days(good, path, recipe), stage, recipe)


def _report_rejected(
    rows: Rows,
    table: pl.DataFrame,
    bad: pl.DataFrame,
    reasons: dict[str, int],
    path: Path,
) -> None:
    """Warn of the `bad` rows of a `table`, counted by reason; DataError above `Recipe.max_rejected`."""
    recipe, n_bad, n = rows.recipe, bad.height, table.height
    line, reason = bad.select("line", "reason").row(0)
    held = ""
    if reason in (MISSING, NO_ID):
        name = next(name for name in ("t", "x", "y", "id") if bad[name][0] is None)
        held = f" ({rows.show_field(line, name)})"
    most = MAX_REJECTED if recipe.max_rejected is None else recipe.max_rejected
    if n_bad <= most * n:
        _warn_rejected(f"{path.name}, first at line {line}{held}", reasons)
        return
    advice = EXPECTED
    if n_bad < n:
        share = ceil(100 * n_bad / n) / 100
        advice = f"if the others are right: {advise(max_rejected=share)}"
    if 2 * n_bad > n and not is_table_known(recipe):
        advice = rows.suggest_reading() or advice
    raise DataError(
        f"{path}, line {line}: {reason}{held}; {n_bad} of {n} rows cannot be used as {recipe.file_format}; "
        f"{advice}"
    )


def _warn_rejected(where: str, reasons: dict[str, int]) -> None:
    counts = [f"{count} x {reason}" for reason, count in reasons.items() if count]
    if counts:
        warn(f"{where}: rejected rows: {', '.join(counts)}")


@contextmanager
def open_file(path: Path, recipe: Recipe) -> Iterator[tuple[Recipe, pl.LazyFrame]]:
    """Open file `path` without reading it as a whole, where its shape allows that.

    Gives the `recipe` completed by the file, and a scan of its rows: line, ragged, t [s], id, x, y
    [m], and, where the file has it, speed [m/s].  Raises DataError where the file cannot be read.
    """
    with unpacked(path) as plain:
        rows = open_rows(plain, path, recipe)
        yield rows.recipe, rows.table


def describe_file(path: Path, recipe: Recipe) -> tuple[str, Recipe]:
    """A description of file `path`, read with a `recipe`, by its first rows; and this recipe, completed."""
    with open_file(path, recipe) as (found, scan):
        rows = (
            select_usable(scan).head(MOST_SHOWN).select("t", "id", "x", "y").collect()
        )
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
        rows = load_rows(source, found, path, is_head=True)
        first = select_usable(rows.table).head(1).collect()
        if first.height and "day" not in (rows.recipe.columns or {}):
            day = str(with_days(first, path, rows.recipe)["day"][0])
            return None if day == file_stem(path) else day
    return None


def with_days(good: pl.DataFrame, path: Path, recipe: Recipe) -> pl.DataFrame:
    """The `good` rows of file `path` as day, id, t, x, y.

    The day is the date in the time zone of the `recipe`, or the file's name if its clock does not count from
    1970.
    """
    if "day" not in good.columns:
        ends = good.select(pl.min("t"), pl.max("t").alias("last")).row(0)
        shape = SHAPES[recipe.file_format or "tidy"]
        day: Any = pl.lit(file_stem(path))
        if good.height and not shape.is_sequence and ends[1] >= CALENDAR_BEGINS:
            tz = recipe.tz or "UTC"
            first, last = _local_dates(pl.Series(ends), tz)
            day = pl.lit(first) if first == last else _local_dates(good["t"], tz)
        good = good.with_columns(day=day)
    return good.select("day", "id", "t", "x", "y")


def _local_dates(t: pl.Series, tz: str) -> pl.Series:
    """The date of each time [s since 1970] in the time zone `tz`."""
    moments = pl.from_epoch(t.floor().cast(pl.Int64), time_unit="s")
    return moments.dt.convert_time_zone(tz).dt.date()


# --- several files ------------------------------------------------------------------------------------


def separate_recordings(files: Sequence[LoadedFile]) -> list[LoadedFile]:
    """Give different recordings among `files` another `day`, so that no person is in two of them.

    Files without a calendar (see `with_days`) are recordings of their own, called by their names, unless
    people continue from one to the other, as in pieces of one recording (not for EWAP).  Files of a calendar
    day are its pieces.  If most of the people in both of two files are in two places at once, the files are
    separate recordings after all, with a DataWarning; if only some are, a DataError is raised.
    """
    found = list(files)
    if len(files) < 2:
        return found
    check_names([file_stem(file.path) for file in files if file.is_sequence])
    names = name_recordings([file.path for file in files])
    is_named = [file.is_named for file in files]
    candidates = [
        file.with_day("") if named else file
        for file, named in zip(files, is_named, strict=True)
    ]
    joined = {
        (j, k)
        for j, k, _, n_apart, _ in _find_shared_people(candidates)
        if is_named[j] and is_named[k] and not n_apart
    }
    for k in (k for k, named in enumerate(is_named) if named):
        first = next((j for j in range(k) if (j, k) in joined), None)
        name = names[k] if first is None else str(found[first].rows["day"][0])
        found[k] = files[k].with_day(name)
    for j, k, n_together, n_apart, example in _find_shared_people(found):
        where = f"{printable(files[j].path.name)} and {printable(files[k].path.name)}"
        has_text_day = found[k].rows.schema["day"] == pl.String
        if n_apart and (n_apart <= n_together or has_text_day):
            raise DataError(
                f"{where}: person {example} is in two places at once ({n_apart} of {n_together + n_apart} "
                "people in both files are); read these files one by one, or correct them"
            )
        if n_apart:
            warn(
                f"{where}: {n_apart} people are in two places at once; read as two recordings"
            )
            day = pl.format("{} {}", pl.col("day").cast(pl.String), pl.lit(names[k]))
            found[k] = files[k].with_day(day)
    return found


def _find_shared_people(
    files: Sequence[LoadedFile],
) -> list[tuple[int, int, int, int, int]]:
    """Pairs of `files` that share people.

    For each: the numbers of both files, how many people continue from one to the other, how many are in two
    places at once, and one of the latter.
    """
    keys = [pl.col("day").cast(pl.String), pl.col("id", "t", "x", "y")]
    parts = [file.rows.select(*keys, file=pl.lit(k)) for k, file in enumerate(files)]
    rows, person = pl.concat(parts), ["day", "id"]
    rows = rows.filter((pl.min("file") != pl.max("file")).over(person))
    step = pl.col("t", "x", "y", "file").diff().over(person).name.prefix("d")
    steps = rows.sort(*person, "t", "file").with_columns(step)
    before, moved = pl.col("file") - pl.col("dfile"), pl.col("dx", "dy") ** 2
    people = (
        steps.filter((pl.col("dfile") != 0) & (pl.col("dt") <= _SOON))
        .group_by(
            *person,
            j=pl.min_horizontal("file", before),
            k=pl.max_horizontal("file", before),
        )
        .agg(
            apart=(
                pl.sum_horizontal(moved).sqrt() > _BLUR + _FASTEST * pl.col("dt")
            ).any()
        )
        .sort("j", "k", "apart", *person)
    )
    counts = people.group_by("j", "k", maintain_order=True).agg(
        (~pl.col("apart")).sum().alias("together"), pl.sum("apart"), pl.last("id")
    )
    return counts.rows()


def name_recordings(files: Sequence[Path]) -> list[str]:
    """A name for each of `files`: without its ending, with its folder where two files have the same name."""
    stems = [file_stem(file) for file in files]
    names = [
        f"{file.parent.name}-{name}" if stems.count(name) > 1 else name
        for file, name in zip(files, stems, strict=True)
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
