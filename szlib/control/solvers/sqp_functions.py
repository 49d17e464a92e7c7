"""The functions of the SQP: the quadratic program, the merit of a step, the unconstrained plan.

The derivatives follow from the structure of the problem. Positions and velocities are constant linear maps
of the inputs, p = P u + ... and v = V u + ...; a barrier row depends on two positions, a speed row on one
velocity. So with g_k and S_k the gradient and the Hessian of h by the position in state k,

    row of the Jacobian    g_{k+1}' P_{k+1} - (1 - gamma)^m g_k' P_k,     -2 v_k' V_k
    Hessian                curvature of the cost + sum_k -2 lambda_k V_k' V_k + sum_k P_k' S_k P_k

with S_k summed over people and walls, weighted by their multipliers. Without its last sum it is that of a
Gauss-Newton step. CasADi gives g_k, S_k and the rest; the products with P_k and V_k are matrix products of
NumPy, because element by element they would take most of the time (`QuadraticProgram`).
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from ...checks import Array
from ..problem import (
    BufferedFunction,
    Problem,
    build_problem,
    dense_function,
    remaining_distance,
)
from ..settings import MPCSettings


class SqpFunctions(NamedTuple):
    """Three functions of CasADi, and what their results are multiplied by.

    The scaled cost is that for each metre to the target, at least one, and the price of violated rows that
    have one. Violation and multipliers are those of the hard rows.

    Attributes
    ----------
    derive : (inputs, parameters, multipliers) -> (scaled cost, violation, largest multiplier of a row, of a
        speed row), lower and upper bounds, gradient, Hessian of the Lagrangian without the curvature of the
        barriers, for each step g_{k+1} and -(1 - gamma)^m g_k of each barrier, then S_{k+1} P_{k+1}, and the
        Jacobian of the other rows and of the terminal condition.
    measure : (inputs, parameters, multipliers, step, share) -> (scaled cost, violation, cost, slack, largest
        element of the step, largest multiplier, largest of a row), inputs, values of the rows and of the
        terminal condition, states and h, all after this share of the step.
    free : parameters -> the inputs of smallest cost without any row or bound, and the sum of their
        violations; None if there is a terminal condition.
    to_positions : P_0 .. P_{N_h}, shape (N_h+1, 2, 2N).
    n_cbf : number of barrier conditions.
    """

    derive: Any
    measure: Any
    free: Any
    to_positions: Array
    n_cbf: int


class QuadraticProgram:
    """The quadratic program at a plan, in arrays that stay where they are: set the arguments, then `derive`.

    Parameters
    ----------
    functions : of the problem.
    n_steps : number of steps that have barriers, N_h.
    arguments : arrays of the inputs, the parameters and the multipliers.

    Attributes
    ----------
    merit, lower, upper, gradient : see `SqpFunctions.derive`.
    jacobian : of the rows and the terminal condition by the inputs, shape (rows, 2N).
    exact, gauss : Hessian of the Lagrangian, with and without the curvature of the barriers, shape (2N, 2N).
    """

    def __init__(
        self, functions: SqpFunctions, n_steps: int, *arguments: Array
    ) -> None:
        n, n_cbf = arguments[0].size, functions.n_cbf
        self.jacobian, self.exact = np.zeros((arguments[2].size, n)), np.zeros((n, n))
        self._function = BufferedFunction(
            functions.derive, *arguments, last_results=[self.jacobian[n_cbf:]]
        )
        self.merit, self.lower, self.upper, self.gradient, gauss, slopes, bends, _ = (
            self._function.results
        )
        self.gauss = gauss.reshape(n, n)
        to_ends = functions.to_positions[1:]
        to_steps = np.concatenate([to_ends, functions.to_positions[:-1]], axis=1)
        of_steps = self.jacobian[:n_cbf].reshape(-1, n_steps, n).swapaxes(0, 1)
        self._of_barriers = slopes.reshape(n_steps, -1, 4), to_steps, of_steps
        self._of_curvature = to_ends.reshape(-1, n).T, bends.reshape(-1, n), self.exact

    def derive(self) -> None:
        """Fill the arrays from the arguments."""
        self._function.call()
        np.matmul(*self._of_barriers)
        np.dot(*self._of_curvature)
        self.exact += self.gauss


@lru_cache(maxsize=256)
def build_sqp_functions(
    settings: MPCSettings, n_people: int, n_walls: int
) -> SqpFunctions:
    """Build the functions for `settings`, `n_people` and `n_walls`, or reuse them."""
    p, s = build_problem(settings, n_people, n_walls), settings
    u, n_rows = p.inputs, p.rows.numel()
    scale = 1 / remaining_distance(*(p.parameters[i] for i in (0, 1, 4, 5)))
    gradient, is_hard = ca.gradient(p.cost, u), p.is_hard(s)
    values = ca.vertcat(p.rows, p.terminal)
    of_hard, of_priced = (
        is_hard * p.violations,
        (1 - is_hard[:n_rows]) * p.violations[:n_rows],
    )
    cost = scale * p.cost + ca.dot(p.prices, of_priced)
    violation, slack = ca.sum1(of_hard), ca.mmax(of_hard)
    multipliers = ca.SX.sym("multiplier", values.numel())
    on_rows = ca.norm_inf(multipliers[:n_rows])
    arguments = [u, p.parameters, multipliers]

    map_of = np.asarray(ca.evalf(ca.jacobian(ca.vec(p.states), u))).reshape(
        s.N + 1, 4, 2 * s.N
    )
    to_positions, on_speed = map_of[: s.N_h + 1, :2], multipliers[p.n_cbf : n_rows]
    curvature = scale * ca.evalf(ca.jacobian(gradient, u))
    gauss = ca.cse(ca.tril2symm(ca.tril(curvature + _hessian_of_speed(s, on_speed))))
    merit = ca.vertcat(cost, violation, on_rows, ca.norm_inf(on_speed))
    lower = ca.vertcat(-s.a_max - u, -values)
    upper = ca.vertcat(s.a_max - u, ca.inf * ca.SX.ones(n_rows), -p.terminal)
    of_barriers = _slopes(p, s), _bends(p, s, multipliers, to_positions)
    others = ca.cse(ca.jacobian(values[p.n_cbf :], u)).T
    outputs = [merit, lower, upper, scale * gradient, gauss, *of_barriers, others]
    derive = dense_function("derive", arguments, outputs)

    step, share = ca.SX.sym("d", u.numel()), ca.SX.sym("s")
    trial = ca.fmax(-s.a_max, ca.fmin(u + share * step, s.a_max))
    found = [cost, violation, p.cost, slack, values, p.states, p.h.T]
    there = ca.Function("there", [u, p.parameters], found)
    *totals, values, states, h = there(trial, p.parameters)
    merit = ca.vertcat(
        *totals, ca.norm_inf(step), ca.norm_inf(is_hard * multipliers), on_rows
    )
    measure = dense_function(
        "measure", [*arguments, step, share], [merit, trial, values, states, h]
    )
    if p.terminal.numel():
        return SqpFunctions(derive, measure, None, to_positions, p.n_cbf)
    given = p.parameters[:10]
    to_inputs, to_given = (ca.evalf(ca.jacobian(gradient, by)) for by in (u, given))
    free = -ca.solve(to_inputs, to_given) @ given
    beyond = ca.sum1(ca.fmax(0, ca.fabs(free) - s.a_max))
    violated = ca.Function("violated", [u, p.parameters], [ca.sum1(p.violations)])
    free_plan = dense_function(
        "unbound", [p.parameters], [free, beyond + violated(free, p.parameters)]
    )
    return SqpFunctions(derive, measure, free_plan, to_positions, p.n_cbf)


def _slopes(p: Problem, s: MPCSettings) -> Any:
    """For each step and barrier the slope of its row by the positions at the end and at the start, 4 numbers.

    The first start is given, and its slope is taken as 0: it may be infinite, on the focus of a zone.
    """
    none = ca.SX(p.h.shape[0], 1)
    ends = [slope[:, 1:] for slope in p.slope]
    starts = [ca.horzcat(none, -p.kept[:, 1:] * slope[:, 1:-1]) for slope in p.slope]
    return ca.horzcat(
        *(ca.horzcat(*(of[:, k] for of in ends + starts)).T for k in range(s.N_h))
    )


def _hessian_of_speed(s: MPCSettings, multipliers: Any) -> Any:
    """Hessian by the inputs of the speed rows, weighted by their multipliers."""
    # V_k' V_k is dt_i dt_j for inputs i and j before k: the later of the two says which rows have both.
    lengths = s.dt * np.array(s.step_lengths)
    later = np.maximum.outer(range(s.N), range(s.N)).ravel(order="F")
    after = ca.DM(np.triu(np.ones((s.N, s.N)))) @ multipliers
    of_one_axis = ca.reshape((-2 * after)[later.tolist()], s.N, s.N) * np.outer(
        lengths, lengths
    )
    return ca.kron(of_one_axis, ca.DM.eye(2))


def _bends(p: Problem, s: MPCSettings, multipliers: Any, to_positions: Array) -> Any:
    """S_k P_k of each step k, by the position at its end: S_k is weighted by the multipliers of the rows."""
    # h_k is in two rows: with lambda_{k-1}, where a step ends, and -kept_k lambda_k, where the next begins.
    on_rows, none = (
        ca.reshape(multipliers[: p.n_cbf], s.N_h, p.h.shape[0]).T,
        ca.SX(p.h.shape[0], 1),
    )
    weights = on_rows - ca.horzcat((p.kept * on_rows)[:, 1:], none)
    xx, xy, yy = (ca.sum1(weights * bend[:, 1:]) for bend in p.bend)
    bends = [ca.blockcat([[xx[k], xy[k]], [xy[k], yy[k]]]) for k in range(s.N_h)]
    return ca.horzcat(
        *((bends[k] @ ca.sparsify(ca.DM(to_positions[k + 1]))).T for k in range(s.N_h))
    )
