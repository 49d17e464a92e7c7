"""Files of tracks as they are: one sorted table day, id, t, x, y in seconds and metres.

Rows that cannot be used are set aside, counted by reason in the funnel of each file, and in a
DataWarning; a file that cannot be used raises a DataError that names the file and the line.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import polars as pl

from ..errors import DataError, DataWarning
from ..files import printable
from . import funnels
from .formats.layouts import EXPECTED, Format, readable, recognise
from .formats.plain import check_rows, plain_file
from .formats.rows import fault, in_metres, stem
from .formats.tables import is_table, recognise_table
from .options import ReadOptions
from .plausible import check_people, check_unit, suggestion

_FASTEST, _BLUR, _SOON = 5.0, 0.5, 5.0
"""Who is in two files walks from the one's place to the other's at most so fast [m/s], up to so much [m];
rows farther apart than that [s] tell nothing."""


def read_raw(
    paths: Any,
    *,
    options: ReadOptions | None = None,
    exclude: Iterable[str] = (),
) -> pd.DataFrame:
    """Read files as they are: day, id, t [s], x, y [m], sorted, without duplicates.

    Parameters and errors are those of `szlib.read_tracks`.  ``.attrs["max_gap"]`` keeps the format's
    longest gap [s] for `to_clock`, ``.attrs["funnel"]`` counts every row, and says at how many frames a
    second an EWAP file was read.
    """
    options = options or ReadOptions()
    sources = [paths] if isinstance(paths, str | Path) or is_table(paths) else list(paths)
    files = [Path(f"table-{k}") if is_table(each) else Path(each) for k, each in enumerate(sources, start=1)]
    excluded = [exclude] if isinstance(exclude, str) else sorted(map(str, exclude))
    if not files:
        raise DataError("no track file was given; pass at least one path")
    read = [_read(source, file, options) for source, file in zip(sources, files, strict=True)]
    parts, stages, layouts = zip(*read, strict=True)
    _check_sequences([stem(f) for f, layout in zip(files, layouts, strict=True) if layout.name == "ewap"])
    return merge(told_apart(files, parts, layouts), stages, layouts, excluded)


def merge(
    parts: Sequence[pl.DataFrame],
    stages: Sequence[dict[str, Any]],
    layouts: Sequence[Format],
    excluded: Sequence[str],
    *,
    copy: bool = True,
) -> pd.DataFrame:
    """Rows (day, id, t, x, y) of all files as one table as from `read_raw`: sorted, without duplicates.

    Without `copy` it may have the memory of `parts`, which nobody may write to.
    """
    if len({part.schema["day"] for part in parts}) > 1:
        parts = [part.with_columns(pl.col("day").cast(pl.String)) for part in parts]
    merged = pl.concat(parts)
    wanted = merged.filter(~pl.col("day").cast(pl.String).is_in(excluded)) if excluded else merged
    keys = ["day", "id", "t"]
    rows = _sorted(wanted)
    again = pl.all_horizontal(pl.col(keys).eq_missing(pl.col(keys).shift()))
    if rows.select(again.any()).item():
        rows = rows.filter(~again)
    doubled = {"duplicate (day, id, t)": wanted.height - rows.height}
    _warn("all files", doubled)
    if rows.height == 0:
        raise DataError(f"all {merged.height} rows lie on excluded days {excluded}; check `exclude`")
    frame = pd.DataFrame({name: rows[name].to_numpy() for name in ("id", "t", "x", "y")}, copy=copy)
    days = rows["day"].unique().sort()
    codes = rows["day"].replace_strict(days, range(len(days)), return_dtype=pl.Int32).to_numpy()
    names = pd.Index(days.cast(pl.String).to_list())
    frame.insert(0, "day", pd.Series(pd.Categorical.from_codes(codes, names)))
    gaps = [layout.max_gap for layout in layouts if layout.max_gap is not None]
    frame.attrs["max_gap"] = max(gaps) if len(gaps) == len(layouts) else None
    reasons = {"excluded day": merged.height - wanted.height, **doubled}
    return funnels.attach(frame, [*stages, funnels.stage("merge files", merged.height, rows.height, reasons)])


def _sorted(rows: pl.DataFrame) -> pl.DataFrame:
    """Rows by day, id and t; those of one day in the order of time need sorting by person only."""
    if rows.height and rows["day"].n_unique() == 1:
        if is_sorted(rows["id"].to_numpy(), rows["t"].to_numpy()):
            return rows
        if rows["t"].is_sorted():
            return rows[person_order(rows["id"].to_numpy())]
    return rows.sort("day", "id", "t", maintain_order=True)


def person_order(person: np.ndarray) -> np.ndarray:
    """The order of rows by person, stable: by numbers of 16 bits where they suffice, in linear time."""
    number, people = pd.factorize(person, sort=True)
    return np.argsort(number.astype(np.min_scalar_type(len(people))), kind="stable")


def is_sorted(person: np.ndarray, time: np.ndarray) -> bool:
    """Whether rows are in the order of person, then time."""
    same = person[1:] == person[:-1]
    return bool(((person[1:] > person[:-1]) | (same & (time[1:] >= time[:-1]))).all())


def _read(source: Any, path: Path, options: ReadOptions) -> tuple[pl.DataFrame, dict[str, Any], Format]:
    """One file or table: its usable rows (day, id, t, x, y), its funnel stage, its layout."""
    if is_table(source):
        layout, scan = recognise_table(source, path, options)
        rows = scan.collect()
    else:
        with plain_file(path) as plain:
            check_rows(plain, path)
            layout, scan = recognise(plain, path, options)
            with readable(path, layout):
                rows = scan.collect()
    metres = layout.metres_in(options.unit)
    rows = rows.with_columns(reason=fault(metres, layout.seconds, "day" in rows.columns))
    bad, good = rows.filter(pl.col("reason").is_not_null()), rows.filter(pl.col("reason").is_null())
    reasons = dict(bad.group_by("reason", maintain_order=True).len().iter_rows())
    first = bad.select("line", "reason").row(0) if bad.height else None
    free = layout.name in ("tidy", "atc-1hz")  # the other formats leave no doubt
    hint = suggestion(rows, layout, metres=metres) if free and bad.height > good.height else ""
    stage = read_stage(path, layout, good.height, reasons, first, hint)
    if free:
        check_people(good, layout, path, metres=metres, sure=options.unit is not None)
    if options.unit is None:
        check_unit(good, layout, path)
    return in_metres(good, path, layout, metres, options.tz), stage, layout


def read_stage(
    path: Path,
    layout: Format,
    good: int,
    reasons: dict[str, int],
    first: tuple[int, str] | None,
    hint: str = "",
) -> dict[str, Any]:
    """Funnel stage of one file; `first` is the line of the first bad row and its reason.

    Warns of rows set aside; raises DataError where they are more than the good ones, or there are none.
    """
    bad = sum(reasons.values())
    if first and bad > good:
        raise DataError(
            f"{path}, line {first[0]}: {first[1]}; {bad} of {bad + good} rows cannot be used "
            f"as {layout.name}; {hint or EXPECTED}"
        )
    if good == 0:
        raise DataError(f"{path}: holds no row; {EXPECTED}")
    if first:
        _warn(f"{path.name}, first at line {first[0]}", reasons)
    rate = f" at {1 / layout.seconds:g} frames/s" if layout.seconds != 1 else ""
    return funnels.stage(f"read {path.name}{rate}", good + bad, good, reasons)


def told_apart(
    files: Sequence[Path], parts: Sequence[pl.DataFrame], layouts: Sequence[Format]
) -> list[pl.DataFrame]:
    """Rows of several files, those of other recordings under another `day`: nobody is in two of them.

    Files without a calendar (see `in_metres`) are recordings of their own, called by their names, unless
    people go on from one to the other, as in pieces of one recording (EWAP has none).  Files of a calendar
    day are its pieces.  Where most of the people whom two of them share are in two places at once, they are
    other recordings after all, and a DataWarning says so; where some are, a DataError does.
    """
    if len(parts) < 2:
        return list(parts)
    texts = [part["day"].dtype == pl.String for part in parts]
    named = [
        text and part["day"].unique().to_list() == [stem(f)]
        for f, part, text in zip(files, parts, texts, strict=True)
    ]
    kept, names = list(parts), recording_names(files)
    own = [
        part.with_columns(day=pl.lit("")) if name and layout.name != "ewap" else part.head(0)
        for part, name, layout in zip(parts, named, layouts, strict=True)
    ]
    joined = {(j, k) for j, k, _, apart, _ in _shared(own) if not apart}
    for k in (k for k, name in enumerate(named) if name):
        of = next((j for j in range(k) if (j, k) in joined), None)
        kept[k] = parts[k].with_columns(day=pl.lit(names[k] if of is None else kept[of]["day"][0]))
    for j, k, together, apart, example in _shared(kept):
        where = f"{printable(files[j].name)} and {printable(files[k].name)}"
        if apart and (apart <= together or texts[k]):
            raise DataError(
                f"{where}: person {example} is in two places at once ({apart} of {together + apart} people "
                "who are in both are); read these files one by one, or correct them"
            )
        if apart:
            _announce(f"{where}: {apart} people are in two places at once; read as two recordings")
            day = pl.format("{} {}", pl.col("day").cast(pl.String), pl.lit(names[k]))
            kept[k] = parts[k].with_columns(day=day)
    return kept


def _shared(parts: Sequence[pl.DataFrame]) -> list[tuple[int, int, int, int, int]]:
    """For two files that share people: their numbers, how many go on from the one to the other, how many are
    in two places at once, and one of those."""
    keys = [pl.col("day").cast(pl.String), pl.col("id", "t", "x", "y")]
    rows = pl.concat([part.select(*keys, file=pl.lit(k, pl.Int32)) for k, part in enumerate(parts)])
    rows = rows.filter((pl.col("file").min() != pl.col("file").max()).over("day", "id"))
    rows = rows.sort("day", "id", "t", "file")
    step = [pl.col(name).diff().over("day", "id").alias(f"d{name}") for name in ("t", "x", "y", "file")]
    steps = rows.with_columns(step).filter((pl.col("dfile") != 0) & (pl.col("dt") <= _SOON))
    before = pl.col("file") - pl.col("dfile")
    steps = steps.with_columns(
        j=pl.min_horizontal("file", before),
        k=pl.max_horizontal("file", before),
        apart=(pl.col("dx") ** 2 + pl.col("dy") ** 2).sqrt() > _BLUR + _FASTEST * pl.col("dt"),
    )
    people = (
        steps.group_by("j", "k", "day", "id").agg(pl.col("apart").any()).sort("j", "k", "apart", "day", "id")
    )
    found = people.group_by("j", "k", maintain_order=True).agg(
        (~pl.col("apart")).sum().alias("together"), pl.col("apart").sum(), pl.col("id").last()
    )
    return list(found.iter_rows())


def recording_names(files: Sequence[Path]) -> list[str]:
    """A name for each file: without its ending, with its folder's where two are called the same."""
    names = [stem(file) for file in files]
    names = [
        f"{file.parent.name}-{name}" if names.count(name) > 1 else name
        for file, name in zip(files, names, strict=True)
    ]
    return [f"{n} ({names[:k].count(n) + 1})" if n in names[:k] else n for k, n in enumerate(names)]


def _check_sequences(names: list[str]) -> None:
    """Raise DataError where two EWAP files of one name would be taken for one day."""
    if doubled := sorted({name for name in names if names.count(name) > 1}):
        raise DataError(
            f"several EWAP files are called {', '.join(doubled)}: their people would be mixed; "
            "pass each file once, and rename those that are other recordings"
        )


def _warn(where: str, reasons: dict[str, int]) -> None:
    counts = ", ".join(f"{count} x {reason}" for reason, count in reasons.items() if count)
    if counts:
        _announce(f"{where}: rows set aside: {counts}")


def _announce(what: str) -> None:
    warnings.warn(what, DataWarning, stacklevel=3)
