"""What a model of walking is given, and what it must do.  World frame, metres and seconds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from types import ModuleType
from typing import Protocol

from ...core.checks import Array
from ...core.errors import SolverError

# Largest speed of people who avoid others, as a multiple of their own (Helbing and Molnar 1995).
MAX_SPEED_FACTOR = 1.3
# command that installs pyrvo and PySocialForce
INSTALL_CROWDS = "pip install -e '.[crowds]'"


@dataclass(frozen=True)
class Walkers:
    """All people at the start, and their goals.

    Attributes
    ----------
    positions, velocities, goals : shape (n, 2) [m, m/s, m].
    speeds : speed at which each walks to their goal, shape (n,) [m/s]; 0 for people who stand.
    walls : segments, shape (m, 2, 2) [m].
    r_robot : radius of the disc for which people take the robot [m]; None: they do not see it.
    """

    positions: Array
    velocities: Array
    goals: Array
    speeds: Array
    walls: Array
    r_robot: float | None


class WalkingModel(Protocol):
    """A model of walking, built for some `Walkers`."""

    def velocities(self, positions: Array, robot: Array, dt: float) -> Array:
        """Velocity of each person for the next time step, shape (n, 2) [m/s].

        Parameters
        ----------
        positions : where people are, shape (n, 2) [m].
        robot : (x, y, vx, vy) of the robot [m, m/s], unless they do not see it.
        dt : time step [s].
        """


# a function of a module, so that other processes find it
ModelFactory = Callable[[Walkers], WalkingModel]


def import_package(name: str, install: str) -> ModuleType:
    """Import the optional package `name`; SolverError gives the command `install` where it is missing."""
    try:
        return import_module(name)
    except ImportError as error:
        raise SolverError(
            f"these people need the package {name} ({error}); install it with: {install}"
        ) from error
