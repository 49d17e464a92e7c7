"""How is it presented? Figures, records of notebooks, their execution, and the command line.

figures       every figure that szlib itself draws
record        what a notebook records, and the data that notebooks share
folders       the notebooks, their parameters, and the folders of results
runner        execution of all notebooks; `execution`: of one, in its kernel
summary       a run as a table and as JUnit XML
report        a run as one HTML file
paper_sentences  every sentence of the paper that can be checked, and its verdict in a run
cli           `szlib run | inspect | extract | fit | notebooks`; `fit_command`: from days or tracks to a zone
"""
