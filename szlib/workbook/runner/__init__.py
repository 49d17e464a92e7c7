"""The whole workbook, headless: its notebooks executed, and what came of it.

summary    what came of a run, and the table that ends it
execution  the notebooks executed by papermill
"""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach(
    __name__, submodules=["summary", "execution"], submod_attrs={"execution": ["run"]}
)
