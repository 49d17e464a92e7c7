"""Kernels of this Python, which on Linux start at once: they are forked from a process with all imports.

Importing what a notebook needs takes about 4 s of CPU time, and forking 0.04 s.
"""

from __future__ import annotations

import os
import sys
import tempfile
from multiprocessing import get_context
from types import SimpleNamespace
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


class OwnKernelManager(AsyncKernelManager):
    """Jupyter's manager of kernels for this Python, whatever others have its name; `options` as Jupyter's."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        if sys.platform == "linux":
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
        context.set_forkserver_preload(_PRELOADED)
        given = cmd[3:], options["env"], options["cwd"]
        process = context.Process(target=_serve, args=given)
        process.start()
        streams = dict.fromkeys(("stdin", "stdout", "stderr"))
        self.process = SimpleNamespace(  # type: ignore[assignment]
            poll=lambda: process.exitcode, wait=process.join, kill=process.kill,
            terminate=process.terminate, pid=process.pid, **streams,
        )  # fmt: skip
        self.pid = self.pgid = process.pid  # it leads a session of its own
        return self.connection_info


def _serve(arguments: list[str], environment: dict[str, str], folder: str) -> None:
    """Run a kernel in the forked process; it ends soon after the process that forked it."""
    import matplotlib
    from ipykernel.kernelapp import IPKernelApp

    os.setsid()
    os.chdir(folder)
    os.environ.clear()
    os.environ.update(environment)
    tempfile.tempdir = None  # that of the environment
    matplotlib.rcdefaults()  # no matplotlibrc of the folder in which the run began
    matplotlib.rcParams["backend"] = INLINE
    parent = f"--IPKernelApp.parent_handle={os.getppid()}"
    IPKernelApp.launch_instance([*arguments, parent])
