"""Execution of all notebooks: in their order, several at a time, with a summary of their checks.

Each notebook is executed in a kernel of its own and leaves a record. The run collects the records in
summary.json and writes the report.
"""

from __future__ import annotations

import json
import os
import socket
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pandas as pd
from tqdm import tqdm

from .. import __version__, memory
from ..errors import DataError, SzlibError
from ..files import folder_lock, process_folder, write_file
from ..input_files import file_content, read_json_object
from ..parallel import limit_jobs, safe_path, uninterrupted
from ..tracks import datasets, funnels
from . import folders
from .notebook_execution import EMPTY_RECORD, end_kernels, execute_notebook
from .record.data_cache import DataCache, describe_missing_data, read_stored_zone
from .record.display import format_value
from .record.parameters import METHOD_DEFAULTS, check_parameters

# Notebooks whose results later ones need: the encounters and the zone.
PRODUCERS = ("02", "05")
# Notebooks that read the records of all others. The others are independent of each other.
SUMMARIES = ("21",)
# Notebooks that take longest. They start first in their batch, so that no core waits for them at its end.
LONGEST = ("15", "16", "18")
SUMMARY = "summary.json"  # file of the outcome of a run
# Files that a process opens: a kernel, 70 to 90; this process for each kernel, about 15 (both measured).
_FILES_OF_KERNEL, _FILES_OF_CLIENT = 96, 16
_ADDRESSES = 2 * 10**9  # memory, mostly unused, that the imports of a process reserve (measured) [bytes]
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
) -> dict[str, Any]:
    """Execute the notebooks on a data set, and collect their results.

    Parameters
    ----------
    data : "synthetic", the name of another data set, or paths of track files.
    out : folder of all results (None: `folders.default_results`); those of this run go to a folder inside.
    jobs : number of notebooks that run at the same time.
    only : numbers ("07") or names of the notebooks; empty: all.
    parameters : parameters of the notebooks by name, such as {"seed": 1}.
    client : of a Dask cluster that shares this file system, as from `szlib.parallel.cluster`.
    notebooks : the folder of the notebooks; None as for `folders.find_notebooks`.

    Returns
    -------
    The summary: passed; notebooks, for each one its status ("done"; "undecided": it ended early, with too few
    encounters for a zone; "error": a cell failed; "refused": data, disk or memory do not allow it;
    "not started": an earlier one was refused), seconds, checks and key figures; the path of the report; the
    verdict. The same, with notebooks of earlier runs on the same data, parameters and version, is in
    ``summary.json``.

    Raises
    ------
    DataError : the data set, a notebook or a parameter is unknown, or a parameter is out of its range.
    StorageError : the results cannot be written, or another run writes to the same folder.
    SzlibError : a process may open too few files or use too little memory, or 127.0.0.1 is not reached.
    """
    place = folders.find_notebooks(notebooks)
    scripts = choose_notebooks(only, place)
    names, jobs = [script.stem for script in scripts], max(limit_jobs(jobs, len(scripts)), 1)
    _require_limits(_FILES_OF_KERNEL + _FILES_OF_CLIENT * jobs)
    _require_loopback()
    known = sorted({*scripts, *(s for s in folders.list_notebooks(place) if s.stem[:2] <= PRODUCERS[-1])})
    given = check_parameters(parameters or {}, known)
    results = folders.default_results(place) if out is None else folders.results_root(out)
    data = folders.absolute_data(data)
    home = folders.claim_results(results, data, given)
    with folder_lock(home), safe_path(), _private_temporary_files():
        files = DataCache(home, data, seed=given.get("seed", 0)).files()
        folders.remove_outputs(home, names)
        if read_stored_zone(home / "zone.json") is None:  # missing, damaged or of another version
            (home / "zone.json").unlink(missing_ok=True)
        source, earlier = _start_summary(home, data, files, given, names)
        variables = given | {"data": data, "results": str(results)}
        outcomes = _execute_all(scripts, variables, home, jobs, client)
        verdict = _judge(zone, source["files"], given) if (zone := home / "zone.json").exists() else ""
        if (samples := home / "encounters.parquet").exists():
            table = pd.read_parquet(samples, columns=[])
            source["warnings"] = funnels.warnings(funnels.get(table))
            source["area"] = "{area} {area_reason}".format_map(table.attrs).strip()
            if not verdict and any(outcome["status"] == "undecided" for outcome in outcomes.values()):
                verdict = f"undecided: {describe_missing_data(samples)}"
            if advice := table.attrs.get("advice"):
                source["warnings"] += [] if verdict else [advice]
                verdict = f"{verdict}; {advice.partition('; ')[2]}" if verdict else ""
        source |= {"verdict": verdict} if verdict else {}
        summary, everything = (_summarise(source, each) for each in (outcomes, {**earlier, **outcomes}))
        write_file(home / SUMMARY, json.dumps(everything, indent=1))
        if any((home / f"{name}.ipynb").exists() for name in everything["notebooks"]):
            from .report import write_report  # importing it takes longer than all other imports

            summary["report"] = str(write_report(home))
        return summary


