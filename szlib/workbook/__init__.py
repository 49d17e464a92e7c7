"""How is it presented? Figures, records of notebooks, their execution, and the command line.

figures       every figure that szlib itself draws
record        what a notebook records, and the data that notebooks share
folders       the notebooks, their parameters, and the folders of results
runner        execution of all notebooks; `execution`: of one, in its kernel
report        a run as one HTML file, as a table and as JUnit XML
claims        verdicts on claims, and on every sentence of the paper that can be checked
cli           `szlib run | inspect | extract | fit | notebooks`; `fit_command`: from days or tracks to a zone
"""
