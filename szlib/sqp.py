"""A condensed sequential quadratic program on the DAQP active-set solver, for the problem of `szlib.problem`.

The unknowns are the 2 N inputs. Each iteration solves

    min over d   1/2 d' H d + grad(cost)' d + weight * sum(s)
    subject to   -a_max - u <= d <= a_max - u,   rows + J d + s >= 0,  s >= 0,   terminal + T d = 0

with the exact Hessian H of the Lagrangian where it is positive definite; else without the curvature
of the barriers (Gauss-Newton). Rows are soft, by an exact penalty, so that every program has a
solution. A step has to lower cost + price * violation, with a price of twice the largest multiplier so
far; one that does not is corrected to second order, then shortened. Where no row has a multiplier, the
program's cost is exact, and the first solution that satisfies the true rows is the answer. Where not
even a bound is met, the answer is a linear feedback of the error, K (x - g), without any program.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, Literal

import casadi as ca
import daqp
import numpy as np

from .barriers import Array
from .problem import Buffered, Evaluator, build_problem, slack_weight
from .settings import MPCSettings

Outcome = Literal["converged", "stalled", "failed"]
CONVERGED = 1e-5
"""The last step of the SQP moves no input by more than this [m/s2]."""
SHORTEST = 1e-3
"""A step that must be cut to less than this share of its length leads nowhere."""
ROUNDING = 1e-12
"""Share by which the merit may rise from rounding alone."""
_HARD, _EQUAL, _SOFT = 0, 5, 8  # DAQP's kinds of constraints
_DAQP = {"primal_tol": 1e-9, "eps_prox": 0.0, "rho_soft": 1e3}
"""Convex programs as they stand; next to the exact penalty, a quadratic one too small to matter."""


class Sqp:
    """The hard problem and the relaxed one, by SQP; it remembers multipliers from call to call."""

    def __init__(self, settings: MPCSettings, n_people: int, n_walls: int) -> None:
        self.settings = settings
        self.evaluate = Evaluator(settings, n_people, n_walls)
        derive, measure, self._gain = _functions(settings, n_people, n_walls)
        n, m, n_rows = derive.nnz_in(0), derive.nnz_in(2), self.evaluate.n_rows
        self._inputs, self._trial = np.zeros(n), np.zeros(n)
        self._parameters, self._multipliers = np.zeros(derive.nnz_in(1)), np.zeros(m)
        self._on_rows, self._on_cbf = self._multipliers[:n_rows], self._multipliers[: self.evaluate.n_cbf]
        self._derive = Buffered(derive, self._inputs, self._parameters, self._multipliers)
        self._measure = Buffered(measure, self._trial, self._parameters)
        self._violation = self._measure.results[1]
        _, _, self._values, self._gradient, jacobian, hessian = self._derive.results
        self._jacobian, self._hessian = jacobian.reshape(m, n), hessian.reshape(n, n)
        self._lower, self._upper = np.zeros(n + m), np.full(n + m, np.inf)
        self._weights = np.zeros(n + m)
        self._sense = np.repeat(np.array([_HARD, _SOFT, _EQUAL], np.intc), [n, n_rows, m - n_rows])
        self._model = daqp.Model()
        self._model.settings = _DAQP
        self._bound(self._values)
        self._model.setup(np.eye(n), self._gradient, self._jacobian, self._upper, self._lower, self._sense)

    def reset(self) -> None:
        """Forget every multiplier and active row."""
        self._multipliers[:] = 0
        self._model.update(sense=self._sense)

    def hard(self, guess: Array, parameters: Array) -> tuple[Array, bool]:
        """Inputs, shape (2N,), and whether they converged; if rows stay violated, to the relaxed problem."""
        plan, outcome = self._solve(guess, parameters)
        return plan, outcome == "converged"

    def relaxed(self, guess: Array, parameters: Array) -> tuple[Array, bool]:
        """The same, where it is enough that no step lowers the merit any more."""
        plan, outcome = self._solve(guess, parameters)
        return plan, outcome != "failed"

    def _solve(self, guess: Array, parameters: Array) -> tuple[Array, Outcome]:
        self._parameters[:], self._inputs[:] = parameters, guess
        if self._gain is not None:
            np.dot(self._gain, parameters[:6], out=self._trial)
            self._measure.call()
            if _largest(self._trial) <= self.settings.a_max and self._violation[0] == 0:
                self._multipliers[:] = 0
                return self._trial.copy(), "converged"
        limit = slack_weight(self.settings, parameters)
        self._weights[:] = limit
        outcome = self._iterate(limit)
        if outcome == "failed":
            self.reset()
        return self._inputs.clip(-self.settings.a_max, self.settings.a_max), outcome

    def _iterate(self, limit: float) -> Outcome:
        """Improve `_inputs`; no price above `limit`, the weight of slack."""
        price = 0.0
        for _ in range(self.settings.max_iterations):
            curved = self._on_rows.any()
            step = self._step()
            if step is None:
                return "failed"
            np.add(self._inputs, step, out=self._trial)
            price = max(price, min(2 * _largest(self._multipliers), limit))
            cost, violation = self._derive.results[:2]
            before, after = float(cost[0] + price * violation[0]), self._merit(price)
            solved = not curved and self._violation[0] == 0 and not self._on_rows.any()
            solved = solved or _largest(step) <= CONVERGED
            if not solved and after > before * (1 + ROUNDING) and not self._lower_merit(step, price, before):
                return "stalled"
            self._inputs[:] = self._trial
            if solved:
                return "converged"
        return "failed"

    def _step(self) -> Array | None:
        """The solution of the program at `_inputs`, or None; its multipliers become the current ones."""
        self._derive.call()
        self._bound(self._values)
        if self._update() < 0:
            self._on_cbf[:] = 0
            self._derive.call()
            self._update()
        self._model.soft_weights(w_l=self._weights, w_u=self._weights)
        step, _, flag, info = self._model.solve()
        if flag < 0:
            return None
        self._multipliers[:] = info["lam"][step.size :]
        return np.asarray(step)

    def _bound(self, values: Array) -> None:
        """The bounds of the program, where the rows and the terminal condition have these values."""
        n, a_max = self._inputs.size, self.settings.a_max
        np.subtract(-a_max, self._inputs, out=self._lower[:n])
        np.subtract(a_max, self._inputs, out=self._upper[:n])
        np.negative(values, out=self._lower[n:])
        end = n + self._on_rows.size
        self._upper[end:] = self._lower[end:]

    def _update(self) -> int:
        """Hand the program over; negative if its Hessian is not positive definite."""
        return int(
            self._model.update(self._hessian, self._gradient, self._jacobian, self._upper, self._lower)
        )

    def _merit(self, price: float) -> float:
        """Cost and violation at `_trial`."""
        self._measure.call()
        return float(self._measure.results[0][0] + price * self._violation[0])

    def _lower_merit(self, step: Array, price: float, before: float) -> bool:
        """Set `_trial` to where the merit is lower: corrected to second order, else on a shorter step."""
        self._bound(self._measure.results[2] - self._jacobian @ step)
        self._model.update(bupper=self._upper, blower=self._lower)
        corrected, _, flag, _ = self._model.solve()
        np.add(self._inputs, corrected, out=self._trial)
        if flag > 0 and self._merit(price) < before:
            return True
        share = 0.5
        while share >= SHORTEST:
            np.add(self._inputs, share * step, out=self._trial)
            if self._merit(price) < before:
                return True
            share /= 2
        return False


def _largest(values: Array) -> float:
    return max(float(values.max()), -float(values.min()))


@lru_cache(maxsize=256)
def _functions(settings: MPCSettings, n_people: int, n_walls: int) -> tuple[Any, Any, Array | None]:
    """Derivatives, merit, and the unconstrained solution as a matrix on the state and the target."""
    p = build_problem(settings, n_people, n_walls)
    values = ca.vertcat(p.rows, p.terminal)
    multipliers = ca.SX.sym("multipliers", values.numel())
    gradient, jacobian = ca.gradient(p.cost, p.inputs), ca.jacobian(values, p.inputs)
    hessian = ca.hessian(p.cost + ca.dot(multipliers, values), p.inputs)[0]
    violation = ca.sum1(ca.fmax(0, -p.rows)) + ca.sum1(ca.fabs(p.terminal))
    merit = [p.cost, violation, values]
    derive = p.function(
        "derive", [p.inputs, p.parameters, multipliers], [*merit, gradient, jacobian.T, hessian]
    )
    measure = p.function("measure", [p.inputs, p.parameters], merit)
    if p.terminal.numel():
        return derive, measure, None
    state_and_target = p.parameters[:6]
    curvature, pull = (np.asarray(ca.evalf(ca.jacobian(gradient, of))) for of in (p.inputs, state_and_target))
    return derive, measure, np.asarray(-np.linalg.solve(curvature, pull), float)
