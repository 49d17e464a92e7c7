"""The share of mutants that the tests kill, estimated from a random sample.

    python tests/studies/mutants.py cover             find which tests reach which lines (once, half an hour)
    python tests/studies/mutants.py run 300           draw mutants, and run tests on each
    python tests/studies/mutants.py again tests/...   run these tests on the mutants that live, if not judged
    python tests/studies/mutants.py table             killed share by module, with Wilson's 95 % intervals

A mutant is the code with one small change (an operator, a number, a condition), made by cosmic-ray.  First a
place is drawn, then one of the changes there; each module gives its share of all places.  Annotations,
`__repr__`, errors and warnings are left alone; texts are never changed.  The tests that reach the statement
are run, and others of their files, the quickest of them up to --seconds in all.  A mutant is killed if a test
fails, or if the tests take more than ten times as long.  The first trial of a run is the unchanged code.

Outcomes are added to outcomes.csv.  Its column `judgement` is written by hand: a mutant that lives may be
"equivalent", or change "speed" or a "message" only, with the reason; it is then not counted.

Needs, beyond the lock: cosmic-ray 8.7 and pytest-cov 7.1.
"""

from __future__ import annotations

import argparse
import ast
import difflib
import multiprocessing
import os
import random
import re
import shutil
import subprocess
import sys
import time
import xml.etree.ElementTree as ET
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from queue import SimpleQueue
from statistics import fmean
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import pandas as pd
from scipy.stats import binomtest

from szlib.core.files import claim_folder

ROOT = Path(__file__).parents[2]
DRAWN = ["control", "encounters", "zones"]
DRAWN += [f"simulation/{name}.py" for name in ("metrics", "social_metrics")]
ROOMS = [
    f"tests/{room}"
    for room in ("control", "encounters", "zones", "simulation", "plaza")
]
PRELOADED = "numpy pandas polars scipy.optimize scipy.stats sklearn.neighbors shapely casadi pytest"
PRELOADED += " hypothesis jupytext joblib pyarrow.parquet"
COLUMNS = [
    "seed", "module", "line", "operator", "occurrence", "before", "after", "outcome", "test", "seconds",
    "judgement",
]  # fmt: skip


NO_TEST = 5
"""Exit code of pytest if it finds no test: none reaches the mutant."""
ALIKE = [
    {"Add", "Sub", "Mul", "Div", "FloorDiv", "Mod", "Pow"}, {"BitOr", "BitAnd", "BitXor"},
    {"Eq", "NotEq", "Lt", "LtE", "Gt", "GtE"}, {"Is", "IsNot"},
    {"USub", "UAdd", "Delete"}, {"Not", "Delete"}, {"Invert", "Delete"},
]  # fmt: skip
"""Operators that replace each other; another one mostly raises TypeError, which every test notices."""


class Place(NamedTuple):
    """A place in a module, and the changes that can be made there: (operator, occurrence)."""

    module: str
    span: tuple[tuple[int, int], tuple[int, int]]
    changes: tuple[tuple[str, int], ...]


def find_places(module: str) -> list[Place]:
    """All places of a module of szlib that cosmic-ray can change."""
    import parso  # noqa: F401  cosmic-ray needs it loaded
    from cosmic_ray.ast import ast_nodes, get_ast
    from cosmic_ray.plugins import get_operator, operator_names

    source = (ROOT / module).read_text()
    nodes, left_alone = (
        list(ast_nodes(get_ast(source))),
        list(find_left_alone(ast.parse(source))),
    )
    changes = defaultdict[Any, list[tuple[str, int]]](list)
    for name in operator_names():
        replaced = set(name.split("_")[1:])
        if get_operator(name).arguments() or not (
            not replaced or any(replaced <= each for each in ALIKE)
        ):
            continue
        operator = get_operator(name)()
        found = [
            (node, span) for node in nodes for span in operator.mutation_positions(node)
        ]
        for occurrence, (node, span) in enumerate(found):
            # keyword-only from here on
            is_marker = node.parent and node.parent.type == "parameters"
            if not is_marker and not any(
                first <= span[0] < last for first, last in left_alone
            ):
                changes[span].append((name, occurrence))
    return [Place(module, span, tuple(each)) for span, each in sorted(changes.items())]


def find_left_alone(tree: ast.AST) -> Iterator[tuple[tuple[int, int], tuple[int, int]]]:
    """Spans of annotations, `__repr__`, errors and warnings."""
    for node in ast.walk(tree):
        parts: list[ast.AST | None] = []
        if isinstance(node, ast.FunctionDef):
            parts = [node if "repr" in node.name else node.returns]
        elif isinstance(node, ast.arg | ast.AnnAssign):
            parts = [node.annotation]
        elif isinstance(node, ast.Raise) or (
            isinstance(node, ast.Call) and "warn" in ast.unparse(node.func)
        ):
            parts = [node]
        for part in filter(None, parts):
            yield (part.lineno, part.col_offset), (part.end_lineno, part.end_col_offset)  # type: ignore[attr-defined]


