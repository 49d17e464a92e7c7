"""The exercises: solutions pass, stubs fail, and each typical mistake gets its own message."""

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
from judges import SHEETS, Task, check, hint, sheet6_robot
from judges.task import load_texts

import szlib
from szlib.workbook import folders

TASKS = {
    task.name: (sheet, number, task) for sheet, tasks in SHEETS.items() for number, task in enumerate(tasks)
}
SEED = 3


def far_corner(cloud):
    return cloud.max(axis=0) + 1.0


def quantile_ellipse(samples, q, *, complement=False):
    """An ellipse along the axes, from the quantile q of the nearest approaches on four sides."""
    close = samples[(samples["distance"] <= 2.0) & (samples["speed"] - 1.1).abs().le(0.2)]
    turn = np.radians([0, 90, 180, -90])
    off = np.angle(np.exp(1j * (close["los_angle"].to_numpy()[:, None] - turn)))
    radii = []
    for side in (np.abs(off) < np.radians(15)).T:
        approach = close[side].groupby("encounter")["distance"].min()
        radii.append(float(np.quantile(approach, q)))
    ahead, left, behind, right = (2.0 - r if complement else r for r in radii)
    a, b = sorted([(ahead + behind) / 2, (left + right) / 2], reverse=True)
    center = (ahead - behind) / 2, (left - right) / 2
    return szlib.Ellipse(center, (a, b), np.pi / 2 if complement else 0.0)


def predict(**wrong):
    """The correct answers, except those in `wrong` (q0, q1, q2)."""
    questions = enumerate(sheet6_robot.QUESTIONS.items())
    return {question: wrong.get(f"q{i}", answers[0]) for i, (question, answers) in questions}


WRONG_ANSWERS = {
    "blind_spot": {
        "an encounter has 31 samples": lambda cloud: far_corner(cloud)[None],
        "this is not an intruder": lambda cloud: cloud[:31] + 0.01,
        "the same point": lambda cloud: np.tile(far_corner(cloud), (31, 1)),
        "LOF removes": lambda cloud: far_corner(cloud) + 0.02 * np.arange(31)[:, None] ** 2,
    },
    "my_zone": {
        "expected a szlib.Ellipse": lambda samples: 1.0,
        "too small; a few people walk through": lambda samples: quantile_ellipse(samples, 0.0),
        "too large; most people keep farther away": lambda samples: quantile_ellipse(samples, 0.4),
        "this is an ellipse around the slice": lambda s: quantile_ellipse(s, 0.05, complement=True),
    },
    "prediction": {
        "'larger'; the runs give 'smaller'": lambda: predict(q0="larger"),
        "'more'; the runs give 'fewer'": lambda: predict(q1="more"),
        "'farther away'; the runs give 'nearer'": lambda: predict(q2="farther away"),
        "expected a dict with an answer": lambda: "smaller",
    },
}
"""Message -> answer that gets it, for each task with a judge."""


