"""Several files: pieces of one recording are joined, different recordings get a day each."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import polars as pl

from ..core.errors import DataError, warn
from ..core.input_files import printable
from .recipe import Recipe
from .shapes import SHAPES

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
