"""Where people were, and when: files of any format become one table of tracks on one clock.

funnels       how many rows entered each stage, and why others were rejected
recipe        how files are read: `Recipe`
shapes        the shapes of files that have a name, each with its recipe
sources       files and tables as columns: text, Parquet, Feather, SQLite, JSON, those of libraries
columns       which column holds what
rows          from columns to rows in seconds and metres
plausibility  whether people can move as they do in a table; if not, with which recipe they would
readers       rows of files as they are: `read_raw`
clock         rows brought to multiples of 0.1 s, with velocities: `read_tracks`, `to_clock`
datasets      named data and paths, downloads verified by hash
"""

from . import datasets, funnels
from .clock import check_tracks, clock_index, read_tracks, to_clock, to_pedpy
from .readers import read_raw
from .recipe import Recipe

__all__ = [
    "Recipe", "check_tracks", "clock_index", "datasets", "funnels", "read_raw",
    "read_tracks", "to_clock", "to_pedpy",
]  # fmt: skip
