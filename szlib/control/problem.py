"""The optimal control problem of the controller, in symbols, for every solver.

    min over u_0 .. u_{N-1}
        (x_N - g)' P (x_N - g) + sum_{k=1}^{N-1} m_{k-1} (x_k - g)' Q (x_k - g)
            + sum_{k=0}^{N-1} m_k u_k' R u_k + j |u_k - u_{k-1}|^2 / m_k
    subject to
        x_{k+1} = A_k x_k + B_k u_k,  x_0 given                       double integrator   (paper, eq. 8)
        -a_max <= u_k <= a_max                                        acceleration        k = 0 .. N-1
        |(vx, vy)_k|^2 <= v_max^2                                     Euclidean speed     k = 1 .. N
        h_i(x_{k+1}, t_{k+1}) - (1 - gamma_i)^{m_k} h_i(x_k, t_k) >= 0    each barrier i  k = 0 .. N_h-1
        (vx, vy)_N = w                                                if there is a terminal condition

(paper, eq. 1-2), where x = (x, y, vx, vy), u = (ax, ay), and h_i(., t) takes person i at constant
velocity, t seconds ahead. Step k takes m_k dt; in the paper m_k = 1, each person and wall has one barrier,
all gamma_i are the same, and the weight j of jerk is 0. `g` is the target at rest: the goal, except where a
person is met head-on (`head_on.find_target`); w is 0 or the velocity of a person. The states are eliminated:
2 N unknowns remain. Each barrier has a price: below `slack_weight`, its rows may be violated, at this price
for each metre and dt; else they are hard (see `crowding`). The *relaxed* problem adds a slack s >= 0 to each
hard barrier row, and to the speed rows if the robot is already too fast, and penalises their sum. The penalty
is exact: if the hard problem has a solution near by, both have the same one. The terminal condition is never
relaxed.
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
from .barriers import barrier, ellipse_formula, segment_formula
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
    parameters : the state (4), the target (2), the terminal velocity w (2), the last input u_{-1} (2), then
        for each barrier of a person the foci and a of the zone, the velocity, gamma and the price (9), then
        for each wall its end points and its margin (5).
    states : x_0 .. x_N, shape (4, N+1).
    cost : of the plan.
    rows : required to be >= 0: the `n_cbf` barrier conditions, person by person, then wall by wall, and the N
        speed limits.
    terminal : required to be 0; empty without a terminal condition.
    h : a row for each barrier, a column for each of the states x_0 .. x_{N_h}.
    slope, bend : derivatives of h by the position in that state, (h_x, h_y) and (h_xx, h_xy, h_yy).
    kept : (1 - gamma_i)^{m_k}, a row for each barrier, a column for each step.
    prices : of a metre of violation of each of `rows`; `slack_weight` for hard ones.
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
    kept: Any
    prices: Any
    n_cbf: int

    @property
    def violations(self) -> Any:
        """Violation of each row and of the terminal condition; 0 where they hold."""
        return ca.vertcat(ca.fmax(0, -self.rows), ca.fabs(self.terminal))

    def is_hard(self, settings: MPCSettings) -> Any:
        """1 for hard rows and the terminal condition, 0 for rows with a price below that of `settings`."""
        return ca.vertcat(
            self.prices >= settings.slack_weight, ca.SX.ones(self.terminal.numel())
        )


@lru_cache(maxsize=256)
def build_problem(settings: MPCSettings, n_people: int, n_walls: int) -> Problem:
    """Build the problem of this module's docstring for `settings`, `n_people` and `n_walls`, or reuse it."""
    s = settings
    inputs, start, target = (
        ca.SX.sym("u", 2, s.N),
        ca.SX.sym("x0", 4),
        ca.SX.sym("target", 2),
    )
    people, walls = ca.SX.sym("person", 9, n_people), ca.SX.sym("wall", 5, n_walls)
    w, last = ca.SX.sym("w", 2), ca.SX.sym("last", 2)

    states = [start]
    for k, length in enumerate(s.step_lengths):
        position, velocity, a, dt = (
            states[-1][:2],
            states[-1][2:],
            inputs[:, k],
            length * s.dt,
        )
        states.append(
            ca.vertcat(position + dt * velocity + 0.5 * dt**2 * a, velocity + dt * a)
        )
    x = ca.horzcat(*states)

    lengths = np.array(s.step_lengths, float)
    weights = ca.DM(np.column_stack([np.zeros(4), np.outer(s.Q, lengths[:-1]), s.P]))
    error = x - ca.repmat(ca.vertcat(target, 0, 0), 1, s.N + 1)
    cost = ca.dot(weights, error**2) + ca.dot(ca.DM(np.outer(s.R, lengths)), inputs**2)
    if s.jerk_weight:
        change = inputs - ca.horzcat(last, inputs[:, :-1])
        cost += ca.dot(
            ca.DM(np.outer((s.jerk_weight, s.jerk_weight), 1 / lengths)), change**2
        )

    h, h_x, h_y, h_xx, h_xy, h_yy = _barriers(
        s, x[:2, : s.N_h + 1], people[:7, :], walls
    )
    kept, prices = _kept_and_prices(s, people[7:, :], n_walls)
    cbf = ca.vec((h[:, 1:] - kept * h[:, :-1]).T)
    speed = s.v_max**2 - ca.sum1(x[2:, 1:] ** 2).T
    return Problem(
        inputs=ca.vec(inputs),
        parameters=ca.vertcat(start, target, w, last, ca.vec(people), ca.vec(walls)),
        states=x,
        cost=cost,
        rows=ca.vertcat(cbf, speed),
        terminal=ca.SX(0, 1) if s.terminal == "none" else x[2:, s.N] - w,
        h=h,
        slope=(h_x, h_y),
        bend=(h_xx, h_xy, h_yy),
        kept=kept,
        prices=ca.vertcat(ca.vec(prices.T), s.slack_weight * ca.SX.ones(s.N)),
        n_cbf=cbf.numel(),
    )


