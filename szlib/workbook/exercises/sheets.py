"""Check an answer, or ask for a hint: `check("barrier_row", barrier_row)`, `hint("barrier_row", 2)`."""

from __future__ import annotations

import numpy as np

from ...errors import DataError
from . import (
    sheet1_tracks,
    sheet2_outliers,
    sheet3_zones,
    sheet4_certainty,
    sheet5_barriers,
    sheet6_robot,
)
from .task import Answer, Task, Verdict

SHEETS: dict[str, tuple[Task, ...]] = {
    "sheet1_tracks": sheet1_tracks.TASKS,
    "sheet2_outliers": sheet2_outliers.TASKS,
    "sheet3_zones": sheet3_zones.TASKS,
    "sheet4_certainty": sheet4_certainty.TASKS,
    "sheet5_barriers": sheet5_barriers.TASKS,
    "sheet6_robot": sheet6_robot.TASKS,
}
"""The tasks of every sheet, in their order."""


def check(name: str, answer: Answer, *, seed: int | None = None) -> Verdict:
    """What is right or wrong with an answer, in words.

    Parameters
    ----------
    name : of the task.
    answer : the function itself, not what it gives.
    seed : of the cases; None draws fresh ones every time.

    Raises DataError where there is no such task.
    """
    task = _task(name)
    if not callable(answer):
        told = f"hand over the function itself, check({name!r}, {name}), not what it gives"
        return Verdict(name, False, told)
    return task.check(answer, np.random.default_rng(seed))


def hint(name: str, number: int = 1) -> None:
    """Print one hint for a task, 1 for the first; the last one is nearly the solution.

    Raises DataError where there is no such task or hint.
    """
    hints = _task(name).hints
    if not 1 <= number <= len(hints):
        raise DataError(f"{name} has hints 1 to {len(hints)}; got {number}")
    print(f"hint {number} of {len(hints)}: {hints[number - 1]}")


def _task(name: str) -> Task:
    tasks = {task.name: task for sheet in SHEETS.values() for task in sheet}
    if name not in tasks:
        raise DataError(f"there is no task {name!r}; there are {', '.join(tasks)}")
    return tasks[name]
