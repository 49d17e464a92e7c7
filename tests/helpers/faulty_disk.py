"""A disk on which one write fails, put in where szlib writes every file."""

from __future__ import annotations

import errno
import os
from pathlib import Path

from szlib.core import files


class FaultyDisk:
    """In a `with` block, write number `failing` (from 0) writes half of its bytes and raises `error`."""

    def __init__(self, failing: int, error: int = errno.ENOSPC) -> None:
        self.failing, self.error, self.n_writes, self.fill = (
            failing,
            error,
            0,
            files._fill,
        )

    def __call__(self, unfinished: Path, content: bytes, durable: bool) -> None:
        self.n_writes += 1
        if self.n_writes - 1 == self.failing:
            self.fill(unfinished, content[: len(content) // 2], False)
            raise OSError(self.error, os.strerror(self.error))
        self.fill(unfinished, content, durable)

    def __enter__(self) -> FaultyDisk:
        files._fill = self
        return self

    def __exit__(self, *_: object) -> None:
        files._fill = self.fill