def _kept_and_prices(s: MPCSettings, given: Any, n_walls: int) -> tuple[Any, Any]:
    """Share of h that a step has to keep, and the price of each row, both of shape (barriers, N_h).

    `given` : gamma and price of each barrier of a person, shape (2, n).
    """
    keep = ca.vertcat(1 - given[0, :].T, ca.SX(1 - s.gamma) * ca.SX.ones(n_walls))
    price = ca.vertcat(given[1, :].T, s.slack_weight * ca.SX.ones(n_walls))
    kept = [keep if m == 1 else keep**m for m in s.step_lengths[: s.N_h]]
    prices = [
        ca.if_else(price < s.slack_weight, m * price, price)
        for m in s.step_lengths[: s.N_h]
    ]
    return ca.horzcat(*kept), ca.horzcat(*prices)


def _barriers(s: MPCSettings, at: Any, people: Any, walls: Any) -> list[Any]:
    """h and its derivatives at positions (2, n), one for each time, each of shape (people + walls, n)."""
    x, y, time = (ca.SX.sym(name) for name in ("x", "y", "t"))
    xa, ya, xb, yb, a, vx, vy = person = ca.vertsplit(ca.SX.sym("person", 7))
    distance = ellipse_formula(x - time * vx, y - time * vy, xa, ya, xb, yb, a)
    *ends, margin = wall = ca.vertsplit(ca.SX.sym("wall", 5))
    of_person, of_wall = (
        barrier(distance, s.r_robot, s.eps),
        segment_formula(x, y, *ends),
    )
    n, found = at.shape[1], [[ca.SX(0, at.shape[1])] for _ in range(6)]
    for h, of, numbers in (
        (of_person, person, people),
        (barrier(of_wall, s.r_robot, margin), wall, walls),
    ):
        if count := numbers.shape[1]:
            once = _differentiated(h, x, y, time, of, s.times, n)
            values = once.map(count)(ca.repmat(at, 1, count), numbers)
            for parts, value in zip(found, values, strict=True):
                parts.append(ca.reshape(value, n, count).T)
    return [ca.vertcat(*parts) for parts in found]


