"""How is it presented: figures, the records of notebooks, their headless execution, the command line.

figures       every figure, one file a room
claims        what data says of the paper's claims: effects, intervals, verdicts
sensitivity   what moves a zone most
places        the folder of results that belongs to a data set and its parameters
parameters    known, of the right type and in range, before a notebook starts
record        what a notebook records: checks, claims, figures, artefacts
summary       what came of a run, and the table that ends it
runner        the notebooks executed by papermill
command_line  `szlib run | inspect | extract`
"""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach(
    __name__,
    submodules=[
        "figures",
        "claims",
        "sensitivity",
        "places",
        "parameters",
        "record",
        "summary",
        "runner",
        "command_line",
    ],
)
