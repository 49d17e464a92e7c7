"""One deliberate regression for each committed table: does `szlib run` fail, and because of this table?

    python tests/studies/regressions.py                all tables (half an hour on one core)
    python tests/studies/regressions.py 29_crowds ...  some of them

A regression is a change of one line in a copy of szlib.  The notebook that reads the table is executed there
into a temporary folder.  It must end with an exit code other than 0, and the check that computes a row of
the table again must have failed.  Tables of one notebook with the same regression share a run.
"""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

ROOT = Path(__file__).parents[2]
TABLES = ROOT / "notebooks" / "tables"
BARRIER = (
    "control/problem.py",
    "tuple((1 - s.gamma) ** m",
    "tuple((1 - 2 * s.gamma) ** m",
)
HULL = (
    "zones/hulls.py",
    "(self.r_max - self.reach(theta))",
    "(self.r_max - 0.95 * self.reach(theta))",
)
PATHS = "zones/outliers.py", "_DEGREE = 2  #", "_DEGREE = 1  #"
LEVEL = "zones/uncertainty.py", "LEVEL = 0.95  #", "LEVEL = 0.8  #"
RESPECT = (
    "zones/respect_test.py",
    "at, most = every.flat[best], every",
    "at, most = 0.9 * every.flat[best], every",
)
STANDING = "../notebooks/studies/quality.py", "\nSTANDING = 0.1\n", "\nSTANDING = 0.2\n"
DEFAULT = {"03": HULL, "24": STANDING, "06": RESPECT, "25": PATHS}
"""The regression for the tables of a notebook; that of the others is `BARRIER`."""
OWN = dict.fromkeys(("25_estimators", "25_sensitivity", "25_subsets"), HULL)
OWN |= dict.fromkeys(("25_coverage", "25_coverage_hull", "25_imposed"), LEVEL)
CHECKS = {"27_atlas": "runs driven anew have the same least h, to a millimetre"}
"""The check of a table, if its row is not computed again by `NotebookRecord.committed_table`."""
RUN = "import sys; from szlib.workbook.cli import main; sys.exit(main(sys.argv[1:]))"


def choose_regression(table: str) -> tuple[str, str, str]:
    """File in szlib, text, and the text that replaces it."""
    return OWN.get(table, DEFAULT.get(table[:2], BARRIER))


def run_with(regression: tuple[str, str, str], notebook: str) -> tuple[int, list[str]]:
    """Exit code of a run of this notebook in a copy with the regression, and the checks that failed."""
    with TemporaryDirectory() as folder:
        copy, out = Path(folder) / "copy", Path(folder) / "results"
        for part in ("szlib", "notebooks"):
            ignored = shutil.ignore_patterns("*.ipynb", "__pycache__")
            shutil.copytree(ROOT / part, copy / part, ignore=ignored)
        file, text, change = regression
        code = (copy / "szlib" / file).read_text(encoding="utf-8")
        if code.count(text) != 1:
            raise SystemExit(
                f"{file}: expected {text!r} once; found it {code.count(text)} times"
            )
        (copy / "szlib" / file).write_text(code.replace(text, change), encoding="utf-8")
        command = [
            sys.executable,
            "-c",
            RUN,
            "run",
            "--only",
            notebook,
            "--out",
            str(out),
        ]
        done = subprocess.run(
            command,
            cwd=copy,
            env={**os.environ, "PYTHONPATH": str(copy)},
            capture_output=True,
            check=False,
        )
        records = list(out.glob(f"*/records/{notebook}_*.json"))
        checks = [
            each
            for record in records
            for each in json.loads(record.read_text())["checks"]
        ]
    return done.returncode, [
        c["name"] for c in checks if c["kind"] == "check" and not c["passed"]
    ]


def main(asked: list[str]) -> int:
    tables = asked or [file.stem for file in TABLES.glob("*.csv")]
    runs, shown = {}, []
    for name in sorted(tables):
        runs.setdefault((name[:2], choose_regression(name)), []).append(name)
    for (notebook, regression), names in runs.items():
        code, failed = run_with(regression, notebook)
        for name in names:
            check = CHECKS.get(name, f"tables/{name}.csv is reproduced")
            shown.append(code != 0 and any(each.endswith(check) for each in failed))
            result = "fails" if shown[-1] else "DOES NOT FAIL"
            print(f"{name:20} {regression[0]:20} exit {code}: {result}", flush=True)
    print(f"{sum(shown)} of {len(shown)} tables make the run fail")
    return 0 if all(shown) else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
