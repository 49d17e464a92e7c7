"""Tasks of the exercise sheets: `check` an answer, or read a `hint`.

client            `check`: the notebook's end; it asks the judges, a program of their own
__main__          that program: it serves a notebook, or marks sheets that were handed in
answers           an answer as the judges see it: a process with the learner's function and the cases
answer_program    that process: limits of time, memory, files, modules
process           a program that cannot keep its caller waiting
task              one task: it draws cases and compares the results
texts.toml        minutes, hints and messages of all tasks
sheet1_tracks     velocity, line of sight, attentional space, sampling at 1 Hz
sheet2_outliers   complementary coordinates, nearest approaches, LOF's blind spot
sheet3_zones      a slice, its zone, the smallest ellipse, a zone of your own
sheet4_certainty  quantiles, extremes, p-values, the null model
sheet5_barriers   distances to zones and walls, the barrier row, the margin
sheet6_robot      speed limit, gamma by experiment, the terminal proof, predictions, distinct ways
sheets            the tasks of all sheets
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from .client import Verdict, check

if TYPE_CHECKING:
    from .sheets import SHEETS, case, hint, plot, sheet_minutes
    from .task import ESSAY_MINUTES, Task

_PLACES = {"ESSAY_MINUTES": "task", "Task": "task"}
_NAMES = ("SHEETS", "case", "hint", "plot", "sheet_minutes", *_PLACES)


def __getattr__(name: str) -> Any:
    """Load the tasks when they are needed: the check of an answer happens elsewhere."""
    if name in _NAMES:
        return getattr(import_module(f".{_PLACES.get(name, 'sheets')}", __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
