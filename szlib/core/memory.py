"""The memory limit: the amount granted, or four fifths of the memory that is available.

Before a table is made, its rows are counted and its size is estimated. A table above the limit raises an
error, so that the machine does not run out of memory.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from pathlib import Path

import psutil

from .errors import MemoryLimitError

# Environment variable: the limit of each process, such as 4GB; ``--memory`` of the command line sets it.
VARIABLE = "SZLIB_MEMORY"
_SHARE = 0.8
_granted: ContextVar[int | None] = ContextVar("granted", default=None)


def parse_size(text: str) -> int:
    """Bytes of `text`, such as "4GB", "512 MiB" or "2g"; raises MemoryLimitError for other text."""
    found = re.fullmatch(
        r"(\d{1,15}(?:\.\d{1,9})?) ?([KMGT]?)(I?)B?", text.strip().upper(), re.ASCII
    )
    number, prefix, binary = found.groups() if found else ("0", "", "")
    size = float(number) * (1024 if binary else 1000) ** " KMGT".index(prefix or " ")
    if not 1 <= size < 1e18:
        raise MemoryLimitError(
            f"memory {text!r}: expected an amount such as 4GB or 512MB"
        )
    return int(size)


def limit() -> int:
    """Bytes that this process may use in total."""
    if (granted := _granted.get()) is not None:
        return granted
    if text := os.environ.get(VARIABLE):
        return parse_size(text)
    return int(_SHARE * _available())


@contextmanager
def granted(size: int | None) -> Iterator[None]:
    """Set the limit to `size` bytes inside a with block; None changes nothing."""
    token = _granted.set(_granted.get() if size is None else size)
    try:
        yield
    finally:
        _granted.reset(token)


def require(size: float, what: str) -> None:
    """Raise MemoryLimitError if `what`, the subject of the message, takes `size` bytes, above the limit."""
    if size > (allowed := limit()):
        raise MemoryLimitError(
            f"{what} takes about {_readable(size)} of memory, and the limit is {_readable(allowed)}; split "
            f"the data by time, or raise the limit (--memory, ${VARIABLE}) if the machine has more memory"
        )


def _readable(size: float) -> str:
    return f"{size / 1e9:.1f} GB" if size >= 1e9 else f"{size / 1e6:.0f} MB"


def _available() -> float:
    """Bytes available without swapping, within the limit of a Linux container (cgroup version 2 or 1)."""
    available = float(psutil.virtual_memory().available)
    for folder, *files in (
        ("/sys/fs/cgroup", "memory.max", "memory.current"),
        ("/sys/fs/cgroup/memory", "memory.limit_in_bytes", "memory.usage_in_bytes"),
    ):
        with suppress(OSError, ValueError):  # "max": no limit
            allowed, used = (float(Path(folder, name).read_text()) for name in files)
            statistics = Path(folder, "memory.stat").read_text()
            cached = re.findall(r"^(?:total_)?inactive_file (\d+)", statistics, re.M)
            free = allowed - used + sum(map(float, cached[:1]))
            return min(available, max(0.0, free))
    return available
