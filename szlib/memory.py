"""How much memory may be used: what was granted, or four fifths of what the machine has left.

Estimates, not measurements: before a table is made, its rows are counted, and what they will take is held
against the ceiling.  So a file that is too large is refused with a line, and the machine goes on.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path

from .errors import MemoryLimitError

VARIABLE = "SZLIB_MEMORY"
"""Names the ceiling of each process, such as 4GB; ``--memory`` of the command line sets it."""
_SHARE = 0.8
_granted: ContextVar[int | None] = ContextVar("granted", default=None)


def parse(text: str) -> int:
    """Bytes of "4GB", "512 MiB" or "2g"; raises MemoryLimitError for what is no amount of memory."""
    found = re.fullmatch(r"(\d{1,15}(?:\.\d{1,9})?) ?([KMGT]?)(I?)B?", text.strip().upper(), re.ASCII)
    size = (
        0.0 if not found else float(found[1]) * (1024 if found[3] else 1000) ** " KMGT".index(found[2] or " ")
    )
    if not 1 <= size < 1e18:
        raise MemoryLimitError(f"memory {text!r}: expected an amount such as 4GB or 512MB")
    return int(size)


def ceiling() -> int | None:
    """Bytes that this process may use in all; None where the machine does not say what it has."""
    if (granted := _granted.get()) is not None:
        return granted
    if text := os.environ.get(VARIABLE):
        return parse(text)
    available = _available()
    return None if available is None else int(_SHARE * available)


@contextmanager
def granted(size: int | None) -> Iterator[None]:
    """Inside, `size` bytes are the ceiling; None changes nothing."""
    token = _granted.set(size) if size is not None else None
    try:
        yield
    finally:
        if token is not None:
            _granted.reset(token)


def require(size: float, what: str) -> None:
    """Raise MemoryLimitError where `what` takes more bytes than may be used."""
    limit = ceiling()
    if limit is not None and size > limit:
        raise MemoryLimitError(
            f"{what} takes about {_readable(size)} of memory, and {_readable(limit)} may be used; cut it "
            f"into pieces by time, or grant more (--memory, ${VARIABLE}) where there is more"
        )


def _readable(size: float) -> str:
    return f"{size / 1e9:.1f} GB" if size >= 1e9 else f"{size / 1e6:.0f} MB"


def _available() -> float | None:
    """Bytes that can be had without swapping, within what a container is allowed."""
    found = [_meminfo(), _container()]
    return min((size for size in found if size is not None), default=None)


def _meminfo() -> float | None:
    try:
        for line in Path("/proc/meminfo").read_text(encoding="ascii").splitlines():
            if line.startswith("MemAvailable:"):
                return float(line.split()[1]) * 1024
    except (OSError, ValueError, IndexError):
        pass
    try:
        return 0.5 * os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):
        return None


def _container() -> float | None:
    """What a Linux container is allowed less what it uses (cgroups, version 2 and 1)."""
    for folder, limit, used in (
        ("/sys/fs/cgroup", "memory.max", "memory.current"),
        ("/sys/fs/cgroup/memory", "memory.limit_in_bytes", "memory.usage_in_bytes"),
    ):
        try:
            most = float(Path(folder, limit).read_text(encoding="ascii"))
            cached = re.search(
                r"^(?:total_)?inactive_file (\d+)", Path(folder, "memory.stat").read_text(), re.M
            )
            return max(0.0, most - float(Path(folder, used).read_text()) + float(cached[1] if cached else 0))
        except (OSError, ValueError):  # "max": no limit
            continue
    return None
