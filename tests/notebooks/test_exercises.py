"""The exercises: solutions pass, stubs fail, and each wrong answer is refused with its own message.

`tests/studies/exercises.py` does the same in 300 checks of each answer.
"""

import doctest
import importlib.util
import math
import os
import re
import subprocess
import sys
import time
import warnings
from dataclasses import replace
from pathlib import Path

import judges
import judges.__main__ as marking
import jupytext
import matplotlib.pyplot as plt
import nbformat
import numpy as np
import pandas as pd
import pytest
from helpers.cheats import CHEATS
from helpers.exercises import TASKS, cells, defined, judge, solution
from helpers.wrong_answers import WRONG
from judges import SHEETS, Task, check, hint
from judges.answers import Answer, pack
from judges.task import load_texts

import szlib
from szlib.workbook import folders

SEED = 3
LONG = {"blind_spot", "my_zone", "largest_gamma", "prediction"} | {
    t.name for t in (*SHEETS["sheet5_barriers"][4:], *SHEETS["sheet6_controller"])
}
"""Tasks whose checks take long: some tenths of a second."""


def _sheets():
    spec = importlib.util.spec_from_file_location(
        "sheets", folders.NOTEBOOKS / "tools" / "sheets.py"
    )
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


sheets = _sheets()


@pytest.fixture(autouse=True)
def quiet():
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", szlib.DataWarning)
        yield
        plt.close("all")


# --- the tasks ---------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("name", TASKS)
class TestEach:
    def test_the_solution_passes_and_each_wrong_answer_gets_its_message(self, name):
        assert len(WRONG[name]) >= 5
        seeds = range(1 if name in LONG else 4)
        for verdict in judge(name, solution(name), seeds):
            assert verdict.passed, verdict
            verdict.require()
        for message, wrong in WRONG[name]:
            for verdict in judge(name, wrong, seeds):
                assert not verdict.passed, message
                assert message in verdict.message

    def test_the_stub_fails_with_no_answer_yet(self, name):
        (verdict,) = judge(
            name, defined(TASKS[name][0], sheets.EXERCISES)[name], [SEED]
        )
        assert not verdict.passed
        assert "no answer yet" in verdict.message
        with pytest.raises(szlib.SzlibError, match="no answer yet"):
            verdict.require()

    def test_the_message_of_each_mistake_has_a_wrong_answer(self, name):
        expected = [message for message, _ in WRONG[name]]
        said = [
            message
            for message in TASKS[name][2].mistakes
            if any(each in message for each in expected)
        ]
        assert len(said) >= min(5, len(TASKS[name][2].mistakes))

    def test_hints_end_before_the_answer(self, name, capsys):
        hints = TASKS[name][2].hints
        assert len(hints) >= 3
        hint(name, len(hints))
        assert hints[-1] in capsys.readouterr().out
        with pytest.raises(szlib.DataError, match=f"hints 1 to {len(hints)}"):
            hint(name, len(hints) + 1)
        sheet = (sheets.SOLUTIONS / f"{TASKS[name][0]}.py").read_text(encoding="utf-8")
        answers = "".join(re.findall(r"BEGIN SOLUTION\n(.*?)### END", sheet, re.DOTALL))
        results = re.findall(r"return (.+)", answers)
        assert not any(
            len(result) > 12 and result in text for result in results for text in hints
        )

    def test_the_sheet_states_the_declared_order_and_time(self, name):
        sheet, number, task = TASKS[name]
        all_cells = cells(sheets.SOLUTIONS / f"{sheet}.py")
        (place,) = [i for i, c in enumerate(all_cells) if f'check("{name}"' in c.source]
        titles = [
            c.source.splitlines()[0]
            for c in all_cells[:place]
            if c.source.startswith("## ")
        ]
        assert titles[number].startswith(f"## {sheet[5]}.{number + 1} ")
        assert titles[number].endswith(f"{task.minutes} min)")


def test_there_are_enough_tasks_for_a_course():
    assert len(TASKS) >= 30
    minutes = [task.minutes for _, _, task in TASKS.values()]
    assert min(minutes) <= 5
    assert max(minutes) >= 120


def test_every_text_belongs_to_a_task():
    assert set(load_texts()) == set(TASKS) == set(WRONG)


def test_each_check_draws_new_cases():
    seeds = [
        re.search(r"seed=(\d+)", check("velocity", lambda *_: 0.0).message)[1]
        for _ in range(2)
    ]
    assert seeds[0] != seeds[1]


