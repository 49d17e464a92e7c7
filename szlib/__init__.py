"""szlib: social zones from pedestrian tracks, and a robot that keeps out of them.

`__init__.pyi` beside this file lists the names. Each is imported when it is first used (SPEC 1).
"""

import lazy_loader as lazy

__version__ = "0.2.0"

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
