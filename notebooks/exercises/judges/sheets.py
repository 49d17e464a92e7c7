"""Check an answer, read a hint, or draw a case again: `check`, `hint`, `case`, `plot`."""

from __future__ import annotations

import secrets
from importlib import import_module
from typing import Any

from szlib.core.errors import DataError

from .task import ESSAY_MINUTES, Answer, Args, Task, Verdict

_SHEETS = "sheet1_tracks sheet2_outliers sheet3_zones sheet4_certainty sheet5_barriers sheet6_robot sheet7_controller"
SHEETS: dict[str, tuple[Task, ...]] = {
    name: import_module(f".{name}", __package__).TASKS for name in _SHEETS.split()
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
    >>> judges.check("speed_limit", speed_limit, seed=1)
    passed - speed_limit: correct in 40 fresh cases
    """
    task = _find_task(name)
    if not callable(answer):
        return Verdict(name, False, f"give the function itself, check({name!r}, {name}), not its result")
    return task.check(answer, secrets.randbelow(10**6) if seed is None else seed)


def case(name: str, seed: int, number: int) -> Args:
    """The arguments of one case of a check, as its message names them.

    Examples
    --------
    >>> import judges
    >>> judges.case("speed_limit", seed=1, number=2)
    (1.28, 0.102, 0.2, 1.34)
    """
    return _find_task(name).case(seed, number)


def plot(name: str, answer: Answer, *, seed: int, number: int) -> None:
    """Draw what the answer does in one world of a check of sheet 7."""
    task = _find_task(name)
    if task.plot is None:
        raise DataError(f"{name} has no worlds to draw; judges.case gives its arguments")
    task.plot(answer, task.case(seed, number))


def hint(name: str, number: int = 1) -> None:
    """Print a hint for a task.

    Parameters
    ----------
    name : name of the task.
    number : number of the hint, from 1.

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


def sheet_minutes(sheet: str) -> int:
    """Minutes that a sheet takes: its tasks and its essay."""
    return ESSAY_MINUTES + sum(task.minutes for task in SHEETS[sheet])


def _find_task(name: str) -> Task:
    tasks = {task.name: task for sheet in SHEETS.values() for task in sheet}
    if name not in tasks:
        raise DataError(f"there is no task {name!r}; the tasks are {', '.join(tasks)}")
    return tasks[name]
