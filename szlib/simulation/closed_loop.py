"""The closed loop: a robot among people who walk on, its log, and the usual metrics of it.

`simulate` drives the double integrator of the paper's eq. 8 with a controller, while people go on at
constant velocity, unaffected by the robot (paper, sec. 4). World frame, metres and seconds.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from math import pi
from typing import Any

import numpy as np
import pandas as pd

from ..control.barriers import Array, check_wall, finite
from ..control.distances import euclidean_to_segment
from ..control.mpc import MPCCBF, RUNGS, Step
from ..control.people import Person
from ..control.problem import TOLERANCE
from ..errors import SolverError

GOAL_RADIUS = 0.1
"""The robot has arrived within this distance of the goal [m], when it has stopped (assumed)."""
STOPPED = 0.05
"""Below this speed the robot stands, and below this progress to the goal it yields [m/s] (assumed)."""
START_UP = 1.0
"""Time from the start that does not count as slow, stopped or yielding [s]: v_max / a_max."""
CRUISE = 0.95
"""The robot brakes into its goal after it last had this share of its greatest speed (assumed)."""
BODY_RADIUS = 0.25
"""Radius of a person's body, for the clearance: half the breadth of shoulders [m] (assumed)."""
ACTIVE = 1e-4
"""A barrier condition that leaves no more than this holds the robot back [m]."""


@dataclass(frozen=True)
class Claim:
    """A sentence that the paper claims of a scenario, and the check of a run against it.

    `check(log)` returns whether it holds, and the figure that decides.
    """

    text: str
    check: Callable[[SimulationLog], tuple[bool, float]]


@dataclass(frozen=True)
class Scenario:
    """A meeting: who is where, and what should happen.

    Parameters
    ----------
    name, title : short name, and the line above a figure.
    start : (x, y, vx, vy) of the robot [m, m/s].
    goal : (x, y) [m].
    people : everybody, at time 0.
    walls : segments, shape (n, 2, 2) [m].
    claims : what the paper says of it.
    duration : time after which a run that has not arrived is given up [s].

    Raises
    ------
    SolverError : a number is not finite, a shape is wrong, or a wall has no length.
    """

    name: str
    start: Array
    goal: Array
    people: tuple[Person, ...] = ()
    walls: Array = field(default_factory=lambda: np.zeros((0, 2, 2)))
    claims: tuple[Claim, ...] = ()
    title: str = ""
    duration: float = 60.0

    def __post_init__(self) -> None:
        walls = np.array([check_wall(wall) for wall in self.walls]).reshape(-1, 2, 2)
        given = {
            "start": finite("start", self.start, (4,)),
            "goal": finite("goal", self.goal, (2,)),
            "walls": walls,
        }
        for name, value in given.items():
            frozen = value.copy()
            frozen.setflags(write=False)
            object.__setattr__(self, name, frozen)
        object.__setattr__(self, "people", tuple(self.people))
        if not 0 < self.duration < np.inf:
            raise SolverError(f"duration must be a positive number of seconds; got {self.duration}")

    def turned(self) -> Scenario:
        """The same place with everybody facing the other way; who walks, walks on backwards."""
        people = tuple(replace(p, heading=(p.heading or 0.0) + pi) for p in self.people)
        return replace(self, people=people)


