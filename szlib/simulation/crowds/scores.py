"""A run beside the person whom the robot replaced: the same numbers of both, from the same log."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...control.barriers import ellipse_formula
from ...zones.ellipses import Ellipse

if TYPE_CHECKING:
    from ..log import SimulationLog

REACHED = 0.5
"""Who is within this distance has reached the goal [m] (assumed): people pass there, robots come to rest."""


def score(log: SimulationLog, zone: Ellipse) -> dict[str, float]:
    """How the robot came to its goal, and how often it was where people keep others out.

    reached : 1 if it came within `REACHED` of the goal, else 0.
    time_to_goal : until then [s]; NaN if it never did.
    path_efficiency : the straight way there over the way gone; NaN if it never did.
    intrusions : how often its centre came into somebody's zone until then, of all people together.
    time_intruding : for how long it was in anybody's [s].
    nearest : smallest distance from its centre to a person's [m]; NaN if there was nobody.

    `zone` is the fitted one, in each person's own frame, whatever the controller kept.  It was learned from
    distances between centres, so that a robot and the person whom it replaces are measured alike.
    """
    away = np.hypot(*(log.states[:, :2] - log.scenario.goal).T)
    there = np.flatnonzero(away <= REACHED)
    way = slice(None, int(there[0]) + 1 if len(there) else None)
    path, relative = log.states[way, :2], log.relative[way]
    length = float(np.hypot(*np.diff(path, axis=0).T).sum())
    (xa, ya), (xb, yb) = zone.foci.tolist()
    distances = ellipse_formula(relative[..., 0], relative[..., 1], xa, ya, xb, yb, zone.semi_axes[0])
    inside = distances < 0  # NaN, where somebody is not there, is not
    entered = inside & ~np.vstack([np.zeros((1, inside.shape[1]), bool), inside[:-1]])
    distance = np.hypot(relative[..., 0], relative[..., 1])
    return {
        "reached": float(len(there) > 0),
        "time_to_goal": float(log.time[there[0]]) if len(there) else np.nan,
        "path_efficiency": float(np.hypot(*(path[-1] - path[0]))) / length
        if len(there) and length
        else np.nan,
        "intrusions": float(entered.sum()),
        "time_intruding": log.settings.dt * float(inside.any(axis=1).sum()),
        "nearest": float(np.nanmin(distance)) if np.isfinite(distance).any() else np.nan,
    }
