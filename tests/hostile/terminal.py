"""Signals to the process group of a command in a real terminal: it ends at once, in its own words.

A command has a pseudo-terminal of its own.  There Ctrl-C is typed once or twice, it is suspended and goes on,
the terminal is closed, or its group gets a signal.  Afterwards no process is left, no foreign traceback was
shown, and the command, called again, makes the same files.
"""

from __future__ import annotations

import fcntl
import os
import pty
import random
import signal
import subprocess
import sys
import tempfile
import termios
import time
from collections import Counter
from pathlib import Path
from select import select

from helpers.process_table import adopt_orphans, descendants, wait_for_end
from processes import (
    GRACE,
    environment,
    everything_before,
    everything_outside,
    finish,
    furnish,
    judge_end,
    make_reference,
)

TRIALS = 50
LONGEST = 60.0
"""Time limit of a command that was stopped [s]."""
ACTIONS = {
    "Ctrl-C": (130, -signal.SIGINT),
    "Ctrl-C twice": (130, -signal.SIGINT),
    "Ctrl-Z, then Ctrl-C": (130, -signal.SIGINT),
    "terminal closed": (129, -signal.SIGHUP),
    "SIGTERM to the group": (143, -signal.SIGTERM),
    "SIGKILL to the group": (-signal.SIGKILL,),
}
"""What is done, and the exit codes with which the command may end then; 0 if it was finished before.

-SIGINT, which a shell shows as 130 too, is the end in the last moments of the interpreter.
"""
IMPORTS = 30
"""Number of times that Ctrl-C is typed while a command imports what it needs."""
IMPORTING = """
from szlib.__main__ import main
print("ready", flush=True)
raise SystemExit(main())
"""


def attack(long: bool, seed: int = 0) -> dict[str, int]:
    """Stop commands in a terminal, and count what is wrong afterwards; the short form does so once."""
    tally = Counter(
        {"broken: other bytes": 0, "broken: processes left": 0, "broken: files left": 0}
    )
    adopt_orphans()
    with tempfile.TemporaryDirectory() as folder:
        place, rng = Path(folder), random.Random(seed)
        commands = furnish(place) if long else furnish(place, days=1)
        if not long:
            out, before = place / "extract-0", everything_before(place)
            attempt(
                "Ctrl-C twice",
                [*commands["extract"], "--out", str(out)],
                place,
                rng,
                0.3,
                tally,
            )
            left = wait_for_end(place, GRACE) or sorted(
                everything_outside(place) - before
            )
            tally["broken: processes left"] += len(left)
            return dict(tally)
        for _ in range(IMPORTS):
            command = [
                sys.executable,
                "-c",
                IMPORTING,
                "inspect",
                str(place / "data" / "day0.csv"),
            ]
            attempt("Ctrl-C while it imports", command, place, rng, 1.5, tally)
        for name, command in commands.items():
            reference = make_reference(name, command, place)
            before = everything_before(place)
            for trial in range(TRIALS):
                action, full = (
                    rng.choice(list(ACTIONS)),
                    [*command, "--out", str(place / f"{name}-{trial}")],
                )
                attempt(action, full, place, rng, 5.0, tally)
                what = f"{name}, trial {trial}, {action}"
                judge_end(what, Path(full[-1]), place, reference, tally)
                finish(what, full, place, reference, before, tally)
    return dict(tally)


def attempt(
    action: str,
    command: list[str],
    place: Path,
    rng: random.Random,
    longest: float,
    tally: Counter[str],
) -> None:
    """Stop a command within `longest` seconds, and count it if its end is wrong."""
    if wrong := stop(command, place, action, rng, longest, tally):
        print(f"{' '.join(command[2:])}, {action}: {wrong}", file=sys.stderr)
        tally[f"broken: {action}"] += 1


def stop(
    command: list[str],
    place: Path,
    action: str,
    rng: random.Random,
    longest: float,
    tally: Counter[str],
) -> str:
    """Start a command, do something to it, and return what was wrong with its end; empty if nothing was."""
    master, slave = pty.openpty()
    process = subprocess.Popen(
        command, env=environment(place), cwd=place, stdin=slave, stdout=slave, stderr=slave,
        start_new_session=True, preexec_fn=take_terminal,
    )  # fmt: skip
    os.close(slave)
    printed = read(master, 120.0, until=b"ready")
    printed += read(master, rng.uniform(0.0, longest))
    descendants()
    if "twice" in action:
        os.write(master, b"\x03")
        printed += read(master, rng.choice([0.0, 0.1, rng.uniform(0, 1)]))
    if "Ctrl-Z" in action:
        os.write(master, b"\x1a")
        printed += read(master, 0.3)
        os.killpg(process.pid, signal.SIGCONT)
    if "Ctrl-C" in action:
        os.write(master, b"\x03")
    elif "closed" not in action:
        os.killpg(process.pid, getattr(signal, action.split()[0]))
    if "closed" in action:
        os.close(master)
    else:
        printed += read(master, LONGEST)
    begun = time.monotonic()
    try:
        code = process.wait(timeout=LONGEST)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        return "it does not end"
    if "closed" not in action:
        os.close(master)
    tally[f"{action}: exit code {code}"] += 1
    text = printed.decode(errors="replace")
    if "Traceback" in text or "Exception ignored" in text:
        return f"a foreign traceback: {text[-2000:]}"
    if code not in (0, *ACTIONS.get(action, (130, -signal.SIGINT))):
        return f"exit code {code} after {time.monotonic() - begun:.0f} s: {text[-500:]}"
    return (
        ""
        if code != 130 or "szlib: stopped" in text
        else f"it says nothing: {text[-500:]}"
    )


def take_terminal() -> None:
    """Make standard input the terminal of a new session, which SIGHUP ends also if this suite ignores it."""
    fcntl.ioctl(0, termios.TIOCSCTTY, 0)
    signal.signal(signal.SIGHUP, signal.SIG_DFL)


def read(master: int, seconds: float, until: bytes | None = None) -> bytes:
    """What a terminal shows for some time, until a word, or until nobody writes to it."""
    found, end = b"", time.monotonic() + seconds
    while (left := end - time.monotonic()) > 0 and not (until and until in found):
        if select([master], [], [], left)[0]:
            try:
                content = os.read(master, 65536)
            except OSError:  # the last process that had it open has ended
                break
            found += content
            if not content:
                break
    return found
