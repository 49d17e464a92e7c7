"""The exercises: their tasks, the solutions in the notebooks, and wrong answers."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import jupytext
from judges import sheets
from judges.answers import Refusal, pack
from judges.client import Verdict
from judges.task import Task

from szlib.workbook import folders

EXERCISES, SOLUTIONS = folders.NOTEBOOKS / "exercises", folders.NOTEBOOKS / "solutions"
TASKS: dict[str, tuple[str, int, Task]] = {
    task.name: (sheet, number, task)
    for sheet, tasks in sheets.SHEETS.items()
    for number, task in enumerate(tasks)
}
"""Sheet, place in the sheet, and task, by name of the task."""


@cache
def cells(file: Path) -> list[Any]:
    return list(jupytext.read(file).cells)


@cache
def defined(sheet: str, folder: Path) -> dict[str, Any]:
    """The names that the cells of a sheet define; only cells that import or define functions are run."""
    found: dict[str, Any] = {"__name__": "sheet"}
    for cell in cells(folder / f"{sheet}.py"):
        if cell.cell_type == "code" and re.search(
            r"^(import|from|def) ", cell.source, re.MULTILINE
        ):
            exec(cell.source, found)
    return found


def solution(name: str) -> Any:
    """The answer of the sheet's solution."""
    return defined(TASKS[name][0], SOLUTIONS)[name]


def judge(
    name: str, answer: Callable[..., Any] | str, seeds: Iterable[int]
) -> Iterator[Verdict]:
    """The verdicts on an answer, a function or the source of one, for each seed in a new process."""
    try:
        packed = (
            {"source": answer, "name": name}
            if isinstance(answer, str)
            else pack(answer)
        )
    except Refusal as refusal:
        for _ in seeds:
            yield Verdict(name, False, str(refusal))
        return
    for seed in seeds:
        yield sheets.judge(name, packed, seed)
