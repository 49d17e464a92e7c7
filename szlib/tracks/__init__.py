"""Where people were, and when: files of any format become one table of tracks on one clock.

funnels       how many rows entered each stage, and why others were rejected
recipe        how files are read: `Recipe`
shapes        the shapes of files that have a name, each with its recipe
sources       files and tables as columns: text, Parquet, Feather, SQLite, JSON, those of libraries
columns       which column holds what
rows          from columns to rows in seconds and metres
ewap          the frame rate of EWAP files, estimated from their velocities
plausibility  whether people can move as they do in a table; if not, what was misread
recordings    which files are pieces of one recording
readers       rows of files as they are: `read_raw`
clock         rows brought to multiples of 0.1 s, with velocities: `read_tracks`, `to_clock`
quality       frames, gaps, visits and speeds of a file
interop       what a track table must be: `check_tracks`; groups; PedPy
sites         Grand Central, Edinburgh's Informatics Forum, THOR-MAGNI
datasets      named data and paths, downloads verified by hash
"""

from . import datasets, funnels
from .clock import clock_index, read_tracks, to_clock
from .interop import check_tracks, read_groups, to_pedpy
from .quality import (
    count_visits_by_hour,
    measure_frame_intervals,
    summarise_people,
    summarise_seconds,
)
from .readers import read_raw
from .recipe import Recipe
from .sites import read_edinburgh, read_grand_central, read_magni, read_magni_groups

__all__ = [
    "Recipe", "check_tracks", "clock_index", "count_visits_by_hour", "datasets",
    "funnels", "measure_frame_intervals", "read_edinburgh", "read_grand_central",
    "read_groups", "read_magni", "read_magni_groups", "read_raw", "read_tracks",
    "summarise_people", "summarise_seconds", "to_clock", "to_pedpy",
]  # fmt: skip
