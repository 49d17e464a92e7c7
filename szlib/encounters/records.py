"""The stored encounters of a day: written as a whole or not at all, known by what they were made of."""

from __future__ import annotations

import hashlib
import io
import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pandas as pd

from .. import __version__
from ..files import file_content, write_file
from ..tracks import funnels
from .pipeline import Chain

_FORMAT, _VERSION = "szlib.extraction", 2
_TOLD = {"rows", "unusable", "encounters", "samples"}


def day_key(files: Sequence[str], chain: Chain) -> str:
    """Names the result: the content of the files, every parameter, and this version of szlib."""
    content = sorted((Path(file).name, *file_content(Path(file))) for file in files)
    named = {"format": [_FORMAT, _VERSION, __version__], "files": content, "parameters": asdict(chain)}
    return hashlib.sha256(json.dumps(named, sort_keys=True).encode()).hexdigest()


def finished_record(folder: Path, day: str, key: str) -> dict[str, Any] | None:
    """The record of a day that is there, whole, and made of the same content with the same parameters."""
    try:
        record = json.loads((folder / f"{day}.json").read_text(encoding="utf-8"))
        samples = (folder / f"{day}.parquet").read_bytes()
    except (OSError, ValueError):  # not there, or not whole
        return None
    whole = isinstance(record, dict) and record.get("key") == key and set(record) >= _TOLD
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
    write_file(folder / f"{day}.parquet", content.getvalue())
    write_file(folder / f"{day}.json", json.dumps(record, indent=1))
    return record
