"""Files of tracks as they are: one sorted table day, id, t, x, y in seconds and metres.

Rows that cannot be used are rejected, and counted by reason in the funnel of each file and in a DataWarning.
A file that cannot be used raises a DataError that names the file and the line.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from math import ceil
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import polars as pl
from polars import Series, String, col, exceptions, lit

from ..core.errors import DataError, warn
from ..core.input_files import explain_errors, printable
from . import funnels
from .columns import column_of, load_rows, open_source
from .funnels import check_people, find_implausible, rejection_reason
from .plausibility import describe_rows
from .recipe import SHAPES, Recipe, advise, find_recipe
from .shapes import open_table
from .sources import SCAN_FACTOR, Rows, check_size, is_table, open_plain, scan_streamed

EXPECTED = (
    "expected a table (text, Parquet, Feather, SQLite, JSON lines) with columns t or frame, id, x, y; or one "
    f"of {', '.join(name for name in SHAPES if name != 'tidy')}; plain, .gz or .zip"
)
"""What can be read, for error messages."""
MAX_REJECTED = 0.05
"""Share of the rows of a file that may be unusable, unless a `Recipe` gives another (assumed)."""
MOST_DOUBLED = 0.2
"""Share of rows up to which a person may have a second place at one time (assumed)."""
# A clock that stays below this (1973) does not count from 1970, and gives no calendar day.
CALENDAR_BEGINS = 1e8
_GLITCHES = 0.01  # share of times that may be wrong
_HEAD = 1 << 16  # bytes of a text by which its day is found

# A person who is in two files walks from one place to the other at most this fast [m/s], give or take this
# distance [m]; pairs of rows that are farther apart than this time [s] are not compared.
_FASTEST = 5.0
_BLUR = 0.5
_SOON = 5.0
_MOST_SHARED = 0.02  # of the rows of a recording that another one may hold (assumed)

Select = Callable[[pl.DataFrame, str | None, float | None], pl.DataFrame]
"""A function of rows, their area and the longest gap within a track [s]: the rows needed, sorted."""


class LoadedFile(NamedTuple):
    """A file that has been read.

    Attributes
    ----------
    path : the file.
    recipe : how it was read, with its columns.
    rows : its usable rows: day, id, t [s], x, y [m].
    is_named : whether its name is its day: it has no calendar.
    stage : its stage of the funnel.
    """

    path: Path
    recipe: Recipe
    rows: pl.DataFrame
    is_named: bool
    stage: dict[str, Any]


def read_raw(
    paths: Any,
    *,
    recipe: Recipe | None = None,
    exclude: Iterable[str] = (),
) -> pd.DataFrame:
    """Read files as they are: day, id, t [s], x, y [m], sorted, without duplicates.

    Parameters
    ----------
    paths : as in `szlib.read_tracks`.
    recipe : how files are read; None takes that beside the files, or finds one.
    exclude : days "YYYY-MM-DD" to leave out.

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
    days = [exclude] if isinstance(exclude, str) else exclude
    return merge_files(load_files(paths, recipe), sorted(map(str, days)))


def load_files(paths: Any, recipe: Recipe | None) -> list[LoadedFile]:
    """Load files, or tables, one or many, each by itself; `paths` and `recipe` as in `read_raw`."""
    sources = list_sources(paths)
    if not sources:
        raise DataError("no track file was given; pass at least one path")
    recipe = find_recipe(sources, recipe)
    files = [_read_file(source, k, recipe) for k, source in enumerate(sources, 1)]
    return separate_recordings(files) if len(files) > 1 else files


def list_sources(paths: Any) -> list[Any]:
    """The files and tables of `paths`, one or many."""
    return [paths] if isinstance(paths, str | Path) or is_table(paths) else list(paths)


