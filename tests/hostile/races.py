"""Files of tracks that are replaced for some milliseconds and put back while they are read.

Whatever is stored is made of the bytes whose checksum is stored with it, or the day fails with a sentence and
nothing of it is stored.  The files are plain, gzipped or Parquet, and read by `extract_days` or by the cache
of a notebook.
"""

from __future__ import annotations

import contextlib
import gzip
import json
import os
import random
import shutil
import sys
import tempfile
import threading
import time
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from unittest import mock

import szlib
from szlib.core.errors import SzlibError
from szlib.core.input_files import file_content
from szlib.plaza.generation import make_plaza
from szlib.plaza.settings import PlazaSettings
from szlib.workbook.record.data_cache import DataCache

TRIES = {False: 4, True: 2000}
LONGEST = 0.01
"""Longest time for which a file is another one, and between two such times [s]; the first begins later."""
AREA = str(szlib.ATC_SQUARE)
REASONS = (
    "changed",
    "no such file",
    "cannot be opened",
    "the file is empty",
    "damaged",
)
FILES = ("day.csv", "day.csv.gz", "day.parquet")


def attack(long: bool, seed: int = 0) -> Counter[str]:
    """Replace files while they are read, and count the results that are of other bytes than they say."""
    tally = Counter(
        {"broken: rows of other bytes": 0, "broken: refused without a reason": 0}
    )
    # thousands of files need not survive a power failure
    no_sync = mock.patch.object(os, "fsync")
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings(), no_sync:
        warnings.simplefilter("ignore", szlib.DataWarning)
        place = Path(folder)
        furnish(place)
        expected = {name: read_in_peace(place, name) for name in FILES}
        for number in range(TRIES[long]):
            rng = random.Random(f"{seed}-{number}")
            name, swap = rng.choice(FILES), rng.choice(sorted(SWAPS))
            read = rng.choice(sorted(READERS))
            out = place / f"out-{number}"
            with changing(place, name, SWAPS[swap], rng) as swaps:
                found = READERS[read](place / "data" / name, out)
            tally["times that a file was another one"] += swaps[0]
            tally["readings"] += 1
            if fault := judge(found, out, expected[name], tally):
                print(
                    f"{seed}-{number}: {read} of {name}, {swap}: {fault}: {found}",
                    file=sys.stderr,
                )
                tally[f"broken: {fault}"] += 1
            shutil.rmtree(out, ignore_errors=True)
    return tally


def furnish(place: Path) -> None:
    """Make two folders with files of the same names, and links to one of them."""
    for number, folder in enumerate(("data", "other")):
        (place / folder).mkdir()
        day = make_plaza(
            place / folder / FILES[0],
            seed=number,
            settings=PlazaSettings(n_encounters=12),
        )
        (place / folder / FILES[1]).write_bytes(gzip.compress(day.read_bytes()))
        szlib.read_tracks(day).to_parquet(place / folder / FILES[2])


def read_in_peace(place: Path, name: str) -> dict[str, dict[str, bytes]]:
    """What each reader stores of both files of one name, by checksum and reader."""
    expected: dict[str, dict[str, bytes]] = {}
    for folder in ("data", "other"):
        file, stored = place / folder / name, {}
        for read in READERS.values():
            out = place / "peace"
            if fault := read(file, out):
                raise RuntimeError(fault)
            stored |= {result.name: result.read_bytes() for result in _results(out)}
            shutil.rmtree(out)
        expected[file_content(file)[1]] = stored
    if len({stored[each] for stored in expected.values() for each in stored}) < 2 * len(
        stored
    ):
        raise RuntimeError("both files give the same results")
    return expected


def extract(file: Path, out: Path) -> str:
    """Extract the encounters of a file; return why it failed."""
    days = szlib.extract_days(file, out=out, area=AREA, progress=False)
    return "".join(days.table["why"])


def extract_twice(file: Path, out: Path) -> str:
    """Extract the encounters of a file into the same folder twice; return why the second one failed."""
    with contextlib.suppress(SzlibError):
        extract(file, out)
    return extract(file, out)


def use_cache(file: Path, out: Path) -> str:
    """Find encounters as notebook 02 does; the cache of another notebook reads what this one has stored."""
    cache = DataCache(out, [str(file)], area=AREA)
    tracks = cache.tracks()
    settings = cache.method.encounter_settings(cache.find_area(tracks))
    cache.store_encounters(szlib.find_encounters(tracks, settings=settings))
    DataCache(out, [str(file)], area=AREA).encounters()
    return ""


def _refuse(read: Callable[[Path, Path], str]) -> Callable[[Path, Path], str]:
    def attempt(file: Path, out: Path) -> str:
        try:
            return read(file, out)
        except SzlibError as error:
            return str(error)

    return attempt


READERS = {each.__name__: _refuse(each) for each in (extract, extract_twice, use_cache)}


def judge(
    found: str, out: Path, expected: dict[str, dict[str, bytes]], tally: Counter[str]
) -> str:
    """What is wrong with the results in a folder; empty if nothing is."""
    results = _results(out)
    for result in results:
        record = json.loads(result.with_name(f"{result.name}.json").read_text())[
            "made_of"
        ]
        checksum = record["files"][0][2]
        if expected.get(checksum, {}).get(result.name) != result.read_bytes():
            return "rows of other bytes"
    if not found:
        tally["readings that are stored"] += 1
        return "" if results else "nothing is stored"
    tally["readings that are refused"] += 1
    return (
        "" if any(reason in found for reason in REASONS) else "refused without a reason"
    )


def _results(out: Path) -> list[Path]:
    return sorted(
        each
        for each in out.glob("*.parquet")
        if each.with_name(f"{each.name}.json").exists()
    )


@contextlib.contextmanager
def changing(
    place: Path, name: str, swap: Swap, rng: random.Random
) -> Iterator[list[int]]:
    """Let a file of the data be another one once, or again and again; gives how often it was."""
    stop, swaps, first = threading.Event(), [0], rng.uniform(0, 10 * LONGEST)
    most = rng.choice([1, 1, 1, 1000])

    def work() -> None:
        while swaps[0] < most and not stop.wait(
            rng.uniform(0, LONGEST) if swaps[0] else first
        ):
            with swap(place, name):
                swaps[0] += 1
                time.sleep(rng.uniform(0, LONGEST))

    thread = threading.Thread(target=work)
    thread.start()
    try:
        yield swaps
    finally:
        stop.set()
        thread.join()


Swap = Callable[[Path, str], contextlib.AbstractContextManager[None]]


@contextlib.contextmanager
def rename(place: Path, name: str) -> Iterator[None]:
    """Rename another file to the name of this one, and back."""
    file, other, away = place / "data" / name, place / "other" / name, place / "away"
    os.link(file, away)
    other.replace(file)
    yield
    os.link(file, other)
    away.replace(file)


@contextlib.contextmanager
def rewrite(place: Path, name: str) -> Iterator[None]:
    """Write other content into the file, and then its own again, with the old time of change."""
    file, before = place / "data" / name, (place / "data" / name).stat()
    content = file.read_bytes()
    file.write_bytes((place / "other" / name).read_bytes())
    os.utime(file, ns=(before.st_atime_ns, before.st_mtime_ns))
    yield
    file.write_bytes(content)
    os.utime(file, ns=(before.st_atime_ns, before.st_mtime_ns))


SWAPS: dict[str, Swap] = {each.__name__: each for each in (rename, rewrite)}
