"""The command line: `szlib run` the workbook, `report` on it, `inspect` a file, `extract`, `compile`.

endings   how a command ends before its time, and what it says then
commands  what each command does
options   what may be said to each
entry     the way in: `main`
"""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach(
    __name__, submodules=["endings", "commands", "options", "entry"], submod_attrs={"entry": ["main"]}
)
