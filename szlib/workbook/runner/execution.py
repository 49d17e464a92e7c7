"""The whole workbook, headless, from tracks to a robot that yields.

Each notebook is executed by papermill from its percent script, and leaves a record of its checks
and key figures; the run gathers them in summary.json and ends with a table.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor, Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import active_children, get_context
from pathlib import Path
from typing import Any

from tqdm import tqdm

from ... import __version__, memory
from ...encounters.areas import AUTO, as_area
from ...errors import DataError, SzlibError
from ...files import file_content, folder_lock, remove_abandoned_temporary
from ...parallel import cluster, limit_jobs
from ...tracks import datasets
from ..record import places
from ..record.notebook import data_files
from ..record.validation import check_parameters
from . import summary, worker

PRODUCERS = ("02", "05")
"""Later notebooks need what these leave, encounters and zone; all others can run side by side."""


def run(
    data: str | Sequence[str] = datasets.SYNTHETIC,
    *,
    out: str | Path = places.RESULTS,
    jobs: int = 1,
    only: Iterable[str] = (),
    parameters: Mapping[str, Any] | None = None,
    scheduler: str | None = None,
) -> dict[str, Any]:
    """Execute the notebooks on a data set, and gather what they found.

    Parameters
    ----------
    data : "synthetic", "atc-1hz", or paths of track files.
    out : folder of results, by default `results` beside the notebooks; this data set's go into a folder
        of their own in it, and with other than the default parameters into another: see `places`.
    jobs : notebooks at a time, once the zone is there.
    only : numbers ("07") or names of the notebooks to run; all of them by default.
    parameters : further parameters of the notebooks, such as {"seed": 1}.
    scheduler : address of a Dask cluster that shares this file system and runs the notebooks.

    Returns
    -------
    The summary: passed, and for each notebook its status ("done"; "error": the notebook broke off;
    "refused": data, disk or memory do not allow it; "not started": one that comes before was refused),
    seconds, checks (name, passed, value) and key figures; and the path of the `report` that was made of it.
    The summary is written to ``summary.json`` in that folder, together with what earlier runs of other
    notebooks left there with the same parameters, data and version.  What a run replaces is withdrawn first.

    Raises
    ------
    DataError : no such data, notebook or parameter, or a parameter out of its range.
    StorageError : results cannot be written there, or another run is writing there.
    """
    sources = _chosen(only)
    known = sorted({*sources, *(n for n in places.notebooks() if n.stem[:2] <= PRODUCERS[-1])})
    given = check_parameters(parameters or {}, known)
    if given.get("area", AUTO) != AUTO:  # in one form, whatever file or text it came from
        given["area"] = str(as_area(given["area"]))
    asked = places.absolute(data)
    files = [] if asked == datasets.SYNTHETIC else datasets.find(asked)
    results = places.root(out)
    home = places.home(results, asked, given, inputs=files)
    with folder_lock(home):
        seed = given.get("seed", 0)
        files = files or data_files(asked, folder=home, seed=seed)
        names = [source.stem for source in sources]
        identity = _identity(asked, files, given)
        earlier = summary.begin(home, identity, names)
        places.withdraw(home, names)
        given |= {"data": asked, "results": str(results)}
        outcomes = _outcomes(sources, given, home, jobs, scheduler)
        done = summary.finish(home, identity, earlier, {name: outcomes[name] for name in names})
        from ..report import document  # takes longer to load than all the rest

        return done | ({"report": str(document.write(home))} if document.executed(home) else {})


def _outcomes(
    sources: Sequence[Path], given: dict[str, Any], home: Path, jobs: int, scheduler: str | None
) -> dict[str, dict[str, Any]]:
    """What came of each notebook, by its name."""
    jobs = limit_jobs(jobs, len(sources))
    limit = None if scheduler else memory.limit()
    share = None if limit is None else limit // max(jobs, 1)
    outcomes: dict[str, dict[str, Any]] = {}
    bar = tqdm(total=len(sources), unit="notebook", desc=datasets.label(given["data"]))
    with bar, cluster(scheduler) as client, _pool(client, jobs) as pool:
        for batch in _batches(sources):
            if any(o["status"] == "refused" for o in outcomes.values()):
                break  # what comes later needs what could not be made
            for future in as_completed(_submit(pool, batch, given, home, share)):
                name, outcome = future.result()
                outcomes[name] = outcome
                bar.update()
                bar.set_postfix_str(f"{name} {outcome['status']}")
    left = {"status": summary.NOT_STARTED, "seconds": 0.0, **worker.EMPTY_RECORD}
    return {source.stem: outcomes.get(source.stem, left) for source in sources}


def _batches(sources: Sequence[Path]) -> list[list[Path]]:
    """Notebooks that can run side by side, in their order: up to each of `PRODUCERS`, and the rest."""
    after = [sum(source.stem[:2] > producer for producer in PRODUCERS) for source in sources]
    return [[s for s, n in zip(sources, after, strict=True) if n == k] for k in range(len(PRODUCERS) + 1)]


def _identity(data: str | Sequence[str], files: Sequence[Path], given: Mapping[str, Any]) -> dict[str, Any]:
    """What a run is of: the version, the content of the data, and the parameters that are not defaults."""
    return {
        "szlib": __version__,
        "data": datasets.label(data),
        "files": [[file.name, *file_content(file)] for file in files],
        "parameters": dict(given),
    }


@contextmanager
def _pool(client: Any, jobs: int) -> Iterator[Executor]:
    """The workers of a Dask cluster, or processes here, which end at once where this one is interrupted."""
    if client is not None:
        with client.get_executor(pure=False) as executor:
            yield executor
        return
    others = set(active_children())
    pool = ProcessPoolExecutor(
        max(jobs, 1), mp_context=get_context("spawn"), initializer=worker.begin, initargs=(os.getpid(), jobs)
    )
    try:
        yield pool
    except BaseException as error:
        for child in set(active_children()) - others:
            child.terminate()  # kernels end with their parents
        pool.shutdown(wait=True, cancel_futures=True)
        remove_abandoned_temporary()
        if isinstance(error, BrokenProcessPool):
            raise SzlibError(
                "a process that executed notebooks was killed, perhaps for lack of memory; what was finished "
                "is kept: run again, with fewer --jobs"
            ) from error
        raise
    pool.shutdown()


def _submit(
    pool: Executor, sources: Iterable[Path], given: dict[str, Any], home: Path, share: int | None
) -> list[Future[Any]]:
    return [pool.submit(worker.execute, str(source), given, str(home), share) for source in sources]


def _chosen(only: Iterable[str]) -> list[Path]:
    sources = places.notebooks()
    if not sources:
        raise DataError(
            f"{places.NOTEBOOKS}: no notebooks; they come with the repository, not with the package: get a "
            "copy of it, and there `make run`, or pip install -e '.[workbook]' and `szlib run`"
        )
    wanted = list(only)
    unknown = [name for name in wanted if not any(places.is_called(source, name) for source in sources)]
    if unknown:
        raise DataError(
            f"no notebook {', '.join(unknown)}; there are {', '.join(source.stem for source in sources)}"
        )
    return [s for s in sources if not wanted or any(places.is_called(s, name) for name in wanted)]
