"""Random command lines: each ends in time with exit code 0, 1 or 2, gives a reason, and harms no file.

Each runs in a fork of a process that has imported everything, so that a thousand take minutes.  This
process uses none of its imports: threads do not survive a fork.
"""

from __future__ import annotations

import argparse
import gzip
import hashlib
import importlib
import json
import os
import random
import re
import signal
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

import szlib.encounters.days
import szlib.zones.social_zone  # noqa: F401 - before the first fork
from szlib.plaza.generation import make_plaza
from szlib.plaza.settings import PlazaSettings
from szlib.tracks.clock import read_tracks
from szlib.workbook import folders
from szlib.workbook.cli import build_parser, main

COUNT = {False: 3, True: 1000}
LONGEST = 60
"""Time limit of a command [s]."""
NOTEBOOK = """# %% tags=["parameters"]
data = "synthetic"
seed = 0
results = "../results"
gamma = 0.05
speeds = [0.7, 0.9]

# %%
from szlib.workbook.record import NotebookRecord
record = NotebookRecord("01_one", globals())
record.check("files", len(record.cache.files()) > 0)
record.close()
"""
NAMES = ["day.csv", "two.csv", "packed.csv.gz", "tidy.parquet", "link.csv", "empty.csv", "binary.csv",
         "damaged.csv.gz", "doubled.parquet", "latin\udce4.csv", "ünï.csv", "fifo", "folder", "folder/.", ".",
         "*.csv", "*", "a**b", "[", "nowhere.csv", "x" * 300, "", " ", "/dev/zero", "/dev/null",
         "/proc/self/mem", "loop", "day.csv/inside", "~", "-", "\n", "synthetic", "days"]  # fmt: skip
PLACES = ["out", "days", "latin\udce4", "out/deep/er", "folder", ".", "day.csv", "day.csv/x", "/proc/x",
          "/dev/null", "foreign", "x" * 300, "", "out\nline"]  # fmt: skip
VALUES = ["1", "abc", "null", "-1", "1e400", "NaN", "[1]", "[]", "{}", '"x"', "true", "0.1", "2",
          "9" * 5000, "[" * 5000, "__import__('os').system('touch pwned')", "", "[0.5, NaN]",
          "1e308", "\udce4"]  # fmt: skip
NUMBERS = ["1", "2", "1", "0", "-1", "100000", "9" * 30, "two", "²", "1.5", ""]
FLOATS = [
    "0",
    "9",
    "-1.85e1",
    "-3",
    "12",
    "1e3",
    "-.5",
    "+4",
    "1e400",
    "nan",
    "-inf",
    "x",
    "",
    "1_0",
]
SHAPES = ["area.json", "area.wkt", "area.json", "fifo", "/dev/zero", "/dev/stdin", "folder", "day.csv",
          "huge.json", "loop", "nan.json", "deep.json", "crossed.wkt", "empty.csv", "binary.csv", "nowhere",
          "", "x" * 300, "latin\udce4.csv"]  # fmt: skip
FOLDERS = ["out/day", "results/day", "results/two", "out", "results/synthetic", "foreign", "folder",
           "day.csv", "nowhere", "", "fifo", "x" * 300, "damaged", "notebooks"]  # fmt: skip
ADDRESSES = ["nowhere", "", "tcp://256.0.0.1:1", "x" * 300, "tcp://", "\n", "ftp://a:b"]
PARAMETERS = [
    "seed",
    "gamma",
    "gamma",
    "speeds",
    "data",
    "results",
    "area",
    "sed",
    "",
    "\udce4",
    "record",
]
POOLS = {
    "out": PLACES, "area": FLOATS, "FILE": SHAPES, "folder": FOLDERS, "scheduler": ADDRESSES, "jobs": NUMBERS,
    "only": ["01", "01_one", "01", "99", "", "../.."], "exclude": ["2000-01-02", "x", ""],
}  # fmt: skip
GOOD = 3
"""So many at the beginning of each list of words are such as a user may mean."""
OFTEN = {
    "out": 0.9,
    "data": 0.8,
    "parameter": 0.5,
    "memory": 0.1,
    "scheduler": 0.03,
    "open": 0.5,
}
"""Shares of the command lines that have an option; of others 0.15."""
SIZES = ["4GB", "700MB", "2e9", "1", "0", "-1", "much", "1e9", "9" * 40, "1 KB", ""]
POOLS["memory"] = SIZES


