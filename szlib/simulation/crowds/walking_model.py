"""Everybody in numbers, and what a model of walking must do.  World frame, metres and seconds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from types import ModuleType
from typing import Protocol

from ...checks import Array
from ...errors import SolverError

FASTER = 1.3
"""How much faster than at their own pace people walk to avoid others (Helbing and Molnar 1995)."""


@dataclass(frozen=True)
class Walkers:
    """Everybody at the beginning, and where they want to go.

    Attributes
    ----------
    positions, velocities, goals : shape (n, 2) [m, m/s, m].
    paces : speed at which each walks to their goal, shape (n,) [m/s]; 0 for who stands.
    walls : segments, shape (m, 2, 2) [m].
    r_robot : radius of the disc for which they take the robot [m]; None: they do not see it.
    """

    positions: Array
    velocities: Array
    goals: Array
    paces: Array
    walls: Array
    r_robot: float | None


class Model(Protocol):
    """A model of walking, built for some `Walkers`."""

    def velocities(self, positions: Array, robot: Array, dt: float) -> Array:
        """Everybody's velocity for the next `dt` [s], shape (n, 2) [m/s].

        They are at `positions`, and see the robot at (x, y, vx, vy), unless they are blind to it.
        """
        ...


Build = Callable[[Walkers], Model]


def package(name: str, install: str) -> ModuleType:
    """An optional package; SolverError says how to install it where it is missing."""
    try:
        return import_module(name)
    except ImportError as error:
        raise SolverError(
            f"these people need the package {name} ({error}); install it with: {install}"
        ) from error


CROWDS = "pip install -e '.[crowds]'"
"""Installs pyrvo and PySocialForce."""
