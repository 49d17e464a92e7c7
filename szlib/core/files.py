"""Atomic files, folders that belong to szlib, and cached results.

Every file is written here: completely, or not at all. A folder of results holds a marker file, `.szlib`. Its
first line says what the folder is for. A folder that holds other files and no marker is never written into.
Neither is a folder that holds the input data.
"""

from __future__ import annotations

import errno
import hashlib
import json
import os
import shutil
import tempfile
import time
import uuid
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import cache, partial
from multiprocessing.util import Finalize
from pathlib import Path
from typing import Any

from filelock import FileLock, Timeout

from .errors import StorageError
from .input_files import explain_errors, open_regular, read_json_object, read_small

MARKER = ".szlib"  # name of the file that marks a folder as szlib's
_LOCK, _UNFINISHED, _TEMPORARY = ".szlib-lock", ".szlib-part-", "szlib-"
# age at which an unfinished file is removed [s]: no write takes so long
_ABANDONED = 3600.0
# Errors of file systems that cannot sync folders, and of operating systems that cannot open them.
_SYNC_ERRORS = (None, errno.EINVAL, errno.EACCES)
_explain_errors = partial(explain_errors, error=StorageError, faults=OSError)


def write_file(path: str | Path, content: bytes | str, *, durable: bool = True) -> None:
    """Write `content` to `path` completely, or leave the file as it was.

    With `durable` the file survives a power failure (fsync of the file and of its folder). Two processes may
    write the same file: one of them wins. The folder must exist. Raises StorageError.
    """
    path, data = Path(path), content.encode() if isinstance(content, str) else content
    unfinished = path.with_name(f"{_UNFINISHED}{uuid.uuid4().hex}")
    advice = "make room, or choose a folder that is writable; files that were finished before are intact"
    with _explain_errors(f"{path}: cannot be written", advice):
        try:
            _fill(unfinished, data, durable)
            unfinished.replace(path)
            if durable:
                _sync(path.parent)
        finally:
            with suppress(OSError):  # it has been renamed, or was never made
                unfinished.unlink()


def _fill(unfinished: Path, content: bytes, durable: bool) -> None:
    with unfinished.open("xb") as stream:
        stream.write(content)
        stream.flush()
        if durable:
            os.fsync(stream.fileno())


def _sync(folder: Path) -> None:
    """Make the names of files in a folder durable."""
    try:
        with ExitStack() as stack:
            handle = os.open(folder, os.O_RDONLY)
            stack.callback(os.close, handle)
            os.fsync(handle)
    except OSError as error:
        if error.errno not in _SYNC_ERRORS:
            raise


def store_cached(path: Path, content: bytes, made_of: Any) -> None:
    """Write `content` to `path`, and beside it a checksum and `made_of` (JSON values); see `load_cached`."""
    write_file(path, content)
    write_checksum(path, content, made_of)


def write_checksum(path: Path, content: bytes, made_of: Any) -> None:
    """Write ``NAME.json`` beside the file `path`: the checksum of `content` and `made_of` (JSON values)."""
    record = json.dumps(_make_record(content, made_of), indent=1)
    write_file(path.with_name(f"{path.name}.json"), record)


def load_cached(path: Path, made_of: Any) -> bytes | None:
    """The content of `path` from `store_cached`; None if missing, damaged, or not made of `made_of`."""
    record = read_json_object(path.with_name(f"{path.name}.json"))
    with suppress(OSError), open_regular(path) as stream:
        content = stream.read()
        if record == json.loads(json.dumps(_make_record(content, made_of))):
            return content
    return None


def _make_record(content: bytes, made_of: Any) -> dict[str, Any]:
    return {"made_of": made_of, "sha256": hashlib.sha256(content).hexdigest()}


