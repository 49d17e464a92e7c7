"""Files of tracks as they are: one sorted table day, id, t, x, y in seconds and metres.

Rows that cannot be used are rejected, and counted by reason in the funnel of each file and in a DataWarning.
A file that cannot be used raises a DataError that names the file and the line.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import ceil
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import polars as pl

from ..core.errors import DataError, warn
from ..core.input_files import printable
from . import funnels
from .formats import TrackFormat, open_file
from .formats.base import EXPECTED, MISSING
from .formats.tidy import is_table, open_table
from .options import ReadOptions, advise
from .plausibility import check_people, check_unit, find_implausible, suggest_reading
from .recordings import LoadedFile, separate_recordings

MAX_REJECTED = 0.05
"""Share of the rows of a file that may be unusable, unless `ReadOptions` give another (assumed)."""
MOST_DOUBLED = 0.2
"""Share of rows up to which a person may have a second place at one time (assumed)."""


def read_raw(
    paths: Any, *, options: ReadOptions | None = None, exclude: Iterable[str] = ()
) -> pd.DataFrame:
    """Read files as they are: day, id, t [s], x, y [m], sorted, without duplicates.

    Parameters
    ----------
    paths : as in `szlib.read_tracks`.
    options : how files are read; None takes the defaults.
    exclude : days "YYYY-MM-DD" to leave out.

    Returns
    -------
    A table for `to_clock`.  ``.attrs["max_gap"]`` is the longest gap [s] of the format, ``.attrs["funnel"]``
    counts every row, and states the frame rate at which an EWAP file was read.

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
    options = options or ReadOptions()
    sources = (
        [paths] if isinstance(paths, str | Path) or is_table(paths) else list(paths)
    )
    excluded = [exclude] if isinstance(exclude, str) else sorted(map(str, exclude))
    if not sources:
        raise DataError("no track file was given; pass at least one path")
    names = (
        Path(f"table-{k}") if is_table(each) else Path(each)
        for k, each in enumerate(sources, start=1)
    )
    files = [
        _read_file(source, path, options)
        for source, path in zip(sources, names, strict=True)
    ]
    return merge(separate_recordings(files), excluded)


def merge(
    files: Sequence[LoadedFile], excluded: Sequence[str] = (), *, copy: bool = True
) -> pd.DataFrame:
    """Merge the rows of `files` into one table as from `read_raw`: sorted, without duplicates.

    Days `excluded` are left out.  Without `copy` the table may share the memory of the rows.
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
    keys = ["day", "id", "t"]
    rows = _sort(wanted)
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
    doubled = {"duplicate (day, id, t)": wanted.height - rows.height}
    _warn_rejected("all files", doubled)
    if rows.height == 0:
        raise DataError(
            f"all {merged.height} rows lie on excluded days {excluded}; check `exclude`"
        )
    frame = pd.DataFrame(
        {name: rows[name].to_numpy() for name in ("id", "t", "x", "y")}, copy=copy
    )
    days = rows["day"].unique().sort()
    codes = (
        rows["day"]
        .replace_strict(days, range(len(days)), return_dtype=pl.Int32)
        .to_numpy()
    )
    names = pd.Index(days.cast(pl.String).to_list())
    frame.insert(0, "day", pd.Series(pd.Categorical.from_codes(codes, names)))
    gaps = [file.layout.max_gap for file in files if file.layout.max_gap is not None]
    frame.attrs["max_gap"] = max(gaps) if len(gaps) == len(files) else None
    areas = {file.layout.area for file in files}
    if len(areas) == 1 and (area := areas.pop()) is not None:
        frame.attrs["area"] = [bound for bounds in area for bound in bounds]
    reasons = {"excluded day": merged.height - wanted.height, **doubled}
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


def _read_file(source: Any, path: Path, options: ReadOptions) -> LoadedFile:
    """The usable rows of one file or table."""
    if is_table(source):
        layout, scan = open_table(source, path, options)
        rows = scan.collect()
        good, reasons, first = reject_rows(rows, layout)
    else:
        with open_file(path, options, is_whole=True) as (layout, scan, plain):
            rows = scan.collect()
            good, reasons, first = reject_rows(rows, layout, plain)
    hint = (
        suggest_reading(rows, layout)
        if layout.is_ambiguous and 2 * good.height < rows.height
        else ""
    )
    most = options.max_rejected
    stage = read_stage(path, layout, good.height, reasons, first, hint, most)
    if layout.is_ambiguous:
        check_people(good, layout, path, is_unit_given=options.metres is not None)
    if options.metres is None:
        check_unit(good, layout, path)
    return LoadedFile(path, layout.to_metres(good, path, options.tz), [stage], layout)


def reject_rows(
    rows: pl.DataFrame, layout: TrackFormat, plain: Path | None = None
) -> tuple[pl.DataFrame, dict[str, int], tuple[int, str] | None]:
    """The usable `rows` of a file in this `layout`.

    Also returns the number of the other rows by reason, and line and reason of the first one, with what file
    `plain` holds there.
    """
    rows = rows.with_columns(reason=layout.rejection_reason())
    bad = rows.filter(pl.col("reason").is_not_null())
    reasons = dict(bad.group_by("reason", maintain_order=True).len().iter_rows())
    first = bad.select("line", "reason").row(0) if bad.height else None
    if first and first[1] == MISSING:
        name = next(name for name in ("t", "id", "x", "y") if bad[name][0] is None)
        first = (first[0], f"{MISSING} ({layout.show_field(plain, first[0], name)})")
    return (
        rows.filter(pl.col("reason").is_null()).with_columns(id="exact_id"),
        reasons,
        first,
    )


def read_stage(
    path: Path,
    layout: TrackFormat,
    n_good: int,
    reasons: dict[str, int],
    first: tuple[int, str] | None,
    hint: str = "",
    max_rejected: float | None = None,
) -> dict[str, Any]:
    """The funnel stage of one file.

    Parameters
    ----------
    path, layout : the file and its format.
    n_good : number of usable rows.
    reasons : number of rejected rows by reason.
    first : line and reason of the first rejected row.
    hint : what to do, if most rows are rejected.
    max_rejected : as in `szlib.ReadOptions`.

    Raises
    ------
    DataError : more than `max_rejected` of the rows are rejected, or there is none.  Fewer are a DataWarning.
    """
    n_bad = sum(reasons.values())
    most = MAX_REJECTED if max_rejected is None else max_rejected
    if first and n_bad > most * (n_bad + n_good):
        share = ceil(100 * n_bad / (n_bad + n_good)) / 100
        if not hint and n_good:
            hint = f"if the others are right: {advise(max_rejected=share)}"
        raise DataError(
            f"{path}, line {first[0]}: {first[1]}; {n_bad} of {n_bad + n_good} rows cannot be used "
            f"as {layout.name}; {hint or EXPECTED}"
        )
    if n_good == 0:
        raise DataError(f"{path}: holds no row; {EXPECTED}")
    if first:
        detail = first[1].partition(" (")[2]
        _warn_rejected(
            f"{path.name}, first at line {first[0]}{detail and f' ({detail}'}", reasons
        )
    rate = f" at {1 / layout.seconds:g} frames/s" if layout.seconds != 1 else ""
    return funnels.stage(f"read {path.name}{rate}", n_good + n_bad, n_good, reasons)


def _warn_rejected(where: str, reasons: dict[str, int]) -> None:
    counts = ", ".join(
        f"{count} x {reason}" for reason, count in reasons.items() if count
    )
    if counts:
        warn(f"{where}: rejected rows: {counts}")
