"""The judges as a program: mark sheets that were handed in, without running them.

    python notebooks/exercises/judges FILE.ipynb ... [--seed 7] [--out marks.csv]

Each function of a sheet is taken from the text of its cells, with the imports, definitions and constants that it
uses, and runs in a process of its own. Nothing that the sheet does to its own judges counts, and no experiment in
it costs points. `serve` in place of the files answers the checks of a notebook.
"""

from __future__ import annotations

import argparse
import ast
import csv
import json
import os
import re
import secrets
import symtable
import sys
from pathlib import Path

if __name__ == "__main__":
    sys.path[0] = str(Path(__file__).resolve().parents[1])

COLUMNS = ("file", "sheet", "task", "points", "of", "message")


def read_source(file: Path) -> tuple[str, list[str]]:
    """The code of a sheet, its cells one after the other, and what is wrong with the cells that are left out."""
    import jupytext

    sources, faults = [], []
    for number, cell in enumerate(jupytext.read(file).cells, 1):
        if cell.cell_type == "code":
            try:
                source = translate_magics(cell.source)
                symtable.symtable(ast.unparse(ast.parse(source, "cell")), "cell", "exec")
            except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
                faults.append(f"cell {number} is left out: {error}")
            else:
                sources.append(source)
    return "\n\n".join(sources), faults


def translate_magics(source: str) -> str:
    """The Python of a cell of IPython, without magics of the whole cell, such as `%%time`."""
    from IPython.core.inputtransformer2 import TransformerManager

    while source.lstrip().startswith("%%"):
        source = source.lstrip().partition("\n")[2]
    return TransformerManager().transform_cell(source)  # type: ignore[no-untyped-call]


def find_sheets(source: str) -> list[str]:
    """The sheets whose tasks the code checks; without checks, those whose functions it defines."""
    from judges.sheets import SHEETS

    for pattern in (r"\bcheck\(\s*[\"'](\w+)", r"^def (\w+)\("):
        names = set(re.findall(pattern, source, re.MULTILINE))
        if found := [sheet for sheet, tasks in SHEETS.items() if names & {task.name for task in tasks}]:
            return found
    return []


def mark_sheet(file: Path, seed: int) -> list[dict[str, object]]:
    """A row for each task of the sheet: its points, and what the judge says."""
    from judges.sheets import SHEETS, judge

    source, faults = read_source(file)
    rows = []
    for sheet in find_sheets(source):
        for task in SHEETS[sheet]:
            verdict = judge(task.name, {"source": source, "name": task.name}, seed)
            points = task.minutes if verdict.passed else 0
            message = " ".join(verdict.message.split())[:300]
            if not verdict.passed:
                message = "; ".join([message, *faults])
            values = (str(file), sheet, task.name, points, task.minutes, message)
            rows.append(dict(zip(COLUMNS, values, strict=True)))
    if not rows:
        expected = "expected `judges.check(...)` or a function of a task"
        raise ValueError("; ".join([f"no task of a sheet is found; {expected}", *faults]))
    return rows


def mark_sheets(files: list[Path], seed: int, out: Path) -> None:
    """Mark the sheets, print the marks, and write them to a table, which is complete after each sheet."""
    from judges.answers import end_programs

    with out.open("w", newline="", encoding="utf-8") as table:
        writer = csv.DictWriter(table, COLUMNS)
        writer.writeheader()
        for file in files:
            try:
                rows = mark_sheet(file, seed)
            except Exception as error:  # one file that cannot be marked must not stop the others
                reason = " ".join(f"not marked: {type(error).__name__}: {error}".split())[:300]
                rows = [dict(zip(COLUMNS, (str(file), "", "", 0, 0, reason), strict=True))]
            except KeyboardInterrupt:
                raise SystemExit(f"interrupted: {file} and the files after it are not marked") from None
            finally:
                end_programs()  # nothing of a student's answers is there when those of the next one run
            writer.writerows(rows)
            table.flush()
            print(f"{file}: {sum(int(str(row['points'])) for row in rows)} points")
            for row in rows:
                text = ": ".join(str(row[column]) for column in ("task", "message") if row[column])
                print(f"    {row['points']:>3} of {row['of']:>3}  {text}", flush=True)


def serve() -> None:
    """Answer the checks of a notebook, a line of JSON each."""
    from judges.sheets import judge
    from szlib.core.errors import SzlibError

    for line in sys.stdin:
        question = json.loads(line)
        try:
            verdict = judge(question["name"], question["answer"], int(question["seed"]))
            reply = {"passed": verdict.passed, "message": verdict.message}
        except SzlibError as error:
            reply = {"error": str(error)}
        print(json.dumps(reply), flush=True)


def main() -> None:
    """Serve, or mark the sheets of the command line."""
    if sys.argv[1:] == ["serve"]:
        serve()
        return
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("files", nargs="+", type=Path, help="sheets, .ipynb or .py")
    parser.add_argument("--seed", type=int, default=secrets.randbelow(10**6), help="default: a new one")
    parser.add_argument("--out", type=Path, help="write a table (CSV)")
    given = parser.parse_args()
    for file in given.files:
        if not file.is_file():
            parser.error(f"{file}: no such file; expected a sheet, .ipynb or .py")
    if given.out and not given.out.parent.is_dir():
        parser.error(f"{given.out.parent}: no such folder; make it first")
    mark_sheets(given.files, given.seed, given.out or Path(os.devnull))
    print(f"--seed {given.seed} draws the same cases again")


if __name__ == "__main__":
    main()
