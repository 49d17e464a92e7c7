"""A model of walking of our own for `ReactingPeople`: the collision-free speed model, by JuPedSim.

A. Tordeux, M. Chraibi, A. Seyfried, "Collision-free speed model for pedestrian dynamics", 2016.  JuPedSim
leads people around walls.  It cannot move an agent: the robot is removed and added again at each step, and
stands in between.  People do not see it in the first 0.01 s of a step, nor while its centre is in a body.

JuPedSim would install a desktop; `INSTALL_JUPEDSIM` leaves that out. Its parameters are its own.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import shapely

from szlib.core.checks import Array
from szlib.core.errors import SolverError
from szlib.simulation.crowds.walking_model import Walkers, import_package

INSTALL_JUPEDSIM = "pip install --no-deps jupedsim deprecated wrapt"
TICK = 0.01
"""JuPedSim's own time step [s]; it advises against any other."""
RADIUS = 0.2
"""Radius of a person's body (JuPedSim's default) [m]."""
_HALF_THICKNESS, _MARGIN, _GOAL_DISTANCE, _POINT_RADIUS = 0.01, 20.0, 0.1, 1e-3
"""Of a wall; of floor around everything; at which a goal is reached; of the robot when it is added [m]."""


class SpeedModel:
    """`walkers` who walk as fast as the gap ahead allows: a `WalkingModel`."""

    def __init__(self, walkers: Walkers) -> None:
        self._jps, self._r_robot = (
            import_package("jupedsim", INSTALL_JUPEDSIM),
            walkers.r_robot,
        )
        self._floor = _make_floor(walkers)
        model = self._jps.CollisionFreeSpeedModel()
        self._sim: Any = self._jps.Simulation(
            model=model, geometry=self._floor, dt=TICK
        )
        numbers = (
            walkers.positions.tolist(),
            walkers.goals.tolist(),
            walkers.speeds.tolist(),
        )
        try:
            self._ids = [
                self._add_agent(
                    at,
                    RADIUS,
                    pace,
                    *self._make_journey(
                        self._sim.add_waypoint_stage(tuple(goal), _GOAL_DISTANCE)
                    ),
                )
                for at, goal, pace in zip(*numbers, strict=True)
            ]
        except RuntimeError as error:
            raise SolverError(
                f"JuPedSim does not accept these people: {error}; people must start more than "
                f"{RADIUS} m from walls and {2 * RADIUS} m from each other, with goals clear of walls"
            ) from error
        self._steered = self._make_journey(self._sim.add_direct_steering_stage())
        self._robot: int | None = None

    def velocities(self, positions: Array, robot: Array, dt: float) -> Array:
        """Mean velocities over the next `dt`; see `WalkingModel.velocities` for `positions` and `robot`.

        Raises
        ------
        SolverError : `dt` is not a multiple of `TICK`.
        """
        before, ticks = self._positions(), round(dt / TICK)
        if ticks < 1 or abs(ticks * TICK - dt) > 1e-9:
            raise SolverError(
                f"dt must be a multiple of JuPedSim's time step of {TICK} s; got {dt} s"
            )
        if self._robot is not None:
            self._sim.mark_agent_for_removal(self._robot)
        self._sim.iterate(1)
        self._robot = (
            None
            if self._r_robot is None
            else self._add_robot(robot[:2].tolist(), self._r_robot)
        )
        self._sim.iterate(ticks - 1)
        return (self._positions() - before) / dt

    def _add_robot(self, at: list[float], radius: float) -> int | None:
        """Add the robot as a point, then enlarge it: JuPedSim adds no agent that touches another."""
        gap = np.hypot(*(self._positions() - at).T).min(initial=np.inf) - RADIUS
        if gap <= 2 * _POINT_RADIUS or not self._floor.buffer(
            -2 * _POINT_RADIUS
        ).contains(shapely.Point(at)):
            return None
        robot = self._add_agent(at, _POINT_RADIUS, 0.0, *self._steered)
        agent = self._sim.agent(robot)
        agent.target, agent.model.radius = tuple(at), radius
        return robot

    def _make_journey(self, stage: int) -> tuple[int, int]:
        """A journey with this one stage, and the stage."""
        return int(self._sim.add_journey(self._jps.JourneyDescription([stage]))), stage

    def _add_agent(
        self, at: list[float], radius: float, pace: float, journey: int, stage: int
    ) -> int:
        agent = self._jps.CollisionFreeSpeedModelAgentParameters(
            position=tuple(at),
            radius=radius,
            desired_speed=pace,
            journey_id=journey,
            stage_id=stage,
        )
        return int(self._sim.add_agent(agent))

    def _positions(self) -> Array:
        return np.array(
            [self._sim.agent(i).position for i in self._ids], float
        ).reshape(-1, 2)


def _make_floor(walkers: Walkers) -> Any:
    """Everything but the walls, as a Shapely polygon; SolverError where walls separate people or goals."""
    points = np.vstack(
        [
            walkers.positions,
            walkers.goals,
            walkers.walls.reshape(-1, 2),
            np.zeros((1, 2)),
        ]
    )
    box = shapely.box(*(points.min(axis=0) - _MARGIN), *(points.max(axis=0) + _MARGIN))
    walls = [
        shapely.LineString(wall).buffer(_HALF_THICKNESS, cap_style="flat")
        for wall in walkers.walls
    ]
    parts = shapely.get_parts(box.difference(shapely.union_all(walls)))
    floor = max(parts, key=lambda part: part.area)
    for at in np.vstack([walkers.positions, walkers.goals]).tolist():
        if not floor.contains(shapely.Point(at)):
            raise SolverError(
                f"JuPedSim needs one connected floor, and walls separate {at} from its largest part; leave a "
                "gap, or use orca"
            )
    return floor
