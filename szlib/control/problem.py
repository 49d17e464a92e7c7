"""The optimal control problem of the controller, in symbols, for every solver.

    min over u_0 .. u_{N-1}
        (x_N - g)' P (x_N - g) + sum_{k=1}^{N-1} (x_k - g)' Q (x_k - g) + sum_{k=0}^{N-1} u_k' R u_k
    subject to
        x_{k+1} = A x_k + B u_k,  x_0 given                           double integrator   (paper, eq. 8)
        -a_max <= u_k <= a_max                                        acceleration        k = 0 .. N-1
        |(vx, vy)_k|^2 <= v_max^2                                     Euclidean speed     k = 1 .. N
        h_i(x_{k+1}, k+1) - (1 - gamma) h_i(x_k, k) >= 0              every person, wall  k = 0 .. N_h-1
        (vx, vy)_N = w                                                if there is a terminal condition

(paper, eq. 1-2), where x = (x, y, vx, vy), u = (ax, ay), and h_i(., k) takes person i at constant
velocity, k steps ahead. `g` is the target at rest: the goal, except where a person is met head-on
(`head_on.find_target`); w is 0 or the velocity of a person. The states are eliminated: 2 N unknowns remain.
The *relaxed* problem adds a slack s >= 0 to each barrier row, and to the speed rows if the robot is already
too fast, and penalises their sum. The penalty is exact: if the hard problem has a solution near by, both have
the same one. The terminal condition is never relaxed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from math import inf
from threading import RLock
from time import perf_counter, thread_time
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from ..checks import Array
from .barriers import barrier, cbf_residual, ellipse_formula, segment_formula
from .settings import MPCSettings

# Share of a step's time for the hard problem. The second try begins within half of this share, or not at all,
# so that time is left for the relaxed problem.
HARD_SHARE = 0.4
# Held while CasADi's symbols and functions are made or released, because their reference counts are not safe
# for threads. Functions may run at the same time, each in memory of its own.
CASADI_LOCK = RLock()


@dataclass(frozen=True)
class Problem:
    """The problem for a number of people and walls.

    Attributes
    ----------
    inputs : u_0 .. u_{N-1}, shape (2N,).
    parameters : the state (4), the target (2), the terminal velocity w (2), then for each person the foci and
        a of the zone and the velocity (7), then for each wall its end points and its margin (5).
    states : x_0 .. x_N, shape (4, N+1).
    cost : of the plan.
    rows : required to be >= 0: the `n_cbf` barrier conditions, person by person, then wall by wall, and the N
        speed limits.
    terminal : required to be 0; empty without a terminal condition.
    h : a row for each person and wall, a column for each of the states x_0 .. x_{N_h}.
    slope, bend : derivatives of h by the position in that state, (h_x, h_y) and (h_xx, h_xy, h_yy).
    n_cbf : number of barrier conditions.
    """

    inputs: Any
    parameters: Any
    states: Any
    cost: Any
    rows: Any
    terminal: Any
    h: Any
    slope: Sequence[Any]
    bend: Sequence[Any]
    n_cbf: int

    @property
    def violations(self) -> Any:
        """Violation of each row and of the terminal condition; 0 where they hold."""
        return ca.vertcat(ca.fmax(0, -self.rows), ca.fabs(self.terminal))


@lru_cache(maxsize=256)
def build_problem(settings: MPCSettings, n_people: int, n_walls: int) -> Problem:
    """Build the problem of this module's docstring for `settings`, `n_people` and `n_walls`, or reuse it."""
    s = settings
    inputs, start, target = ca.SX.sym("u", 2, s.N), ca.SX.sym("x0", 4), ca.SX.sym("target", 2)
    people, walls, w = ca.SX.sym("person", 7, n_people), ca.SX.sym("wall", 5, n_walls), ca.SX.sym("w", 2)

    states = [start]
    for k in range(s.N):
        position, velocity, a = states[-1][:2], states[-1][2:], inputs[:, k]
        states.append(ca.vertcat(position + s.dt * velocity + 0.5 * s.dt**2 * a, velocity + s.dt * a))
    x = ca.horzcat(*states)

    weights = ca.DM([[0.0] * 4, *[s.Q] * (s.N - 1), s.P]).T
    error = x - ca.repmat(ca.vertcat(target, 0, 0), 1, s.N + 1)
    cost = ca.dot(weights, error**2) + ca.dot(ca.repmat(ca.DM(s.R), 1, s.N), inputs**2)

    h, h_x, h_y, h_xx, h_xy, h_yy = _barriers(s, x[:2, : s.N_h + 1], people, walls)
    cbf = ca.vec(cbf_residual(h[:, 1:], h[:, :-1], s.gamma).T)
    speed = s.v_max**2 - ca.sum1(x[2:, 1:] ** 2).T
    return Problem(
        inputs=ca.vec(inputs),
        parameters=ca.vertcat(start, target, w, ca.vec(people), ca.vec(walls)),
        states=x,
        cost=cost,
        rows=ca.vertcat(cbf, speed),
        terminal=ca.SX(0, 1) if s.terminal == "none" else x[2:, s.N] - w,
        h=h,
        slope=(h_x, h_y),
        bend=(h_xx, h_xy, h_yy),
        n_cbf=cbf.numel(),
    )


