"""Many days to encounters: a Parquet file and a funnel for each, resumable, on one machine or many.

In the folder `out` each day leaves ``<day>.parquet``, its samples, and then ``<day>.json``, its record: the
funnel, every parameter, and a key made of these and of the content of the day's files.  Both are written
as a whole or not at all, the record last.  A day whose record has the right key, and whose samples have
the right SHA-256, is not computed again; so a run that was stopped or killed goes on where it was.
"""

from __future__ import annotations

import gzip
import hashlib
import io
import json
import time
import uuid
import warnings
import zlib
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any
from zoneinfo import ZoneInfo

import joblib
import numpy as np
import pandas as pd
from tqdm import tqdm

from . import __version__, datasets, funnels
from .encounters import ATC_SQUARE, SAMPLE_COLUMNS, AttentionalSpace, Square, find_encounters
from .errors import DataError, DataWarning, SzlibError
from .jobs import handed_out
from .nearby import read_nearby
from .readers import FORMATS, layout_of, read_raw
from .tracks import to_clock

_FORMAT, _VERSION = "szlib.extraction", 1
_BLOCK = 1 << 20
"""Bytes of a file whose checksum is taken at a time."""
_LONGEST_LINE = 100_000
_READ = "read all files"
"""The first stage of the funnel of many days."""


@dataclass(frozen=True)
class Chain:
    """Every parameter from a file to its encounters: those of `read_tracks` and `find_encounters`."""

    square: Square = ATC_SQUARE
    space: AttentionalSpace = field(default_factory=AttentionalSpace)
    duration: float = 3.0
    min_distance: float = 1.0
    min_speed: float = 0.4
    throughout: bool = False
    file_format: str | None = None
    unit: str | None = None
    max_gap: float | None = None
    tz: str = "Asia/Tokyo"

    def __post_init__(self) -> None:
        try:
            ZoneInfo(self.tz)
        except (KeyError, ValueError, OSError) as error:
            raise DataError(f"unknown time zone {self.tz!r}; expected one like 'Asia/Tokyo'") from error
        if self.file_format is not None and self.file_format not in FORMATS:
            raise DataError(f"unknown file_format {self.file_format!r}; expected one of {list(FORMATS)}")
        if self.unit not in (None, "m", "mm"):
            raise DataError(f"unit must be 'm' or 'mm'; got {self.unit!r}")

    def encounters(self, files: Sequence[Path]) -> pd.DataFrame:
        """The encounters of one day's files: identical to those found from `szlib.read_tracks(files)`."""
        if len(files) == 1:
            raw = read_nearby(
                files[0],
                square=self.square,
                duration=self.duration,
                file_format=self.file_format,
                unit=self.unit,
                max_gap=self.max_gap,
                tz=self.tz,
            )
        else:
            raw = read_raw(files, file_format=self.file_format, unit=self.unit, tz=self.tz)
        tracks = to_clock(raw, max_gap=self.max_gap) if len(raw) else raw
        if len(tracks) == 0:
            return funnels.carry(_no_samples(), funnels.of(tracks))
        return find_encounters(
            tracks,
            square=self.square,
            space=self.space,
            duration=self.duration,
            min_distance=self.min_distance,
            min_speed=self.min_speed,
            throughout=self.throughout,
        )


@dataclass(frozen=True, eq=False)
class Extraction:
    """What `extract_days` has done.

    Parameters
    ----------
    out : folder of the results.
    table : one row a day: day, status ("done" now, "kept" from before, "excluded", "failed"), files, rows
        read, unusable rows among them, encounters, samples, seconds, and why a day failed.
    exclude : days that were left out.
    """

    out: Path
    table: pd.DataFrame
    exclude: tuple[str, ...] = ()

    @property
    def failed(self) -> pd.DataFrame:
        """The days that failed, and why."""
        return self.table[self.table["status"] == "failed"]

    def samples(self) -> pd.DataFrame:
        """Samples of all finished days, as from `szlib.find_encounters`, by day, encounters numbered anew.

        The funnels of all days are added up, stage by stage.
        Independent of the order of the files, of what was kept, and of who computed it.  Raises DataError
        where no day was finished.
        """
        days = self.table.loc[self.table["status"].isin(["done", "kept"]), "day"]
        if len(days) == 0:
            raise DataError(f"no day was finished in {self.out}; see the table: {self}")
        parts, stages, count = [], [], 0
        for day in sorted(days):
            part = pd.read_parquet(self.out / f"{day}.parquet")
            stages.append(
                [s | {"stage": _READ} if s["stage"].startswith("read ") else s for s in funnels.of(part)]
            )
            part = part[~part["day"].isin(self.exclude)]
            numbers, found = pd.factorize(part["encounter"])
            parts.append(part.assign(encounter=numbers + count, day=part["day"].astype(str)))
            count += len(found)
        samples = pd.concat([part for part in parts if len(part)] or parts[:1], ignore_index=True)
        return funnels.carry(samples.astype({"day": "category"}), funnels.add(stages))

    def __str__(self) -> str:
        shown = self.table.to_string(index=False, float_format="{:.1f}".format)
        counts = self.table["status"].value_counts().sort_index()
        return f"{shown}\n" + ", ".join(f"{n} {status}" for status, n in counts.items())


