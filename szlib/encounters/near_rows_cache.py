"""Rows near the square, kept in the user's cache: asked with other conditions, a day is not read again.

An entry is known by the content of its file, by all that says which rows are near, and by this version of
the step; it is whole, or it is made anew (`szlib.files.load_cached`).  $SZLIB_CACHE names the folder of the
cache, or is "off".  Entries take at most `LIMIT`; the least recently used are removed.  `clear` removes all.
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

import numpy as np
import pyarrow as pa  # type: ignore[import-untyped]
import pyarrow.parquet as pq  # type: ignore[import-untyped]

from ..errors import StorageError
from ..files import CACHE, MARKER, cache_folder, claim_folder, load_cached, store_cached
from .blocks import Rows, Tally

Content = Callable[[], tuple[int, str]]
"""Gives size and checksum of a file, once they are known."""
PURPOSE = "rows near a square"
"""What the folder of the entries is marked as."""
LIMIT = 2_000_000_000
"""Bytes of all entries; the 92 days of the paper take 1.6e9."""
_STEP = 1
"""Version of what is kept, and of how rows near the square are found: another one reads no older entry."""
_SCALES = (1, 1000)
"""Numbers that are whole in such parts of a unit are kept as whole numbers."""


def folder() -> Path | None:
    """Where entries are; None where they are off."""
    return cache_folder("near-rows")


def find(size: int, which: dict[str, Any], content: Content) -> tuple[Rows, Tally] | None:
    """The rows of a file of this size [bytes] and content, and what was seen of it; None if not kept whole.

    An entry that may be the file's is read before its content is asked for, which takes a while to be known.
    """
    home = folder()
    for path in home.glob(f"{_name(size, which)}-*.parquet") if home else ():
        kept_of = size, path.stem.rpartition("-")[2]
        entry = load_cached(path, _made_of(kept_of, which))
        found = _read(entry) if entry else None
        if found and kept_of == content():
            with suppress(OSError):  # only the order in which entries give way depends on it
                os.utime(path)
            return found
    return None


def _read(entry: bytes) -> tuple[Rows, Tally]:
    with pq.ParquetFile(io.BytesIO(entry)) as file:  # column by column, as memory is short
        told = json.loads(file.schema_arrow.metadata[b"szlib"])
        rows = [file.read([name])[name].to_numpy() / told["scales"][name] for name in Rows._fields]
    seen = told["tally"]
    first = tuple(seen["first"]) if seen["first"] else None
    return Rows(*rows), Tally(seen["good"], seen["reach"], Counter(seen["reasons"]), first)


def remember(content: tuple[int, str], which: dict[str, Any], rows: Rows, seen: Tally) -> None:
    """Keep the rows of a file; where that cannot be done, a RuntimeWarning says why, and the day goes on."""
    home = folder()
    if home is None:
        return
    packed = {name: _packed(values) for name, values in rows._asdict().items()}
    table = pa.table({name: values for name, (values, _) in packed.items()})
    told = {"scales": {name: scale for name, (_, scale) in packed.items()}, "tally": vars(seen)}
    table = table.replace_schema_metadata({"szlib": json.dumps(told)})
    encodings = {
        field.name: "DELTA_BINARY_PACKED" if pa.types.is_integer(field.type) else "BYTE_STREAM_SPLIT"
        for field in table.schema
    }
    file = io.BytesIO()
    pq.write_table(table, file, compression="zstd", use_dictionary=False, column_encoding=encodings)
    try:
        claim_folder(home, PURPOSE)
        store_cached(_path(home, content, which), file.getvalue(), _made_of(content, which))
        _make_room(home, LIMIT)
    except (StorageError, OSError) as error:
        warnings.warn(
            f"rows near the square are not kept ({error}); name another folder in ${CACHE}, or set it to off",
            RuntimeWarning,
            stacklevel=2,
        )


def clear() -> None:
    """Remove every entry."""
    home = folder()
    if home is not None and home.is_dir():
        _make_room(home, 0)


def _packed(values: np.ndarray) -> tuple[np.ndarray, int]:
    """The values as whole numbers of 1 / scale where that is exact to the last bit, and the scale."""
    for scale in _SCALES:
        whole = np.rint(values * scale)
        if np.abs(whole).max(initial=0) < 2**53 and np.array_equal(
            (whole.astype(np.int64) / scale).view(np.int64), values.view(np.int64)
        ):
            return whole.astype(np.int64), scale
    return values, 1


def _made_of(content: tuple[int, str], which: dict[str, Any]) -> dict[str, Any]:
    return {"step": _STEP, "content": list(content), "which": which}


def _name(size: int, which: dict[str, Any]) -> str:
    return f"{size}-{hashlib.sha256(json.dumps([_STEP, which], sort_keys=True).encode()).hexdigest()[:16]}"


def _path(home: Path, content: tuple[int, str], which: dict[str, Any]) -> Path:
    return home / f"{_name(content[0], which)}-{content[1]}.parquet"


def _make_room(home: Path, limit: int) -> None:
    """Remove the entries not used for longest, until the others take no more than `limit` bytes."""
    entries = []
    for path in home.iterdir():
        if not path.name.startswith(MARKER):
            with suppress(FileNotFoundError):  # another process makes room as well
                entries.append((path.stat().st_mtime, path.stat().st_size, path))
    taken = 0
    for _, size, path in sorted(entries, reverse=True):
        taken += size
        if taken > limit:
            path.unlink(missing_ok=True)