def _barriers(s: MPCSettings, at: Any, people: Any, walls: Any) -> list[Any]:
    """h and its derivatives at positions (2, n), one step apart, each of shape (people + walls, n)."""
    x, y, time = (ca.SX.sym(name) for name in ("x", "y", "t"))
    xa, ya, xb, yb, a, vx, vy = person = ca.vertsplit(ca.SX.sym("person", 7))
    distance = ellipse_formula(x - time * vx, y - time * vy, xa, ya, xb, yb, a)
    *ends, margin = wall = ca.vertsplit(ca.SX.sym("wall", 5))
    of_person, of_wall = barrier(distance, s.r_robot, s.eps), segment_formula(x, y, *ends)
    n, found = at.shape[1], [[ca.SX(0, at.shape[1])] for _ in range(6)]
    for h, of, numbers in ((of_person, person, people), (barrier(of_wall, s.r_robot, margin), wall, walls)):
        if count := numbers.shape[1]:
            values = _differentiated(h, x, y, time, of, s.dt, n).map(count)(ca.repmat(at, 1, count), numbers)
            for parts, value in zip(found, values, strict=True):
                parts.append(ca.reshape(value, n, count).T)
    return [ca.vertcat(*parts) for parts in found]


def _differentiated(h: Any, x: Any, y: Any, time: Any, of: Sequence[Any], dt: float, n: int) -> Any:
    """A function of n positions, dt apart, and of numbers: h, h_x, h_y, h_xx, h_xy, h_yy, of shape (1, n)."""
    by, numbers, at = ca.vertcat(x, y), ca.vertcat(*of), ca.SX.sym("at", 2, n)
    hessian, gradient = ca.hessian(h, by)
    outputs = [h, gradient[0], gradient[1], hessian[0, 0], hessian[0, 1], hessian[1, 1]]
    once = ca.Function("h", [by, numbers, time], outputs)
    everywhere = zip(*(once(at[:, k], numbers, dt * k) for k in range(n)), strict=True)
    return ca.Function("h", [at, numbers], ca.cse([ca.horzcat(*values) for values in everywhere]))


def remaining_distance(x: Any, y: Any, gx: Any, gy: Any) -> Any:
    """Distance from (`x`, `y`) to the target (`gx`, `gy`) [m], at least 1 m.

    The cost of a metre of slack is `MPCSettings.slack_weight` for each of its metres.
    """
    distance = ((gx - x) ** 2 + (gy - y) ** 2) ** 0.5
    return (distance + 1 + abs(distance - 1)) / 2


def dense_function(name: str, arguments: Sequence[Any], outputs: Sequence[Any]) -> Any:
    """A CasADi function `name` from `arguments` to dense `outputs`."""
    return ca.Function(name, list(arguments), [ca.densify(output) for output in outputs])


class BufferedFunction:
    """A CasADi function on fixed arrays: fill the arguments, `call`, read `results`.

    This saves the conversions of an ordinary call, which take ten times as long as these functions.

    Parameters
    ----------
    function : the CasADi function.
    arguments : one array for each of its arguments.
    """

    def __init__(self, function: Any, *arguments: Array) -> None:
        self.results = [np.zeros(function.nnz_out(i)) for i in range(function.n_out())]
        buffer, call = function.buffer()
        for i, array in enumerate(arguments):
            buffer.set_arg(i, array.data)
        for i, array in enumerate(self.results):
            buffer.set_res(i, array.data)
        self.call = call
        self._memory = buffer, arguments  # must live as long as `call`


