"""A run in numbers and words: one dictionary of metrics, how the run ends, and what the robot does.

People who are absent at a time are left out at that time.

Source: A. Francis et al., "Principles and guidelines for evaluating social robot navigation algorithms",
2023.
"""

from __future__ import annotations

from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import label

from ..control import STATUSES, Obstacles, Zone
from ..control.settings import TOLERANCE
from ..core.checks import Array
from .robot_run import Run, nanmin
from .scenario import GOAL_RADIUS, STOPPED_SPEED

START_UP_TIME = 1.0  # time after the start that does not count as slow or yielding [s]: v_max / a_max
# The robot brakes into its goal after it last has this fraction of its greatest speed (assumed).
CRUISE_FRACTION = 0.95
# a barrier condition with at most this residual holds the robot back [m]
ACTIVE_RESIDUAL = 1e-4

# The steps whose control is applied: all but that of the last state.
_APPLIED = slice(0, -1)
# Metrics of `Step.solve_time`, each with its quantile.
SOLVE_TIMES = {
    "solve_time_median": 0.5,
    "solve_time_p95": 0.95,
    "solve_time_p99": 0.99,
    "solve_time_max": 1.0,
}

Outcome = Literal[
    "arrived",
    "hit wall",
    "run into",
    "squeezed",
    "drove in",
    "boxed in",
    "deadlock",
    "out of time",
]
"""How a run ends; see `classify_outcome`."""
# if two barriers are below this h, the robot has no way out [m] (assumed)
CROWDED_H = 0.2
STOP_WINDOW = 3.0  # a robot that stands for this time at the end of a run has stopped for good [s] (assumed)
_CELL = 0.1  # cell size of the grid for the search of a free path to the goal [m]
_MARGIN = 2.5  # margin of the grid around everything: enough for a zone and the robot beside it [m]

