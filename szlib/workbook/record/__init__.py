"""What does a notebook write down, and where does it go?

places      the folder of results that belongs to a data set and its parameters
validation  parameters known, of the right type and in range, before a notebook starts
notebook    the record of one notebook: checks, claims, figures, artefacts
"""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach(
    __name__,
    submodules=["places", "validation", "notebook"],
    submod_attrs={
        "notebook": ["PAPER", "ASSUMED", "MEASURED", "NotebookRecord", "parameters", "settings_table"],
    },
)
