"""A run beside the person whom the robot replaced: the same numbers of both, from the same log."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from ..control.barriers import ellipse_distance
from ..zones.ellipses import Ellipse

if TYPE_CHECKING:
    from .log import SimulationLog

REACHED = 0.5
"""Who is within this distance has reached the goal [m] (assumed): people pass there, robots come to rest."""


def compute_replay_metrics(log: SimulationLog, zone: Ellipse | None = None) -> dict[str, float]:
    """How the robot came to its goal, and how often it was where people keep others out.

    reached : 1 if it came within `REACHED` of the goal, else 0.
    time_to_goal : until then [s]; NaN if it never did.
    path_efficiency : the straight way there over the way gone; NaN if it never did.
    intrusions : how often its centre came into somebody's zone until then, of all people together.
    time_intruding : for how long it was in anybody's [s].
    nearest : smallest distance from its centre to a person's [m]; NaN if there was nobody.

    `zone` is the fitted one, in each person's own frame; None: what was kept for each.  It was learned from
    distances between centres, so that a robot and the person whom it replaces are measured alike.
    """
    away = np.hypot(*(log.states[:, :2] - log.scenario.goal).T)
    there = np.flatnonzero(away <= REACHED)
    way = slice(None, int(there[0]) + 1 if len(there) else None)
    path = log.states[way, :2]
    length = float(np.hypot(*np.diff(path, axis=0).T).sum())
    zones = log.zones if zone is None else (zone,) * len(log.zones)
    gaps = [log.to_person(i, partial(ellipse_distance, ellipse=each))[way] for i, each in enumerate(zones)]
    inside = np.reshape(gaps, (len(zones), len(path))).T < 0  # who is away, NaN, is not
    entered = inside & ~np.vstack([np.zeros((1, len(zones)), bool), inside[:-1]])
    distance = np.hypot(log.relative[way, :, 0], log.relative[way, :, 1])
    came, straight = len(there) > 0, float(np.hypot(*(path[-1] - path[0])))
    return {
        "reached": float(came),
        "time_to_goal": float(log.time[there[0]]) if came else np.nan,
        "path_efficiency": straight / length if came and length > 0 else np.nan,
        "intrusions": float(entered.sum()),
        "time_intruding": log.settings.dt * float(inside.any(axis=1).sum()),
        "nearest": float(np.nanmin(distance)) if np.isfinite(distance).any() else np.nan,
    }
