"""Execution of all notebooks: in their order, several at a time, with a summary of their checks.

Each notebook is executed in a kernel of its own and leaves a record. The run collects the records in
summary.json and writes the report.
"""

from __future__ import annotations

import hashlib
import json
import os
import socket
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import (
    FIRST_COMPLETED,
    Executor,
    Future,
    ThreadPoolExecutor,
    wait,
)
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pandas as pd
from tqdm import tqdm

from .. import __version__
from ..core import memory
from ..core.errors import DataError, SzlibError
from ..core.files import (
    folder_lock,
    load_cached,
    process_folder,
    write_checksum,
    write_file,
)
from ..core.input_files import file_content, read_json_object
from ..core.parallel import limit_jobs, safe_path, uninterrupted
from ..tracks import datasets, funnels
from . import folders
from .kept_results import (
    PRODUCTS,
    SUMMARIES,
    find_kept,
    outcome_checksum,
    package_checksum,
)
from .notebook_execution import EMPTY_RECORD, end_kernels, execute_notebook
from .record.data_cache import DataCache, describe_missing_data, read_stored_zone
from .record.display import format_value
from .record.parameters import METHOD_DEFAULTS, check_parameters

PRODUCERS = tuple(PRODUCTS)
# Notebooks that take longest. They start first in their batch, so that no core waits for them at its end.
LONGEST = ("06", "25", "26")
SUMMARY = "summary.json"  # file of the outcome of a run
# Files that a process opens: a kernel, 70 to 90; this process for each kernel, about 15 (both measured).
_FILES_OF_KERNEL, _FILES_OF_CLIENT = 96, 16
# memory, mostly unused, that the imports of a process reserve (measured) [bytes]
_ADDRESSES = 2 * 10**9
_POLL = 0.5  # longest wait before Ctrl-C is noticed, whichever thread receives it [s]