def test_the_examples_of_the_judges_hold():
    assert (
        doctest.testmod(judges.client, extraglobs={"__name__": "example"}).failed == 0
    )


# --- invalid answers ---------------------------------------------------------------------------------


def make_task(**options):
    """A task whose correct answer is twice a number."""
    mistakes = {"add": lambda x: x + x + 1}
    given = {"solution": lambda x: 2 * x, "mistakes": mistakes, "unit": "m"} | options
    return Task("double", 1, (), lambda rng: [(3.0,), (4.0,)], **given)


@pytest.mark.parametrize(
    ("answer", "message"),
    [
        (lambda x: None, "does it end with `return`"),
        (lambda x: x[0], r"stopped with TypeError(.|\n)*for x = 3.0"),
        (lambda x: "six", "expected a number; got a str"),
        (lambda x: "6.0", "expected a number; got a str"),
        (lambda x: True, "expected a number; got a boolean"),
        (lambda x: 6 + 0j, "expected a number; got a complex"),
        (lambda x: [[1], [1, 2]], "a list of parts of unequal length"),
        (lambda x: np.full(2, 6.0), r"expected a number; got numbers, shape \(2,\)"),
        (lambda x: np.nan, "expected 6 m, got nan m"),
        (lambda x: 2 * x + 1, r"^add\n    expected 6 m, got 7 m"),
        (lambda x: 6.0, "the same in every case(.|\n)*expected 8 m, got 6 m"),
        (lambda x: 2 * x + 1e-5, r"expected 6 m, got 6.00001 m"),
    ],
)
def test_a_wrong_answer_is_described(answer, message):
    with Answer(pack(answer), (), 20.0) as process:
        verdict = make_task().check(process, 0)
    assert not verdict.passed
    assert re.search(message, verdict.message), verdict.message


def test_each_check_has_a_process_of_its_own():
    """What an answer keeps, or the time that it took, does not reach the next check."""
    source = "seen = []\ndef speed_limit(h, gamma, dt, v):\n    seen.append(h)\n    return len(seen)"
    first, again = (str(verdict) for verdict in judge("speed_limit", source, [1, 1]))
    assert first == again


@pytest.mark.slow
def test_the_time_of_the_judge_is_not_charged_to_the_answer():
    def cases(rng):
        for x in (3.0, 4.0, 5.0):
            time.sleep(0.8)
            yield (x,)

    with Answer(pack(lambda x: 2 * x), (), 2.0) as process:
        assert replace(make_task(), cases=cases).check(process, 0).passed
    with Answer(pack(lambda x: time.sleep(0.9) or 2 * x), (), 2.0) as process:
        verdict = replace(make_task(), cases=lambda _: [(3.0,)] * 3).check(process, 0)
    assert "too slow: the check ends after 2 s" in verdict.message


def test_a_failing_case_can_be_run_again():
    def wrong(points, a, b):
        return np.abs(szlib_free_line(points, a, b))

    verdict = check("wall_distance", wrong)
    seed, number = map(
        int, re.search(r"seed=(\d+), number=(\d+)\)", verdict.message).groups()
    )
    points, a, b = judges.case("wall_distance", seed=seed, number=number)
    shown = re.search(r"\bb = np\.array\(\[([^]]*)\]\)", verdict.message)[1]
    assert [float(each) for each in shown.split(",")] == b.tolist()
    assert not np.allclose(wrong(points, a, b), szlib.segment_distance(points, a, b))
    assert str(check("wall_distance", wrong, seed=seed)) == str(verdict)


@pytest.mark.parametrize("name", TASKS)
def test_a_message_shows_at_most_eight_numbers_of_a_case(name):
    if name in LONG or TASKS[name][2].plot:
        pytest.skip("it has worlds to draw, or takes long")
    (verdict,) = judge(name, lambda *_: None, [SEED])
    shown = verdict.message.partition("\n    for ")[2].partition("\n")[0]
    values = re.sub(r"shape \([^)]*\)|a table of \d+ rows", "", shown)
    assert len(re.findall(r"(?<![\w.])-?\d+\.?\d*(?:e-?\d+)?", values)) <= 8, shown


def szlib_free_line(points, a, b):
    return (
        (points - a)[:, 0] * (b - a)[1] - (points - a)[:, 1] * (b - a)[0]
    ) / np.hypot(*(b - a))