def attack(long: bool, seed: int = 0) -> dict[str, int]:
    """Run random command lines, and count how they end and how many are broken."""
    tally = Counter({"broken command lines": 0})
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        if in_a_fork(lambda: furnish(place)):
            raise RuntimeError("the folder with everything could not be made")
        if long:
            import_slow_modules()
        before = fingerprint(place)
        for number in range(COUNT[long]):
            line = draw(random.Random(f"{seed}-{number}"))
            code, printed = execute(line, place)
            wrong = judge(code, printed)
            if fingerprint(place) != before:
                wrong = "it changed files that are not its own"
                before = fingerprint(place)
            if wrong:
                print(
                    f"{seed}-{number}: szlib {line}: {code}: {wrong}: {printed[-1500:]}",
                    file=sys.stderr,
                )
                tally["broken command lines"] += 1
            tally["command lines"] += 1
            tally[f"command lines that end with {code}"] += 1
    return dict(tally)


def import_slow_modules() -> None:
    """Import what `run` imports when it begins, once and not in every fork: seconds each."""
    for name in ("report", "runner"):
        importlib.import_module(f"szlib.workbook.{name}")


def judge(code: int, printed: str) -> str:
    """What is wrong with the end of a command; empty if nothing is."""
    if code not in (0, 1, 2):
        return (
            "an exit code of its own" if code >= 0 else "it hangs, or a signal ended it"
        )
    if "Traceback" in printed or "Exception ignored" in printed:
        return "a foreign traceback"
    if re.search(r"^szlib: \w+(Error|Exception|Warning|Exit): ", printed, re.MULTILINE):
        return "an error that is not of szlib"
    complaints = [
        text for text in printed.splitlines() if text.startswith(("szlib: ", "szlib "))
    ]
    return "" if code != 2 or complaints else "it gives no reason"


def draw(rng: random.Random) -> list[str]:
    """One command line, of any command and option that the parser knows."""
    (verbs,) = [
        action for action in build_parser()._actions if isinstance(action.choices, dict)
    ]
    command = rng.choices(
        [*verbs.choices, "", "rnu", "--version"],
        [*[6] * len(verbs.choices), 0.3, 0.3, 0.3],
    )[0]
    if command not in verbs.choices:
        return [command] if command else []
    line, options = [], []
    for action in verbs.choices[command]._actions:
        if (
            action.option_strings
            and action.dest != "help"
            and rng.random() < OFTEN.get(action.dest, 0.15)
        ):
            name = rng.choice(action.option_strings)
            if name.startswith("--") and rng.random() < 0.05:
                name = name[: rng.randrange(4, len(name) + 1)]
            values = draw_values(action, rng)
            together = len(values) == 1 and name.startswith("--") and rng.random() < 0.2
            options += [[f"{name}={values[0]}"]] if together else [[name, *values]]
        elif not action.option_strings and (action.required or rng.random() < 0.8):
            line += draw_values(action, rng)
    rng.shuffle(options)
    line = [command, *line, *[word for option in options for word in option]]
    if rng.random() < 0.03:
        line.insert(
            rng.randrange(len(line) + 1),
            rng.choice(["--nonsense", "--help", "--", "-p", "-1"]),
        )
    return line


def draw_values(action: argparse.Action, rng: random.Random) -> list[str]:
    """Words that follow an option or stand for an argument; now and then too many or too few."""
    pool = POOLS.get(action.metavar if action.metavar == "FILE" else action.dest, NAMES)
    count = {
        None: 1,
        "+": rng.choice([1, 1, 2, 3]),
        "*": rng.choice([0, 1, 2]),
        "?": 1,
    }.get(action.nargs, action.nargs)
    if action.nargs and rng.random() < 0.05:
        count = max(0, count + rng.choice([-1, 1]))
    if action.dest == "parameter":
        return [f"{rng.choice(PARAMETERS)}={rng.choice(VALUES)}"]
    return [
        rng.choice(pool[: GOOD if rng.random() < 0.85 else None]) for _ in range(count)
    ]


