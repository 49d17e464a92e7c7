"""What a notebook records, and the data that notebooks share.

notebook_record  checks, claims, figures and tables of one notebook; tables that are committed
data_cache       tracks, area, encounters and zone, computed once
parameters       how the zone is made; checks of parameters before a notebook starts
display          how tables, figures and parameters are shown
"""

from .data_cache import DataCache
from .display import ASSUMED, CHOSEN, MEASURED, PAPER, TUNED, parameters
from .notebook_record import TABLES, NotebookRecord, read_table
from .parameters import ZoneMethod

__all__ = [
    "ASSUMED",
    "CHOSEN",
    "MEASURED",
    "PAPER",
    "TABLES",
    "TUNED",
    "DataCache",
    "NotebookRecord",
    "ZoneMethod",
    "parameters",
    "read_table",
]
