"""The kernel of this Python, whatever kernels are installed under its name ($JUPYTER_PATH)."""

from __future__ import annotations

from ipykernel.kernelspec import get_kernel_dict
from jupyter_client.kernelspec import KernelSpec
from jupyter_client.manager import AsyncKernelManager


class OwnKernelManager(AsyncKernelManager):
    """Jupyter's manager of kernels, which starts the kernel of this Python."""

    @property
    def kernel_spec(self) -> KernelSpec:
        """How this Python starts its kernel."""
        return KernelSpec(**get_kernel_dict())
