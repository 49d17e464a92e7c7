"""The usable rows of a raw file, block by block, and a summary of the file."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import polars as pl

from ..tracks.formats import TrackFormat
from ..tracks.readers import reject_rows

_BLOCK_ROWS = 1 << 17
"""Rows of one block [about 5 minutes of a raw day]."""


class FileRows(NamedTuple):
    """Usable rows as they stand in the file; each array has shape (n,).

    Attributes
    ----------
    t, id, x, y : time, person and position, in the units of the file.
    """

    t: np.ndarray
    id: np.ndarray
    x: np.ndarray
    y: np.ndarray

    def take(self, rows: np.ndarray) -> FileRows:
        """The rows at the indices `rows`."""
        return FileRows(*(values[rows] for values in self))


@dataclass
class FileSummary:
    """Counts of the rows of a file.

    Attributes
    ----------
    usable : number of usable rows.
    farthest : their greatest coordinate, in the unit of the file.
    reasons : number of rejected rows, by reason.
    first_fault : line and reason of the first rejected row.
    """

    usable: int = 0
    farthest: float = 0.0
    reasons: Counter[str] = field(default_factory=Counter)
    first_fault: tuple[int, str] | None = None


@dataclass
class UsableBlocks:
    """The usable rows of a scan, block by block, in the order of the file.

    Attributes
    ----------
    quick_scan : a faster scan of the same file; it is read up to the first row that is not usable.
    scan : a scan of the file, as from `recognise`.
    layout : the format of the file.
    summary : of the rows read so far.
    """

    quick_scan: pl.LazyFrame
    scan: pl.LazyFrame
    layout: TrackFormat
    summary: FileSummary = field(default_factory=FileSummary)

    def __iter__(self) -> Iterator[FileRows]:
        self.summary, read = FileSummary(), 0
        for block in _batches(self.quick_scan):
            rows = _as_numbers(block)
            if not self._all_usable(block, rows):
                break
            read += block.height
            yield self._counted(rows)
        else:
            return
        for block in _batches(self.scan.slice(read)):
            if len((rows := self._usable(block, read)).t):
                yield self._counted(rows)
            read += block.height

    def _counted(self, rows: FileRows) -> FileRows:
        self.summary.usable += len(rows.t)
        self.summary.farthest = max(self.summary.farthest, _largest(rows.x), _largest(rows.y))
        return rows

    def _all_usable(self, block: pl.DataFrame, rows: FileRows) -> bool:
        """Whether every row is usable; where the extreme values are within the limits, all values are."""
        limit = self.layout.value_limits()
        within = (_largest(v) * limit[name][0] <= limit[name][1] for name, v in rows._asdict().items())
        return all(within) and not block["ragged"].any() and np.array_equal(rows.id, np.floor(rows.id))

    def _usable(self, block: pl.DataFrame, read: int) -> FileRows:
        """The usable rows of a block; counts the others."""
        good, reasons, first = reject_rows(block.with_row_index("line", offset=read + 1), self.layout)
        self.summary.first_fault = self.summary.first_fault or first
        self.summary.reasons.update(reasons)
        return _as_numbers(good)


def _batches(scan: pl.LazyFrame) -> Iterator[pl.DataFrame]:
    columns = scan.select("ragged", *FileRows._fields)  # without the line numbers, which take long
    batches = columns.collect_batches(chunk_size=_BLOCK_ROWS, maintain_order=True, engine="streaming")
    return (block for block in batches if block.height)


def _as_numbers(block: pl.DataFrame) -> FileRows:
    """The columns of a block as floats; NaN where a value is missing."""
    return FileRows(*(block[name].to_numpy().astype(float, copy=False) for name in FileRows._fields))


def _largest(values: np.ndarray) -> float:
    """The largest absolute value; NaN if any value is NaN."""
    return float(np.abs([values.min(), values.max()]).max())
