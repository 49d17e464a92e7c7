"""How is it presented? Figures, records of notebooks, their execution, and the command line.

figures       every figure, one file a room
paper_sentences  every sentence of the paper that can be checked, and its verdict in a run
folders       the folders of results
record        what a notebook records, and the data that notebooks share
runner        execution of all notebooks, with a summary
notebook_execution, forked_kernel  execution of one notebook; kernels that start at once
report        a run as one HTML file
cli, console  `szlib run | report | inspect | extract`
"""
