"""The usable rows of a raw file, block by block; those that are set aside are counted."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import polars as pl

from ..tracks.formats.rows import rejection_reason, value_limits

_ROWS_AT_ONCE = 1 << 17
"""Rows of one block [about 5 minutes of a raw day]."""


class Rows(NamedTuple):
    """Usable rows as they stand in the file, each array of shape (n,)."""

    t: np.ndarray
    id: np.ndarray
    x: np.ndarray
    y: np.ndarray

    def at(self, rows: np.ndarray) -> Rows:
        """Some of the rows, by their indices."""
        return Rows(*(values[rows] for values in self))


@dataclass
class Tally:
    """What has been seen of a file: usable rows, their greatest coordinate, rows set aside by reason, and the
    line and reason of the first of these."""

    good: int = 0
    reach: float = 0.0
    reasons: Counter[str] = field(default_factory=Counter)
    first: tuple[int, str] | None = None


@dataclass
class Blocks:
    """A scan's usable rows, block by block in the order of the file; `tally` counts what was seen.

    `quick` is a faster scan of the same file, which is read as far as every row of it is usable.
    """

    quick: pl.LazyFrame
    scan: pl.LazyFrame
    metres: float
    seconds: float
    tally: Tally = field(default_factory=Tally)

    def __iter__(self) -> Iterator[Rows]:
        self.tally, seen = Tally(), 0
        for block in _batches(self.quick):
            rows = _numbers(block)
            if not self._spotless(block, rows):
                break
            seen += block.height
            yield self._counted(rows)
        else:
            return
        for block in _batches(self.scan.slice(seen)):
            if len((rows := self._usable(block, seen)).t):
                yield self._counted(rows)
            seen += block.height

    def _counted(self, rows: Rows) -> Rows:
        self.tally.good += len(rows.t)
        self.tally.reach = max(self.tally.reach, _farthest(rows.x), _farthest(rows.y))
        return rows

    def _spotless(self, block: pl.DataFrame, rows: Rows) -> bool:
        """Whether every row is usable: limits are kept by all values that lie between two that keep them."""
        limit = value_limits(self.metres, self.seconds)
        within = (_farthest(v) * limit[name][0] <= limit[name][1] for name, v in rows._asdict().items())
        return all(within) and not block["ragged"].any() and np.array_equal(rows.id, np.floor(rows.id))

    def _usable(self, block: pl.DataFrame, seen: int) -> Rows:
        """The usable rows of a block; counts the others."""
        rows = _numbers(block)
        if self._spotless(block, rows):
            return rows
        lines = block.with_row_index("line", offset=seen + 1)
        lines = lines.with_columns(reason=rejection_reason(self.metres, self.seconds, False))
        bad = lines.filter(pl.col("reason").is_not_null())
        if bad.height:
            self.tally.first = self.tally.first or bad.select("line", "reason").row(0)
            self.tally.reasons.update(dict(bad.group_by("reason", maintain_order=True).len().iter_rows()))
        return rows.at(np.flatnonzero(lines["reason"].is_null().to_numpy()))


def _batches(scan: pl.LazyFrame) -> Iterator[pl.DataFrame]:
    wanted = scan.select("ragged", *Rows._fields)  # not the lines: to number them takes long
    batches = wanted.collect_batches(chunk_size=_ROWS_AT_ONCE, maintain_order=True, engine="streaming")
    return (block for block in batches if block.height)


def _numbers(block: pl.DataFrame) -> Rows:
    """Its numbers; NaN where there is none."""
    return Rows(*(block[name].to_numpy().astype(float, copy=False) for name in Rows._fields))


def _farthest(values: np.ndarray) -> float:
    """The greatest distance from 0; NaN where a value is."""
    return float(np.abs([values.min(), values.max()]).max())
