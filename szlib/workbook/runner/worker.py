"""One notebook, executed by papermill in a kernel of its own.

What a process of the run's pool loads: nothing of szlib that the kernel loads anyway.
"""

from __future__ import annotations

import json
import logging
import os
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from ... import memory
from ...errors import SzlibError
from ...files import printable, temporary_folder, write_file
from ...parallel import end_with
from ..record import places
from . import kernels

REFUSED = {
    "DataError", "StorageError", "MemoryLimitError", "ZoneError", "SolverError", "SzlibError", "MemoryError",
    "OSError", "PermissionError", "FileNotFoundError", "IsADirectoryError", "NotADirectoryError",
    "DeadKernelError",
}  # fmt: skip
"""Errors that tell of the data, of the disk or of memory, and not of a notebook."""
EMPTY_RECORD: dict[str, Any] = {"checks": [], "key_figures": {}, "figures": []}
"""What a notebook leaves that leaves nothing."""


def begin(parent: int, jobs: int) -> None:
    """What a process of the pool does first: end with its parent, and leave the others their cores."""
    end_with(parent)
    os.environ.setdefault("OMP_NUM_THREADS", str(max(1, (os.cpu_count() or 1) // jobs)))


def execute(source: str, given: dict[str, Any], home: str, share: int | None) -> tuple[str, dict[str, Any]]:
    """Run one notebook in a kernel of its own, with its share of memory; its name, and what it left."""
    script, folder = Path(source), Path(home)
    begun = time.perf_counter()
    outcome: dict[str, Any] = {"status": "done"}
    try:
        with temporary_folder() as temporary:
            runtime = {"JUPYTER_RUNTIME_DIR": str(temporary / "runtime")}  # gone with the folder, always
            runtime[places.RUN_VARIABLE] = str(folder)
            with _environment(runtime | ({memory.VARIABLE: str(share)} if share else {})):
                outcome |= _execute_in(temporary, script, folder, given)
    except (SzlibError, OSError, MemoryError) as error:
        outcome = {"status": "refused", "error": f"{type(error).__name__}: {error}"}
    except Exception as error:  # of papermill, nbclient or the kernel
        status = "refused" if type(error).__name__ in REFUSED else "error"
        outcome = {"status": status, "error": f"{type(error).__name__}: {error}"}
    if "error" in outcome:
        outcome["error"] = printable(" ".join(outcome["error"].split()))
    outcome["seconds"] = round(time.perf_counter() - begun, 2)
    try:
        left = json.loads((folder / "records" / f"{script.stem}.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        left = {}
    if outcome["status"] == "done" and not left:
        outcome = {
            **outcome,
            "status": "error",
            "error": "the notebook left no record; does it end with record.close()?",
        }
    return script.stem, outcome | {name: left.get(name, default) for name, default in EMPTY_RECORD.items()}


def _execute_in(temporary: Path, script: Path, folder: Path, given: dict[str, Any]) -> dict[str, Any]:
    """Execute a notebook in a temporary folder, and put the executed copy among the results."""
    import jupytext  # here, where they are needed: the process that waits for notebooks loads neither
    import papermill

    plain, executed = temporary / f"{script.stem}.ipynb", temporary / "executed.ipynb"
    jupytext.write(jupytext.read(script), plain, fmt="ipynb")
    outcome: dict[str, Any] = {}
    logging.getLogger("papermill").setLevel(
        logging.ERROR
    )  # that a notebook does not name a parameter is usual
    try:
        papermill.execute_notebook(
            plain,
            executed,
            given,
            kernel_manager_class=kernels.KernelManager,
            kernel_name="python3",
            language="python",
            cwd=script.parent,
            progress_bar=False,
            extra_arguments=["--log-level=CRITICAL"],  # the kernel's remarks on its own transport
        )
    except papermill.PapermillExecutionError as error:
        status = "refused" if error.ename in REFUSED else "error"
        outcome = {"status": status, "error": f"{error.ename}: {error.evalue}"}
    if executed.exists():
        write_file(folder / plain.name, executed.read_bytes())
    return outcome


@contextmanager
def _environment(variables: Mapping[str, str]) -> Iterator[None]:
    """Environment variables for what is started inside."""
    before = {name: os.environ.get(name) for name in variables}
    os.environ.update(variables)
    try:
        yield
    finally:
        for name, value in before.items():
            os.environ.pop(name, None)
            if value is not None:
                os.environ[name] = value