def _judge(file: Path, contents: Sequence[Any], parameters: Mapping[str, Any]) -> str:
    """The verdict on the zone in a `file`; "" if there is none that was made from data of `contents`."""
    zone = read_stored_zone(file)
    if not zone or zone.provenance.get("source", {}).get("files") != json.loads(json.dumps(contents)):
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
    scripts, wanted = folders.list_notebooks(place or folders.find_notebooks()), list(only)
    if unknown := [name for name in wanted if not any(folders.has_name(script, name) for script in scripts)]:
        raise DataError(
            f"no notebook {', '.join(unknown)}; there are {', '.join(script.stem for script in scripts)}"
        )
    return [s for s in scripts if not wanted or any(folders.has_name(s, name) for name in wanted)]


def _execute_all(
    scripts: Sequence[Path], given: Mapping[str, Any], home: Path, jobs: int, client: Any
) -> dict[str, dict[str, Any]]:
    """Execute the notebooks; the outcome of each by its name, in their order."""
    environment = {folders.RUN_VARIABLE: str(home)}
    if client is None:
        threads = max(1, (os.cpu_count() or 1) // jobs)
        environment |= {
            memory.VARIABLE: str(memory.limit() // jobs),
            "OMP_NUM_THREADS": os.environ.get("OMP_NUM_THREADS", str(threads)),
        }
    not_started = {"status": "not started", "seconds": 0.0, **EMPTY_RECORD}
    outcomes = {script.stem: not_started for script in scripts}
    bar = tqdm(total=len(scripts), unit="notebook", desc=home.name, disable=None)
    futures: list[Future[Any]] = []
    with bar, _open_executor(client, jobs, futures) as executor:
        for batch in split_batches(scripts):
            if any(outcome["status"] == "refused" for outcome in outcomes.values()):
                break  # the later notebooks need its result
            arguments = (dict(given), str(home), environment)
            with uninterrupted():
                futures[:] = [executor.submit(execute_notebook, str(script), *arguments) for script in batch]
            running = set(futures)
            while running:
                done, running = wait(running, timeout=_POLL, return_when=FIRST_COMPLETED)
                for future in done:
                    name, outcomes[name] = future.result()
                    bar.update()
                    bar.set_postfix_str(f"{name} {outcomes[name]['status']}")
    return outcomes


def split_batches(scripts: Sequence[Path]) -> list[list[Path]]:
    """Split `scripts` after each of `PRODUCERS`, with `SUMMARIES` in the last batch.

    The notebooks of a batch can run at the same time.
    """
    batches: list[list[Path]] = [[] for _ in range(len(PRODUCERS) + 2)]
    for script in sorted(scripts, key=lambda script: script.stem[:2] not in LONGEST):
        number = script.stem[:2]
        last = number in SUMMARIES
        batches[-1 if last else sum(number > producer for producer in PRODUCERS)].append(script)
    return batches


@contextmanager
def _open_executor(client: Any, jobs: int, futures: Sequence[Future[Any]]) -> Iterator[Executor]:
    """The workers of a Dask `client`, or threads that wait for kernels; an interruption ends `futures`."""
    with client.get_executor(pure=False) if client else ThreadPoolExecutor(jobs) as executor:
        try:
            yield executor
        except BaseException:
            if not client:
                end_kernels(futures)
            raise


def _start_summary(
    home: Path,
    data: str | Sequence[str],
    files: Sequence[Path],
    parameters: Mapping[str, Any],
    names: Sequence[str],
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Remove the outcomes of the notebooks `names`; return the source of the run, and the other outcomes.

    The source is version, content of the data, parameters. The other outcomes stay only if parameters.json
    equals it. Until the run is finished, the summary in the folder has not passed.
    """
    before = read_json_object(home / folders.PARAMETERS)
    outcomes = read_json_object(home / SUMMARY).get("notebooks", {})
    contents = [[file.name, *file_content(file)] for file in files]
    source = {"szlib": __version__, "data": datasets.label(data), "files": contents, "parameters": parameters}
    is_same = before == json.loads(json.dumps(source))
    earlier = {name: outcome for name, outcome in outcomes.items() if is_same and name not in names}
    (home / SUMMARY).unlink(missing_ok=True)
    if earlier:
        unfinished = {"passed": False, "unfinished": list(names), "notebooks": earlier}
        write_file(home / SUMMARY, json.dumps(unfinished, indent=1))
    write_file(home / folders.PARAMETERS, json.dumps(source, indent=1))
    return source, earlier


def _summarise(source: Mapping[str, Any], notebooks: Mapping[str, Any]) -> dict[str, Any]:
    passed = all(has_passed(outcome) for outcome in notebooks.values())
    return {**source, "passed": passed, "notebooks": dict(sorted(notebooks.items()))}


def has_passed(outcome: Mapping[str, Any]) -> bool:
    """Whether a notebook with this `outcome` has finished or is undecided, and none of its checks failed."""
    is_over = outcome["status"] in ("done", "undecided")
    return is_over and all(c["passed"] for c in outcome["checks"] if c["kind"] == "check")


def format_summary(summary: Mapping[str, Any]) -> str:
    """Format the `summary` of a run: a row for each notebook, each result that does not hold, the verdict."""
    rows, notes = [("notebook", "seconds", "checks", "observed", "key figures")], []
    for name, outcome in summary["notebooks"].items():
        done = outcome["status"] == "done"
        held = [_count_passed(outcome, kind) for kind in ("check", "observation")]
        key = ", ".join(f"{k} {format_value(v)}" for k, v in outcome["key_figures"].items())
        rows.append((name, f"{outcome['seconds']:.1f}", held[0] if done else outcome["status"], held[1], key))
        notes += [
            f"{name}: {c['name']}: {c['result']} ({c['value']})" for c in outcome["checks"] if not c["passed"]
        ]
        if "error" in outcome and outcome["status"] != "undecided":
            notes.append(f"{name}: {outcome['error']}")
    undecided = [name for name, n in summary["notebooks"].items() if n["status"] == "undecided"]
    notes += [f"not decidable on this data, see the report: {', '.join(undecided)}"] if undecided else []
    notes += [f"data: {text}" for text in summary.get("warnings", ())]
    notes += [f"area: {summary['area']}"] if "area" in summary else []
    table = [f"{row[0]:<24} {row[1]:>7} {row[2]:>11} {row[3]:>9}  {row[4]}" for row in rows]
    end = f"all checks {'that were made ' if undecided else ''}hold"
    return "\n".join([*table, *notes, end if summary["passed"] else "NOT ALL CHECKS HOLD"])


def _count_passed(outcome: Mapping[str, Any], kind: str) -> str:
    """How many of a kind hold, of how many, such as "3/4"; "-" if there are none."""
    passed = [c["passed"] for c in outcome["checks"] if c["kind"] == kind]
    return f"{sum(passed)}/{len(passed)}" if passed else "-"
