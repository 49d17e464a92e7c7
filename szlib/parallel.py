"""Work in parallel: processes here, or a Dask cluster, whatever joblib is configured for.

A laptop needs nothing: ``n_jobs=2``.  Inside ``joblib.parallel_config("dask")``, with a
``distributed.Client`` open, the same calls go to a Dask cluster; `cluster` opens both for an address.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import joblib
from joblib.externals.loky.process_executor import TerminatedWorkerError

from .errors import SzlibError

_PATIENCE = 10
"""So long a scheduler may take to answer [s]."""


def run_tasks(tasks: Sequence[Any], *, n_jobs: int | None = None) -> Iterator[Any]:
    """Results of ``joblib.delayed`` calls, each as soon as it is there, in any order.

    `n_jobs` is a number of processes; None takes what ``joblib.parallel_config`` says, or one.
    Raises SzlibError where a process here is killed; a cluster computes again what a worker took with it.
    """
    done = 0
    try:
        for result in joblib.Parallel(n_jobs=n_jobs, return_as="generator_unordered")(tasks):
            done += 1
            yield result
    except TerminatedWorkerError as error:
        raise SzlibError(
            f"a worker process was killed after {done} of {len(tasks)} tasks, perhaps for lack of memory "
            f"({error}); what was finished is kept: run again, with fewer processes"
        ) from error


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