@dataclass(frozen=True)
class SimulationLog:
    """One run, from the start to the goal or to the end of time.

    Attributes
    ----------
    scenario, controller : what was run.
    table : one row a step, the state at its time and the control decided there. Columns: t [s], x, y
        [m], vx, vy, speed [m/s], ax, ay [m/s2], status, rung, slack, solve_time [s], cbf_people (smallest
        residual of a person's barrier condition [m], inf without people), clearance [m] (from the
        robot's body to the nearest wall or person's body, Euclidean, person as a disc of
        `BODY_RADIUS`), and for each person i and wall j: person_i_x, person_i_y [m],
        person_i_heading [rad], h_person_i, h_wall_j [m].
    predicted : the plan of each step, shape (steps, N+1, 4).
    success : the goal was reached.
    """

    scenario: Scenario
    controller: MPCCBF
    table: pd.DataFrame
    predicted: Array
    success: bool

    def min_h(self) -> pd.Series[float]:
        """Smallest h of each person and wall over the run [m]."""
        return self.table.filter(regex="^h_").min()

    def progress(self) -> Array:
        """Speed at which the goal came nearer during each step, shape (steps - 1,) [m/s]."""
        away = np.hypot(*(self.table[["x", "y"]].to_numpy() - self.scenario.goal).T)
        return np.asarray(-np.diff(away) / self.controller.settings.dt)

    def metrics(self) -> dict[str, Any]:
        """The run in numbers, in s, m, m/s; NaN where there is nothing to measure.

        success : at rest within `GOAL_RADIUS` of the goal before the end of time.
        time_to_goal : duration of a run that succeeded.
        path_length : length of the polygon through the robot's positions.
        min_h : smallest h of any person or wall at any step.
        min_clearance : smallest Euclidean gap from the robot's disc to a wall or to a person's body.
        min_speed, mean_speed, max_speed : of the robot; min_speed after the start-up and before it
            brakes into the goal, after it last had `CRUISE` of its greatest speed.
        time_stopped : slower than `STOPPED`, after the start-up and before arrival.
        time_yielding : coming nearer to the goal at less than `STOPPED`, after the start-up, while a
            person's barrier condition is active.
        passing_side : the side, "right" or "left", on which the robot passes the person that came
            closest: "right" if the person is to the left of the line from start to goal when
            abeam of the robot; "none" if that never happens.
        infeasible_steps : steps whose plan violates the hard problem.
        steps_warm, steps_cold, steps_kept, steps_relaxed, steps_braking : steps of each rung of the
            ladder in `szlib.mpc`.
        solve_time_median, solve_time_p95, solve_time_max : of `Step.solve_time`.
        """
        table = self.table
        dt, speed = self.controller.settings.dt, table["speed"].to_numpy()
        h, solve_time = self.min_h(), table["solve_time"]
        later = table["t"].to_numpy() >= START_UP
        before_braking = np.arange(len(speed)) <= np.flatnonzero(speed >= CRUISE * speed.max())[-1]
        held = table["cbf_people"].to_numpy() <= ACTIVE
        away = np.hypot(*(table[["x", "y"]].to_numpy() - self.scenario.goal).T) > GOAL_RADIUS
        slow = self.progress() < STOPPED
        return {
            "success": self.success,
            "time_to_goal": float(table["t"].iloc[-1]) if self.success else np.nan,
            "path_length": float(np.hypot(table["x"].diff(), table["y"].diff()).sum()),
            "min_h": float(h.min()) if len(h) else np.nan,
            "min_clearance": float(table["clearance"].min()) if len(h) else np.nan,
            "min_speed": float(speed[later & before_braking].min(initial=speed.max())),
            "mean_speed": float(speed.mean()),
            "max_speed": float(speed.max()),
            "time_stopped": dt * int((later & away & (speed < STOPPED)).sum()),
            "time_yielding": dt * int((later & away & held)[:-1][slow].sum()),
            "passing_side": passing_side(self),
            "infeasible_steps": int((table["slack"] > TOLERANCE).sum()),
            **{f"steps_{rung}": int((table["rung"] == rung).sum()) for rung in RUNGS},
            "solve_time_median": float(solve_time.median()),
            "solve_time_p95": float(solve_time.quantile(0.95)),
            "solve_time_max": float(solve_time.max()),
        }


def simulate(scenario: Scenario, controller: MPCCBF, *, max_time: float | None = None) -> SimulationLog:
    """Run a scenario until the robot rests at the goal, or to `max_time` [s] (default: its duration).

    The controller is reset first, so the same scenario gives the same run. Every row of the table,
    the last one included, has the control decided in its state.

    Raises
    ------
    SolverError : the controller has other walls, the start violates a barrier or the speed limit, or
        the goal cannot be reached.
    """
    if not np.array_equal(controller.walls, scenario.walls):
        raise SolverError(
            f"the controller knows {len(controller.walls)} walls, and not the {len(scenario.walls)} of "
            f"{scenario.name!r}; build it with walls=scenario.walls"
        )
    _check_start(scenario, controller)
    dt = controller.settings.dt
    end = scenario.duration if max_time is None else max_time
    state, people = scenario.start.copy(), list(scenario.people)
    controller.reset()
    rows, predicted, success = [], [], False
    for k in range(round(end / dt) + 1):
        step = controller.step(state, scenario.goal, people)
        rows.append(_row(round(k * dt, 9), state, people, step, controller))
        predicted.append(step.predicted)
        rests = np.hypot(*state[2:]) <= STOPPED
        success = bool(rests and np.hypot(*(state[:2] - scenario.goal)) <= GOAL_RADIUS)
        if success:
            break
        state = advance(state, step.control, dt)
        people = [person.after((k + 1) * dt) for person in scenario.people]
    return SimulationLog(scenario, controller, pd.DataFrame(rows), np.array(predicted), success)


