"""Scenes to drive through: the paper's four scenarios, eleven meetings, random worlds."""

from .meetings import MEETINGS, Variations, VisiblePeople
from .paper import SCENARIOS
from .random_worlds import ONE_PERSON, Worlds, draw_zone
