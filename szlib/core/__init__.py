"""What every room uses: errors, checks of arguments, files, the memory limit, parallel work.

errors       `SzlibError` and its kinds, warnings
checks       checks of arguments: numbers, arrays, columns of tables
files        atomic files, folders that belong to szlib, cached results
input_files  files of users, opened and read with care
memory       the memory limit
parallel     processes, or a Dask cluster
"""