def merge_files(
    files: Sequence[LoadedFile],
    excluded: Sequence[str] = (),
    select: Select | None = None,
) -> pd.DataFrame:
    """Merge the rows of `files` into one table as from `read_raw`: sorted, without duplicates.

    Days `excluded` are left out, and rows that `select` leaves out.
    """
    merged = pl.concat((file.rows for file in files), how="vertical_relaxed")
    wanted = merged
    if excluded:
        wanted = merged.filter(~col.day.cast(String).is_in(excluded))
    gaps = [file.recipe.max_gap for file in files]
    max_gap = None if None in gaps else max(filter(None, gaps))
    areas = {file.recipe.area for file in files}
    area = areas.pop() if len(areas) == 1 else None
    near = select(wanted, area, max_gap) if select else sort_rows(wanted)
    keys = col("day", "id", "t")
    again = pl.all_horizontal(keys.eq_missing(keys.shift()))
    elsewhere = again & pl.any_horizontal(col("x", "y").diff() != 0)
    names = ", ".join(printable(file.path.name) for file in files[:3])
    if (n := near.select(elsewhere.sum()).item()) > MOST_DOUBLED * near.height:
        raise DataError(
            f"{names}: {n:,} of {near.height:,} rows give a person a second place at one time; name the "
            "column of the recording, as columns={'day': ...}, or one with the whole time: seconds "
            "without their fraction are not enough"
        )
    rows = near.filter(~again)
    doubled = {"duplicate (day, id, t)": near.height - rows.height}
    _warn_rejected("all files", doubled)
    if rows.height == 0:
        raise DataError(
            f"all {merged.height} rows lie on excluded days {excluded}; check `exclude`"
        )
    days = pd.Index([*rows["day"].unique().sort().cast(String)])
    codes = pd.Categorical.from_codes(rows["day"].rle_id().to_numpy(), days)
    frame = pd.DataFrame({"day": codes})
    for name in ("id", "t", "x", "y"):
        frame[name] = rows[name].to_numpy()
    frame.attrs |= {"max_gap": max_gap, "recipe": files[0].recipe.as_json()}
    if area:
        frame.attrs["area"] = area
    stages = [file.stage for file in files]
    for text in find_implausible(rows):
        warn(f"{names}: {text}")
        n = merged.height
        stages.append(funnels.stage(f"{funnels.WARNING}{text}", n, n, {}))
    reasons = {
        "excluded day": merged.height - wanted.height,
        "never near the area": wanted.height - near.height,
        **doubled,
    }
    stages.append(funnels.stage("merge files", merged.height, rows.height, reasons))
    return funnels.attach(frame, stages)


def sort_rows(rows: pl.DataFrame) -> pl.DataFrame:
    """Sort `rows` by day, id and t, several times as fast as Polars does by three columns."""
    rows = rows.rechunk()
    return rows[np.lexsort((rows["t"], rows["id"], rows["day"].rank("dense")))]


# --- one file -----------------------------------------------------------------------------------------


@contextmanager
def open_rows(path: Path, recipe: Recipe, size: int | None = None) -> Iterator[Rows]:
    """Open file `path` with a `recipe`, without reading it as a whole, where its shape allows that.

    Of a text only `size` bytes are read (None: all).  Raises DataError where the file cannot be read.
    """
    faults = exceptions.PolarsError, exceptions.PanicException
    with open_plain(path, recipe, size) as file:
        with explain_errors(f"{path}: cannot be read", EXPECTED, faults=faults):
            rows = scan_streamed(file) or load_rows(
                *open_source(file), ask=size is None
            )
        yield rows


def _read_file(source: Any, number: int, recipe: Recipe) -> LoadedFile:
    """The usable rows of one file or table `source`; a table is called table-1, ..., by its `number`."""
    if not is_table(source):
        path = Path(source)
        with open_rows(path, recipe) as rows:
            check_size(rows.n_bytes, path, factor=SCAN_FACTOR)
            return _accept(rows, recipe)
    if hasattr(source, "data") and hasattr(source, "frame_rate"):  # PedPy's
        rate = source.frame_rate
        recipe = recipe.over(Recipe(columns={"frame": "frame"}, frame_rate=rate))
        source = source.data
    table = open_table(source, Path(f"table-{number}"))
    return _accept(load_rows(table, replace(recipe, file_format="tidy")), recipe)


