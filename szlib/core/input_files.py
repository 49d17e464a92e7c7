"""What users give: argument values, files that must not change while they are read, and the memory limit.

Before a table is made, its rows are counted and its size is estimated. A table above the limit raises an
error, so that the machine does not run out of memory. The limit is the amount granted, or four fifths of the
memory that is available.
"""

from __future__ import annotations

import hashlib
import os
import re
import stat
from collections.abc import Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from pathlib import Path
from typing import Any, BinaryIO

import psutil

from .errors import DataError, MemoryLimitError, SzlibError

_LARGEST = 10_000_000  # of a small file [bytes]
# Environment variable: the limit of each process, such as 4GB; ``--memory`` of the command line sets it.
MEMORY_VARIABLE = "SZLIB_MEMORY"


def require(
    holds: object,
    name: str,
    value: object,
    expected: str,
    error: type[SzlibError] = DataError,
) -> None:
    """Raise `error` if the check of an argument does not hold: "`name` must be `expected`; got `value`".

    Parameters
    ----------
    holds : whether the argument is valid.
    name : of the argument.
    value : of the argument.
    expected : what it must be.
    error : class of the error.
    """
    if not holds:
        raise error(f"{name} must be {expected}; got {value!r}")


# --- files --------------------------------------------------------------------------------------------


@contextmanager
def explain_errors(
    what: str,
    advice: str,
    error: type[SzlibError] = DataError,
    faults: Any = Exception,
) -> Iterator[None]:
    """Replace errors of the classes `faults` in a with block by an `error` that says more.

    Its message states `what` failed, the reason, and `advice`.  A MemoryLimitError is not replaced.
    """
    try:
        yield
    except MemoryLimitError:
        raise
    except faults as fault:
        reason = getattr(fault, "strerror", None) or fault
        raise error(f"{what} ({reason}); {advice}") from fault


def reading(
    path: Path, what: str, expected: str, error: type[SzlibError] = DataError
) -> AbstractContextManager[None]:
    """Raise `error` if the block cannot read the file `path`.

    Parameters
    ----------
    path : the file.
    what : what it is read as, such as "as groups".
    expected : what the file should be.
    error : class of the error.
    """
    return explain_errors(
        f"{printable(path)}: cannot be read {what}", f"expected {expected}", error
    )


def open_regular(path: Path) -> BinaryIO:
    """Open the regular file `path` to read it; OSError for anything else, such as a FIFO without end."""
    if not stat.S_ISREG(path.stat().st_mode):
        raise OSError("it is no regular file")
    return path.open("rb")


def read_small(path: Path) -> bytes:
    """The content of the regular file `path`; OSError where it has more than `_LARGEST` bytes."""
    with open_regular(path) as stream:
        content = stream.read(_LARGEST + 1)
    if len(content) > _LARGEST:
        raise OSError(f"it is larger than {_LARGEST / 1e6:g} MB")
    return content


@contextmanager
def unchanged_files(paths: Iterable[Path]) -> Iterator[None]:
    """Raise DataError where one of the files `paths` has changed when the block ends, or cannot be found."""
    before = {path: file_state(path) for path in paths}
    yield
    for path, state in before.items():
        if file_state(path) != state:
            raise DataError(
                f"{printable(path)}: changed while it was read; try again when it is complete"
            )


def file_state(path: Path) -> Any:
    """Inode, size and times of the file `path`."""
    with opening(path):
        found = path.stat()
    return found.st_ino, found.st_size, found.st_mtime_ns, found.st_ctime_ns


def opening(path: Path) -> AbstractContextManager[None]:
    """Raise DataError if the block cannot open the file `path`."""
    return explain_errors(
        f"{printable(path)}: cannot be opened",
        "expected a file that may be read",
        faults=OSError,
    )


def file_content(file: Path) -> tuple[int, str]:
    """Size of `file` [bytes] and its SHA-256; raises DataError where it cannot be read."""
    with opening(file), file.open("rb") as stream:
        digest = hashlib.file_digest(stream, "sha256").hexdigest()
        return stream.tell(), digest


def printable(name: object) -> str:
    """The file name `name` as text for any file and any terminal: bytes that are not UTF-8 are escaped."""
    # Python calls the zero-width letters of Persian, Hindi and emoji not printable.
    return "".join(
        c if c.isprintable() or c in "\u200c\u200d" else ascii(c)[1:-1]
        for c in str(name)
    )


# --- memory -------------------------------------------------------------------------------------------


def parse_size(text: str) -> int:
    """Bytes of `text`, such as "4GB", "512 MB" or "2g"; raises MemoryLimitError for other text."""
    found = re.fullmatch(
        r"([1-9]\d{0,14}\.?\d{0,9}) ?([KMGT]?)B?", text.strip().upper(), re.ASCII
    )
    if found is None:
        raise MemoryLimitError(
            f"memory {text!r}: expected an amount such as 4GB or 512MB"
        )
    return int(float(found[1]) * 1000 ** " KMGT".index(found[2] or " "))


def memory_limit() -> int:
    """Bytes that this process may use in total.

    Without a limit it is four fifths of the bytes that are free without swapping, or of those that a Linux
    container has (cgroup 2).
    """
    if text := os.environ.get(MEMORY_VARIABLE):
        return parse_size(text)
    available = psutil.virtual_memory().available
    with suppress(OSError, ValueError):  # "max": no limit
        available = min(available, int(Path("/sys/fs/cgroup/memory.max").read_text()))
    return int(0.8 * available)


@contextmanager
def environment(**variables: str) -> Iterator[None]:
    """Set the environment `variables` inside a with block."""
    before = {k: v for k, v in os.environ.items() if k in variables}
    os.environ.update(variables)
    try:
        yield
    finally:
        for name in variables:
            os.environ.pop(name, None)
        os.environ.update(before)


def require_memory(size: float, what: str) -> None:
    """Raise MemoryLimitError if `size` bytes are above the limit; `what` takes them, as the message says."""
    allowed = memory_limit()
    if size > allowed:
        raise MemoryLimitError(
            f"{what} takes about {size / 1e9:.3g} GB of memory, and the limit is {allowed / 1e9:.3g} GB; "
            f"split the data by time, or raise the limit (--memory, ${MEMORY_VARIABLE})"
        )
