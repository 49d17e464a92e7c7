"""A run in numbers: one dictionary of metrics for scenarios, random worlds and comparisons.

After A. Francis et al., "Principles and guidelines for evaluating social robot navigation algorithms", 2023.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from scipy.ndimage import label

from ..control.barriers import Array, barrier, ellipse_distance, segment_distance
from ..control.distances import wall_margin
from ..control.problem import TOLERANCE
from ..control.step import RUNGS
from .scenario import GOAL_RADIUS, STOPPED

if TYPE_CHECKING:
    from .log import SimulationLog

Outcome = Literal[
    "arrived", "hit wall", "run into", "squeezed", "drove in", "boxed in", "deadlock", "out of time"
]
"""How a run ended; see `outcome`."""
START_UP = 1.0
"""Time from the start that does not count as slow or yielding [s]: v_max / a_max."""
CRUISE = 0.95
"""The robot brakes into its goal after it last had this share of its greatest speed (assumed)."""
ACTIVE = 1e-4
"""A barrier condition that leaves no more than this holds the robot back [m]."""
CROWDED = 0.2
"""Two barriers below this h at once leave a robot no way out [m] (assumed)."""
AT_LAST = 3.0
"""A robot that stood for so long at the end has stopped for good [s] (assumed)."""
_CELL = 0.1
"""Grid on which a way to the goal is looked for [m]."""
_AROUND = 2.5
"""How far around everything it reaches: enough for a zone and the robot beside it [m]."""


def metrics(log: SimulationLog) -> dict[str, Any]:
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
    time_stopped : slower than `STOPPED` after it first was faster, until the arrival.
    time_yielding : coming nearer to the goal at less than `STOPPED`, after the start-up, while a
        person's barrier condition is active.
    passing_side : the side, "right" or "left", on which the robot passes the person that came
        closest; "none" if that never happens. See `passing_side`.
    jerk : mean squared change of acceleration over time, until the arrival [m2/s6].
    people, walls : how many.
    infeasible_steps : steps whose plan violates the hard problem.
    flagged_steps : steps that say that they are not safe.
    unflagged_violations : steps that said they were safe and led to h < 0.
    unflagged_overlaps : steps that said they were safe and led to a Euclidean overlap.
    steps_warm, steps_cold, steps_kept, steps_relaxed, steps_braking : steps of each rung of the
        ladder in `szlib.control.solvers.ladder`.
    max_slack : largest violation of a hard row by any plan.
    solve_time_median, solve_time_p95, solve_time_p99, solve_time_max : of `Step.solve_time`.

    A step counts where its control was applied: not in the last state of the run.
    """
    dt, n_people = log.settings.dt, len(log.scenario.people)
    way = slice(None if log.arrived is None else log.arrived + 1)
    speed, applied = log.speed[way], slice(0, -1)
    time = dt * np.arange(len(speed))
    jolt = np.diff(log.controls[slice(-1 if log.arrived is None else log.arrived + 1)], axis=0)
    cruising = np.arange(len(speed)) <= np.flatnonzero(speed >= CRUISE * speed.max())[-1]
    moved = np.maximum.accumulate(speed > STOPPED)
    away = np.hypot(*(log.states[way, :2] - log.scenario.goal).T)
    held = (time >= START_UP) & (away > GOAL_RADIUS) & (log.cbf_people[way] <= ACTIVE)
    yields = held[:-1] & (-np.diff(away) / dt < STOPPED)
    worst, gap = log.h.min(axis=1, initial=np.inf), log.clearance.min(axis=1, initial=np.inf)
    return {
        "success": log.success,
        "outcome": outcome(log),
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
        "time_stopped": dt * int((moved & (speed < STOPPED))[:-1].sum()),
        "time_yielding": dt * int(yields.sum()),
        "passing_side": passing_side(log),
        "jerk": float((jolt**2).sum(axis=1).mean() / dt**2) if len(jolt) else 0.0,
        "people": n_people,
        "walls": len(log.scenario.walls),
        "infeasible_steps": int((log.slack[applied] > TOLERANCE).sum()),
        "flagged_steps": int((~log.safe[applied]).sum()),
        "unflagged_violations": int((log.safe[applied] & (worst[1:] < -TOLERANCE)).sum()),
        "unflagged_overlaps": int((log.safe[applied] & (gap[1:] < -TOLERANCE)).sum()),
        **{f"steps_{rung}": int((log.rung[applied] == rung).sum()) for rung in RUNGS},
        "max_slack": float(log.slack[applied].max(initial=0.0)),
        "solve_time_median": float(np.median(log.solve_time)),
        "solve_time_p95": float(np.quantile(log.solve_time, 0.95)),
        "solve_time_p99": float(np.quantile(log.solve_time, 0.99)),
        "solve_time_max": float(log.solve_time.max()),
    }


