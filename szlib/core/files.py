"""Atomic files, folders that belong to szlib, and cached results.

Every file is written here: completely, or not at all. A folder of results holds a marker file, `.szlib`. Its
first line says what the folder is for. A folder that holds other files and no marker is never written into.
Neither is a folder that holds the input data. What a killed process left unfinished in a claimed folder (not
in folders in it) is removed an hour later, by the next one that claims it.
"""

from __future__ import annotations

import hashlib
import json
import os
import time
import uuid
from contextlib import suppress
from pathlib import Path
from typing import Any

from .errors import StorageError
from .input_files import explain_errors, open_regular, read_small

MARKER = ".szlib"  # name of the file that marks a folder as szlib's
_PART = f"{MARKER}-part-"  # how names of unfinished files begin
_ABANDONED = 3600  # age of an unfinished file that no process writes any more [s]


def write_file(path: str | Path, content: bytes | str, *, durable: bool = True) -> None:
    """Write `content` to `path` completely, or leave the file as it was.

    With `durable` its content survives a power failure (fsync). Two processes may write the same file: one of
    them wins. The folder must exist. Raises StorageError.
    """
    path = Path(path)
    data = content.encode() if isinstance(content, str) else content
    unfinished = path.with_name(f"{_PART}{uuid.uuid4().hex}")
    with explain_errors(
        f"{path}: cannot be written",
        "make room, or choose a folder that is writable; files that were finished before are intact",
        StorageError,
        OSError,
    ):
        try:
            _fill(unfinished, data, durable)
            unfinished.replace(path)
        finally:
            unfinished.unlink(missing_ok=True)


def _fill(unfinished: Path, content: bytes, durable: bool) -> None:
    with unfinished.open("xb") as stream:
        stream.write(content)
        if durable:
            stream.flush()
            os.fsync(stream.fileno())


def store_cached(path: Path, content: bytes, made_of: Any) -> None:
    """Write `content` to `path`, and beside it a checksum and `made_of` (JSON values); see `load_cached`."""
    write_file(path, content)
    write_checksum(path, content, made_of)


def write_checksum(path: Path, content: bytes, made_of: Any) -> None:
    """Write ``NAME.json`` beside the file `path`: the checksum of `content` and `made_of` (JSON values)."""
    write_file(f"{path}.json", _make_record(content, made_of))


def load_cached(path: Path, made_of: Any) -> bytes | None:
    """The content of `path` from `store_cached`; None if missing, damaged, or not made of `made_of`."""
    with suppress(OSError), open_regular(path) as stream:
        content = stream.read()
        if read_small(Path(f"{path}.json")) == _make_record(content, made_of):
            return content
    return None


def _make_record(content: bytes, made_of: Any) -> bytes:
    checksum = hashlib.sha256(content).hexdigest()
    return json.dumps({"made_of": made_of, "sha256": checksum}, indent=1).encode()


def claim_folder(folder: str | Path, purpose: str) -> Path:
    """Make `folder`, or reuse it if it is empty or was claimed for the same `purpose`; return its path.

    Parameters
    ----------
    folder : the folder; its parents are made too.
    purpose : one line, such as "days"; a folder with another purpose is refused.

    Raises
    ------
    StorageError : the folder is refused, or cannot be made or read.
    """
    folder = Path(folder)
    with explain_errors(
        f"{folder}: cannot be made or read",
        "choose another folder",
        StorageError,
        OSError,
    ):
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
        write_file(
            folder / MARKER,
            f"{purpose}\nWritten by szlib, which may replace every file here.\n",
        )
    elif owner != purpose:
        raise StorageError(f"{folder}: holds {owner}; {purpose} need another folder")
    for part in folder.glob(f"{_PART}*"):
        with suppress(OSError):
            if part.stat().st_mtime < time.time() - _ABANDONED:
                part.unlink()
    return folder


def folder_purpose(folder: str | Path) -> str | None:
    """The purpose for which `folder` was claimed, or None."""
    with suppress(OSError, ValueError, IndexError):
        return read_small(Path(folder) / MARKER).decode().splitlines()[0]
    return None
