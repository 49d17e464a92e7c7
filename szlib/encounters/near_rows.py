"""The rows of a track table, or of a file, that encounters in an area can depend on.

`select_near_rows` takes them from a track table (one row in six of a mall's day), `read_near_area` from a
file.  `szlib.find_encounters` finds the same encounters in them as in all rows.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pandas as pd
import polars as pl

from .. import memory
from ..tracks import funnels
from ..tracks.clock import TICKS_PER_SECOND, VELOCITY_SPAN
from ..tracks.formats import TrackFormat, open_file
from ..tracks.options import ReadOptions
from ..tracks.plausibility import check_unit
from ..tracks.readers import merge, order_by_person, read_raw, read_stage
from ..tracks.recordings import LoadedFile
from . import near_rows_cache
from .blocks import FileRows, FileSummary, UsableBlocks
from .cells import Cells, UnsortedError, select_in_one_pass, select_in_two_passes
from .geometry import Area
from .kinds import REACH
from .near_rows_cache import Content
from .occupants import TrackRows

_ROW_BYTES = 180
"""Memory that a row near the area takes until its day is done (15.6 million of them: 2.7 GB)."""


def select_near_rows(tracks: pd.DataFrame, area: Area, duration: float) -> pd.DataFrame:
    """Select the rows of `tracks`, by person and time, that encounters in the `area` can depend on.

    `szlib.find_encounters` finds the same encounters in them, in this area or in one inside it, with windows
    of `duration` [s] or less.  The funnel counts the other rows.  Raises DataError as `find_encounters`.
    """
    rows = TrackRows.from_tracks(tracks)
    near = is_near(rows.x, rows.y, rows.person, area, duration)
    stage = funnels.stage("near the area", len(near), near.sum(), {"elsewhere": (~near).sum()})
    table = tracks.iloc[rows.order[near]].reset_index(drop=True)
    return funnels.attach(table, [*funnels.get(tracks), stage])


def is_near(x: np.ndarray, y: np.ndarray, person: np.ndarray, area: Area, duration: float) -> np.ndarray:
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
    return np.asarray(count[np.minimum(after + 1, len(row))] > count[np.maximum(before, 0)])


def read_near_area(
    paths: str | Path | Sequence[Path],
    *,
    area: Area | None,
    duration: float,
    options: ReadOptions | None = None,
    content: Content | None = None,
) -> pd.DataFrame:
    """Read the rows of files that encounters in an area can depend on, as `tracks.readers.read_raw` does.

    A single ATC raw file is streamed.  Other files are small: all their rows are read.

    Parameters
    ----------
    paths : one file, or several of one day.
    area, duration : as in `szlib.EncounterSettings`; area None reads all rows.
    options : how the files are read.
    content : gives size and checksum of a single file, as `szlib.files.file_content`; with it the rows are
        stored in the user's cache, and loaded from there (`near_rows_cache`).

    Returns
    -------
    The rows; empty where nobody came near.  The funnel counts every row of the files.

    Raises
    ------
    DataError : as `szlib.read_tracks`.
    """
    options = options or ReadOptions()
    files = [Path(paths)] if isinstance(paths, str | Path) else list(paths)
    path = files[0]
    if area is not None and len(files) == 1 and path.is_file():
        with open_file(path, options) as (layout, scan, plain):
            if layout.is_streamed:
                max_gap = options.max_gap or layout.max_gap or 0.0
                cells = Cells(area.grown(REACH).box, duration, max_gap, layout.metres)
                blocks = UsableBlocks(layout.quick_scan(plain), scan, layout)
                near, summary = _load_or_select(blocks, path, layout, cells, content)
                return _as_table(near, summary, path, layout, options)
    return read_raw(files, options=options)


def _load_or_select(
    blocks: UsableBlocks, path: Path, layout: TrackFormat, cells: Cells, content: Content | None
) -> tuple[FileRows, FileSummary]:
    """The rows near the area, loaded from the cache or selected from the file, and a summary of the file."""
    selection = {"format": asdict(layout), "cells": asdict(cells)}
    if content and (found := near_rows_cache.load(path.stat().st_size, selection, content)):
        return found
    try:
        parts = _collect(select_in_one_pass(cells, blocks), path)
    except UnsortedError:
        parts = _collect(select_in_two_passes(cells, blocks), path)
    order = order_by_person(np.concatenate([rows.id for rows in parts]))
    near = FileRows(*(np.concatenate(values)[order] for values in zip(*parts, strict=True)))
    if content:
        near_rows_cache.store(content(), selection, near, blocks.summary)
    return near, blocks.summary


def _collect(blocks: Iterator[FileRows], path: Path) -> list[FileRows]:
    """The rows of all blocks; raises MemoryLimitError as soon as they are too many."""
    parts, count = [], 0
    for rows in blocks:
        parts.append(rows)
        count += len(rows.t)
        memory.require(count * _ROW_BYTES, f"{path}: to hold {count:,} rows near the area, or more,")
    return parts


def _as_table(
    near: FileRows, summary: FileSummary, path: Path, layout: TrackFormat, options: ReadOptions
) -> pd.DataFrame:
    """The rows as a table as from `read_raw`, with the funnel of the whole file; it overwrites `near`."""
    stage = read_stage(path, layout, summary.usable, dict(summary.reasons), summary.first_fault)
    if options.unit is None:
        check_unit(pl.DataFrame({"x": [summary.farthest], "y": [0.0]}), layout, path)
    far = {"never near the area": summary.usable - len(near.t)}
    stages = [stage, funnels.stage("near the area", summary.usable, len(near.t), far)]
    if len(near.t) == 0:
        empty = {"day": pd.Categorical([]), "id": np.zeros(0, np.int64)}
        return funnels.attach(pd.DataFrame(empty | dict.fromkeys("txy", np.zeros(0))), stages)
    for values in (near.x, near.y):
        values *= layout.metres
    layout = replace(layout, metres=1.0)
    rows = layout.to_metres(pl.DataFrame(near._asdict()), path, options.tz)
    return merge([LoadedFile(path, rows, stages, layout)], copy=False)
