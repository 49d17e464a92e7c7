"""The rows of a file that encounters in an area can depend on: `read_near_area`.

`szlib.find_encounters` finds the same encounters in them as in all rows, bit for bit.

A raw file is read block by block.  The proof uses these terms: g is the longest gap [s] within a track; 0.1 s
is the step of the clock; "the square" is the smallest one around the area, grown by the 5 m in which kinds of
encounter are decided.

1. Time is cut into cells of w > g seconds for each person.  Only whole cells are dropped.  Take two selected
   rows that follow each other among the selected ones, at most g apart.  No dropped row lies between them,
   because a dropped cell between them would be longer than g.  So `to_clock` interpolates between the same
   two rows as in the whole day: no tick is new, and no tick has moved.
2. A tick inside the square lies between two rows at most g apart, in one cell or in two successive cells.
   If all rows of both cells were on the outer side of one of the square's four edges, the tick would be
   too.  So a tick can be inside only where this holds for no edge.  No speed is assumed.
3. Of the rows outside the square `find_encounters` uses only these: the rows of a person who is inside, from
   0.5 s before (velocity of the reference pedestrian) to the end of the window of 3 s after (both people
   are tracked, and the other person is sampled), and g further to interpolate.  All cells within this reach
   of a cell that can have a tick inside are selected.  (Kinds need only ticks inside and their velocities.)

One pass over a file sorted by time, as ATC's are, is enough, because a cell depends only on a few later ones.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from math import ceil
from pathlib import Path

import numpy as np
import pandas as pd
import polars as pl

from ..core import memory
from ..tracks import funnels
from ..tracks.clock import VELOCITY_SPAN
from ..tracks.plausibility import check_unit
from ..tracks.readers import (
    LoadedFile,
    is_streamed,
    merge,
    open_file,
    order_by_person,
    read_raw,
    read_stage,
    reject_rows,
    with_days,
)
from ..tracks.recipe import Recipe, find_recipe
from .geometry import Area
from .kinds import REACH

NUMBERS = ("t", "id", "x", "y")  # columns of a block: t [s], id, x, y [m]
_BLOCK_ROWS = 1 << 17  # of one block [about 5 minutes of a raw day]
# larger than every rounding error of a time [s], position [m]
_TIME_ROUNDING, _POSITION_ROUNDING = (0.1, 1e-6)
_ROW_BYTES = 180  # memory of a row near the area until its day is done (15.6 million of them: 2.7 GB)


class UnsortedError(Exception):
    """The rows are not sorted by time."""


@dataclass
class UsableBlocks:
    """The usable rows of a scan, block by block, in the order of the file.

    Attributes
    ----------
    scan : scan of the file.
    n_usable : number of usable rows so far.
    farthest : their largest absolute coordinate [m].
    reasons : number of the other rows by reason.
    first_fault : line and reason of the first of them.
    """

    scan: pl.LazyFrame
    n_usable: int = 0
    farthest: float = 0.0
    reasons: Counter[str] = field(default_factory=Counter)
    first_fault: tuple[int, str] | None = None

    def __iter__(self) -> Iterator[pl.DataFrame]:
        read = 0  # line numbers of the scan take long
        columns = self.scan.select("ragged", *NUMBERS)
        for block in columns.collect_batches(
            chunk_size=_BLOCK_ROWS, maintain_order=True, engine="streaming"
        ):
            lines = block.with_row_index("line", offset=read + 1)
            good, reasons, first = reject_rows(lines)
            read += block.height
            self.reasons.update(reasons)
            self.first_fault = self.first_fault or first
            if good.height:
                self.n_usable += good.height
                self.farthest = max(
                    self.farthest, *good.select(pl.col("x", "y").abs().max()).row(0)
                )
                yield good.select(NUMBERS)


def reach_in_cells(duration: float, max_gap: float) -> tuple[float, int, int]:
    """Length w of a cell [s], and how many cells before and after one with a tick inside are needed.

    `duration` [s] and `max_gap` [s] are as in `select_near`.
    """
    width = max_gap + _TIME_ROUNDING
    spans = (VELOCITY_SPAN, max(duration, VELOCITY_SPAN))
    before, after = (ceil((span + width) / width) for span in spans)
    return width, before, after


def select_near(
    blocks: Iterable[pl.DataFrame], square: Area, duration: float, max_gap: float
) -> Iterator[pl.DataFrame]:
    """Yield the needed rows of `blocks` sorted by time; else raise UnsortedError.

    `square` is the smallest one around the area, grown by `REACH`; `duration` [s] is that of a window, and
    `max_gap` [s] the longest gap within a track.
    """
    width, before, after = reach_in_cells(duration, max_gap)
    cell = (pl.col("t") / width).floor().cast(pl.Int64).alias("cell")
    waiting = pl.DataFrame(schema=dict.fromkeys(NUMBERS, pl.Float64) | {"id": pl.Int64})
    waiting = waiting.with_columns(cell)
    decided = newest = np.iinfo(np.int64).min // 2
    for block in blocks:
        block = block.with_columns(cell)
        if int(block["cell"].to_numpy().min()) < newest:
            raise UnsortedError
        newest = int(block["cell"].to_numpy().max())
        known = pl.concat([waiting, block], rechunk=True)
        complete = newest - before - 2
        chosen = pl.col("cell").is_between(decided + 1, complete)
        yield _needed(known, square, before, after).filter(chosen).select(NUMBERS)
        decided = max(decided, complete)
        waiting = known.filter(pl.col("cell") >= decided - after)
    rest = _needed(waiting, square, before, after).filter(pl.col("cell") > decided)
    yield rest.select(NUMBERS)


def _needed(rows: pl.DataFrame, square: Area, before: int, after: int) -> pl.DataFrame:
    """The `rows` in cells that are needed."""
    x0, y0 = square.x[0] - _POSITION_ROUNDING, square.y[0] - _POSITION_ROUNDING
    x1, y1 = square.x[1] + _POSITION_ROUNDING, square.y[1] + _POSITION_ROUNDING
    x, y = pl.col("x"), pl.col("y")
    inner = {"a": x >= x0, "b": x <= x1, "c": y >= y0, "d": y <= y1}
    sides = rows.select("id", "cell", **inner)
    earlier = sides.with_columns(pl.col("cell") - 1)
    both = pl.concat([sides, earlier]).group_by("id", "cell").agg(pl.all().any())
    inside = both.filter(pl.all_horizontal(*inner)).select("id", "cell")
    reach = [
        inside.with_columns(pl.col("cell") + step)
        for step in range(
            -before, after + 2
        )  # the tick may be in the pair's second cell
    ]
    needed = pl.concat(reach).unique()
    return rows.join(needed, on=["id", "cell"], how="semi", maintain_order="left")


def read_near_area(
    paths: str | Path | Sequence[Path],
    *,
    area: Area | None,
    duration: float,
    recipe: Recipe | None = None,
) -> pd.DataFrame:
    """Read the rows of files that encounters in an area can depend on, as `tracks.readers.read_raw` does.

    A single ATC raw file that is sorted by time is streamed.  Of other files all rows are read.

    Parameters
    ----------
    paths : one file, or several of one day.
    area, duration : as in `szlib.EncounterSettings`; area None reads all rows.
    recipe : how the files are read.

    Returns
    -------
    The rows; empty where nobody came near.  The funnel counts every row of the files.

    Raises
    ------
    DataError : as `szlib.read_tracks`.
    """
    files = [Path(paths)] if isinstance(paths, str | Path) else list(paths)
    path, recipe = files[0], find_recipe(files, recipe)
    if (
        area is not None
        and len(files) == 1
        and path.is_file()
        and is_streamed(path, recipe)
    ):
        with open_file(path, recipe) as (found, scan), suppress(UnsortedError):
            square, blocks = area.grown(REACH), UsableBlocks(scan)
            parts, n_near = [], 0
            for rows in select_near(blocks, square, duration, found.max_gap or 0.0):
                parts.append(rows)
                n_near += rows.height
                memory.require(
                    n_near * _ROW_BYTES,
                    f"{path}: to hold {n_near:,} rows near the area, or more,",
                )
            near = pl.concat(parts, rechunk=True)
            near = near[order_by_person(near["id"].to_numpy())]
            return _as_table(near, blocks, path, found, is_unit_given=recipe.has_places)
    return read_raw(files, recipe=recipe)


def _as_table(
    near: pl.DataFrame,
    blocks: UsableBlocks,
    path: Path,
    recipe: Recipe,
    *,
    is_unit_given: bool,
) -> pd.DataFrame:
    """The rows as a table as from `read_raw`, with the funnel of the whole file."""
    stage = read_stage(
        path, recipe, blocks.n_usable, dict(blocks.reasons), blocks.first_fault
    )
    if not is_unit_given:
        check_unit(pl.DataFrame({"x": [blocks.farthest], "y": [0.0]}), recipe, path)
    far = {"never near the area": blocks.n_usable - near.height}
    stages = [stage, funnels.stage("near the area", blocks.n_usable, near.height, far)]
    if near.height == 0:
        empty = {"day": pd.Categorical([]), "id": np.zeros(0, np.int64)}
        return funnels.attach(
            pd.DataFrame(empty | dict.fromkeys("txy", np.zeros(0))), stages
        )
    rows = with_days(near, path, recipe)
    return merge([LoadedFile(path, rows, stages, recipe)], copy=False)
