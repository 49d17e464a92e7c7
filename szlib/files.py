"""The one door through which files are written: each whole or not at all, into folders that are szlib's own.

A folder of results holds a marker, `.szlib`, that says what it is for.  One that holds anything else and no
marker is never written into, nor one that holds the data read.  What is unfinished, or temporary, bears
the name of its process; where that is dead, the next call removes it.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
import socket
import sys
import tempfile
import uuid
import zlib
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from .errors import StorageError

CACHE, MARKER = "SZLIB_CACHE", ".szlib"
"""Names the folder of the user's cache, or is "off"; in a folder: that it is szlib's to write, what for."""
_UNFINISHED, _TEMPORARY = ".szlib-", "szlib-"
_BLOCK, _AT_ONCE, _READERS = 1 << 20, 1 << 26, 2
"""Bytes of a file whose checksum is taken at a time, bytes that a thread takes, and threads."""


def write_file(path: str | Path, content: bytes | str, *, lasting: bool = True) -> None:
    """Write a file as a whole or not at all, in place of what was there; folders are not made.

    With `lasting` it outlives a power failure (fsync of the file and of its folder).  Two processes may write
    the same file: it is the one's or the other's.  Raises StorageError, and leaves what was there.
    """
    path = Path(path)
    unfinished = path.parent / f"{_UNFINISHED}{_process()}-{uuid.uuid4().hex[:8]}"
    try:
        try:
            _fill(unfinished, content.encode() if isinstance(content, str) else content, lasting)
            unfinished.replace(path)
            if lasting:
                _sync(path.parent)
        except BaseException:
            with suppress(OSError):  # what could not be written may not be there to be removed
                unfinished.unlink()
            raise
        _sweep(path.parent, _UNFINISHED)
    except OSError as error:
        raise StorageError(
            f"{path}: cannot be written ({error.strerror or error}); make room, or choose a folder that is "
            "writable; what was finished before is intact"
        ) from error


def cache_folder(name: str) -> Path | None:
    """A folder of the user's cache, made or not; None where that is off (see `CACHE`)."""
    import pooch

    named = os.environ.get(CACHE) or pooch.os_cache("szlib")
    return None if named == "off" else Path(named) / name


def keep(path: Path, content: bytes, made_of: Any) -> None:
    """Write a file, then beside it (``NAME.json``) of what it was made, in JSON values, and its checksum."""
    write_file(path, content)
    sign(path, content, made_of)


def sign(path: Path, content: bytes, made_of: Any) -> None:
    """The second half of `keep`, for a file that has been written."""
    record = {"made_of": made_of, "sha256": hashlib.sha256(content).hexdigest()}
    write_file(path.with_name(f"{path.name}.json"), json.dumps(record, indent=1))


def kept(path: Path, made_of: Any) -> bytes | None:
    """The content of a file from `keep`; None where it is not there, not whole, or made of something else."""
    try:
        record = json.loads(path.with_name(f"{path.name}.json").read_text(encoding="utf-8"))
        content = path.read_bytes()
        right = record["made_of"] == json.loads(json.dumps(made_of))
        return content if right and record["sha256"] == hashlib.sha256(content).hexdigest() else None
    except (OSError, ValueError, KeyError, TypeError):
        return None


def own_folder(folder: str | Path, purpose: str, *, inputs: Iterable[Path] = ()) -> Path:
    """Make a folder, or take it if it is empty or has been this one's; mark it as szlib's, and return it.

    `purpose` is one line: a folder for something else is not taken, nor one that holds any of `inputs`.
    Raises StorageError, with the reason.
    """
    folder = Path(folder)
    try:
        place = folder.resolve()
        if inside := [file for file in inputs if place in file.resolve().parents]:
            raise StorageError(
                f"{folder}: holds data that is to be read, {inside[0].name}; choose a folder of its own"
            )
        folder.mkdir(parents=True, exist_ok=True)
        others = sorted(each.name for each in folder.iterdir() if not _is_ours(each))
        owner = owner_of(folder)
        if owner is None and others:
            raise StorageError(
                f"{folder}: holds what szlib did not write, such as {others[0]!r}; choose a folder that is "
                "new or empty (or remove what an earlier szlib has left there)"
            )
        if owner is None:
            _claim(folder / MARKER, purpose)
            owner = owner_of(folder)
    except OSError as error:
        raise StorageError(
            f"{folder}: cannot be made or read ({error.strerror or error}); choose another folder"
        ) from error
    if owner != purpose:
        raise StorageError(f"{folder}: holds {owner}; {purpose} need another folder")
    _sweep(folder, _UNFINISHED)
    return folder


def owner_of(folder: str | Path) -> str | None:
    """For what szlib has marked a folder, or None."""
    try:
        return (Path(folder) / MARKER).read_text(encoding="utf-8").splitlines()[0]
    except (OSError, ValueError, IndexError):
        return None


@contextmanager
def held(folder: str | Path) -> Iterator[None]:
    """Keep a folder of szlib's to this process; it is free again however the process ends.

    Raises StorageError where another process has it.
    """
    with (Path(folder) / MARKER).open("r+b") as marker:
        try:
            _lock(marker.fileno())
        except OSError as error:
            raise StorageError(
                f"{folder}: another process is writing there; wait for its end, or choose another folder"
            ) from error
        yield


