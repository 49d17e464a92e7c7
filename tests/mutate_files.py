"""Mutated files, many: `python tests/mutate_files.py 20000`.

Every one must read with a funnel that adds up, streamed as well as whole, or be refused with an error of
szlib that names it; nothing may hang, nor take more than 1 GB.
"""

from __future__ import annotations

import gzip
import random
import resource
import signal
import sys
import tempfile
import warnings
from collections import Counter
from pathlib import Path

from test_readers import WRITERS, lines_of, mutate, samples

import szlib
from szlib.encounters.near_rows import read_near_square
from szlib.tracks import funnels

LONGEST = 20
"""Nothing takes longer than that [s]."""
MOST_MEMORY = 1 << 30


def survive(folder: Path, seed: int) -> str:
    """Read one mutated file both ways; what came of it. Raises where anything but szlib's errors comes."""
    rng = random.Random(seed)
    name = rng.choice(sorted(WRITERS))
    content = WRITERS[name](samples(count=rng.randint(2, 40))).encode()
    packed = rng.random() < 0.2
    content = gzip.compress(mutate(content, rng)) if packed else mutate(content, rng)
    path = folder / f"m{seed}.csv"
    path.write_bytes(mutate(content, rng) if packed and rng.random() < 0.3 else content)
    signal.alarm(LONGEST)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            warnings.simplefilter("ignore", szlib.DataWarning)
            outcomes = [_outcome(path, way) for way in (_whole, _streamed)]
    finally:
        signal.alarm(0)
        path.unlink()
    assert outcomes[0] == outcomes[1], f"seed {seed}: whole {outcomes[0]}, streamed {outcomes[1]}"
    return outcomes[0][0]


def _whole(path: Path) -> list[dict[str, object]]:
    return funnels.get(szlib.tracks.readers.read_raw(path))


def _streamed(path: Path) -> list[dict[str, object]]:
    return funnels.get(read_near_square(path, square=szlib.ATC_SQUARE, duration=3.0))


def _outcome(path: Path, read: object) -> tuple[str, str]:
    try:
        stages = read(path)  # type: ignore[operator]
    except szlib.SzlibError as error:
        told = str(error)
        assert str(path) in told, told
        return ("refused, with its line" if ", line " in told else "refused as a whole"), told
    entered = lines_of(path)
    assert stages[0]["entered"] in (entered, entered - 1), "a header is no row"
    for stage in stages:
        assert stage["entered"] == stage["kept"] + sum(stage["rejected"].values())
    for before, after in zip(stages, stages[1:], strict=False):
        assert before["kept"] == after["entered"]
    return "read with rows set aside" if stages[0]["rejected"] else "read", str(stages[0])


def main() -> None:
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 20_000
    with tempfile.TemporaryDirectory() as folder:
        found = Counter(survive(Path(folder), seed) for seed in range(count))
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
    print(f"{count} mutated files: " + ", ".join(f"{n} {what}" for what, n in found.most_common()))
    print(f"peak memory {peak / 1e6:.0f} MB")
    assert peak < MOST_MEMORY


if __name__ == "__main__":
    main()
