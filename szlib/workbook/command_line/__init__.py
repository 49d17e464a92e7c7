"""The command line: `szlib run` the workbook, `report` on it, `inspect` a file, `extract`.

endings   how a command ends before its time, and what it says then
commands  what each command does
options   what may be said to each
entry     the way in: `main`
"""

from .entry import main

__all__ = ["main"]
