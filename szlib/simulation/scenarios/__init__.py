"""Scenes to drive through.

paper     the four scenarios of the paper: `SCENARIOS`
meetings  eleven meetings after Francis et al. (2025): `MEETINGS`
worlds    random worlds, each from its seed
atlas     the paper's scenarios stretched, and what the robot does in them: `chart`
"""

from .atlas import Cell, chart
from .meetings import MEETINGS, InSight, Variations
from .paper import SCENARIOS
from .worlds import ONE_PERSON, Worlds, random_zone, world

__all__ = [
    "MEETINGS",
    "ONE_PERSON",
    "SCENARIOS",
    "Cell",
    "InSight",
    "Variations",
    "Worlds",
    "chart",
    "random_zone",
    "world",
]
