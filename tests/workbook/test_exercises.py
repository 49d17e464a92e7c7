"""The exercises: solutions pass, stubs fail, and typical wrong answers are told what is wrong."""

import importlib.util
import re
import warnings
from functools import cache
from pathlib import Path

import jupytext
import matplotlib.pyplot as plt
import nbformat
import numpy as np
import pytest

import szlib
from szlib.workbook.exercises import SHEETS, Task, check, hint
from szlib.workbook.record import places

TASKS = {
    task.name: (sheet, number, task) for sheet, tasks in SHEETS.items() for number, task in enumerate(tasks)
}
SEED = 3


def _sheets():
    spec = importlib.util.spec_from_file_location("sheets", places.NOTEBOOKS / "sheets.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


sheets = _sheets()


@cache
def cells(file: Path) -> list[nbformat.NotebookNode]:
    return jupytext.read(file).cells


def defined(sheet: str, folder: Path) -> dict[str, object]:
    """What the cells of a sheet define: those that import something or define a function."""
    found: dict[str, object] = {}
    for cell in cells(folder / f"{sheet}.py"):
        if cell.cell_type == "code" and re.search(r"^(import|from|def) ", cell.source, re.MULTILINE):
            exec(cell.source, found)
    return found


@pytest.fixture(autouse=True)
def quiet():
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", szlib.DataWarning)
        yield


# --- the tasks ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", TASKS)
class TestEach:
    def test_the_solution_passes(self, name):
        answer = defined(TASKS[name][0], sheets.SOLUTIONS)[name]
        verdict = check(name, answer, seed=SEED)
        assert verdict.passed, verdict
        verdict.require()

    def test_the_stub_fails_and_is_told_that_there_is_no_answer(self, name):
        verdict = check(name, defined(TASKS[name][0], sheets.EXERCISES)[name], seed=SEED)
        assert not verdict.passed
        assert "no answer yet" in verdict.message
        with pytest.raises(szlib.SzlibError, match="no answer yet"):
            verdict.require()

    def test_typical_wrong_answers_are_told_what_is_wrong(self, name):
        mistakes = TASKS[name][2].mistakes
        assert len(mistakes) >= 3
        for told, wrong in mistakes.items():
            verdict = check(name, wrong, seed=SEED)
            assert not verdict.passed
            assert told in verdict.message

    def test_hints_go_on_to_the_last(self, name, capsys):
        hints = TASKS[name][2].hints
        assert len(hints) >= 3
        hint(name, len(hints))
        assert hints[-1] in capsys.readouterr().out
        with pytest.raises(szlib.DataError, match=f"hints 1 to {len(hints)}"):
            hint(name, len(hints) + 1)

    def test_the_sheet_asks_for_it_where_and_as_long_as_declared(self, name):
        sheet, number, task = TASKS[name]
        (place,) = [
            i for i, c in enumerate(cells(sheets.SOLUTIONS / f"{sheet}.py")) if f'check("{name}"' in c.source
        ]
        before = cells(sheets.SOLUTIONS / f"{sheet}.py")[:place]
        (title,) = [c.source.splitlines()[0] for c in before if c.source.startswith("## ")][
            number : number + 1
        ]
        assert title.startswith(f"## {sheet[5]}.{number + 1} ")
        assert title.endswith(f"{task.minutes} min)")


def test_there_are_enough_for_a_course():
    assert len(TASKS) >= 24
    assert all(2 <= len(tasks) <= 4 for tasks in SHEETS.values())
    minutes = [task.minutes for _, _, task in TASKS.values()]
    assert min(minutes) <= 5
    assert max(minutes) >= 120


def test_cases_are_fresh():
    first, second = [], []
    for seen in (first, second):
        check("velocity", lambda path, k, half, seen=seen: seen.append(path) or path[k])
    assert not np.array_equal(first[0], second[0])


# --- what else a learner may hand in -------------------------------------------------------------------


def one(judge=None):
    """A task whose truth is twice a number."""
    return Task("double", 1, (), lambda rng: ((3.0,), 6.0), {"add": lambda x: x + x + 1}, judge, unit="m")


@pytest.mark.parametrize(
    ("answer", "told"),
    [
        (lambda x: None, "does it end with `return`"),
        (lambda x: x[0], r"stopped with TypeError .* for \(3.0\)"),
        (lambda x: "six", "expected a number; got str"),
        (lambda x: np.full(2, 6.0), r"expected a number; got an array of shape \(2,\)"),
        (lambda x: np.nan, "expected 6.0 m; got nan"),
        (lambda x: 7.0, "add: expected 6.0 m; got 7.0"),
        (lambda x: 6.0 + 1e-5, "expected 6.0 m; got 6.0"),
    ],
)
def test_an_answer_that_is_none(answer, told):
    verdict = one().check(answer, np.random.default_rng(0))
    assert not verdict.passed
    assert re.search(told, verdict.message), verdict.message


def test_what_the_answer_raised_is_kept():
    verdict = one().check(lambda x: 1 / 0, np.random.default_rng(0))
    assert isinstance(verdict.error, ZeroDivisionError)


def test_an_answer_cannot_spoil_the_case():
    def spoils(path, k, half):
        right = (path[k + half] - path[k - half]) / (2 * half * 0.1)
        path[:] = 0
        return right

    assert check("velocity", spoils, seed=SEED).passed


def test_a_value_in_place_of_a_function_and_an_unknown_task():
    assert "the function itself" in check("velocity", 1.0).message
    with pytest.raises(szlib.DataError, match="no task 'speed'; there are velocity"):
        check("speed", lambda: 0)


def test_of_a_large_array_the_first_wrong_number_is_shown():
    verdict = check("in_space", lambda ref, heading, others: np.zeros(len(others)), seed=SEED)
    assert re.search(r"\d+ of 60 numbers are wrong; at \[\d+\] expected", verdict.message)


# --- the sheets --------------------------------------------------------------------------------------


@pytest.mark.parametrize("sheet", SHEETS)
class TestSheet:
    def test_the_exercise_is_made_of_the_solutions(self, sheet):
        solutions = (sheets.SOLUTIONS / f"{sheet}.py").read_text(encoding="utf-8")
        exercise = (sheets.EXERCISES / f"{sheet}.py").read_text(encoding="utf-8")
        assert exercise == sheets.exercise_of(solutions)
        assert "SOLUTION" not in exercise
        assert exercise.count("raise NotImplementedError()") == len(SHEETS[sheet])

    @pytest.mark.parametrize("folder", [sheets.SOLUTIONS, sheets.EXERCISES], ids=lambda f: f.name)
    def test_the_pairs_hold_together(self, sheet, folder):
        copy = nbformat.read(folder / f"{sheet}.ipynb", as_version=4).cells
        assert [(c.cell_type, c.source) for c in copy] == [
            (c.cell_type, c.source) for c in cells(folder / f"{sheet}.py")
        ]

    def test_the_executed_copy_of_the_solutions_passes(self, sheet):
        copy = nbformat.read(sheets.SOLUTIONS / f"{sheet}.ipynb", as_version=4).cells
        said = [
            out["data"]["text/plain"]
            for c in copy
            if c.source.startswith("exercises.check")
            for out in c.outputs
        ]
        assert [line.split(" - ")[0] for line in said] == ["passed"] * len(SHEETS[sheet])

    def test_run_all_goes_through_before_anything_is_answered(self, sheet, monkeypatch):
        monkeypatch.setattr(plt, "show", lambda: plt.close("all"))
        found: dict[str, object] = {}
        for cell in cells(sheets.EXERCISES / f"{sheet}.py"):
            if cell.cell_type == "code" and not cell.source.startswith("exercises.check"):
                exec(cell.source, found)

    def test_for_a_class_each_check_is_graded_and_locked(self, sheet):
        solutions = (sheets.SOLUTIONS / f"{sheet}.py").read_text(encoding="utf-8")
        points = {task.name: task.minutes for task in SHEETS[sheet]}
        marked = [c for c in sheets.graded(solutions, points).cells if "nbgrader" in c.metadata]
        assert len(marked) == 2 * len(points)
        for answer, test in zip(marked[::2], marked[1::2], strict=True):
            assert "### BEGIN SOLUTION" in answer.source
            assert answer.metadata["nbgrader"]["solution"]
            assert test.source.endswith(".require()")
            assert test.metadata["nbgrader"]["locked"]
            assert test.metadata["nbgrader"]["points"] in points.values()

    def test_nbgrader_makes_the_same_stubs(self, sheet):
        preprocessors = pytest.importorskip("nbgrader.preprocessors", reason="nbgrader is not installed")
        solutions = (sheets.SOLUTIONS / f"{sheet}.py").read_text(encoding="utf-8")
        source = sheets.graded(solutions, {task.name: task.minutes for task in SHEETS[sheet]})
        released = preprocessors.ClearSolutions().preprocess(source, {})[0].cells
        expected = [cell.source for cell in cells(sheets.EXERCISES / f"{sheet}.py")]
        assert [cell.source.removesuffix(".require()") for cell in released] == expected
