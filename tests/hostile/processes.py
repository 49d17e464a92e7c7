"""Commands killed at random moments, and two commands in one folder: the same files, and no process left.

Every process of a command has a word in its environment, by which it is found (Linux).
"""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

import szlib
from szlib.plaza.generation import make_plaza
from szlib.plaza.settings import PlazaSettings

KILLS = {False: 1, True: 50}
GRACE = 20.0
"""Time within which the processes of a killed command must end [s]."""
LOCK, UNFINISHED = ".szlib-lock", ".szlib-part-"
"""Beginnings of names in a folder of results: locks stay there, unfinished files must not."""
PROGRAM = """
import sys
from pathlib import Path
from szlib.workbook import folders
from szlib.workbook.cli import main
if __name__ == "__main__":
    folders.NOTEBOOKS = Path({notebooks!r})
    sys.exit(main())
"""
NOTEBOOK = """# %% tags=["parameters"]
data = "synthetic"
seed = 0
results = "../results"

# %%
import time
from szlib.workbook.record import NotebookRecord
record = NotebookRecord("{name}", globals())
record.check("somebody met", record.cache.encounters()["encounter"].nunique() > 0)
time.sleep(1.5)
record.animation(b"GIF89a", "movie")
record.close()
"""


def attack(long: bool, seed: int = 0) -> dict[str, int]:
    """Kill commands, and count what is wrong afterwards; the short form kills one run of notebooks only."""
    tally = Counter({"broken: other bytes": 0, "broken: processes left": 0, "broken: files left": 0})
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        commands = furnish(place)
        for name, command in commands.items() if long else [("run", commands["run"])]:
            reference_folder = place / f"{name}-reference"
            _run([*command, "--out", str(reference_folder)], place).wait()
            reference = _contents(reference_folder)
            if not reference:
                raise RuntimeError(f"{name}: the reference could not be made")
            kill(name, command, place, reference, random.Random(seed), KILLS[long], tally)
        if long:
            both(commands["extract"], place, _contents(place / "extract-reference"), tally)
    return dict(tally)


def furnish(place: Path) -> dict[str, list[str]]:
    """Make four days, one of them packed, and two notebooks; return two commands without their `--out`."""
    (place / "data").mkdir()
    (place / "tmp").mkdir()
    for day in range(4):
        settings = PlazaSettings(n_encounters=150, date=f"2012-11-{day + 1:02}")
        make_plaza(place / "data" / f"day{day}.csv", seed=day, settings=settings)
    subprocess.run(["gzip", str(place / "data" / "day3.csv")], check=True)
    (place / "notebooks").mkdir()
    for name in ("01_one", "06_two"):
        (place / "notebooks" / f"{name}.py").write_text(NOTEBOOK.format(name=name))
    (place / "program.py").write_text(PROGRAM.format(notebooks=str(place / "notebooks")))
    program = [sys.executable, str(place / "program.py")]
    return {
        "extract": [*program, "extract", str(place / "data"), "--jobs", "2"],
        "run": [*program, "run", "--data", str(place / "data" / "day0.csv"), "--jobs", "2"],
    }


def kill(
    name: str, command: list[str], place: Path, reference: dict[str, bytes], rng: random.Random, kills: int,
    tally: Counter[str],
) -> None:  # fmt: skip
    """Kill the first process of a command, mostly by SIGKILL, and at last let the command finish."""
    out, longest, struck = place / f"{name}-killed", 6.0, 0
    while struck < kills:
        begun = time.monotonic()
        word = f"attack-{os.getpid()}-{name}-{struck}"
        process = _run([*command, "--out", str(out)], place, word)
        try:
            process.wait(timeout=rng.uniform(0.5, longest))
            longest = max(1.5, time.monotonic() - begun)
            continue
        except subprocess.TimeoutExpired:
            number = rng.choice([signal.SIGKILL, signal.SIGKILL, signal.SIGTERM])
            process.send_signal(number)
            code = process.wait()
        struck += 1
        tally[f"{name}: {signal.Signals(number).name}"] += 1
        if number == signal.SIGTERM and code not in (143, -15):
            tally[f"broken: SIGTERM ends {name} with {code}"] += 1
        left = _wait_for_end(word)
        if left:
            print(f"{name}, kill {struck}: left {left}", file=sys.stderr)
            tally["broken: processes left"] += 1
        for file, content in _contents(out).items():
            if reference.get(file) != content:
                print(f"{name}, kill {struck}: {file} has other bytes", file=sys.stderr)
                tally["broken: other bytes"] += 1
        if struck == kills or rng.random() < 0.2:
            _run([*command, "--out", str(out)], place).wait()
            if _contents(out) != reference:
                tally["broken: other bytes"] += 1
            if rubbish := [*(place / "tmp").glob("szlib-*"), *out.rglob(f"{UNFINISHED}*")]:
                print(f"{name}, kill {struck}: left {rubbish}", file=sys.stderr)
                tally["broken: files left"] += 1
            tally[f"{name}: resumed to identical bytes"] += _contents(out) == reference
            _remove(out)


def both(command: list[str], place: Path, reference: dict[str, bytes], tally: Counter[str]) -> None:
    """Start two processes at once in one folder."""
    out = place / "both"
    pair = [_run([*command, "--out", str(out)], place) for _ in range(2)]
    codes = [process.wait() for process in pair]
    if codes != [0, 0] or _contents(out) != reference:
        print(f"two at once: exit codes {codes}", file=sys.stderr)
        tally["broken: other bytes"] += 1
    tally["two processes in one folder"] += 1


def _run(command: list[str], place: Path, word: str = "") -> subprocess.Popen[bytes]:
    own = {"PYTHONPATH": str(Path(szlib.__file__).parents[1]), "TMPDIR": str(place / "tmp"), "ATTACK": word}
    with (place / "printed.txt").open("ab") as printed:
        return subprocess.Popen(command, env=os.environ | own, stdout=printed, stderr=printed, cwd=place)


def _contents(out: Path) -> dict[str, bytes]:
    """Finished files, without those that contain times."""
    return {
        str(file.relative_to(out)): file.read_bytes()
        for file in sorted(out.rglob("*"))
        if file.is_file() and not file.name.startswith((LOCK, UNFINISHED)) and file.suffix != ".ipynb"
        and file.name not in ("summary.json", "report.html")
    }  # fmt: skip


def _wait_for_end(word: str) -> list[str]:
    """The processes that still have this word after the time of grace."""
    end = time.monotonic() + GRACE
    while (left := _processes_with(word)) and time.monotonic() < end:
        time.sleep(0.2)
    return left


def _processes_with(word: str) -> list[str]:
    found = []
    for process in Path("/proc").glob("[0-9]*"):
        try:
            alive = "\nState:\tZ" not in (process / "status").read_text()
            if alive and f"ATTACK={word}\0".encode() in (process / "environ").read_bytes() + b"\0":
                found.append(process.name + ": " + (process / "cmdline").read_text().replace("\0", " ")[:120])
        except OSError:
            continue
    return found


def _remove(folder: Path) -> None:
    import shutil

    shutil.rmtree(folder)
