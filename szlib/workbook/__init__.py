"""How is it presented: figures, the records of notebooks, their headless execution, the command line.

figures       every figure, one file a room
claims        what data says of the paper's claims: effects, intervals, verdicts
sensitivity   what moves a zone most
exercises     the tasks of the exercise sheets, with their checkers and hints
record        what a notebook writes down, and where it goes
laboratory    a scene that can be dragged and set while it runs
report        a run to read without running anything
runner        the whole workbook, headless, and what came of it
cli           `szlib run | report | inspect | extract`
"""