def _accept(rows: Rows, given: Recipe) -> LoadedFile:
    """Select the usable ones of the `rows` of a file that was read with the recipe `given` by the user.

    Raises DataError where there is none, too many are rejected, or people cannot move like this.
    """
    path = rows.path
    recipe = rows.recipe
    table = rows.table.drop("speed", strict=False).collect()
    marked = table.with_columns(reason=rejection_reason(table))
    bad = marked.filter(col.reason.is_not_null())
    good = marked.filter(col.reason.is_null())
    reasons = _count_rejected(rows, bad, table.height)
    if good.height == 0:
        raise DataError(
            f"{path}: holds no row{f' where {recipe.where}' if recipe.where else ''}; {EXPECTED}"
        )
    name = f"read {path.name}"
    if recipe.frame_rate:
        name += f" at {recipe.frame_rate:g} frames/s"
    stage = funnels.stage(name, table.height, good.height, reasons)
    check_people(rows, good, given)
    dates = good.get_column("day", default=local_dates(good["t"], recipe))
    day = lit(file_stem(path)) if dates is None else dates
    good = good.select("id", "t", "x", "y", day=day)
    return LoadedFile(path, recipe, good, dates is None, stage)


def _count_rejected(rows: Rows, bad: pl.DataFrame, n: int) -> dict[str, int]:
    """Count the `bad` ones of `n` rows by reason, and warn; raise DataError above `Recipe.max_rejected`."""
    reasons = dict(bad.group_by("reason", maintain_order=True).len().iter_rows())
    if not reasons:
        return reasons
    recipe = rows.recipe
    n_bad = bad.height
    line, reason = bad.select("line", "reason").row(0)
    held = ""
    if reason in (funnels.MISSING, funnels.NO_ID):
        name = next((name for name in ("t", "x", "y") if bad[name][0] is None), "id")
        held = f" ({_show_field(rows, line, name)})"
    most = MAX_REJECTED if recipe.max_rejected is None else recipe.max_rejected
    if n_bad <= most * n + 1e-6:  # an advised share is enough
        _warn_rejected(f"{rows.path.name}, first at line {line}{held}", reasons)
        return reasons
    advice = EXPECTED
    if n_bad < n:
        advice = f"if the others are right: {advise(max_rejected=ceil(100 * n_bad / n) / 100)}"
    raise DataError(
        f"{rows.path}, line {line}: {reason}{held}; {n_bad} of {n} rows cannot be used as "
        f"{recipe.file_format}; {advice}"
    )


def _show_field(rows: Rows, line: int, name: str) -> str:
    """The column that holds the quantity `name`, and what is in it at a `line`, for messages."""
    columns = rows.recipe.columns
    source = rows.source
    if source is None:
        return f"column {name}"
    at = columns["frame" if name == "t" and "frame" in columns else name]
    shown = f"column {at!r}" if at in source.names else f"column {name}"
    value = column_of(source, at)[line - source.first_line]
    return f"{shown} holds {value[:80]!r}" if isinstance(value, str) else shown


def _warn_rejected(where: str, reasons: dict[str, int]) -> None:
    counts = [f"{count} x {reason}" for reason, count in reasons.items() if count]
    if counts:
        warn(f"{where}: rejected rows: {', '.join(counts)}")


def _first_rows(rows: Rows, n: int) -> pl.DataFrame:
    """The first `n` of the `rows` that can be used."""
    return rows.table.filter(rejection_reason(rows.table).is_null()).head(n).collect()


def describe_file(path: Path, recipe: Recipe) -> tuple[str, Recipe]:
    """A description of file `path`, read with a `recipe`, by its first rows; and this recipe, completed."""
    with open_rows(path, recipe) as rows:
        found = describe_rows(
            _first_rows(rows, funnels.MAX_ROWS), rows.recipe, path.name
        )
    return found, rows.recipe


def find_format(path: Path, recipe: Recipe) -> Recipe:
    """The `recipe` completed by that of the shape of file `path`; unchanged where that cannot be read."""
    with suppress(DataError, OSError), open_plain(path, recipe, _HEAD) as file:
        return open_source(file)[1]
    return recipe


