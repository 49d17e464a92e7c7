"""The extended social force model, by PySocialForce, with its own parameters.

M. Moussaid et al., "Experimental study of the behavioural mechanisms underlying self-organization in human
crowds", Proc. R. Soc. B 276, 2009.  People have no radius in it; the robot is one more of them.  They
stop within 0.5 m of their goal; people who stand do not move.
"""

from __future__ import annotations

import logging
from functools import partial
from types import ModuleType

import numpy as np

from ...core.checks import Array
from ...core.errors import SolverError
from .walking_model import INSTALL_CROWDS, Walkers, import_package

# A shorter wall counts as one of this length, because walls are points at 0.1 m from each other [m].
MIN_WALL_LENGTH = 0.2
# Time ahead at which the robot's goal lies [s]; PySocialForce does not decide the robot's motion.
_GOAL_TIME = 1e3


class SocialForceModel:
    """`walkers` who are pushed by each other, the robot and walls: a `WalkingModel`."""

    def __init__(self, walkers: Walkers) -> None:
        module, self._robot = _import_pysocialforce(), walkers.r_robot is not None
        state = np.hstack([walkers.positions, walkers.velocities, walkers.goals])
        speeds = walkers.speeds
        if self._robot:
            state, speeds = np.vstack([state, np.zeros(6)]), np.append(speeds, 1.0)
        self._sim = module.Simulator(
            state, obstacles=[_obstacle(wall) for wall in walkers.walls]
        )
        self._sim.peds.initial_speeds, self._sim.peds.max_speed_multiplier = speeds, 1.0

    def velocities(self, positions: Array, robot: Array, dt: float) -> Array:
        """See `WalkingModel.velocities` for `positions`, `robot` and `dt`.

        Raises
        ------
        SolverError : a velocity is not finite.
        """
        n, peds = len(positions), self._sim.peds
        if n == 0:
            return np.zeros((0, 2))
        state = peds.state.copy()
        state[:n, :2] = positions
        if self._robot:
            state[n, :6] = np.r_[robot, robot[:2] + _GOAL_TIME * robot[2:]]
        peds.step_width, peds.state = dt, state
        with np.errstate(
            divide="ignore", invalid="ignore"
        ):  # 0 / 0 for people who stand, which it sets to 0
            self._sim.step_once()
        # it would keep the states of all steps
        (peds.ped_states.clear(), peds.group_states.clear())
        velocities = np.array(peds.vel()[:n], float)
        if not np.isfinite(velocities).all():
            raise SolverError(
                f"PySocialForce gave velocities that are not finite, for people at {positions}"
            )
        return velocities


def _obstacle(wall: Array) -> tuple[float, float, float, float]:
    """A wall in the order of PySocialForce: x0, x1, y0, y1."""
    middle, half = wall.mean(axis=0), (wall[1] - wall[0]) / 2
    half = half * max(1.0, MIN_WALL_LENGTH / (2 * np.hypot(*half)))
    (x0, y0), (x1, y1) = (middle - half).tolist(), (middle + half).tolist()
    return x0, x1, y0, y1


def _import_pysocialforce() -> ModuleType:
    """PySocialForce without compilation, which takes seconds; a step of ten people takes half a
    millisecond.

    Its import would open ``file.log`` in the working folder, and set the root logger to log everything.
    """
    numba, root, handler = (
        import_package("numba", INSTALL_CROWDS),
        logging.getLogger(),
        logging.FileHandler,
    )
    level, handlers, disabled = root.level, root.handlers[:], root.manager.disable
    jit_is_off = numba.config.DISABLE_JIT
    logging.disable(logging.CRITICAL)
    logging.FileHandler = partial(handler, delay=True)  # type: ignore[assignment,misc]
    numba.config.DISABLE_JIT = 1
    try:
        return import_package("pysocialforce", INSTALL_CROWDS)
    finally:
        numba.config.DISABLE_JIT = jit_is_off
        logging.FileHandler = handler  # type: ignore[misc]
        root.level, root.handlers[:] = level, handlers
        logging.disable(disabled)
