"""A raw day, streamed: of millions of rows only those that encounters in the square can depend on.

`read_near_square` gives a table from which `to_clock` and `find_encounters` make the very encounters, bit
for bit, that they make from the whole day.  Why that is so, with g the longest gap [s] within a track, 0.1 s
the clock, and "the square" the one asked for (or the smallest around an
area of another shape), grown by the 5 m in which kinds of encounter are decided:

1. Cut time into cells of w > g seconds for each person.  Rows leave the scan by whole cells.  Of two
   kept rows, consecutive among the kept ones and at most g apart, no dropped row can lie between: a
   dropped cell between them would be longer than g.  So whatever `to_clock` interpolates from kept rows
   it interpolates from the same two rows of the whole day: no tick is new, none has moved.
2. A tick inside the square lies between two rows at most g apart, in one cell or in two successive ones.
   Were all rows of both cells on the outer side of one of the square's four edges, so were the tick.  So
   where it is not so, for any of the edges, the cells *may* have a tick inside; no speed is assumed.
3. `find_encounters` uses of rows outside the square only these: those of a person who is inside, from
   0.5 s before (velocity of the reference pedestrian) to the end of the window of 3 s after (both are
   tracked, and the other person is sampled), and g further to interpolate.  All cells that this reaches
   from cells that may have a tick inside are kept.  (Kinds need ticks inside and their velocities only.)

Cells are found by a hash: those that share a slot are kept if one of them is, which keeps whole cells,
and more of them, so that 1 to 3 hold.  Files sorted by time, as ATC's are, need one pass, for what comes
more than a few cells later cannot matter any more; others need two.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from math import ceil
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
import polars as pl

from .. import memory
from ..tracks import funnels
from ..tracks.clock import VELOCITY_SPAN
from ..tracks.formats.layouts import Columns, Format, readable, recognise
from ..tracks.formats.plain import plain_file
from ..tracks.formats.rows import fault, faults, in_metres
from ..tracks.plausible import check_unit
from ..tracks.readers import merge, read_raw, read_stage
from .geometry import Area, Square
from .kinds import REACH

_ROWS_AT_ONCE = 1 << 17
"""Rows of one block [about 5 minutes of a raw day]."""
_CELLS, _ALL_CELLS = 1 << 16, 1 << 24
"""Slots of the table of cells: for one block, and for a whole day that is not sorted by time."""
_MIXER, _SHIFT = np.int64(-7_046_029_254_386_353_131), 40
"""Fibonacci hashing (Knuth, TAOCP 3, 6.4): spreads ids over the table, be they as regular as they like."""
_SLACK = 0.1
"""Covers every rounding of a time [s]."""
_NEAR_ROW = 180
"""Bytes that a row near the square takes until its day is done (15.6 million of them: 2.7 GB)."""
_TOUCH = 1e-6
"""Covers every rounding of a position [m]."""


@dataclass(frozen=True)
class Cells:
    """Which cells of (person, w seconds) encounters in the square can depend on (see the module)."""

    square: Square
    duration: float
    max_gap: float
    metres: float

    @property
    def width(self) -> float:
        """Length w of a cell [s]."""
        return self.max_gap + _SLACK

    @property
    def before(self) -> int:
        """Cells needed before one with a tick inside."""
        return ceil((VELOCITY_SPAN + self.max_gap + _SLACK) / self.width)

    @property
    def after(self) -> int:
        """Cells needed after one with a tick inside."""
        return ceil((max(self.duration, VELOCITY_SPAN) + self.max_gap + _SLACK) / self.width)

    def number(self, t: np.ndarray | np.floating) -> np.ndarray:
        """Number of the cell in time, for times [s]."""
        return np.asarray(np.floor(t * (1 / self.width)).astype(np.int64))

    def slot(self, rows: Rows, number: np.ndarray, slots: int) -> np.ndarray:
        """Slot of each row's cell in a table; successive cells of a person have successive slots."""
        person = (rows.id.astype(np.int64) * _MIXER) >> _SHIFT
        return np.asarray((person + number) & (slots - 1))

    def mark(self, sides: np.ndarray, rows: Rows, slot: np.ndarray) -> None:
        """Mark in `sides` (4, slots) the cells with a row that is not outside of each of the four edges."""
        (x0, x1), (y0, y1) = np.divide([self.square.x, self.square.y], self.metres)
        touch = _TOUCH / self.metres
        within = (rows.x >= x0 - touch, rows.x <= x1 + touch, rows.y >= y0 - touch, rows.y <= y1 + touch)
        for side, reached in zip(sides, within, strict=True):
            side[np.compress(reached, slot)] = True

    def needed(self, sides: np.ndarray) -> np.ndarray:
        """Which slots are needed, from `sides` (4, slots); shape (slots,)."""
        pair = sides | np.roll(sides, -1, axis=1)
        inside = pair.all(axis=0)
        needed = inside.copy()
        for cell in range(-self.before, self.after + 2):  # the tick may be in the pair's second cell
            needed |= np.roll(inside, cell)
        return np.asarray(needed)


def read_near_square(
    path: str | Path,
    *,
    square: Area,
    duration: float,
    file_format: str | None = None,
    unit: str | None = None,
    frame_rate: float | None = None,
    max_gap: float | None = None,
    tz: str = "Asia/Tokyo",
    columns: Columns | None = None,
) -> pd.DataFrame:
    """The rows of a file that encounters in the square can depend on, as from `tracks.readers.read_raw`.

    Only ATC raw files are streamed; others are small, and are read whole.  `square` and `duration` [s] are
    those of `szlib.find_encounters`, the others those of `szlib.read_tracks`.  The table is empty where
    nobody came near; its funnel counts every row of the file.

    Raises
    ------
    DataError : as `szlib.read_tracks`.
    """
    path = Path(path)
    if path.is_file():
        with plain_file(path) as plain:
            layout, scan = recognise(plain, path, file_format, frame_rate, columns=columns, unit=unit)
            if layout.name == "atc-raw":
                metres = layout.metres_in(unit)
                cells = Cells(square.grown(REACH).box, duration, max_gap or layout.max_gap or 0.0, metres)
                return _read(scan, path, layout, cells, unit=unit, tz=tz)
    given = {"file_format": file_format, "unit": unit, "frame_rate": frame_rate, "columns": columns}
    return read_raw(path, tz=tz, **given)  # type: ignore[arg-type]


