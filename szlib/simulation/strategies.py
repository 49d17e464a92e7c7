"""The strategy of a robot in a run: it goes ahead, waits, backs out, or does not arrive."""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np

from ..control.settings import TOLERANCE
from .metrics import compute_metrics, find_passing_side
from .run import Run, nanmin

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
    if (nanmin(run.h, axis=1) < -TOLERANCE).any():
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
    course = run.scenario.goal - run.scenario.start[:2]
    along = (
        (run.states[:, :2] - run.scenario.start[:2])
        @ course
        / max(float(np.hypot(*course)), 1e-12)
    )
    return float((np.maximum.accumulate(along) - along).max())