class PlanEvaluation(NamedTuple):
    """The numbers of a plan.

    Attributes
    ----------
    cost : of the plan, without any penalty.
    slack : largest violation of a row or of the terminal condition, 0 if none.
    inputs : accelerations, shape (2N,) [m/s2].
    rows : see `Problem`.
    states : shape (N+1, 4) [m, m/s].
    h : barriers, shape (people + walls, N_h+1) [m].
    """

    cost: float
    slack: float
    inputs: Array
    rows: Array
    states: Array
    h: Array


class PlanEvaluator:
    """Evaluates any plan, without a solver.

    Parameters
    ----------
    settings, n_people, n_walls : of the problem; `size` holds the last two.
    """

    def __init__(self, settings: MPCSettings, n_people: int, n_walls: int) -> None:
        with CASADI_LOCK:
            evaluate, self.n_cbf = _evaluation(settings, n_people, n_walls)
            self.n_rows = evaluate.nnz_out(1)
            self._inputs, self._parameters = np.zeros(evaluate.nnz_in(0)), np.zeros(evaluate.nnz_in(1))
            self.function = BufferedFunction(evaluate, self._inputs, self._parameters)
        self.size, self._shape = (n_people, n_walls), (n_people + n_walls, settings.N_h + 1)
        self._numbers = (self._inputs, *self.shaped(*self.function.results[1:]))

    def shaped(self, rows: Array, states: Array, h: Array) -> tuple[Array, Array, Array]:
        """Views of the buffers `rows`, `states` and `h`, shaped as in `PlanEvaluation`."""
        return rows[: self.n_rows], states.reshape(-1, 4), h.reshape(self._shape)

    def __call__(self, plan: Array, parameters: Array) -> PlanEvaluation:
        self._inputs[:], self._parameters[:] = plan, parameters
        self.function.call()
        cost, slack = self.function.results[0].tolist()
        return PlanEvaluation(cost, slack, *[array.copy() for array in self._numbers])


@lru_cache(maxsize=256)
def _evaluation(settings: MPCSettings, n_people: int, n_walls: int) -> tuple[Any, int]:
    p = build_problem(settings, n_people, n_walls)
    outputs = [ca.vertcat(p.cost, ca.mmax(p.violations)), p.rows, p.states, p.h.T]
    return dense_function("evaluate", [p.inputs, p.parameters], outputs), p.n_cbf


class TimeBudget:
    """The time of one step; call `begin` at its start.

    Parameters
    ----------
    limit : computing time of the thread [s], or inf.
    deadline : time of a clock on the wall [s], or inf.
    """

    def __init__(self, limit: float, deadline: float = inf) -> None:
        self._limit, self._deadline = limit, deadline
        self.begin()

    def begin(self, spent: float = 0.0) -> None:
        """Start to measure; of the deadline so much is `spent` already [s]."""
        self._wall, self._thread, self._spent = perf_counter(), thread_time(), spent

    def is_spent(self, share: float = 1.0) -> bool:
        """True if this `share` of the time is used up. The thread's clock is slow, so it is read last."""
        limit, passed = share * self._limit, perf_counter() - self._wall
        if passed + self._spent > share * self._deadline:
            return True
        return passed > limit and thread_time() - self._thread > limit


class ProblemSolver:
    """Base class of the solvers of this problem.

    Parameters
    ----------
    settings, n_people, n_walls : of the problem.

    Attributes
    ----------
    evaluate : evaluates any plan.
    budget : the computing time of a step.
    timed_out : True if the budget stopped the last call, which then returned its plan so far.
    """

    def __init__(self, settings: MPCSettings, n_people: int, n_walls: int) -> None:
        self.settings, self.budget, self.timed_out = (
            settings,
            TimeBudget(settings.time_limit, settings.deadline),
            False,
        )
        self.evaluate = PlanEvaluator(settings, n_people, n_walls)

    remembered: Array
    """Multipliers kept from call to call: they save time, and change the answers by rounding only."""

    def hard(self, guess: Array, parameters: Array) -> tuple[PlanEvaluation, bool]:
        """The plan that obeys every row, from a `guess`, shape (2N,), and `parameters`; True if found."""
        raise NotImplementedError

    def relaxed(self, guess: Array, parameters: Array) -> tuple[PlanEvaluation, bool]:
        """The plan of least penalty, from a `guess` and `parameters`; True if it converged."""
        raise NotImplementedError

    def reset(self) -> None:
        """Forget the multipliers."""
