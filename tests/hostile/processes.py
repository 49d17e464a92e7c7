"""Commands killed at random moments, and two commands in one folder: the same files, and nothing left.

What is left is found by the process table, by open files, and by comparing folders before and after: in the
results, in the temporary folder, in the user's own folder and in shared memory (Linux). There, a file counts
if its name holds the number of a process of the command.
"""

from __future__ import annotations

import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

from helpers.process_table import (
    adopt_orphans,
    descendants,
    everything_in,
    named_after_noted,
    wait_and_note,
    wait_for_end,
)

import szlib
from szlib.plaza.generation import make_plaza
from szlib.plaza.settings import PlazaSettings

KILLS = {False: 1, True: 50}
GRACE = 20.0
"""Time within which the processes of a killed command must end [s]."""
SHARED_MEMORY = Path("/dev/shm")
PROGRAM = """
import sys
from pathlib import Path
from szlib.workbook import folders
from szlib.__main__ import main
if __name__ == "__main__":
    folders.NOTEBOOKS = Path({notebooks!r})
    if sys.stdout and sys.stdout.isatty():
        print("ready", flush=True)
    sys.exit(main())
"""
NOTEBOOK = """# %% tags=["parameters"]
data = "synthetic"
seed = 0
results = "../results"

# %%
import time
import matplotlib.pyplot as plt
from szlib.workbook.record import NotebookRecord
record = NotebookRecord("{name}", globals())
record.check("somebody met", record.cache.encounters()["encounter"].nunique() > 0)
plt.plot([seed, 2])
plt.show()
time.sleep({seconds})
record.animation(b"GIF89a", "movie")
record.close()
"""


def attack(long: bool, seed: int = 0) -> dict[str, int]:
    """Kill commands, and count what is wrong afterwards; the short form kills one run of notebooks only."""
    tally = Counter(
        {"broken: other bytes": 0, "broken: processes left": 0, "broken: files left": 0}
    )
    adopt_orphans()
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        commands = furnish(place)
        for name, command in commands.items() if long else [("run", commands["run"])]:
            reference = make_reference(name, command, place)
            kill(
                name, command, place, reference, random.Random(seed), KILLS[long], tally
            )
        if long:
            both(
                commands["extract"], place, contents(place / "extract-reference"), tally
            )
    return dict(tally)


def furnish(
    place: Path, days: int = 4, encounters: int = 150, seconds: float = 1.5
) -> dict[str, list[str]]:
    """Make days, the fourth one packed, and two notebooks, which also sleep; return two commands."""
    for name in ("data", "tmp", "home", "bin"):
        (place / name).mkdir()
    for day in range(days):
        settings = PlazaSettings(n_encounters=encounters, date=f"2012-11-{day + 1:02}")
        make_plaza(place / "data" / f"day{day}.csv", seed=day, settings=settings)
    if days > 3:
        subprocess.run(["gzip", str(place / "data" / "day3.csv")], check=True)
    (place / "notebooks").mkdir()
    for name in ("01_one", "06_two"):
        (place / "notebooks" / f"{name}.py").write_text(
            NOTEBOOK.format(name=name, seconds=seconds)
        )
    (place / "bin" / "program.py").write_text(
        PROGRAM.format(notebooks=str(place / "notebooks"))
    )
    program = [sys.executable, str(place / "bin" / "program.py")]
    return {
        "extract": [*program, "extract", str(place / "data"), "--jobs", "2"],
        "run": [
            *program,
            "run",
            "--data",
            str(place / "data" / "day0.csv"),
            "--jobs",
            "2",
        ],
    }


def make_reference(name: str, command: list[str], place: Path) -> dict[str, bytes]:
    """The finished files of a command that nobody disturbs."""
    out = place / f"{name}-reference"
    wait_and_note(start([*command, "--out", str(out)], place))
    reference = contents(out)
    if not reference:
        raise RuntimeError(
            f"{name}: the reference could not be made: {(place / 'printed.txt').read_text()}"
        )
    return reference


def kill(
    name: str, command: list[str], place: Path, reference: dict[str, bytes], rng: random.Random, kills: int,
    tally: Counter[str],
) -> None:  # fmt: skip
    """Kill the first process of a command, mostly by SIGKILL, and at last let the command finish."""
    out, longest, struck = place / f"{name}-killed", 6.0, 0
    before = everything_before(place)
    while struck < kills:
        begun = time.monotonic()
        process = start([*command, "--out", str(out)], place)
        if wait_and_note(process, rng.uniform(0.5, longest)) is not None:
            longest = max(1.5, time.monotonic() - begun)
            continue
        number = rng.choice([signal.SIGKILL, signal.SIGKILL, signal.SIGTERM])
        process.send_signal(number)
        code = process.wait()
        struck += 1
        tally[f"{name}: {signal.Signals(number).name}"] += 1
        if number == signal.SIGTERM and code not in (143, -15):
            tally[f"broken: SIGTERM ends {name} with {code}"] += 1
        judge_end(f"{name}, kill {struck}", out, place, reference, tally)
        if struck == kills or rng.random() < 0.2:
            finish(
                f"{name}, kill {struck}",
                [*command, "--out", str(out)],
                place,
                reference,
                before,
                tally,
            )


