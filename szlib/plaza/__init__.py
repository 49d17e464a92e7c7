"""Is it true: a synthetic square whose people keep a known social zone.

settings    the settings of the plaza, the true zone of its people (`PlazaSettings`), rules beside the truth
generation  how its people walk, and what a sensor records of them: `make_plaza`
"""

from .generation import make_plaza, positions, stage_encounters
from .settings import (
    ANY_SPEED_INTRUDERS,
    RUSHING_INTRUDERS,
    SLOW_INTRUDERS,
    PlazaSettings,
    precision_and_recall,
)

__all__ = [
    "ANY_SPEED_INTRUDERS",
    "RUSHING_INTRUDERS",
    "SLOW_INTRUDERS",
    "PlazaSettings",
    "make_plaza",
    "positions",
    "precision_and_recall",
    "stage_encounters",
]
