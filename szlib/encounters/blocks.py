"""The usable rows of a raw file, block by block, and a summary of the file."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field

import polars as pl

from ..tracks.readers import reject_rows

NUMBERS = ("t", "id", "x", "y")  # columns of a block: t [s], id, x, y [m]
_BLOCK_ROWS = 1 << 17  # of one block [about 5 minutes of a raw day]


@dataclass
class UsableBlocks:
    """The usable rows of a scan, block by block, in the order of the file.

    Attributes
    ----------
    scan : scan of the file.
    n_usable : number of usable rows so far.
    farthest : their largest absolute coordinate [m].
    reasons : number of the other rows by reason.
    first_fault : line and reason of the first of them.
    """

    scan: pl.LazyFrame
    n_usable: int = 0
    farthest: float = 0.0
    reasons: Counter[str] = field(default_factory=Counter)
    first_fault: tuple[int, str] | None = None

    def __iter__(self) -> Iterator[pl.DataFrame]:
        read = 0  # line numbers of the scan take long
        columns = self.scan.select("ragged", *NUMBERS)
        for block in columns.collect_batches(
            chunk_size=_BLOCK_ROWS, maintain_order=True, engine="streaming"
        ):
            lines = block.with_row_index("line", offset=read + 1)
            good, reasons, first = reject_rows(lines)
            read += block.height
            self.reasons.update(reasons)
            self.first_fault = self.first_fault or first
            if good.height:
                self.n_usable += good.height
                self.farthest = max(
                    self.farthest, *good.select(pl.col("x", "y").abs().max()).row(0)
                )
                yield good.select(NUMBERS)
