"""The ways to a control: each is tried until one gives a plan.

    warm      the problem, from the last plan, changed as it changed in the step before
    cold      the problem, from full braking
    kept      the last plan, shifted, if it still satisfies the problem        terminal condition only
    relaxed   the problem with penalised slack, from the last plan (with a grid, or from braking)
    kept      the last plan, shifted, if it reaches a safe end                 terminal condition only
    braking   to rest as soon as the bounds allow

With a grid the relaxed problem begins at braking where that violates less than the last plan, which may lead
through a wall.

When the time of a step is up, the remaining solvers are skipped. A relaxed plan that was cut short is used if
it violates no more than braking does. For the reason of "kept" see `szlib.control.mpc`.
"""

from __future__ import annotations

import numpy as np

from ...checks import Array
from ..problem import HARD_SHARE, PlanEvaluation, ProblemSolver
from ..settings import TOLERANCE, MPCSettings
from ..step import FALLBACKS, Fallback


def solve_with_fallbacks(
    solver: ProblemSolver, last_plan: Array, change: Array, parameters: Array
) -> tuple[Fallback, PlanEvaluation, bool]:
    """Find a plan: the fallback that gave it, the plan, and True if time was up.

    Parameters
    ----------
    solver : of the problem of this size.
    last_plan : inputs of the last plan, shape (2N,) [m/s2].
    change : by which the last plan differed from the one before, shape (2N,) [m/s2].
    parameters : of the problem: see `Problem`.
    """
    s, timed_out, unfinished = solver.settings, False, None
    guess = _continue_trend(s, last_plan, change)
    for fallback in FALLBACKS[:2]:  # warm and cold
        plan, converged = solver.hard(guess, parameters)
        if converged and plan.slack <= TOLERANCE:
            return fallback, plan, timed_out
        timed_out |= solver.timed_out
        if solver.timed_out and np.isfinite(plan.inputs).all():
            unfinished = plan.inputs
        guess = braking = plan_braking(s, parameters[2:4])
        if fallback == "warm" and solver.budget.is_spent(HARD_SHARE / 2):
            timed_out = True
            break
    shifted = solver.evaluate(
        last_plan if s.grid else np.append(last_plan[2:], (0.0, 0.0)), parameters
    )
    has_end = s.terminal != "none"
    if has_end and shifted.slack <= TOLERANCE:
        return "kept", shifted, timed_out
    shifted_is_safe = has_end and _reaches_safe_end(shifted, parameters)
    full_braking = solver.evaluate(braking, parameters)
    start = shifted if unfinished is None else solver.evaluate(unfinished, parameters)
    if s.grid and full_braking.slack < start.slack:
        start = full_braking  # a plan with a long horizon may lead through a wall, and stay there
    relaxed, converged = solver.relaxed(start.inputs, parameters)
    timed_out |= solver.timed_out
    # A plan that was cut short is usable if it violates no row by more than braking does.
    is_usable = converged or (solver.timed_out and relaxed.slack <= full_braking.slack)
    is_usable &= bool(np.isfinite(relaxed.inputs).all())
    if is_usable and (not shifted_is_safe or _reaches_safe_end(relaxed, parameters)):
        return (
            "warm" if converged and relaxed.slack <= TOLERANCE else "relaxed",
            relaxed,
            timed_out,
        )
    return (
        ("kept", shifted, timed_out)
        if shifted_is_safe
        else ("braking", full_braking, timed_out)
    )


def _continue_trend(s: MPCSettings, last_plan: Array, change: Array) -> Array:
    """The last plan, changed as it changed before: a better guess than the plan shifted.

    A plan changes little from step to step, seen from the robot: a barrier holds inputs at certain steps
    ahead. This saves up to a quarter of the iterations. The guess matters for speed only: with the opposite
    sign the states of the four scenarios are the same to 1e-6.
    """
    return np.minimum(np.maximum(last_plan + change, -s.a_max), s.a_max)


def plan_braking(s: MPCSettings, velocity: Array) -> Array:
    """Inputs that bring the robot from `velocity` to rest soonest along its path, within `s`, shape (2N,)."""
    vx, vy = velocity.tolist()
    plan: list[float] = []
    for dt in (s.dt * length for length in s.step_lengths):
        time = max(dt, max(abs(vx), abs(vy)) / s.a_max)
        plan += (-vx / time, -vy / time)
        vx, vy = vx - dt * vx / time, vy - dt * vy / time
    return np.array(plan)


def _reaches_safe_end(plan: PlanEvaluation, parameters: Array) -> bool:
    """True if the plan ends at its terminal velocity, with h >= 0 at every state until it has reached it."""
    is_off = np.abs(plan.states[:, 2:] - parameters[6:8]).max(axis=1) > TOLERANCE
    last = int(is_off.nonzero()[0].max(initial=-1)) + 1
    return last < len(is_off) and bool((plan.h[:, : last + 1] >= -TOLERANCE).all())
