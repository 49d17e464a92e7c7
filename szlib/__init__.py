"""szlib: social zones from pedestrian tracks, and a robot that keeps out of them.

`__init__.pyi` beside this file lists the names. Each is imported when it is first used (SPEC 1).
"""

import lazy_loader as lazy

__version__ = "0.2.0"

_load, __dir__, __all__ = lazy.attach_stub(__name__, __file__)


def __getattr__(name: str) -> object:
    """Import a name when it is first used; the error of a missing package says which extra has it."""
    try:
        return _load(name)
    except ModuleNotFoundError as error:
        error.add_note(
            "pip install 'szlib[data]' reads tracks and fits zones, 'szlib[workbook]' draws"
        )
        raise
