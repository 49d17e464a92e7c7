"""A disk that is full at each write in turn, damaged files, and clocks that jump: no result is wrong.

Every file is written by `szlib.core.files`, where the fault is put in: half of the bytes are written, then
there is no room.  Afterwards finished files are intact, and the same call makes the same bytes (except for
the times of steps).
"""

from __future__ import annotations

import io
import json
import os
import random
import sys
import tempfile
import time
import warnings
from collections import Counter
from collections.abc import Callable
from contextlib import redirect_stdout, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import pandas as pd
from helpers.faulty_disk import FaultyDisk

import szlib
from szlib.core import files
from szlib.core.errors import DataError, StorageError, ZoneError
from szlib.plaza.generation import make_plaza
from szlib.plaza.settings import PlazaSettings
from szlib.simulation.monte_carlo import RolloutSetup, rollouts
from szlib.simulation.scenario import Worlds
from szlib.workbook.record import NotebookRecord, ZoneMethod

DAMAGES = {False: 2, True: 300}
STRIDE = 4  # of the writes at which the disk is full, in the short form
JUMPS = {False: 1, True: 40}


def attack(long: bool, seed: int = 0) -> dict[str, int]:
    """Count the attacks, and the results that were missing, half-written or different."""
    tally = Counter(
        {
            "broken after a full disk": 0,
            "broken after damage": 0,
            "broken by a clock": 0,
        }
    )
    with (
        tempfile.TemporaryDirectory() as folder,
        warnings.catch_warnings(),
        redirect_stdout(io.StringIO()),
    ):
        # so few encounters make no good zone
        warnings.simplefilter("ignore", szlib.DataWarning)
        place = Path(folder)
        (place / "data").mkdir()
        for number, date in enumerate(("2012-10-24", "2012-10-28")):
            settings = PlazaSettings(n_encounters=30, date=date)
            make_plaza(
                place / "data" / f"day{number}.csv", seed=number, settings=settings
            )
        for name, work in WORKS.items():
            reference = _reference(work, place, name)
            fill_disks(name, work, place, reference, tally, 1 if long else STRIDE)
            damage(
                name, work, place, reference, random.Random(seed), DAMAGES[long], tally
            )
        jump(
            place,
            _reference(_extract, place, "jumps"),
            random.Random(seed),
            JUMPS[long],
            tally,
        )
    return dict(tally)


def fill_disks(
    name: str,
    work: Callable[[Path, Path], None],
    place: Path,
    reference: dict[str, bytes],
    tally: Counter[str],
    stride: int,
) -> None:
    """Let the disk be full at each write in turn, or at each `stride`-th."""
    full = 0
    while True:
        out = place / f"{name}-full-{full}"
        with FaultyDisk(full) as disk:
            try:
                work(place / "data", out)
                refused = False
            except (StorageError, ZoneError):
                refused = True
        if disk.n_writes <= full:
            break
        found = _contents(out)
        whole = all(
            reference.get(file) == content or is_open(content)
            for file, content in found.items()
        )
        work(place / "data", out)
        if not (refused and whole and _contents(out) == reference):
            print(
                f"{name}, full at write {full}: refused {refused}, whole {whole}",
                file=sys.stderr,
            )
            tally["broken after a full disk"] += 1
        tally["disks full at a write"] += 1
        full += stride


def is_open(content: bytes) -> bool:
    """Whether it is the whole record of a notebook that ended early: the checks that it made."""
    try:
        record = json.loads(content)
    except ValueError:
        return False
    return isinstance(record, dict) and record.get("closed") is False


