"""A condensed sequential quadratic program on the DAQP active-set solver, for the problem of `problem`.

The unknowns are the 2 N inputs. Each iteration solves

    min over d   1/2 d' H d + grad(scaled cost)' d + prices' s
    subject to   -a_max - u <= d <= a_max - u,   rows + J d + s >= 0,  s >= 0,   terminal + T d = 0

where the scaled cost is that for each metre to the target (at least 1 m), so that the weight stays the same,
with the exact Hessian H of the Lagrangian where it is positive definite; else without the curvature
of the barriers (Gauss-Newton). Rows are soft, by an exact penalty, so that every program has a
solution. A step has to lower cost + price * violation, with a price just above the largest multiplier so
far. Near the solution a full step may miss that and still be good, so up to `RISES` in a row are taken all
the same (a watchdog: R. Chamberlain et al., Math. Programming Study 16, 1982). If the merit is still not
lower, the solver returns to where they began, corrects the step to second order, and then shortens it. If no
row has a multiplier, the program's cost is exact, and the first solution that satisfies the true rows is the
answer. If no bound is active either, the answer is a linear feedback of the error, K (x - g), without any
program.
"""

from __future__ import annotations

from math import inf, isnan
from typing import Any, Literal

import daqp
import numpy as np

from ...checks import Array
from ..problem import (
    CASADI_LOCK,
    HARD_SHARE,
    BufferedFunction,
    PlanEvaluation,
    ProblemSolver,
)
from ..settings import MPCSettings
from .sqp_functions import QuadraticProgram, SqpFunctions, build_sqp_functions

Outcome = Literal["converged", "stalled", "timed out", "failed"]
# The SQP has converged if its last step moves no input by more than the first number [m/s2], and the
# violations of the rows sum up to no more than the second. With the exact Hessian the error is of the order
# of the square of the step. That of an input is up to 2 / dt^2 times as large as the violations: 2e-6 m/s2.
CONVERGED = {True: (1e-2, 1e-8), False: (1e-5, 1e-8)}
# The same after `PATIENCE` iterations among people: without the exact Hessian, further ones gain little.
LATE, PATIENCE = {True: (1e-2, 1e-7), False: (1e-3, 1e-7)}, 20
PRICE = 1.1  # price of violation in the merit, as a multiple of the largest multiplier: exact above 1
SHORTEST = 1e-3  # smallest share of a step that is still tried
ROUNDING = 1e-12  # share by which the merit may rise from rounding alone
RISES = 2  # full steps in a row that need not lower the merit
_HARD, _EQUAL, _SOFT = 0, 5, 8  # DAQP's kinds of constraints
# No regularisation of convex programs; beside the exact penalty, a negligible quadratic one.
_DAQP = {"primal_tol": 1e-9, "eps_prox": 0.0, "rho_soft": 1e3}


