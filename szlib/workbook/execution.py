"""One notebook: papermill sets its parameters, and nbclient, papermill's engine, executes it.

Kernels are those of this Python. On Linux they are forked from a process with most imports, which saves 5 s
of CPU time for each notebook.
"""

from __future__ import annotations

import asyncio
import atexit
import logging
import os
import sys
import tempfile
import time
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from multiprocessing import forkserver, get_context
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

from ipykernel.kernelspec import get_kernel_dict
from jupyter_client.kernelspec import KernelSpec
from jupyter_client.manager import AsyncKernelManager
from jupyter_client.provisioning.local_provisioner import LocalProvisioner

from ..core.errors import SzlibError
from ..core.files import write_file
from ..core.input_files import printable
from .folders import read_json_object
from .record.data_cache import describe_missing_data
from .record.parameters import METHOD_DEFAULTS, read_defaults

# Errors caused by data, disk or memory, not by the notebook.
REFUSED = {
    "DataError",
    "StorageError",
    "MemoryLimitError",
    "ZoneError",
    "SolverError",
    "SzlibError",
    "MemoryError",
    "OSError",
    "PermissionError",
    "FileNotFoundError",
    "IsADirectoryError",
    "NotADirectoryError",
    "DeadKernelError",
}
INLINE = "module://matplotlib_inline.backend_inline"  # the backend that shows figures in a notebook
# of temporary files [characters]: in a longer one the server of forks has no room for its socket
_LONGEST_FOLDER = 70
# Nothing of it imports polars, whose threads a fork does not survive.
PRELOADED = [
    "ipykernel.kernelapp",
    "matplotlib.pyplot",
    "sklearn.neighbors",
    "pandas.io.formats.style",
    "szlib.control.mpc",
    "szlib.simulation.monte_carlo",
]
# The record of a notebook that wrote none.
EMPTY_RECORD: dict[str, Any] = {"checks": [], "key_figures": {}, "figures": []}


def execute_notebook(
    script: Path,
    parameters: Mapping[str, Any],
    folder: Path,
    environment: Mapping[str, str],
) -> dict[str, Any]:
    """Execute one notebook in a kernel of its own, and save the executed copy.

    Parameters
    ----------
    script : the notebook's percent script.
    parameters : values that replace the defaults of the cell tagged "parameters".
    folder : the results of the run.
    environment : further environment variables of the kernel.

    Returns
    -------
    The outcome of the notebook: status, seconds, an error if there is one, and its record.
    """
    start = time.perf_counter()
    outcome: dict[str, Any] = {"status": "done"}
    try:
        run_cells(script, parameters, folder, environment)
    except Exception as error:  # of szlib, of a cell, or of Jupyter
        outcome = _describe(error, folder)
    outcome["seconds"] = round(time.perf_counter() - start, 2)
    record = read_json_object(folder / "records" / f"{script.stem}.json")
    if not record.get("closed") and outcome["status"] == "done":
        missing = "the notebook wrote no record; it must end with record.close()"
        outcome |= {"status": "error", "error": missing}
    return outcome | {
        name: record.get(name, EMPTY_RECORD[name]) for name in EMPTY_RECORD
    }


def _describe(error: Exception, folder: Path) -> dict[str, Any]:
    """Status and text of the `error` that ended a notebook, whose results are in `folder`."""
    name = getattr(error, "ename", type(error).__name__)
    text = " ".join(f"{name}: {getattr(error, 'evalue', error)}".split())
    outcome = {"status": "error", "error": printable(text)}
    if name in REFUSED or isinstance(error, SzlibError | OSError | MemoryError):
        outcome["status"] = "refused"
    samples = folder / "encounters.parquet"
    if name == "ZoneError" and describe_missing_data(samples):
        outcome["status"] = "undecided"
        outcome["error"] = f"not decidable on this data: {outcome['error']}"
    return outcome


