"""Which rows of a file encounters in the square can depend on, as whole cells of (person, time).

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

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from math import ceil

import numpy as np

from ..tracks.clock import VELOCITY_SPAN
from .blocks import Rows
from .geometry import Square

_CELLS, _ALL_CELLS = 1 << 16, 1 << 24
"""Slots of the table of cells: for one block, and for a whole day that is not sorted by time."""
_MIXER, _SHIFT = np.int64(-7_046_029_254_386_353_131), 40
"""Fibonacci hashing (Knuth, TAOCP 3, 6.4): spreads ids over the table, be they as regular as they like."""
_SLACK = 0.1
"""Covers every rounding of a time [s]."""
_TOUCH = 1e-6
"""Covers every rounding of a position [m]."""


class Unsorted(Exception):
    """The rows are not sorted by time."""


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

    def sides(self, rows: Rows, slot: np.ndarray, slots: int) -> np.ndarray:
        """Which of `slots` have a row that is not outside of each of the square's four edges; (4, slots)."""
        (x0, x1), (y0, y1) = np.divide([self.square.x, self.square.y], self.metres)
        touch = _TOUCH / self.metres
        within = (rows.x >= x0 - touch, rows.x <= x1 + touch, rows.y >= y0 - touch, rows.y <= y1 + touch)
        edges = np.bitwise_or.reduce([side.view(np.uint8) << k for k, side in enumerate(within)])
        seen = np.zeros((1 << len(within), slots), bool)
        seen.ravel()[edges.astype(np.int64) * slots + slot] = True
        codes = np.arange(len(seen))
        return np.array([seen[(codes >> k) & 1 == 1].any(axis=0) for k in range(len(within))])

    def needed(self, sides: np.ndarray) -> np.ndarray:
        """Which slots are needed, from `sides` (4, slots); shape (slots,)."""
        pair = sides | np.roll(sides, -1, axis=1)
        inside = pair.all(axis=0)
        needed = inside.copy()
        for cell in range(-self.before, self.after + 2):  # the tick may be in the pair's second cell
            needed |= np.roll(inside, cell)
        return np.asarray(needed)


def one_pass(cells: Cells, blocks: Iterable[Rows]) -> Iterator[Rows]:
    """The rows of needed cells, each as soon as all that it depends on has been seen."""
    waiting = Rows(*np.zeros((4, 0)))
    decided = newest = np.iinfo(np.int64).min // 2
    for block in blocks:
        if cells.number(block.t.min()) < newest:
            raise Unsorted
        known = Rows(*map(np.concatenate, zip(waiting, block, strict=True)))
        number = cells.number(known.t)
        needed = _needed(cells, known, number)
        newest = int(number.max())
        ripe = newest - cells.before - 2
        yield known.at(np.flatnonzero(needed & (number > decided) & (number <= ripe)))
        decided = max(decided, ripe)
        waiting = known.at(np.flatnonzero(number >= decided - cells.after))
    number = cells.number(waiting.t)
    yield waiting.at(np.flatnonzero(_needed(cells, waiting, number) & (number > decided)))


def _needed(cells: Cells, rows: Rows, number: np.ndarray) -> np.ndarray:
    slot = cells.slot(rows, number, _CELLS)
    return np.asarray(cells.needed(cells.sides(rows, slot, _CELLS))[slot])


def two_passes(cells: Cells, blocks: Iterable[Rows]) -> Iterator[Rows]:
    """The rows of needed cells, of rows in any order."""
    sides = np.zeros((4, _ALL_CELLS), bool)
    for block in blocks:
        used, at = np.unique(cells.slot(block, cells.number(block.t), _ALL_CELLS), return_inverse=True)
        sides[:, used] |= cells.sides(block, at, len(used))
    needed = cells.needed(sides)
    for block in blocks:
        yield block.at(np.flatnonzero(needed[cells.slot(block, cells.number(block.t), _ALL_CELLS)]))
