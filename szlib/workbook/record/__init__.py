"""What a notebook records, and the data that notebooks share.

notebook_record  checks, claims, figures and tables of one notebook
committed_tables tables that are committed beside the notebooks, and how they were made
data_cache       tracks, area, encounters and zone, computed once
parameters       how the zone is made; checks of parameters before a notebook starts
display          how tables, figures and parameters are shown
"""

from .committed_tables import TABLES, read_table
from .data_cache import DataCache
from .display import ASSUMED, CHOSEN, MEASURED, PAPER, TUNED, parameters, settings_table
from .notebook_record import NotebookRecord
from .parameters import ZoneMethod
