"""The closed loop: a robot, whatever controls it, and people who walk on, deviate, react, come and go.

The robot is the double integrator of the paper's eq. 8, unless the controller has one of its own; people go
on at constant velocity, unaffected by the robot (paper, sec. 4), unless a `Behaviour` or a `Crowd` says
otherwise.  World frame, metres and seconds.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import hypot, isfinite
from time import perf_counter
from typing import Any

import numpy as np
import pandas as pd

from ..control.barriers import Array
from ..control.mpc import MPCCBF
from ..control.people.person import BODY_RADIUS, Person, SpeedZone, as_ellipse, circle_around
from ..control.settings import MPCSettings
from ..errors import SolverError
from ..zones.ellipses import Ellipse
from .controllers.protocol import Controller, DoubleIntegrator, Robot, StepLike, advance
from .log import SimulationLog
from .scenario import GOAL_RADIUS, STOPPED, UNAFFECTED, Crowd, CrowdModel, Scenario

__all__ = ["BODY", "Zones", "advance", "drive", "simulate"]

Zones = Callable[[Ellipse], Ellipse]
"""What is kept in place of a person's own zone, made from it."""

BODY = Ellipse((0.0, 0.0), (BODY_RADIUS, BODY_RADIUS))
"""The zone of people for whom neither they nor the controller have one: their body alone."""
_ABSENT = (np.nan,) * 5


def simulate(
    scenario: Scenario,
    controller: Controller,
    *,
    crowd: Crowd | None = None,
    max_time: float | None = None,
) -> SimulationLog:
    """Run a scenario until the robot rests at the goal, or to `max_time` [s] (default: its duration).

    The controller is reset first, so the same scenario gives the same run. Every row of the table,
    the last one included, has the control decided in its state.

    Parameters
    ----------
    scenario : the scene.
    controller : an `MPCCBF`, or anything else with `reset` and `step`: see `controllers.protocol`.
    crowd : everybody's true motion; see `scenario.Crowd`. Default: the scenario's people walk on.

    Raises
    ------
    SolverError : the controller has other walls, or gives a control that is not finite; for an `MPCCBF` also:
        the start violates a barrier or the speed limit, or the goal cannot be reached: it lies too close to
        a wall, or in the zone of somebody who stands.
    """
    walls = np.asarray(getattr(controller, "walls", scenario.walls))
    if not np.array_equal(walls, scenario.walls):
        raise SolverError(
            f"the controller knows {len(walls)} walls, and not the {len(scenario.walls)} of "
            f"{scenario.name!r}; build it with walls=scenario.walls"
        )
    if isinstance(controller, MPCCBF):
        _check_start(scenario, controller, scenario.people if crowd is None else ())
    return drive(scenario, controller, crowd=crowd, max_time=max_time)


