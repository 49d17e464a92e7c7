"""Work in parallel: processes here, or a Dask cluster, whatever joblib is configured for.

A laptop needs nothing: ``n_jobs=2``.  Inside ``joblib.parallel_config("dask")``, with a
``distributed.Client`` open, the same calls go to a Dask cluster; `cluster` opens both for an address.
"""

from __future__ import annotations

import os
import threading
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from typing import Any

import joblib
from joblib.externals.loky.process_executor import TerminatedWorkerError

from . import memory
from .errors import SzlibError

_PATIENCE = 10
"""So long a scheduler may take to answer [s]."""
_PER_CORE = 4
"""More processes than that for each core only get into each other's way."""
_HEARTBEAT = 0.5
"""So often a process looks whether its parent still lives [s]."""


def run_tasks(tasks: Sequence[Any], *, n_jobs: int | None = None) -> Iterator[Any]:
    """Results of ``joblib.delayed`` calls, each as soon as it is there, in any order.

    `n_jobs` is a number of processes, -1 for every core; None takes what ``joblib.parallel_config`` says, or
    one.  There are never more than tasks, nor, with a RuntimeWarning, than four for each core.  Processes
    end with this one, however it ends, and share the memory that it may use.
    Raises SzlibError where a process here is killed; a cluster computes again what a worker took with it.
    """
    done, parent, n_jobs = 0, os.getpid(), bounded(n_jobs, len(tasks))
    share = _share(n_jobs)
    guarded = [joblib.delayed(_in_share)(parent, share, task) for task in tasks]
    workers = joblib.Parallel(
        n_jobs=n_jobs, return_as="generator_unordered", initializer=end_with, initargs=(parent,)
    )
    try:
        with closing(workers(guarded)) as results:
            for result in results:
                done += 1
                yield result
    except TerminatedWorkerError as error:
        raise SzlibError(
            f"a worker process was killed after {done} of {len(tasks)} tasks, perhaps for lack of memory "
            f"({' '.join(str(error).split())}); what was finished is kept: run again, with fewer processes"
        ) from error


def bounded(n_jobs: int | None, tasks: int) -> int | None:
    """A number of processes that makes sense for so many tasks on this machine."""
    if n_jobs == 0:
        raise SzlibError("n_jobs must be a number of processes, or -1 for every core; got 0")
    if n_jobs is None or n_jobs < 0:
        return n_jobs
    most = _PER_CORE * (os.cpu_count() or 1)
    if n_jobs > most:
        warnings.warn(
            f"of {n_jobs} processes {min(most, max(tasks, 1))} are used: at most one for each task, and "
            f"{_PER_CORE} for each core",
            RuntimeWarning,
            stacklevel=3,
        )
    return min(n_jobs, most, max(tasks, 1))


def end_with(parent: int) -> None:
    """End this process as soon as `parent`, which started it, has ended, even by SIGKILL.

    As the initializer of a pool it holds before the first task comes, and where the parent is gone by then.
    """

    def watch() -> None:
        """Look after the parent until it is gone."""
        while os.getppid() == parent:
            time.sleep(_HEARTBEAT)
        os._exit(1)

    if os.getppid() != parent:
        os._exit(1)
    threading.Thread(target=watch, name="ends with its parent", daemon=True).start()


def _in_share(parent: int, share: int | None, task: tuple[Callable[..., Any], Any, Any]) -> Any:
    """One task, in this process or one that it started, within that process's share of memory."""
    function, positional, named = task
    with memory.granted(share if parent in (os.getpid(), os.getppid()) else None):
        return function(*positional, **named)


def _share(n_jobs: int | None) -> int | None:
    """The memory of one of these processes: None for workers elsewhere, who have their own."""
    limit = memory.ceiling()
    return None if limit is None else limit // max(1, joblib.effective_n_jobs(n_jobs))


@contextmanager
def cluster(address: str | None) -> Iterator[Any]:
    """Hand out everything inside to the Dask scheduler at `address`; gives the client. None changes nothing.

    Raises SzlibError where nobody answers there, or the extra `cluster` is not installed.
    """
    if address is None:
        yield None
        return
    try:
        from distributed import Client
    except ImportError as error:
        raise SzlibError("a scheduler needs Dask; install it with: pip install -e '.[cluster]'") from error
    try:
        client = Client(address, timeout=_PATIENCE)
    except (OSError, ValueError) as error:
        raise SzlibError(
            f"no Dask scheduler answers at {address!r} ({error}); start one with `dask scheduler`, and give "
            "its address, such as tcp://10.0.0.1:8786"
        ) from error
    with client, joblib.parallel_config("dask"):
        yield client
