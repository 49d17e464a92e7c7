"""The extended social force model, by PySocialForce, with its own parameters.

M. Moussaid et al., "Experimental study of the behavioural mechanisms underlying self-organization in human
crowds", Proc. R. Soc. B 276, 2009.  People have no radius in it: the robot is one more of them.  They stop
within 0.5 m of their goal; who stands is not moved.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from types import ModuleType

import numpy as np

from ...checks import Array
from ...errors import SolverError
from .walking_model import CROWDS, Walkers, package

SHORTEST = 0.2
"""A shorter wall counts as one of this length: walls are points, 0.1 m apart [m]."""
_AHEAD = 1e3
"""How far ahead the robot's goal is put [m]: its own motion is not PySocialForce's."""


class SocialForce:
    """People who are pushed by each other, the robot and walls; parameters as of `Model`."""

    def __init__(self, walkers: Walkers) -> None:
        module, self._robot = _quietly(), walkers.r_robot is not None
        state = np.hstack([walkers.positions, walkers.velocities, walkers.goals])
        paces = walkers.paces
        if self._robot:
            state, paces = np.vstack([state, np.zeros(6)]), np.append(paces, 1.0)
        self._sim = module.Simulator(state, obstacles=[_obstacle(wall) for wall in walkers.walls])
        self._sim.peds.initial_speeds, self._sim.peds.max_speed_multiplier = paces, 1.0

    def velocities(self, positions: Array, robot: Array, dt: float) -> Array:
        """Everybody's velocity for the next `dt`, shape (n, 2) [m/s]; see `Model`.

        Raises SolverError where it is not finite.
        """
        n, peds = len(positions), self._sim.peds
        if n == 0:
            return np.zeros((0, 2))
        state = peds.state.copy()
        state[:n, :2] = positions
        if self._robot:
            state[n, :6] = np.r_[robot, robot[:2] + _AHEAD * robot[2:]]
        peds.step_width, peds.state = dt, state
        with np.errstate(divide="ignore", invalid="ignore"):  # 0 / 0 of who stands, which it sets to 0
            self._sim.step_once()
        peds.ped_states.clear(), peds.group_states.clear()  # or it keeps every state there ever was
        velocities = np.array(peds.vel()[:n], float)
        if not np.isfinite(velocities).all():
            raise SolverError(f"PySocialForce gave velocities that are not finite, for people at {positions}")
        return velocities


def _obstacle(wall: Array) -> tuple[float, float, float, float]:
    """A wall as PySocialForce takes it: x0, x1, y0, y1."""
    middle, half = wall.mean(axis=0), (wall[1] - wall[0]) / 2
    half = half * max(1.0, SHORTEST / (2 * np.hypot(*half)))
    (x0, y0), (x1, y1) = (middle - half).tolist(), (middle + half).tolist()
    return x0, x1, y0, y1


def _quietly() -> ModuleType:
    """PySocialForce, interpreted: compiling takes seconds, a step of ten people half a millisecond."""
    numba = package("numba", CROWDS)
    before = numba.config.DISABLE_JIT
    numba.config.DISABLE_JIT = 1
    try:
        with _logging_as_it_was():
            return package("pysocialforce", CROWDS)
    finally:
        numba.config.DISABLE_JIT = before


@contextmanager
def _logging_as_it_was() -> Iterator[None]:
    """Its import opens ``file.log`` in the working directory and makes the root logger tell everything."""
    root, handler = logging.getLogger(), logging.FileHandler
    before = root.level, root.handlers[:], root.manager.disable
    logging.disable(logging.CRITICAL)
    logging.FileHandler = partial(handler, delay=True)  # type: ignore[assignment,misc]
    try:
        yield
    finally:
        logging.FileHandler = handler  # type: ignore[misc]
        root.level, root.handlers[:] = before[:2]
        logging.disable(before[2])
