"""The collision-free speed model, by JuPedSim, with its own parameters.

A. Tordeux, M. Chraibi, A. Seyfried, "Collision-free speed model for pedestrian dynamics", 2016.  JuPedSim
leads people around walls.  It moves nobody by hand: the robot is taken out and put in again at each step, and
stands in between.  Nobody sees it in the first 0.01 s of a step, nor while its centre is in somebody's body.

JuPedSim is no part of the extra `crowds`, for it would bring a desktop: `INSTALL` leaves that out.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ...checks import Array
from ...errors import SolverError
from .walking_model import Walkers, package

INSTALL = "pip install --no-deps jupedsim deprecated wrapt shapely"
TICK = 0.01
"""JuPedSim's own time step [s]; it advises against any other."""
RADIUS = 0.2
"""Of a person's body (JuPedSim's default) [m]."""
_THICK, _AROUND, _REACHED, _POINT = 0.01, 20.0, 0.1, 1e-3
"""Half a wall's thickness, floor around everything, how near a goal is reached, the robot when put in [m]."""


class SpeedModel:
    """People who walk as fast as the gap ahead allows; parameters as of `Model`."""

    def __init__(self, walkers: Walkers) -> None:
        self._jps, self._r_robot = package("jupedsim", INSTALL), walkers.r_robot
        self._floor = _floor(walkers)
        model = self._jps.CollisionFreeSpeedModel()
        self._sim: Any = self._jps.Simulation(model=model, geometry=self._floor, dt=TICK)
        numbers = (walkers.positions.tolist(), walkers.goals.tolist(), walkers.paces.tolist())
        try:
            self._ids = [
                self._add(at, RADIUS, pace, *self._way(self._sim.add_waypoint_stage(tuple(goal), _REACHED)))
                for at, goal, pace in zip(*numbers, strict=True)
            ]
        except RuntimeError as error:
            raise SolverError(
                f"JuPedSim does not take these people: {error}; nobody may begin within {RADIUS} m of a wall "
                f"or {2 * RADIUS} m of another, and every goal must lie off walls"
            ) from error
        self._steered = self._way(self._sim.add_direct_steering_stage())
        self._robot: int | None = None

    def velocities(self, positions: Array, robot: Array, dt: float) -> Array:
        """Everybody's mean velocity over the next `dt`, shape (n, 2) [m/s]; see `Model`.

        Raises SolverError where `dt` is no multiple of `TICK`.
        """
        before, ticks = self._positions(), round(dt / TICK)
        if ticks < 1 or abs(ticks * TICK - dt) > 1e-9:
            raise SolverError(f"JuPedSim's time goes by steps of {TICK} s; got dt = {dt} s")
        if self._robot is not None:
            self._sim.mark_agent_for_removal(self._robot)
        self._sim.iterate(1)
        self._robot = None if self._r_robot is None else self._put(robot[:2].tolist(), self._r_robot)
        self._sim.iterate(ticks - 1)
        return (self._positions() - before) / dt

    def _put(self, at: list[float], radius: float) -> int | None:
        """The robot, put in as a point that then grows: JuPedSim takes nobody who touches somebody."""
        gap = np.hypot(*(self._positions() - at).T).min(initial=np.inf) - RADIUS
        shapely = package("shapely", INSTALL)
        if gap <= 2 * _POINT or not self._floor.buffer(-2 * _POINT).contains(shapely.Point(at)):
            return None
        robot = self._add(at, _POINT, 0.0, *self._steered)
        agent = self._sim.agent(robot)
        agent.target, agent.model.radius = tuple(at), radius
        return robot

    def _way(self, stage: int) -> tuple[int, int]:
        """The journey that has this one stage, and the stage."""
        return int(self._sim.add_journey(self._jps.JourneyDescription([stage]))), stage

    def _add(self, at: list[float], radius: float, pace: float, journey: int, stage: int) -> int:
        agent = self._jps.CollisionFreeSpeedModelAgentParameters(
            position=tuple(at), radius=radius, desired_speed=pace, journey_id=journey, stage_id=stage
        )
        return int(self._sim.add_agent(agent))

    def _positions(self) -> Array:
        return np.array([self._sim.agent(i).position for i in self._ids], float).reshape(-1, 2)


def _floor(walkers: Walkers) -> Any:
    """Everything but the walls, as a Shapely polygon; SolverError where walls part people from each other."""
    shapely = package("shapely", INSTALL)
    points = np.vstack([walkers.positions, walkers.goals, walkers.walls.reshape(-1, 2), np.zeros((1, 2))])
    box = shapely.box(*(points.min(axis=0) - _AROUND), *(points.max(axis=0) + _AROUND))
    walls = [shapely.LineString(wall).buffer(_THICK, cap_style="flat") for wall in walkers.walls]
    parts = shapely.get_parts(box.difference(shapely.union_all(walls)))
    floor = max(parts, key=lambda part: part.area)
    for at in np.vstack([walkers.positions, walkers.goals]).tolist():
        if not floor.contains(shapely.Point(at)):
            raise SolverError(
                f"JuPedSim wants one floor, and walls part {at} from the largest; leave a gap, or take orca"
            )
    return floor