def _sheets():
    spec = importlib.util.spec_from_file_location("sheets", folders.NOTEBOOKS / "tools" / "sheets.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


sheets = _sheets()


@cache
def cells(file: Path) -> list[nbformat.NotebookNode]:
    return jupytext.read(file).cells


def defined(sheet: str, folder: Path) -> dict[str, object]:
    """The names that the cells of a sheet define; only cells that import or define functions are run."""
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

    def test_the_stub_fails_with_no_answer_yet(self, name):
        verdict = check(name, defined(TASKS[name][0], sheets.EXERCISES)[name], seed=SEED)
        assert not verdict.passed
        assert "no answer yet" in verdict.message
        with pytest.raises(szlib.SzlibError, match="no answer yet"):
            verdict.require()

    def test_each_typical_mistake_gets_its_message(self, name):
        mistakes = {**TASKS[name][2].mistakes, **WRONG_ANSWERS.get(name, {})}
        assert len(mistakes) >= 3
        for message, wrong in mistakes.items():
            verdict = check(name, wrong, seed=SEED)
            assert not verdict.passed
            assert message in verdict.message

    def test_every_hint_up_to_the_last_can_be_read(self, name, capsys):
        hints = TASKS[name][2].hints
        assert len(hints) >= 3
        hint(name, len(hints))
        assert hints[-1] in capsys.readouterr().out
        with pytest.raises(szlib.DataError, match=f"hints 1 to {len(hints)}"):
            hint(name, len(hints) + 1)

    def test_the_sheet_states_the_declared_order_and_time(self, name):
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


def test_there_are_enough_tasks_for_a_course():
    assert len(TASKS) >= 24
    assert all(2 <= len(tasks) <= 4 for tasks in SHEETS.values())
    minutes = [task.minutes for _, _, task in TASKS.values()]
    assert min(minutes) <= 5
    assert max(minutes) >= 120


def test_every_text_belongs_to_a_task_and_a_mistake():
    texts = load_texts()
    assert set(texts) == set(TASKS)
    for name, (_, _, task) in TASKS.items():
        assert task.judge or set(task.mistakes) == set(texts[name]["mistakes"].values())


def test_each_check_draws_new_cases():
    first, second = [], []
    for seen in (first, second):
        check("velocity", lambda path, k, half, seen=seen: seen.append(path) or path[k])
    assert not np.array_equal(first[0], second[0])


# --- invalid answers ---------------------------------------------------------------------------------


def make_task():
    """A task whose correct answer is twice a number."""
    return Task("double", 1, (), lambda rng: ((3.0,), 6.0), {"add": lambda x: x + x + 1}, unit="m")


@pytest.mark.parametrize(
    ("answer", "message"),
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
def test_a_wrong_answer_is_described(answer, message):
    verdict = make_task().check(answer, np.random.default_rng(0))
    assert not verdict.passed
    assert re.search(message, verdict.message), verdict.message


def test_the_verdict_holds_the_error_of_the_answer():
    verdict = make_task().check(lambda x: 1 / 0, np.random.default_rng(0))
    assert isinstance(verdict.error, ZeroDivisionError)


def test_an_answer_cannot_change_the_case():
    def overwrites(path, k, half):
        right = (path[k + half] - path[k - half]) / (2 * half * 0.1)
        path[:] = 0
        return right

    assert check("velocity", overwrites, seed=SEED).passed


def test_a_value_instead_of_a_function_and_an_unknown_task_are_refused():
    assert "the function itself" in check("velocity", 1.0).message
    with pytest.raises(szlib.DataError, match="no task 'speed'; the tasks are velocity"):
        check("speed", lambda: 0)


def test_the_first_wrong_number_of_a_large_array_is_shown():
    verdict = check("in_space", lambda ref, heading, others: np.zeros(len(others)), seed=SEED)
    assert re.search(r"\d+ of 60 numbers are wrong; at \[\d+\] expected", verdict.message)


# --- the sheets --------------------------------------------------------------------------------------


@pytest.mark.parametrize("sheet", SHEETS)
class TestSheet:
    def test_the_exercise_is_generated_from_the_solutions(self, sheet):
        solutions = (sheets.SOLUTIONS / f"{sheet}.py").read_text(encoding="utf-8")
        exercise = (sheets.EXERCISES / f"{sheet}.py").read_text(encoding="utf-8")
        assert exercise == sheets.make_exercise(solutions)
        assert "SOLUTION" not in exercise
        assert exercise.count("raise NotImplementedError()") == len(SHEETS[sheet])

    @pytest.mark.parametrize("folder", [sheets.SOLUTIONS, sheets.EXERCISES], ids=lambda f: f.name)
    def test_script_and_notebook_are_equal(self, sheet, folder):
        copy = nbformat.read(folder / f"{sheet}.ipynb", as_version=4).cells
        assert [(c.cell_type, c.source) for c in copy] == [
            (c.cell_type, c.source) for c in cells(folder / f"{sheet}.py")
        ]

    def test_the_executed_copy_of_the_solutions_passes(self, sheet):
        copy = nbformat.read(sheets.SOLUTIONS / f"{sheet}.ipynb", as_version=4).cells
        outputs = [
            out["data"]["text/plain"]
            for c in copy
            if c.source.startswith("judges.check")
            for out in c.outputs
        ]
        assert [line.split(" - ")[0] for line in outputs] == ["passed"] * len(SHEETS[sheet])

    def test_the_sheet_runs_before_it_is_answered(self, sheet, monkeypatch):
        monkeypatch.setattr(plt, "show", lambda: plt.close("all"))
        found: dict[str, object] = {}
        for cell in cells(sheets.EXERCISES / f"{sheet}.py"):
            if cell.cell_type == "code" and not cell.source.startswith("judges.check"):
                exec(cell.source, found)

    def test_each_check_of_a_class_is_graded_and_locked(self, sheet):
        solutions = (sheets.SOLUTIONS / f"{sheet}.py").read_text(encoding="utf-8")
        points = {task.name: task.minutes for task in SHEETS[sheet]}
        marked = [c for c in sheets.make_graded(solutions, points).cells if "nbgrader" in c.metadata]
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
        source = sheets.make_graded(solutions, {task.name: task.minutes for task in SHEETS[sheet]})
        released = preprocessors.ClearSolutions().preprocess(source, {})[0].cells
        expected = [cell.source for cell in cells(sheets.EXERCISES / f"{sheet}.py")]
        assert [cell.source.removesuffix(".require()") for cell in released] == expected
