"""Parallel work: processes on this machine, or a Dask cluster, as joblib is configured.

On one machine pass ``n_jobs=2``. Inside ``joblib.parallel_config("dask")``, with an open
``distributed.Client``, the same calls run on the Dask cluster; `cluster` opens both for an address.
"""

from __future__ import annotations

import os
import signal
import threading
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager, nullcontext
from multiprocessing import resource_tracker
from typing import Any

import joblib
from joblib.externals.loky.backend import resource_tracker as loky_resource_tracker
from joblib.externals.loky.process_executor import TerminatedWorkerError

from .errors import SzlibError
from .files import process_folder
from .input_files import explain_errors, granted_memory, memory_limit

# longest wait for the answer of a scheduler, and for its first worker [s]
_CONNECT_TIMEOUT = 10.0
_MAX_PER_CORE = 4  # more processes than this for each core slow each other down
_HEARTBEAT = 0.5  # interval at which a process checks that its parent lives [s]


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
    done, parent, n_jobs = 0, os.getpid(), limit_jobs(n_jobs, len(tasks))
    jobs = None if n_jobs == 1 else n_jobs
    share = memory_limit() // max(1, joblib.effective_n_jobs(jobs))
    workers = joblib.Parallel(
        n_jobs=jobs,
        return_as="generator_unordered",
        temp_folder=None if jobs is None else process_folder(),
        initializer=end_with,
        initargs=(parent,),
    )
    guarded = [joblib.delayed(_run_in_share)(parent, share, task) for task in tasks]
    try:
        with safe_path():
            is_one = workers.n_jobs in (1, None)
            with nullcontext() if is_one else uninterrupted():
                results = workers(guarded)
            with closing(results):
                for result in results:
                    done += 1
                    yield result
    except TerminatedWorkerError as error:
        raise SzlibError(
            f"a worker process was killed after {done} of {len(tasks)} tasks, perhaps for lack of memory "
            f"({' '.join(str(error).split())}); finished tasks are kept: run again with fewer processes"
        ) from error


@contextmanager
def safe_path() -> Iterator[None]:
    """Start processes inside a with block that import nothing from the current folder."""
    is_set = bool(os.environ.get("PYTHONSAFEPATH"))
    os.environ["PYTHONSAFEPATH"] = "1"
    try:
        yield
    finally:
        if not is_set:
            os.environ.pop("PYTHONSAFEPATH", None)


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Start threads and processes inside a with block that Ctrl-C does not reach, only this one."""
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGHUP})
    try:
        for tracker in (resource_tracker, loky_resource_tracker):
            tracker.ensure_running()  # outlives a closed terminal, to clean up; its start unblocks Ctrl-C
        signal.pthread_sigmask(signal.SIG_SETMASK, before | {signal.SIGINT})
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def limit_jobs(n_jobs: int, n_tasks: int) -> int:
    """Reduce `n_jobs` to at most `n_tasks` and, with a RuntimeWarning, to four for each core; -1 is left.

    Raises SzlibError for 0.
    """
    if n_jobs == 0:
        raise SzlibError(
            "n_jobs must be a number of processes, or -1 for every core; got 0"
        )
    if n_jobs < 0:
        return n_jobs
    largest = _MAX_PER_CORE * (os.cpu_count() or 1)
    allowed = min(n_jobs, largest, max(n_tasks, 1))
    if n_jobs > largest:
        warnings.warn(
            f"n_jobs={n_jobs} is reduced to {allowed}: at most one process for each task, and "
            f"{_MAX_PER_CORE} for each core",
            RuntimeWarning,
            stacklevel=3,
        )
    return allowed


def end_with(parent: int) -> None:
    """End this process soon after the process number `parent`, which started it, ends, even by SIGKILL.

    As the initializer of a pool it runs before the first task, also if the parent has ended by then.
    """

    def watch_parent() -> None:
        """Poll until the parent has ended."""
        while os.getppid() == parent:
            time.sleep(_HEARTBEAT)
        os._exit(1)

    if os.getppid() != parent:
        os._exit(1)
    threading.Thread(
        target=watch_parent, name="ends with its parent", daemon=True
    ).start()


def _run_in_share(
    parent: int, share: int, task: tuple[Callable[..., Any], Any, Any]
) -> Any:
    """Run one task, within `share` bytes of memory on the machine of `parent`, else within its limit."""
    function, positional, named = task
    with granted_memory(share if parent in (os.getpid(), os.getppid()) else None):
        return function(*positional, **named)


@contextmanager
def cluster(address: str | None, *, wait: float = _CONNECT_TIMEOUT) -> Iterator[Any]:
    """Run parallel work inside a with block on the Dask scheduler at `address`; yields the client.

    None changes nothing. `wait` is the longest wait for the first worker [s]. Raises SzlibError if no
    scheduler answers, no worker joins it, or the extra `cluster` is not installed.
    """
    if address is None:
        yield None
        return
    advice = "install it with: pip install -e '.[cluster]'"
    with explain_errors("a scheduler needs Dask", advice, SzlibError, ImportError):
        from distributed import Client
    with explain_errors(
        f"no Dask scheduler answers at {address!r}",
        "start one with `dask scheduler`, and give its address, such as tcp://10.0.0.1:8786",
        SzlibError,
    ):
        client = Client(address, timeout=max(wait, _CONNECT_TIMEOUT))
    with client:
        with explain_errors(
            f"no worker joined the scheduler at {address!r} within {wait:g} s",
            f"start one with `dask worker {address}`, or wait longer, such as --wait 600",
            SzlibError,
        ):
            client.wait_for_workers(1, timeout=wait)
        with joblib.parallel_config("dask"):
            yield client
