"""Kernels that are ready at once: forked, on Linux, from a process that has imported what notebooks import.

To start a kernel and to import what a notebook needs takes four seconds of a processor, to fork one that has
done so a hundredth.  Each is a process of its own as any kernel is, in a session of its own, with the
environment that it was asked for, and with memory of its own where it writes.  Elsewhere, in processes that
may have no children, and for another Python than this one kernels are started as Jupyter starts them.
"""

from __future__ import annotations

import atexit
import os
import sys
import threading
from multiprocessing import current_process, get_context, parent_process
from pathlib import Path
from typing import Any

from jupyter_client.manager import AsyncKernelManager
from jupyter_client.provisioning.local_provisioner import LocalProvisioner

_INLINE = "module://matplotlib_inline.backend_inline"
"""Where a kernel shows figures; it says so by a variable that matplotlib reads while it is imported."""
_LAUNCHER = "ipykernel_launcher"
_IMPORTED = [
    "ipykernel.kernelapp", "matplotlib.pyplot", "sklearn.neighbors", "pandas.io.formats.style",
    "szlib.workbook.figures.simulation", "szlib.workbook.figures.zones", "szlib.workbook.record.notebook",
    "szlib.control.mpc", "szlib.control.solvers.sqp", "szlib.simulation.monte_carlo", __name__,
]  # fmt: skip


class KernelManager(AsyncKernelManager):
    """As Jupyter's own, but that it forks where it can."""

    async def _async_pre_start_kernel(self, **options: Any) -> Any:
        if self.provisioner is None:
            self.provisioner = _Provisioner(kernel_spec=self.kernel_spec, parent=self)
        return await super()._async_pre_start_kernel(**options)


class _Provisioner(LocalProvisioner):
    async def launch_kernel(self, cmd: list[str], **options: Any) -> Any:
        """Fork a kernel if that can be, or start one; how to reach it."""
        can = sys.platform == "linux" and not current_process().daemon
        if not can or cmd[0] != sys.executable or _LAUNCHER not in cmd:
            return await super().launch_kernel(cmd, **options)
        self.cwd = Path(options.get("cwd") or ".").absolute()
        arguments = cmd[cmd.index(_LAUNCHER) + 1 :]
        process = _Forked(arguments, options["env"], str(self.cwd))
        self.process = process  # type: ignore[assignment]
        self.pid = self.pgid = process.pid  # it leads a session of its own
        return self.connection_info


class _Forked:
    """A forked kernel, as `subprocess.Popen` tells of one that was started."""

    stdin = stdout = stderr = None

    def __init__(self, arguments: list[str], environment: dict[str, str], folder: str) -> None:
        context = get_context("forkserver")
        context.set_forkserver_preload(_IMPORTED)
        self._process = context.Process(target=_serve, args=(arguments, environment, folder))
        self._process.start()
        self.pid = self._process.pid

    def poll(self) -> int | None:
        """The exit code; None while it runs."""
        return self._process.exitcode

    def wait(self) -> int | None:
        """The exit code, when it has ended."""
        self._process.join()
        return self._process.exitcode

    def send_signal(self, signum: int) -> None:
        """A signal to it alone, if it runs."""
        if self.pid and self.poll() is None:
            os.kill(self.pid, signum)

    def kill(self) -> None:
        """End it at once."""
        self._process.kill()

    def terminate(self) -> None:
        """Ask it to end."""
        self._process.terminate()


def _serve(arguments: list[str], environment: dict[str, str], folder: str) -> None:
    """Be a kernel, in the process that was forked for it."""
    import matplotlib
    from ipykernel.kernelapp import IPKernelApp

    os.setsid()
    os.chdir(folder)
    os.environ.clear()
    os.environ.update(environment)
    matplotlib.rcParams["backend"] = environment.get("MPLBACKEND") or _INLINE
    threading.Thread(target=_end_with_parent, daemon=True).start()
    try:
        IPKernelApp.launch_instance(arguments)
    finally:
        atexit._run_exitfuncs()  # a forked process leaves them out


def _end_with_parent() -> None:
    """End as soon as the process that asked for this one has ended, even by SIGKILL."""
    if (parent := parent_process()) is not None:
        parent.join()
        os._exit(1)
