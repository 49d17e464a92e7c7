"""szlib: social zones from pedestrian tracks, and a robot that keeps out of them.

`__init__.pyi` beside this file lists the names. Each is imported when it is first used (SPEC 1). The names of
robots need no extra, the others ``szlib[data]``.
"""

import lazy_loader as lazy

__version__ = "0.2.0"

_load, __dir__, __all__ = lazy.attach_stub(__name__, __file__)


def __getattr__(name: str) -> object:
    """Import a public name; the error of a missing package says how to install it."""
    try:
        return _load(name)
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(
            f"szlib.{name} needs {error.name}: pip install 'szlib[data]'",
            name=error.name,
        ) from error
