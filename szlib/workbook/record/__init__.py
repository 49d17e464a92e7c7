"""What does a notebook write down, and where does it go?

method      the knobs between tracks and the robot's zone, which reach every notebook
places      the folder of results that belongs to a data set and its parameters
validation  parameters known, of the right type and in range, before a notebook starts
tables      how values, tables and figures are shown
notebook    the record of one notebook: checks, claims, figures, artefacts
"""

from .notebook import NotebookRecord
from .tables import ASSUMED, MEASURED, PAPER, parameters, settings_table

__all__ = ["ASSUMED", "MEASURED", "PAPER", "NotebookRecord", "parameters", "settings_table"]