@pytest.mark.slow
def test_an_answer_cannot_read_what_only_the_judge_knows():
    samples, speed = judges.case("my_zone", seed=SEED, number=1)
    assert isinstance(speed, float)
    assert set(samples) >= {"encounter", "los_angle", "distance", "speed"}


def test_an_answer_that_calls_szlib_or_the_judges_is_refused():
    line = judges.sheets.SHEETS["sheet1_tracks"][1].solution
    for answer in (line, lambda *args: line(*args)):
        assert (
            "no answer: this uses judges.tracks"
            in check("line_of_sight", answer).message
        )
    verdict = check("wall_distance", szlib.segment_distance)
    assert "no answer: this uses szlib" in verdict.message


def test_the_quantile_of_the_task_and_its_count_agree_in_every_case():
    """q n is not rounded across a whole number: n = 50 with q = 0.28 gave 14.000000000000002."""
    task = TASKS["quantile_radius"][2]
    for seed in range(200):
        for nearest, q in task.cases(np.random.default_rng(seed)):
            literal = next(r for r in np.sort(nearest) if np.mean(nearest <= r) >= q)
            counted = np.sort(nearest)[math.ceil(q * len(nearest)) - 1]
            assert literal == counted == task.solution(nearest, q), (seed, q)


def test_an_answer_cannot_change_the_case():
    def overwrites(path, k, half):
        right = (path[k + half] - path[k - half]) / (2 * half * 0.1)
        path[:] = 0
        return right

    assert check("velocity", overwrites, seed=SEED).passed


def test_a_value_instead_of_a_function_and_an_unknown_task_are_refused():
    assert "the function itself" in check("velocity", 1.0).message
    with pytest.raises(
        szlib.DataError, match="no task 'speed'; the tasks are velocity"
    ):
        check("speed", lambda: 0)


def test_the_first_wrong_number_of_a_large_array_is_shown():
    verdict = check(
        "in_space", lambda ref, heading, others: np.zeros(len(others), bool), seed=SEED
    )
    assert re.search(
        r"\d+ of 40 numbers are wrong; at \[\d+\] expected True, got False",
        verdict.message,
    )


@pytest.mark.slow
@pytest.mark.parametrize("kind", CHEATS)
def test_no_cheat_passes_and_none_holds_the_judge(kind, monkeypatch):
    """`tests/studies/exercises.py --cheats` does the same in 300 checks of each."""
    assert len(CHEATS[kind]) == 12
    for name, source in CHEATS[kind]:
        task = judges.sheets.TASKS[name]
        slow = name in LONG or kind not in ("concurrency", "exhaustion")
        limited = replace(task, seconds=task.seconds if slow else 1.0)
        monkeypatch.setitem(judges.sheets.TASKS, name, limited)
        start = time.monotonic()
        (verdict,) = judge(name, source, [SEED])
        assert not verdict.passed, source
        assert slow or time.monotonic() - start < 30, source


@pytest.mark.slow
def test_what_a_notebook_does_to_its_judges_changes_nothing(tmp_path):
    """The judges of a check are another process; marks come from the text of a sheet."""
    sheet = tmp_path / "sheet.py"
    sheet.write_text(
        "# %%\nimport judges\njudges.task.compare = lambda *a, **k: ''\n"
        "judges.check = lambda *a, **k: 'passed'\n\n"
        "# %%\ndef velocity(path, k, half):\n    return path[k]\n\n"
        "# %%\ndef speed_limit(h, gamma, dt, v):\n    return gamma * h / dt - v\n\n"
        "# %%\n%matplotlib inline\n",
        encoding="utf-8",
    )
    table = tmp_path / "marks.csv"
    command = [sys.executable, sheets.EXERCISES / "judges", sheet, "--seed", "3"]
    done = subprocess.run(
        [*command, "--out", table], check=True, capture_output=True, text=True
    )
    minutes = TASKS["speed_limit"][2].minutes
    assert f"{sheet}: {minutes} points" in done.stdout
    marks = pd.read_csv(table).set_index("task")["points"].to_dict()
    tasks = [*SHEETS["sheet1_tracks"], *SHEETS["sheet4_own_zone"]]
    expected = dict.fromkeys((task.name for task in tasks), 0)
    assert marks == expected | {"speed_limit": minutes}


