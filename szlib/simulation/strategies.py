"""The manner of a run: whether the robot went ahead, waited, backed out, or got no further."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, get_args

import numpy as np

from ..control.problem import TOLERANCE
from .metrics import compute_metrics, find_passing_side
from .outcomes import nanmin

if TYPE_CHECKING:
    from .log import SimulationLog

Strategy = Literal[
    "goes ahead", "waits", "backs out", "passes on the other side", "deadlock", "infeasible", "h < 0"
]
"""What a robot did; see `manner`."""
STRATEGIES: tuple[Strategy, ...] = get_args(Strategy)
MIN_WAIT = 1.0
"""Yielding for as long as this is waiting [s] (assumed)."""
MIN_RETREAT = 0.5
"""Going back as far as this, the robot's radius, is making room [m] (assumed)."""


def classify_strategy(log: SimulationLog) -> Strategy:
    """What the robot did: the first of these that holds.

    "h < 0"       it came into a zone, or too near to a wall, at some state;
    "infeasible"  some step that was applied had no plan that satisfies the hard problem;
    "deadlock"    it did not come to rest at the goal in time;
    "backs out"   it went back by `MIN_RETREAT` from where it had come farthest towards the goal;
    "waits"       it yielded for `MIN_WAIT` in all (`metrics`, time_yielding);
    "passes on the other side"  it met somebody on the side that is not `pass_side`;
    "goes ahead"  none of these.

    A controller that does not tell its conditions is never infeasible, and never waits.
    """
    found = compute_metrics(log)
    if (nanmin(log.h, axis=1) < -TOLERANCE).any():
        return "h < 0"
    if found["infeasible_steps"]:
        return "infeasible"
    if not log.success:
        return "deadlock"
    if compute_retreat(log) >= MIN_RETREAT:
        return "backs out"
    if found["time_yielding"] >= MIN_WAIT:
        return "waits"
    if find_passing_side(log) not in ("none", log.settings.pass_side):
        return "passes on the other side"
    return "goes ahead"


def compute_retreat(log: SimulationLog) -> float:
    """How far the robot went back, along the line from start to goal, from its farthest point by then [m]."""
    course = log.scenario.goal - log.scenario.start[:2]
    along = (log.states[:, :2] - log.scenario.start[:2]) @ course / max(float(np.hypot(*course)), 1e-12)
    return float((np.maximum.accumulate(along) - along).max())
