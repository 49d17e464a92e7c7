"""Make the exercise sheets from their solutions, or a course of nbgrader for a class.

    python notebooks/tools/sheets.py                 write exercises/, and execute the copies of solutions/
    python notebooks/tools/sheets.py --text          the same if only text has changed: execute nothing
    python notebooks/tools/sheets.py --class FOLDER  make a course of nbgrader with its sheets

The exercises are made from the solutions. The code between `### BEGIN SOLUTION` and `### END SOLUTION` is
replaced by the stub of nbgrader, a cell that begins with "**Rubric**" by a place for the essay, and cells
that begin with "**Solution.**" are left out. The sheets of a class have no links to other files of szlib, which its
students need not have. nbgrader is not among the packages of the workbook: `pip install nbgrader` first.
"""

import argparse
import importlib.util
import os
import re
import shutil
import subprocess
import sys
from itertools import chain
from pathlib import Path

import jupytext
import nbformat
from nbclient import NotebookClient

HERE = Path(__file__).parents[1]
SOLUTIONS, EXERCISES = HERE / "solutions", HERE / "exercises"
sys.path.append(str(EXERCISES))  # the judges
JUDGES, UNNEEDED = EXERCISES / "judges", shutil.ignore_patterns("__pycache__")
SOLVED = re.compile(r"^( *)### BEGIN SOLUTION\n.*?### END SOLUTION$", re.DOTALL | re.MULTILINE)
STUB = r"\1# YOUR CODE HERE\n\1raise NotImplementedError()"
REMARK = re.compile(
    r"\n# %% \[markdown\]\n# \*\*Solution\.\*\*.*(?:\n#.*)*\n"
    r"|\n# %%\n# Solution: (?:.*\n)*?(?=\n# %%)"
)
RUBRIC = re.compile(r"^# \*\*Rubric\*\*.*(?:\n#.*)*", re.MULTILINE)
CHECK = re.compile(r'^judges\.check\("(\w+)", \w+\)$')
LOCAL_LINK = re.compile(r"\[([^]]*)\]\((?!https?:)[^)]*\)")
NAVIGATION = re.compile(r"^\[Start\].*\[solved\]\([^)]*\)\s·\s(.*?)\sbelongs\sto\s", re.DOTALL)
CONFIG = """c = get_config()
c.CourseDirectory.course_id = "szlib"
c.ExecutePreprocessor.timeout = 120
"""
LECTURER = """# A course of szlib

Run these commands in this folder; students need szlib, lecturers szlib and nbgrader.

1. Hand out `release/SHEET`: the sheet, and the folder `judges`, which must stay beside it.
2. Put what a student hands in into `submitted/STUDENT/SHEET/SHEET.ipynb`.
3. `nbgrader autograde SHEET` runs each submission with your `judges`, not with the student's.
4. `nbgrader export --to grades.csv` writes the points: one a minute of each task that passes.
5. Grade the essay of each sheet by its rubric: `nbgrader formgrader` in JupyterLab shows it beside the answer.
6. For marks that count: `python JUDGES submitted/*/*/*.ipynb --out marks.csv`, with your folder `judges`. It takes the
   functions from the text of the sheets, with the imports, definitions and constants that they use. What a sheet does
   to its own judges has no effect, and experiments cost no points. Each task has a row, with the reason for no points;
   so has a file that cannot be read.
7. `nbgrader generate_feedback SHEET` writes `feedback/STUDENT/SHEET/SHEET.html`.
"""


def make_exercise(solutions: str) -> str:
    """Remove the answers from the percent script `solutions`, and return the exercise sheet."""
    return RUBRIC.sub("# YOUR ANSWER HERE", SOLVED.sub(STUB, REMARK.sub("", solutions)))


def make_graded(solutions: str, points: dict[str, int]) -> nbformat.NotebookNode:
    """Make the source of nbgrader for a sheet: answers are cleared, checks give the `points` of their task."""
    from judges import ESSAY_MINUTES

    sheet = jupytext.reads(REMARK.sub("", solutions), fmt="py:percent")
    for cell in sheet.cells:
        if cell.cell_type == "markdown":
            cell.source = remove_local_links(cell.source)
    for cell, after in zip(sheet.cells, [*sheet.cells[1:], None], strict=True):
        if after is not None and (task := CHECK.match(after.source)):
            cell.metadata["nbgrader"] = _nbgrader_metadata(f"{task[1]}-answer", solution=True)
        if task := CHECK.match(cell.source):
            mark = _nbgrader_metadata(f"{task[1]}-check", grade=True)
            cell.metadata["nbgrader"] = mark | {"points": points[task[1]]}
            cell.source += ".require()"
        if cell.source.startswith("**Rubric**"):
            mark = _nbgrader_metadata("essay", solution=True, grade=True)
            cell.metadata["nbgrader"] = mark | {"points": ESSAY_MINUTES, "locked": False}
    return sheet


