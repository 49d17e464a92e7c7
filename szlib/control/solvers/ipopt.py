"""The problem of `szlib.control.problem`, solved by IPOPT as in the paper.

A built solver keeps its iterations in memory of its own, so it belongs to one controller at a time. When the
controller is gone, the solver is used again, because building one takes as long as many steps.
"""

from __future__ import annotations

import weakref
from collections import deque
from math import inf
from typing import Any

import casadi as ca
import numpy as np

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

_Key = tuple[MPCSettings, int, int]
_Solvers = tuple[Any, Any]
# Pairs of solvers that wait for another controller; if there are more, the oldest are dropped.
_idle: deque[tuple[_Key, _Solvers]] = deque(maxlen=64)


class Ipopt(ProblemSolver):
    """The hard and the relaxed problem, by IPOPT.

    Parameters
    ----------
    settings, n_people, n_walls : of the problem.
    """

    def __init__(self, settings: MPCSettings, n_people: int, n_walls: int) -> None:
        super().__init__(settings, n_people, n_walls)
        key = (settings, n_people, n_walls)
        solvers = _borrow(key)
        weakref.finalize(self, _give_back, key, solvers).atexit = False
        self._hard, self._relaxed = solvers
        self._upper = np.zeros(self._hard.numel_out("g"))  # 0 for the terminal condition
        self._upper[: self.evaluate.n_rows] = inf
        self.remembered = np.zeros(0)

    def hard(self, guess: Array, parameters: Array) -> tuple[PlanEvaluation, bool]:
        """The plan from a `guess` and `parameters`; True if IPOPT converged."""
        a_max = self.settings.a_max
        found = self._hard(x0=guess, p=parameters, lbx=-a_max, ubx=a_max, lbg=0, ubg=self._upper)
        return self._plan(self._hard, found, parameters)

    def relaxed(self, guess: Array, parameters: Array) -> tuple[PlanEvaluation, bool]:
        """The plan of the relaxed problem from a `guess` and `parameters`; True if IPOPT converged."""
        s = self.settings
        rows = self.evaluate(guess, parameters).rows
        free = np.ones(rows.size)
        free[self.evaluate.n_cbf :] = np.hypot(*parameters[2:4]) > s.v_max
        weight = s.slack_weight * remaining_distance(*parameters[[0, 1, 4, 5]])
        found = self._relaxed(
            x0=np.r_[guess, np.maximum(-rows, 0) * free * weight],
            p=np.r_[parameters, weight],
            lbx=np.r_[np.full(guess.size, -s.a_max), np.zeros(rows.size)],
            ubx=np.r_[np.full(guess.size, s.a_max), np.where(free > 0, np.inf, 0.0)],
            lbg=0,
            ubg=self._upper,
        )
        return self._plan(self._relaxed, found, parameters)

    def _plan(self, solver: Any, found: dict[str, Any], parameters: Array) -> tuple[PlanEvaluation, bool]:
        """The plan that `solver` has found, and True if it converged."""
        s, stats = self.settings, solver.stats()
        self.timed_out = stats["return_status"] == "Maximum_CpuTime_Exceeded"
        inputs = np.clip(np.asarray(found["x"]).ravel()[: 2 * s.N], -s.a_max, s.a_max)
        return self.evaluate(inputs, parameters), bool(stats["success"])


def _borrow(key: _Key) -> _Solvers:
    """Solvers that no controller uses: idle ones, or else new ones."""
    with CASADI_LOCK:
        for _ in range(len(_idle)):
            known, solvers = _idle.popleft()
            if known == key:
                return solvers
            _idle.append((known, solvers))
        return _build(*key)


def _give_back(key: _Key, solvers: _Solvers) -> None:
    with CASADI_LOCK:
        _idle.append((key, solvers))


def _build(settings: MPCSettings, n_people: int, n_walls: int) -> _Solvers:
    p = build_problem(settings, n_people, n_walls)
    options: dict[str, Any] = {"expand": True, "print_time": False, "calc_lam_p": False}
    options["show_eval_warnings"] = False  # a failure shows in `Step.status`
    options |= {f"ipopt.{name}": value for name, value in _OPTIONS.items()}
    options["ipopt.max_iter"] = settings.max_iterations
    if settings.time_limit < inf:
        options["ipopt.max_cpu_time"] = HARD_SHARE * settings.time_limit
    # Slack counted by its penalty, in the unit of the cost: IPOPT would scale the rest away.
    penalty, weight = ca.SX.sym("penalty", p.rows.numel()), ca.SX.sym("weight")
    hard = {"x": p.inputs, "p": p.parameters, "f": p.cost, "g": ca.vertcat(p.rows, p.terminal)}
    relaxed = {
        "x": ca.vertcat(p.inputs, penalty),
        "p": ca.vertcat(p.parameters, weight),
        "f": p.cost + ca.sum1(penalty),
        "g": ca.vertcat(p.rows + penalty / weight, p.terminal),
    }
    return ca.nlpsol("hard", "ipopt", hard, options), ca.nlpsol("relaxed", "ipopt", relaxed, options)
