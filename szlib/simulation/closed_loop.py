"""The closed loop: a robot, its controller, and people who walk on or deviate.

The robot is the double integrator of the paper's eq. 8; people go on at constant velocity, unaffected by
the robot (paper, sec. 4), unless a `Behaviour` says otherwise.  World frame, metres and seconds.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import hypot

import numpy as np

from ..control.barriers import Array
from ..control.mpc import MPCCBF
from ..control.step import Step
from ..errors import SolverError
from ..zones.ellipses import Ellipse
from .log import SimulationLog
from .scenario import GOAL_RADIUS, STOPPED, UNAFFECTED, Behaviour, Scenario

Zones = Callable[[Ellipse], Ellipse]
"""What the controller keeps in place of a person's own zone, made from it."""


def simulate(scenario: Scenario, controller: MPCCBF, *, max_time: float | None = None) -> SimulationLog:
    """Run a scenario until the robot rests at the goal, or to `max_time` [s] (default: its duration).

    The controller is reset first, so the same scenario gives the same run. Every row of the table,
    the last one included, has the control decided in its state.

    Raises
    ------
    SolverError : the controller has other walls, the start violates a barrier or the speed limit, or
        the goal cannot be reached: it lies too close to a wall, or in the zone of somebody who stands.
    """
    if not np.array_equal(controller.walls, scenario.walls):
        raise SolverError(
            f"the controller knows {len(controller.walls)} walls, and not the {len(scenario.walls)} of "
            f"{scenario.name!r}; build it with walls=scenario.walls"
        )
    _check_start(scenario, controller)
    return drive(scenario, controller, max_time=max_time)


def drive(
    scenario: Scenario,
    controller: MPCCBF,
    *,
    behaviour: Behaviour = UNAFFECTED,
    seed: int = 0,
    zones: Zones | None = None,
    max_time: float | None = None,
    until_arrival: bool = True,
) -> SimulationLog:
    """The loop itself, from wherever the robot starts: what `simulate` and `rollouts` run.

    Parameters
    ----------
    behaviour, seed : what people do, and the seed of it.
    zones : makes what the controller keeps from each person's own zone (or from the controller's).
    max_time : end of the run [s]; default: the scenario's duration.
    until_arrival : False drives on to the end of time, so that a robot that rests at its goal may still
        have to make room.

    Raises
    ------
    SolverError : the goal lies too close to a wall.
    """
    dt = controller.settings.dt
    end = scenario.duration if max_time is None else max_time
    kept = tuple(zones(z) if zones else z for z in map(controller.zone_of, scenario.people))
    people = tuple(replace(p, zone=zone) for p, zone in zip(scenario.people, kept, strict=True))
    crowd, rng = behaviour.crowd(people, seed), np.random.default_rng([seed, 2])
    gx, gy = scenario.goal.tolist()
    controller.reset()
    state, states, steps, true = scenario.start.copy(), [], [], []
    for k in range(round(end / dt) + 1):
        now = crowd(k * dt, state)
        steps.append(controller.step(state, scenario.goal, behaviour.seen(now, rng)))
        states.append(state)
        true.append([(*p.position, p.heading) for p in now])
        x, y, vx, vy = state.tolist()
        if until_arrival and hypot(vx, vy) <= STOPPED and hypot(x - gx, y - gy) <= GOAL_RADIUS:
            break
        state = advance(state, steps[-1].control, dt)
    return _log(scenario, controller, kept, np.array(states), true, steps)


def advance(state: Array, control: Array, dt: float) -> Array:
    """The state (x, y, vx, vy) one step later: a double integrator, exact (paper, eq. 8)."""
    position, velocity = state[:2], state[2:]
    return np.asarray(np.r_[position + dt * velocity + 0.5 * dt**2 * control, velocity + dt * control])


def _log(
    scenario: Scenario,
    controller: MPCCBF,
    kept: tuple[Ellipse, ...],
    states: Array,
    true: list[list[tuple[float, float, float | None]]],
    steps: list[Step],
) -> SimulationLog:
    away = states - np.r_[scenario.goal, 0.0, 0.0]
    there = (np.hypot(*away[:, :2].T) <= GOAL_RADIUS) & (np.hypot(*away[:, 2:].T) <= STOPPED)
    return SimulationLog(
        scenario=scenario,
        settings=controller.settings,
        zones=kept,
        states=states,
        controls=np.array([step.control for step in steps]),
        people=np.reshape(np.array(true, float), (len(states), len(kept), 3)),
        predicted=np.array([step.predicted for step in steps]),
        residual=np.array([step.residual for step in steps]),
        rung=np.array([step.rung for step in steps]),
        safe=np.array([step.safe for step in steps]),
        slack=np.array([step.slack for step in steps]),
        solve_time=np.array([step.solve_time for step in steps]),
        arrived=int(there.argmax()) if there.any() else None,
    )


def _check_start(scenario: Scenario, controller: MPCCBF) -> None:
    h = controller.barriers(scenario.start[:2], scenario.people)
    if len(h) and h.min() < 0:
        i = int(h.argmin())
        of = f"person {i}" if i < len(scenario.people) else f"wall {i - len(scenario.people)}"
        raise SolverError(
            f"{scenario.name!r} starts in violation: h = {h[i]:.3f} m for {of} at "
            f"{scenario.start[:2].tolist()}; start where h >= 0"
        )
    if controller.goal_blocked(scenario.goal, scenario.people):
        raise SolverError(
            f"{scenario.name!r}: the goal {scenario.goal.tolist()} cannot be reached: it lies in the zone of "
            "somebody who stands; choose one where h >= 0"
        )
    speed, limit = float(np.hypot(*scenario.start[2:])), controller.settings.v_max
    if speed > limit:
        raise SolverError(f"{scenario.name!r} starts at {speed:.3f} m/s; the limit is {limit} m/s")
