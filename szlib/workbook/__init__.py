"""How is it presented? Figures, records of notebooks, their execution, and the command line.

figures       every figure that several notebooks share, one file a room
record        what a notebook records, and the data that notebooks share
folders       the notebooks, and the folders of results
runner        execution of all notebooks; `execution`: of one; `kernel`: what it runs in
summary       a run as a table, as Markdown and as JUnit XML
report        a run as one HTML file
paper_sentences  every sentence of the paper that can be checked, and its verdict in a run
cli, console  `szlib run | report | inspect | extract | fit | notebooks`
"""
