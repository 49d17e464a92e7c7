"""Optimal reciprocal collision avoidance (ORCA), by pyrvo, which wraps the authors' RVO2 library.

J. van den Berg, S. Guy, M. Lin, D. Manocha, "Reciprocal n-body collision avoidance", ISRR 2009.  Everybody
takes half of what is needed to stay apart for `HORIZON`, and expects the robot to take the other half.  Who
stands steps aside and comes back.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ...checks import Array
from ...control.person import BODY_RADIUS
from .walking_model import CROWDS, FASTER, Walkers, package

HORIZON, WALL_HORIZON = 3.0, 1.0
"""How far ahead people keep apart from others and from walls [s] (assumed)."""
SENSING_RANGE, NEIGHBOURS = 10.0, 10
"""How far they see [m], and to how many at once they react (as in RVO2's examples)."""
STEP_ASIDE = 0.5
"""Greatest speed of who stands [m/s] (assumed)."""


class Orca:
    """People who avoid each other, the robot and walls by ORCA; parameters as of `Model`."""

    def __init__(self, walkers: Walkers) -> None:
        self._walkers, self._sim = walkers, self._simulator(walkers)

    @staticmethod
    def _simulator(walkers: Walkers) -> Any:
        rvo = package("pyrvo", CROWDS)
        near = (SENSING_RANGE, NEIGHBOURS, HORIZON, WALL_HORIZON)
        sim = rvo.RVOSimulator(0.1, *near, BODY_RADIUS, 1.0)
        fastest = np.where(walkers.paces > 0, FASTER * walkers.paces, STEP_ASIDE).tolist()
        for position, velocity, speed in zip(walkers.positions, walkers.velocities, fastest, strict=True):
            sim.add_agent(position.tolist(), *near, BODY_RADIUS, speed, velocity.tolist())
        if walkers.r_robot is not None:
            sim.add_agent((0.0, 0.0), *near, walkers.r_robot, 1.0, (0.0, 0.0))
        for wall in walkers.walls:
            sim.add_obstacle(wall.tolist())
        sim.process_obstacles()
        return sim

    def velocities(self, positions: Array, robot: Array, dt: float) -> Array:
        """Everybody's velocity for the next `dt`, shape (n, 2) [m/s]; see `Model`."""
        w, sim, n = self._walkers, self._sim, len(positions)
        way = w.goals - positions
        left = np.hypot(*way.T)
        pace = np.minimum(np.where(w.paces > 0, w.paces, STEP_ASIDE), left / dt)
        preferred = way * np.divide(pace, left, out=np.zeros(n), where=left > 0)[:, None]
        for i in range(n):
            sim.set_agent_position(i, positions[i].tolist())
            sim.set_agent_pref_velocity(i, preferred[i].tolist())
        if w.r_robot is not None:
            x, y, vx, vy = robot.tolist()
            sim.set_agent_position(n, (x, y))
            sim.set_agent_velocity(n, (vx, vy))
            sim.set_agent_pref_velocity(n, (vx, vy))
        sim.set_time_step(dt)
        sim.do_step()
        return np.array([sim.get_agent_velocity(i).to_tuple() for i in range(n)], float).reshape(-1, 2)