def find_day(path: Path, recipe: Recipe) -> str | None:
    """The day on which file `path`, read with a `recipe`, begins; None where it has none."""
    with suppress(DataError, OSError), open_rows(path, recipe, _HEAD) as rows:
        first = _first_rows(rows, 1)
        if "day" not in rows.recipe.columns:
            dates = first.get_column(
                "day", default=local_dates(first["t"], rows.recipe)
            )
            return str(dates[0]) if dates is not None and len(dates) else None
    return None


def local_dates(t: Series, recipe: Recipe) -> Series | None:
    """The date of each time `t` in the time zone of the `recipe`; None where there is no calendar."""
    if recipe.shape.is_sequence or (t.quantile(_GLITCHES) or 0) < CALENDAR_BEGINS:
        return None

    def dates(times: Series) -> Series:
        """The date of each of some times."""
        moments = pl.from_epoch(times.floor().cast(pl.Int64))
        return moments.dt.convert_time_zone(recipe.tz or "UTC").dt.date()

    first, last = dates(Series([t.min(), t.max()]))
    if first == last:  # mostly so; several times as fast
        return pl.repeat(first, len(t), eager=True)
    return dates(t)


# --- several files ------------------------------------------------------------------------------------


def separate_recordings(files: Sequence[LoadedFile]) -> list[LoadedFile]:
    """Give different recordings among `files` another `day`, so that no person is in two of them.

    Files without a calendar are recordings of their own, called by their names.  Files of a calendar day are
    its pieces.  Raises DataError where somebody in two of them is in two places at once, or two recordings
    have the same name, or the same rows, to 1 cm and 10 ms.
    """
    names = name_recordings([file.path for file in files])
    pairs = [*zip(files, names, strict=True)]
    check_names([name for file, name in pairs if file.is_named])
    held = {
        name: file.rows.select("id", col("t", "x", "y").round(2)).hash_rows().unique()
        for file, name in pairs
        if file.is_named
    }
    every = pl.concat([Series(dtype=pl.UInt64), *held.values()])
    shared = every.filter(every.is_duplicated())
    for name, own in held.items():
        if len(shared) and own.is_in(shared.implode()).sum() > _MOST_SHARED * len(own):
            raise DataError(
                f"{name} and another recording hold the same rows; pass each recording once, and repeated "
                "trials as one table with a column 'day'"
            )
    named = [
        file._replace(rows=file.rows.with_columns(day=lit(name)))
        if file.is_named
        else file
        for file, name in pairs
    ]
    rows = pl.concat(
        f.rows.select(col.day.cast(String), "id", "t", "x", "y", file=k)
        for k, f in enumerate(named)
    )
    rows = rows.filter((col.file.min() != col.file.max()).over("day", "id"))
    rows = rows.sort("day", "id", "t")
    rows = rows.with_columns(col("t", "x", "y", "file").diff().over("day", "id"))
    length = (col.x**2 + col.y**2).sqrt()
    rows = rows.filter(length > _BLUR + _FASTEST * col.t)
    apart = rows.filter(col.file != 0, col.t <= _SOON)
    if apart.height:
        day, person = apart.select("day", "id").row(0)
        raise DataError(
            f"{', '.join(names[:3])}: person {person} is in two places at once on {day}; read these files "
            "one by one, or name the column of the recording: columns={'day': ...}"
        )
    return named


def name_recordings(files: Sequence[Path]) -> list[str]:
    """A name for each of `files`: without its ending, with its folder where two files have the same name."""
    stems = [file_stem(file) for file in files]
    return [
        f"{file.parent.name}-{stem}" if stems.count(stem) > 1 else stem
        for file, stem in zip(files, stems, strict=True)
    ]


def file_stem(path: Path) -> str:
    """The name of file `path` without its endings."""
    return re.sub(r"(?<=.)(\.[a-zA-Z]\w*)+$", "", path.name)


def check_names(names: Sequence[str]) -> None:
    """Raise DataError where two files of one name in `names` would become one day."""
    if doubled := sorted({name for name in names if names.count(name) > 1}):
        raise DataError(
            f"several files are called {', '.join(doubled)}: their people would be mixed; "
            "pass each file once, and rename those that are other recordings"
        )