def drive(
    scenario: Scenario,
    controller: Controller,
    *,
    behaviour: CrowdModel = UNAFFECTED,
    crowd: Crowd | None = None,
    seed: int = 0,
    zones: Zones | None = None,
    settings: MPCSettings | None = None,
    max_time: float | None = None,
    until_arrival: bool = True,
) -> SimulationLog:
    """The loop itself, from wherever the robot starts: what `simulate` and `rollouts` run.

    Parameters
    ----------
    behaviour, seed : what people do and how they are seen, and the seed of it.
    crowd : what people do, in place of the behaviour's. If the scenario has people, the crowd is as many, and
        theirs are the zones; else everybody has the zone with which they first come.
    zones : makes what is kept from each person's own zone, or else the controller's, or else `BODY`; of who
        comes without a heading, from the smallest circle around it.
    settings : what is measured by (dt, r_robot, eps, zone_speed); default: the controller's, if it has any.
    max_time : end of the run [s]; default: the scenario's duration.
    until_arrival : False drives on to the end of time, so that a robot that rests at its goal may still
        have to make room.

    Raises
    ------
    SolverError : a control is not finite, the crowd changes its size, the controller's dt is not that of
        `settings`; of an `MPCCBF`: the goal lies too close to a wall.
    """
    s = _settings(controller, settings)
    robot: Robot = getattr(controller, "robot", None) or DoubleIntegrator()
    end = scenario.duration if max_time is None else max_time
    cast = _Cast(getattr(controller, "zone", None) or BODY, zones, s.zone_speed)
    people = tuple(replace(p, zone=cast.zone(i, p)) for i, p in enumerate(scenario.people))
    if crowd is None:
        crowd = behaviour.crowd(replace(scenario, people=people), seed)
    goal, dt, rng = scenario.goal, s.dt, np.random.default_rng([seed, 2])
    gx, gy = goal.tolist()
    controller.reset()
    own, states, steps, true = robot.start(scenario.start), [], [], []
    given: list[list[int]] = []
    took: list[float] = []
    for k in range(round(end / dt) + 1):
        state = robot.body(own)
        everybody = cast.zoned(crowd(k * dt, state))
        there = {i: person for i, person in enumerate(everybody) if person is not None}
        seen = behaviour.seen(tuple(there.values()), rng)
        known = {i: person for i, person in zip(there, seen, strict=True) if person is not None}
        given.append(list(known))
        began = perf_counter()
        steps.append(controller.step(own, goal, tuple(known.values())))
        took.append(perf_counter() - began)
        states.append(state)
        true.append([_ABSENT if p is None else (*p.position, p.heading, *p.velocity) for p in everybody])
        x, y, vx, vy = state.tolist()
        if until_arrival and hypot(vx, vy) <= STOPPED and hypot(x - gx, y - gy) <= GOAL_RADIUS:
            break
        control = np.asarray(steps[-1].control, float)
        if not all(map(isfinite, control.tolist())):
            raise SolverError(f"{scenario.name!r}: the controller gave {control.tolist()} at {k * dt:g} s")
        own = robot.advance(own, control, dt)
    at = _facing(np.reshape(np.array(true, float), (len(states), len(everybody), 5)))
    return _log(scenario, s, cast.kept(len(everybody)), np.array(states), at, steps, took, given, robot)


def _facing(people: Array) -> Array:
    """The same, with the last heading known of those who are there without one; 0 if there never was one."""
    headings, there = people[:, :, 2], ~np.isnan(people[:, :, 0])
    if np.isnan(headings[there]).any():
        known = pd.DataFrame(headings).ffill().fillna(0.0).to_numpy()
        people[:, :, 2] = np.where(there, known, np.nan)
    return people


def _settings(controller: Controller, given: MPCSettings | None) -> MPCSettings:
    """What a run is measured by."""
    own = getattr(controller, "settings", None)
    own = own if isinstance(own, MPCSettings) else None
    if given and own and given.dt != own.dt:
        raise SolverError(f"the controller steps every {own.dt} s, the loop every {given.dt} s; give one")
    return given or own or MPCSettings()


class _Cast:
    """Everybody in their order, and the zone that is kept for each from when they first come."""

    def __init__(self, default: Ellipse | SpeedZone, change: Zones | None, speed: float) -> None:
        self._default, self._change, self._speed = default, change, speed
        self._zones: dict[int, Ellipse] = {}
        self._size: int | None = None

    def zone(self, i: int, person: Person | None) -> Ellipse:
        """What is kept for person i."""
        if i not in self._zones:
            own = self._default if person is None or person.zone is None else person.zone
            ellipse = as_ellipse(own, self._speed)
            if person is not None and person.heading is None:
                ellipse = circle_around(ellipse)
            self._zones[i] = self._change(ellipse) if self._change else ellipse
        return self._zones[i]

    def zoned(self, everybody: Sequence[Person | None]) -> Sequence[Person | None]:
        """The same people, with the zones that are kept."""
        if self._size is None:
            self._size = len(self._zones) or len(everybody)
        if len(everybody) != self._size:
            raise SolverError(
                f"a crowd is always as many, with None for who is not there; it was {self._size}, and now is "
                f"{len(everybody)}"
            )
        return [
            p if p is None or p.zone is self._zones.get(i, self) else replace(p, zone=self.zone(i, p))
            for i, p in enumerate(everybody)
        ]

    def kept(self, size: int) -> tuple[Ellipse, ...]:
        """The zone of each; for those who never came, of those without a zone of their own."""
        return tuple(self.zone(i, None) for i in range(size))


