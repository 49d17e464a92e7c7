"""What is done where a solver has no answer: each step climbs down a ladder until a fallback holds.

    warm      the problem, from the last plan, changed as it changed in the step before
    cold      the problem, from full braking
    kept      the last plan, shifted, if it still satisfies the problem        terminal condition only
    relaxed   the problem with penalised slack
    kept      the last plan, shifted, if it is a way to a safe end             terminal condition only
    braking   to rest as soon as the bounds allow

Where the time of a step is up, what is left of the ladder is skipped; a relaxed plan that was cut short is
taken if it violates no more than braking would. For the reason of "kept" see `szlib.control.mpc`.
"""

from __future__ import annotations

import numpy as np

from ...checks import Array
from ..problem import HARD_SHARE, TOLERANCE, Numbers, ProblemSolver
from ..settings import MPCSettings
from ..step import Fallback


def solve_with_fallbacks(
    solver: ProblemSolver, last_plan: Array, change: Array, parameters: Array
) -> tuple[Fallback, Numbers, bool]:
    """The first fallback that holds, its plan in numbers, and whether the time was up.

    Plans are inputs, shape (2N,) [m/s2], `change` is that of the last one; `parameters` as in `Problem`.
    A plan changes little from step to step, seen from the robot: which of its inputs a barrier holds depends
    on how far ahead they are. So its trend is a better guess than the plan shifted, by up to a quarter of
    the iterations.
    """
    s = solver.settings
    ends, late, start = s.terminal != "none", False, None
    fallback: Fallback
    for fallback in ("warm", "cold"):
        if fallback == "cold" and solver.budget.spent(HARD_SHARE / 2):
            late = True
            break
        if fallback == "warm":
            guess = np.minimum(np.maximum(last_plan + change, -s.a_max), s.a_max)
        else:
            guess = _brake(s, parameters[2:4])
        plan, converged = solver.hard(guess, parameters)
        if converged and plan.slack <= TOLERANCE:
            return fallback, plan, late
        late |= solver.late
        start = plan.inputs if solver.late and np.isfinite(plan.inputs).all() else start
    shifted = np.zeros(last_plan.size)
    shifted[:-2] = last_plan[2:]
    kept = solver.evaluate(shifted, parameters)
    if ends and kept.slack <= TOLERANCE:
        return "kept", kept, late
    safe_end = ends and _safe_to_its_end(kept, parameters)
    plan, converged = solver.relaxed(shifted if start is None else start, parameters)
    late |= solver.late
    braking = solver.evaluate(_brake(s, parameters[2:4]), parameters)
    if (converged or solver.late) and np.isfinite(plan.inputs).all():
        better = converged or plan.slack <= braking.slack
        if better and (not safe_end or _safe_to_its_end(plan, parameters)):
            fallback = "warm" if converged and plan.slack <= TOLERANCE else "relaxed"
            return fallback, plan, late
    if safe_end:
        return "kept", kept, late
    return "braking", braking, late


def _brake(s: MPCSettings, velocity: Array) -> Array:
    """The inputs that bring the robot to rest soonest along its path, shape (2N,) [m/s2]."""
    vx, vy = velocity.tolist()
    plan: list[float] = []
    for _ in range(s.N):
        time = max(s.dt, max(abs(vx), abs(vy)) / s.a_max)
        plan += (-vx / time, -vy / time)
        vx, vy = vx - s.dt * vx / time, vy - s.dt * vy / time
    return np.array(plan)


def _safe_to_its_end(plan: Numbers, parameters: Array) -> bool:
    """True if the plan ends as it should, with h >= 0 at every state up to the one from which on it does."""
    off = np.abs(plan.states[:, 2:] - parameters[6:8]).max(axis=1) > TOLERANCE
    last = int(off.nonzero()[0].max(initial=-1)) + 1
    return last < len(off) and bool((plan.h[:, : last + 1] >= -TOLERANCE).all())
