"""Tasks of the exercise sheets: `check` an answer, or read a `hint`.

client            `check`: the notebook's end; it asks the judges, a program of their own
__main__          that program: it serves a notebook, or marks sheets that were handed in
answers           an answer as the judges see it: a process with the learner's function and the cases
answer_program    that process: limits of time, memory, files, modules
process           a program that cannot keep its caller waiting
task              one task: it draws cases and compares the results
texts.toml        minutes, hints and messages of all tasks
tracks            tasks: velocity, line of sight, attentional space, sampling at 1 Hz
outliers          tasks: complementary coordinates, nearest approaches, LOF's blind spot
zones             tasks: a slice, its zone, the smallest ellipse, a zone of your own
certainty         tasks: quantiles, extremes, p-values, the null model
barriers          tasks: distances to zones and walls, the barrier row, the margin
robot             tasks: speed limit, gamma by experiment, the terminal proof, predictions, distinct ways
controller        tasks: filters (CBF-QP), the states of a plan, MPC, MPC-CBF
sheets            which tasks each sheet has: those of one week, or of a part of it
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from .client import Verdict, check

if TYPE_CHECKING:
    from .sheets import SHEETS, case, hint, plot
    from .task import ESSAY_MINUTES, Task

_PLACES = {"ESSAY_MINUTES": "task", "Task": "task"}
_NAMES = ("SHEETS", "case", "hint", "plot", *_PLACES)


def __getattr__(name: str) -> Any:
    """Load the tasks when they are needed: the check of an answer happens elsewhere."""
    if name in _NAMES:
        return getattr(import_module(f".{_PLACES.get(name, 'sheets')}", __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
