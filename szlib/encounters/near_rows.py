"""The rows of a file near the square, as a table: `read_near_square`."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pandas as pd
import polars as pl

from .. import memory
from ..tracks import funnels
from ..tracks.formats import TrackFormat, open_file
from ..tracks.formats.base import readable
from ..tracks.formats.rows import to_metres
from ..tracks.formats.unpack import unpacked
from ..tracks.options import ReadOptions
from ..tracks.plausibility import check_unit
from ..tracks.readers import merge, order_by_person, read_raw, read_stage
from ..tracks.recordings import FileRows
from . import near_rows_cache as kept_rows
from .blocks import Blocks, Rows, Tally
from .cells import Cells, Unsorted, one_pass, two_passes
from .geometry import Area
from .kinds import REACH

_NEAR_ROW = 180
"""Bytes that a row near the square takes until its day is done (15.6 million of them: 2.7 GB)."""


def read_near_square(
    path: str | Path,
    *,
    square: Area,
    duration: float,
    options: ReadOptions | None = None,
    content: kept_rows.Content | None = None,
) -> pd.DataFrame:
    """The rows of a file that encounters in the square can depend on, as from `tracks.readers.read_raw`.

    Only ATC raw files are streamed; others are small, and are read whole.  `square` and `duration` [s] are
    those of `szlib.find_encounters`, `options` those of `szlib.read_tracks`.  The table is empty where
    nobody came near; its funnel counts every row of the file.  With `content`, which gives that of the file
    as `szlib.files.file_content`, the rows are kept in the user's cache (`kept_rows`), and taken from it.

    Raises
    ------
    DataError : as `szlib.read_tracks`.
    """
    path, options = Path(path), options or ReadOptions()
    if path.is_file():
        with unpacked(path) as plain:
            layout, scan = open_file(plain, path, options)
            if layout.is_streamed:
                cells = Cells(
                    square.grown(REACH).box, duration, options.max_gap or layout.max_gap or 0.0, layout.metres
                )
                blocks = Blocks(layout.quick_scan(plain), scan, layout.metres, layout.seconds)
                near, seen = _near(blocks, path, layout, cells, content)
                return _table(near, seen, path, layout, options)
    return read_raw(path, options=options)


def _near(
    blocks: Blocks, path: Path, layout: TrackFormat, cells: Cells, content: kept_rows.Content | None
) -> tuple[Rows, Tally]:
    """The rows near the square, from the cache where they are kept, and what was seen of the file."""
    which = {"format": asdict(layout), "cells": asdict(cells)}
    if content and (known := kept_rows.find(path.stat().st_size, which, content)):
        return known
    with readable(path, layout):
        try:
            parts = _gather(one_pass(cells, blocks), path)
        except Unsorted:
            parts = _gather(two_passes(cells, blocks), path)
    order = order_by_person(np.concatenate([rows.id for rows in parts]))
    near = Rows(*(np.concatenate(values)[order] for values in zip(*parts, strict=True)))
    if content:
        kept_rows.remember(content(), which, near, blocks.tally)
    return near, blocks.tally


def _table(near: Rows, seen: Tally, path: Path, layout: TrackFormat, options: ReadOptions) -> pd.DataFrame:
    """The rows, whose memory it takes, as from `read_raw`, with the funnel of the whole file."""
    stage = read_stage(path, layout, seen.good, dict(seen.reasons), seen.first)
    if options.unit is None:
        check_unit(pl.DataFrame({"x": [seen.reach], "y": [0.0]}), layout, path)
    far = {"never near the square": seen.good - len(near.t)}
    stages = [stage, funnels.stage("near the square", seen.good, len(near.t), far)]
    if len(near.t) == 0:
        empty = {"day": pd.Categorical([]), "id": np.zeros(0, np.int64)}
        return funnels.attach(pd.DataFrame(empty | dict.fromkeys("txy", np.zeros(0))), stages)
    for values in (near.x, near.y):
        values *= layout.metres
    layout = replace(layout, metres=1.0)
    rows = to_metres(pl.DataFrame(near._asdict()), path, layout, options.tz)
    return merge([FileRows(path, rows, stages, layout)], copy=False)


def _gather(blocks: Iterator[Rows], path: Path) -> list[Rows]:
    """The rows of all blocks; raises MemoryLimitError as soon as they are too many."""
    parts, count = [], 0
    for rows in blocks:
        parts.append(rows)
        count += len(rows.t)
        memory.require(count * _NEAR_ROW, f"{path}: to keep {count:,} rows near the square, or more,")
    return parts
