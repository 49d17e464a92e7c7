"""The CasADi functions of the SQP: the quadratic program, the merit of a step, the unconstrained plan.

The derivatives follow from the structure of the problem. Positions and velocities are constant linear maps
of the inputs, p = P u + ... and v = V u + ...; a barrier row depends on two positions, a speed row on one
velocity. So with g_k and S_k the gradient and the Hessian of h by the position in state k,

    row of the Jacobian    g_{k+1}' P_{k+1} - (1 - gamma)^m g_k' P_k,     -2 v_k' V_k
    Hessian                curvature of the cost + sum_k -2 lambda_k V_k' V_k + sum_k P_k' S_k P_k

with S_k summed over people and walls, weighted by their multipliers. Without its last sum it is that of a
Gauss-Newton step.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from ..problem import Problem, build_problem, dense_function, remaining_distance
from ..settings import MPCSettings


class SqpFunctions(NamedTuple):
    """Four functions of CasADi.

    The scaled cost is that for each metre to the target, at least one, and the price of violated rows that
    have one. Violation and multipliers are those of the hard rows.

    Attributes
    ----------
    derive : (inputs, parameters, multipliers) -> (scaled cost, violation, largest multiplier of a row, of a
        speed row), lower and upper bounds, gradient, Jacobian, Hessian of the Lagrangian, and that Hessian
        without the curvature of the barriers.
    measure : (inputs, parameters, multipliers, step, share) -> (scaled cost, violation, cost, slack, largest
        element of the step, largest multiplier, largest of a row), inputs, values of the rows and of the
        terminal condition, states and h, all after this share of the step.
    free : parameters -> the inputs of smallest cost without any row or bound, and the sum of their
        violations; None if there is a terminal condition.
    prices : parameters -> the price of each row.
    """

    derive: Any
    measure: Any
    free: Any
    prices: Any


@lru_cache(maxsize=256)
def build_sqp_functions(settings: MPCSettings, n_people: int, n_walls: int) -> SqpFunctions:
    """Build the functions for `settings`, `n_people` and `n_walls`, or reuse them."""
    p, s = build_problem(settings, n_people, n_walls), settings
    u, n_rows = p.inputs, p.rows.numel()
    scale = 1 / remaining_distance(*(p.parameters[i] for i in (0, 1, 4, 5)))
    gradient, is_hard = ca.gradient(p.cost, u), p.is_hard(s)
    values = ca.vertcat(p.rows, p.terminal)
    of_hard, of_priced = is_hard * p.violations, (1 - is_hard[:n_rows]) * p.violations[:n_rows]
    cost = scale * p.cost + ca.dot(p.prices, of_priced)
    violation, slack = ca.sum1(of_hard), ca.mmax(of_hard)
    multipliers = ca.SX.sym("multiplier", values.numel())
    on_rows = ca.norm_inf(multipliers[:n_rows])
    arguments = [u, p.parameters, multipliers]

    map_of = np.asarray(ca.evalf(ca.jacobian(ca.vec(p.states), u))).reshape(s.N + 1, 4, s.N, 2)
    to_position, to_velocity = map_of[: s.N_h + 1, 0, :, 0], map_of[1:, 2, :, 0]
    curvature = scale * ca.evalf(ca.jacobian(gradient, u))
    of_speed, of_barriers = _hessians(p, s, multipliers, to_position)
    gauss = ca.cse(ca.tril(curvature + of_speed))
    exact = gauss + ca.tril(of_barriers)
    merit = ca.vertcat(cost, violation, on_rows, ca.norm_inf(multipliers[p.n_cbf : n_rows]))
    lower = ca.vertcat(-s.a_max - u, -values)
    upper = ca.vertcat(s.a_max - u, ca.inf * ca.SX.ones(n_rows), -p.terminal)
    jacobian = _jacobian(p, s, to_position, to_velocity)
    hessians = ca.tril2symm(exact), ca.tril2symm(gauss)
    outputs = [merit, lower, upper, scale * gradient, jacobian.T, *hessians]
    derive = dense_function("derive", arguments, outputs)

    step, share = ca.SX.sym("d", u.numel()), ca.SX.sym("s")
    trial = ca.fmax(-s.a_max, ca.fmin(u + share * step, s.a_max))
    found = [cost, violation, p.cost, slack, values, p.states, p.h.T]
    there = ca.Function("there", [u, p.parameters], found)
    *totals, values, states, h = there(trial, p.parameters)
    merit = ca.vertcat(*totals, ca.norm_inf(step), ca.norm_inf(is_hard * multipliers), on_rows)
    measure = dense_function("measure", [*arguments, step, share], [merit, trial, values, states, h])
    prices = dense_function("prices", [p.parameters], [p.prices])
    if p.terminal.numel():
        return SqpFunctions(derive, measure, None, prices)
    given = p.parameters[:10]
    to_inputs, to_given = (ca.evalf(ca.jacobian(gradient, by)) for by in (u, given))
    free = -ca.solve(to_inputs, to_given) @ given
    beyond = ca.sum1(ca.fmax(0, ca.fabs(free) - s.a_max))
    violated = ca.Function("violated", [u, p.parameters], [ca.sum1(p.violations)])
    free_plan = dense_function("unbound", [p.parameters], [free, beyond + violated(free, p.parameters)])
    return SqpFunctions(derive, measure, free_plan, prices)


def _jacobian(p: Problem, s: MPCSettings, to_position: Any, to_velocity: Any) -> Any:
    """Jacobian of the rows and the terminal condition by the inputs, shape (rows, 2N)."""
    maps, n = [ca.sparsify(ca.DM(row[None])) for row in to_position], p.h.shape[0]
    by_axis = []
    for slope in p.slope:
        slopes = ca.horzsplit(slope)
        ends = [slopes[k + 1] @ maps[k + 1] - (p.kept[:, k] * slopes[k]) @ maps[k] for k in range(s.N_h)]
        by_axis.append(ca.vertcat(*ends))
    rows = np.arange(s.N_h * n).reshape(s.N_h, n).T.ravel()
    columns = np.arange(2 * s.N).reshape(2, s.N).T.ravel()
    velocities = ca.diagcat(*(-2 * p.states[2:, k].T for k in range(1, s.N + 1)))
    blocks = [
        ca.horzcat(*by_axis)[rows.tolist(), columns.tolist()],
        ca.cse(velocities @ _for_x_and_y(to_velocity)),
    ]
    if p.terminal.numel():
        blocks.append(_for_x_and_y(to_velocity[-1:]))
    return ca.vertcat(*blocks)


def _hessians(p: Problem, s: MPCSettings, multipliers: Any, to_position: Any) -> tuple[Any, Any]:
    """Hessians by the inputs of the speed rows and of the barrier rows, each weighted by its multipliers."""
    # V_k' V_k is dt_i dt_j for inputs i and j before k: the later of the two says which rows have both.
    lengths = s.dt * np.array(s.step_lengths)
    later = np.maximum.outer(range(s.N), range(s.N)).ravel(order="F")
    on_speed = multipliers[p.n_cbf : p.n_cbf + s.N]
    after = ca.DM(np.triu(np.ones((s.N, s.N)))) @ on_speed
    of_speed = ca.reshape((-2 * after)[later.tolist()], s.N, s.N) * np.outer(lengths, lengths)
    # h_k is in two rows: with lambda_{k-1}, where a step ends, and -kept_k lambda_k, where the next begins.
    on_rows, none = ca.reshape(multipliers[: p.n_cbf], s.N_h, p.h.shape[0]).T, ca.SX(p.h.shape[0], 1)
    weights = ca.horzcat(none, on_rows) - ca.horzcat(p.kept * on_rows, none)
    xx, xy, yy = (ca.sum1(weights * bend) for bend in p.bend)
    bends = [ca.blockcat([[xx[k], xy[k]], [xy[k], yy[k]]]) for k in range(s.N_h + 1)]
    to_xy = _for_x_and_y(to_position)
    return ca.kron(of_speed, ca.DM.eye(2)), to_xy.T @ ca.diagcat(*bends) @ to_xy


def _for_x_and_y(one: Any) -> Any:
    """The linear map `one` of an axis, for x and y in turn."""
    return ca.kron(ca.sparsify(ca.DM(one)), ca.DM.eye(2))
