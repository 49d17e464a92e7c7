"""Is it true: a synthetic square whose people keep a known social zone.

settings    the settings of the plaza, and the true zone of its people: `PlazaSettings`
generation  how its people walk, and what a sensor records of them: `make_plaza`
accuracy    the precision and recall of a rule for outliers
"""

from .accuracy import precision_and_recall
from .generation import make_plaza, positions, stage_encounters
from .settings import (
    ANY_SPEED_INTRUDERS,
    RUSHING_INTRUDERS,
    SLOW_INTRUDERS,
    PlazaSettings,
)

__all__ = [
    "ANY_SPEED_INTRUDERS", "RUSHING_INTRUDERS", "SLOW_INTRUDERS", "PlazaSettings",
    "make_plaza", "positions", "precision_and_recall", "stage_encounters",
]  # fmt: skip
