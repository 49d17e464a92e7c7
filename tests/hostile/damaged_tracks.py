"""Files of tracks with small accidents: read with a funnel that adds up, or refused with an error of szlib.

Every file is read whole and streamed, with the same result.  The error names the file.  Nothing hangs, and
memory stays below 1 GB.
"""

from __future__ import annotations

import gzip
import random
import resource
import signal
import tempfile
import warnings
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import pandas as pd
from helpers.raw_days import read_near
from helpers.track_files import WRITERS, lines_of, mutate, samples

import szlib
from szlib.tracks import funnels
from szlib.tracks.readers import read_raw

FILES = {False: 60, True: 20_000}
FIRST_SEED = 100_000
TIME_LIMIT = 20
"""Seconds that reading a file may take."""
MEMORY_LIMIT = 1 << 30
EXPECTED = (
    "read",
    "read with rejected rows",
    "refused with a line",
    "refused as a whole",
)


def attack(long: bool) -> Counter[str]:
    """Read damaged files, and count the outcomes."""
    tally = Counter(dict.fromkeys(EXPECTED, 0))
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(FIRST_SEED, FIRST_SEED + FILES[long]):
            tally[read_damaged(Path(folder), seed)] += 1
    tally["broken: more memory than allowed"] = int(_peak_memory() >= MEMORY_LIMIT)
    tally["broken: an outcome that never came"] = sum(
        tally[outcome] == 0 for outcome in EXPECTED
    )
    return tally


def _peak_memory() -> int:
    """Largest memory of this process so far, in bytes.

    On Linux ru_maxrss counts the memory of the process that started this one as well; VmHWM does not.
    """
    status = Path("/proc/self/status")
    if status.exists():
        line = next(
            line
            for line in status.read_text().splitlines()
            if line.startswith("VmHWM:")
        )
        return int(line.split()[1]) * 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def read_damaged(folder: Path, seed: int) -> str:
    """Read one damaged file both ways, and return the outcome.

    Raises whatever is not an error of szlib, and AssertionError where the two ways differ.
    """
    rng = random.Random(seed)
    name = rng.choice(sorted(WRITERS))
    content = WRITERS[name](samples(count=rng.randint(2, 40))).encode()
    packed = rng.random() < 0.2
    content = gzip.compress(mutate(content, rng)) if packed else mutate(content, rng)
    path = folder / f"m{seed}.csv"
    path.write_bytes(mutate(content, rng) if packed and rng.random() < 0.3 else content)
    signal.alarm(TIME_LIMIT)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            warnings.simplefilter("ignore", szlib.DataWarning)
            whole, streamed = (_outcome(path, read) for read in (read_raw, _streamed))
    finally:
        signal.alarm(0)
        path.unlink()
    if whole != streamed:
        raise AssertionError(f"seed {seed}: whole {whole}, streamed {streamed}")
    return whole[0]


def _streamed(path: Path) -> pd.DataFrame:
    return read_near(path, szlib.ATC_SQUARE)


def _outcome(path: Path, read: Callable[[Path], pd.DataFrame]) -> tuple[str, str]:
    """The outcome, and the first stage of the funnel or the error."""
    try:
        stages = funnels.get(read(path))
    except szlib.SzlibError as error:
        message = str(error)
        assert str(path) in message, message
        return (
            "refused with a line" if ", line " in message else "refused as a whole"
        ), message
    entered = lines_of(path)
    assert stages[0]["entered"] in (entered, entered - 1), "a header is no row"
    for stage in stages:
        assert stage["entered"] == stage["kept"] + sum(stage["rejected"].values())
    for before, after in zip(stages, stages[1:], strict=False):
        assert before["kept"] == after["entered"]
    return "read with rejected rows" if stages[0]["rejected"] else "read", str(
        stages[0]
    )