def draw(
    places: Sequence[Place], n: int, seed: int
) -> list[tuple[Place, tuple[str, int]]]:
    """`n` places at equal distances in the shuffled places of all modules, and a change of each."""
    rng = random.Random(seed)
    shuffled = sorted(places, key=lambda place: (place.module, rng.random()))
    begin = rng.random()
    drawn = [
        shuffled[int((k + begin) * len(shuffled) / n)]
        for k in range(min(n, len(shuffled)))
    ]
    mutants = [(place, rng.choice(place.changes)) for place in drawn]
    rng.shuffle(mutants)
    return mutants


@dataclass(frozen=True)
class Reach:
    """Which tests reach a line, from the data of `cover` in a folder."""

    folder: Path

    @cached_property
    def seconds(self) -> dict[str, float]:
        """Time of each test that passed."""
        cases = ET.parse(self.folder / "times.xml").iter("testcase")
        return {
            f"{c.get('file')}::{c.get('name')}": float(c.get("time", 0))
            for c in cases
            if not len(c)
        }

    @cached_property
    def lines(self) -> dict[str, dict[int, set[str]]]:
        """The tests that reach each line of each module."""
        from coverage import CoverageData

        data = CoverageData(str(self.folder / "coverage"))
        data.read()
        return {
            file[file.rindex("szlib/") :]: {
                line: {context.split("|")[0] for context in contexts}
                & self.seconds.keys()
                for line, contexts in data.contexts_by_lineno(file).items()
            }
            for file in data.measured_files()
        }

    def quickest(self) -> list[str]:
        """The quickest test of each file: whether every file can be imported in a copy of the tree."""
        by_time = sorted(self.seconds, key=lambda test: self.seconds[test])
        return list({test.split("::")[0]: test for test in reversed(by_time)}.values())

    def find_tests(self, module: str, line: int, seconds: float) -> list[str]:
        """The quickest tests that reach the statement, then others of their files, up to `seconds` in all."""
        reaching = self._reaching(module, line)
        files = {test.split("::")[0] for test in reaching}
        mates = {
            test for test in self.seconds if test.split("::")[0] in files
        } - reaching
        found, total = [], 0.0
        for group in (reaching, mates):
            for test in sorted(group, key=lambda each: self.seconds[each]):
                total += self.seconds[test]
                if total <= seconds or not found:
                    found.append(test)
        times = {
            file: [self.seconds[test] for test in found if test.startswith(file)]
            for file in files
        }
        return sorted(found, key=lambda test: fmean(times[test.split("::")[0]]))

    def _reaching(self, module: str, line: int) -> set[str]:
        lines, tree = self.lines.get(module, {}), ast.parse((ROOT / module).read_text())
        around = [
            node
            for node in ast.walk(tree)
            if isinstance(node, ast.stmt)
            and node.lineno <= line <= (node.end_lineno or line)
        ]
        for node in sorted(
            around, key=lambda each: each.lineno - (each.end_lineno or 0), reverse=True
        ):
            if found := set().union(
                *(
                    lines.get(k, ())
                    for k in range(node.lineno, (node.end_lineno or 0) + 1)
                )
            ):
                return found
            target = (
                getattr(node, "target", None) or getattr(node, "targets", [None])[0]
            )
            if isinstance(
                target, ast.Name
            ):  # a constant or a field: where its name is used
                return self._using(target.id) or set().union(*lines.values())
        return set().union(*lines.values())

    def _using(self, name: str) -> set[str]:
        found = set[str]()
        for module, lines in self.lines.items():
            for number, text in enumerate(
                (ROOT / module).read_text().splitlines(), start=1
            ):
                if re.search(rf"\b{name}\b", text):
                    found |= lines.get(number, set())
        return found


class Selection:
    """Plugin of pytest: only some tests, file by file, and a file that names the first that fails."""

    def __init__(self, tests: Sequence[str], report: Path) -> None:
        self.tests, self.report = set(tests), report

    def pytest_collection_modifyitems(self, items: list[Any]) -> None:
        items[:] = [
            item
            for item in items
            if item.nodeid in self.tests or item.nodeid.split("::")[0] in self.tests
        ]

    def pytest_runtest_logreport(self, report: Any) -> None:
        if report.failed and not self.report.exists():
            self.report.write_text(report.nodeid)


