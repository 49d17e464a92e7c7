"""Several files: which of them are pieces of one recording, and which are recordings of their own."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import polars as pl
from polars import col

from ..core.errors import DataError, warn
from ..core.input_files import printable
from .recipe import Recipe

# A person who is in two files walks from one place to the other at most this fast [m/s], give or take this
# distance [m]; pairs of rows that are farther apart than this time [s] are not compared.
_FASTEST, _BLUR, _SOON = 5.0, 0.5, 5.0


class LoadedFile(NamedTuple):
    """A file that has been read.

    Attributes
    ----------
    path : the file.
    recipe : how it was read, with its columns.
    rows : its usable rows: day, id, t [s], x, y [m].
    stage : of its funnel.
    """

    path: Path
    recipe: Recipe
    rows: pl.DataFrame
    stage: dict[str, Any]


def separate_recordings(files: Sequence[LoadedFile]) -> list[LoadedFile]:
    """Give different recordings among `files` another `day`, so that no person is in two of them.

    Files without a calendar are recordings of their own, called by their names, unless people continue from
    one to the other, as in pieces of one recording (not for EWAP).  Files of a calendar day are its pieces.
    If most of the people in both of two files are in two places at once, the files are separate recordings
    after all, with a DataWarning; if only some are, a DataError is raised.
    """
    is_sequence = [file.recipe.shape.is_sequence for file in files]
    stems = [file_stem(file.path) for file in files]
    check_names([stem for stem, holds in zip(stems, is_sequence, strict=True) if holds])
    days = name_recordings([file.path for file in files])
    rows, is_named = [file.rows for file in files], []
    for k, part in enumerate(rows):
        is_text = part.schema["day"] == pl.String and not is_sequence[k]
        is_named.append(is_text and bool((part["day"] == stems[k]).all()))
        if is_named[k]:
            rows[k] = part.with_columns(day=pl.lit(""))
    shared, joined = _find_shared_people(rows), dict[int, str]()
    for j, k, _, n_apart, _ in shared:
        if is_named[j] and is_named[k] and not n_apart:
            joined.setdefault(k, joined.get(j, days[j]))
    names = [joined.get(k, day) for k, day in enumerate(days)]
    for k, part in enumerate(rows):
        if is_named[k]:
            rows[k] = part.with_columns(day=pl.lit(names[k]))
    for j, k, n_together, n_apart, example in shared:
        is_both = is_named[j] and is_named[k]
        if not n_apart or (is_both and names[j] != names[k]):
            continue
        where = f"{printable(files[j].path.name)} and {printable(files[k].path.name)}"
        if n_apart <= n_together or rows[k].schema["day"] == pl.String:
            raise DataError(
                f"{where}: person {example} is in two places at once ({n_apart} of {n_together + n_apart} "
                "people in both files are); read these files one by one, or correct them"
            )
        warn(
            f"{where}: {n_apart} people are in two places at once; read as two recordings"
        )
        day = pl.format("{} {}", col.day.cast(pl.String), pl.lit(days[k]))
        rows[k] = files[k].rows.with_columns(day=day)
    return [file._replace(rows=part) for file, part in zip(files, rows, strict=True)]


def _find_shared_people(
    parts: Sequence[pl.DataFrame],
) -> list[tuple[int, int, int, int, int]]:
    """Pairs of the rows of files that share people.

    For each: the numbers of both files, how many people continue from one to the other, how many are in two
    places at once, and one of the latter.
    """
    keys = [col.day.cast(pl.String), col("id", "t", "x", "y")]
    rows = pl.concat(part.select(*keys, file=k) for k, part in enumerate(parts))
    person = ["day", "id"]
    rows = rows.filter((pl.min("file") != pl.max("file")).over(person))
    step = col("t", "x", "y", "file").diff().over(person).name.prefix("d")
    steps = rows.sort(*person, "t", "file").with_columns(step)
    steps = steps.filter(col.dfile != 0, col.dt <= _SOON)
    before, moved = col.file - col.dfile, (col.dx**2 + col.dy**2).sqrt()
    pair = [
        pl.min_horizontal("file", before).alias("j"),
        pl.max_horizontal("file", before).alias("k"),
    ]
    is_apart = (moved > _BLUR + _FASTEST * col.dt).any()
    people = steps.group_by(*person, *pair).agg(apart=is_apart)
    pairs = people.sort("j", "k", "apart", *person).group_by(
        "j", "k", maintain_order=True
    )
    counts = pairs.agg(
        (~col.apart).sum().alias("together"), pl.sum("apart"), pl.last("id")
    )
    return counts.rows()


def name_recordings(files: Sequence[Path]) -> list[str]:
    """A name for each of `files`: without its ending, with its folder where two files have the same name."""
    stems = [file_stem(file) for file in files]
    names = list[str]()
    for file, stem in zip(files, stems, strict=True):
        name = f"{file.parent.name}-{stem}" if stems.count(stem) > 1 else stem
        n = sum(other.partition(" (")[0] == name for other in names)
        names.append(f"{name} ({n + 1})" if n else name)
    return names


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
