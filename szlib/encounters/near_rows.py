"""The rows of a track table, or of a file, that encounters in an area can depend on.

`select_near_rows` takes them from a track table (one row in six of a mall's day), `read_near_area` from a
file.  `szlib.find_encounters` finds the same encounters in them as in all rows.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np
import pandas as pd
import polars as pl

from ..core import memory
from ..tracks import funnels
from ..tracks.clock import TICKS_PER_SECOND, VELOCITY_SPAN
from ..tracks.plausibility import check_unit
from ..tracks.readers import (
    LoadedFile,
    is_streamed,
    merge,
    open_file,
    order_by_person,
    read_raw,
    read_stage,
    with_days,
)
from ..tracks.recipe import Recipe, find_recipe
from .blocks import UsableBlocks
from .cells import Cells, UnsortedError, select_near
from .geometry import Area
from .kinds import REACH
from .occupants import TrackRows

_ROW_BYTES = 180  # memory of a row near the area until its day is done (15.6 million of them: 2.7 GB)


def select_near_rows(tracks: pd.DataFrame, area: Area, duration: float) -> pd.DataFrame:
    """Select the rows of `tracks`, by person and time, that encounters in the `area` can depend on.

    `szlib.find_encounters` finds the same encounters in them, in this area or in one inside it, with windows
    of `duration` [s] or less.  The funnel counts the other rows.  Raises DataError as `find_encounters`.
    """
    rows = TrackRows.from_tracks(tracks)
    near = is_near(rows.x, rows.y, rows.person, area, duration)
    stage = funnels.stage(
        "near the area", len(near), near.sum(), {"elsewhere": (~near).sum()}
    )
    table = tracks.iloc[rows.order[near]].reset_index(drop=True)
    return funnels.attach(table, [*funnels.get(tracks), stage])


def is_near(
    x: np.ndarray, y: np.ndarray, person: np.ndarray, area: Area, duration: float
) -> np.ndarray:
    """Whether encounters in the `area` can depend on each row at `x`, `y` [m]; shape (n,).

    Rows are sorted by `person` (numbered from 0) and time.  Of each person who is in the area at all, these
    are the rows in the area grown by `REACH` (for kinds of encounter), half a second around them (for
    velocities), and the `duration` [s] after them (both people must be tracked).
    """
    visits = np.zeros(person.max(initial=-1) + 1, bool)
    visits[person[area.contains(x, y)]] = True
    inside = area.grown(REACH).contains(x, y) & visits[person]
    count, row = np.r_[0, np.cumsum(inside)], np.arange(len(inside))
    after = row + round(VELOCITY_SPAN * TICKS_PER_SECOND)
    before = row - round(max(duration, VELOCITY_SPAN) * TICKS_PER_SECOND)
    return np.asarray(
        count[np.minimum(after + 1, len(row))] > count[np.maximum(before, 0)]
    )


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
            cells = Cells(area.grown(REACH).box, duration, found.max_gap or 0.0, 1.0)
            blocks, parts, n_near = UsableBlocks(scan), [], 0
            for rows in select_near(cells, blocks):
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
