"""What every room uses: errors, checks of arguments, files, the memory limit, parallel work.

errors       `SzlibError` and its kinds, warnings
input_files  what users give: argument values, files, and the memory limit
checks       checks of arguments: numbers, arrays, columns of tables
files        atomic files, folders that belong to szlib, cached results
parallel     processes, or a Dask cluster
"""
