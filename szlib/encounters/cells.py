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
whole cells are selected, so that 1 to 3 still hold.  One pass over a file sorted by time, as ATC's are, is
enough, because a cell depends only on a few later ones.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from math import ceil

import numpy as np
import polars as pl

from ..tracks.clock import VELOCITY_SPAN
from .blocks import NUMBERS
from .geometry import Square

_SLOTS = 1 << 16  # of the hash table
# Fibonacci hashing (Knuth, TAOCP 3, 6.4) spreads ids over the table, also regular ones.
_MIXER, _SHIFT = np.int64(-7_046_029_254_386_353_131), 40
# larger than every rounding error of a time [s], position [m]
_TIME_ROUNDING, _POSITION_ROUNDING = (0.1, 1e-6)


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
        return ceil(
            (max(self.duration, VELOCITY_SPAN) + self.max_gap + _TIME_ROUNDING)
            / self.width
        )

    def number(self, t: np.ndarray) -> np.ndarray:
        """Number of the cell in time, for times `t` [s]."""
        return np.asarray(np.floor(t * (1 / self.width)).astype(np.int64))

    def needed(self, rows: pl.DataFrame, number: np.ndarray) -> np.ndarray:
        """Whether the cell of each of the `rows` is needed; `number` as from `number`; shape (n,)."""
        person = (rows["id"].to_numpy().astype(np.int64) * _MIXER) >> _SHIFT
        slot = (person + number) & (_SLOTS - 1)
        pair = self._find_sides(rows, slot)
        pair |= np.roll(pair, -1, axis=1)
        inside = np.asarray(pair.all(axis=0))
        needed = inside.copy()
        for cell in range(
            -self.before, self.after + 2
        ):  # the tick may be in the pair's second cell
            needed |= np.roll(inside, cell)
        return np.asarray(needed[slot])

    def _find_sides(self, rows: pl.DataFrame, slot: np.ndarray) -> np.ndarray:
        """Whether a row of each slot is on the inner side of each edge of the square; shape (4, slots)."""
        (x0, x1), (y0, y1) = np.divide([self.square.x, self.square.y], self.metres)
        rounding = _POSITION_ROUNDING / self.metres
        x, y = rows["x"].to_numpy(), rows["y"].to_numpy()
        within = (
            x >= x0 - rounding,
            x <= x1 + rounding,
            y >= y0 - rounding,
            y <= y1 + rounding,
        )
        sides = np.zeros((len(within), _SLOTS), bool)
        for side, is_within in zip(sides, within, strict=True):
            side[slot[is_within]] = True
        return sides


def select_near(cells: Cells, blocks: Iterable[pl.DataFrame]) -> Iterator[pl.DataFrame]:
    """Yield the rows of needed `cells` from `blocks` sorted by time; else raise UnsortedError."""
    waiting = pl.DataFrame(schema=dict.fromkeys(NUMBERS, pl.Float64) | {"id": pl.Int64})
    decided = newest = np.iinfo(np.int64).min // 2
    for block in blocks:
        number = cells.number(block["t"].to_numpy())
        if number.min() < newest:
            raise UnsortedError
        newest = int(number.max())
        known = pl.concat([waiting, block], rechunk=True)
        number = cells.number(known["t"].to_numpy())
        complete = newest - cells.before - 2
        yield known.filter(
            cells.needed(known, number) & (number > decided) & (number <= complete)
        )
        decided = max(decided, complete)
        waiting = known.filter(number >= decided - cells.after)
    number = cells.number(waiting["t"].to_numpy())
    yield waiting.filter(cells.needed(waiting, number) & (number > decided))