def _log(
    scenario: Scenario,
    settings: MPCSettings,
    kept: tuple[Ellipse, ...],
    states: Array,
    people: Array,
    steps: list[StepLike],
    took: list[float],
    given: list[list[int]],
    robot: Robot,
) -> SimulationLog:
    """What the run was, with what the controller does not tell left empty."""
    away = states - np.r_[scenario.goal, 0.0, 0.0]
    there = (np.hypot(*away[:, :2].T) <= GOAL_RADIUS) & (np.hypot(*away[:, 2:].T) <= STOPPED)
    controls = np.array([step.control for step in steps], float)
    inputs = getattr(robot, "inputs", None) or [f"control_{i}" for i in range(controls.shape[1])]
    times = [getattr(step, "solve_time", time) for step, time in zip(steps, took, strict=True)]
    return SimulationLog(
        scenario=scenario,
        settings=settings,
        zones=kept,
        states=states,
        controls=controls,
        people=people,
        predicted=_plans(steps),
        residual=_residuals(steps, given, people.shape[1], len(scenario.walls)),
        rung=np.array([getattr(step, "rung", "") for step in steps]),
        safe=np.array([bool(getattr(step, "safe", False)) for step in steps]),
        slack=np.array([getattr(step, "slack", np.nan) for step in steps]),
        solve_time=np.array(times),
        arrived=int(there.argmax()) if there.any() else None,
        promises=hasattr(steps[0], "safe"),
        inputs=tuple(inputs),
    )


def _plans(steps: list[StepLike]) -> Array:
    """The plan of each step, shape (n, N+1, 4); (n, 0, 4) if there is none, NaN after the shorter ones."""
    plans = [np.asarray(getattr(step, "predicted", np.zeros((0, 4))), float) for step in steps]
    longest = max(map(len, plans))
    if all(len(plan) == longest for plan in plans):
        return np.array(plans)
    return np.array([np.pad(p, ((0, longest - len(p)), (0, 0)), constant_values=np.nan) for p in plans])


def _residuals(steps: list[StepLike], given: list[list[int]], people: int, walls: int) -> Array:
    """The conditions of each step, shape (n, P+W, N_h), NaN for whom it was not given; else (n, P+W, 0).

    A step has a row for everybody it was given, then for whoever it remembers besides, then for each wall.
    """
    rows: list[Any] = [getattr(step, "residual", None) for step in steps]
    if any(row is None for row in rows):
        return np.zeros((len(steps), people + walls, 0))
    full = np.full((len(steps), people + walls, rows[0].shape[1]), np.nan)
    for each, row, of in zip(full, rows, given, strict=True):
        if len(row) < len(of) + walls:
            raise SolverError(
                "the residual of a step has a row for everybody whom it is given, and then for each wall; "
                f"got {len(row)} rows, expected {len(of) + walls}"
            )
        each[of] = row[: len(of)]
        each[people:] = row[len(row) - walls :]
    return full


def _check_start(scenario: Scenario, controller: MPCCBF, people: tuple[Person, ...]) -> None:
    h = controller.barriers(scenario.start[:2], people)
    if len(h) and h.min() < 0:
        i = int(h.argmin())
        of = f"person {i}" if i < len(people) else f"wall {i - len(people)}"
        raise SolverError(
            f"{scenario.name!r} starts in violation: h = {h[i]:.3f} m for {of} at "
            f"{scenario.start[:2].tolist()}; start where h >= 0"
        )
    if controller.goal_blocked(scenario.goal, people):
        raise SolverError(
            f"{scenario.name!r}: the goal {scenario.goal.tolist()} cannot be reached: it lies in the zone of "
            "somebody who stands; choose one where h >= 0"
        )
    speed, limit = float(np.hypot(*scenario.start[2:])), controller.settings.v_max
    if speed > limit:
        raise SolverError(f"{scenario.name!r} starts at {speed:.3f} m/s; the limit is {limit} m/s")
