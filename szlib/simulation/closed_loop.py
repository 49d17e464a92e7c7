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

from ..checks import Array
from ..control.controller import Controller, Robot, advance, as_controller
from ..control.person import BODY_RADIUS, Person, SpeedZone, as_ellipse, circle_around
from ..control.settings import MPCSettings
from ..errors import SolverError
from ..zones.ellipses import Ellipse
from .log import SimulationLog
from .scenario import GOAL_RADIUS, STOPPED_SPEED, UNAFFECTED, Crowd, CrowdModel, Scenario

__all__ = ["BODY", "Zones", "advance", "drive", "simulate"]

Zones = Callable[[Ellipse], Ellipse]
"""What is kept in place of a person's own zone, made from it."""

BODY = Ellipse((0.0, 0.0), (BODY_RADIUS, BODY_RADIUS))
"""The zone of people for whom neither they nor the controller have one: their body alone."""
_ABSENT = (np.nan,) * 5
_NO_PLAN = np.zeros((0, 4))


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
    controller : an `MPCCBF`, or anything else with `reset` and `step`: see `robots`.
    crowd : everybody's true motion; see `scenario.Crowd`. Default: the scenario's people walk on.

    Raises
    ------
    SolverError : the controller has other walls, or gives a control that is not finite; for an `MPCCBF` also:
        the start violates a barrier or the speed limit, or the goal cannot be reached: it lies too close to
        a wall, or in the zone of somebody who stands.
    """
    known = as_controller(controller)
    if known.walls is not None and not np.array_equal(known.walls, scenario.walls):
        raise SolverError(
            f"the controller knows {len(known.walls)} walls, and not the {len(scenario.walls)} of "
            f"{scenario.name!r}; build it with walls=scenario.walls"
        )
    try:
        known.check_start(scenario.start, scenario.goal, scenario.people if crowd is None else ())
    except SolverError as error:
        raise SolverError(f"{scenario.name!r}: {error}") from error
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
    controller = as_controller(controller)
    s = _settings(controller, settings)
    robot = controller.robot
    end = scenario.duration if max_time is None else max_time
    cast = _Cast(BODY if controller.zone is None else controller.zone, zones, s.zone_speed)
    people = tuple(replace(p, zone=cast.zone(i, p)) for i, p in enumerate(scenario.people))
    if crowd is None:
        crowd = behaviour.crowd(replace(scenario, people=people), seed)
    goal, dt, rng = scenario.goal, s.dt, np.random.default_rng([seed, 2])
    gx, gy = goal.tolist()
    controller.reset()
    own, numbers = robot.start(scenario.start), list[float | None]()
    rows: list[tuple[Any, ...]] = []
    for k in range(round(end / dt) + 1):
        state = robot.body(own)
        everybody = cast.zoned(crowd(k * dt, state))
        for p in everybody:
            numbers += _ABSENT if p is None else (*p.position, p.heading, *p.velocity)
        there = [i for i, p in enumerate(everybody) if p is not None]
        seen = behaviour.seen(tuple([p for p in everybody if p is not None]), rng)
        given = [i for i, p in zip(there, seen, strict=True) if p is not None]
        known = tuple([p for p in seen if p is not None])
        began = perf_counter()
        step = controller.step(own, goal, known)
        told = _told(step, perf_counter() - began)
        rows.append((state, given, *told))
        x, y, vx, vy = state.tolist()
        if until_arrival and hypot(vx, vy) <= STOPPED_SPEED and hypot(x - gx, y - gy) <= GOAL_RADIUS:
            break
        control = told[0]
        if not all(map(isfinite, control.tolist())):
            raise SolverError(f"{scenario.name!r}: the controller gave {control.tolist()} at {k * dt:g} s")
        own = robot.advance(own, control, dt)
    true = _facing(np.reshape(np.array(numbers, float), (len(rows), len(everybody), 5)))
    return _log(scenario, s, cast.kept(len(everybody)), rows, true, robot)


def _facing(people: Array) -> Array:
    """The same, with the last heading known of those who are there without one; 0 if there never was one."""
    headings, there = people[:, :, 2], ~np.isnan(people[:, :, 0])
    if np.isnan(headings[there]).any():
        known = pd.DataFrame(headings).ffill().fillna(0.0).to_numpy()
        people[:, :, 2] = np.where(there, known, np.nan)
    return people


def _settings(controller: Controller, given: MPCSettings | None) -> MPCSettings:
    """What a run is measured by."""
    own = controller.settings
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


def _told(step: Any, took: float) -> tuple[Any, ...]:
    """What is logged of a step, empty where it does not tell it: control, plan, conditions, fallback, if it
    is safe, slack, time. The step itself is let go: a thousand objects that stay cost a garbage collection.
    """
    return (
        np.asarray(step.control, float),
        np.asarray(getattr(step, "predicted", _NO_PLAN), float),
        getattr(step, "residual", None),
        getattr(step, "fallback", ""),
        getattr(step, "safe", None),
        getattr(step, "slack", np.nan),
        getattr(step, "solve_time", took),
    )


def _log(
    scenario: Scenario,
    settings: MPCSettings,
    kept: tuple[Ellipse, ...],
    rows: list[tuple[Any, ...]],
    people: Array,
    robot: Robot,
) -> SimulationLog:
    """What the run was: a row is a state, who was given to the controller, and what the step told."""
    way, given, *told = zip(*rows, strict=True)
    controls, plans, residual, fallback, safe, slack, solve_time = told
    states = np.array(way)
    away = states - np.r_[scenario.goal, 0.0, 0.0]
    there = (np.hypot(*away[:, :2].T) <= GOAL_RADIUS) & (np.hypot(*away[:, 2:].T) <= STOPPED_SPEED)
    inputs = getattr(robot, "inputs", None) or [f"control_{i}" for i in range(len(controls[0]))]
    return SimulationLog(
        scenario=scenario,
        settings=settings,
        zones=kept,
        states=states,
        controls=np.array(controls),
        people=people,
        predicted=_plans(plans),
        residual=_residuals(residual, given, people.shape[1], len(scenario.walls)),
        fallback=np.array(fallback),
        safe=np.array(safe, bool),
        slack=np.array(slack),
        solve_time=np.array(solve_time),
        arrival=int(there.argmax()) if there.any() else None,
        has_safety_claims=safe[0] is not None,
        inputs=tuple(inputs),
    )


def _plans(plans: Sequence[Array]) -> Array:
    """The plan of each step, shape (n, N+1, 4); (n, 0, 4) if there is none, NaN after the shorter ones."""
    longest = max(map(len, plans))
    if all(len(plan) == longest for plan in plans):
        return np.array(plans)
    return np.array([np.pad(p, ((0, longest - len(p)), (0, 0)), constant_values=np.nan) for p in plans])


def _residuals(rows: Sequence[Any], given: Sequence[list[int]], people: int, walls: int) -> Array:
    """The conditions of each step, shape (n, P+W, N_h), NaN for whom it was not given; else (n, P+W, 0).

    A step has a row for everybody it was given, then for whoever it remembers besides, then for each wall.
    """
    if any(row is None for row in rows):
        return np.zeros((len(rows), people + walls, 0))
    if all(len(row) == len(of) + walls == people + walls for row, of in zip(rows, given, strict=True)):
        return np.array(rows)
    full = np.full((len(rows), people + walls, rows[0].shape[1]), np.nan)
    for each, row, of in zip(full, rows, given, strict=True):
        if len(row) < len(of) + walls:
            raise SolverError(
                "the residual of a step has a row for everybody whom it is given, and then for each wall; "
                f"got {len(row)} rows, expected {len(of) + walls}"
            )
        each[of] = row[: len(of)]
        each[people:] = row[len(row) - walls :]
    return full