def claim_folder(
    folder: str | Path, purpose: str, *, inputs: Iterable[Path] = ()
) -> Path:
    """Make `folder`, or reuse it if it is empty or was claimed for the same `purpose`; return its path.

    Parameters
    ----------
    folder : the folder; its parents are made too.
    purpose : one line, such as "days"; a folder with another purpose is refused.
    inputs : files of input data; a folder that holds one of them is refused.

    Raises
    ------
    StorageError : the folder is refused, or cannot be made or read.
    """
    folder = Path(folder)
    with _explain_errors(f"{folder}: cannot be made or read", "choose another folder"):
        place = folder.resolve()
        if inside := [file for file in inputs if place in file.resolve().parents]:
            raise StorageError(
                f"{folder}: holds input data, {inside[0].name}; choose a folder without input data"
            )
        folder.mkdir(parents=True, exist_ok=True)
        foreign = sorted(
            entry.name
            for entry in folder.iterdir()
            if not (entry.name.startswith(MARKER) or (entry / MARKER).is_file())
        )
        owner = folder_purpose(folder)
        if owner is None and foreign:
            raise StorageError(
                f"{folder}: holds files that szlib did not write, such as {foreign[0]!r}; choose a new or "
                "empty folder (or remove the results of an older szlib)"
            )
        if owner is None:
            with FileLock(folder / _LOCK):  # of two processes one comes first
                owner = folder_purpose(folder) or purpose
                says = "Written by szlib, which may replace every file here."
                write_file(folder / MARKER, f"{owner}\n{says}\n")
        for entry in folder.glob(f"{_UNFINISHED}*"):  # of processes that were killed
            with suppress(OSError):
                if time.time() - entry.stat().st_mtime > _ABANDONED:
                    entry.unlink()
    if owner != purpose:
        raise StorageError(f"{folder}: holds {owner}; {purpose} need another folder")
    return folder


def folder_purpose(folder: str | Path) -> str | None:
    """The purpose for which `folder` was claimed, or None."""
    try:
        return read_small(Path(folder) / MARKER).decode("utf-8").splitlines()[0]
    except (OSError, ValueError, IndexError):
        return None


@contextmanager
def folder_lock(folder: str | Path) -> Iterator[None]:
    """Reserve a claimed `folder` for this process; the lock ends with the process.

    Raises StorageError where another process has reserved it, or where this one may not write.
    """
    lock = FileLock(Path(folder) / f"{_LOCK}-run", timeout=0)
    busy = f"{folder}: another process is writing there"
    with (
        _explain_errors(f"{folder}: cannot be written", "choose another folder"),
        _explain_errors(
            busy, "wait until it ends, or choose another folder", faults=Timeout
        ),
    ):
        lock.acquire()
    try:
        yield
    finally:
        lock.release()


@contextmanager
def temporary_folder() -> Iterator[Path]:
    """A temporary folder, removed at the end of the block, or by a later call if this process is killed.

    A locked file beside it shows that its process lives, even if that runs in another container.
    Raises StorageError where there is no room for it, or the umask forbids its use.
    """
    remove_abandoned_temporary()
    with ExitStack() as stack:
        advice = "make room, or name another one in $TMPDIR"
        with _explain_errors("no temporary folder", advice):
            home = Path(tempfile.gettempdir()).resolve(strict=True)
            folder = home / f"{_TEMPORARY}{os.getpid()}-{uuid.uuid4().hex}"
            lock = FileLock(f"{folder}{_LOCK}")
            lock.acquire()
            stack.callback(_remove_temporary, lock)
            if Path(lock.lock_file).stat().st_mode & 0o600 != 0o600:
                raise StorageError(
                    "new files may not be used by their owner (umask); call umask 022 first"
                )
            folder.mkdir(mode=0o700)
        yield folder


def _remove_temporary(lock: FileLock) -> None:
    """Remove the folder that a `lock` protects, and the lock."""
    shutil.rmtree(lock.lock_file.removesuffix(_LOCK), ignore_errors=True)
    with suppress(OSError):
        Path(lock.lock_file).unlink()
    lock.release()


@cache
def process_folder() -> Path:
    """The `temporary_folder` of this process, removed when the process ends."""
    stack = ExitStack()
    # after multiprocessing has removed its own folder inside
    Finalize(None, stack.close, exitpriority=-200)
    return stack.enter_context(temporary_folder())


def remove_abandoned_temporary() -> None:
    """Remove temporary folders whose process has ended without removing them.

    With them go the semaphores that joblib left in shared memory when this process was killed.
    """
    for file in Path(tempfile.gettempdir()).glob(f"{_TEMPORARY}*{_LOCK}"):
        with suppress(OSError, Timeout):
            lock = FileLock(file, timeout=0)
            lock.acquire()
            number = file.name.split("-")[1]
            _remove_temporary(lock)
            if Path("/proc/self").exists() and not Path("/proc", number).exists():
                for semaphore in Path("/dev/shm").glob(f"sem.loky-{number}-*"):
                    semaphore.unlink(missing_ok=True)
