"""Foreign environments: the same results to the byte, figures too, or one sentence that names the reason.

Backends, kernels, locales, time zones, limits of the shell, folders that cannot be written, other users,
namespaces of processes, mounts and networks, and closed streams.  What the machine does not allow is counted
as skipped.
"""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path

from helpers.process_table import adopt_orphans, wait_for_end
from processes import GRACE, contents, environment, furnish, make_reference

LONGEST = 300
"""Time limit of a command [s]."""
SAME, REFUSED = "same", "same or refused"
STALE = {"argv": ["/nowhere/python", "-m", "ipykernel_launcher", "-f", "{connection_file}"],
         "display_name": "python3", "language": "python"}  # fmt: skip
UNSHARE = "unshare --mount --propagation private sh -c"
PLACES: list[tuple[str, dict[str, str], str, str]] = [
    ("backend without figures", {"MPLBACKEND": "Agg"}, "", SAME),
    ("backend that does not exist", {"MPLBACKEND": "module://nowhere"}, "", SAME),
    ("stale kernel", {"JUPYTER_PATH": "{place}/stale"}, "", SAME),
    ("no home", {"HOME": "/proc/nowhere/home", "MPLCONFIGDIR": ""}, "", SAME),
    ("home that cannot be written", {"HOME": "/proc", "MPLCONFIGDIR": ""}, "", SAME),
    (
        "runtime folder that cannot be written",
        {"JUPYTER_RUNTIME_DIR": "/proc/nowhere"},
        "",
        SAME,
    ),
    (
        "settings of Jupyter",
        {"JUPYTER_CONFIG_DIR": "{place}/stale", "IPYTHONDIR": "/proc/nowhere"},
        "",
        SAME,
    ),
    (
        "locale C",
        {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONIOENCODING": "ascii"},
        "",
        SAME,
    ),
    ("time zone", {"TZ": "Asia/Kolkata"}, "", SAME),
    ("no documentation strings", {"PYTHONOPTIMIZE": "2"}, "", SAME),
    ("another hash seed", {"PYTHONHASHSEED": "7"}, "", SAME),
    (
        "terminal of one column",
        {"COLUMNS": "1", "LINES": "1", "TERM": "dumb"},
        "",
        SAME,
    ),
    (
        "temporary folder with a long name",
        {"TMPDIR": "{place}/tmp/" + "x" * 100 + "/" + "y" * 100},
        "",
        SAME,
    ),
    (
        "temporary folder that cannot be written",
        {"TMPDIR": "/proc/nowhere"},
        "",
        REFUSED,
    ),
    ("one core", {}, "taskset 1", SAME),
    ("64 open files", {}, "ulimit -n 64;", REFUSED),
    ("24 open files", {}, "ulimit -n 24;", REFUSED),
    ("files of 8 KB", {}, "ulimit -f 8;", REFUSED),
    ("little memory", {}, "ulimit -v 1500000;", REFUSED),
    ("no right to write", {}, "umask 777;", REFUSED),
    ("no standard input", {}, "exec 0<&-;", SAME),
    ("no standard output", {}, "exec 1>&-;", SAME),
    ("full standard output", {}, "exec 1>/dev/full;", REFUSED),
    ("no standard error", {}, "exec 2>&-;", SAME),
    ("folder that is gone", {}, "mkdir gone; cd gone; rmdir ../gone;", REFUSED),
    ("processes of their own", {}, "unshare --pid --fork --mount-proc", SAME),
    (
        "shared memory that is read-only",
        {},
        f"{UNSHARE} 'mount -t tmpfs -o ro none /dev/shm; \"$@\"' sh",
        REFUSED,
    ),
    (
        "full temporary folder",
        {},
        f"{UNSHARE} 'mount -t tmpfs -o size=8k none $TMPDIR; \"$@\"' sh",
        REFUSED,
    ),
    ("no network, not even within", {}, "unshare --net", REFUSED),
    (
        "another user",
        {"HOME": "/proc/nowhere"},
        "setpriv --reuid=65534 --regid=65534 --clear-groups",
        SAME,
    ),
]
"""Name, variables, what precedes the command in the shell, and what is expected."""
ALL_AT_ONCE = (
    "backend without figures",
    "stale kernel",
    "no home",
    "locale C",
    "time zone",
    "one core",
)


def attack(long: bool) -> dict[str, int]:
    """Run two notebooks in every environment, and count the results that differ and the foreign errors."""
    tally = Counter({"broken: environments": 0, "broken: processes left": 0})
    adopt_orphans()
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        command = furnish(place, days=1, encounters=60, seconds=0.0)["run"]
        command += [] if long else ["--only", "01"]
        (place / "stale" / "kernels" / "python3").mkdir(parents=True)
        (place / "stale" / "kernels" / "python3" / "kernel.json").write_text(
            json.dumps(STALE)
        )
        if long:
            reference = make_reference("run", command, place)
            for name, variables, before, expected in PLACES:
                enter(
                    name, variables, before, expected, command, place, reference, tally
                )
        else:
            chosen = [each for each in PLACES if each[0] in ALL_AT_ONCE]
            together = {
                key: value
                for _, variables, _, _ in chosen
                for key, value in variables.items()
            }
            enter(
                "all at once", together, "taskset 1", SAME, command, place, None, tally
            )
    return dict(tally)


def enter(
    name: str, variables: dict[str, str], before: str, expected: str, command: list[str], place: Path,
    reference: dict[str, bytes] | None, tally: Counter[str],
) -> None:  # fmt: skip
    """Run a command in one environment, and judge its end, and its results where a reference is known."""
    own = {key: value.format(place=place) for key, value in variables.items()}
    everybody = place / "everybody"
    everybody.mkdir(exist_ok=True)
    for folder in (place, everybody):
        folder.chmod(0o777)
    if "setpriv" in before:
        own["TMPDIR"] = str(everybody)
    elif own.get("TMPDIR", "").startswith(str(place)):
        Path(own["TMPDIR"]).mkdir(parents=True)
    out, settings = everybody / "out", environment(place) | own
    shell = ["sh", "-c", f'{before} "$@"', "sh"]
    if not is_allowed(before, shell, settings, place):
        tally["environments that the machine does not allow"] += 1
        return
    with (place / "said.txt").open("wb") as said:
        code = subprocess.run(
            [*shell, *command, "--out", str(out)], env=settings, cwd=place, stdout=said, stderr=said,
            timeout=LONGEST, check=False,
        ).returncode  # fmt: skip
    text = (place / "said.txt").read_text(errors="replace")
    tally[f"environments with {'the same results' if code == 0 else 'a refusal'}"] += 1
    wrong = judge(
        name, code, text, contents(out) if code == 0 else {}, expected, reference
    )
    if wrong:
        print(f"{name}: exit code {code}: {wrong}: {text[-1500:]}", file=sys.stderr)
        tally["broken: environments"] += 1
    if left := wait_for_end(place, GRACE):
        print(f"{name}: left {left}", file=sys.stderr)
        tally["broken: processes left"] += 1
    shutil.rmtree(everybody)


def is_allowed(
    before: str, shell: list[str], settings: dict[str, str], place: Path
) -> bool:
    """Whether this machine has the tool, and lets it start Python, which starts itself again."""
    tool = before.partition(" ")[0]
    if tool not in ("unshare", "setpriv", "taskset"):
        return True
    again = (
        "import subprocess, sys; sys.exit(subprocess.call([sys.executable, '-c', '']))"
    )
    trial = [*shell, sys.executable, "-c", again]
    return (
        subprocess.run(
            trial, env=settings, cwd=place, capture_output=True, check=False
        ).returncode
        == 0
    )


def judge(
    name: str,
    code: int,
    text: str,
    found: dict[str, bytes],
    expected: str,
    reference: dict[str, bytes] | None,
) -> str:
    """What is wrong with the end of a command; empty if nothing is."""
    if re.search("Traceback|Exception ignored|Fatal Python", text):
        return "a foreign traceback"
    if code == 0 and reference is None:
        shown = [content for file, content in found.items() if file.endswith(".ipynb")]
        return "" if shown and all(shown) else "no figures"
    if code == 0 and reference is not None:
        files = sorted(
            file
            for file in {*found, *reference}
            if found.get(file) != reference.get(file)
        )
        return f"other results: {files}" if files else ""
    if expected == SAME or code not in (1, 2):
        return (
            "it must not make a difference"
            if expected == SAME
            else "an exit code of its own"
        )
    if re.search(r"^szlib: \w+(Error|Exception): ", text, re.MULTILINE):
        return "an error that is not of szlib"
    return "" if re.search("^szlib: ", text, re.MULTILINE) else "no sentence"
