"""Check an answer, or read a hint: `check("barrier_row", barrier_row)`, `hint("barrier_row", 2)`."""

from __future__ import annotations

import numpy as np

from szlib.errors import DataError

from . import sheet1_tracks, sheet2_outliers, sheet3_zones, sheet4_certainty, sheet5_barriers, sheet6_robot
from .task import Answer, Task, Verdict

_MODULES = (sheet1_tracks, sheet2_outliers, sheet3_zones, sheet4_certainty, sheet5_barriers, sheet6_robot)
SHEETS: dict[str, tuple[Task, ...]] = {
    module.__name__.rpartition(".")[2]: module.TASKS for module in _MODULES
}
"""The tasks of each sheet, in order."""


def check(name: str, answer: Answer, *, seed: int | None = None) -> Verdict:
    """Check an answer, and say what is correct or wrong.

    Parameters
    ----------
    name : name of the task.
    answer : the function itself, not its result.
    seed : seed of the cases; None draws fresh cases each time.

    Returns
    -------
    The verdict. Its text stands below the cell.

    Raises
    ------
    DataError : there is no such task.

    Examples
    --------
    >>> import judges
    >>> def speed_limit(h, gamma, dt, person_speed):
    ...     return gamma * h / dt - person_speed
    >>> judges.check("speed_limit", speed_limit)
    passed - speed_limit: correct in 5 fresh cases
    """
    task = _find_task(name)
    if not callable(answer):
        return Verdict(name, False, f"give the function itself, check({name!r}, {name}), not its result")
    return task.check(answer, np.random.default_rng(seed))


def hint(name: str, number: int = 1) -> None:
    """Print a hint for a task.

    Parameters
    ----------
    name : name of the task.
    number : number of the hint, from 1; the last one is nearly the solution.

    Raises
    ------
    DataError : there is no such task or hint.

    Examples
    --------
    >>> import judges
    >>> judges.hint("velocity", 1)
    hint 1 of 3: Velocity is displacement divided by time.
    """
    hints = _find_task(name).hints
    if not 1 <= number <= len(hints):
        raise DataError(f"{name} has hints 1 to {len(hints)}; got {number}")
    print(f"hint {number} of {len(hints)}: {hints[number - 1]}")


def _find_task(name: str) -> Task:
    tasks = {task.name: task for sheet in SHEETS.values() for task in sheet}
    if name not in tasks:
        raise DataError(f"there is no task {name!r}; the tasks are {', '.join(tasks)}")
    return tasks[name]
