"""The problem of `szlib.control.problem`, solved by IPOPT as in the paper.

All controllers share the solvers, because building one takes as long as many steps. A solver keeps its
iterations in memory of its own, so one thread calls IPOPT at a time.
"""

from __future__ import annotations

from functools import lru_cache
from math import inf
from threading import Lock
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from ...checks import Array
from ..problem import (
    CASADI_LOCK,
    HARD_SHARE,
    PlanEvaluation,
    ProblemSolver,
    build_problem,
    remaining_distance,
)
from ..settings import MPCSettings

# Measured on the approach to a person: 7 iterations instead of 9.4, in 0.65 of the time.
_OPTIONS = {
    "print_level": 0,
    "sb": "yes",
    # The start is close to the solution: the plan of the step before, by its trend.
    "mu_init": 1e-2,
    "bound_push": 1e-3,
    "bound_frac": 1e-3,
    "bound_mult_init_method": "mu-based",
    # The problem is small and nearly quadratic: leave each barrier subproblem early, step boldly.
    "barrier_tol_factor": 1e3,
    "mu_linear_decrease_factor": 0.02,
    "mu_superlinear_decrease_power": 1.9,
    "alpha_for_y": "min-dual-infeas",
    "fast_step_computation": "yes",
    "min_refinement_steps": 0,
}

_CALL_LOCK = Lock()  # held from the call of a solver until its result is read


class Ipopt(ProblemSolver):
    """The hard and the relaxed problem, by IPOPT.

    Parameters
    ----------
    settings, n_people, n_walls : of the problem.
    """

    def __init__(self, settings: MPCSettings, n_people: int, n_walls: int) -> None:
        super().__init__(settings, n_people, n_walls)
        with CASADI_LOCK:
            self._hard, self._relaxed = _build(settings, n_people, n_walls)
        self._upper = np.zeros(
            self._hard.numel_out("g")
        )  # 0 for the terminal condition
        self._upper[: self.evaluate.n_rows] = inf
        self.remembered = np.zeros(0)

    def hard(self, guess: Array, parameters: Array) -> tuple[PlanEvaluation, bool]:
        """The plan from a `guess` and `parameters`; True if IPOPT converged."""
        a_max = self.settings.a_max
        if self.settings.crowding:
            prices = np.asarray(self.evaluate.find_prices(parameters)).ravel()
            return self._solve_with_slack(
                guess, parameters, prices < self.settings.slack_weight
            )
        return self._solve(
            self._hard, parameters, x0=guess, p=parameters, lbx=-a_max, ubx=a_max
        )

    def relaxed(self, guess: Array, parameters: Array) -> tuple[PlanEvaluation, bool]:
        """The plan of the relaxed problem from a `guess` and `parameters`; True if IPOPT converged."""
        is_free = np.ones(self.evaluate.n_rows, bool)
        is_free[self.evaluate.n_cbf :] = (
            np.hypot(*parameters[2:4]) > self.settings.v_max
        )
        return self._solve_with_slack(guess, parameters, is_free)

    def _solve_with_slack(
        self, guess: Array, parameters: Array, is_free: NDArray[np.bool_]
    ) -> tuple[PlanEvaluation, bool]:
        """The plan with a slack in each row that `is_free`, at its price."""
        s, rows = self.settings, self.evaluate(guess, parameters).rows
        prices = np.asarray(self.evaluate.find_prices(parameters)).ravel()
        weight = prices * remaining_distance(*parameters[[0, 1, 4, 5]])
        return self._solve(
            self._relaxed,
            parameters,
            x0=np.r_[guess, np.maximum(-rows, 0) * is_free * weight],
            p=np.r_[parameters, weight],
            lbx=np.r_[np.full(guess.size, -s.a_max), np.zeros(rows.size)],
            ubx=np.r_[np.full(guess.size, s.a_max), np.where(is_free, np.inf, 0.0)],
        )

    def _solve(
        self, solver: Any, parameters: Array, **problem: Any
    ) -> tuple[PlanEvaluation, bool]:
        """The plan that `solver` finds, and True if it converged."""
        with _CALL_LOCK:
            found, stats = solver(lbg=0, ubg=self._upper, **problem), solver.stats()
        s = self.settings
        self.timed_out = stats["return_status"] in (
            "Maximum_CpuTime_Exceeded",
            "Maximum_WallTime_Exceeded",
        )
        inputs = np.clip(np.asarray(found["x"]).ravel()[: 2 * s.N], -s.a_max, s.a_max)
        return self.evaluate(inputs, parameters), bool(stats["success"])


@lru_cache(maxsize=256)
def _build(settings: MPCSettings, n_people: int, n_walls: int) -> tuple[Any, Any]:
    """The solvers of the hard and of the relaxed problem."""
    p = build_problem(settings, n_people, n_walls)
    options: dict[str, Any] = {"expand": True, "print_time": False, "calc_lam_p": False}
    options["show_eval_warnings"] = False  # a failure shows in `Step.status`
    options |= {f"ipopt.{name}": value for name, value in _OPTIONS.items()}
    options["ipopt.max_iter"] = settings.max_iterations
    for name, limit in (("cpu", settings.time_limit), ("wall", settings.deadline)):
        if limit < inf:
            options[f"ipopt.max_{name}_time"] = HARD_SHARE * limit
    # Slack counted by its penalty, in the unit of the cost: IPOPT would scale the rest away.
    penalty, weight = (
        ca.SX.sym("penalty", p.rows.numel()),
        ca.SX.sym("weight", p.rows.numel()),
    )
    hard = {
        "x": p.inputs,
        "p": p.parameters,
        "f": p.cost,
        "g": ca.vertcat(p.rows, p.terminal),
    }
    relaxed = {
        "x": ca.vertcat(p.inputs, penalty),
        "p": ca.vertcat(p.parameters, weight),
        "f": p.cost + ca.sum1(penalty),
        "g": ca.vertcat(p.rows + penalty / weight, p.terminal),
    }
    return ca.nlpsol("hard", "ipopt", hard, options), ca.nlpsol(
        "relaxed", "ipopt", relaxed, options
    )
