"""The usable rows of a raw file, block by block; those that are set aside are counted."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np
import polars as pl

from ...tracks.formats.rows import fault

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
    """A scan's usable rows, block by block in the order of the file; `tally` counts what was seen."""

    scan: pl.LazyFrame
    metres: float
    seconds: float
    tally: Tally = field(default_factory=Tally)

    @cached_property
    def _fault(self) -> pl.Expr:
        return fault(self.metres, self.seconds, False)

    def __iter__(self) -> Iterator[Rows]:
        self.tally, seen = Tally(), 0
        wanted = self.scan.select("ragged", *Rows._fields)  # not the lines: to number them takes long
        for block in wanted.collect_batches(
            chunk_size=_ROWS_AT_ONCE, maintain_order=True, engine="streaming"
        ):
            rows = self._usable(block, seen) if block.height else Rows(*np.zeros((4, 0)))
            seen += block.height
            if len(rows.t):
                self.tally.good += len(rows.t)
                self.tally.reach = max(self.tally.reach, *(float(np.abs(v).max()) for v in (rows.x, rows.y)))
                yield rows

    def _usable(self, block: pl.DataFrame, seen: int) -> Rows:
        """The usable rows of a block, all of them where its extremes are; counts the others."""
        rows = Rows(*(block[name].to_numpy() for name in Rows._fields))  # NaN where there is no number
        if self._spotless(block, rows):
            return rows
        block = block.with_row_index("line", offset=seen + 1).with_columns(reason=self._fault)
        bad = block.filter(pl.col("reason").is_not_null())
        if bad.height:
            self.tally.first = self.tally.first or bad.select("line", "reason").row(0)
            self.tally.reasons.update(dict(bad.group_by("reason", maintain_order=True).len().iter_rows()))
        return rows.at(np.flatnonzero(block["reason"].is_null().to_numpy()))

    def _spotless(self, block: pl.DataFrame, rows: Rows) -> bool:
        """Whether no row has a fault: limits are kept by all values that lie between two that keep them."""
        if block["ragged"].any() or not np.array_equal(rows.id, np.floor(rows.id)):
            return False
        ends = {name: [values.min(), values.max()] for name, values in rows._asdict().items()}
        found = pl.DataFrame({"ragged": [False, False], **ends})
        return found.select(self._fault).to_series().null_count() == 2
