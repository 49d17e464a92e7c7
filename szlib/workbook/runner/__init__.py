"""The whole workbook, headless: its notebooks executed, and what came of it.

summary    what came of a run, and the table that ends it
kernels    kernels that are ready at once
worker     one notebook, executed by papermill in a kernel of its own
execution  all of them, in their order and side by side
"""

from .execution import run

__all__ = ["run"]