def remove_local_links(text: str) -> str:
    """The text of a cell without links to files; of a navigation cell, the time and the chapters remain."""
    return LOCAL_LINK.sub(r"\1", NAVIGATION.sub(r"\1 chapters: ", text))


def _nbgrader_metadata(name: str, *, solution: bool = False, grade: bool = False) -> dict[str, object]:
    mark = {"schema_version": 3, "grade_id": name, "solution": solution, "grade": grade, "locked": grade}
    return mark | {"task": False}


def make_sheets(*, text_only: bool = False) -> None:
    """Write the exercises, and the executed copies of the solutions; `text_only`: execute nothing again."""
    for source in sorted(SOLUTIONS.glob("*.py")):
        print(source.stem, flush=True)
        text = source.read_text(encoding="utf-8")
        exercise = EXERCISES / source.name
        exercise.write_text(make_exercise(text), encoding="utf-8")
        sheet, solved = (jupytext.reads(each, fmt="py:percent") for each in (make_exercise(text), text))
        for number, cell in chain(enumerate(sheet.cells), enumerate(solved.cells)):
            cell.id = f"{source.stem[:6]}-{number}"  # the same identifiers at every execution
        jupytext.write(_copy_with_text(sheet, exercise) or sheet, exercise.with_suffix(".ipynb"))
        copy = _copy_with_text(solved, source) if text_only else None
        if copy is None:
            quiet = {"record_timing": False, "extra_arguments": ["--log-level=CRITICAL"]}
            NotebookClient(solved, kernel_name="python3", **quiet).execute(cwd=str(SOLUTIONS))
        jupytext.write(copy or solved, source.with_suffix(".ipynb"))


def _copy_with_text(new: nbformat.NotebookNode, script: Path) -> nbformat.NotebookNode | None:
    """The executed copy of `script` with the text of `new`; None if there is no copy with the same code."""
    if not (file := script.with_suffix(".ipynb")).exists():
        return None
    copy = nbformat.read(file, as_version=4)
    code = [[c.source for c in each.cells if c.cell_type == "code"] for each in (copy, new)]
    if code[0] != code[1] or len(copy.cells) != len(new.cells):
        return None
    for cell, new_cell in zip(copy.cells, new.cells, strict=True):
        cell.source = new_cell.source
    return copy


def make_course(folder: Path) -> None:
    """Write a course of nbgrader into `folder`; nbgrader then makes the sheets for students, `release/`."""
    from judges import SHEETS

    if importlib.util.find_spec("nbgrader") is None:
        raise SystemExit(
            "nbgrader is not installed; run `pip install nbgrader` in the environment of szlib first"
        )
    for name, tasks in SHEETS.items():
        place = folder / "source" / name
        place.mkdir(parents=True, exist_ok=True)
        text = (SOLUTIONS / f"{name}.py").read_text(encoding="utf-8")
        sheet = make_graded(text, {task.name: task.minutes for task in tasks})
        jupytext.write(sheet, place / f"{name}.ipynb")
        shutil.copytree(JUDGES, place / "judges", dirs_exist_ok=True, ignore=UNNEEDED)
    (folder / "nbgrader_config.py").write_text(CONFIG, encoding="utf-8")
    programs = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    for name in SHEETS:
        command = ["-m", "nbgrader", "generate_assignment", name, "--create", "--force"]
        where = {"cwd": folder, "env": os.environ | {"PATH": programs}}  # nbgrader starts alembic by its name
        subprocess.run([sys.executable, *command], check=True, **where)
    (folder / "README.md").write_text(LECTURER, encoding="utf-8")
    print(
        f"{folder / 'release'} holds the sheets for students; {folder / 'README.md'} says how to grade them"
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--class", dest="folder", type=Path, help="folder of the course")
    parser.add_argument("--text", action="store_true", help="only text has changed: execute nothing")
    options = parser.parse_args()
    make_course(options.folder) if options.folder else make_sheets(text_only=options.text)
