"""Execution of all notebooks: in their order, several at a time, with a summary of their checks.

Each notebook is executed in a kernel of its own and leaves a record. The run collects the records in
summary.json and writes the report.
"""

from __future__ import annotations

import io
import json
import os
import platform
import shlex
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from datetime import UTC, datetime
from importlib.metadata import version
from itertools import groupby
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pandas as pd
import psutil
from filelock import FileLock
from joblib import Parallel, delayed
from tqdm import tqdm

from ..core.errors import DataError, StorageError
from ..core.files import load_cached, write_file
from ..core.input_files import (
    MEMORY_VARIABLE,
    environment,
    explain_errors,
    memory_limit,
)
from ..core.parallel import limit_jobs
from ..tracks import datasets, funnels
from . import folders
from .execution import EMPTY_RECORD, execute_notebook
from .record.data_cache import DataCache, describe_missing_data, read_stored_zone
from .record.parameters import ZoneMethod, check_parameters

# The notebooks whose results later ones need (the encounters, the zone), and those that read all records.
PRODUCERS = ("02", "05")
SUMMARIES = ("28",)
# Notebooks that take longest. They start first in their batch, so that no core waits for them at its end.
LONGEST = ("06", "25", "26")
SUMMARY = "summary.json"  # file of the outcome of a run
# Packages whose versions the report states.
PACKAGES = ("numpy", "scipy", "pandas", "scikit-learn", "casadi", "matplotlib")
NOT_STARTED: dict[str, Any] = {"status": "not started", "seconds": 0.0, **EMPTY_RECORD}


