"""The stored encounters of a day: written as a whole or not at all, known by what they were made of."""

from __future__ import annotations

import hashlib
import io
import json
import uuid
import zlib
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pandas as pd

from .. import __version__
from ..errors import DataError
from ..tracks import funnels
from .pipeline import Chain

_FORMAT, _VERSION = "szlib.extraction", 2

_BLOCK = 1 << 20
"""Bytes of a file whose checksum is taken at a time."""


def day_key(files: Sequence[str], chain: Chain) -> str:
    """Names the result: the content of the files, every parameter, and this version of szlib."""
    content = sorted((Path(file).name, *file_content(Path(file))) for file in files)
    named = {"format": [_FORMAT, _VERSION, __version__], "files": content, "parameters": asdict(chain)}
    return hashlib.sha256(json.dumps(named, sort_keys=True).encode()).hexdigest()


def file_content(file: Path) -> tuple[int, str]:
    """Size of a file, and the SHA-256 over the CRC-32 of each of its MiB.

    It reads the whole file, at 5 to 10 times the speed of a SHA-256 over all of it; a block that has
    changed by accident goes unnoticed with a probability of 2**-32, a short burst of errors never.
    """
    digest, size, block = hashlib.sha256(), 0, bytearray(_BLOCK)
    with file.open("rb", buffering=0) as stream:
        while count := stream.readinto(block):
            size += count
            digest.update(zlib.crc32(memoryview(block)[:count]).to_bytes(4, "big"))
    return size, digest.hexdigest()


def finished_record(folder: Path, day: str, key: str) -> dict[str, Any] | None:
    """The record of a day that is there, whole, and made of the same content with the same parameters."""
    try:
        record = json.loads((folder / f"{day}.json").read_text(encoding="utf-8"))
        samples = (folder / f"{day}.parquet").read_bytes()
    except (OSError, ValueError):  # not there, or not whole
        return None
    whole = isinstance(record, dict) and record.get("key") == key
    return record if whole and record.get("sha256") == hashlib.sha256(samples).hexdigest() else None


def write_record(
    folder: Path, day: str, key: str, samples: pd.DataFrame, files: Sequence[str], chain: Chain
) -> dict[str, Any]:
    """Write the samples of a day, then its record."""
    content = io.BytesIO()
    samples.to_parquet(content, index=False)
    stages = funnels.of(samples)
    read = [stage for stage in stages if stage["stage"].startswith("read ")]
    record = {
        "format": _FORMAT,
        "version": _VERSION,
        "szlib": __version__,
        "key": key,
        "day": day,
        "files": [Path(file).name for file in files],
        "parameters": asdict(chain),
        "rows": sum(stage["entered"] for stage in read),
        "unusable": sum(stage["entered"] - stage["kept"] for stage in read),
        "encounters": int(samples["encounter"].nunique()),
        "samples": len(samples),
        "sha256": hashlib.sha256(content.getvalue()).hexdigest(),
        "funnel": stages,
    }
    replace_file(folder / f"{day}.parquet", content.getvalue())
    replace_file(folder / f"{day}.json", json.dumps(record, indent=1).encode())
    return record


def replace_file(path: Path, content: bytes) -> None:
    """Write a file as a whole or not at all, and sweep up what a killed run has left of it."""
    unfinished = path.parent / f".{path.name}.{uuid.uuid4().hex}"
    try:
        unfinished.write_bytes(content)
        unfinished.replace(path)
        for stale in path.parent.glob(f".{path.name}.*"):
            stale.unlink(missing_ok=True)
    except OSError as error:
        with suppress(OSError):  # what could not be written may not be there to be removed
            unfinished.unlink()
        raise DataError(
            f"{path}: cannot be written ({error}); make room, or choose a folder that is writable; "
            "days finished before are intact, and kept by the next run"
        ) from error
