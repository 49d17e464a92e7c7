"""One notebook, executed in a kernel of its own."""

from __future__ import annotations

import logging
import os
import re
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import Future
from contextlib import closing
from copy import deepcopy
from pathlib import Path
from threading import Event
from typing import Any

from ..core.errors import SzlibError
from ..core.files import temporary_folder, write_file
from ..core.input_files import printable, read_json_object
from .record.data_cache import describe_missing_data
from .record.parameters import METHOD_DEFAULTS, read_defaults

# Errors caused by data, disk or memory, not by the notebook.
REFUSED = {
    "DataError", "StorageError", "MemoryLimitError", "ZoneError", "SolverError", "SzlibError", "MemoryError",
    "OSError", "PermissionError", "FileNotFoundError", "IsADirectoryError", "NotADirectoryError",
    "DeadKernelError",
}  # fmt: skip
# The clients of nbclient whose kernels run in this process.
_CLIENTS: set[Any] = set()
# Set while the run is being stopped.
_STOPPING = Event()
# A signal that stops a kernel and the run reaches the run within this time [s].
_SIGNAL_DELAY = 1.0
# The notebooks that import a package beside them, and so need their folder on the module path.
NEEDS_FOLDER = re.compile(r"^from (?:laboratory|studies)\b", re.MULTILINE)
# The record of a notebook that wrote none.
EMPTY_RECORD: dict[str, Any] = {"checks": [], "key_figures": {}, "figures": []}


def execute_notebook(
    script: str,
    parameters: Mapping[str, Any],
    folder: str,
    environment: Mapping[str, str],
) -> tuple[str, dict[str, Any]]:
    """Execute one notebook in a kernel of its own, and save the executed copy.

    Parameters
    ----------
    script : path of the notebook's percent script.
    parameters : values that replace the defaults of the cell tagged "parameters".
    folder : the results of the run.
    environment : further environment variables of the kernel.

    Returns
    -------
    The name of the notebook, and its outcome: status, seconds, an error if there is one, and its record.
    """
    source, results = Path(script), Path(folder)
    start = time.perf_counter()
    outcome: dict[str, Any] = {"status": "done"}
    try:
        run_cells(source, parameters, results, environment)
    except Exception as error:  # of szlib, of a cell, or of Jupyter
        name = getattr(error, "ename", type(error).__name__)
        is_refused = name in REFUSED or isinstance(
            error, SzlibError | OSError | MemoryError
        )
        text = printable(" ".join(f"{name}: {getattr(error, 'evalue', error)}".split()))
        outcome = {"status": "refused" if is_refused else "error", "error": text}
        if name == "ZoneError" and describe_missing_data(
            results / "encounters.parquet"
        ):
            outcome = {
                "status": "undecided",
                "error": f"not decidable on this data: {text}",
            }
    outcome["seconds"] = round(time.perf_counter() - start, 2)
    record = read_json_object(results / "records" / f"{source.stem}.json")
    if not record.get("closed") and outcome["status"] == "done":
        missing = "the notebook wrote no record; it must end with record.close()"
        outcome |= {"status": "error", "error": missing}
    return source.stem, outcome | {
        name: record.get(name, empty) for name, empty in EMPTY_RECORD.items()
    }


def run_cells(
    script: Path,
    parameters: Mapping[str, Any],
    folder: Path,
    environment: Mapping[str, str],
) -> None:
    """Run the cells of a notebook by papermill, and write the executed copy also if a cell fails.

    A run that is stopped writes no copy, because it would be unfinished.

    `script`, `parameters`, `folder` and `environment` are those of `execute_notebook`.
    Raises the error of papermill for a cell that fails, or of nbclient for a kernel that ends.
    """
    import jupytext
    import nbformat
    import papermill
    from jupyter_core.utils import ensure_event_loop
    from papermill.clientwrap import PapermillNotebookClient
    from papermill.engines import Engine, papermill_engines

    from .forked_kernel import INLINE, ForkedKernelManager

    arguments = ["--log-level=CRITICAL"]  # no messages about the transport
    if NEEDS_FOLDER.search(script.read_text(encoding="utf-8")):
        add = f"import sys; sys.path.append({str(script.parent)!r})"
        arguments.append(f"--InteractiveShellApp.exec_lines={add}")
    own = {"MPLBACKEND": INLINE, "PYTHONSAFEPATH": "1"}

    class KernelEngine(Engine):
        """Papermill's own engine, but the kernel has an environment and the copy is written atomically."""

        @classmethod
        def execute_managed_notebook(
            cls, nb_man: Any, kernel_name: str, **_: Any
        ) -> None:
            """Execute the notebook of the manager `nb_man` in the kernel `kernel_name`."""
            client = PapermillNotebookClient(
                nb_man,
                kernel_name=kernel_name,
                kernel_manager_class=ForkedKernelManager,
                resources={"metadata": {"path": str(script.parent)}},
                extra_arguments=arguments,
            )
            _CLIENTS.add(client)
            try:
                # the loop of this thread, which Jupyter leaves open
                with closing(ensure_event_loop()), temporary_folder() as private:
                    folders = {"TMPDIR": str(private), "IPYTHONDIR": str(private)}
                    client.execute(env={**os.environ, **own, **folders, **environment})
            except Exception:  # of a cell, or the kernel has ended
                if _STOPPING.wait(_SIGNAL_DELAY):
                    _CLIENTS.discard(client)
                raise
            finally:
                copy = deepcopy(nb_man.nb)
                copy.metadata.pop("papermill", None)  # times and paths of this machine
                if client in _CLIENTS:  # nobody has stopped the run
                    _CLIENTS.discard(client)
                    write_file(folder / f"{script.stem}.ipynb", nbformat.writes(copy))

    # those of the zone are in no notebook's own cell
    logging.getLogger("papermill").setLevel(logging.ERROR)
    known = METHOD_DEFAULTS.keys() | read_defaults(script).keys()
    papermill_engines.register(script.stem, KernelEngine)
    papermill.execute_notebook(
        jupytext.read(script),
        None,
        {name: value for name, value in parameters.items() if name in known},
        engine_name=script.stem,
        kernel_name="python3",
        language="python",
        progress_bar=False,
    )


def end_kernels(executions: Sequence[Future[Any]]) -> None:
    """End the kernels of all notebooks that this process executes, and wait for the ends of `executions`.

    Those that have not started never do.
    """
    _STOPPING.set()
    for each in executions:
        each.cancel()
    while not all(each.done() for each in executions):
        for client in list(_CLIENTS):
            if process := getattr(
                getattr(client.km, "provisioner", None), "process", None
            ):
                _CLIENTS.discard(client)
                process.kill()
        time.sleep(0.1)
    _STOPPING.clear()