@pytest.mark.slow
def test_the_command_that_marks_gives_a_solved_sheet_all_its_points():
    """Its first cell imports Matplotlib, as those of most sheets do; all its functions are the solutions."""
    sheet = folders.NOTEBOOKS / "solutions" / "sheet1_tracks.ipynb"
    command = [sys.executable, sheets.EXERCISES / "judges", sheet, "--seed", "1"]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    points = sum(task.minutes for task in SHEETS["sheet1_tracks"])
    assert f"{sheet}: {points} points" in done.stdout
    assert "import matplotlib" in sheet.read_text(encoding="utf-8")


def solved_sheet(file, edit):
    """Write the solved sheet 1 with its cells edited, and return its path."""
    notebook = jupytext.read(sheets.SOLUTIONS / "sheet1_tracks.ipynb")
    edit(notebook.cells)
    jupytext.write(notebook, file)
    return file


def test_what_a_sheet_does_beside_its_answers_costs_no_points(tmp_path):
    def edit(sheet):
        for cell in sheet:
            if cell.source.startswith("import judges\n"):
                cell.source = "%matplotlib inline\n" + cell.source
            if cell.source.startswith("def velocity"):
                cell.source = "%%time\n" + cell.source
            if cell.source.startswith("def line_of_sight"):
                cell.source = "%precision 3\n" + cell.source
            if cell.source.startswith("def one_hertz"):
                cell.source = (
                    "one_hertz = lambda radius, speed, interval: "
                    "radius * (1 - np.cos(speed * interval / radius / 2))"
                )
        for source in (
            "plt.plot([0, 1])\nplt.savefig('mine.png')",
            "import pandas as pd\ntracks = pd.read_csv('tracks.csv')",
            "import time\ntime.sleep(25)",
            "path = pd.read_csv('path.csv')  # the name of an argument",
            "n = " + " + ".join(["1"] * 6000),
            "nonlocal n",
            "import os\nos._exit(0)",
        ):
            sheet.append(nbformat.v4.new_code_cell(source))

    rows = marking.mark_sheet(solved_sheet(tmp_path / "sheet.ipynb", edit), 1)
    expected = {task.name: task.minutes for task in SHEETS["sheet1_tracks"]}
    assert {row["task"]: row["points"] for row in rows} == expected, rows


def test_each_task_of_a_sheet_has_a_row_with_the_reason(tmp_path):
    def edit(sheet):
        for cell in sheet:
            if cell.source.startswith("def velocity"):
                cell.source = "def velocity(path, k, half)\n    return 0"
            if cell.source.startswith("def line_of_sight"):
                cell.source = "line_of_sight = 3.0"
            if cell.source.startswith("def in_space"):
                cell.source = "in_space = unknown(3)"

    rows = marking.mark_sheet(solved_sheet(tmp_path / "sheet.ipynb", edit), 1)
    said = {row["task"]: row["message"] for row in rows}
    assert re.search(
        r"the sheet defines no velocity; cell \d+ is left out: .*line 1",
        said["velocity"],
    )
    assert "line_of_sight is a float; expected a function" in said["line_of_sight"]
    assert "name 'unknown' is not defined" in said["in_space"]
    assert "correct" in said["one_hertz"]
    assert [bool(row["points"]) for row in rows] == [False, False, False, True]


@pytest.mark.parametrize(
    ("before", "value"),
    [
        ("one = 1.0", "one"),
        ("import numpy\nfrom math import *\none = numpy.exp(0) * cos(0)", "one"),
        ("from math import *", "cos(0)"),
        ("ones = []\nfor i in range(3):\n    ones.append(1.0)", "ones[2]"),
        ("ones = {}\nones['a'] = 0.0\nones['a'] += 1", "ones['a']"),
        ("def own():\n    return Two().half\nclass Two:\n    half = 2 / 2", "own()"),
        ("try:\n    from none import one\nexcept ImportError:\n    one = 1.0", "one"),
    ],
)
def test_an_answer_has_the_names_of_the_sheet_that_it_uses(before, value):
    source = (
        f"def speed_limit(h, gamma, dt, v):\n    return {value} * gamma * h / dt - v"
    )
    (verdict,) = judge("speed_limit", f"{before}\n{source}", [SEED])
    assert verdict.passed, verdict


def test_a_file_that_an_answer_needs_is_not_read():
    source = "text = open('one.txt').read()\ndef speed_limit(*_):\n    return len(text)"
    (verdict,) = judge("speed_limit", source, [SEED])
    assert "reads a file" in verdict.message


def run_marks(*arguments):
    command = [sys.executable, sheets.EXERCISES / "judges", *arguments]
    return subprocess.run(command, capture_output=True, text=True)


