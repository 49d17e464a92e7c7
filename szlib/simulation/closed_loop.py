"""The closed loop: a robot with any controller, among people who walk on, change their velocity, or react.

The robot is the double integrator of the paper (eq. 8), unless the controller has another one.  People
walk at constant velocity, unaffected by the robot (paper, sec. 4), unless a `CrowdModel` or a `Crowd`
moves them.  World frame, metres and seconds.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from math import hypot, isfinite
from time import perf_counter
from typing import Any

import numpy as np
import pandas as pd

from ..control.controller import Controller, as_controller
from ..control.obstacles import Obstacle
from ..control.people import Person, SpeedZone, as_ellipse
from ..control.settings import MPCSettings
from ..core.checks import Array
from ..core.errors import SolverError
from ..zones.ellipses import BODY_RADIUS, Ellipse, circle_around
from .log import SimulationLog
from .scenario import (
    GOAL_RADIUS,
    STOPPED_SPEED,
    UNAFFECTED,
    Crowd,
    CrowdModel,
    Scenario,
)

# Makes the zone that the robot keeps out of from a person's own zone.
ZoneTransform = Callable[[Ellipse], Ellipse]

# Zone of people if neither they nor the controller have one: their body.
BODY_ZONE = Ellipse((0.0, 0.0), (BODY_RADIUS, BODY_RADIUS))
_ABSENT = (np.nan,) * 5
# What the log keeps of each step, as of `szlib.Step`, and its value if a controller does not report it.
# The step itself is not kept: a thousand of them cost a garbage collection.
_UNREPORTED = {
    "predicted": np.zeros((0, 4)),
    "residual": None,
    "status": "",
    "safe": None,
    "slack": np.nan,
    "stuck": 0.0,
}


def simulate(
    scenario: Scenario,
    controller: Controller,
    *,
    crowd: Crowd | None = None,
    max_time: float | None = None,
) -> SimulationLog:
    """Run a scenario until the robot rests at the goal, or until the time limit.

    The loop resets the controller first, so that the same scenario gives the same run.  Each row of the log,
    also the last one, has the control that is decided in its state.

    Parameters
    ----------
    scenario : the scene.
    controller : an `MPCCBF`, or any other `szlib.control.Controller`.
    crowd : the true people as a function of time and the robot's state (`szlib.simulation.Crowd`);
        default: the scenario's people, who walk on.
    max_time : time limit [s]; default: the scenario's duration.

    Raises
    ------
    SolverError : the controller has other walls or obstacles, or gives a control that is not finite. For an
        `MPCCBF` also: the start violates a barrier or the speed limit, or the goal cannot be reached, because
        it lies too close to a wall or in the zone of a person who stands.

    Examples
    --------
    >>> import szlib
    >>> scenario = szlib.SCENARIOS["corridor"]
    >>> zone = szlib.Ellipse(center=(0.1, 0.0), semi_axes=(1.0, 0.7))
    >>> log = szlib.simulate(scenario, szlib.MPCCBF(zone, walls=scenario.walls))
    >>> log.success, log.metrics()["passing_side"]
    (True, 'right')
    """
    controller = as_controller(controller)
    if controller.walls is not None and not np.array_equal(
        controller.walls, scenario.walls
    ):
        raise SolverError(
            f"the controller knows {len(controller.walls)} walls, and not the {len(scenario.walls)} of "
            f"{scenario.name!r}; build it with walls=scenario.walls"
        )
    known = getattr(controller, "obstacles", None)
    if known is not None and _list_numbers(known) != _list_numbers(scenario.obstacles):
        raise SolverError(
            f"the controller knows other obstacles than {scenario.name!r}: {list(known)}, and not "
            f"{list(scenario.obstacles)}; build it with obstacles=scenario.obstacles"
        )
    try:
        controller.check_start(
            scenario.start, scenario.goal, scenario.people if crowd is None else ()
        )
    except SolverError as error:
        raise SolverError(f"{scenario.name!r}: {error}") from error
    return drive(scenario, controller, crowd=crowd, max_time=max_time)


def _list_numbers(obstacles: Iterable[Obstacle]) -> list[tuple[Any, ...]]:
    """What makes obstacles the same: their class and their numbers."""
    return [(type(each), *each.numbers) for each in obstacles]


def drive(
    scenario: Scenario,
    controller: Controller,
    *,
    behaviour: CrowdModel = UNAFFECTED,
    crowd: Crowd | None = None,
    seed: int = 0,
    zone_transform: ZoneTransform | None = None,
    settings: MPCSettings | None = None,
    max_time: float | None = None,
    until_arrival: bool = True,
) -> SimulationLog:
    """Run the loop from any start, without the checks of `simulate`, and with any behaviour of people.

    Parameters
    ----------
    scenario : the scene.
    controller : an `MPCCBF`, or any other `szlib.control.Controller`.
    behaviour : how people move and how the controller sees them.
    crowd : the true people, in place of those of `behaviour`. If the scenario has people, the crowd must have
        as many, and their zones apply; else each person has the zone with which they first appear.
    seed : seed of the behaviour.
    zone_transform : makes the zone that the robot keeps out of from each person's own zone, or the
        controller's, or `BODY_ZONE`; from the smallest circle around it for a person without a heading.
    settings : settings of the measurements (dt, r_robot, eps, zone_speed); default: the controller's.
    max_time : time limit [s]; default: the scenario's duration.
    until_arrival : False: run to the time limit, so that a robot at its goal may still have to make room.

    Raises
    ------
    SolverError : a control is not finite, the crowd changes its size, or the controller's dt is not that of
        `settings`. For an `MPCCBF` also: the goal lies too close to a wall.

    Examples
    --------
    >>> import szlib
    >>> turning = szlib.simulation.Behaviour(turn=1.5)
    >>> zone = szlib.Ellipse(center=(0.1, 0.0), semi_axes=(1.0, 0.7))
    >>> scenario = szlib.MEETINGS["frontal approach"]
    >>> log = szlib.simulation.drive(scenario, szlib.MPCCBF(zone), behaviour=turning, seed=1)
    >>> log.metrics()["unflagged_overlaps"]
    0
    """
    controller = as_controller(controller)
    s, robot = _choose_settings(controller, settings), controller.robot
    default_zone = BODY_ZONE if controller.zone is None else controller.zone
    zones = ZoneAssignment(default_zone, zone_transform, s.zone_speed)
    people = tuple(
        replace(p, zone=zones.zone_of(i, p)) for i, p in enumerate(scenario.people)
    )
    if crowd is None:
        crowd = behaviour.start(replace(scenario, people=people), seed)
    end = scenario.duration if max_time is None else max_time
    goal, dt, rng = scenario.goal, s.dt, np.random.default_rng([seed, 2])
    gx, gy = goal.tolist()
    arrival: int | None = None
    controller.reset()
    own, numbers = robot.start(scenario.start), list[float | None]()
    states, controls, seen_by_step = list[Array](), list[Array](), list[list[int]]()
    reported: dict[str, list[Any]] = {name: [] for name in (*_UNREPORTED, "solve_time")}
    for k in range(round(end / dt) + 1):
        state = robot.body(own)
        everyone = zones.assign(crowd(k * dt, state))
        for p in everyone:
            numbers += _ABSENT if p is None else (*p.position, p.heading, *p.velocity)
        present = [i for i, p in enumerate(everyone) if p is not None]
        observed = behaviour.observe(tuple([p for p in everyone if p is not None]), rng)
        seen_by_step.append(
            [i for i, p in zip(present, observed, strict=True) if p is not None]
        )
        seen = tuple([p for p in observed if p is not None])
        begin = perf_counter()
        step = controller.step(own, goal, seen)
        defaults = {**_UNREPORTED, "solve_time": perf_counter() - begin}
        for name, column in reported.items():
            column.append(getattr(step, name, defaults[name]))
        control = np.asarray(step.control, float)
        states.append(state)
        controls.append(control)
        x, y, vx, vy = state.tolist()
        if (
            arrival is None
            and hypot(vx, vy) <= STOPPED_SPEED
            and hypot(x - gx, y - gy) <= GOAL_RADIUS
        ):
            arrival = k
            if until_arrival:
                break
        if not all(map(isfinite, given := control.tolist())):
            raise SolverError(
                f"{scenario.name!r}: the controller gave {given} at {k * dt:g} s"
            )
        own = robot.advance(own, control, dt)
    n, n_people = len(states), len(everyone)
    return SimulationLog(
        scenario=scenario,
        settings=s,
        zones=tuple(zones.zone_of(i, None) for i in range(n_people)),
        states=np.array(states),
        controls=np.array(controls),
        people=_fill_headings(np.reshape(np.array(numbers, float), (n, n_people, 5))),
        predicted=_stack_plans(reported["predicted"]),
        residual=_align_residuals(
            reported["residual"], seen_by_step, n_people, len(scenario.fixed)
        ),
        status=np.array(reported["status"]),
        safe=np.array(reported["safe"], bool),
        **{
            name: np.array(reported[name], float)
            for name in ("slack", "solve_time", "stuck")
        },
        arrival=arrival,
        has_safety_claims=reported["safe"][0] is not None,
        inputs=tuple(robot.inputs),
    )


def _choose_settings(
    controller: Controller, settings: MPCSettings | None
) -> MPCSettings:
    own = controller.settings
    if settings and own and settings.dt != own.dt:
        raise SolverError(
            f"the controller steps every {own.dt} s, the loop every {settings.dt} s; give one"
        )
    return settings or own or MPCSettings()


class ZoneAssignment:
    """The zone that the robot keeps out of for each person, from when they first appear.

    Parameters
    ----------
    default : zone of people who have none.
    transform : makes the zone from each person's own; None: it is their own.
    speed : walking speed for zones that depend on it [m/s].
    """

    def __init__(
        self,
        default: Ellipse | SpeedZone,
        transform: ZoneTransform | None,
        speed: float,
    ) -> None:
        self._default, self._transform, self._speed = default, transform, speed
        self._zones: dict[int, Ellipse] = {}
        self._n_people: int | None = None

    def zone_of(self, i: int, person: Person | None) -> Ellipse:
        """The zone of person `i`, made from the `person` at the first call; None: they never appear."""
        if i not in self._zones:
            own = (
                self._default if person is None or person.zone is None else person.zone
            )
            zone = as_ellipse(own, self._speed)
            if person is not None and person.heading is None:
                zone = circle_around(zone)
            self._zones[i] = self._transform(zone) if self._transform else zone
        return self._zones[i]

    def assign(self, people: Sequence[Person | None]) -> Sequence[Person | None]:
        """The `people` with their zones; SolverError if their number changes."""
        if self._n_people is None:
            self._n_people = len(self._zones) or len(people)
        if len(people) != self._n_people:
            raise SolverError(
                "the number of people in a crowd must not change, use None for people who are absent; it was "
                f"{self._n_people}, and now is {len(people)}"
            )
        return [
            p
            if p is None or p.zone is self._zones.get(i, self)
            else replace(p, zone=self.zone_of(i, p))
            for i, p in enumerate(people)
        ]


def _fill_headings(people: Array) -> Array:
    """Replace missing headings of people who are present by their last known heading, or 0."""
    headings, is_present = people[:, :, 2], ~np.isnan(people[:, :, 0])
    if np.isnan(headings[is_present]).any():
        known = pd.DataFrame(headings).ffill().fillna(0.0).to_numpy()
        people[:, :, 2] = np.where(is_present, known, np.nan)
    return people


def _stack_plans(plans: Sequence[Array]) -> Array:
    """The plan of each step, shape (n, N+1, 4); (n, 0, 4) if there are none, NaN after shorter ones."""
    longest = max(map(len, plans))
    return np.array(
        [
            np.pad(p, ((0, longest - len(p)), (0, 0)), constant_values=np.nan)
            for p in plans
        ]
    )


def _align_residuals(
    rows: Sequence[Any], seen: Sequence[list[int]], n_people: int, n_fixed: int
) -> Array:
    """The conditions of each step, shape (n, P+W, N_h), NaN for people who were not seen; else (n, P+W, 0).

    A step has a row for each person whom it sees, for people whom it remembers, then for everything fixed.
    """
    if any(row is None for row in rows):
        return np.zeros((len(rows), n_people + n_fixed, 0))
    residuals = np.full((len(rows), n_people + n_fixed, rows[0].shape[1]), np.nan)
    for residual, row, i in zip(residuals, rows, seen, strict=True):
        if len(row) < len(i) + n_fixed:
            raise SolverError(
                "the residual of a step must have a row for each person it sees, then for everything fixed; "
                f"got {len(row)} rows, expected {len(i) + n_fixed}"
            )
        residual[i] = row[: len(i)]
        residual[n_people:] = row[len(row) - n_fixed :]
    return residuals
