"""Input files: regular, of bounded size, and unchanged while they are read."""

from __future__ import annotations

import errno
import hashlib
import json
import os
import stat
import time
import zlib
from collections.abc import Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from contextvars import ContextVar
from operator import attrgetter
from pathlib import Path
from typing import Any, BinaryIO
from zipfile import BadZipFile

from .errors import DataError, SzlibError

_TICK = 0.004  # two changes of a file within this time [s] can have the same time stamp (Linux)
_JOINERS = "\u200c\u200d"  # zero-width letters of Persian, Hindi and emoji, which Python calls not printable
_STATE = attrgetter("st_dev", "st_ino", "st_size", "st_mtime_ns", "st_ctime_ns")
# The files that `unchanged_files` keeps open, by path.
_OPEN: ContextVar[Mapping[Path, BinaryIO]] = ContextVar("open")


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
    with suppress(OSError, ValueError, RecursionError):
        content = json.loads(read_small(path))
        if isinstance(content, dict):
            return content
    return {}


@contextmanager
def unchanged_files(paths: Iterable[Path]) -> Iterator[None]:
    """Keep the files `paths` open while the block reads them at their `readable_path`.

    Each is opened once, so that checksums and rows are of the same bytes.  Blocks inside this one use its
    descriptors.  Raises DataError where a file cannot be opened, or has changed when the block ends.
    """
    with ExitStack() as stack:
        opened = {}
        for path in (path for path in paths if path not in _OPEN.get({})):
            try:
                opened[path] = stack.enter_context(open_regular(path))
            except OSError as error:
                raise DataError(
                    f"{printable(path)}: cannot be opened ({error.strerror or error})"
                ) from error
        before = {path: _states(path, stream) for path, stream in opened.items()}
        token = _OPEN.set({**_OPEN.get({}), **opened})
        try:
            yield
        finally:
            _OPEN.reset(token)
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
    stream = _OPEN.get({}).get(path)
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


@contextmanager
def reading(
    path: Path, what: str, expected: str, error: type[SzlibError] = DataError
) -> Iterator[None]:
    """Raise `error` if the block cannot read the file `path`.

    Parameters
    ----------
    path : the file.
    what : what it is read as, such as "as groups".
    expected : what the file should be.
    error : class of the error.
    """
    try:
        if path.exists() and not (path.is_file() or path.is_dir()):
            raise OSError(errno.EINVAL, "it is no regular file", str(path))
        yield
    except (
        OSError,
        ValueError,
        KeyError,
        TypeError,
        RecursionError,
        BadZipFile,
        zlib.error,
    ) as fault:
        raise error(
            f"{printable(path)}: cannot be read {what} ({fault}); expected {expected}"
        ) from fault


def printable(name: object) -> str:
    """The file name `name` as text for any file and any terminal: bytes that are not UTF-8 are escaped."""
    text = (
        str(name).encode("utf-8", "surrogateescape").decode("utf-8", "backslashreplace")
    )
    return "".join(
        c if c.isprintable() or c in _JOINERS else ascii(c)[1:-1] for c in text
    )
