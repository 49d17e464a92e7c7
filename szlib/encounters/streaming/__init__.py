"""A raw day, streamed: of millions of rows only those that encounters in the square can depend on.

blocks     the usable rows of a file, block by block
cells      which of them are needed
kept_rows  the user's cache of them
reading    `read_near_square`
"""

from .reading import read_near_square

__all__ = ["read_near_square"]