def run(
    data: str | Sequence[str] = datasets.SYNTHETIC,
    *,
    out: str | Path | None = None,
    jobs: int = 1,
    only: Iterable[str] = (),
    parameters: Mapping[str, Any] | None = None,
    notebooks: str | Path | None = None,
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
    notebooks : the folder of the notebooks; None as for `folders.find_notebooks`.
    figures : a format in which figures are saved besides PNG, "svg" or "pdf".

    Returns
    -------
    The summary: passed; verdict; path of the report; status, seconds, checks and key figures by notebook.
    A status is "done"; "undecided": too few encounters for a zone; "error": a cell failed; "refused": data,
    disk or memory do not allow it; "not started": an earlier one was refused. ``summary.json`` also has the
    notebooks of earlier runs on the same data, parameters and version.

    Raises
    ------
    DataError : the data set, a notebook or a parameter is unknown, or a parameter is out of its range.
    StorageError : the results cannot be written, or another run writes to the same folder.
    """
    place = folders.find_notebooks(notebooks)
    known = folders.list_notebooks(place)
    scripts = choose_notebooks(known, only)
    early = (s for s in known if s.stem[:2] <= PRODUCERS[-1])
    given = check_parameters(parameters or {}, sorted({*scripts, *early}))
    root = folders.default_results(place) if out is None else folders.results_root(out)
    data = folders.absolute_data(data)
    home = folders.claim_results(root, data, given)
    with _folder_lock(home), environment(PYTHONSAFEPATH="1"):
        made_of = _find_source(home, data, given)
        source = {name: made_of[name] for name in ("szlib", "data", "files")}
        source["parameters"] = given
        names = [script.stem for script in scripts]
        outcomes = _stored_outcomes(home, source, known)
        outcomes |= dict.fromkeys(names, NOT_STARTED)
        write_file(home / folders.PARAMETERS, json.dumps(source, indent=1))
        folders.remove_outputs(home, names)
        unfinished = {**source, "passed": False, "notebooks": outcomes}
        _store(home, unfinished)
        variables = given | {"data": data, "results": str(root)}
        for name, outcome in _execute_all(scripts, variables, home, jobs, figures):
            outcomes[name] = outcome
            _store(home, unfinished)
        source |= _describe_machine() | _describe_data(home, source, made_of, outcomes)
        summary = _store(home, _summarise(source, outcomes))
        if any((home / f"{name}.ipynb").exists() for name in outcomes):
            # importing it takes longer than all other imports
            from .report import write_report

            source["report"] = str(write_report(home, summary))
    return _summarise(source, {name: outcomes[name] for name in names})


@contextmanager
def _folder_lock(folder: Path) -> Iterator[None]:
    """Reserve a `folder` for this process; the lock ends with the process.

    Raises StorageError where another process has reserved it, or where this one may not write.
    """
    lock = FileLock(folder / ".szlib-lock-run", timeout=0)
    with ExitStack() as stack:
        with explain_errors(
            f"{folder}: cannot be written, or another process is writing there",
            "wait until it ends, or choose another folder",
            StorageError,
            OSError,
        ):
            stack.enter_context(lock)
        yield


def _find_source(
    home: Path, data: str | Sequence[str], given: Mapping[str, Any]
) -> dict[str, Any]:
    """What the encounters of a run are made of, as of `DataCache.source`."""
    method = ZoneMethod.from_variables(given)
    area = given.get("area", "")
    return DataCache(home, data, area, given.get("seed", 0), method).source()


def _describe_machine() -> dict[str, Any]:
    """When, how and where a run was made, as the report states it."""
    python = f"Python {platform.python_version()}"
    return {
        "date": datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        "command": shlex.join(["szlib", *sys.argv[1:]]),
        "machine": f"{platform.platform()}, {os.cpu_count()} cores",
        "versions": ", ".join([python, *(f"{p} {version(p)}" for p in PACKAGES)]),
    }


def _describe_data(
    home: Path,
    source: Mapping[str, Any],
    made_of: Mapping[str, Any],
    outcomes: Mapping[str, Any],
) -> dict[str, Any]:
    """Stages, area, warnings and verdict of the data of a run, from the encounters and the zone in `home`.

    Encounters that are not `made_of` this data and these parameters are left out.
    """
    found: dict[str, Any] = {}
    zone = read_stored_zone(home / "zone.json")
    samples = home / "encounters.parquet"
    if zone and zone.provenance.get("source", {}).get("files") == source["files"]:
        speed = ZoneMethod.from_variables(source["parameters"]).zone_speed
        found["verdict"] = f"zone at {speed:g} m/s: {zone.verdict(speed).sentence}"
    if content := load_cached(samples, made_of):
        table = pd.read_parquet(io.BytesIO(content), columns=[])
        stages = funnels.get(table)
        found["stages"] = funnels.table(stages).to_dict("records")
        found["warnings"] = funnels.warnings(stages)
        found["area"] = "{area} {area_reason}".format_map(table.attrs).strip()
        is_undecided = any(o["status"] == "undecided" for o in outcomes.values())
        if is_undecided and "verdict" not in found:
            found["verdict"] = f"undecided: {describe_missing_data(samples)}"
    return found


def choose_notebooks(scripts: Sequence[Path], only: Iterable[str]) -> list[Path]:
    """The `scripts` of the notebooks whose numbers or names are in `only`; all if it is empty.

    Raises DataError for an unknown name.
    """
    found = {name: [s for s in scripts if folders.has_name(s, name)] for name in only}
    unknown = [name for name, each in found.items() if not each]
    if unknown:
        known = [script.stem for script in scripts]
        raise DataError(
            f"no notebook {', '.join(unknown)}; there are {', '.join(known)}"
        )
    chosen = sum(found.values(), start=list[Path]())
    return [script for script in scripts if not found or script in chosen]


def _execute_all(
    scripts: Sequence[Path],
    given: Mapping[str, Any],
    home: Path,
    jobs: int,
    figures: str | None,
) -> Iterator[tuple[str, dict[str, Any]]]:
    """Execute the notebooks; yield the name and the outcome of each when it has ended."""
    jobs = max(limit_jobs(jobs, len(scripts)), 1)
    threads = str(max(1, (os.cpu_count() or 1) // jobs))
    variables = {
        folders.RUN_VARIABLE: str(home),
        folders.FIGURES_VARIABLE: figures or "",
        MEMORY_VARIABLE: str(memory_limit() // jobs),
        "OMP_NUM_THREADS": os.environ.get("OMP_NUM_THREADS", threads),
    }
    # at least one thread besides this one, with which signals stay
    options = {"backend": "threading", "return_as": "generator_unordered"}
    workers = Parallel(max(jobs, 2), pre_dispatch=jobs, batch_size=1, **options)
    bar = tqdm(total=len(scripts), unit="notebook", desc=home.name, disable=None)
    with bar, TemporaryDirectory(prefix="szlib-") as private:
        variables |= {"TMPDIR": private, "IPYTHONDIR": private}

        def execute(script: Path) -> tuple[str, dict[str, Any]]:
            """The name of a notebook and its outcome."""
            return script.stem, execute_notebook(script, given, home, variables)

        try:
            for batch in split_batches(scripts):
                is_refused = False
                for name, outcome in workers(map(delayed(execute), batch)):
                    is_refused |= outcome["status"] == "refused"
                    bar.update()
                    bar.set_postfix_str(f"{name} {outcome['status']}")
                    yield name, outcome
                if is_refused:
                    return  # the later notebooks need its result
        except BaseException:
            _end_kernels()
            raise


def _end_kernels() -> None:
    """End all kernels that still run, so that the threads that wait for them end, too.

    The server that forks them lives on: a dying one would be asked for the next kernel.
    """
    for process in psutil.Process().children(recursive=True):
        with suppress(psutil.Error):
            words = " ".join(process.cmdline())
            is_forked = "multiprocessing.forkserver" in words
            if (is_forked and process.ppid() != os.getpid()) or "-m ipykernel" in words:
                process.kill()


def split_batches(scripts: Sequence[Path]) -> list[list[Path]]:
    """Split `scripts` after each of `PRODUCERS`, with `SUMMARIES` in the last batch.

    The notebooks of a batch can run at the same time.
    """

    def find_batch(script: Path) -> tuple[bool, list[bool]]:
        """Whether it is a summary, and after which producers it comes."""
        number = script.stem[:2]
        return number in SUMMARIES, [number > each for each in PRODUCERS]

    ordered = sorted(scripts, key=lambda s: (find_batch(s), s.stem[:2] not in LONGEST))
    return [list(batch) for _, batch in groupby(ordered, find_batch)]


def _stored_outcomes(
    home: Path, source: Mapping[str, Any], known: Iterable[Path]
) -> dict[str, dict[str, Any]]:
    """The outcomes of `known` notebooks in an earlier run of the same version, data and parameters."""
    stored = folders.read_json_object(home / SUMMARY)
    as_stored = json.loads(json.dumps(source))
    outcomes = stored["notebooks"] if as_stored.items() <= stored.items() else {}
    return {s.stem: outcomes[s.stem] for s in known if s.stem in outcomes}


def _store(home: Path, summary: dict[str, Any]) -> dict[str, Any]:
    """Write the summary of a run, and return it."""
    write_file(home / SUMMARY, json.dumps(summary, indent=1))
    return summary


def _summarise(
    source: Mapping[str, Any], notebooks: Mapping[str, Any]
) -> dict[str, Any]:
    passed = all(has_passed(outcome) for outcome in notebooks.values())
    return {**source, "passed": passed, "notebooks": dict(sorted(notebooks.items()))}


def has_passed(outcome: Mapping[str, Any]) -> bool:
    """Whether a notebook with this `outcome` has finished or is undecided, and none of its checks failed."""
    has_failed = any(
        check["kind"] == "check" and not check["passed"] for check in outcome["checks"]
    )
    return outcome["status"] in ("done", "undecided") and not has_failed