def _least(values: Array) -> float:
    return float(values.min()) if values.size else np.nan


def along_course(log: SimulationLog, person: int) -> tuple[Array, Array]:
    """Where a person is, as seen by a robot that faces from start to goal: (ahead, left) [m], each row."""
    course = log.scenario.goal - log.scenario.start[:2]
    course = course / np.hypot(*course)
    offset = log.people[:, person, :2] - log.states[:, :2]
    return offset @ course, offset @ np.array([-course[1], course[0]])


def passing_side(log: SimulationLog) -> str:
    """The side on which the robot passes the person that came closest.

    "right" if the person is to the left of the line from start to goal when abeam of the robot; "none" if
    that never happens.
    """
    if not log.scenario.people or np.array_equal(log.scenario.goal, log.scenario.start[:2]):
        return "none"
    seen = [along_course(log, i) for i in range(len(log.scenario.people))]
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
    ahead, left = along_course(log, person)
    x, y, h = (v[last] + share * (v[first] - v[last]) for v in (ahead, left, log.h[:, person]))
    return float(np.hypot(x, y)), float(h)


def outcome(log: SimulationLog) -> Outcome:
    """How a run ended; where a barrier was broken, how that began.

    "arrived", or where h fell below 0 first: "hit wall"; "run into", by a person who came nearer while
    the robot did so less; "squeezed", the same with another barrier close by (`CROWDED`); "drove in",
    the robot did it. Where it never did: "boxed in", stopped where no way leads to the goal;
    "deadlock", stopped where one does; "out of time", still on its way.
    """
    broken = np.flatnonzero(log.h.min(axis=1, initial=np.inf) < -TOLERANCE)
    if len(broken):
        return _breach(log, int(broken[0]))
    if log.success:
        return "arrived"
    last = round(AT_LAST / log.settings.dt)
    if log.speed[-last:].max() > STOPPED:
        return "out of time"
    return "deadlock" if path_exists(log) else "boxed in"


def _breach(log: SimulationLog, k: int) -> Outcome:
    """Who broke the barrier at state k."""
    i = int(log.h[k].argmin())
    if i >= len(log.scenario.people):
        return "hit wall"
    before = max(k - 1, 0)
    away = log.states[before, :2] - log.people[before, i, :2]
    away = away / np.hypot(*away)
    walked = (log.people[k, i, :2] - log.people[before, i, :2]) @ away
    drove = -(log.states[k, :2] - log.states[before, :2]) @ away
    if drove > walked:
        return "drove in"
    return "squeezed" if (log.h[k] < CROWDED).sum() > 1 else "run into"


def path_exists(log: SimulationLog) -> bool:
    """True if h >= 0 all along some way from the robot to the goal, with everybody where they are at last."""
    ends = np.array([log.states[-1, :2], log.scenario.goal])
    everything = np.vstack([ends, log.people[-1, :, :2], log.scenario.walls.reshape(-1, 2)])
    low, high = everything.min(axis=0) - _AROUND, everything.max(axis=0) + _AROUND
    axes = [np.arange(low[i], high[i], _CELL) for i in range(2)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    s, free = log.settings, np.ones(grid.shape[:2], bool)
    for zone, (x, y, heading) in zip(log.zones, log.people[-1], strict=True):
        free &= barrier(ellipse_distance(grid, zone.placed((x, y), heading)), s.r_robot, s.eps) >= 0
    for wall in log.scenario.walls:
        free &= barrier(segment_distance(grid, *wall), s.r_robot, wall_margin(wall, s)) >= 0
    here, there = np.round((ends - low) / _CELL).astype(int)
    regions = label(free, structure=np.ones((3, 3)))[0]
    around = [regions[max(i - 1, 0) : i + 2, max(j - 1, 0) : j + 2] for i, j in (here, there)]
    return bool(set(np.unique(around[0])) & set(np.unique(around[1])) - {0})
