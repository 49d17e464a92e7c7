"""Optimal reciprocal collision avoidance (ORCA), by pyrvo, which wraps the authors' RVO2 library.

J. van den Berg, S. Guy, M. Lin, D. Manocha, "Reciprocal n-body collision avoidance", ISRR 2009.  Each
person takes half of the motion that keeps them apart for `HORIZON`, and expects the robot to take the other
half.  People who stand step aside and come back.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ...core.checks import Array
from ...zones.ellipses import BODY_RADIUS
from .walking_model import INSTALL_CROWDS, MAX_SPEED_FACTOR, Walkers, import_package

# time for which people keep apart from others and from walls [s] (assumed)
HORIZON, WALL_HORIZON = (3.0, 1.0)
SENSING_RANGE, MAX_NEIGHBOURS = 10.0, 10
"""How far they see [m], and to how many at once they react (as in RVO2's examples)."""
STEP_ASIDE_SPEED = 0.5  # largest speed of people who stand [m/s] (assumed)


class OrcaModel:
    """`walkers` who avoid each other, the robot and walls by ORCA: a `WalkingModel`."""

    def __init__(self, walkers: Walkers) -> None:
        rvo = import_package("pyrvo", INSTALL_CROWDS)
        near = (SENSING_RANGE, MAX_NEIGHBOURS, HORIZON, WALL_HORIZON)
        sim: Any = rvo.RVOSimulator(0.1, *near, BODY_RADIUS, 1.0)
        fastest = np.where(
            walkers.speeds > 0, MAX_SPEED_FACTOR * walkers.speeds, STEP_ASIDE_SPEED
        ).tolist()
        for position, velocity, speed in zip(
            walkers.positions, walkers.velocities, fastest, strict=True
        ):
            sim.add_agent(
                position.tolist(), *near, BODY_RADIUS, speed, velocity.tolist()
            )
        if walkers.r_robot is not None:
            sim.add_agent((0.0, 0.0), *near, walkers.r_robot, 1.0, (0.0, 0.0))
        for wall in walkers.walls:
            sim.add_obstacle(wall.tolist())
        sim.process_obstacles()
        self._walkers, self._sim = walkers, sim

    def velocities(self, positions: Array, robot: Array, dt: float) -> Array:
        """See `WalkingModel.velocities` for `positions`, `robot` and `dt`."""
        w, sim, n = self._walkers, self._sim, len(positions)
        offset = w.goals - positions
        distance = np.hypot(*offset.T)
        speed = np.minimum(
            np.where(w.speeds > 0, w.speeds, STEP_ASIDE_SPEED), distance / dt
        )
        preferred = (
            offset
            * np.divide(speed, distance, out=np.zeros(n), where=distance > 0)[:, None]
        )
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
        return np.array(
            [sim.get_agent_velocity(i).to_tuple() for i in range(n)], float
        ).reshape(-1, 2)
