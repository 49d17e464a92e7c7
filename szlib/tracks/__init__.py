"""Where people were, and when: files of any format become one table of tracks on one clock.

funnels       how many rows entered each stage, and why others were rejected
options       how files are read: `ReadOptions`
formats       the formats of files and tables: recognition and scans
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
from .options import ReadOptions
from .quality import (
    count_visits_by_hour,
    measure_frame_intervals,
    summarise_people,
    summarise_seconds,
)
from .readers import read_raw
from .sites import read_edinburgh, read_grand_central, read_magni, read_magni_groups
