"""The problem of a step by IPOPT, the paper's solver, written anew from eq. 1, 2 and 8: a referee of szlib's plans."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from math import inf
from typing import Any

import casadi as ca
import numpy as np

import szlib
from szlib.control.planner import Plan
from szlib.control.problem import Question
from szlib.control.step import Scene
from szlib.control.ways import Heading
from szlib.core.checks import Array

OPTIONS: dict[str, Any] = {
    "mu_init": 1e-2,
    "bound_push": 1e-3,
    "bound_frac": 1e-3,
    "bound_mult_init_method": "mu-based",
    "barrier_tol_factor": 1e3,
    "mu_linear_decrease_factor": 0.02,
    "mu_superlinear_decrease_power": 1.9,
    "alpha_for_y": "min-dual-infeas",
    "fast_step_computation": "yes",
    "min_refinement_steps": 0,
}
"""The start is near the solution, and the problem nearly quadratic: so IPOPT needs 0.65 of its usual time."""


class ByIpopt(szlib.MPCCBF):
    """A controller with the plans of IPOPT, and of szlib where IPOPT finds none; parameters: of `MPCCBF`, and of IPOPT."""

    def __init__(self, zone: Any, *, options: dict[str, Any] = OPTIONS, **given: Any) -> None:
        super().__init__(zone, **given)
        self._options = tuple(options.items())

    def _refine(self, scene: Scene, headings: Sequence[Heading]) -> tuple[Heading, Question, Plan]:
        last = self._plan[0] if self._clock.has_begun else np.zeros(2)
        question = Question(scene.state, headings[0].target, last, scene.barriers)
        asked = np.concatenate(question[:3])
        inputs = solve(self._s, scene, asked, self._plan + self._change, self._options)
        if inputs is None:
            return super()._refine(scene, headings)
        return headings[0], question, Plan(inputs, 0.0, (), False, False)


def solve(
    s: szlib.MPCSettings, scene: Scene, asked: Array, guess: Array, options: tuple[Any, ...] = ()
) -> Array | None:
    """The inputs that satisfy every row and cost least, shape (N, 2) [m/s2]; None if IPOPT finds none.

    `asked` are the state, the target and the last input, shape (8,); `guess` are inputs to begin with.
    """
    groups = scene.barriers.groups
    shapes = tuple((kind, *numbers.shape) for kind, numbers, _ in groups)
    numbers = [np.column_stack(group[1:]).ravel() for group in groups]
    solver = _build(s, shapes, options)
    upper = np.full(solver.numel_out("g"), inf)
    if s.terminal == "rest":
        upper[-2:] = 0.0
    start = guess.clip(-s.a_max, s.a_max).ravel()
    given = np.concatenate([asked, *numbers])
    found = solver(x0=start, p=given, lbx=-s.a_max, ubx=s.a_max, lbg=0, ubg=upper)
    inputs = np.asarray(found["x"]).ravel().clip(-s.a_max, s.a_max)
    return inputs.reshape(-1, 2) if solver.stats()["success"] else None


@lru_cache
def _build(s: szlib.MPCSettings, shapes: tuple[Any, ...], options: tuple[Any, ...]) -> Any:
    """The problem in symbols, and its solver; `shapes` of the tables of obstacles: kind, number, and columns."""
    u, asked = ca.SX.sym("u", 2, s.N), ca.SX.sym("asked", 8)
    x, target, before = [asked[:4]], ca.vertcat(asked[4:6], 0, 0), asked[6:]
    cost, rows, tables = 0.0, [], []
    for k, m in enumerate(s.step_lengths):
        dt, a = m * s.dt, u[:, k]
        velocity = x[-1][2:]
        x.append(x[-1] + ca.vertcat(dt * velocity + dt**2 / 2 * a, dt * a))
        weights = np.array(s.P) if k + 1 == s.N else m * np.array(s.Q)
        cost += ca.dot(weights, (x[-1] - target) ** 2) + m * ca.dot(np.array(s.R), a**2)
        cost += s.jerk_weight / m * ca.sumsqr(a - before)
        rows.append(s.v_max**2 - ca.sumsqr(x[-1][2:]))
        before = a
    for kind, n, columns in shapes:
        table = ca.SX.sym("table", columns + 1, n)
        tables.append(ca.vec(table))
        for i in range(n):
            *numbers, offset = ca.vertsplit(table[:, i])
            h = [
                kind.distance(p[0], p[1], t, *numbers) - offset
                for p, t in zip(x, s.times.tolist(), strict=True)
            ]
            rows += [h[k + 1] - (1 - s.gamma) ** s.step_lengths[k] * h[k] for k in range(s.N_h)]
    if s.terminal == "rest":
        rows.append(x[-1][2:])
    problem = {"x": ca.vec(u), "p": ca.vertcat(asked, *tables), "f": cost, "g": ca.vertcat(*rows)}
    quiet = {"print_level": 0, "sb": "yes", "max_iter": s.max_iterations}
    calls = {"expand": True, "print_time": False, "calc_lam_p": False, "show_eval_warnings": False}
    return ca.nlpsol("problem", "ipopt", problem, calls | {"ipopt": quiet | dict(options)})
