"""A raw day, streamed: of millions of rows only those that encounters in the square can depend on.

blocks     the usable rows of a file, block by block
cells      which of them are needed
kept_rows  the user's cache of them
reading    `read_near_square`
"""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach(
    __name__,
    submodules=["blocks", "cells", "kept_rows", "reading"],
    submod_attrs={"reading": ["read_near_square"]},
)