def extract_days(
    paths: str | Path | Sequence[str | Path],
    *,
    out: str | Path,
    n_jobs: int | None = None,
    exclude: Iterable[str] = (),
    progress: bool = True,
    **parameters: Any,
) -> Extraction:
    """Find the encounters of many days, each on its own, and keep them in a folder.

    Parameters
    ----------
    paths : files, folders or globs.  Files that begin on the same calendar day make one day (the pieces
        of the 1 Hz day); a recording that counts frames or has its own days is one by its name.
    out : folder of the results; made if it is missing.  Only one run at a time may write into it.
    n_jobs : processes; None takes what ``joblib.parallel_config`` says, such as a Dask cluster, or one.
    exclude : days "YYYY-MM-DD" to leave out, as event days were in the paper (sec. 2); they are not read.
    progress : whether to show a bar over the days.
    parameters : of `szlib.read_tracks` and `szlib.find_encounters`: square, space, duration, min_distance,
        min_speed, throughout, file_format, unit, max_gap, tz.

    Returns
    -------
    An `Extraction`: its table says what became of each day; a day that fails does not stop the others.

    Raises
    ------
    DataError : there is no such file or parameter, or the folder cannot be made.
    """
    unknown = sorted(set(parameters) - set(Chain.__dataclass_fields__))
    if unknown:
        raise DataError(f"unknown parameter {unknown}; expected some of {list(Chain.__dataclass_fields__)}")
    chain, folder = Chain(**parameters), Path(out)
    excluded = (exclude,) if isinstance(exclude, str) else tuple(sorted(map(str, exclude)))
    days: dict[str, list[str]] = {}
    for file in sorted({file.resolve() for file in datasets.find(paths, cache=folder)}):
        days.setdefault(_day_of(file, chain), []).append(str(file))
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise DataError(f"{folder}: cannot be made ({error}); choose another folder") from error
    rows = [_row(day, files, status="excluded") for day, files in days.items() if day in excluded]
    tasks = [
        joblib.delayed(extract_day)(day, files, str(folder.resolve()), chain)
        for day, files in sorted(days.items())
        if day not in excluded
    ]
    with tqdm(total=len(tasks), unit="day", disable=not progress) as bar:
        for row in handed_out(tasks, n_jobs=n_jobs):
            rows.append(row)
            bar.update()
            bar.set_postfix_str(f"{row['day']} {row['status']}")
    table = pd.DataFrame(rows).sort_values("day", ignore_index=True)
    return Extraction(folder, table, excluded)


def extract_day(day: str, files: Sequence[str], out: str, chain: Chain) -> dict[str, Any]:
    """Compute one day, or keep it if it is there; its row of the table.  Nothing but `out` is shared."""
    begun = time.perf_counter()
    row, folder = _row(day, files, status="failed"), Path(out)
    try:
        key = _key(files, chain)
        record = _finished(folder, day, key)
        status = "kept" if record else "done"
        if record is None:
            with warnings.catch_warnings():  # the table and the funnel tell of rows set aside
                warnings.simplefilter("ignore", DataWarning)
                samples = chain.encounters([Path(file) for file in files])
            record = _keep(folder, day, key, samples, files, chain)
        row |= {name: record[name] for name in ("rows", "unusable", "encounters", "samples")}
        row["status"] = status
    except (SzlibError, OSError, MemoryError) as error:
        row["why"] = str(error) or type(error).__name__
    return row | {"seconds": time.perf_counter() - begun}


def _row(day: str, files: Sequence[str], status: str) -> dict[str, Any]:
    counts = dict.fromkeys(("rows", "unusable", "encounters", "samples"), 0)
    return {"day": day, "status": status, "files": len(files), **counts, "seconds": 0.0, "why": ""}


def _day_of(file: Path, chain: Chain) -> str:
    """The calendar day on which a file begins; its name where it has no time of day."""
    name = file.name.split(".")[0]
    try:
        with file.open("rb") as stream:
            packed = stream.read(2) == b"\x1f\x8b"
        with gzip.open(file) if packed else file.open("rb") as stream:
            first = stream.readline(_LONGEST_LINE).decode("utf-8", errors="replace").lstrip("\ufeff").strip()
        layout = layout_of(first, chain.file_format)
        if layout.name not in ("atc-raw", "atc-1hz"):
            return name
        begun = float(first.split(layout.separator)[layout.columns["t"]])
        return datetime.fromtimestamp(begun, ZoneInfo(chain.tz)).strftime("%Y-%m-%d")
    except (OSError, EOFError, zlib.error, ValueError, OverflowError):  # reading the day will tell why
        return name


def _key(files: Sequence[str], chain: Chain) -> str:
    """Names the result: the content of the files, every parameter, and this version of szlib."""
    content = sorted((Path(file).name, *_content(Path(file))) for file in files)
    named = {"format": [_FORMAT, _VERSION, __version__], "files": content, "parameters": asdict(chain)}
    return hashlib.sha256(json.dumps(named, sort_keys=True).encode()).hexdigest()


def _content(file: Path) -> tuple[int, str]:
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


def _finished(folder: Path, day: str, key: str) -> dict[str, Any] | None:
    """The record of a day that is there, whole, and made of the same content with the same parameters."""
    try:
        record = json.loads((folder / f"{day}.json").read_text(encoding="utf-8"))
        samples = (folder / f"{day}.parquet").read_bytes()
    except (OSError, ValueError):  # not there, or not whole
        return None
    whole = isinstance(record, dict) and record.get("key") == key
    return record if whole and record.get("sha256") == hashlib.sha256(samples).hexdigest() else None


def _keep(
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
    _replace(folder / f"{day}.parquet", content.getvalue())
    _replace(folder / f"{day}.json", json.dumps(record, indent=1).encode())
    return record


def _replace(path: Path, content: bytes) -> None:
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


def _no_samples() -> pd.DataFrame:
    """A table of samples in which nobody met."""
    integers, numbers = np.zeros(0, np.int64), np.zeros(0)
    columns: Mapping[str, Any] = dict.fromkeys(SAMPLE_COLUMNS, numbers) | dict.fromkeys(
        ("encounter", "ref_id", "other_id"), integers
    )
    return pd.DataFrame({**columns, "day": pd.Categorical([])})[SAMPLE_COLUMNS]
