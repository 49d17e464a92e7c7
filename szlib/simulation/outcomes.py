"""The outcome of a run: how it ends, and who causes the first violation of a barrier."""

from __future__ import annotations

from typing import Literal

import numpy as np
from scipy.ndimage import label

from ..control.obstacles import Obstacles, Zone
from ..control.settings import TOLERANCE
from .run import Run, nanmin
from .scenario import STOPPED_SPEED

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
    violated = np.flatnonzero(nanmin(run.h, axis=1) < -TOLERANCE)
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
    before = max(k - 1, 0)
    direction = run.states[before, :2] - run.people[before, i, :2]
    direction = direction / np.hypot(*direction)
    approach_of_person = (run.people[k, i, :2] - run.people[before, i, :2]) @ direction
    approach_of_robot = -(run.states[k, :2] - run.states[before, :2]) @ direction
    if approach_of_robot > approach_of_person:
        return "drove in"
    return "squeezed" if (run.h[k] < CROWDED_H).sum() > 1 else "run into"


def _has_free_path(run: Run) -> bool:
    """True if a path with h >= 0 leads from the robot to the goal, with people at their last positions."""
    ends = np.array([run.states[-1, :2], run.scenario.goal])
    people = [
        (zone, p)
        for zone, p in zip(run.zones, run.people[-1], strict=True)
        if p[0] == p[0]
    ]
    bodies = np.reshape([p[:2] for _, p in people], (-1, 2))
    everything = np.vstack([ends, bodies, run.scenario.walls.reshape(-1, 2)])
    low, high = everything.min(axis=0) - _MARGIN, everything.max(axis=0) + _MARGIN
    axes = [np.arange(low[i], high[i], _CELL) for i in range(2)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    s = run.settings
    x, y = grid[..., 0], grid[..., 1]
    zones = Obstacles.of(
        (
            Zone(*Zone.place(zone, (px, py), heading, (0.0, 0.0)))
            for zone, (px, py, heading, *_) in people
        ),
        s,
    )
    h = [*zones.h(x, y), *run.fixed.h(x, y)]
    is_free = nanmin(np.array([np.ones(grid.shape[:2]), *h]), axis=0) >= 0
    regions = label(is_free, structure=np.ones((3, 3)))[0]
    cells = np.round((ends - low) / _CELL).astype(int)
    robot, goal = (
        regions[max(i - 1, 0) : i + 2, max(j - 1, 0) : j + 2] for i, j in cells
    )
    return bool(set(np.unique(robot)) & set(np.unique(goal)) - {0})