def _differentiated(
    h: Any, x: Any, y: Any, time: Any, of: Sequence[Any], times: Sequence[float], n: int
) -> Any:
    """A function of n positions at these times and of numbers: h and its derivatives, each (1, n)."""
    # One variable at a time: these are a fifth fewer instructions than those of `ca.hessian`.
    h_x, h_y = (ca.jacobian(h, by) for by in (x, y))
    outputs = [
        h,
        h_x,
        h_y,
        ca.jacobian(h_x, x),
        ca.jacobian(h_x, y),
        ca.jacobian(h_y, y),
    ]
    numbers, at = ca.vertcat(*of), ca.SX.sym("at", 2, n)
    once = ca.Function("h", [ca.vertcat(x, y), numbers, time], outputs)
    everywhere = zip(
        *(once(at[:, k], numbers, times[k]) for k in range(n)), strict=True
    )
    return ca.Function(
        "h", [at, numbers], ca.cse([ca.horzcat(*values) for values in everywhere])
    )


def remaining_distance(x: Any, y: Any, gx: Any, gy: Any) -> Any:
    """Distance from (`x`, `y`) to the target (`gx`, `gy`) [m], at least 1 m.

    The cost of a metre of slack is `MPCSettings.slack_weight` for each of its metres.
    """
    distance = ((gx - x) ** 2 + (gy - y) ** 2) ** 0.5
    return (distance + 1 + abs(distance - 1)) / 2


def dense_function(name: str, arguments: Sequence[Any], outputs: Sequence[Any]) -> Any:
    """A CasADi function `name` from `arguments` to dense `outputs`."""
    return ca.Function(
        name, list(arguments), [ca.densify(output) for output in outputs]
    )


class BufferedFunction:
    """A CasADi function on fixed arrays: fill the arguments, `call`, read `results`.

    This saves the conversions of an ordinary call, which take ten times as long as these functions.

    Parameters
    ----------
    function : the CasADi function.
    arguments : one array for each of its arguments.
    last_results : arrays for its last results; for the others it makes some.
    """

    def __init__(
        self, function: Any, *arguments: Array, last_results: Sequence[Array] = ()
    ) -> None:
        n_made = function.n_out() - len(last_results)
        self.results = [
            *(np.zeros(function.nnz_out(i)) for i in range(n_made)),
            *last_results,
        ]
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
    slack : largest violation of a hard row or of the terminal condition, 0 if none.
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

    Attributes
    ----------
    find_prices : the function of CasADi from the parameters to the price of each row.
    """

    def __init__(self, settings: MPCSettings, n_people: int, n_walls: int) -> None:
        with CASADI_LOCK:
            evaluate, self.find_prices, self.n_cbf = _evaluation(
                settings, n_people, n_walls
            )
            self.n_rows = evaluate.nnz_out(1)
            self._inputs, self._parameters = (
                np.zeros(evaluate.nnz_in(0)),
                np.zeros(evaluate.nnz_in(1)),
            )
            self.function = BufferedFunction(evaluate, self._inputs, self._parameters)
        self.size, self._shape = (
            (n_people, n_walls),
            (n_people + n_walls, settings.N_h + 1),
        )
        self._numbers = (self._inputs, *self.shaped(*self.function.results[1:]))

    def shaped(
        self, rows: Array, states: Array, h: Array
    ) -> tuple[Array, Array, Array]:
        """Views of the buffers `rows`, `states` and `h`, shaped as in `PlanEvaluation`."""
        return rows[: self.n_rows], states.reshape(-1, 4), h.reshape(self._shape)

    def __call__(self, plan: Array, parameters: Array) -> PlanEvaluation:
        self._inputs[:], self._parameters[:] = plan, parameters
        self.function.call()
        cost, slack = self.function.results[0].tolist()
        return PlanEvaluation(cost, slack, *[array.copy() for array in self._numbers])


@lru_cache(maxsize=256)
def _evaluation(
    settings: MPCSettings, n_people: int, n_walls: int
) -> tuple[Any, Any, int]:
    p = build_problem(settings, n_people, n_walls)
    slack = ca.mmax(p.violations * p.is_hard(settings))
    outputs = [ca.vertcat(p.cost, slack), p.rows, p.states, p.h.T]
    prices = dense_function("prices", [p.parameters], [p.prices])
    return (
        dense_function("evaluate", [p.inputs, p.parameters], outputs),
        prices,
        p.n_cbf,
    )


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
        self.settings, self.timed_out = settings, False
        self.budget = TimeBudget(settings.time_limit, settings.deadline)
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
