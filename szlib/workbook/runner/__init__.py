"""The whole workbook, headless: its notebooks executed, and what came of it.

summary    what came of a run, and the table that ends it
kernels    kernels that are ready at once
worker     one notebook, executed by papermill in a kernel of its own
execution  all of them, in their order and side by side
"""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach(
    __name__, submodules=["summary", "kernels", "worker", "execution"], submod_attrs={"execution": ["run"]}
)