def test_files_that_cannot_be_marked_have_a_row_and_stop_no_other(tmp_path):
    sources = {
        "a_conflict.ipynb": b"<<<<<<< HEAD",
        "b_latin.py": "# %%\ngröße = 1".encode("latin-1"),
        "c_empty.ipynb": b"",
        "d_letter.txt": b"Dear professor",
        "e_other.py": b"x = 1",
        "f_answer.py": b"def speed_limit(h, gamma, dt, v):\n    return gamma * h / dt - v",
    }
    for name, source in sources.items():
        (tmp_path / name).write_bytes(source)
    table = tmp_path / "marks.csv"
    done = run_marks(*sorted(tmp_path.iterdir()), "--seed", "1", "--out", table)
    assert done.returncode == 0, done.stderr
    marks = pd.read_csv(table)
    said = marks[marks["task"].isna()].set_index("file")["message"]
    assert [Path(name).name for name in said.index] == list(sources)[:-1]
    assert said.str.startswith("not marked: ").all()
    for reason, message in zip(
        ("NotJSONError", "UnicodeDecodeError", "NotJSONError", "", "no task"),
        said,
        strict=True,
    ):
        assert reason in message and message[12:] in done.stdout
    solved = marks.set_index("task").loc["speed_limit"]
    assert solved["points"] == solved["of"] == TASKS["speed_limit"][2].minutes


def test_an_interruption_keeps_the_rows_of_the_sheets_before(tmp_path, monkeypatch):
    def mark(file, seed):
        if file.name == "second.py":
            raise KeyboardInterrupt
        row = dict.fromkeys(marking.COLUMNS, "") | {"file": file, "points": 5}
        return [row]

    monkeypatch.setattr(marking, "mark_sheet", mark)
    table = tmp_path / "marks.csv"
    with pytest.raises(
        SystemExit, match=r"interrupted: second\.py and the files after"
    ):
        marking.mark_sheets([Path("first.py"), Path("second.py")], 1, table)
    assert pd.read_csv(table)["file"].tolist() == ["first.py"]


def test_the_command_that_marks_names_a_sheet_that_is_missing(tmp_path):
    done = run_marks(tmp_path / "none.ipynb")
    assert done.returncode == 2 and "none.ipynb: no such file" in done.stderr
    done = run_marks(Path(__file__), "--out", tmp_path / "none" / "marks.csv")
    assert done.returncode == 2 and "none: no such folder" in done.stderr


# --- the closed loop ---------------------------------------------------------------------------------


def test_a_world_that_fails_says_when_and_is_drawn():
    def careless(x, wish, *_):
        return min(wish, 1.0)

    verdict = check("filter_1d", careless, seed=SEED)
    assert re.search(
        r"after \d+\.\d s h = -0\.\d+ m: the robot is too near to a person",
        verdict.message,
    )
    number = int(
        re.search(rf"filter_1d, seed={SEED}, number=(\d)\)", verdict.message)[1]
    )
    judges.plot("filter_1d", careless, seed=SEED, number=number)
    h = plt.gcf().axes[1].lines[0].get_ydata()
    assert h[-1] < 0 <= h[-2]
    judges.plot("mpc_cbf_2d", solution("mpc_cbf_2d"), seed=SEED, number=2)
    assert plt.gcf().axes[1].lines[0].get_ydata().min() >= 0
    with pytest.raises(szlib.DataError, match="velocity has no worlds"):
        judges.plot("velocity", solution("velocity"), seed=SEED, number=1)


@pytest.mark.parametrize(
    ("name", "answer", "message"),
    [
        ("filter_1d", lambda *_: 5.0, "after 0.0 s the input is"),
        ("filter_1d", lambda x, *_: np.nan, "after 0.0 s the input is"),
        ("filter_1d", lambda x, *_: 1e-3 * np.sin(x), "it does not arrive in time"),
        ("mpc_1d", lambda *_: np.zeros(3), r"expected numbers, shape \(15,\)"),
    ],
)
def test_what_a_closed_loop_violates_is_said(name, answer, message):
    assert re.search(message, check(name, answer, seed=SEED).message)


# --- the sheets --------------------------------------------------------------------------------------


