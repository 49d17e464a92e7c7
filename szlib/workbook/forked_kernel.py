"""Kernels that start at once: on Linux, forked from a process that has imported what notebooks import.

Starting a kernel and importing what a notebook needs takes about 4 s of CPU time; forking takes 0.04 s. A
forked kernel is a process of its own, as any kernel. On other systems kernels start as usual.
"""

from __future__ import annotations

import os
import signal
import sys
import tempfile
import threading
from multiprocessing import current_process, get_context, parent_process
from pathlib import Path
from typing import Any

from ipykernel.kernelspec import get_kernel_dict
from jupyter_client.kernelspec import KernelSpec
from jupyter_client.manager import AsyncKernelManager
from jupyter_client.provisioning.local_provisioner import LocalProvisioner

INLINE = "module://matplotlib_inline.backend_inline"  # the backend that shows figures in a notebook
_PRELOADED = [
    "ipykernel.kernelapp", "matplotlib.pyplot", "sklearn.neighbors", "pandas.io.formats.style",
    "szlib.workbook.figures.simulation", "szlib.workbook.figures.zones", "szlib.workbook.record",
    "szlib.control.mpc", "szlib.simulation.monte_carlo", __name__,
]  # fmt: skip


class ForkedKernelManager(AsyncKernelManager):
    """Jupyter's manager of kernels, which forks them on Linux; `options` are those of Jupyter.

    The kernel is the one of this Python, whatever kernels are installed under its name ($JUPYTER_PATH).
    """

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        if sys.platform == "linux":
            self.provisioner = ForkingProvisioner(
                kernel_spec=self.kernel_spec, parent=self
            )

    @property
    def kernel_spec(self) -> KernelSpec:
        """How this Python starts its kernel."""
        return KernelSpec(**get_kernel_dict())


class ForkingProvisioner(LocalProvisioner):
    """A kernel provisioner, Jupyter's extension point for the start of kernels, that forks."""

    async def launch_kernel(self, cmd: list[str], **options: Any) -> Any:
        """Fork a kernel with the arguments of the command `cmd`, and return how to connect to it.

        `options` hold its environment, env, and its folder, cwd. If this process may have no children (a
        worker of Dask), the kernel is started as usual.
        """
        if current_process().daemon:
            return await super().launch_kernel(cmd, **options)
        context = get_context("forkserver")
        context.set_forkserver_preload(_PRELOADED)
        self.cwd = Path(options.get("cwd") or ".").absolute()
        try:
            process = _KernelProcess(
                context.Process(
                    target=_serve, args=(cmd[3:], options["env"], str(self.cwd))
                )
            )
        except OSError:  # the path of the temporary folder is too long for a socket
            return await super().launch_kernel(cmd, **options)
        self.process = process  # type: ignore[assignment]
        self.pid = self.pgid = process.pid  # it leads a session of its own
        return self.connection_info


class _KernelProcess:
    """A process of multiprocessing with the methods of `subprocess.Popen` that a provisioner calls."""

    stdin = stdout = stderr = None

    def __init__(self, process: Any) -> None:
        process.start()
        self.pid = process.pid
        self.kill, self.terminate, self._process = (
            process.kill,
            process.terminate,
            process,
        )

    def poll(self) -> int | None:
        """The exit code, or None while the process runs."""
        return self._process.exitcode  # type: ignore[no-any-return]

    def wait(self) -> int | None:
        """Wait for the end of the process, and return its exit code."""
        self._process.join()
        return self.poll()


def _serve(arguments: list[str], environment: dict[str, str], folder: str) -> None:
    """Run a kernel in the forked process."""
    import matplotlib
    from ipykernel.kernelapp import IPKernelApp

    os.setsid()
    # Jupyter's own way to interrupt a cell
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    os.chdir(folder)
    os.environ.clear()
    os.environ.update(environment)
    tempfile.tempdir = None  # that of the environment
    matplotlib.rcdefaults()  # no matplotlibrc of the folder in which the run began
    matplotlib.rcParams["backend"] = environment.get("MPLBACKEND") or INLINE
    threading.Thread(target=_end_with_parent, daemon=True).start()
    IPKernelApp.launch_instance(arguments)


def _end_with_parent() -> None:
    """End this process as soon as the process that asked for it has ended, even by SIGKILL."""
    if (parent := parent_process()) is not None:
        parent.join()
        os._exit(1)
