"""How social a run was: metrics after HuNavSim, from the log of any controller.

Source: N. Perez-Higueras et al., "HuNavSim: a ROS 2 human navigation simulator for benchmarking human-aware
robot navigation", IEEE Robotics and Automation Letters 8(11), 2023, and its `hunav_evaluator`; distances of
E. T. Hall, "The Hidden Dimension", 1966; path efficiency as in N. Tsoi et al., "SEAN 2.0", RA-L 7(4), 2022.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..checks import Array
from ..control.distances import euclidean_to_segment
from ..control.person import BODY_RADIUS
from .outcomes import nanmin
from .scenario import STOPPED_SPEED

if TYPE_CHECKING:
    from .log import SimulationLog

HALL = {"intimate": (0.0, 0.45), "personal": (0.45, 1.2), "social": (1.2, 3.6)}
"""From where to where each of Hall's distances reaches [m]."""
NOT_MOVING = 0.001
"""Below this speed HuNavSim's robot does not move [m/s]."""
_ON_THE_WAY = 21
"""Points of the straight way to the goal at which it is held against walls."""


def compute_social_metrics(log: SimulationLog) -> dict[str, float]:
    """What people would notice, until the arrival; time to the goal and path length are in `metrics`.

    heading_changes : sum of the angles between successive directions of motion [rad], while the robot is
        faster than `STOPPED_SPEED`: one that drives in any direction has no heading of its own.
    closest_person : mean over time of the gap from the robot's disc to the nearest body [m].
    intimate, personal, social : share of the time in which the nearest person, their centre, is that far
        from the robot's disc (`HALL`).
    robot_on_person, person_on_robot : how often the disc and a body came to overlap, by who closed in faster
        then. (HuNavSim counts the steps of an overlap, and asks who faces whom more.)
    time_not_moving : slower than `NOT_MOVING` [s].
    path_efficiency : the straight way from start to goal over the way driven; NaN without success, or where a
        wall leaves no straight way.

    Where nobody ever is, distances are NaN, and shares and numbers are 0.
    """
    way = slice(None if log.arrived is None else log.arrived + 1)
    states, gap = log.states[way], log.clearance[way, : len(log.zones)]
    nearest = nanmin(gap, axis=1)
    to_person = np.maximum(nearest + BODY_RADIUS, 0.0)
    met = np.isfinite(nearest)
    robot, person = _contacts(log, way, gap)
    shares = {
        name: float(((to_person >= low) & (to_person < high)).mean()) for name, (low, high) in HALL.items()
    }
    return {
        "heading_changes": heading_changes(states),
        "closest_person": float(nearest[met].mean()) if met.any() else np.nan,
        **shares,
        "robot_on_person": robot,
        "person_on_robot": person,
        "time_not_moving": log.settings.dt * int((log.speed[way] < NOT_MOVING).sum()),
        "path_efficiency": path_efficiency(log, states),
    }


def heading_changes(states: Array) -> float:
    """Sum of the angles between successive directions of motion [rad], of states (n, 4)."""
    moving = states[np.hypot(states[:, 2], states[:, 3]) > STOPPED_SPEED]
    turns = np.diff(np.arctan2(moving[:, 3], moving[:, 2]))
    return float(np.abs((turns + np.pi) % (2 * np.pi) - np.pi).sum())


def path_efficiency(log: SimulationLog, states: Array) -> float:
    """The straight way over the way driven; see `social`."""
    start, goal = log.scenario.start[:2], log.scenario.goal
    straight = start + np.linspace(0, 1, _ON_THE_WAY)[:, None] * (goal - start)
    radius = log.settings.r_robot
    if not log.success or any(euclidean_to_segment(straight, *w).min() < radius for w in log.scenario.walls):
        return np.nan
    driven = float(np.hypot(*np.diff(states[:, :2], axis=0).T).sum())
    left = float(np.hypot(*(goal - states[-1, :2])))
    return float(np.hypot(*(goal - start))) / (driven + left) if driven else np.nan


def _contacts(log: SimulationLog, way: slice, gap: Array) -> tuple[int, int]:
    """How often the robot ran into somebody, and somebody into the robot."""
    touching = gap < 0
    begins = touching & ~np.vstack([np.zeros((1, gap.shape[1]), bool), touching[:-1]])
    apart = log.states[way, None, :2] - log.people[way, :, :2]
    robot = -(log.states[way, None, 2:] * apart).sum(axis=2)
    person = (log.people[way, :, 3:] * apart).sum(axis=2)
    return int((begins & (robot >= person)).sum()), int((begins & (robot < person)).sum())
