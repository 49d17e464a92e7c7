"""What users give: argument values, files that must not change while they are read, and the memory limit.

Before a table is made, its rows are counted and its size is estimated. A table above the limit raises an
error, so that the machine does not run out of memory. The limit is the amount granted, or four fifths of the
memory that is available.
"""

from __future__ import annotations

import errno
import hashlib
import json
import os
import re
import stat
import time
from collections.abc import Iterable, Iterator, Mapping
from contextlib import (
    AbstractContextManager,
    ExitStack,
    contextmanager,
    suppress,
)
from contextvars import ContextVar
from operator import attrgetter
from pathlib import Path
from typing import Any, BinaryIO

import psutil

from .errors import DataError, MemoryLimitError, SzlibError

_TICK = 0.004  # two changes of a file within this time [s] can have the same time stamp (Linux)
# Zero-width letters of Persian, Hindi and emoji, which Python calls not printable.
_JOINERS = "\u200c\u200d"
# what differs after a file has changed
_STATE = attrgetter("st_dev", "st_ino", "st_size", "st_mtime_ns", "st_ctime_ns")
# The files that `unchanged_files` keeps open, by path.
_OPEN_FILES: ContextVar[Mapping[Path, BinaryIO]] = ContextVar("open")

# Environment variable: the limit of each process, such as 4GB; ``--memory`` of the command line sets it.
MEMORY_VARIABLE = "SZLIB_MEMORY"
_SHARE = 0.8  # share of the available memory that may be used
_GRANTED_SIZE: ContextVar[int | None] = ContextVar("granted", default=None)


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
    faults: type[BaseException] | tuple[type[BaseException], ...] = Exception,
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
    shown = f"{printable(path)}: cannot be read {what}"
    return explain_errors(shown, f"expected {expected}", error)


def open_regular(path: Path) -> BinaryIO:
    """Open the regular file `path` to read it; OSError for anything else, such as a FIFO without end."""
    # do not wait for a process that writes the file
    at_once = getattr(os, "O_NONBLOCK", 0)
    stream = open(path, "rb", opener=lambda name, flags: os.open(name, flags | at_once))  # noqa: SIM115
    if stat.S_ISREG(os.fstat(stream.fileno()).st_mode):
        return stream
    stream.close()
    raise OSError(errno.EINVAL, "it is no regular file", str(path))


def read_small(path: Path, largest: int = 10_000_000) -> bytes:
    """The content of the regular file `path`; OSError where it has more than `largest` bytes."""
    with open_regular(path) as stream:
        content = stream.read(largest + 1)
    if len(content) > largest:
        raise OSError(errno.EFBIG, f"it is larger than {largest / 1e6:g} MB", str(path))
    return content


def read_json_object(path: Path) -> dict[str, Any]:
    """The object in the small JSON file `path`; empty if the file is missing or damaged."""
    with suppress(OSError, ValueError, TypeError, RecursionError):
        return dict(json.loads(read_small(path)))
    return {}


@contextmanager
def unchanged_files(paths: Iterable[Path]) -> Iterator[None]:
    """Keep the files `paths` open while the block reads them at their `readable_path`.

    Each is opened once, so that checksums and rows are of the same bytes.  A block inside this one uses
    the same open files.  Raises DataError where a file cannot be opened, or has changed when the block ends.
    """
    with ExitStack() as stack:
        opened = {}
        for path in set(paths) - _OPEN_FILES.get({}).keys():
            what = f"{printable(path)}: cannot be opened"
            with explain_errors(
                what, "expected a file that may be read", faults=OSError
            ):
                opened[path] = stack.enter_context(open_regular(path))
        before = {path: _states(path, stream) for path, stream in opened.items()}
        token = _OPEN_FILES.set({**_OPEN_FILES.get({}), **opened})
        try:
            yield
        finally:
            _OPEN_FILES.reset(token)
            for path, stream in opened.items():
                if _states(path, stream) != before[path]:
                    raise DataError(
                        f"{printable(path)}: changed while it was read; try again when it is complete"
                    )


def readable_path(path: Path) -> Path:
    """The path at which `unchanged_files` keeps file `path` open, whatever has replaced it; else `path`.

    Systems without /proc have no such path. There `unchanged_files` finds a file that was replaced, but not a
    folder that was exchanged for another one and put back while its files were read.
    """
    stream = _OPEN_FILES.get({}).get(path)
    place = Path(f"/proc/self/fd/{stream.fileno()}") if stream else path
    return place if place.exists() else path


def _states(path: Path, stream: BinaryIO) -> list[tuple[float, ...]]:
    """Device, inode, size and times of the file that is open and of the file at its path, if there is one."""
    if abs(time.time() - os.fstat(stream.fileno()).st_ctime) < _TICK:
        time.sleep(_TICK)  # a change after this has another time
    found = [os.fstat(stream.fileno())]
    with suppress(OSError):
        found.append(path.stat())
    return list(map(_STATE, found))


def file_content(file: Path) -> tuple[int, str]:
    """Size of `file` [bytes] and its SHA-256; raises DataError as `unchanged_files`."""
    with unchanged_files([file]), readable_path(file).open("rb") as stream:
        digest = hashlib.file_digest(stream, "sha256").hexdigest()
        return stream.tell(), digest


def printable(name: object) -> str:
    """The file name `name` as text for any file and any terminal: bytes that are not UTF-8 are escaped."""
    text = (
        str(name).encode("utf-8", "surrogateescape").decode("utf-8", "backslashreplace")
    )
    return "".join(
        c if c.isprintable() or c in _JOINERS else ascii(c)[1:-1] for c in text
    )


# --- memory -------------------------------------------------------------------------------------------


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


def memory_limit() -> int:
    """Bytes that this process may use in total."""
    text = os.environ.get(MEMORY_VARIABLE)
    return _GRANTED_SIZE.get() or (parse_size(text) if text else _available_memory())


@contextmanager
def granted_memory(size: int | None) -> Iterator[None]:
    """Set the limit to `size` bytes inside a with block; None changes nothing."""
    token = _GRANTED_SIZE.set(size or _GRANTED_SIZE.get())
    try:
        yield
    finally:
        _GRANTED_SIZE.reset(token)


def require_memory(size: float, what: str) -> None:
    """Raise MemoryLimitError if `size` bytes are above the limit; `what` takes them, as the message says."""
    if size > (allowed := memory_limit()):
        raise MemoryLimitError(
            f"{what} takes about {_show_size(size)} of memory, and the limit is {_show_size(allowed)}; split "
            f"the data by time, or raise the limit (--memory, ${MEMORY_VARIABLE}) if the machine has more"
        )


def _show_size(size: float) -> str:
    return f"{size / 1e9:.1f} GB" if size >= 1e9 else f"{size / 1e6:.0f} MB"


def _available_memory() -> int:
    """Four fifths of the bytes free without swapping, or of those left to a Linux container (cgroup 2)."""
    available, group = psutil.virtual_memory().available, "/sys/fs/cgroup/memory"
    with suppress(OSError, ValueError):  # "max": no limit
        allowed = float(Path(f"{group}.max").read_text())
        used = float(Path(f"{group}.current").read_text())
        statistics = Path(f"{group}.stat").read_text()
        cached = re.findall(r"^inactive_file (\d+)", statistics, re.M)
        available = min(available, allowed - used + float(cached[0]))
    return int(_SHARE * available)