@pytest.mark.parametrize("sheet", SHEETS)
class TestSheet:
    def test_the_exercise_is_generated_from_the_solutions(self, sheet):
        solutions = (sheets.SOLUTIONS / f"{sheet}.py").read_text(encoding="utf-8")
        exercise = (sheets.EXERCISES / f"{sheet}.py").read_text(encoding="utf-8")
        assert exercise == sheets.make_exercise(solutions)
        assert "SOLUTION" not in exercise
        assert exercise.count("raise NotImplementedError()") == len(SHEETS[sheet])
        assert exercise.count("# YOUR ANSWER HERE") == 1
        assert "Rubric" not in exercise

    @pytest.mark.parametrize(
        "folder", [sheets.SOLUTIONS, sheets.EXERCISES], ids=lambda f: f.name
    )
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
        assert [line.split(" - ")[0] for line in outputs] == ["passed"] * len(
            SHEETS[sheet]
        )

    def test_the_sheet_runs_before_it_is_answered(self, sheet, monkeypatch):
        monkeypatch.setattr(plt, "show", lambda: plt.close("all"))
        found = {}
        for cell in cells(sheets.EXERCISES / f"{sheet}.py"):
            if cell.cell_type == "code" and not cell.source.startswith("judges.check"):
                exec(cell.source, found)

    def test_each_check_of_a_class_is_graded_and_locked(self, sheet):
        solutions = (sheets.SOLUTIONS / f"{sheet}.py").read_text(encoding="utf-8")
        points = {task.name: task.minutes for task in SHEETS[sheet]}
        marked = [
            c
            for c in sheets.make_graded(solutions, points).cells
            if "nbgrader" in c.metadata
        ]
        assert len(marked) == 2 * len(points) + 1
        essay = marked.pop()
        assert essay.metadata["nbgrader"]["points"] == judges.ESSAY_MINUTES
        assert (
            sum(map(int, re.findall(r"^\| (\d+) \|", essay.source, re.MULTILINE)))
            == judges.ESSAY_MINUTES
        )
        for answer, test in zip(marked[::2], marked[1::2], strict=True):
            assert "### BEGIN SOLUTION" in answer.source
            assert answer.metadata["nbgrader"]["solution"]
            assert test.source.endswith(".require()")
            assert test.metadata["nbgrader"]["locked"]
            assert test.metadata["nbgrader"]["points"] in points.values()

    def test_nbgrader_makes_the_same_stubs(self, sheet):
        preprocessors = pytest.importorskip(
            "nbgrader.preprocessors", reason="nbgrader is not installed"
        )
        solutions = (sheets.SOLUTIONS / f"{sheet}.py").read_text(encoding="utf-8")
        source = sheets.make_graded(
            solutions, {task.name: task.minutes for task in SHEETS[sheet]}
        )
        released = preprocessors.ClearSolutions().preprocess(source, {})[0].cells
        expected = [
            sheets.remove_local_links(cell.source)
            for cell in cells(sheets.EXERCISES / f"{sheet}.py")
        ]
        assert [cell.source.removesuffix(".require()") for cell in released] == expected

    def test_the_sheet_of_a_class_has_no_link_to_a_file(self, sheet):
        """Its students have neither the chapters nor the solutions beside it."""
        solutions = (sheets.SOLUTIONS / f"{sheet}.py").read_text(encoding="utf-8")
        points = {task.name: task.minutes for task in SHEETS[sheet]}
        released = sheets.make_graded(solutions, points).cells
        texts = [c.source for c in released if c.cell_type == "markdown"]
        links = re.findall(r"\]\(([^)]*)\)", "\n".join(texts))
        assert [link for link in links if not link.startswith("http")] == []
        assert not any("solved" in text or "Start" in text for text in texts[:2])
        assert re.fullmatch(r"\d h \d\d min · chapters: \d\d(,\s\d\d)*", texts[1])


def test_a_class_without_nbgrader_is_refused_before_anything_is_written(
    tmp_path, monkeypatch
):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    folder = tmp_path / "course"
    with pytest.raises(SystemExit, match="run `pip install nbgrader`"):
        sheets.make_course(folder)
    assert not folder.exists()


def test_nbgrader_finds_the_programs_beside_its_python(tmp_path, monkeypatch):
    """It starts alembic by name, which failed where the environment was not activated."""
    calls = []
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: sheets)
    monkeypatch.setattr(subprocess, "run", lambda *_, **options: calls.append(options))
    sheets.make_course(tmp_path)
    assert len(calls) == len(SHEETS)
    for options in calls:
        first = options["env"]["PATH"].split(os.pathsep)[0]
        assert first == str(Path(sys.executable).parent)
