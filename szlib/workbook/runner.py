"""The whole workbook, headless, from tracks to a robot that yields.

Each notebook is executed by papermill from its percent script, and leaves a record of its checks
and key figures; the run gathers them in summary.json and ends with a table.
"""

from __future__ import annotations

import ast
import json
import tempfile
import time
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import Executor, Future, ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import jupytext
import papermill
from tqdm import tqdm

from .. import __version__
from ..errors import DataError
from ..parallel import cluster
from ..tracks import datasets
from .record import data_files

NOTEBOOKS = Path(__file__).resolve().parents[2] / "notebooks"
"""The workbook's home: beside the package in the repository."""
LAST_PRODUCER = "05"
"""Up to here each notebook needs the artefact of the one before; later ones can run side by side."""


def run(
    data: str | Sequence[str] = datasets.SYNTHETIC,
    *,
    out: str | Path = "results",
    jobs: int = 1,
    only: Iterable[str] = (),
    parameters: Mapping[str, Any] | None = None,
    scheduler: str | None = None,
) -> dict[str, Any]:
    """Execute the notebooks on a data set, and gather what they found.

    Parameters
    ----------
    data : "synthetic", "atc-1hz", or paths of track files.
    out : folder of results; this data set's go into a folder of their own in it.
    jobs : notebooks at a time, once the zone is there.
    only : numbers ("07") or names of the notebooks to run; all of them by default.
    parameters : further parameters of the notebooks, such as {"seed": 1}.
    scheduler : address of a Dask cluster that shares this file system and runs the notebooks.

    Returns
    -------
    The summary, also written to ``<out>/<data>/summary.json``: passed, and for each notebook its
    status, seconds, checks (name, passed, value) and key figures.

    Raises
    ------
    DataError : no such data, notebook or parameter.
    """
    sources = _chosen(only)
    given = dict(parameters or {})
    _check_parameters(given, sources)
    seed = given.get("seed", 0)
    results = Path(out).resolve()
    home = results / datasets.label(data)
    files = data_files(data, folder=home, seed=seed)
    if data not in datasets.NAMES:
        data = [str(file.resolve()) for file in files]
    given |= {"data": data, "results": str(results)}
    (home / "records").mkdir(parents=True, exist_ok=True)
    for source in sources:
        (home / "records" / f"{source.stem}.json").unlink(missing_ok=True)

    outcomes: dict[str, dict[str, Any]] = {}
    with tqdm(total=len(sources), unit="notebook", desc=datasets.label(data)) as bar:
        first = [source for source in sources if source.stem[:2] <= LAST_PRODUCER]
        rest = sources[len(first) :]
        with cluster(scheduler) as client, _pool(client, jobs) as pool:
            try:
                for batch in [*([source] for source in first), rest]:
                    for future in as_completed(_submit(pool, batch, given, home)):
                        name, outcome = future.result()
                        outcomes[name] = outcome
                        bar.update()
                        bar.set_postfix_str(f"{name} {outcome['status']}")
            except KeyboardInterrupt:
                pool.shutdown(wait=False, **({} if client else {"cancel_futures": True}))
                raise
    notebooks = {source.stem: outcomes[source.stem] for source in sources}
    passed = all(
        n["status"] == "done" and all(c["passed"] for c in n["checks"] if c["kind"] == "check")
        for n in notebooks.values()
    )
    summary = {
        "szlib": __version__,
        "data": datasets.label(data),
        "seed": seed,
        "passed": passed,
        "notebooks": notebooks,
    }
    (home / "summary.json").write_text(json.dumps(summary, indent=1), encoding="utf-8")
    return summary


def render(summary: Mapping[str, Any]) -> str:
    """The table that ends a run: notebook, time, checks passed, key figures; then what did not hold."""
    lines = [f"{'notebook':<20} {'seconds':>7} {'checks':>7}  key figures"]
    notes = []
    for name, record in summary["notebooks"].items():
        checks = [c for c in record["checks"] if c["kind"] == "check"]
        held = (
            f"{sum(c['passed'] for c in checks)}/{len(checks)}"
            if record["status"] == "done"
            else record["status"]
        )
        key = ", ".join(
            f"{k} {v:.4g}" if isinstance(v, float) else f"{k} {v}" for k, v in record["key_figures"].items()
        )
        lines.append(f"{name:<20} {record['seconds']:>7.1f} {held:>7}  {key}")
        notes += [
            f"{name}: {c['name']}: {c['result']} ({c['value']})" for c in record["checks"] if not c["passed"]
        ]
        if record.get("error"):
            notes.append(f"{name}: {record['error']}")
    return "\n".join([*lines, *notes, "all checks hold" if summary["passed"] else "NOT ALL CHECKS HOLD"])