def run(
    data: str | Sequence[str] = datasets.SYNTHETIC,
    *,
    out: str | Path | None = None,
    jobs: int = 1,
    only: Iterable[str] = (),
    parameters: Mapping[str, Any] | None = None,
    client: Any = None,
    notebooks: str | Path | None = None,
    force: bool = False,
    figures: str | None = None,
) -> dict[str, Any]:
    """Execute the notebooks on a data set, and collect their results.

    Parameters
    ----------
    data : "synthetic", the name of another data set, or paths of track files.
    out : folder of all results (None: `folders.default_results`); those of this run go to a folder inside.
    jobs : number of notebooks that run at the same time.
    only : numbers ("07") or names of the notebooks; empty: all.
    parameters : parameters of the notebooks by name, such as {"seed": 1}.
    client : of a Dask cluster that shares this file system, as from `szlib.core.parallel.cluster`.
    notebooks : the folder of the notebooks; None as for `folders.find_notebooks`.
    figures : a format in which figures are saved besides PNG, "svg" or "pdf".
    force : whether to repeat notebooks whose stored results are of the same notebook, code, data, parameters.

    Returns
    -------
    The summary: passed; notebooks, for each one its status ("done"; "undecided": it ended early, with too few
    encounters for a zone; "error": a cell failed; "refused": data, disk or memory do not allow it;
    "not started": an earlier one was refused), seconds, checks and key figures; the path of the report; the
    verdict; the names of notebooks that were kept, not repeated. The same, with notebooks of earlier runs on
    the same data, parameters and version, is in ``summary.json``.

    Raises
    ------
    DataError : the data set, a notebook or a parameter is unknown, or a parameter is out of its range.
    StorageError : the results cannot be written, or another run writes to the same folder.
    SzlibError : a process may open too few files or use too little memory, or 127.0.0.1 is not reached.
    """
    place = folders.find_notebooks(notebooks)
    scripts = choose_notebooks(only, place)
    jobs = max(limit_jobs(jobs, len(scripts)), 1)
    _require_limits(_FILES_OF_KERNEL + _FILES_OF_CLIENT * jobs)
    _require_loopback()
    known = sorted(
        {
            *scripts,
            *(s for s in folders.list_notebooks(place) if s.stem[:2] <= PRODUCERS[-1]),
        }
    )
    given = check_parameters(parameters or {}, known)
    results = (
        folders.default_results(place) if out is None else folders.results_root(out)
    )
    data = folders.absolute_data(data)
    home = folders.claim_results(results, data, given)
    with folder_lock(home), safe_path(), _private_temporary_files():
        files = DataCache(home, data, seed=given.get("seed", 0)).files()
        if (
            read_stored_zone(home / "zone.json") is None
        ):  # missing, damaged or of another version
            (home / "zone.json").unlink(missing_ok=True)
        contents = [[file.name, *file_content(file)] for file in files]
        source: dict[str, Any] = {"szlib": __version__, "data": datasets.label(data)}
        source |= {"files": contents, "parameters": given}
        stored, code = _stored_outcomes(home, source), package_checksum(place)
        kept = [] if force else find_kept(home, scripts, stored, code, figures)
        due = [script for script in scripts if script.stem not in kept]
        names = [script.stem for script in due]
        there = {script.stem for script in folders.list_notebooks(place)}.difference(
            names
        )
        outcomes = {name: each for name, each in stored.items() if name in there}
        write_file(home / folders.PARAMETERS, json.dumps(source, indent=1))
        if due:
            folders.remove_outputs(home, names)
            _store_unfinished(home, outcomes, names)
            variables = given | {"data": data, "results": str(results)}
            for script, outcome in _execute_all(
                due, variables, home, jobs, client, figures
            ):
                outcome["checksum"] = outcome_checksum(home, script, outcome, code)
                outcomes[script.stem] = outcome
                _store_unfinished(home, outcomes, names)
        verdict = (
            _judge(zone, source["files"], given)
            if (zone := home / "zone.json").exists()
            else ""
        )
        if (samples := home / "encounters.parquet").exists():
            table = pd.read_parquet(samples, columns=[])
            source["warnings"] = funnels.warnings(funnels.get(table))
            source["area"] = "{area} {area_reason}".format_map(table.attrs).strip()
            if not verdict and any(
                outcome["status"] == "undecided" for outcome in outcomes.values()
            ):
                verdict = f"undecided: {describe_missing_data(samples)}"
            if advice := table.attrs.get("advice"):
                source["warnings"] += [] if verdict else [advice]
                verdict = f"{verdict}; {advice.partition('; ')[2]}" if verdict else ""
        source |= {"verdict": verdict} if verdict else {}
        text = json.dumps(_summarise(source, outcomes), indent=1)
        write_file(home / SUMMARY, text)
        if any((home / f"{name}.ipynb").exists() for name in outcomes):
            _update_report(
                report := home / folders.REPORT,
                hashlib.sha256(text.encode()).hexdigest(),
            )
            source["report"] = str(report)
        chosen = {script.stem: outcomes[script.stem] for script in scripts}
        return _summarise(source | {"kept": kept}, chosen)


def _update_report(file: Path, made_of: str) -> None:
    """Write the report again, unless the `file` is that of the summary with the checksum `made_of`."""
    if load_cached(file, made_of) is None:
        # importing it takes longer than all other imports
        from .report import write_report

        write_checksum(file, write_report(file.parent).read_bytes(), made_of)


def _judge(file: Path, contents: Sequence[Any], parameters: Mapping[str, Any]) -> str:
    """The verdict on the zone in a `file`; "" if there is none that was made from data of `contents`."""
    zone = read_stored_zone(file)
    if not zone or zone.provenance.get("source", {}).get("files") != json.loads(
        json.dumps(contents)
    ):
        return ""
    speed = float(parameters.get("zone_speed", METHOD_DEFAULTS["zone_speed"]))
    return f"zone at {speed:g} m/s: {zone.verdict(speed).sentence}"


def _require_limits(n_files: int) -> None:
    """Let this process and its kernels open `n_files`; SzlibError where the system does not allow a run."""
    try:
        import resource
    except ImportError:  # Windows has no such limit
        return
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if 0 <= hard < n_files:  # negative: unlimited
        raise SzlibError(
            f"a process may open {hard} files on this machine, and a run needs {n_files}; raise the limit "
            f"(ulimit -n {n_files}), or use fewer --jobs"
        )
    if 0 <= soft < n_files:
        resource.setrlimit(resource.RLIMIT_NOFILE, (n_files, hard))
    if 0 <= (size := resource.getrlimit(resource.RLIMIT_AS)[0]) < _ADDRESSES:
        raise SzlibError(
            f"a process may use {size / 1e9:.1f} GB of memory on this machine (ulimit -v), and a run needs "
            f"{_ADDRESSES / 1e9:.1f} GB; raise the limit"
        )


