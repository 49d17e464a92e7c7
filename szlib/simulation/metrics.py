"""Metrics of the motion of a run: one dictionary for scenarios, random worlds and comparisons.

People who are absent at a time are left out at that time.

Source: A. Francis et al., "Principles and guidelines for evaluating social robot navigation algorithms",
2023.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..control.settings import TOLERANCE
from ..control.step import STATUSES
from ..core.checks import Array
from .outcomes import classify_outcome
from .run import Run, nanmin
from .scenario import GOAL_RADIUS, STOPPED_SPEED

START_UP_TIME = 1.0  # time after the start that does not count as slow or yielding [s]: v_max / a_max
# The robot brakes into its goal after it last has this fraction of its greatest speed (assumed).
CRUISE_FRACTION = 0.95
# a barrier condition with at most this residual holds the robot back [m]
ACTIVE_RESIDUAL = 1e-4

# Metrics of `Step.solve_time`, each with its quantile.
SOLVE_TIMES = {
    "solve_time_median": 0.5,
    "solve_time_p95": 0.95,
    "solve_time_p99": 0.99,
    "solve_time_max": 1.0,
}


def compute_metrics(run: Run) -> dict[str, Any]:
    """The numbers of a `run`, in s, m, m/s; NaN where there is nothing to measure.

    Returns
    -------
    success : True if the robot is at rest within `GOAL_RADIUS` of the goal before the time is over.
    outcome : how the run ends; see `classify_outcome`.
    time_to_goal : time of the arrival; NaN without success.
    path_length : length of the polygon through the robot's positions until the arrival.
    min_h, min_h_people, min_h_walls : smallest h at any state, with the true positions of people; walls are
        everything fixed.
    min_clearance, min_clearance_people, min_clearance_walls : smallest Euclidean gap from the robot's disc
        to a person's body or to a wall; negative is an overlap.
    min_speed, mean_speed, max_speed : speed of the robot until the arrival; min_speed after the start-up and
        before the robot brakes into the goal, after it last has `CRUISE_FRACTION` of its greatest speed.
    time_stopped : time below `STOPPED_SPEED` after the robot is first faster, until the arrival.
    time_yielding : see `find_yielding_steps`; NaN if the controller does not report its conditions.
    passing_side : "right", "left" or "none"; see `find_passing_side`.
    jerk : mean squared change of acceleration over time, until the arrival [m2/s6].
    people, walls : number of people, and of everything fixed.
    violations, overlaps : all steps that lead to h < 0, or to a Euclidean overlap.
    infeasible_steps : steps whose plan violates a row without a price.
    claimed_safe_steps : steps with a safety claim; 0 for a controller without claims.
    flagged_steps : steps that are reported as not safe; 0 for a controller without claims.
    unflagged_violations : steps with a safety claim that lead to h < 0.
    unflagged_overlaps : steps with a safety claim that lead to a Euclidean overlap.
    steps_optimal, steps_relaxed, steps_restarted, steps_braking : steps of each `Step.status`.
    max_slack : largest violation of a row without a price by any plan; NaN if the controller reports none.
    solve_time_median, solve_time_p95, solve_time_p99, solve_time_max : of `Step.solve_time`, or of the call.

    Notes
    -----
    A step counts if its control is applied.  The step of the last state does not count.
    """
    dt, n_people, way, applied = (
        run.settings.dt,
        len(run.zones),
        run.until_arrival,
        slice(0, -1),
    )
    speed = run.speed[way]
    time = dt * np.arange(len(speed))
    jerk = np.diff(np.diff(run.states[way, 2:], axis=0), axis=0) / dt**2
    cruising = (
        np.arange(len(speed))
        <= np.flatnonzero(speed >= CRUISE_FRACTION * speed.max())[-1]
    )
    has_moved = np.maximum.accumulate(speed > STOPPED_SPEED)
    has_residuals = run.residual.shape[2] > 0 or not n_people
    violated = (nanmin(run.h, axis=1) < -TOLERANCE)[1:]
    overlap = (nanmin(run.clearance, axis=1) < -TOLERANCE)[1:]
    solve_times = np.quantile(run.solve_time, list(SOLVE_TIMES.values())).tolist()
    return {
        "success": run.success,
        "outcome": classify_outcome(run),
        "time_to_goal": np.nan if run.arrival is None else round(dt * run.arrival, 9),
        "path_length": measure_path_length(run.states[way, :2]),
        "min_h": _min_or_nan(run.h),
        "min_h_people": _min_or_nan(run.h[:, :n_people]),
        "min_h_walls": _min_or_nan(run.h[:, n_people:]),
        "min_clearance": _min_or_nan(run.clearance),
        "min_clearance_people": _min_or_nan(run.clearance[:, :n_people]),
        "min_clearance_walls": _min_or_nan(run.clearance[:, n_people:]),
        "min_speed": float(
            speed[(time >= START_UP_TIME) & cruising].min(initial=speed.max())
        ),
        "mean_speed": float(speed.mean()),
        "max_speed": float(speed.max()),
        "time_stopped": dt * int((has_moved & (speed < STOPPED_SPEED))[:-1].sum()),
        "time_yielding": dt * int(find_yielding_steps(run).sum())
        if has_residuals
        else np.nan,
        "passing_side": find_passing_side(run),
        "jerk": float((jerk**2).sum(axis=1).mean()) if len(jerk) else 0.0,
        "people": n_people,
        "walls": len(run.scenario.fixed),
        "violations": int(violated.sum()),
        "overlaps": int(overlap.sum()),
        "infeasible_steps": int((run.slack[applied] > TOLERANCE).sum()),
        "claimed_safe_steps": int(run.safe[applied].sum()),
        "flagged_steps": int(run.flagged[applied].sum()),
        "unflagged_violations": int((run.safe[applied] & violated).sum()),
        "unflagged_overlaps": int((run.safe[applied] & overlap).sum()),
        **{
            f"steps_{name}": int((run.status[applied] == name).sum())
            for name in STATUSES
        },
        "max_slack": float(run.slack[applied].max(initial=0.0)),
        **dict(zip(SOLVE_TIMES, solve_times, strict=True)),
    }


def measure_path_length(points: Array) -> float:
    """Length of the polygon through `points`, shape (n, 2) [m]."""
    return float(np.hypot(*np.diff(points, axis=0).T).sum())


def _min_or_nan(values: Array) -> float:
    smallest = float(nanmin(values))
    return smallest if np.isfinite(smallest) else np.nan


def find_yielding_steps(run: Run) -> NDArray[np.bool_]:
    """True at the steps of a `run` at which the robot yields, until the arrival, shape (n,).

    The robot yields if it approaches the goal at less than `STOPPED_SPEED`, after the start-up, while the
    barrier condition of a person holds it back (`ACTIVE_RESIDUAL`).
    """
    way = run.until_arrival
    to_goal = np.hypot(*(run.states[way, :2] - run.scenario.goal).T)
    is_held = (run.time[way] >= START_UP_TIME) & (to_goal > GOAL_RADIUS)
    is_held &= run.cbf_people[way] <= ACTIVE_RESIDUAL
    return np.asarray(
        is_held[:-1] & (-np.diff(to_goal) / run.settings.dt < STOPPED_SPEED)
    )


def locate_along_course(run: Run, person: int) -> tuple[Array, Array]:
    """Position of a `person` at each state of a `run`, seen by a robot that faces from start to goal.

    Returns
    -------
    (ahead, left), each of shape (n,) [m].
    """
    course = run.scenario.goal - run.scenario.start[:2]
    course = course / np.hypot(*course)
    offset = run.people[:, person, :2] - run.states[:, :2]
    return offset @ course, offset @ np.array([-course[1], course[0]])


def find_passing_side(run: Run) -> str:
    """Side on which the robot of a `run` passes the person who comes closest: "right", "left" or "none".

    "right" means: the person is to the left of the line from start to goal when abeam of the robot.  "none"
    means: the person is never abeam.
    """
    if not run.zones or np.array_equal(run.scenario.goal, run.scenario.start[:2]):
        return "none"
    closest = int(nanmin(run.clearance[:, : len(run.zones)], axis=0).argmin())
    ahead, left = locate_along_course(run, closest)
    abeam = np.flatnonzero((ahead[:-1] > 0) & (ahead[1:] <= 0))
    if not len(abeam):
        return "none"
    return "right" if left[abeam[-1] + 1] > 0 else "left"


def find_avoidance_start(
    run: Run, person: int = 0, deviation: float = 0.1
) -> tuple[float, float]:
    """Distance to a person, and h, where the robot first leaves its straight line (paper, sec. 4).

    Parameters
    ----------
    run : the run.
    person : index of the person.
    deviation : distance from the line from start to goal at which avoidance starts [m].

    Returns
    -------
    (distance, h) [m], interpolated between two states; NaN if the robot stays on the line.
    """
    start, course = run.scenario.start[:2], run.scenario.goal - run.scenario.start[:2]
    beside = run.states[:, :2] - start
    beside = np.abs(beside[:, 0] * course[1] - beside[:, 1] * course[0]) / np.hypot(
        *course
    )
    rows = np.flatnonzero(beside > deviation)
    if not len(rows):
        return np.nan, np.nan
    last, first = max(int(rows[0]) - 1, 0), int(rows[0])
    share = (
        (deviation - beside[last]) / (beside[first] - beside[last])
        if first > last
        else 1.0
    )
    ahead, left = locate_along_course(run, person)
    x, y, h = (
        v[last] + share * (v[first] - v[last]) for v in (ahead, left, run.h[:, person])
    )
    return float(np.hypot(x, y)), float(h)