def advance(state: Array, control: Array, dt: float) -> Array:
    """The state (x, y, vx, vy) one step later: a double integrator, exact (paper, eq. 8)."""
    position, velocity = state[:2], state[2:]
    return np.asarray(np.r_[position + dt * velocity + 0.5 * dt**2 * control, velocity + dt * control])


def _check_start(scenario: Scenario, controller: MPCCBF) -> None:
    h = controller.barriers(scenario.start[:2], scenario.people)
    if len(h) and h.min() < 0:
        i = int(h.argmin())
        of = f"person {i}" if i < len(scenario.people) else f"wall {i - len(scenario.people)}"
        raise SolverError(
            f"{scenario.name!r} starts in violation: h = {h[i]:.3f} m for {of} at "
            f"{scenario.start[:2].tolist()}; start where h >= 0"
        )
    speed, limit = float(np.hypot(*scenario.start[2:])), controller.settings.v_max
    if speed > limit:
        raise SolverError(f"{scenario.name!r} starts at {speed:.3f} m/s; the limit is {limit} m/s")


def _row(t: float, state: Array, people: list[Person], step: Step, controller: MPCCBF) -> dict[str, Any]:
    x, y, vx, vy = state.tolist()
    ax, ay = step.control.tolist()
    h, n = step.h, len(people)
    gaps = [np.hypot(x - p.position[0], y - p.position[1]) - BODY_RADIUS for p in people]
    gaps += [float(euclidean_to_segment(state[:2], *wall)) for wall in controller.walls]
    row = {
        "t": t, "x": x, "y": y, "vx": vx, "vy": vy, "speed": float(np.hypot(vx, vy)), "ax": ax, "ay": ay,
        "status": step.status, "rung": step.rung, "slack": step.slack, "solve_time": step.solve_time,
        "cbf_people": float(step.residual[:n].min(initial=np.inf)),
        "clearance": float(min(gaps, default=np.inf)) - controller.settings.r_robot,
    }  # fmt: skip
    for i, person in enumerate(people):
        row |= {f"person_{i}_x": person.position[0], f"person_{i}_y": person.position[1]}
        row |= {f"person_{i}_heading": person.heading, f"h_person_{i}": float(h[i])}
    return row | {f"h_wall_{j}": float(h[n + j]) for j in range(len(controller.walls))}


def relative(log: SimulationLog, person: int) -> tuple[Array, Array]:
    """Where a person is, as seen by a robot that faces from start to goal: (ahead, left) [m], each row."""
    course = log.scenario.goal - log.scenario.start[:2]
    course = course / np.hypot(*course)
    there = log.table[[f"person_{person}_x", f"person_{person}_y"]].to_numpy()
    offset = there - log.table[["x", "y"]].to_numpy()
    return offset @ course, offset @ np.array([-course[1], course[0]])


def passing_side(log: SimulationLog) -> str:
    """The side on which the robot passes the person that came closest; see `SimulationLog.metrics`."""
    if not log.scenario.people:
        return "none"
    seen = [relative(log, i) for i in range(len(log.scenario.people))]
    ahead, left = min(seen, key=lambda each: np.hypot(*each).min())
    abeam = np.flatnonzero((ahead[:-1] > 0) & (ahead[1:] <= 0))
    if not len(abeam):
        return "none"
    return "right" if left[abeam[-1] + 1] > 0 else "left"


def avoidance_start(log: SimulationLog, person: int = 0, deviation: float = 0.1) -> tuple[float, float]:
    """Distance to a person, and h, where the robot first leaves its straight line (paper, sec. 4).

    Returns
    -------
    (distance, h) [m] where it is first `deviation` [m] beside the line from start to goal, between the
    rows before and after; NaN if it never is.
    """
    start, course = log.scenario.start[:2], log.scenario.goal - log.scenario.start[:2]
    beside = log.table[["x", "y"]].to_numpy() - start
    beside = np.abs(beside[:, 0] * course[1] - beside[:, 1] * course[0]) / np.hypot(*course)
    rows = np.flatnonzero(beside > deviation)
    if not len(rows):
        return np.nan, np.nan
    last, first = max(int(rows[0]) - 1, 0), int(rows[0])
    share = (deviation - beside[last]) / (beside[first] - beside[last]) if first > last else 1.0
    ahead, left = relative(log, person)
    h = log.table[f"h_person_{person}"].to_numpy()
    x, y, barrier = (v[last] + share * (v[first] - v[last]) for v in (ahead, left, h))
    return float(np.hypot(x, y)), float(barrier)
