"""Make the exercise sheets from their solutions; for a class, make a course of nbgrader.

    python notebooks/tools/sheets.py                 exercises/, and the executed copies of solutions/
    python notebooks/tools/sheets.py --text          the same where only text has changed: nothing is executed
    python notebooks/tools/sheets.py --class FOLDER  a course of nbgrader, its sheets ready to be handed out

The solutions are the source.  What stands between `### BEGIN SOLUTION` and `### END SOLUTION` becomes the
stub that nbgrader makes of it, and cells that begin with "**Solution.**" are left out.  nbgrader is not among
the packages of the workbook: `pip install nbgrader` first.
"""

import argparse
import re
import subprocess
import sys
from pathlib import Path

import jupytext
import nbformat
from nbclient import NotebookClient

HERE = Path(__file__).parents[1]
SOLUTIONS, EXERCISES = HERE / "solutions", HERE / "exercises"
SOLVED = re.compile(r"^( *)### BEGIN SOLUTION\n.*?### END SOLUTION$", re.DOTALL | re.MULTILINE)
STUB = r"\1# YOUR CODE HERE\n\1raise NotImplementedError()"
REMARK = re.compile(r"\n# %% \[markdown\]\n# \*\*Solution\.\*\*.*(?:\n#.*)*\n")
CHECK = re.compile(r'^exercises\.check\("(\w+)", \w+\)$')
CONFIG = """c = get_config()
c.CourseDirectory.course_id = "szlib"
c.ExecutePreprocessor.timeout = 120
"""


def exercise_of(solutions: str) -> str:
    """The sheet, a percent script, without its solutions."""
    return SOLVED.sub(STUB, REMARK.sub("", solutions))


def graded(solutions: str, points: dict[str, int]) -> nbformat.NotebookNode:
    """The sheet as a source of nbgrader: answers are cleared, checks give the points of their task."""
    sheet = jupytext.reads(REMARK.sub("", solutions), fmt="py:percent")
    for cell, after in zip(sheet.cells, [*sheet.cells[1:], None], strict=True):
        if after is not None and (asked := CHECK.match(after.source)):
            cell.metadata["nbgrader"] = _marked(f"{asked[1]}-answer", solution=True)
        if asked := CHECK.match(cell.source):
            mark = _marked(f"{asked[1]}-check", grade=True)
            cell.metadata["nbgrader"] = mark | {"points": points[asked[1]]}
            cell.source += ".require()"
    return sheet


def _marked(name: str, *, solution: bool = False, grade: bool = False) -> dict[str, object]:
    mark = {"schema_version": 3, "grade_id": name, "solution": solution, "grade": grade, "locked": grade}
    return mark | {"task": False}


def make_sheets(*, text_only: bool = False) -> None:
    """Write the exercises, and the executed copies of the solutions; `text_only` keeps what was executed."""
    for source in sorted(SOLUTIONS.glob("*.py")):
        print(source.stem, flush=True)
        text = source.read_text(encoding="utf-8")
        exercise = EXERCISES / source.name
        exercise.write_text(exercise_of(text), encoding="utf-8")
        sheet, solved = (jupytext.reads(each, fmt="py:percent") for each in (exercise_of(text), text))
        jupytext.write(_kept(sheet, exercise) or sheet, exercise.with_suffix(".ipynb"))
        kept = _kept(solved, source) if text_only else None
        if kept is None:
            quiet = {"record_timing": False, "extra_arguments": ["--log-level=CRITICAL"]}
            NotebookClient(solved, kernel_name="python3", **quiet).execute(cwd=str(SOLUTIONS))
        jupytext.write(kept or solved, source.with_suffix(".ipynb"))


def _kept(new: nbformat.NotebookNode, script: Path) -> nbformat.NotebookNode | None:
    """The copy beside a script with the new text; None where its code is another, or there is none."""
    if not (file := script.with_suffix(".ipynb")).exists():
        return None
    copy = nbformat.read(file, as_version=4)
    code = [[c.source for c in each.cells if c.cell_type == "code"] for each in (copy, new)]
    if code[0] != code[1] or len(copy.cells) != len(new.cells):
        return None
    for cell, renewed in zip(copy.cells, new.cells, strict=True):
        cell.source = renewed.source
    return copy


def make_course(folder: Path) -> None:
    """Write a course of nbgrader; nbgrader makes of it what is handed out, `release/`."""
    from szlib.workbook.exercises import SHEETS

    for name, tasks in SHEETS.items():
        place = folder / "source" / name
        place.mkdir(parents=True, exist_ok=True)
        text = (SOLUTIONS / f"{name}.py").read_text(encoding="utf-8")
        sheet = graded(text, {task.name: task.minutes for task in tasks})
        jupytext.write(sheet, place / f"{name}.ipynb")
    (folder / "nbgrader_config.py").write_text(CONFIG, encoding="utf-8")
    for name in SHEETS:
        command = ["-m", "nbgrader", "generate_assignment", name, "--create", "--force"]
        subprocess.run([sys.executable, *command], cwd=folder, check=True)
    print(f"{folder / 'release'} is ready to be handed out; graded is with `nbgrader autograde` in {folder}")


if __name__ == "__main__":
    asked = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    asked.add_argument("--class", dest="folder", type=Path, help="folder of the course")
    asked.add_argument("--text", action="store_true", help="only text has changed: execute nothing")
    given = asked.parse_args()
    make_course(given.folder) if given.folder else make_sheets(text_only=given.text)
