"""Encounters: windows in which two people share the attentional space, alone.

geometry         the area and the attentional space
areas            an area in any form, or found from walking people: `as_area`, `walked_area`
kinds            companions, same direction, opposite, crossing, standing, decided on the common track
settings         what counts as an encounter: `EncounterSettings`
occupants        the people inside the attentional space of each row of a track table
finding          the four conditions of the paper: `find_encounters`
samples          what is measured in a window
neighbours       rows of people who are near each other at one moment
near_rows        the rows of a track table or file that encounters in an area can depend on
one_day          from the files of a day to its encounters
days             many days, resumable, on one machine or many: `extract_days`
time_shift       the same people, each moved in time: `time_shifted`
pairs            every pair of people, and streams that are moved in time: `find_pairs`
null_model       encounters of people who do not interact: `null_encounters`, `null_pairs`
sensors          whether tracks end where people are near: `check_sensor`
"""

from .areas import as_area, walked_area
from .days import Extraction, extract_days
from .finding import find_encounters
from .geometry import ATC_SQUARE, PAPER_SPACE, Area, AttentionalSpace, Region, Square
from .kinds import KINDS, of_kind
from .null_model import NullEncounters, null_encounters, null_pairs
from .pairs import find_pairs
from .samples import SAMPLE_COLUMNS
from .sensors import SensorCheck
from .settings import EncounterSettings
from .time_shift import time_shifted

__all__ = [
    "ATC_SQUARE", "KINDS", "PAPER_SPACE", "SAMPLE_COLUMNS", "Area", "AttentionalSpace", "EncounterSettings",
    "Extraction", "NullEncounters", "Region", "SensorCheck", "Square", "as_area",
    "extract_days", "find_encounters", "find_pairs", "null_encounters", "null_pairs", "of_kind",
    "time_shifted", "walked_area",
]  # fmt: skip
