"""Parallel work: processes on this machine, or a Dask cluster, as joblib is configured.

On one machine pass ``n_jobs=2``. Inside ``joblib.parallel_config("dask")``, with an open
``distributed.Client``, the same calls run on the Dask cluster; `cluster` opens both for an address.
"""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import joblib
from joblib.externals.loky.process_executor import TerminatedWorkerError

from .errors import SzlibError
from .input_files import (
    MEMORY_VARIABLE,
    environment,
    explain_errors,
    memory_limit,
    require,
)

_MAX_PER_CORE = 4  # more processes than this for each core slow each other down


def run_tasks(tasks: Sequence[Any], *, n_jobs: int = 1) -> Iterator[Any]:
    """Yield the results of ``joblib.delayed`` calls, each when it is finished, in any order.

    The processes end with this one, even if it is killed, and share its memory limit.

    Parameters
    ----------
    tasks : the ``joblib.delayed`` calls.
    n_jobs : number of processes; -1: one for each core. With 1, the configuration of
        ``joblib.parallel_config`` applies, if there is one. See `limit_jobs`.

    Raises
    ------
    SzlibError : a process on this machine was killed. A cluster repeats the tasks of a lost worker.
    """
    n_jobs = limit_jobs(n_jobs, len(tasks))
    jobs = None if n_jobs == 1 else n_jobs
    workers = joblib.Parallel(
        n_jobs=jobs,
        return_as="generator_unordered",
        initializer=_begin_process,
        initargs=(
            os.getpid(),
            memory_limit() // max(1, joblib.effective_n_jobs(jobs)),
        ),
    )
    with explain_errors(
        "a worker process was killed, perhaps for lack of memory",
        "finished tasks are kept: run again with fewer processes",
        SzlibError,
        TerminatedWorkerError,
    ):
        # no process imports from the current folder
        with environment(PYTHONSAFEPATH="1"):
            results = workers(tasks)
        yield from results


def limit_jobs(n_jobs: int, n_tasks: int) -> int:
    """Reduce `n_jobs` to at most `n_tasks`, and to four for each core; -1 is left."""
    require(n_jobs, "n_jobs", n_jobs, "a number of processes, or -1 for every core")
    return min(n_jobs, _MAX_PER_CORE * (os.cpu_count() or 1), max(n_tasks, 1))


def _begin_process(parent: int, memory: int) -> None:
    """Prepare a process of the process number `parent`: it may use `memory` bytes, and ends with its parent.

    Ctrl-C ends it through its parent, without a message of its own.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.environ[MEMORY_VARIABLE] = str(memory)

    def watch_parent() -> None:
        """End this process once the parent has ended, even by SIGKILL."""
        while os.getppid() == parent:
            time.sleep(0.5)
        os._exit(1)

    threading.Thread(target=watch_parent, daemon=True).start()


@contextmanager
def cluster(address: str | None, *, wait: float = 10.0) -> Iterator[Any]:
    """Run parallel work inside a with block on the Dask scheduler at `address`; yields the client.

    None changes nothing. `wait` is the longest wait for the scheduler and for its first worker [s]. Raises
    SzlibError if no scheduler answers, no worker joins it, or the extra `cluster` is not installed.
    """
    if address is None:
        yield
        return
    with explain_errors(
        f"no Dask scheduler with a worker answers at {address!r} within {wait:g} s",
        f"start `dask scheduler`, and `dask worker {address}`, or wait longer, such as --wait 600; "
        "Dask is installed by: pip install 'szlib[cluster]'",
        SzlibError,
    ):
        from distributed import Client

        client = Client(address, timeout=wait)
        client.wait_for_workers(1, timeout=wait)
    with client, joblib.parallel_config("dask"):
        yield client