class Sqp(ProblemSolver):
    """The hard and the relaxed problem, by SQP; it keeps multipliers from call to call.

    Parameters
    ----------
    settings, n_people, n_walls : of the problem.
    """

    def __init__(self, settings: MPCSettings, n_people: int, n_walls: int) -> None:
        super().__init__(settings, n_people, n_walls)
        with CASADI_LOCK:
            self._allocate(build_sqp_functions(settings, n_people, n_walls))

    def _allocate(self, functions: SqpFunctions) -> None:
        """Memory for the functions and for the program."""
        derive, n_rows = functions.derive, self.evaluate.n_rows
        n, m = derive.nnz_in(0), derive.nnz_in(2)
        self._inputs, self._step, self._share = np.zeros(n), np.zeros(n), np.ones(1)
        self._parameters, self._multipliers = np.zeros(derive.nnz_in(1)), np.zeros(m)
        arguments = self._inputs, self._parameters, self._multipliers
        self._at_inputs = program = QuadraticProgram(
            functions, self.settings.N_h, *arguments
        )
        self._measure = BufferedFunction(
            functions.measure, *arguments, self._step, self._share
        )
        free = functions.free
        self._free = None if free is None else BufferedFunction(free, self._parameters)
        self._before, self._lower, self._upper = (
            program.merit,
            program.lower,
            program.upper,
        )
        self._after, self._trial, self._values, states, h = self._measure.results
        self._program = (
            program.exact,
            program.gradient,
            program.jacobian,
            program.upper,
            program.lower,
        )
        self._sense = np.repeat(
            np.array([_HARD, _SOFT, _EQUAL], np.intc), [n, n_rows, m - n_rows]
        )
        self._measured = (self._trial, *self.evaluate.shaped(self._values, states, h))
        self._has_multipliers, self._model = False, daqp.Model()
        self._model.settings = _DAQP
        self._model.setup(np.eye(n), *self._program[1:], self._sense)
        self._find_prices = BufferedFunction(
            self.evaluate.find_prices, self._parameters
        )
        self._prices = np.full(n + m, self.settings.slack_weight)
        self._model.soft_weights(w_l=self._prices, w_u=self._prices)

    @property
    def remembered(self) -> Array:
        """The multipliers of the last program."""
        return self._multipliers

    @remembered.setter
    def remembered(self, multipliers: Array) -> None:
        """Continue from these multipliers."""
        self._multipliers[:], self._has_multipliers = (
            multipliers,
            bool(multipliers.any()),
        )

    def reset(self) -> None:
        """Forget every multiplier."""
        self._multipliers[:], self._has_multipliers = 0, False

    def hard(self, guess: Array, parameters: Array) -> tuple[PlanEvaluation, bool]:
        """The plan from a `guess` and `parameters`, relaxed if rows stay violated; True if it converged."""
        plan, outcome = self._solve(guess, parameters, HARD_SHARE)
        return plan, outcome == "converged"

    def relaxed(self, guess: Array, parameters: Array) -> tuple[PlanEvaluation, bool]:
        """The same; True as well if no step lowers the merit any more, from a `guess` and `parameters`."""
        plan, outcome = self._solve(guess, parameters, 1.0)
        return plan, outcome in ("converged", "stalled")

    def _solve(
        self, guess: Array, parameters: Array, share: float
    ) -> tuple[PlanEvaluation, Outcome]:
        """The plan from a `guess`, within this share of the budget, and how the search for it ended."""
        self._parameters[:] = parameters
        if self.settings.crowding:
            self._find_prices.call()
            self._prices[self._inputs.size :][: self.evaluate.n_rows] = (
                self._find_prices.results[0]
            )
            self._model.soft_weights(w_l=self._prices, w_u=self._prices)
        outcome: Outcome = "converged"
        # If a row had a multiplier in the last step, it nearly always has one now.
        if self._has_multipliers or not self._is_free():
            self._inputs[:] = guess
            outcome = self._iterate(share)
            if outcome == "failed":
                self.reset()
            if outcome != "converged":
                self._measure_inputs()
        self.timed_out = outcome == "timed out"
        cost, slack = self._after[2:4].tolist()
        return PlanEvaluation(
            cost, slack, *[array.copy() for array in self._measured]
        ), outcome

    def _is_free(self) -> bool:
        """True if the minimum of the cost alone satisfies all bounds and rows; then it is the plan."""
        if self._free is None:
            return False
        self._free.call()
        inputs, violation = self._free.results
        if violation[0] != 0:
            return False
        self._inputs[:] = inputs
        self._measure_inputs()
        return True

    @np.errstate(
        all="ignore"
    )  # on the focus of a zone the slopes are not finite; DAQP refuses them
    def _iterate(self, share: float) -> Outcome:
        """Improve `_inputs`, within this share of the budget; no price goes above the weight of slack."""
        price, rises, best, limit = 0.0, 0, (0.0, 0.0), self.settings.slack_weight
        sense: Any = (
            self._sense
        )  # a copy has only the multipliers: forget which rows are active
        patience = inf if self.settings.crowding is None else PATIENCE
        for k in range(self.settings.max_iterations):
            if self.budget.is_spent(share):
                return "timed out"
            exact, sense = self._linearise(sense), None
            step, _, flag, info = self._model.solve()
            if flag < 0:
                return "failed"
            self._step[:], self._multipliers[:] = step, info["lam"][step.size :]
            self._share[0] = 1.0
            self._measure.call()
            cost, violation, _, _, size, largest_multiplier, on_rows = (
                self._after.tolist()
            )
            self._has_multipliers = largest_multiplier > 0
            price = max(price, min(PRICE * largest_multiplier, limit))
            cost_before, violation_before, on_rows_before, on_speed = (
                self._before.tolist()
            )
            curved = on_rows_before if exact else on_speed
            if rises == 0:
                best = cost_before, violation_before
            before, after = best[0] + price * best[1], cost + price * violation
            if isnan(before):
                return "failed"
            moved, violated = (CONVERGED if k < patience else LATE)[exact]
            is_satisfied = violation <= violated or largest_multiplier >= limit
            has_converged = curved == on_rows == violation == 0 or (
                size <= moved and is_satisfied
            )
            if has_converged or after <= before * (1 + ROUNDING):
                rises = 0
            elif rises < RISES:
                if rises == 0:
                    began = self._inputs.copy(), self._multipliers.copy()
                rises += 1
            elif rises == RISES > 0:
                self._inputs[:], self.remembered = began
                rises += 1
                continue
            elif self._lower_merit(price, before):
                rises = 0
            else:
                self._measure_inputs()
                return "converged" if size <= CONVERGED[False][0] else "stalled"
            if has_converged:
                return "converged"
            self._inputs[:] = self._trial
        return "failed"

    def _measure_inputs(self) -> None:
        """Measure the plan in `_inputs`, unchanged."""
        self._step[:] = 0
        self._measure.call()

    def _linearise(self, sense: Any) -> bool:
        """Give the quadratic program at `_inputs` to DAQP; True if with the exact Hessian.

        With `sense`, the kinds of constraints, DAQP forgets which ones were active; with None it does not.
        """
        self._at_inputs.derive()
        exact = bool(self._model.update(*self._program, sense) >= 0)
        if not exact:
            self._model.update(self._at_inputs.gauss, *self._program[1:], sense)
        return exact

    def _merit(self, price: float, share: float) -> float:
        """Cost and violation after this share of the step."""
        self._share[0] = share
        self._measure.call()
        return float(self._after[0] + price * self._after[1])

    def _lower_merit(self, price: float, before: float) -> bool:
        """Set `_trial` to where the merit is lower: corrected to second order, else on a shorter step."""
        step, n = self._step.copy(), self._step.size
        self._lower[n:] = self._at_inputs.jacobian @ step - self._values
        end = n + self.evaluate.n_rows
        self._upper[end:] = self._lower[end:]
        self._model.update(bupper=self._upper, blower=self._lower)
        corrected, _, flag, _ = self._model.solve()
        self._step[:] = corrected
        if flag > 0 and self._merit(price, 1.0) < before:
            return True
        self._step[:], share = step, 0.5
        while share >= SHORTEST:
            if self._merit(price, share) < before:
                return True
            share /= 2
        return False