def damage(
    name: str, work: Callable[[Path, Path], None], place: Path, reference: dict[str, bytes],
    rng: random.Random, count: int, tally: Counter[str],
) -> None:  # fmt: skip
    """Damage a file of the results: the next call repairs it."""
    out = place / f"{name}-damaged"
    work(place / "data", out)
    for _ in range(count):
        file = out / rng.choice(
            sorted(file for file in reference if files.MARKER not in file)
        )
        content = bytearray(file.read_bytes())
        kind = rng.choice(["cut", "flip", "gone", "garbage"])
        if kind == "cut":
            file.write_bytes(content[: rng.randrange(len(content))])
        elif kind == "flip":
            content[rng.randrange(len(content))] ^= 1 << rng.randrange(8)
            file.write_bytes(content)
        elif kind == "gone":
            file.unlink()
        else:
            file.write_bytes(rng.randbytes(50))
        work(place / "data", out)
        if _contents(out) != reference:
            print(f"{name}: {file.name}: {kind} is not repaired", file=sys.stderr)
            tally["broken after damage"] += 1
        tally["results damaged"] += 1


def jump(
    place: Path,
    reference: dict[str, bytes],
    rng: random.Random,
    count: int,
    tally: Counter[str],
) -> None:
    """Clocks that jump forwards and backwards, files from the future: times change no result."""
    real = time.time
    for number in range(count):
        time.time = lambda: real() + rng.uniform(-1e9, 1e9)
        out = place / f"jump-{number % 2}"
        try:
            for file in [
                *(place / "data").iterdir(),
                *(out.iterdir() if out.exists() else []),
            ]:
                moment = rng.uniform(0, 4e9)
                os.utime(file, (moment, moment))
            _extract(place / "data", out)
        finally:
            time.time = real
        tally["broken by a clock"] += _contents(out) != reference
        tally["clocks that jumped"] += 1


def _extract(data: Path, out: Path) -> None:
    done = szlib.extract_days(data, out=out, progress=False)
    if len(done.failed):
        why = done.failed["why"].iloc[0]
        raise (StorageError if "cannot be written" in why else DataError)(why)


def _rollouts(_: Path, out: Path) -> None:
    rollouts(2, RolloutSetup(worlds=Worlds(duration=0.5)), out=out, progress=False)


class _Quick(ZoneMethod):
    """One speed and few resamples: the attack is on files."""

    def fit_options(self) -> dict[str, Any]:
        return super().fit_options() | {"speeds": [self.zone_speed], "n_resamples": 10}


def _notebook(data: Path, out: Path) -> None:
    record = NotebookRecord(
        "05_attack", {"data": [str(data / "day0.csv")], "results": out}
    )
    record.cache = replace(record.cache, method=_Quick())
    record.cache.find_area()
    record.check("encounters", len(record.cache.encounters()) > 0)
    record.cache.zone()
    record.table(pd.DataFrame({"a": [1, 2]}), "table")
    record.animation(b"GIF89a", "movie")
    record.close()


def _plaza(_: Path, out: Path) -> None:
    out.mkdir(exist_ok=True)
    make_plaza(out / "plaza.csv", settings=PlazaSettings(n_encounters=5))


WORKS = {"days": _extract, "worlds": _rollouts, "notebook": _notebook, "plaza": _plaza}


def _reference(
    work: Callable[[Path, Path], None], place: Path, name: str
) -> dict[str, bytes]:
    work(place / "data", place / f"{name}-reference")
    return _contents(place / f"{name}-reference")


def _contents(out: Path) -> dict[str, bytes]:
    """Every file of the results but locks, without times of steps and of files."""
    found = {
        str(file.relative_to(out)): file.read_bytes()
        for file in out.rglob("*")
        if file.is_file() and not file.name.startswith(".szlib-lock")
    }
    for name, content in list(found.items()):
        with suppress(ValueError, LookupError, TypeError):  # no record, or damaged
            record = json.loads(content)
            del record["made_of"]["states"]
            found[name] = json.dumps(record).encode()
        if not Path(name).name.startswith("seeds-"):
            continue
        if name.endswith(".json"):
            found[name] = (
                b"made_of"
                if b'"made_of"' in content and b'"sha256"' in content
                else content
            )
            continue
        with suppress(ValueError, OSError):  # damaged
            table = pd.read_parquet(io.BytesIO(content))
            found[name] = (
                table.drop(columns=[c for c in table if "time_" in c]).to_csv().encode()
            )
    return found