def _lock(file: int) -> None:
    if sys.platform == "win32":
        import msvcrt

        os.lseek(file, _BLOCK, os.SEEK_SET)  # beyond what is read of it
        msvcrt.locking(file, msvcrt.LK_NBLCK, 1)
    else:
        import fcntl

        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)


@contextmanager
def temporary_folder() -> Iterator[Path]:
    """A folder for what is temporary; gone at the end, or with the next call where this process is killed.

    Raises StorageError where there is no room for it.
    """
    try:
        place = Path(tempfile.gettempdir())
        _sweep(place, _TEMPORARY)
        folder = Path(tempfile.mkdtemp(prefix=f"{_TEMPORARY}{_process()}-", dir=place))
    except OSError as error:
        raise StorageError(
            f"no temporary folder ({error.strerror or error}); make room, or name another in $TMPDIR"
        ) from error
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def sweep_temporary() -> None:
    """Remove what processes that are dead have left in the temporary folder."""
    with suppress(OSError):
        _sweep(Path(tempfile.gettempdir()), _TEMPORARY)


def file_content(file: Path) -> tuple[int, str]:
    """Size of a file, and the SHA-256 over the CRC-32 of each of its MiB.

    It reads the whole file, at 5 to 10 times the speed of a SHA-256 over all of it; a block that has
    changed by accident goes unnoticed with a probability of 2**-32, a short burst of errors never.
    """
    size = file.stat().st_size
    digest, read = hashlib.sha256(), 0
    with ThreadPoolExecutor(_READERS) as readers:
        for count, checksums in readers.map(lambda at: _checksums(file, at), range(0, size, _AT_ONCE)):
            digest.update(checksums)
            read += count
    return read, digest.hexdigest()


def _checksums(file: Path, begin: int) -> tuple[int, bytes]:
    """Bytes read from there on, at most `_AT_ONCE`, and the CRC-32 of each of their MiB."""
    found, read, block = [], 0, bytearray(_BLOCK)
    with file.open("rb", buffering=0) as stream:
        stream.seek(begin)
        while read < _AT_ONCE and (count := stream.readinto(block)):
            read += count
            found.append(zlib.crc32(memoryview(block)[:count]).to_bytes(4, "big"))
    return read, b"".join(found)


def printable(name: object) -> str:
    """A file's name as text that any file and any terminal takes: bytes that are no UTF-8 are spelled out."""
    text = str(name).encode("utf-8", "surrogateescape").decode("utf-8", "backslashreplace")
    return "".join(letter if letter.isprintable() else ascii(letter)[1:-1] for letter in text)


def _fill(unfinished: Path, content: bytes, lasting: bool) -> None:
    """Every byte that szlib writes goes through here."""
    with unfinished.open("xb") as stream:
        stream.write(content)
        if lasting:
            stream.flush()
            os.fsync(stream.fileno())


def _claim(marker: Path, purpose: str) -> None:
    """Write the marker unless somebody has: of two processes one comes first."""
    unfinished = marker.with_name(f"{_UNFINISHED}{_process()}-{uuid.uuid4().hex[:8]}")
    try:
        _fill(
            unfinished, f"{purpose}\nWritten by szlib, which may replace all that is here.\n".encode(), True
        )
        with suppress(FileExistsError):
            try:
                os.link(unfinished, marker)
            except FileExistsError:
                raise
            except (OSError, AttributeError):  # a file system without hard links
                unfinished.replace(marker)
    finally:
        with suppress(OSError):
            unfinished.unlink()


def _is_ours(entry: Path) -> bool:
    """A marker, an unfinished file, or a folder with a marker."""
    return entry.name.startswith(MARKER) or (entry / MARKER).is_file()


def _sync(folder: Path) -> None:
    """Make the names in a folder last; where folders cannot be opened (Windows) nothing is needed."""
    try:
        handle = os.open(folder, os.O_RDONLY)
    except OSError:
        return
    try:
        os.fsync(handle)
    except OSError as error:
        if error.errno not in (None, 22):  # EINVAL: a file system that does not sync folders
            raise
    finally:
        os.close(handle)


def _process() -> str:
    """This process among all machines that share a folder."""
    return f"{re.sub(r'[^A-Za-z0-9]', '', socket.gethostname())[:32]}-{os.getpid()}"


def _sweep(folder: Path, prefix: str) -> None:
    """Remove what processes of this machine that are dead have left."""
    host, own = _process().split("-")
    with os.scandir(folder) as entries:
        left = [entry.path for entry in entries if entry.name.startswith(f"{prefix}{host}-")]
    for path in left:
        number = Path(path).name.removeprefix(f"{prefix}{host}-").split("-")[0]
        if number == own or not number.isdecimal() or _alive(int(number)):
            continue
        if Path(path).is_dir() and not Path(path).is_symlink():
            shutil.rmtree(path, ignore_errors=True)
        else:
            with suppress(OSError):
                Path(path).unlink()


def _alive(process: int) -> bool:
    """Whether a process of this machine lives; True where that cannot be asked without harm (Windows)."""
    if os.name != "posix":
        return True
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):
        return True
    return True
