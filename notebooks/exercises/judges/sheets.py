"""The tasks of all sheets; judge an answer, read a hint, or draw a case again."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any

from szlib.core.errors import DataError

from .answers import Answer
from .task import ESSAY_MINUTES, Args, Task, Verdict

_MODULES = "tracks outliers zones certainty barriers robot controller"
TASKS: dict[str, Task] = {
    task.name: task for module in _MODULES.split() for task in import_module(f".{module}", __package__).TASKS
}
"""All tasks by name."""
_SHEETS = {
    "sheet1_tracks": "velocity line_of_sight in_space one_hertz",
    "sheet2_outliers": "complementary nearest found blind_spot",
    "sheet3_zones": "crossing zone_radius triangle_ellipse quantile_radius expected_nearest p_value shifted",
    "sheet4_own_zone": "my_zone speed_limit",
    "sheet5_barriers": "focal_distance wall_distance barrier_row end_margin filter_1d filter_2d predict",
    "sheet6_controller": "mpc_1d mpc_cbf_1d mpc_cbf_2d tuned",
    "sheet7_robot": "largest_gamma next_plan prediction count_ways",
}
SHEETS: dict[str, tuple[Task, ...]] = {
    sheet: tuple(TASKS[name] for name in names.split()) for sheet, names in _SHEETS.items()
}
"""The tasks of each sheet, in order. A sheet belongs to one week, so that it can be handed out whole."""


def judge(name: str, packed: dict[str, str], seed: int) -> Verdict:
    """Judge a packed answer in the cases of one seed, in a process of its own."""
    task = find_task(name)
    with Answer(packed, task.allowed, task.seconds) as answer:
        return task.check(answer, seed)


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
    """Draw what the answer does in one world of a check in closed loop."""
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


def find_task(name: str) -> Task:
    """The task of this name."""
    if name not in TASKS:
        raise DataError(f"there is no task {name!r}; the tasks are {', '.join(TASKS)}")
    return TASKS[name]
