"""Social metrics of a run: what people notice of a robot, and a robot compared with a person.

Sources: N. Perez-Higueras et al., "HuNavSim: a ROS 2 human navigation simulator for benchmarking human-aware
robot navigation", IEEE Robotics and Automation Letters 8(11), 2023, and its `hunav_evaluator`; distances of
E. T. Hall, "The Hidden Dimension", 1966; path efficiency as in N. Tsoi et al., "SEAN 2.0", RA-L 7(4), 2022.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..control.obstacles import ellipse_distance
from ..core.checks import Array
from ..encounters.geometry import wrap_angle
from ..zones.ellipses import BODY_RADIUS, Ellipse
from .metrics import measure_path_length
from .run import Run, nanmin
from .scenario import STOPPED_SPEED

# Range of each of Hall's distances [m].
HALL_DISTANCES = {
    "intimate": (0.0, 0.45),
    "personal": (0.45, 1.2),
    "social": (1.2, 3.6),
}
NOT_MOVING = 0.001  # below this speed HuNavSim's robot does not move [m/s]
# Within this distance a person or a robot has reached the goal [m] (assumed): people walk on there.
REACHED = 0.5
_N_POINTS = 21  # points of the straight path to the goal that are checked against walls


def compute_social_metrics(run: Run) -> dict[str, float]:
    """What people notice of the robot in a `run`, until the arrival.

    Returns
    -------
    heading_changes : sum of the angles between successive directions of motion [rad], while the robot is
        faster than `STOPPED_SPEED`. (A robot that drives in any direction has no heading of its own.)
    closest_person : mean over time of the gap from the robot's disc to the nearest body [m].
    intimate, personal, social : fraction of the time in which the centre of the nearest person is at that
        distance from the robot's disc (`HALL_DISTANCES`).
    robot_on_person, person_on_robot : number of overlaps of the disc and a body, by who approaches faster
        when the overlap begins. (HuNavSim counts the steps of an overlap and compares headings.)
    time_not_moving : time below `NOT_MOVING` [s].
    path_efficiency : length of the straight path from start to goal over the length of the path driven; NaN
        without success, or where a wall crosses the straight path.

    Without people, distances are NaN, and fractions and numbers are 0.
    """
    way = run.until_arrival
    states, gap = run.states[way], run.clearance[way, : len(run.zones)]
    nearest = nanmin(gap, axis=1)
    to_person = np.maximum(nearest + BODY_RADIUS, 0.0)
    is_near_person = np.isfinite(nearest)
    robot_on_person, person_on_robot = _count_collisions(run, way, gap)
    fractions = {
        name: float(((to_person >= low) & (to_person < high)).mean())
        for name, (low, high) in HALL_DISTANCES.items()
    }
    return {
        "heading_changes": _sum_heading_changes(states),
        "closest_person": float(nearest[is_near_person].mean())
        if is_near_person.any()
        else np.nan,
        **fractions,
        "robot_on_person": robot_on_person,
        "person_on_robot": person_on_robot,
        "time_not_moving": run.settings.dt * int((run.speed[way] < NOT_MOVING).sum()),
        "path_efficiency": _compute_path_efficiency(run, states),
    }


def _sum_heading_changes(states: Array) -> float:
    moving = states[np.hypot(states[:, 2], states[:, 3]) > STOPPED_SPEED]
    turns = np.diff(np.arctan2(moving[:, 3], moving[:, 2]))
    return float(np.abs(wrap_angle(turns)).sum())


def _compute_path_efficiency(run: Run, states: Array) -> float:
    start, goal = run.scenario.start[:2], run.scenario.goal
    straight = start + np.linspace(0, 1, _N_POINTS)[:, None] * (goal - start)
    if not run.success or (run.fixed.gaps(*straight.T) < 0).any():
        return np.nan
    driven, rest = (
        measure_path_length(states[:, :2]),
        float(np.hypot(*(goal - states[-1, :2]))),
    )
    return float(np.hypot(*(goal - start))) / (driven + rest) if driven else np.nan


def _find_onsets(states: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """True where a column of `states` becomes True."""
    return np.diff(states, axis=0, prepend=False) & states


def _count_collisions(run: Run, way: slice, gap: Array) -> tuple[int, int]:
    """Number of times the robot runs into a person, and a person into the robot."""
    begins = _find_onsets(gap < 0)
    offset = run.states[way, None, :2] - run.people[way, :, :2]
    robot = -(run.states[way, None, 2:] * offset).sum(axis=2)
    person = (run.people[way, :, 3:] * offset).sum(axis=2)
    return int((begins & (robot >= person)).sum()), int(
        (begins & (robot < person)).sum()
    )


def compute_replay_metrics(run: Run, zone: Ellipse | None = None) -> dict[str, float]:
    """Compare a robot with the person whom it replaces: the same numbers for the runs of both.

    Parameters
    ----------
    run : the run of the robot, or of the person (`szlib.simulation.ReplacedWalker`).
    zone : the fitted zone, in each person's own frame; None: the zones of the run. It is learned from
        distances between centres, so that a robot and a person are measured alike.

    Returns
    -------
    reached : 1 if the robot comes within `REACHED` of the goal, else 0.
    time_to_goal : time until then [s]; NaN if it does not.
    path_efficiency : length of the straight path there over that of the path driven; NaN if it does not.
    intrusions : number of times until then that the robot's centre enters a zone, over all people.
    time_intruding : time in any zone [s].
    nearest : smallest distance from the robot's centre to a person's [m]; NaN without people.
    """
    rows = np.flatnonzero(
        np.hypot(*(run.states[:, :2] - run.scenario.goal).T) <= REACHED
    )
    way = slice(None, int(rows[0]) + 1 if len(rows) else None)
    path, n_people = run.states[way, :2], len(run.zones)
    length, straight = measure_path_length(path), float(np.hypot(*(path[-1] - path[0])))
    zones = run.zones if zone is None else (zone,) * n_people
    # NaN, of absent people, is not inside
    inside = run.distances_to_zones(zones, ellipse_distance)[way] < 0
    distance = np.hypot(run.relative[way, :, 0], run.relative[way, :, 1])
    reached = len(rows) > 0
    return {
        "reached": float(reached),
        "time_to_goal": float(run.time[rows[0]]) if reached else np.nan,
        "path_efficiency": straight / length if reached and length > 0 else np.nan,
        "intrusions": float(_find_onsets(inside).sum()),
        "time_intruding": run.settings.dt * float(inside.any(axis=1).sum()),
        "nearest": float(np.nanmin(distance))
        if np.isfinite(distance).any()
        else np.nan,
    }
