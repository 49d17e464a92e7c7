"""Scenes to drive through: the paper's four scenarios, eleven meetings, random worlds."""

from .meetings import MEETINGS, InSight, Variations
from .paper import SCENARIOS
from .random_worlds import ONE_PERSON, Worlds, random_zone, world

__all__ = [
    "MEETINGS",
    "ONE_PERSON",
    "SCENARIOS",
    "InSight",
    "Variations",
    "Worlds",
    "random_zone",
    "world",
]
