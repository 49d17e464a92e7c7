"""The packages of the models of walking, and small scenes for their people."""

import numpy as np
from helpers.speed_model import SpeedModel

from szlib.control.people import Person
from szlib.simulation.crowds import WALKING_MODELS, ModelFactory
from szlib.simulation.scenario import Scenario

PACKAGES = {"orca": "pyrvo", "speed model": "jupedsim"}
"""The package of each model that needs one."""
FACTORIES: dict[str, ModelFactory] = {**WALKING_MODELS, "speed model": SpeedModel}
"""Every model by name: those of szlib, and one that is written here."""


def scene(*people: Person, walls: object = (), duration: float = 20.0) -> Scenario:
    return Scenario(
        "scene",
        np.zeros(4),
        np.ones(2),
        people,
        np.reshape(walls, (-1, 2, 2)),
        duration=duration,
    )
