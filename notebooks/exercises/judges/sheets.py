"""The tasks of all sheets; judge an answer, read a hint, or draw a case again."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from importlib import import_module
from typing import Any

from szlib.core.errors import DataError

from .answers import Answer
from .task import ESSAY_MINUTES, Args, Task, Verdict

_SHEETS = "sheet1_tracks sheet2_outliers sheet3_zones sheet4_certainty sheet5_barriers sheet6_robot sheet7_controller"
SHEETS: dict[str, tuple[Task, ...]] = {
    name: import_module(f".{name}", __package__).TASKS for name in _SHEETS.split()
}
"""The tasks of each sheet, in order."""


def judge(name: str, packed: dict[str, str], seeds: Iterable[int]) -> Iterator[Verdict]:
    """Judge a packed answer in the cases of each seed, all in one process of the answer."""
    task = find_task(name)
    with Answer(packed, task.allowed, task.seconds) as answer:
        for seed in seeds:
            answer.renew()
            yield task.check(answer, seed)


def case(name: str, seed: int, number: int) -> Args:
    """The arguments of one case of a check, as its message names them.

    Examples
    --------
    >>> import judges
    >>> judges.case("speed_limit", seed=1, number=2)
    (1.28, 0.102, 0.2, 1.34)
    """
    return find_task(name).case(seed, number)


def plot(name: str, answer: Callable[..., Any], *, seed: int, number: int) -> None:
    """Draw what the answer does in one world of a check of sheet 7."""
    task = find_task(name)
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
    hints = find_task(name).hints
    if not 1 <= number <= len(hints):
        raise DataError(f"{name} has hints 1 to {len(hints)}; got {number}")
    print(f"hint {number} of {len(hints)}: {hints[number - 1]}")


def sheet_minutes(sheet: str) -> int:
    """Minutes that a sheet takes: its tasks and its essay."""
    return ESSAY_MINUTES + sum(task.minutes for task in SHEETS[sheet])


def find_task(name: str) -> Task:
    """The task of this name."""
    tasks = {task.name: task for sheet in SHEETS.values() for task in sheet}
    if name not in tasks:
        raise DataError(f"there is no task {name!r}; the tasks are {', '.join(tasks)}")
    return tasks[name]
