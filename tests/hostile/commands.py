"""Random command lines: each ends in time with exit code 0, 1 or 2, gives a reason, and harms no file.

Each runs in a fork of a process that has imported everything, so that a thousand take minutes.  This
process uses none of its imports: threads do not survive a fork.
"""

from __future__ import annotations

import gzip
import hashlib
import os
import random
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
from szlib.workbook.cli import main

COUNT = {False: 15, True: 1000}
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
PLACES = ["out", "out/deep/er", "folder", ".", "day.csv", "day.csv/x", "/proc/x", "/dev/null", "foreign",
          "x" * 300, "", "latin\udce4", "days", "out\nline"]  # fmt: skip
VALUES = ["1", "abc", "null", "-1", "1e400", "NaN", "[1]", "[]", "{}", '"x"', "true", "0.1", "2",
          "9" * 5000, "[" * 5000, "__import__('os').system('touch pwned')", "", "[0.5, NaN]",
          "1e308", "\udce4"]  # fmt: skip
NUMBERS = ["1", "2", "0", "-1", "100000", "9" * 30, "two", "²", "1.5", ""]
SIZES = ["4GB", "300MB", "1", "0", "-1", "much", "1e9", "9" * 40, "1 KB", ""]


def attack(long: bool, seed: int = 0) -> dict[str, int]:
    """Run random command lines, and count how they end and how many are broken."""
    tally = Counter({"broken command lines": 0})
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        if _in_a_fork(lambda: furnish(place)):
            raise RuntimeError("the folder with everything could not be made")
        before = fingerprint(place)
        for number in range(COUNT[long]):
            line = draw(random.Random(f"{seed}-{number}"))
            code, printed = execute(line, place)
            wrong = judge(code, printed)
            if fingerprint(place) != before:
                wrong = "it changed files that are not its own"
                before = fingerprint(place)
            if wrong:
                print(f"{seed}-{number}: szlib {line}: {code}: {wrong}: {printed[-1500:]}", file=sys.stderr)
                tally["broken command lines"] += 1
            tally["command lines"] += 1
            tally[f"command lines that end with {code}"] += 1
    return dict(tally)


def judge(code: int, printed: str) -> str:
    """What is wrong with the end of a command; empty if nothing is."""
    if code not in (0, 1, 2):
        return "an exit code of its own" if code >= 0 else "it hangs, or a signal ended it"
    if "Traceback" in printed or "Exception ignored" in printed:
        return "a foreign traceback"
    complaints = [text for text in printed.splitlines() if text.startswith(("szlib: ", "szlib "))]
    return "" if code != 2 or complaints else "it gives no reason"


def draw(rng: random.Random) -> list[str]:
    """One command line."""
    command = rng.choices(["run", "inspect", "extract", "", "rnu", "--version"], [5, 6, 8, 0.3, 0.3, 0.3])[0]
    line = [command] if command else []
    if command == "inspect":
        line.append(rng.choice(NAMES))
    elif command == "extract":
        line += rng.choices(NAMES, k=rng.choice([1, 1, 2, 3]))
        line += ["--out", rng.choice(PLACES)]
        if rng.random() < 0.2:
            line += ["--exclude", rng.choice(["2000-01-02", "x", ""])]
    elif command == "run":
        line += [
            "--data",
            rng.choice(NAMES),
            "--out",
            rng.choice(PLACES[2:] if rng.random() < 0.97 else PLACES),
        ]
        if rng.random() < 0.7:
            name = rng.choice(["seed", "gamma", "speeds", "data", "results", "sed", "", "\udce4"])
            line += ["-p", f"{name}={rng.choice(VALUES)}"]
        if rng.random() < 0.2:
            line += ["--only", rng.choice(["01", "99", "", "../.."])]
    if command in ("run", "extract") and rng.random() < 0.3:
        line += ["--jobs", rng.choice(NUMBERS)]
    if rng.random() < 0.2:
        line += ["--memory", rng.choice(SIZES)]
    if rng.random() < 0.03:
        line.insert(rng.randrange(len(line) + 1), rng.choice(["--nonsense", "--help", "--", "-p"]))
    return line


def furnish(place: Path) -> None:
    """Make a folder with every file that the command lines name."""
    day = make_plaza(place / "day.csv", settings=PlazaSettings(n_encounters=20))
    (place / "two.csv").write_bytes(day.read_bytes()[:100_000].rsplit(b"\n", 1)[0] + b"\n")
    (place / "packed.csv.gz").write_bytes(gzip.compress(day.read_bytes()))
    (place / "damaged.csv.gz").write_bytes(gzip.compress(day.read_bytes())[:5000])
    tracks = read_tracks(day)
    tracks.to_parquet(place / "tidy.parquet")
    doubled = pd.concat([tracks, tracks[["x"]]], axis=1)
    columns = [pa.array(doubled.iloc[:, k].astype(float)) for k in range(1, doubled.shape[1])]
    pq.write_table(pa.Table.from_arrays(columns, names=list(doubled.columns[1:])), place / "doubled.parquet")
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
    (place / "notebooks" / "01_one.py").write_text(NOTEBOOK)


def fingerprint(place: Path) -> dict[str, str]:
    """Everything that a command must leave as it is, and unfinished files, which it must not leave."""
    ours = {"out", "days", "latin\udce4", "out\nline"}
    found = {}
    for path in sorted(place.rglob("*")):
        top = path.relative_to(place).parts[0]
        if top in ours and not path.name.startswith(".szlib-part-"):
            continue
        content = path.read_bytes() if path.is_file() else b""
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
        folders.NOTEBOOKS = place / "notebooks"
        sys.exit(main(line))

    code = _in_a_fork(command)
    printed = place / ".printed"
    text = printed.read_bytes().decode("utf-8", errors="replace")
    printed.unlink()
    return code, text


def _in_a_fork(work: Callable[[], None]) -> int:
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