Strategy = Literal[
    "goes ahead",
    "waits",
    "backs out",
    "passes on the other side",
    "deadlock",
    "infeasible",
    "h < 0",
]
"""What a robot does in a run; see `classify_strategy`."""
STRATEGIES: tuple[Strategy, ...] = get_args(Strategy)
MIN_WAIT = 1.0  # a robot that yields for this time waits [s] (assumed)
# a robot that goes back by this distance, its radius, backs out [m] (assumed)
MIN_RETREAT = 0.5


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
    min_speed, mean_speed, max_speed : speed of the robot until the arrival; min_speed only after the start-up
        and until the robot last has `CRUISE_FRACTION` of its greatest speed, because then it brakes into the
        goal. So it leaves out a stop from which the robot does not recover; `time_stopped` has it.
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
    steps_optimal, steps_relaxed, steps_restarted, steps_kept, steps_braking : steps of each `Step.status`.
    max_slack : largest violation of a row without a price by any plan; NaN if the controller reports none.
    solve_time_median, solve_time_p95, solve_time_p99, solve_time_max : of `Step.solve_time`, or of the call.

    Notes
    -----
    A step counts if its control is applied.  The step of the last state does not count.
    """
    dt = run.settings.dt
    n_people = len(run.zones)
    states = run.states[run.until_arrival]
    jerk = np.diff(states[:, 2:], n=2, axis=0) / dt**2
    has_residuals = run.residual.shape[2] > 0 or not n_people
    yielding = dt * int(find_yielding_steps(run).sum()) if has_residuals else np.nan
    return {
        "success": run.success,
        "outcome": classify_outcome(run),
        "time_to_goal": np.nan if run.arrival is None else round(dt * run.arrival, 9),
        "path_length": measure_path_length(states[:, :2]),
        **_find_minima("min_h", run.h, n_people),
        **_find_minima("min_clearance", run.clearance, n_people),
        **_measure_speed(run),
        "time_yielding": yielding,
        "passing_side": find_passing_side(run),
        "jerk": float((jerk**2).sum(axis=1).mean()) if len(jerk) else 0.0,
        "people": n_people,
        "walls": len(run.scenario.fixed),
        **_count_steps(run),
        "max_slack": float(run.slack[_APPLIED].max(initial=0.0)),
        **{
            name: float(np.quantile(run.solve_time, share))
            for name, share in SOLVE_TIMES.items()
        },
    }


def _find_minima(name: str, values: Array, n_people: int) -> dict[str, float]:
    """The smallest of the `values` of shape (states, obstacles): of all, of people, of what is fixed."""
    return {
        name: _min_or_nan(values),
        f"{name}_people": _min_or_nan(values[:, :n_people]),
        f"{name}_walls": _min_or_nan(values[:, n_people:]),
    }


def _min_or_nan(values: Array) -> float:
    smallest = float(nanmin(values))
    return smallest if np.isfinite(smallest) else np.nan


def _measure_speed(run: Run) -> dict[str, float]:
    """Speed of the robot until the arrival, and the time for which it stands after it has moved."""
    speed = run.speed[run.until_arrival]
    fast = np.flatnonzero(speed >= CRUISE_FRACTION * speed.max())
    counts = run.time[run.until_arrival] >= START_UP_TIME
    counts[fast[-1] + 1 :] = False
    has_moved = np.maximum.accumulate(speed > STOPPED_SPEED)
    stands = has_moved & (speed < STOPPED_SPEED)
    return {
        "min_speed": float(speed[counts].min(initial=speed.max())),
        "mean_speed": float(speed.mean()),
        "max_speed": float(speed.max()),
        "time_stopped": run.settings.dt * int(stands[:-1].sum()),
    }


def _count_steps(run: Run) -> dict[str, int]:
    """The numbers of steps with each property that `compute_metrics` counts."""
    violated = _is_violated(run.h)[1:]
    overlap = _is_violated(run.clearance)[1:]
    safe = run.safe[_APPLIED]
    properties = {
        "violations": violated,
        "overlaps": overlap,
        "infeasible_steps": run.slack[_APPLIED] > TOLERANCE,
        "claimed_safe_steps": safe,
        "flagged_steps": run.flagged[_APPLIED],
        "unflagged_violations": safe & violated,
        "unflagged_overlaps": safe & overlap,
        **{f"steps_{name}": run.status[_APPLIED] == name for name in STATUSES},
    }
    return {name: int(steps.sum()) for name, steps in properties.items()}


def _is_violated(values: Array) -> NDArray[np.bool_]:
    """True at the states, shape (n,), where some of the `values`, shape (n, obstacles), is below 0."""
    return nanmin(values, axis=1) < -TOLERANCE


def measure_path_length(points: Array) -> float:
    """Length of the polygon through `points`, shape (n, 2) [m]."""
    return float(np.hypot(*np.diff(points, axis=0).T).sum())


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
    return _project_on_course(run, run.people[:, person, :2] - run.states[:, :2])


def _project_on_course(run: Run, offset: Array) -> tuple[Array, Array]:
    """The parts of an `offset`, shape (n, 2), along the line from start to goal, and to its left [m]."""
    course = run.scenario.goal - run.scenario.start[:2]
    x, y = course / max(float(np.hypot(*course)), 1e-12)
    return offset @ np.array([x, y]), offset @ np.array([-y, x])


def find_passing_side(run: Run) -> str:
    """Side on which the robot of a `run` passes the person who comes closest: "right", "left" or "none".

    "right" means: the robot has the person to its left, seen along the line from start to goal, when it last
    passes abeam of them.  "none" means: it never passes them, as where a person overtakes the robot.
    """
    if not run.zones:
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
    way = run.states[:, :2] - run.scenario.start[:2]
    beside = np.abs(_project_on_course(run, way)[1])
    rows = np.flatnonzero(beside > deviation)
    if not len(rows):
        return np.nan, np.nan
    first = int(rows[0])
    last = max(first - 1, 0)
    share = 1.0
    if first:
        share = (deviation - beside[last]) / (beside[first] - beside[last])
    values = np.stack([*locate_along_course(run, person), run.h[:, person]])
    x, y, h = values[:, last] + share * (values[:, first] - values[:, last])
    return float(np.hypot(x, y)), float(h)


def classify_outcome(run: Run) -> Outcome:
    """How a `run` ends.  Where a barrier is violated, how the first violation begins.

    Returns
    -------
    "arrived" : the robot is at rest at the goal, and h >= 0 at all states.
    "hit wall" : h of a wall is the first below 0.
    "run into" : h of a person is the first below 0, and the person approached faster than the robot.
    "squeezed" : the same, and another barrier is below `CROWDED_H`.
    "drove in" : h of a person is the first below 0, and the robot approached faster than the person.
    "boxed in" : the robot has stopped, and no free path leads to the goal.
    "deadlock" : the robot has stopped although a free path leads to the goal.
    "out of time" : the robot is still moving at the end.
    """
    violated = np.flatnonzero(_is_violated(run.h))
    if len(violated):
        return _classify_violation(run, int(violated[0]))
    if run.success:
        return "arrived"
    window = round(STOP_WINDOW / run.settings.dt)
    if run.speed[-window:].max() > STOPPED_SPEED:
        return "out of time"
    return "deadlock" if _has_free_path(run) else "boxed in"


def _classify_violation(run: Run, k: int) -> Outcome:
    """Who violates the barrier at state k; a person who was absent before came to the robot."""
    i = int(np.nanargmin(run.h[k]))
    if i >= len(run.zones):
        return "hit wall"
    states = [max(k - 1, 0), k]
    robot = run.states[states, :2]
    person = run.people[states, i, :2]
    to_robot = robot[0] - person[0]
    if -np.diff(robot, axis=0)[0] @ to_robot > np.diff(person, axis=0)[0] @ to_robot:
        return "drove in"
    return "squeezed" if (run.h[k] < CROWDED_H).sum() > 1 else "run into"


def _has_free_path(run: Run) -> bool:
    """True if a path with h >= 0 leads from the robot to the goal, with people at their last positions."""
    zones = list[Zone]()
    for i in np.flatnonzero(run.is_present[-1]):
        x, y, heading = run.people[-1, i, :3].tolist()
        zones.append(Zone(*Zone.place(run.zones[i], (x, y), heading, (0.0, 0.0))))
    ends = np.array([run.states[-1, :2], run.scenario.goal])
    everything = np.vstack(
        [ends, run.people[-1, :, :2], run.scenario.walls.reshape(-1, 2)]
    )
    low = np.nanmin(everything, axis=0) - _MARGIN
    high = np.nanmax(everything, axis=0) + _MARGIN
    axes = [np.arange(low[i], high[i], _CELL) for i in range(2)]
    cells = np.stack(np.meshgrid(*axes, indexing="ij"), axis=1)
    obstacles = Obstacles.of([*zones, *run.scenario.fixed], run.settings)
    # row by row: h of all obstacles at all cells of a large map needs gigabytes
    is_free = [nanmin(obstacles.h(x, y), axis=0) >= 0 for x, y in cells]
    regions = label(is_free, structure=np.ones((3, 3)))[0]
    reached = list[set[int]]()
    for i, j in np.round((ends - low) / _CELL).astype(int):
        around = regions[max(i - 1, 0) : i + 2, max(j - 1, 0) : j + 2]
        reached.append({*around.flat} - {0})
    return bool(reached[0] & reached[1])


def classify_strategy(run: Run) -> Strategy:
    """What the robot does in a `run`: the first of these that holds.

    Returns
    -------
    "h < 0" : it enters a zone, or comes too near to a wall, at some state.
    "infeasible" : some step that is applied has no plan that satisfies the hard problem.
    "deadlock" : it does not come to rest at the goal in time.
    "backs out" : it goes back by `MIN_RETREAT` (see `compute_retreat`).
    "waits" : it yields for `MIN_WAIT` in all (see `find_yielding_steps`).
    "passes on the other side" : it passes a person on the side that is not `MPCSettings.pass_side`.
    "goes ahead" : none of these.

    Notes
    -----
    A controller that does not report its conditions is never "infeasible" and never "waits".
    """
    metrics = compute_metrics(run)
    if _is_violated(run.h).any():
        return "h < 0"
    if metrics["infeasible_steps"]:
        return "infeasible"
    if not run.success:
        return "deadlock"
    if compute_retreat(run) >= MIN_RETREAT:
        return "backs out"
    if metrics["time_yielding"] >= MIN_WAIT:
        return "waits"
    if find_passing_side(run) not in ("none", run.settings.pass_side):
        return "passes on the other side"
    return "goes ahead"


def compute_retreat(run: Run) -> float:
    """Largest distance by which the robot of a `run` goes back along the line from start to goal [m].

    It is measured from the farthest point that the robot has reached so far.
    """
    way = run.states[:, :2] - run.scenario.start[:2]
    along = _project_on_course(run, way)[0]
    return float((np.maximum.accumulate(along) - along).max())
