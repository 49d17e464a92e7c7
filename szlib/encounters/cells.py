"""Selection of the rows of a file that encounters in an area can depend on, by cells of (person, time).

`read_near_area` reads a table from which `to_clock` and `find_encounters` compute exactly the encounters of
the whole day, bit for bit.  The proof uses these terms: g is the longest gap [s] within a track; 0.1 s is
the step of the clock; "the square" is the smallest one around the area, grown by the 5 m in which kinds of
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

Cells are stored in a hash table.  If one cell of a slot is selected, all cells of that slot are.  Then more
whole cells are selected, so that 1 to 3 still hold.  Files sorted by time, as ATC's are, need one pass,
because a cell depends only on a few later ones; other files need two passes.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from math import ceil

import numpy as np

from ..tracks.clock import VELOCITY_SPAN
from .blocks import FileRows
from .geometry import Square

_CELLS, _ALL_CELLS = 1 << 16, 1 << 24
"""Slots of the hash table: for one block, and for a whole day that is not sorted by time."""
_MIXER, _SHIFT = np.int64(-7_046_029_254_386_353_131), 40
"""Fibonacci hashing (Knuth, TAOCP 3, 6.4): spreads ids over the table, also regular ones."""
_TIME_ROUNDING = 0.1
"""Larger than every rounding error of a time [s]."""
_POSITION_ROUNDING = 1e-6
"""Larger than every rounding error of a position [m]."""


class UnsortedError(Exception):
    """The rows are not sorted by time."""


@dataclass(frozen=True)
class Cells:
    """Cells of (person, w seconds), and which of them encounters in the square can depend on (see above).

    Attributes
    ----------
    square : the smallest square around the area, grown by `REACH` [m].
    duration : of a window [s].
    max_gap : longest gap within a track [s].
    metres : length of the file's unit of position.
    """

    square: Square
    duration: float
    max_gap: float
    metres: float

    @property
    def width(self) -> float:
        """Length w of a cell [s]."""
        return self.max_gap + _TIME_ROUNDING

    @property
    def before(self) -> int:
        """Number of cells needed before one with a tick inside."""
        return ceil((VELOCITY_SPAN + self.max_gap + _TIME_ROUNDING) / self.width)

    @property
    def after(self) -> int:
        """Number of cells needed after one with a tick inside."""
        return ceil((max(self.duration, VELOCITY_SPAN) + self.max_gap + _TIME_ROUNDING) / self.width)

    def number(self, t: np.ndarray | np.floating) -> np.ndarray:
        """Number of the cell in time, for times `t` [s]."""
        return np.asarray(np.floor(t * (1 / self.width)).astype(np.int64))

    def slot(self, rows: FileRows, number: np.ndarray, slots: int) -> np.ndarray:
        """Slot of the cell of each of `rows`, whose cells in time have this `number`, in a table of `slots`.

        Successive cells of a person have successive slots.
        """
        person = (rows.id.astype(np.int64) * _MIXER) >> _SHIFT
        return np.asarray((person + number) & (slots - 1))

    def sides(self, rows: FileRows, slot: np.ndarray, slots: int) -> np.ndarray:
        """Whether each of `slots` has a row on the inner side of each of the square's four edges; (4, slots).

        `slot` is the slot of each of `rows`.
        """
        (x0, x1), (y0, y1) = np.divide([self.square.x, self.square.y], self.metres)
        rounding = _POSITION_ROUNDING / self.metres
        within = (
            rows.x >= x0 - rounding,
            rows.x <= x1 + rounding,
            rows.y >= y0 - rounding,
            rows.y <= y1 + rounding,
        )
        edges = np.bitwise_or.reduce([side.view(np.uint8) << k for k, side in enumerate(within)])
        occurs = np.zeros((1 << len(within), slots), bool)
        occurs.ravel()[edges.astype(np.int64) * slots + slot] = True
        codes = np.arange(len(occurs))
        return np.array([occurs[(codes >> k) & 1 == 1].any(axis=0) for k in range(len(within))])

    def needed(self, sides: np.ndarray) -> np.ndarray:
        """Whether each slot is needed, from `sides` (4, slots); shape (slots,)."""
        pair = sides | np.roll(sides, -1, axis=1)
        inside = pair.all(axis=0)
        needed = inside.copy()
        for cell in range(-self.before, self.after + 2):  # the tick may be in the pair's second cell
            needed |= np.roll(inside, cell)
        return np.asarray(needed)


def select_in_one_pass(cells: Cells, blocks: Iterable[FileRows]) -> Iterator[FileRows]:
    """Yield the rows of needed `cells` from `blocks` sorted by time; else raise UnsortedError."""
    waiting = FileRows(*np.zeros((4, 0)))
    decided = newest = np.iinfo(np.int64).min // 2
    for block in blocks:
        if cells.number(block.t.min()) < newest:
            raise UnsortedError
        known = FileRows(*map(np.concatenate, zip(waiting, block, strict=True)))
        number = cells.number(known.t)
        needed = _needed(cells, known, number)
        newest = int(number.max())
        complete = newest - cells.before - 2
        yield known.take(np.flatnonzero(needed & (number > decided) & (number <= complete)))
        decided = max(decided, complete)
        waiting = known.take(np.flatnonzero(number >= decided - cells.after))
    number = cells.number(waiting.t)
    yield waiting.take(np.flatnonzero(_needed(cells, waiting, number) & (number > decided)))


def _needed(cells: Cells, rows: FileRows, number: np.ndarray) -> np.ndarray:
    slot = cells.slot(rows, number, _CELLS)
    return np.asarray(cells.needed(cells.sides(rows, slot, _CELLS))[slot])


def select_in_two_passes(cells: Cells, blocks: Iterable[FileRows]) -> Iterator[FileRows]:
    """Yield the rows of needed `cells` from `blocks` in any order."""
    sides = np.zeros((4, _ALL_CELLS), bool)
    for block in blocks:
        used, at = np.unique(cells.slot(block, cells.number(block.t), _ALL_CELLS), return_inverse=True)
        sides[:, used] |= cells.sides(block, at, len(used))
    needed = cells.needed(sides)
    for block in blocks:
        yield block.take(np.flatnonzero(needed[cells.slot(block, cells.number(block.t), _ALL_CELLS)]))