def run_tests(folder: Path, tests: Sequence[str], report: Path) -> None:
    """Run `tests` in a copy of the tree, in a process of its own, and exit as pytest does."""
    os.chdir(folder)
    sys.path.insert(0, str(folder))
    sys.dont_write_bytecode = True
    with report.with_suffix(".log").open("w") as log:
        os.dup2(log.fileno(), 1)
        os.dup2(log.fileno(), 2)
    import pytest

    files = dict.fromkeys(test.split("::")[0] for test in tests) or ["tests/helpers"]
    options = [
        "-x",
        "-q",
        "-p",
        "no:cacheprovider",
        "-W",
        "ignore::pytest.PytestAssertRewriteWarning",
    ]
    code = pytest.main([*options, *files], plugins=[Selection(tests, report)])
    os._exit(int(code))


class Trial(NamedTuple):
    """A mutant to be tried: its row of outcomes so far, the tests, and their time limit [s]."""

    row: dict[str, Any]
    tests: Sequence[str]
    limit: float


def mutate(row: dict[str, Any]) -> dict[str, Any]:
    """The row with the code of the mutant, and with the lines before and after the change."""
    from cosmic_ray.mutating import mutate_code
    from cosmic_ray.plugins import get_operator

    before = (ROOT / row["module"]).read_text()
    if row["operator"] == "none":
        return row | {"code": before, "before": "", "after": ""}
    code = str(mutate_code(before, get_operator(row["operator"])(), row["occurrence"]))
    changes = [
        line
        for line in difflib.ndiff(before.splitlines(), code.splitlines())
        if line[0] in "-+"
    ]
    old, new = (
        " ".join(line[2:].strip() for line in changes if line[0] == sign)
        for sign in "-+"
    )
    return row | {"code": code, "before": old, "after": new}


def try_mutant(folder: Path, trial: Trial) -> dict[str, Any]:
    """The row of outcomes of one mutant, from its tests in a copy of the tree in `folder`."""
    row, began = mutate(trial.row), time.monotonic()
    report, file = folder.with_suffix(".txt"), folder / row["module"]
    report.unlink(missing_ok=True)
    file.write_text(row.pop("code"))
    context = multiprocessing.get_context("forkserver")
    process = context.Process(target=run_tests, args=(folder, trial.tests, report))
    process.start()
    process.join(trial.limit)
    if process.exitcode is None:
        process.kill()
        process.join()
        row["outcome"] = "killed by time"
    else:
        failed = "killed" if report.exists() else "killed at import"
        row["outcome"] = "lives" if process.exitcode in (0, NO_TEST) else failed
    shutil.copy2(ROOT / row["module"], file)
    test = report.read_text() if report.exists() else ""
    return (
        {"judgement": ""}
        | row
        | {"test": test, "seconds": round(time.monotonic() - began, 1)}
    )


def run(trials: Iterable[Trial], asked: argparse.Namespace) -> Iterator[dict[str, Any]]:
    """The row of outcomes of each mutant, some at a time, each in a copy of the tree."""
    multiprocessing.get_context("forkserver").set_forkserver_preload(PRELOADED.split())
    free = SimpleQueue[Path]()

    def try_in_copy(trial: Trial) -> dict[str, Any]:
        while asked.pause and asked.pause.exists():
            time.sleep(5)
        folder = free.get()
        try:
            return try_mutant(folder, trial)
        finally:
            free.put(folder)

    with TemporaryDirectory() as top, ThreadPoolExecutor(asked.jobs) as pool:
        for k in range(asked.jobs):
            folder = Path(top) / f"copy{k}"
            for name in (
                "szlib",
                "tests",
                "notebooks/examples",
                "notebooks/tables",
                "notebooks/studies",
            ):
                shutil.copytree(ROOT / name, folder / name)
            shutil.copy2(ROOT / "pyproject.toml", folder)
            free.put(folder)
        try:
            yield from pool.map(try_in_copy, trials)
        finally:
            pool.shutdown(cancel_futures=True)


def find_modules(path: Path) -> list[Path]:
    """The modules in a folder, or the one at `path`."""
    return [path] if path.suffix else list(path.rglob("*.py"))


def plan_run(
    n: int, modules: Sequence[str], asked: argparse.Namespace
) -> Iterator[Trial]:
    """The unchanged code, then `n` mutants of `modules`."""
    reach = Reach(asked.out)
    places = [place for module in modules for place in find_places(module)]
    print(
        f"{len(places)} places, {sum(len(place.changes) for place in places)} mutants",
        flush=True,
    )
    for place, (operator, occurrence) in [
        (places[0], ("none", 0)),
        *draw(places, n, asked.seed),
    ]:
        line = place.span[0][0]
        tests = (
            reach.find_tests(place.module, line, asked.seconds)
            if operator != "none"
            else reach.quickest()
        )
        row = {
            "seed": asked.seed,
            "module": place.module,
            "line": line,
            "operator": operator,
        }
        limit = 60 + 10 * sum(reach.seconds[test] for test in tests)
        yield Trial(row | {"occurrence": occurrence}, tests, limit)


