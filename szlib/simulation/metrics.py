"""The motion of a run: one dictionary of metrics for scenarios, random worlds and comparisons.

People who are not there at a time, NaN in the log, are left out of it.

After A. Francis et al., "Principles and guidelines for evaluating social robot navigation algorithms", 2023.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..checks import Array
from ..control.problem import TOLERANCE
from ..control.step import RUNGS
from .outcomes import classify_outcome, nanmin
from .scenario import GOAL_RADIUS, STOPPED_SPEED

if TYPE_CHECKING:
    from .log import SimulationLog

START_UP = 1.0
"""Time from the start that does not count as slow or yielding [s]: v_max / a_max."""
CRUISE = 0.95
"""The robot brakes into its goal after it last had this share of its greatest speed (assumed)."""
ACTIVE = 1e-4
"""A barrier condition that leaves no more than this holds the robot back [m]."""

SOLVE_TIMES = {
    "solve_time_median": 0.5,
    "solve_time_p95": 0.95,
    "solve_time_p99": 0.99,
    "solve_time_max": 1.0,
}
"""Metrics of `Step.solve_time`, and the quantile that each is."""


def compute_metrics(log: SimulationLog) -> dict[str, Any]:
    """The run in numbers, in s, m, m/s; NaN where there is nothing to measure.

    success : at rest within `GOAL_RADIUS` of the goal before the end of time.
    outcome : how it ended; see `outcome`.
    time_to_goal : until then; NaN without success.
    path_length : length of the polygon through the robot's positions until the arrival.
    min_h, min_h_people, min_h_walls : smallest h at any state, with people as they truly were.
    min_clearance, min_clearance_people, min_clearance_walls : smallest Euclidean gap from the robot's disc
        to a person's body or to a wall; negative is an overlap.
    min_speed, mean_speed, max_speed : of the robot until the arrival; min_speed after the start-up and
        before it brakes into the goal, after it last had `CRUISE` of its greatest speed.
    time_stopped : slower than `STOPPED_SPEED` after it first was faster, until the arrival.
    time_yielding : coming nearer to the goal at less than `STOPPED_SPEED`, after the start-up, while a
        person's barrier condition is active; NaN where the controller does not tell its conditions.
    passing_side : the side, "right" or "left", on which the robot passes the person that came
        closest; "none" if that never happens. See `passing_side`.
    jerk : mean squared change of acceleration over time, until the arrival [m2/s6].
    people, walls : how many.
    violations, overlaps : steps that led to h < 0, or to a Euclidean overlap, whatever was said of them.
    infeasible_steps : steps whose plan violates the hard problem.
    claimed_safe_steps : steps that said they were safe; 0 for a controller that promises nothing.
    flagged_steps : steps that say that they are not safe; 0 too for such a controller.
    unflagged_violations : steps that said they were safe and led to h < 0.
    unflagged_overlaps : steps that said they were safe and led to a Euclidean overlap.
    steps_warm, steps_cold, steps_kept, steps_relaxed, steps_braking : steps of each rung of the
        ladder in `szlib.control.solvers.fallbacks`.
    max_slack : largest violation of a hard row by any plan; NaN where the controller does not tell it.
    solve_time_median, solve_time_p95, solve_time_p99, solve_time_max : of `Step.solve_time`, or of the call.

    A step counts where its control was applied: not in the last state of the run.
    """
    dt, n_people = log.settings.dt, len(log.zones)
    way = slice(None if log.arrived is None else log.arrived + 1)
    speed, applied = log.speed[way], slice(0, -1)
    time = dt * np.arange(len(speed))
    jolt = np.diff(np.diff(log.states[way, 2:], axis=0), axis=0) / dt**2
    cruising = np.arange(len(speed)) <= np.flatnonzero(speed >= CRUISE * speed.max())[-1]
    moved = np.maximum.accumulate(speed > STOPPED_SPEED)
    told = log.residual.shape[2] > 0 or not n_people
    broken = (nanmin(log.h, axis=1) < -TOLERANCE)[1:]
    overlap = (nanmin(log.clearance, axis=1) < -TOLERANCE)[1:]
    times = np.quantile(log.solve_time, list(SOLVE_TIMES.values())).tolist()
    return {
        "success": log.success,
        "outcome": classify_outcome(log),
        "time_to_goal": np.nan if log.arrived is None else round(dt * log.arrived, 9),
        "path_length": float(np.hypot(*np.diff(log.states[way, :2], axis=0).T).sum()),
        "min_h": _least(log.h),
        "min_h_people": _least(log.h[:, :n_people]),
        "min_h_walls": _least(log.h[:, n_people:]),
        "min_clearance": _least(log.clearance),
        "min_clearance_people": _least(log.clearance[:, :n_people]),
        "min_clearance_walls": _least(log.clearance[:, n_people:]),
        "min_speed": float(speed[(time >= START_UP) & cruising].min(initial=speed.max())),
        "mean_speed": float(speed.mean()),
        "max_speed": float(speed.max()),
        "time_stopped": dt * int((moved & (speed < STOPPED_SPEED))[:-1].sum()),
        "time_yielding": dt * int(find_yielding_steps(log).sum()) if told else np.nan,
        "passing_side": find_passing_side(log),
        "jerk": float((jolt**2).sum(axis=1).mean()) if len(jolt) else 0.0,
        "people": n_people,
        "walls": len(log.scenario.walls),
        "violations": int(broken.sum()),
        "overlaps": int(overlap.sum()),
        "infeasible_steps": int((log.slack[applied] > TOLERANCE).sum()),
        "claimed_safe_steps": int(log.safe[applied].sum()),
        "flagged_steps": int(log.flagged[applied].sum()),
        "unflagged_violations": int((log.safe[applied] & broken).sum()),
        "unflagged_overlaps": int((log.safe[applied] & overlap).sum()),
        **{f"steps_{rung}": int((log.rung[applied] == rung).sum()) for rung in RUNGS},
        "max_slack": float(log.slack[applied].max(initial=0.0)),
        **dict(zip(SOLVE_TIMES, times, strict=True)),
    }


def _least(values: Array) -> float:
    smallest = float(nanmin(values))
    return smallest if np.isfinite(smallest) else np.nan


def find_yielding_steps(log: SimulationLog) -> NDArray[np.bool_]:
    """At which steps until the arrival the robot yields, shape (n,): see `metrics`, time_yielding."""
    way = slice(None if log.arrived is None else log.arrived + 1)
    away = np.hypot(*(log.states[way, :2] - log.scenario.goal).T)
    held = (log.time[way] >= START_UP) & (away > GOAL_RADIUS) & (log.cbf_people[way] <= ACTIVE)
    return np.asarray(held[:-1] & (-np.diff(away) / log.settings.dt < STOPPED_SPEED))


def locate_along_course(log: SimulationLog, person: int) -> tuple[Array, Array]:
    """Where a person is, as seen by a robot that faces from start to goal: (ahead, left) [m], each row."""
    course = log.scenario.goal - log.scenario.start[:2]
    course = course / np.hypot(*course)
    offset = log.people[:, person, :2] - log.states[:, :2]
    return offset @ course, offset @ np.array([-course[1], course[0]])


def find_passing_side(log: SimulationLog) -> str:
    """The side on which the robot passes the person that came closest.

    "right" if the person is to the left of the line from start to goal when abeam of the robot; "none" if
    that never happens.
    """
    if not log.zones or np.array_equal(log.scenario.goal, log.scenario.start[:2]):
        return "none"
    apart = np.moveaxis(log.people[:, :, :2] - log.states[:, None, :2], -1, 0)
    ahead, left = locate_along_course(log, int(nanmin(np.hypot(*apart), axis=0).argmin()))
    abeam = np.flatnonzero((ahead[:-1] > 0) & (ahead[1:] <= 0))
    if not len(abeam):
        return "none"
    return "right" if left[abeam[-1] + 1] > 0 else "left"


def find_avoidance_start(log: SimulationLog, person: int = 0, deviation: float = 0.1) -> tuple[float, float]:
    """Distance to a person, and h, where the robot first leaves its straight line (paper, sec. 4).

    Returns
    -------
    (distance, h) [m] where it is first `deviation` [m] beside the line from start to goal, between the
    states before and after; NaN if it never is.
    """
    start, course = log.scenario.start[:2], log.scenario.goal - log.scenario.start[:2]
    beside = log.states[:, :2] - start
    beside = np.abs(beside[:, 0] * course[1] - beside[:, 1] * course[0]) / np.hypot(*course)
    rows = np.flatnonzero(beside > deviation)
    if not len(rows):
        return np.nan, np.nan
    last, first = max(int(rows[0]) - 1, 0), int(rows[0])
    share = (deviation - beside[last]) / (beside[first] - beside[last]) if first > last else 1.0
    ahead, left = locate_along_course(log, person)
    x, y, h = (v[last] + share * (v[first] - v[last]) for v in (ahead, left, log.h[:, person]))
    return float(np.hypot(x, y)), float(h)
