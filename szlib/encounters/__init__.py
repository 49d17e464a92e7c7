"""Encounters: windows in which two people share the attentional space, alone.

geometry         the area and the attentional space
areas            an area in any form, or the outline of where people were seen: `as_area`, `walked_area`
kinds            companions, same direction, opposite, crossing, standing, decided on the common track
settings         what counts as an encounter: `EncounterSettings`
occupants        people near each other at one moment, those in the attentional space of a row, samples
finding          the four conditions of the paper: `find_encounters`; the rows of a file that they depend on
days             from the files of days to their encounters, resumable, on one machine or many: `extract_days`
pairs            every pair of people, and streams that are moved in time: `find_pairs`
sensor           people that it loses, its noise, and ids that it exchanges: `SensorCheck`
null_model       people moved in time, as units or streams: `time_shifted`, `null_encounters`, `null_pairs`
"""

from .areas import as_area, walked_area
from .days import Extraction, extract_days
from .finding import find_encounters
from .geometry import ATC_SQUARE, PAPER_SPACE, Area, AttentionalSpace, Square
from .kinds import KINDS, of_kind
from .null_model import NullEncounters, null_encounters, null_pairs, time_shifted
from .occupants import SAMPLE_COLUMNS
from .pairs import find_pairs
from .sensor import SensorCheck
from .settings import EncounterSettings

__all__ = [
    "ATC_SQUARE",
    "KINDS",
    "PAPER_SPACE",
    "SAMPLE_COLUMNS",
    "Area",
    "AttentionalSpace",
    "EncounterSettings",
    "Extraction",
    "NullEncounters",
    "SensorCheck",
    "Square",
    "as_area",
    "extract_days",
    "find_encounters",
    "find_pairs",
    "null_encounters",
    "null_pairs",
    "of_kind",
    "time_shifted",
    "walked_area",
]
