"""The ways to a control: each is tried until one gives a plan.

    warm      the problem, from the last plan, changed as it changed in the step before
    cold      the problem, from full braking
    kept      the last plan, shifted, if it still satisfies the problem        terminal condition only
    relaxed   the problem with penalised slack
    kept      the last plan, shifted, if it reaches a safe end                 terminal condition only
    braking   to rest as soon as the bounds allow

When the time of a step is up, the remaining solvers are skipped. A relaxed plan that was cut short is used if
it violates no more than braking does. For the reason of "kept" see `szlib.control.mpc`.
"""

from __future__ import annotations

import numpy as np

from ...checks import Array
from ..problem import HARD_SHARE, PlanEvaluation, ProblemSolver
from ..settings import TOLERANCE, MPCSettings
from ..step import Fallback


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
    attempts = _Attempts(solver, parameters)
    if plan := attempts.solve_hard(_continue_trend(solver.settings, last_plan, change)):
        return "warm", plan, attempts.timed_out
    braking = plan_braking(solver.settings, parameters[2:4])
    if plan := attempts.solve_hard_if_time(braking):
        return "cold", plan, attempts.timed_out
    same_times = last_plan if solver.settings.grid else np.append(last_plan[2:], (0.0, 0.0))
    shifted = solver.evaluate(same_times, parameters)
    has_end = solver.settings.terminal != "none"
    if has_end and shifted.slack <= TOLERANCE:
        return "kept", shifted, attempts.timed_out
    shifted_is_safe = has_end and _reaches_safe_end(shifted, parameters)
    full_braking = solver.evaluate(braking, parameters)
    relaxed, converged = attempts.solve_relaxed(shifted.inputs, full_braking.slack)
    if relaxed and (not shifted_is_safe or _reaches_safe_end(relaxed, parameters)):
        is_satisfied = converged and relaxed.slack <= TOLERANCE
        return "warm" if is_satisfied else "relaxed", relaxed, attempts.timed_out
    if shifted_is_safe:
        return "kept", shifted, attempts.timed_out
    return "braking", full_braking, attempts.timed_out


class _Attempts:
    """The calls of the solver within one step, and what one call leaves for the next."""

    def __init__(self, solver: ProblemSolver, parameters: Array) -> None:
        self.solver, self.parameters = solver, parameters
        self.timed_out = False
        self._unfinished: Array | None = None

    def solve_hard(self, guess: Array) -> PlanEvaluation | None:
        """The plan that satisfies the problem, found from a `guess`; None if there is none."""
        plan, converged = self.solver.hard(guess, self.parameters)
        if converged and plan.slack <= TOLERANCE:
            return plan
        self.timed_out |= self.solver.timed_out
        if self.solver.timed_out and np.isfinite(plan.inputs).all():
            self._unfinished = plan.inputs
        return None

    def solve_hard_if_time(self, guess: Array) -> PlanEvaluation | None:
        """As `solve_hard` from a `guess`; None if too little time is left."""
        if self.solver.budget.is_spent(HARD_SHARE / 2):
            self.timed_out = True
            return None
        return self.solve_hard(guess)

    def solve_relaxed(self, guess: Array, slack_limit: float) -> tuple[PlanEvaluation | None, bool]:
        """The relaxed plan from a `guess`, None if it is unusable; and True if it converged.

        A plan that was cut short is usable if it violates no row by more than `slack_limit`.
        """
        start = guess if self._unfinished is None else self._unfinished
        plan, converged = self.solver.relaxed(start, self.parameters)
        self.timed_out |= self.solver.timed_out
        is_usable = converged or (self.solver.timed_out and plan.slack <= slack_limit)
        return (plan if is_usable and np.isfinite(plan.inputs).all() else None), converged


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
