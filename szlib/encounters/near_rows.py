"""The rows of a day that encounters in an area can depend on: `select_near`.

A raw day has 15 million rows, most of them far from the area.  `szlib.find_encounters` finds the same
encounters in the selected rows as in all rows, bit for bit.  The proof uses these terms: g is the longest gap
[s] within a track; 0.1 s is the step of the clock; "the rectangle" is the smallest one along the axes around
the area, grown by the 5 m in which kinds of encounter are decided.

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
"""

from __future__ import annotations

from math import ceil

import polars as pl

from ..tracks.clock import VELOCITY_SPAN
from .areas import AUTO, as_area
from .kinds import REACH
from .settings import EncounterSettings

# larger than every rounding error of a time [s], position [m]
_TIME_ROUNDING, _POSITION_ROUNDING = (0.1, 1e-6)


def select_near(
    settings: EncounterSettings,
    rows: pl.DataFrame,
    area: object,
    max_gap: float | None,
) -> pl.DataFrame:
    """Select the rows on which encounters can depend; all where nobody comes near, or the area is unknown.

    Parameters
    ----------
    settings : what counts as an encounter, and where.
    rows : day, id, t [s], x, y [m], in any order.
    area : that of the files, where the settings have none.
    max_gap : the longest gap within a track [s]; None: unknown.
    """
    area = area if settings.area is None else settings.area
    if max_gap is None or area in (None, AUTO):
        return rows
    around = as_area(area).grown(REACH + _POSITION_ROUNDING)
    width = max_gap + _TIME_ROUNDING
    before = ceil(VELOCITY_SPAN / width) + 1
    after = max(before, ceil(settings.duration / width) + 1)
    cell, keys = pl.col("cell"), ["day", "id", "cell"]
    all_rows = rows.lazy().with_columns(cell=(pl.col("t") / width).floor())
    cells = all_rows.group_by(keys).agg(
        pl.min("x", "y").name.prefix("low_"), pl.max("x", "y").name.prefix("high_")
    )
    inside = (  # of two successive cells, the first
        pl.concat([cells, cells.with_columns(cell - 1)])
        .group_by(keys)
        .having(
            pl.max("high_x") >= around.x[0],
            pl.min("low_x") <= around.x[1],
            pl.max("high_y") >= around.y[0],
            pl.min("low_y") <= around.y[1],
        )
        .agg()
    )
    needed = [inside.with_columns(cell + k) for k in range(-before, after + 2)]
    near = all_rows.join(pl.concat(needed), keys, "semi", maintain_order="left")
    found = near.drop("cell").collect()
    return found if found.height else rows