def furnish(place: Path) -> None:
    """Make a folder with every file that the command lines name."""
    day = make_plaza(place / "day.csv", settings=PlazaSettings(n_encounters=20))
    (place / "two.csv").write_bytes(
        day.read_bytes()[:100_000].rsplit(b"\n", 1)[0] + b"\n"
    )
    (place / "packed.csv.gz").write_bytes(gzip.compress(day.read_bytes()))
    (place / "damaged.csv.gz").write_bytes(gzip.compress(day.read_bytes())[:5000])
    tracks = read_tracks(day)
    tracks.to_parquet(place / "tidy.parquet")
    doubled = pd.concat([tracks, tracks[["x"]]], axis=1)
    columns = [
        pa.array(doubled.iloc[:, k].astype(float)) for k in range(1, doubled.shape[1])
    ]
    pq.write_table(
        pa.Table.from_arrays(columns, names=list(doubled.columns[1:])),
        place / "doubled.parquet",
    )
    (place / "link.csv").symlink_to("day.csv")
    (place / "loop").symlink_to("loop")
    (place / "empty.csv").write_bytes(b"")
    (place / "binary.csv").write_bytes(bytes(range(256)) * 40)
    for name in ("latin\udce4.csv", "ünï.csv"):
        (place / name).write_bytes((place / "two.csv").read_bytes())
    os.mkfifo(place / "fifo")
    for name in ("folder", "foreign", "notebooks"):
        (place / name).mkdir()
    (place / "folder" / "inner.csv").write_bytes((place / "two.csv").read_bytes())
    (place / "foreign" / "thesis.txt").write_text("not yours")
    (place / "damaged").mkdir()
    (place / "damaged" / "01_one.ipynb").write_text('{"cells": 5}')
    square = [[0, 0], [9, 0], [9, 9], [0, 9], [0, 0]]
    (place / "area.json").write_text(
        json.dumps({"type": "Polygon", "coordinates": [square]})
    )
    (place / "area.wkt").write_text(
        "POLYGON ((-20 -20, 20 -20, 20 20, -20 20, -20 -20))"
    )
    (place / "crossed.wkt").write_text("POLYGON ((0 0, 9 9, 9 0, 0 9, 0 0))")
    (place / "nan.json").write_text(
        '{"type": "Polygon", "coordinates": [[[0, 0], [NaN, 1], [1e999, 2]]]}'
    )
    (place / "deep.json").write_text("[" * 100_000)
    (place / "huge.json").write_bytes(b" " * (11 << 20))
    (place / "notebooks" / "01_one.py").write_text(NOTEBOOK)


def fingerprint(place: Path) -> dict[str, str]:
    """Everything that a command must leave as it is, and unfinished files, which it must not leave."""
    ours = {
        "out",
        "days",
        "results",
        "latin\udce4",
        "out\nline",
        "nowhere",
        "zone.json",
        "zone.png",
    }
    found = {}
    for path in sorted(place.rglob("*")):
        top, *inside = path.relative_to(place).parts
        if (top in ours or "notebooks" in inside) and not path.name.startswith(
            ".szlib-part-"
        ):
            continue
        stat = path.lstat()
        known = (
            f"{stat.st_size} {stat.st_mtime_ns} {stat.st_ino}".encode()
            if stat.st_size > 1 << 20
            else None
        )
        content = known or (path.read_bytes() if path.is_file() else b"")
        found[str(path.relative_to(place))] = hashlib.sha256(content).hexdigest()
    return found


def execute(line: list[str], place: Path) -> tuple[int, str]:
    """Exit code (or minus the signal), and the printed text."""

    def command() -> None:
        os.setpgid(0, 0)
        os.chdir(place)
        handle = os.open(".printed", os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.dup2(handle, 1)
        os.dup2(handle, 2)
        os.dup2(os.open("/dev/null", os.O_RDONLY), 0)
        os.environ |= {
            "BROWSER": "true",
            "DASK_DISTRIBUTED__COMM__TIMEOUTS__CONNECT": "1s",
        }
        folders.NOTEBOOKS = place / "notebooks"
        sys.exit(main(line))

    code = in_a_fork(command)
    printed = place / ".printed"
    text = printed.read_bytes().decode("utf-8", errors="replace")
    printed.unlink()
    return code, text


def in_a_fork(work: Callable[[], None]) -> int:
    child = os.fork()
    if child == 0:
        code = 0
        try:
            work()
        except SystemExit as stop:  # of argparse, too
            code = int(stop.code or 0)
        except BaseException:
            traceback.print_exc()
            code = 99
        finally:
            sys.stderr.flush()
            os._exit(code)
    return os.waitstatus_to_exitcode(_wait(child))


def _wait(child: int) -> int:
    end = time.monotonic() + LONGEST
    while time.monotonic() < end:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            return status
        time.sleep(0.01)
    with suppress(ProcessLookupError):  # it may not have a group of its own yet
        os.killpg(child, signal.SIGKILL)
    os.kill(child, signal.SIGKILL)
    return os.waitpid(child, 0)[1]
