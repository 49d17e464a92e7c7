"""How a run ended; where a barrier was broken, by whom."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np
from scipy.ndimage import label

from ..checks import Array
from ..control.barriers import barrier, ellipse_distance, segment_distance
from ..control.distances import wall_margin
from ..control.problem import TOLERANCE
from .scenario import STOPPED_SPEED

if TYPE_CHECKING:
    from .log import SimulationLog

Outcome = Literal[
    "arrived", "hit wall", "run into", "squeezed", "drove in", "boxed in", "deadlock", "out of time"
]
"""How a run ended; see `outcome`."""
CROWDED = 0.2
"""Two barriers below this h at once leave a robot no way out [m] (assumed)."""
STOP_WINDOW = 3.0
"""A robot that stood for so long at the end has stopped for good [s] (assumed)."""
_CELL = 0.1
"""Grid on which a way to the goal is looked for [m]."""
_AROUND = 2.5
"""How far around everything it reaches: enough for a zone and the robot beside it [m]."""


def nanmin(values: Array, axis: int | tuple[int, ...] | None = None) -> Array:
    """The smallest value along an axis, NaN left out; inf where there is none."""
    return np.asarray(np.fmin.reduce(values, axis=axis, initial=np.inf))


def classify_outcome(log: SimulationLog) -> Outcome:
    """How a run ended; where a barrier was broken, how that began.

    "arrived", or where h fell below 0 first: "hit wall"; "run into", by a person who came nearer while
    the robot did so less; "squeezed", the same with another barrier close by (`CROWDED`); "drove in",
    the robot did it. Where it never did: "boxed in", stopped where no way leads to the goal;
    "deadlock", stopped where one does; "out of time", still on its way.
    """
    broken = np.flatnonzero(nanmin(log.h, axis=1) < -TOLERANCE)
    if len(broken):
        return _breach(log, int(broken[0]))
    if log.success:
        return "arrived"
    last = round(STOP_WINDOW / log.settings.dt)
    if log.speed[-last:].max() > STOPPED_SPEED:
        return "out of time"
    return "deadlock" if path_exists(log) else "boxed in"


def _breach(log: SimulationLog, k: int) -> Outcome:
    """Who broke the barrier at state k; who was not there before it came to the robot."""
    i = int(np.nanargmin(log.h[k]))
    if i >= len(log.zones):
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
    people = [(zone, who) for zone, who in zip(log.zones, log.people[-1], strict=True) if who[0] == who[0]]
    bodies = np.reshape([who[:2] for _, who in people], (-1, 2))
    everything = np.vstack([ends, bodies, log.scenario.walls.reshape(-1, 2)])
    low, high = everything.min(axis=0) - _AROUND, everything.max(axis=0) + _AROUND
    axes = [np.arange(low[i], high[i], _CELL) for i in range(2)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    s, free = log.settings, np.ones(grid.shape[:2], bool)
    for zone, (x, y, heading, *_) in people:
        free &= barrier(ellipse_distance(grid, zone.placed((x, y), heading)), s.r_robot, s.eps) >= 0
    for wall in log.scenario.walls:
        free &= barrier(segment_distance(grid, *wall), s.r_robot, wall_margin(wall, s)) >= 0
    here, there = np.round((ends - low) / _CELL).astype(int)
    regions = label(free, structure=np.ones((3, 3)))[0]
    around = [regions[max(i - 1, 0) : i + 2, max(j - 1, 0) : j + 2] for i, j in (here, there)]
    return bool(set(np.unique(around[0])) & set(np.unique(around[1])) - {0})