def _read(
    scan: pl.LazyFrame, path: Path, layout: Format, cells: Cells, *, unit: str | None, tz: str
) -> pd.DataFrame:
    with readable(path, layout):
        blocks = Blocks(scan, cells.metres, layout.seconds)
        try:
            parts = _gather(_one_pass(cells, blocks), path)
        except _Unsorted:
            parts = _gather(_two_passes(cells, blocks), path)
    near = pl.DataFrame(dict(zip(Rows._fields, map(np.concatenate, zip(*parts, strict=True)), strict=True)))
    stage = read_stage(path, layout, blocks.good, dict(blocks.reasons), blocks.first)
    if unit is None:
        check_unit(pl.DataFrame({"x": [blocks.reach], "y": [0.0]}), layout, path)
    far = {"never near the square": blocks.good - near.height}
    stages = [stage, funnels.stage("near the square", blocks.good, near.height, far)]
    if near.height == 0:
        empty = {"day": pd.Categorical([]), "id": np.zeros(0, np.int64)}
        return funnels.carry(pd.DataFrame(empty | dict.fromkeys("txy", np.zeros(0))), stages)
    return merge([in_metres(near, path, layout, cells.metres, tz)], stages, [layout], [])


def _gather(blocks: Iterator[Rows], path: Path) -> list[Rows]:
    """The rows of all blocks; raises MemoryLimitError as soon as they are too many."""
    parts, count = [], 0
    for rows in blocks:
        parts.append(rows)
        count += len(rows.t)
        memory.require(count * _NEAR_ROW, f"{path}: to keep {count:,} rows near the square, or more,")
    return parts


class _Unsorted(Exception):
    """The rows are not sorted by time."""


class Rows(NamedTuple):
    """Usable rows as they stand in the file, each array of shape (n,)."""

    t: np.ndarray
    id: np.ndarray
    x: np.ndarray
    y: np.ndarray

    def where(self, mask: np.ndarray) -> Rows:
        """Some of the rows."""
        return Rows(*(np.compress(mask, values) for values in self))


@dataclass
class Blocks:
    """A scan's usable rows, block by block in the order of the file; counts what it has seen."""

    scan: pl.LazyFrame
    metres: float
    seconds: float
    good: int = 0
    reach: float = 0.0
    reasons: Counter[str] = field(default_factory=Counter)
    first: tuple[int, str] | None = None

    def __iter__(self) -> Iterator[Rows]:
        self.good, self.reach, self.reasons, self.first = 0, 0.0, Counter(), None
        layout = self.metres, self.seconds, False
        usable = ~pl.any_horizontal(faults(*layout).values())
        marked = self.scan.with_columns(usable=usable.fill_null(False))
        for block in marked.collect_batches(
            chunk_size=_ROWS_AT_ONCE, maintain_order=True, engine="streaming"
        ):
            rows = Rows(*(block[name].to_numpy() for name in Rows._fields))
            if not block["usable"].all():
                bad = block.filter(~pl.col("usable")).with_columns(reason=fault(*layout))
                self.first = self.first or bad.select("line", "reason").row(0)
                self.reasons.update(dict(bad.group_by("reason", maintain_order=True).len().iter_rows()))
                rows = rows.where(block["usable"].to_numpy())
            if len(rows.t):
                self.good += len(rows.t)
                self.reach = max(self.reach, *(float(np.abs(v).max()) for v in (rows.x, rows.y)))
                yield rows


def _one_pass(cells: Cells, blocks: Blocks) -> Iterator[Rows]:
    """The rows of needed cells, each as soon as all that it depends on has been seen."""
    waiting = Rows(*np.zeros((4, 0)))
    decided = newest = np.iinfo(np.int64).min // 2
    for block in blocks:
        if cells.number(block.t.min()) < newest:
            raise _Unsorted
        known = Rows(*map(np.concatenate, zip(waiting, block, strict=True)))
        number = cells.number(known.t)
        needed = _needed(cells, known, number)
        newest = int(number.max())
        ripe = newest - cells.before - 2
        yield known.where(needed & (number > decided) & (number <= ripe))
        decided = max(decided, ripe)
        waiting = known.where(number >= decided - cells.after)
    number = cells.number(waiting.t)
    yield waiting.where(_needed(cells, waiting, number) & (number > decided))


def _needed(cells: Cells, rows: Rows, number: np.ndarray) -> np.ndarray:
    slot, sides = cells.slot(rows, number, _CELLS), np.zeros((4, _CELLS), bool)
    cells.mark(sides, rows, slot)
    return np.asarray(cells.needed(sides)[slot])


def _two_passes(cells: Cells, blocks: Blocks) -> Iterator[Rows]:
    """The rows of needed cells, of rows in any order."""
    sides = np.zeros((4, _ALL_CELLS), bool)
    for block in blocks:
        cells.mark(sides, block, cells.slot(block, cells.number(block.t), _ALL_CELLS))
    needed = cells.needed(sides)
    for block in blocks:
        yield block.where(needed[cells.slot(block, cells.number(block.t), _ALL_CELLS)])
