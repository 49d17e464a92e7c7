"""What does a notebook write down, and where does it go?

method      the knobs between tracks and the robot's zone, which reach every notebook
places      the folder of results that belongs to a data set and its parameters
validation  parameters known, of the right type and in range, before a notebook starts
tables      how values, tables and figures are shown
notebook    the record of one notebook: checks, claims, figures, artefacts
"""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach(
    __name__,
    submodules=["method", "places", "validation", "tables", "notebook"],
    submod_attrs={
        "notebook": ["NotebookRecord"],
        "tables": ["PAPER", "ASSUMED", "MEASURED", "parameters", "settings_table"],
    },
)
