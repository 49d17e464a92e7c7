"""Where people were, and when: files of any format become one table of tracks on one clock.

recipe        how files are read: `Recipe`, and `Shape`, a kind of files that has a name
sources       files unpacked and recognised; text as columns; large files scanned
shapes        other files, and tables of libraries, as columns: Parquet, Feather, SQLite, JSON, named shapes
funnels       how many rows entered each stage, and why others were rejected; whether people can move so
plausibility  a description of rows, with a map
columns       which column holds what, and with which columns people would walk; rows in seconds and metres
readers       rows of files as they are: `read_raw`; several files: pieces of one recording, or separate ones
clock         rows brought to multiples of 0.1 s, with velocities: `read_tracks`, `to_clock`
datasets      named data and paths, downloads verified by hash
"""

from . import datasets, funnels
from .clock import clock_index, read_tracks, to_clock
from .readers import read_raw
from .recipe import Recipe

__all__ = [
    "Recipe",
    "clock_index",
    "datasets",
    "funnels",
    "read_raw",
    "read_tracks",
    "to_clock",
]
