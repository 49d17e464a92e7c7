"""The rows of a file that encounters in an area can depend on: `read_near_area`.

`szlib.find_encounters` finds the same encounters in them as in all rows, bit for bit.

A raw file is read block by block.  The proof uses these terms: g is the longest gap [s] within a track; 0.1 s
is the step of the clock; "the rectangle" is the smallest one along the axes around the area, grown by the 5 m
in which kinds of encounter are decided.

1. Time is cut into cells of w > g seconds for each person.  Only whole cells are dropped.  Take two selected
   rows that follow each other among the selected ones, at most g apart.  No dropped row lies between them,
   because a dropped cell between them would be longer than g.  So `to_clock` interpolates between the same
   two rows as in the whole day: no tick is new, and no tick has moved.
2. A tick inside the rectangle lies between two rows at most g apart, in one cell or in two successive cells.
   If all rows of both cells were on the outer side of one of the rectangle's four edges, the tick would be
   too.  So a tick can be inside only where this holds for no edge.  No speed is assumed.
3. Of the rows outside the rectangle `find_encounters` uses only these: the rows of a person who is inside,
   from 0.5 s before (velocity of the reference pedestrian) to the end of the window of 3 s after (both people
   are tracked, and the other person is sampled), and g further to interpolate.  All cells within this reach
   of a cell that can have a tick inside are selected.  (Kinds need only ticks inside and their velocities.)

One pass over a file sorted by time, as ATC's are, is enough, because a cell depends only on a few later ones.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from itertools import chain
from math import ceil, inf
from pathlib import Path
from typing import Any

import pandas as pd
import polars as pl

from ..core import memory
from ..tracks import funnels
from ..tracks.clock import VELOCITY_SPAN
from ..tracks.plausibility import check_unit
from ..tracks.readers import (
    LoadedFile,
    find_format,
    is_streamed,
    merge,
    open_file,
    read_raw,
    read_stage,
    reject_rows,
    with_days,
)
from ..tracks.recipe import Recipe
from .areas import AUTO, as_area
from .geometry import Area
from .kinds import REACH
from .settings import EncounterSettings

_COLUMNS = ("id", "t", "x", "y")  # of a block: t [s], id, x, y [m]
_BLOCK_ROWS = 1 << 17  # of one block [about 5 minutes of a raw day]
# larger than every rounding error of a time [s], position [m]
_TIME_ROUNDING, _POSITION_ROUNDING = (0.1, 1e-6)
_ROW_BYTES = 180  # memory of a row near the area until its day is done (15.6 million of them: 2.7 GB)
# The last block of every file: somebody later than all others, and never near.
_END = pl.DataFrame({"id": [0], "t": [1e15], "x": [inf], "y": [inf]})


class UnsortedError(Exception):
    """The rows are not sorted by time."""


def read_near_area(
    files: Sequence[Path], settings: EncounterSettings, recipe: Recipe
) -> pd.DataFrame:
    """Read the rows of files that encounters in an area can depend on, as `tracks.readers.read_raw` does.

    A single ATC raw file that is sorted by time is streamed.  All rows are read of other files, and where the
    area must be found.

    Parameters
    ----------
    files : the files of one day.
    settings : what counts as an encounter, and where.
    recipe : how the files are read.

    Returns
    -------
    The rows; empty where nobody came near.  The funnel counts every row of the files.

    Raises
    ------
    DataError : as `szlib.read_tracks`.
    """
    path, *more = files
    area = find_format(path, recipe).area if settings.area is None else settings.area
    if not more and area not in (None, AUTO) and is_streamed(path, recipe):
        with suppress(UnsortedError):
            return _stream(path, as_area(area), settings.duration, recipe)
    return read_raw(files, recipe=recipe)


def _stream(path: Path, area: Area, duration: float, recipe: Recipe) -> pd.DataFrame:
    """As `read_near_area`, of one raw file; raises UnsortedError."""
    parts: list[pl.DataFrame] = []
    counts: list[tuple[Any, ...]] = []
    n_near = 0
    with open_file(path, recipe) as (found, scan):
        blocks = _usable_blocks(scan, counts)
        for rows in select_near(blocks, area, duration, found.max_gap or 0.0):
            parts.append(rows)
            n_near += rows.height
            memory.require(
                n_near * _ROW_BYTES,
                f"{path}: to hold {n_near:,} rows near the area, or more,",
            )
    usable, reasons, faults, farthest = zip(*counts, strict=True)
    n_usable, rejected = sum(usable), sum(map(Counter, reasons), Counter[str]())
    first_fault = next(filter(None, faults), None)
    read = read_stage(path, found, n_usable, rejected, first_fault)
    if not recipe.has_places:
        check_unit(pl.concat(farthest).max(), found, path)
    far = {"never near the area": n_usable - n_near}
    stages = [read, funnels.stage("near the area", n_usable, n_near, far)]
    if n_near == 0:
        nobody = pd.DataFrame(columns=["day", *_COLUMNS], dtype=float)
        return funnels.attach(nobody, stages)
    near = with_days(pl.concat(parts), path, found)
    return merge([LoadedFile(path, near, stages, found)], copy=False)


def _usable_blocks(
    scan: pl.LazyFrame, counts: list[tuple[Any, ...]]
) -> Iterator[pl.DataFrame]:
    """Yield the usable rows of a `scan` of a file, block by block.

    Of each block `counts` gets the number of usable rows, that of the others by reason, line and reason of
    the first of these, and the largest absolute coordinates [m].
    """
    n_read = 0  # line numbers of the scan take long
    batches = scan.select("ragged", *_COLUMNS).collect_batches(
        chunk_size=_BLOCK_ROWS, maintain_order=True, engine="streaming"
    )
    for block in batches:
        lines = block.with_row_index("line", offset=n_read + 1)
        good, reasons, first = reject_rows(lines)
        n_read += block.height
        farthest = good.select(pl.col("x", "y").abs().max())
        counts.append((good.height, reasons, first, farthest))
        if good.height:
            yield good.select(_COLUMNS)


def select_near(
    blocks: Iterable[pl.DataFrame], area: Area, duration: float, max_gap: float
) -> Iterator[pl.DataFrame]:
    """Yield the needed rows of `blocks` sorted by time; else raise UnsortedError.

    `area` and `duration` [s] are as in `szlib.EncounterSettings`, `max_gap` [s] is the longest gap within a
    track.
    """
    width = max_gap + _TIME_ROUNDING
    before = ceil(VELOCITY_SPAN / width) + 1
    after = max(before, ceil(duration / width) + 1)
    around = area.grown(REACH + _POSITION_ROUNDING)
    waiting: list[pl.DataFrame] = []
    cell, decided = pl.col("cell"), -inf
    for block in chain(blocks, [_END]):
        block = block.with_columns(cell=pl.col("t") // width)
        cells = block["cell"].to_numpy()
        if cells.min() < decided + before + 2:
            raise UnsortedError
        complete = cells.max() - before - 2
        rows = pl.concat([*waiting, block]).lazy()
        inside = (  # of two successive cells, the first
            pl.concat([rows, rows.with_columns(cell - 1)])
            .group_by("id", "cell")
            .having(
                pl.max("x") >= around.x[0],
                pl.min("x") <= around.x[1],
                pl.max("y") >= around.y[0],
                pl.min("y") <= around.y[1],
            )
            .agg()
        )
        needed = [inside.with_columns(cell + k) for k in range(-before, after + 2)]
        yield (
            rows.filter(cell.is_between(decided, complete, closed="right"))
            .join(pl.concat(needed), ["id", "cell"], "semi", maintain_order="left")
            .select(_COLUMNS)
            .collect()
        )
        waiting = [rows.filter(cell >= complete - after).collect()]
        decided = complete
