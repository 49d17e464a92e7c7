"""Who was where, when: files of any format to one table of tracks on one clock.

funnels    how many rows entered each stage, and why others were set aside
formats    the layouts of files and tables, and how they are recognised
plausible  what people can do, and what is wrong with a table where they cannot
readers    rows of files as they are
clock      rows brought to multiples of 0.1 s, with velocities: `read_tracks`
quality    what a file is like before it is used
interop    the contract of a loader, groups, PedPy
sites      Grand Central, Edinburgh's Informatics Forum, THOR-MAGNI
datasets   named data and paths, downloads verified by hash
"""