def plan_again(table: Path, asked: argparse.Namespace) -> Iterator[Trial]:
    """The mutants in `table` that live and are not judged."""
    rows = pd.read_csv(table, dtype=str).fillna("")
    for row in rows[(rows["outcome"] == "lives") & (rows["judgement"] == "")].to_dict(
        "records"
    ):
        if row["module"] in asked.modules:
            yield Trial(row | {"occurrence": int(row["occurrence"])}, asked.what, 600.0)


def append(table: Path, row: dict[str, Any]) -> None:
    """Add a row to `table`, in place of the one of the same mutant."""
    rows = pd.DataFrame([row], columns=COLUMNS).astype(str)
    if table.exists():
        old = pd.read_csv(table, dtype=str).fillna("")
        same = (
            old[["module", "operator", "occurrence"]]
            == rows.loc[0, ["module", "operator", "occurrence"]]
        ).all(axis=1)
        rows = pd.concat([old[~same], rows])
    rows.to_csv(table, index=False)


def tabulate(outcomes: pd.DataFrame, modules: Sequence[str]) -> pd.DataFrame:
    """Killed share of the mutants that change a result, by module and in all."""
    drawn = outcomes[outcomes["operator"] != "none"]
    rows = []
    for name, part in [*drawn.groupby("module"), ("all", drawn)]:
        counted = part[part["judgement"] == ""]
        n, killed = len(counted), int(counted["outcome"].str.startswith("killed").sum())
        low, high = (
            binomtest(killed, n).proportion_ci(method="wilson") if n else (0.0, 1.0)
        )
        places = sum(
            len(find_places(m)) for m in ([name] if name != "all" else modules)
        )
        rows.append((name, places, len(part), n, killed, killed / max(n, 1), low, high))
    columns = ["module", "places", "drawn", "counted", "killed", "share", "low", "high"]
    return pd.DataFrame(rows, columns=columns).set_index("module").round(2)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("verb", choices=["cover", "run", "again", "table"])
    parser.add_argument(
        "what", nargs="*", help="run: number of mutants; again: test files"
    )
    parser.add_argument(
        "--only", nargs="+", default=DRAWN, help="modules or folders of szlib"
    )
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument(
        "--seconds", type=float, default=20.0, help="time of the tests on one mutant"
    )
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument(
        "--out",
        type=Path,
        default=ROOT / "results" / "mutants",
        help="folder of the results",
    )
    parser.add_argument("--pause", type=Path, help="pause while this file exists")
    asked = parser.parse_args()
    if not asked.out.exists():
        claim_folder(asked.out, "outcomes of mutants")
    os.environ |= {
        "SZLIB_CACHE": "off",
        "OMP_NUM_THREADS": "1",
        "PYTHONDONTWRITEBYTECODE": "1",
    }
    os.environ.pop("SZLIB_DATA_DIR", None)
    files = [
        file for part in asked.only for file in find_modules(ROOT / "szlib" / part)
    ]
    asked.modules = sorted(str(file.relative_to(ROOT)) for file in files)
    table = asked.out / "outcomes.csv"
    if asked.verb == "cover":
        os.environ["COVERAGE_FILE"] = str(asked.out / "coverage")
        options = [
            "--cov=szlib",
            "--cov-context=test",
            "--cov-report=",
            "-o",
            "junit_family=xunit1",
        ]
        command = [
            sys.executable,
            "-m",
            "pytest",
            *ROOMS,
            *options,
            f"--junitxml={asked.out / 'times.xml'}",
        ]
        subprocess.run(command, cwd=ROOT, check=False)
    elif asked.verb == "table":
        print(
            tabulate(
                pd.read_csv(table, dtype=str).fillna(""), asked.modules
            ).to_string()
        )
    else:
        trials = (
            plan_run(int(asked.what[0]), asked.modules, asked)
            if asked.verb == "run"
            else plan_again(table, asked)
        )
        for row in run(trials, asked):
            append(table, row)
            if row["operator"] == "none" and row["outcome"] != "lives":
                raise SystemExit(
                    f"the unchanged code fails: {row['test'] or 'a test cannot be imported'}"
                )
            print(*(row[name] for name in COLUMNS[1:-1]), flush=True)


if __name__ == "__main__":
    main()