def run_cells(
    script: Path,
    parameters: Mapping[str, Any],
    folder: Path,
    environment: Mapping[str, str],
) -> None:
    """Run the cells of a notebook, and write the executed copy, also if a cell fails.

    `script`, `parameters`, `folder` and `environment` are those of `execute_notebook`.
    Raises the error of nbclient for a cell that fails, or for a kernel that ends.
    """
    # a kernel, which also imports this module, needs none of them
    import jupytext
    import nbformat
    import papermill
    from nbclient import NotebookClient
    from nbclient.exceptions import CellExecutionError

    # The parameters of the zone are in no notebook's own cell.
    logging.getLogger("papermill").setLevel(logging.ERROR)
    known = METHOD_DEFAULTS.keys() | read_defaults(script).keys()
    notebook = papermill.execute_notebook(
        jupytext.read(script),
        None,
        {name: value for name, value in parameters.items() if name in known},
        kernel_name="python3",
        language="python",
        prepare_only=True,
    )
    notebook.metadata.pop("papermill")  # times and paths of this machine
    # The packages beside the notebooks come last: no file there replaces a library.
    place = script.parents[1] if script.parent.name == "deeper" else script.parent
    client = NotebookClient(
        notebook,
        kernel_manager_class=OwnKernelManager,
        resources={"metadata": {"path": str(script.parent)}},
        extra_arguments=[
            "--log-level=CRITICAL",
            f"--InteractiveShellApp.exec_lines=import sys; sys.path.append({str(place)!r})",
        ],
    )
    kernel = {"MPLBACKEND": INLINE, "PYTHONSAFEPATH": "1", **environment}
    failure = None
    try:
        run = client.async_execute(env=os.environ | kernel)
        with ThreadPoolExecutor(1) as thread:  # an event loop may run in this one
            thread.submit(asyncio.run, run).result()
    except CellExecutionError as error:
        failure = error
    finally:
        # after Ctrl-C it would fail at exit; the kernel ends by itself
        atexit.unregister(client._cleanup_kernel)
    write_file(folder / f"{script.stem}.ipynb", nbformat.writes(notebook))
    if failure:
        raise failure


class OwnKernelManager(AsyncKernelManager):
    """Jupyter's manager of kernels for this Python, whatever others have its name; `options` as Jupyter's."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        folder = tempfile.gettempdir()
        if sys.platform == "linux" and len(folder) < _LONGEST_FOLDER:
            spec = self.kernel_spec
            self.provisioner = ForkingProvisioner(kernel_spec=spec, parent=self)

    @property
    def kernel_spec(self) -> KernelSpec:
        """How this Python starts its kernel."""
        return KernelSpec(**get_kernel_dict())


class ForkingProvisioner(LocalProvisioner):
    """A kernel provisioner, Jupyter's extension point for the start of kernels, that forks."""

    async def launch_kernel(self, cmd: list[str], **options: Any) -> Any:
        """Fork a kernel with the arguments of `cmd`; `options` hold its environment, env, and folder, cwd."""
        context = get_context("forkserver")
        context.set_forkserver_preload(PRELOADED)
        given = cmd[3:], options["env"], options["cwd"]
        process = context.Process(target=_serve, args=given)
        process.start()
        pid = cast(int, process.pid)
        streams = dict.fromkeys(("stdin", "stdout", "stderr"))
        self.process = SimpleNamespace(  # type: ignore[assignment]
            poll=lambda: process.exitcode,
            wait=process.join,
            kill=process.kill,
            terminate=process.terminate,
            pid=pid,
            **streams,
            # used where the group of the process has gone, as of a kernel that has just died
            send_signal=lambda number: os.kill(pid, number),
        )
        self.pid = self.pgid = pid  # it leads a session of its own
        return self.connection_info


def _serve(arguments: list[str], environment: dict[str, str], folder: str) -> None:
    """Run a kernel in the forked process; it ends soon after the process that forked it."""
    import matplotlib
    from ipykernel.kernelapp import IPKernelApp

    os.setsid()
    # while this end is open, the server that forks does not see that the run has ended
    os.close(forkserver._forkserver._forkserver_alive_fd)  # type: ignore[attr-defined]
    os.chdir(folder)
    os.environ.clear()
    os.environ.update(environment)
    tempfile.tempdir = None  # that of the environment
    matplotlib.rcdefaults()  # no matplotlibrc of the folder in which the run began
    matplotlib.rcParams["backend"] = INLINE
    parent = f"--IPKernelApp.parent_handle={os.getppid()}"
    IPKernelApp.launch_instance([*arguments, parent])