def _require_loopback() -> None:
    """Raise SzlibError where no process can be reached over 127.0.0.1, as kernels are."""
    try:
        with socket.create_server(("127.0.0.1", 0)) as server:
            socket.create_connection(server.getsockname(), timeout=10).close()
    except OSError as error:
        raise SzlibError(
            f"127.0.0.1 cannot be reached ({error.strerror or error}), and notebooks are executed over it; "
            "bring up the network interface lo (ip link set lo up)"
        ) from error


@contextmanager
def _private_temporary_files() -> Iterator[None]:
    """Create temporary files inside a with block, also those of Jupyter, in the folder of this process."""
    before, tempfile.tempdir = tempfile.tempdir, str(process_folder())
    try:
        yield
    finally:
        tempfile.tempdir = before


def choose_notebooks(only: Iterable[str], place: Path | None = None) -> list[Path]:
    """The scripts of the notebooks in `place` whose numbers or names are in `only`; all if it is empty.

    Raises DataError for an unknown name, and if there are no notebooks.
    """
    scripts, wanted = (
        folders.list_notebooks(place or folders.find_notebooks()),
        list(only),
    )
    if unknown := [
        name
        for name in wanted
        if not any(folders.has_name(script, name) for script in scripts)
    ]:
        raise DataError(
            f"no notebook {', '.join(unknown)}; there are {', '.join(script.stem for script in scripts)}"
        )
    return [
        s
        for s in scripts
        if not wanted or any(folders.has_name(s, name) for name in wanted)
    ]