def judge_end(
    what: str, out: Path, place: Path, reference: dict[str, bytes], tally: Counter[str]
) -> None:
    """After a command was stopped, no process is left, and each finished file has the right bytes."""
    if left := wait_for_end(place, GRACE):
        print(f"{what}: left {left}", file=sys.stderr)
        tally["broken: processes left"] += 1
        for number in descendants():
            os.kill(number, signal.SIGKILL)
    for file, content in contents(out).items():
        if reference.get(file) != content:
            print(f"{what}: {file} has other bytes", file=sys.stderr)
            tally["broken: other bytes"] += 1


def finish(
    what: str, command: list[str], place: Path, reference: dict[str, bytes], before: set[str],
    tally: Counter[str],
) -> None:  # fmt: skip
    """Let the command finish: the results are those of an undisturbed one, and nothing else is left.

    szlib removes an unfinished file when it is an hour old, so those of killed processes are made older.
    """
    out = Path(command[-1])
    for unfinished in out.rglob(".szlib-part-*"):
        os.utime(unfinished, (0, 0))
    wait_and_note(start(command, place))
    same_bytes = contents(out) == reference
    tally["broken: other bytes"] += not same_bytes
    tally["resumed to identical bytes"] += same_bytes
    names = {str(path.relative_to(out)) for path in out.rglob("*")}
    undisturbed = place / f"{out.name.partition('-')[0]}-reference"
    more = names - {
        str(path.relative_to(undisturbed)) for path in undisturbed.rglob("*")
    }
    if left := more | (everything_outside(place) - before):
        print(f"{what}: left {sorted(left)}", file=sys.stderr)
        tally["broken: files left"] += 1
    shutil.rmtree(out)


def both(
    command: list[str], place: Path, reference: dict[str, bytes], tally: Counter[str]
) -> None:
    """Start two processes at once in one folder."""
    out = place / "both"
    pair = [start([*command, "--out", str(out)], place) for _ in range(2)]
    codes = [wait_and_note(process) for process in pair]
    if codes != [0, 0] or contents(out) != reference:
        print(f"two at once: exit codes {codes}", file=sys.stderr)
        tally["broken: other bytes"] += 1
    tally["two processes in one folder"] += 1


def environment(place: Path) -> dict[str, str]:
    """The environment of a command whose temporary files and own folder are in `place`."""
    own = {
        "TMPDIR": str(place / "tmp"),
        "HOME": str(place / "home"),
        "MPLCONFIGDIR": str(place / "home"),
    }
    usual = {
        name: value
        for name, value in os.environ.items()
        if name not in ("MPLBACKEND", "JUPYTER_PATH")
    }
    return usual | own | {"PYTHONPATH": str(Path(szlib.__file__).parents[1])}


def everything_outside(place: Path) -> set[str]:
    """Every file where temporary ones may be, in shared memory those of the processes that were noted."""
    return everything_in(place / "tmp", place / "home") | named_after_noted(
        SHARED_MEMORY
    )


def everything_before(place: Path) -> set[str]:
    """Every file that an attacked command cannot have left; numbers of processes recur in shared memory."""
    return everything_outside(place) | {str(file) for file in SHARED_MEMORY.glob("*")}


def start(command: list[str], place: Path) -> subprocess.Popen[bytes]:
    """Start a command, which prints to printed.txt."""
    with (place / "printed.txt").open("ab") as printed:
        return subprocess.Popen(
            command, env=environment(place), stdout=printed, stderr=printed, cwd=place
        )


def contents(out: Path) -> dict[str, bytes]:
    """Finished files without times; of notebooks the figures.

    Hidden files are locks and unfinished files. A record that is not closed is unfinished, too: it holds the
    checks that a notebook made before its kernel ended.
    """
    found = {
        str(file.relative_to(out)): figures(file) if file.suffix == ".ipynb" else file.read_bytes()
        for file in sorted(out.rglob("*"))
        if file.is_file() and not file.name.startswith(".")
        and file.name not in ("summary.json", "report.html", "report.html.json")
    }  # fmt: skip
    return {
        name: content
        for name, content in found.items()
        if b'"closed": false' not in content
    }


def figures(notebook: Path) -> bytes:
    """The pictures that an executed notebook shows, one a line."""
    shown = [output.get("data", {}).get("image/png", "")
             for cell in json.loads(notebook.read_text(encoding="utf-8"))["cells"]
             for output in cell.get("outputs", [])]  # fmt: skip
    return "\n".join(filter(None, shown)).encode()
