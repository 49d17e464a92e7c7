"""What every room uses: errors, checks of arguments, files, the memory limit, parallel work.

errors       `SzlibError` and its kinds, warnings
input_files  values and files of users, read with care; the memory limit
checks       checks of arguments: numbers, arrays, columns of tables
files        atomic files, folders that belong to szlib, cached results
parallel     processes, or a Dask cluster
"""