def _pool(client: Any, jobs: int) -> Executor:
    """The workers of a Dask cluster, or processes here."""
    if client is not None:
        executor: Executor = client.get_executor(pure=False)
        return executor
    return ProcessPoolExecutor(max(jobs, 1), mp_context=get_context("spawn"))


def _submit(pool: Executor, sources: Iterable[Path], given: dict[str, Any], home: Path) -> list[Future[Any]]:
    return [pool.submit(_execute, str(source), given, str(home)) for source in sources]


def _execute(source: str, given: dict[str, Any], home: str) -> tuple[str, dict[str, Any]]:
    """Run one notebook in a kernel of its own; its name, and what it left."""
    script, folder = Path(source), Path(home)
    notebook = jupytext.read(script)
    begun = time.perf_counter()
    outcome: dict[str, Any] = {"status": "done"}
    with tempfile.TemporaryDirectory() as temporary:
        plain = Path(temporary) / f"{script.stem}.ipynb"
        jupytext.write(notebook, plain, fmt="ipynb")
        try:
            papermill.execute_notebook(
                plain,
                folder / plain.name,
                given,
                kernel_name="python3",
                language="python",
                cwd=script.parent,
                progress_bar=False,
                extra_arguments=["--log-level=CRITICAL"],  # the kernel's remarks on its own transport
            )
        except papermill.PapermillExecutionError as error:
            outcome = {"status": "error", "error": f"{error.ename}: {error.evalue}"}
    outcome["seconds"] = round(time.perf_counter() - begun, 2)
    record = folder / "records" / f"{script.stem}.json"
    left = json.loads(record.read_text(encoding="utf-8")) if record.exists() else {}
    if outcome["status"] == "done" and not left:
        outcome = {
            **outcome,
            "status": "error",
            "error": "the notebook left no record; does it end with record.close()?",
        }
    return script.stem, outcome | {name: left.get(name, default) for name, default in _EMPTY_RECORD.items()}


_EMPTY_RECORD: dict[str, Any] = {"checks": [], "key_figures": {}, "figures": []}


def _chosen(only: Iterable[str]) -> list[Path]:
    sources = sorted(NOTEBOOKS.glob("[0-9][0-9]_*.py"))
    if not sources:
        raise DataError(
            f"{NOTEBOOKS}: no notebooks; they come with the repository, not with the package: get a copy of "
            "it, and there `make run`, or pip install -e '.[workbook]' and `szlib run`"
        )
    wanted = list(only)
    unknown = [name for name in wanted if not any(source.stem.startswith(name) for source in sources)]
    if unknown:
        raise DataError(
            f"no notebook {', '.join(unknown)}; there are {', '.join(source.stem for source in sources)}"
        )
    return [
        source for source in sources if not wanted or any(source.stem.startswith(name) for name in wanted)
    ]


def _check_parameters(given: Mapping[str, Any], sources: Sequence[Path]) -> None:
    """Each parameter must be one of a notebook to be run, and of the type of its default there."""
    defaults: dict[str, Any] = {}
    for source in sources:
        for cell in jupytext.read(source).cells:
            if "parameters" in cell.metadata.get("tags", []):
                defaults |= {
                    node.targets[0].id: ast.literal_eval(node.value)
                    for node in ast.parse(cell.source).body
                    if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name)
                }
    unknown = set(given) - set(defaults)
    if unknown:
        known = ", ".join(sorted(defaults))
        raise DataError(f"unknown parameter {', '.join(sorted(unknown))}; the notebooks know {known}")
    for name, value in given.items():
        default = defaults[name]
        number = isinstance(default, float) and isinstance(value, int) and not isinstance(value, bool)
        if not number and type(value) is not type(default):
            raise DataError(
                f"parameter {name}: expected {type(default).__name__}, such as {default!r}; got {value!r}"
            )
