"""What a command leaves: descendants, open files, files in temporary folders (Linux)."""

from __future__ import annotations

import ctypes
import os
import re
import subprocess
import time
from contextlib import suppress
from pathlib import Path

ADOPT_ORPHANS = 36
"""PR_SET_CHILD_SUBREAPER of prctl(2)."""
LOOK = 0.2
"""Interval at which the descendants of a command are noted [s]."""
NOTED: set[int] = set()
"""The number of every process that `descendants` has found."""


def adopt_orphans() -> None:
    """Become the parent of every descendant whose own parent ends, so that `descendants` finds it."""
    if ctypes.CDLL(None, use_errno=True).prctl(ADOPT_ORPHANS, 1, 0, 0, 0):
        raise OSError(ctypes.get_errno(), "prctl")


def descendants() -> dict[int, str]:
    """Number and command line of every process that this one started, or that such a process started."""
    parents, commands = {}, {}
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            state, parent = (folder / "stat").read_text().rpartition(")")[2].split()[:2]
            commands[int(folder.name)] = (
                (folder / "cmdline").read_text().replace("\0", " ")[:200]
            )
        except OSError:
            continue
        if state not in "ZX":
            parents[int(folder.name)] = int(parent)
    found: dict[int, str] = {}
    while more := {
        n for n, parent in parents.items() if parent in {os.getpid(), *found}
    } - set(found):
        found |= {number: commands[number] for number in more}
    NOTED.update(found)
    return found


def wait_and_note(
    process: subprocess.Popen[bytes], seconds: float = float("inf")
) -> int | None:
    """Note the descendants until a process ends, and return its exit code; None after some time [s]."""
    end = time.monotonic() + seconds
    while (code := process.poll()) is None and (left := end - time.monotonic()) > 0:
        descendants()
        with suppress(subprocess.TimeoutExpired):
            process.wait(timeout=min(LOOK, left))
    return code


def named_after_noted(folder: Path) -> set[str]:
    """Files whose name holds the number of a noted process, as those of joblib in shared memory do.

    Files of other programs, which run on the same machine, have other numbers.
    """
    number = re.compile("(?<=[-_])[0-9]+(?=[-_])")
    return {
        str(path)
        for path in folder.glob("*")
        if {*map(int, number.findall(path.name))} & NOTED
    }


def users_of(place: Path) -> list[str]:
    """Processes, except for this one, that have a file below `place` open, or work there."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        if int(folder.name) == os.getpid():
            continue
        try:
            targets = [
                link.readlink() for link in (folder / "cwd", *(folder / "fd").iterdir())
            ]
            used = [target for target in targets if place in target.parents]
        except OSError:
            continue
        if used:
            found.append(f"{folder.name}: {used[0]}")
    return found


def wait_for_end(place: Path, grace: float) -> list[str]:
    """Descendants, and users of `place`, who are still there after the time of grace [s]."""
    end = time.monotonic() + grace
    while True:
        left = [
            f"{number}: {command}" for number, command in descendants().items()
        ] + users_of(place)
        if not left or time.monotonic() > end:
            return left
        time.sleep(0.1)


def everything_in(*folders: Path) -> set[str]:
    """Every file and folder below these."""
    return {str(path) for folder in folders for path in folder.rglob("*")}
