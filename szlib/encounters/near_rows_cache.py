"""The user's cache of the rows near an area: a search with other conditions does not read the day again.

An entry belongs to the content of its file, to all that decides which rows are near, and to the version of
that selection.  A damaged entry is made anew (`szlib.files.load_cached`).  $SZLIB_CACHE names the folder of
the cache, or is "off".  All entries together take at most `LIMIT` bytes; those that were not used for
longest are removed.  `clear` removes all.
"""

from __future__ import annotations

import hashlib
import io
import json
import os
import warnings
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import pyarrow as pa  # type: ignore[import-untyped]
import pyarrow.parquet as pq  # type: ignore[import-untyped]

from ..errors import StorageError
from ..files import CACHE, MARKER, cache_folder, claim_folder, load_cached, store_cached
from .blocks import FileRows, FileSummary

Content = Callable[[], tuple[int, str]]
"""Returns size and checksum of a file; waits until they are known."""
PURPOSE = "rows near a square"
"""Purpose of the folder of the entries, as its marker states it (in the words of the first version)."""
LIMIT = 2_500_000_000
"""Bytes of all entries; the 92 days of the paper take about 2.1e9."""
_VERSION = 3
"""Version of the entries and of the selection of rows; entries of another version are not read."""


def folder() -> Path | None:
    """The folder of the entries; None where the cache is off."""
    return cache_folder("near-rows")


def load(size: int, selection: dict[str, Any], content: Content) -> tuple[FileRows, FileSummary] | None:
    """The rows of a file and its summary; None if there is no whole entry.

    `size` is that of the file [bytes], `selection` decides which rows are near.  The entry is read before
    `content` of the file is known, which takes a while.
    """
    home = folder()
    for path in home.glob(f"{_name(size, selection)}-*.parquet") if home else ():
        stored = size, path.stem.rpartition("-")[2]
        entry = load_cached(path, _made_of(stored, selection))
        found = _unpack(entry) if entry else None
        if found and stored == content():
            with suppress(OSError):  # the time only decides which entries are removed first
                os.utime(path)
            return found
    return None


def _unpack(entry: bytes) -> tuple[FileRows, FileSummary]:
    with pq.ParquetFile(io.BytesIO(entry)) as file:  # column by column, to save memory
        summary = json.loads(file.schema_arrow.metadata[b"summary"])
        columns = [file.read([name])[name].to_numpy().copy() for name in FileRows._fields]
    first = tuple(summary["first_fault"]) if summary["first_fault"] else None
    reasons = Counter(summary["reasons"])
    return FileRows(*columns), FileSummary(**summary | {"reasons": reasons, "first_fault": first})


def store(content: tuple[int, str], selection: dict[str, Any], rows: FileRows, summary: FileSummary) -> None:
    """Store the `rows` of a file of this `content`, and its `summary`, for `load` with this `selection`.

    Where that fails a RuntimeWarning says why, and the day goes on.
    """
    home = folder()
    if home is None:
        return
    table = pa.table(rows._asdict()).replace_schema_metadata({"summary": json.dumps(vars(summary))})
    file = io.BytesIO()
    pq.write_table(table, file, compression="zstd", use_dictionary=False, use_byte_stream_split=True)
    path = home / f"{_name(content[0], selection)}-{content[1]}.parquet"
    try:
        claim_folder(home, PURPOSE)
        store_cached(path, file.getvalue(), _made_of(content, selection))
        _remove_oldest(home, LIMIT)
    except (StorageError, OSError) as error:
        warnings.warn(
            f"rows near the area are not cached ({error}); name another folder in ${CACHE}, or set it to off",
            RuntimeWarning,
            stacklevel=2,
        )


def clear() -> None:
    """Remove every entry."""
    home = folder()
    if home is not None and home.is_dir():
        _remove_oldest(home, 0)


def _made_of(content: tuple[int, str], selection: dict[str, Any]) -> dict[str, Any]:
    return {"version": _VERSION, "content": list(content), "selection": selection}


def _name(size: int, selection: dict[str, Any]) -> str:
    key = json.dumps([_VERSION, selection], sort_keys=True)
    return f"{size}-{hashlib.sha256(key.encode()).hexdigest()[:16]}"


def _remove_oldest(home: Path, limit: int) -> None:
    """Remove the entries that were not used for longest, until the others take at most `limit` bytes."""
    entries = []
    for path in home.iterdir():
        if not path.name.startswith(MARKER):
            with suppress(FileNotFoundError):  # another process may remove entries too
                entries.append((path.stat().st_mtime, path.stat().st_size, path))
    total = 0
    for _, size, path in sorted(entries, reverse=True):
        total += size
        if total > limit:
            path.unlink(missing_ok=True)
