"""Formats of track files: plain or packed, recognised, laid out, or read by PedPy.

frame_rates  how long a frame is, where EWAP files count frames
plain        files as they are on disk, plain or .gz
foreign      formats of other programs, by PedPy's own loaders
layouts      which column is what, and how a file is recognised by its first line
tables       tables in memory: DataFrames, and PedPy's TrajectoryData
rows         why some rows cannot be used, and the others in seconds and metres
"""
