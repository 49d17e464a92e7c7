"""A submission in a process of its own: the end of the judge, and the end of the submission.

    python submission.py FILE    (the judge starts it)

The process gets one JSON line for each new world and for each step, with what a robot would measure, and answers
each with one line. It knows neither the seed nor the scenario.
"""

import contextlib
import json
import os
import runpy
import signal
import subprocess
import sys
import traceback
from pathlib import Path
from types import SimpleNamespace

import numpy as np

import szlib

RULES = szlib.MPCSettings()  # time step, sizes and limits of the robot


# --- in the process of the judge ----------------------------------------------------------------------


class RefusedError(Exception):
    """A submission is refused in a meeting; the text says why."""


class Submission(szlib.control.Controller):
    """The controller of a `file`, in a process of its own, as the closed loop sees it."""

    def __init__(self, file):
        command = [sys.executable, str(Path(__file__).resolve()), str(file)]
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL}
        self.process = subprocess.Popen(command, text=True, start_new_session=True, **pipes)
        self.is_late = False

    def stop(self):
        """End the process because the time is over."""
        self.is_late = True
        self.end()

    def end(self):
        """End the process, and on POSIX those that it has started."""
        with contextlib.suppress(ProcessLookupError):  # they have ended
            os.killpg(self.process.pid, signal.SIGKILL) if hasattr(os, "killpg") else self.process.kill()

    def ask(self, **message):
        """Send a message, and return the control in the answer."""
        with contextlib.suppress(BrokenPipeError):  # the process has ended; its last answer may say why
            print(json.dumps(message), file=self.process.stdin, flush=True)
        text = self.process.stdout.readline(4096)
        if not text:
            code = self.process.wait()
            raise RefusedError("is too slow" if self.is_late else f"ends its process with exit code {code}")
        try:
            answer = json.loads(text)
            if "error" not in answer:
                return np.array(answer["control"], float)
        except (KeyError, TypeError, ValueError) as error:
            raise RefusedError(f"answers {text[:60]!r}; expected an acceleration") from error
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
    try:
        for control in answer(sys.stdin, runpy.run_path(file)["make_controller"]):
            print(json.dumps({"control": control}), file=answers, flush=True)
    except Exception as error:
        print(json.dumps({"error": describe(error, file)}), file=answers, flush=True)
