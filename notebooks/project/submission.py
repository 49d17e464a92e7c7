"""A submission in a process of its own: the end of the judge, and the end of the submission.

    python submission.py FILE    (the judge starts it)

The process gets one JSON line for each new world and for each step, with what a robot would measure, and answers
each with one line. It knows neither the seed nor the scenario. Where the system allows it, the process sees no
other process and no network (`unshare`).
"""

import contextlib
import ctypes
import functools
import json
import os
import runpy
import shutil
import subprocess
import sys
import traceback
from pathlib import Path
from time import monotonic
from types import SimpleNamespace

import numpy as np
import psutil

import szlib

sys.path.append(str(Path(__file__).resolve().parents[1] / "exercises"))  # for `judges`
from judges.process import Process

RULES = szlib.MPCSettings()  # time step, sizes and limits of the robot
STARTING = 120.0  # time that Python and szlib may take to start [s]; it does not count for the submission
OWN_WORLD = ("--user", "--map-root-user", "--pid", "--fork", "--kill-child", "--mount-proc", "--net", "--ipc")


# --- in the process of the judge ----------------------------------------------------------------------


class RefusedError(Exception):
    """A submission is refused in a meeting; the text says why."""


@functools.cache
def find_prefix():
    """The program that starts a submission where it sees nobody else; () where the system does not allow it."""
    if not (unshare := shutil.which("unshare")):
        return ()
    prefix = (unshare, *OWN_WORLD)
    tried = subprocess.run([*prefix, sys.executable, "-c", ""], capture_output=True, check=False)
    return prefix if tried.returncode == 0 else ()


def adopt_orphans():
    """Become the parent of processes that a submission leaves behind (Linux), so that they can be ended."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(36, 1, 0, 0, 0)  # PR_SET_CHILD_SUBREAPER


class Submission(szlib.control.Controller):
    """The controller of a `file`, in a process of its own, as the closed loop sees it."""

    def __init__(self, file, time_limit=60.0):
        adopt_orphans()
        self._before = {child.pid for child in psutil.Process().children(recursive=True)}
        self.process = Process([str(Path(__file__).resolve()), str(file)], find_prefix())
        self.time_limit, self._deadline = time_limit, monotonic() + time_limit
        if self.process.receive(monotonic() + STARTING) != b"ready\n":
            self.end()
            raise RefusedError("does not start")

    def begin_world(self, world, zone):
        """Send a new world; its time begins."""
        self._deadline = monotonic() + self.time_limit
        return self.ask(walls=world.walls.tolist(), zone=(zone.center, zone.semi_axes, zone.angle))

    def end(self):
        """End the process and all that it has started."""
        self.process.end()
        for child in psutil.Process().children(recursive=True):
            if child.pid not in self._before:
                with contextlib.suppress(psutil.Error):
                    child.kill()
                    child.wait(1.0)

    def ask(self, **message):
        """Send a message, and return the control in the answer."""
        self.process.send(json.dumps(message).encode() + b"\n", self._deadline)
        text = self.process.receive(self._deadline)
        if text is None:
            raise RefusedError("is too slow")
        if not text:
            raise RefusedError(f"ends its process with exit code {self.process.wait()}")
        try:
            answer = json.loads(text[:4096])
            if "error" not in answer:
                return np.array(answer["control"], float)
        except (KeyError, TypeError, ValueError) as error:
            raise RefusedError(
                f"answers {text[:60].decode(errors='replace')!r}; expected an acceleration"
            ) from error
        raise RefusedError(f"fails: {answer['error']}")

    def step(self, state, goal, people):
        """Ask for the acceleration; the motors saturate at the largest acceleration and speed."""
        seen = [{key: getattr(p, key) for key in ("position", "velocity", "heading", "id")} for p in people]
        control = self.ask(state=state.tolist(), goal=goal.tolist(), people=seen)
        if control.shape != (2,) or not np.isfinite(control).all():
            raise RefusedError(f"gives the acceleration {control.tolist()}; expected two finite numbers")
        velocity = state[2:] + RULES.dt * np.clip(control, -RULES.a_max, RULES.a_max)
        velocity /= max(1.0, np.hypot(*velocity) / RULES.v_max)
        return SimpleNamespace(control=(velocity - state[2:]) / RULES.dt)


# --- in the process of the submission -----------------------------------------------------------------


def answer(lines, make_controller):
    """Yield the control for each line of `lines`; None for a new world, which gets a new controller."""
    for given in map(json.loads, lines):
        if "walls" in given:
            walls = np.reshape(given["walls"], (-1, 2, 2))
            controller = szlib.control.as_controller(make_controller(walls, szlib.Ellipse(*given["zone"])))
            yield controller.reset()
        else:
            people = tuple(szlib.Person(**person) for person in given["people"])
            step = controller.step(np.array(given["state"]), np.array(given["goal"]), people)
            yield np.asarray(step.control, float).tolist()


def describe(error, file):
    """The error as text, with the line of `file` that was executed last."""
    lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == file]
    line = (lines or [getattr(error, "lineno", None)])[-1]
    return f"{f'line {line}: ' if line else ''}{type(error).__name__}: {error}"[:300]


if __name__ == "__main__":
    file, answers = sys.argv[1], os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # what the submission prints is not an answer
    for name in szlib.__all__:
        getattr(szlib, name)  # loaded now, so that it does not count
    print("ready", file=answers, flush=True)
    try:
        for control in answer(sys.stdin, runpy.run_path(file)["make_controller"]):
            print(json.dumps({"control": control}), file=answers, flush=True)
    except Exception as error:
        print(json.dumps({"error": describe(error, file)}), file=answers, flush=True)