def _execute_all(
    scripts: Sequence[Path],
    given: Mapping[str, Any],
    home: Path,
    jobs: int,
    client: Any,
    figures: str | None,
) -> Iterator[tuple[Path, dict[str, Any]]]:
    """Execute the notebooks; yield the script and the outcome of each when it has ended."""
    environment = {
        folders.RUN_VARIABLE: str(home),
        folders.FIGURES_VARIABLE: figures or "",
    }
    if client is None:
        threads = max(1, (os.cpu_count() or 1) // jobs)
        environment |= {
            memory.VARIABLE: str(memory.limit() // jobs),
            "OMP_NUM_THREADS": os.environ.get("OMP_NUM_THREADS", str(threads)),
        }
    ended, is_refused = set[Path](), False
    bar = tqdm(total=len(scripts), unit="notebook", desc=home.name, disable=None)
    futures: list[Future[Any]] = []
    with bar, _open_executor(client, jobs, futures) as executor:
        for batch in split_batches(scripts):
            if is_refused:
                break  # the later notebooks need its result
            arguments = (dict(given), str(home), environment)
            with uninterrupted():
                futures[:] = [
                    executor.submit(execute_notebook, str(script), *arguments)
                    for script in batch
                ]
            script_of = dict(zip(futures, batch, strict=True))
            running = set(futures)
            while running:
                done, running = wait(
                    running, timeout=_POLL, return_when=FIRST_COMPLETED
                )
                for future in done:
                    name, outcome = future.result()
                    ended.add(script := script_of[future])
                    is_refused |= outcome["status"] == "refused"
                    bar.update()
                    bar.set_postfix_str(f"{name} {outcome['status']}")
                    yield script, outcome
    for script in (script for script in scripts if script not in ended):
        yield script, {"status": "not started", "seconds": 0.0, **EMPTY_RECORD}


def split_batches(scripts: Sequence[Path]) -> list[list[Path]]:
    """Split `scripts` after each of `PRODUCERS`, with `SUMMARIES` in the last batch.

    The notebooks of a batch can run at the same time.
    """
    batches: list[list[Path]] = [[] for _ in range(len(PRODUCERS) + 2)]
    for script in sorted(scripts, key=lambda script: script.stem[:2] not in LONGEST):
        number = script.stem[:2]
        last = number in SUMMARIES
        batches[
            -1 if last else sum(number > producer for producer in PRODUCERS)
        ].append(script)
    return batches


@contextmanager
def _open_executor(
    client: Any, jobs: int, futures: Sequence[Future[Any]]
) -> Iterator[Executor]:
    """The workers of a Dask `client`, or threads that wait for kernels; an interruption ends `futures`."""
    with (
        client.get_executor(pure=False)
        if client
        else ThreadPoolExecutor(jobs) as executor
    ):
        try:
            yield executor
        except BaseException:
            if not client:
                end_kernels(futures)
            raise


def _store_unfinished(
    home: Path, outcomes: Mapping[str, Any], names: Sequence[str]
) -> None:
    """Write the `outcomes` that there are as a summary that has not passed; `names` are of all that run."""
    if not outcomes:
        (home / SUMMARY).unlink(missing_ok=True)
        return
    left = [name for name in names if name not in outcomes]
    unfinished = {"passed": False, "unfinished": left, "notebooks": outcomes}
    write_file(home / SUMMARY, json.dumps(unfinished, indent=1), durable=False)


def _stored_outcomes(
    home: Path, source: Mapping[str, Any]
) -> dict[str, dict[str, Any]]:
    """The outcomes in the summary of an earlier run of the same `source`: version, data and parameters."""
    is_same = read_json_object(home / folders.PARAMETERS) == json.loads(
        json.dumps(source)
    )
    stored = read_json_object(home / SUMMARY).get("notebooks") if is_same else None
    outcomes = stored.items() if isinstance(stored, dict) else ()
    whole = ((name, each) for name, each in outcomes if isinstance(each, dict))
    return {name: each for name, each in whole if each.keys() >= EMPTY_RECORD.keys()}


def _summarise(
    source: Mapping[str, Any], notebooks: Mapping[str, Any]
) -> dict[str, Any]:
    passed = all(has_passed(outcome) for outcome in notebooks.values())
    return {**source, "passed": passed, "notebooks": dict(sorted(notebooks.items()))}


def has_passed(outcome: Mapping[str, Any]) -> bool:
    """Whether a notebook with this `outcome` has finished or is undecided, and none of its checks failed."""
    is_over = outcome["status"] in ("done", "undecided")
    return is_over and all(
        c["passed"] for c in outcome["checks"] if c["kind"] == "check"
    )


def format_summary(summary: Mapping[str, Any]) -> str:
    """Format the `summary` of a run: a row for each notebook, each result that does not hold, the verdict."""
    rows, notes = list_results(summary)
    table = [
        f"{row[0]:<24} {row[1]:>7} {row[2]:>11} {row[3]:>9}  {row[4]}" for row in rows
    ]
    return "\n".join([*table, *notes])


def list_results(summary: Mapping[str, Any]) -> tuple[list[tuple[str, ...]], list[str]]:
    """List rows of a table of the `summary` of a run, the first its head, and notes, the last its result."""
    rows: list[tuple[str, ...]] = [
        ("notebook", "seconds", "checks", "observed", "key figures")
    ]
    notes = []
    for name, outcome in summary["notebooks"].items():
        done = outcome["status"] == "done"
        held = [_count_passed(outcome, kind) for kind in ("check", "observation")]
        key = ", ".join(
            f"{k} {format_value(v)}" for k, v in outcome["key_figures"].items()
        )
        rows.append(
            (
                name,
                f"{outcome['seconds']:.1f}",
                held[0] if done else outcome["status"],
                held[1],
                key,
            )
        )
        notes += [
            f"{name}: {c['name']}: {c['result']} ({c['value']})"
            for c in outcome["checks"]
            if not c["passed"]
        ]
        if "error" in outcome and outcome["status"] != "undecided":
            notes.append(f"{name}: {outcome['error']}")
    undecided = [
        name for name, n in summary["notebooks"].items() if n["status"] == "undecided"
    ]
    notes += (
        [f"not decidable on this data, see the report: {', '.join(undecided)}"]
        if undecided
        else []
    )
    notes += [f"data: {text}" for text in summary.get("warnings", ())]
    notes += [f"area: {summary['area']}"] if "area" in summary else []
    if n_kept := len(summary.get("kept", ())):
        notes.append(
            f"{n_kept} of {len(rows) - 1} notebooks are kept from an earlier run; --force repeats them"
        )
    end = f"all checks {'that were made ' if undecided else ''}hold"
    return rows, [*notes, end if summary["passed"] else "NOT ALL CHECKS HOLD"]


def _count_passed(outcome: Mapping[str, Any], kind: str) -> str:
    """How many of a kind hold, of how many, such as "3/4"; "-" if there are none."""
    passed = [c["passed"] for c in outcome["checks"] if c["kind"] == kind]
    return f"{sum(passed)}/{len(passed)}" if passed else "-"
