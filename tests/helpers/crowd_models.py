"""The packages of the models of walking, and small scenes for their people."""

import numpy as np

from szlib.control.person import Person
from szlib.simulation.scenario import Scenario

PACKAGES = {"orca": "pyrvo", "social force": "pysocialforce", "speed model": "jupedsim"}
"""The package of each model."""


def scene(*people: Person, walls: object = (), duration: float = 20.0) -> Scenario:
    return Scenario(
        "scene", np.zeros(4), np.ones(2), people, np.reshape(walls, (-1, 2, 2)), duration=duration
    )
