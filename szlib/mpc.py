"""The controller: model predictive control with barriers around people and walls (MPC-CBF).

    min over u_0 .. u_{N-1}
        (x_N - g)' P (x_N - g) + sum_{k=1}^{N-1} (x_k - g)' Q (x_k - g) + sum_{k=0}^{N-1} u_k' R u_k
    subject to
        x_{k+1} = A x_k + B u_k,  x_0 given                           double integrator   (paper, eq. 8)
        -a_max <= u_k <= a_max                                        acceleration        k = 0 .. N-1
        |(vx, vy)_k|^2 <= v_max^2                                     Euclidean speed     k = 1 .. N
        h_i(x_{k+1}, k+1) - (1 - gamma) h_i(x_k, k) >= 0              every person, wall  k = 0 .. N_h-1

(paper, eq. 1-2), where x = (x, y, vx, vy), u = (ax, ay), and h_i(., k) takes person i at constant
velocity, k steps ahead. `g` is the goal at rest, but for meetings head-on (`steer`). The states are
eliminated: 2 N unknowns remain. The *relaxed* problem adds a slack s >= 0 to each barrier row, and
to the speed rows if the robot is already too fast, and penalises their sum: exactly, so wherever
the hard problem has a solution near by, both have the same one.

`Problem` is the definition, in symbols; what solves it (here IPOPT, as in the paper) only reads it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from time import perf_counter
from typing import Any, Literal, cast

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from .barriers import (
    Array,
    barrier,
    cbf_residual,
    check_wall,
    ellipse_distance,
    ellipse_formula,
    finite,
    segment_distance,
    segment_formula,
)
from .ellipses import Ellipse
from .errors import SolverError
from .meetings import Person, SpeedZone, as_ellipse, steer
from .settings import MPCSettings

__all__ = ["MPCCBF", "MPCSettings", "Person", "Step"]

Status = Literal["optimal", "relaxed", "braking"]
TOLERANCE = 1e-6
"""Largest violation of a hard row, in its own unit, that still counts as satisfied."""


@dataclass(frozen=True)
class Step:
    """What the controller decided, and how far it can be relied upon.

    Attributes
    ----------
    control : acceleration (ax, ay) to apply now, within its bounds, shape (2,) [m/s2].
    predicted : states x_0 .. x_N of the plan, shape (N+1, 4) [m, m/s].
    status : "optimal": a solver converged and every hard row holds; "relaxed": the hard problem was
        not solved, and the plan violates it by `slack`; "braking": no solver converged, full braking.
    slack : largest violation of a hard row by the plan, 0 if none [m for barriers, m2/s2 for speed].
    residual : h_{k+1} - (1-gamma) h_k, people before walls, shape (people + walls, N_h) [m].
    h : barriers in the state itself, people before walls, shape (people + walls,) [m]; where one is
        negative, the robot already is where it should not be, and the plan leads out again.
    target : where the plan is drawn to: the goal, but for a meeting head-on, shape (2,) [m].
    cost : the cost of the plan, without any penalty.
    solve_time : wall-clock time of the whole step [s].
    """

    control: Array
    predicted: Array
    status: Status
    slack: float
    residual: Array
    h: Array
    target: Array
    cost: float
    solve_time: float

    @property
    def safe(self) -> bool:
        """True if the plan satisfies the hard problem, from a state that satisfies every barrier."""
        return self.status == "optimal" and bool((self.h >= -TOLERANCE).all())


@dataclass(frozen=True)
class Problem:
    """The optimal control problem in symbols, for so many people and walls; rows are meant >= 0.

    `parameters` stacks the state (4), the target (2), then for each person the foci and a of the zone
    and the velocity (7), then the end points of each wall (4).
    """

    inputs: Any
    parameters: Any
    states: Any
    cost: Any
    cbf: Any
    speed: Any


@lru_cache(maxsize=64)
def build_problem(settings: MPCSettings, n_people: int, n_walls: int) -> Problem:
    """Write down the problem of this module's docstring; once for each size and settings."""
    s = settings
    inputs, start, target = ca.SX.sym("u", 2, s.N), ca.SX.sym("x0", 4), ca.SX.sym("target", 2)
    people, walls = ca.SX.sym("person", 7, n_people), ca.SX.sym("wall", 4, n_walls)

    states = [start]
    for k in range(s.N):
        position, velocity, u = states[-1][:2], states[-1][2:], inputs[:, k]
        states.append(ca.vertcat(position + s.dt * velocity + 0.5 * s.dt**2 * u, velocity + s.dt * u))

    error = [x - ca.vertcat(target, 0, 0) for x in states]
    cost = ca.dot(ca.DM(s.P), error[s.N] ** 2)
    cost += sum(ca.dot(ca.DM(s.Q), error[k] ** 2) for k in range(1, s.N))
    cost += sum(ca.dot(ca.DM(s.R), inputs[:, k] ** 2) for k in range(s.N))

    near = list(enumerate(states[: s.N_h + 1]))
    distances = []
    for i in range(n_people):
        xa, ya, xb, yb, a, vx, vy = ca.vertsplit(people[:, i])
        seen = [(x[0] - k * s.dt * vx, x[1] - k * s.dt * vy) for k, x in near]
        distances.append([ellipse_formula(x, y, xa, ya, xb, yb, a) for x, y in seen])
    for j in range(n_walls):
        distances.append([segment_formula(x[0], x[1], *ca.vertsplit(walls[:, j])) for _, x in near])
    h = [[barrier(d, s.r_robot, s.eps) for d in row] for row in distances]
    cbf = [cbf_residual(row[k + 1], row[k], s.gamma) for row in h for k in range(s.N_h)]

    return Problem(
        inputs=ca.vec(inputs),
        parameters=ca.vertcat(start, target, ca.vec(people), ca.vec(walls)),
        states=ca.horzcat(*states),
        cost=cost,
        cbf=ca.vertcat(*cbf),
        speed=ca.vertcat(*(s.v_max**2 - ca.sumsqr(x[2:]) for x in states[1:])),
    )


_IPOPT = {
    "print_level": 0,
    "sb": "yes",
    # The start is close to the solution: the plan of the step before, shifted.
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
"""Measured on the approach to a person: 7 iterations instead of 9.4, in 0.65 of the time."""


@dataclass(frozen=True)
class Ipopt:
    """IPOPT behind a `Problem`: the hard and the relaxed one, and the numbers of a given plan."""

    settings: MPCSettings
    n_cbf: int
    hard: Any
    relaxed: Any
    evaluate: Any

    @staticmethod
    @lru_cache(maxsize=64)
    def build(settings: MPCSettings, n_people: int, n_walls: int) -> Ipopt:
        """The solver of `build_problem(...)`; built once for each size and settings."""
        p = build_problem(settings, n_people, n_walls)
        options: dict[str, Any] = {"expand": True, "print_time": False, "calc_lam_p": False}
        options["show_eval_warnings"] = False  # a failure is told by `Step.status`
        options |= {f"ipopt.{name}": value for name, value in _IPOPT.items()}
        options["ipopt.max_iter"] = settings.max_iterations
        rows = ca.vertcat(p.cbf, p.speed)
        # Slack counted by its penalty, in the unit of the cost: IPOPT would scale the rest away.
        penalty, weight = ca.SX.sym("penalty", rows.numel()), ca.SX.sym("weight")
        hard = {"x": p.inputs, "p": p.parameters, "f": p.cost, "g": rows}
        relaxed = {
            "x": ca.vertcat(p.inputs, penalty),
            "p": ca.vertcat(p.parameters, weight),
            "f": p.cost + ca.sum1(penalty),
            "g": rows + penalty / weight,
        }
        return Ipopt(
            settings=settings,
            n_cbf=p.cbf.numel(),
            hard=ca.nlpsol("hard", "ipopt", hard, options),
            relaxed=ca.nlpsol("relaxed", "ipopt", relaxed, options),
            evaluate=ca.Function("evaluate", [p.inputs, p.parameters], [p.cost, rows, p.states]),
        )

    def solve_hard(self, guess: Array, parameters: Array) -> tuple[Array, bool]:
        """Inputs, shape (2N,), and whether IPOPT says that it converged."""
        a_max = self.settings.a_max
        found = self.hard(x0=guess, p=parameters, lbx=-a_max, ubx=a_max, lbg=0, ubg=np.inf)
        return self._inputs(found), bool(self.hard.stats()["success"])

    def solve_relaxed(self, guess: Array, parameters: Array) -> tuple[Array, bool]:
        """The same for the problem with penalised slack."""
        s, speed = self.settings, np.hypot(*parameters[2:4])
        rows = np.asarray(self.evaluate(guess, parameters)[1]).ravel()
        free = np.r_[np.ones(self.n_cbf), np.full(s.N, speed > s.v_max)]
        weight = s.slack_weight * max(1.0, np.hypot(*(parameters[4:6] - parameters[:2])))
        found = self.relaxed(
            x0=np.r_[guess, np.maximum(-rows, 0) * free * weight],
            p=np.r_[parameters, weight],
            lbx=np.r_[np.full(guess.size, -s.a_max), np.zeros(rows.size)],
            ubx=np.r_[np.full(guess.size, s.a_max), np.where(free > 0, np.inf, 0.0)],
            lbg=0,
            ubg=np.inf,
        )
        return self._inputs(found), bool(self.relaxed.stats()["success"])

    def _inputs(self, found: dict[str, Any]) -> Array:
        inputs = np.asarray(found["x"]).ravel()[: 2 * self.settings.N]
        return np.asarray(np.clip(inputs, -self.settings.a_max, self.settings.a_max))


class MPCCBF:
    """Drives a double integrator to a goal, outside the social zones of people and clear of walls.

    Parameters
    ----------
    zone : the social zone of a person, in the person's frame [m]; or anything with `.ellipse(speed)`,
        such as a `SocialZone`, which is asked for `settings.zone_speed`.
    walls : segments, shape (n, 2, 2): end points [m].
    settings : every other parameter.

    Raises
    ------
    SolverError : a wall is not finite or has no length.
    ZoneError : `zone` is no zone.
    """

    def __init__(
        self,
        zone: Ellipse | SpeedZone,
        *,
        walls: ArrayLike | Sequence[ArrayLike] = (),
        settings: MPCSettings | None = None,
    ) -> None:
        self.settings = settings or MPCSettings()
        self.zone = as_ellipse(zone, self.settings.zone_speed)
        ends = [check_wall(wall) for wall in cast(Sequence[ArrayLike], walls)]
        self.walls = np.reshape(np.array(ends, float), (-1, 2, 2))
        self.reset()

    def reset(self) -> None:
        """Forget the last plan and goal: what follows depends on nothing that went before."""
        self._plan = np.zeros(2 * self.settings.N)
        self._goal: Array | None = None

    def step(self, state: ArrayLike, goal: ArrayLike, people: Sequence[Person] = ()) -> Step:
        """The acceleration to apply for the next `dt`.

        The ladder: the hard problem from the last plan, shifted; the relaxed problem; full braking.
        A goal is checked when it is new; from then on a moving robot always gets a control.

        Parameters
        ----------
        state : (x, y, vx, vy) [m, m/s].
        goal : (x, y) [m].
        people : everybody to be respected now.

        Raises
        ------
        SolverError : a number is not finite, a shape is wrong, or a new goal cannot be reached,
            because it lies too close to a wall or in the zone of somebody who stands.
        """
        began = perf_counter()
        x = finite("state", state, (4,))
        g = finite("goal", goal, (2,))
        placed = self.placed_zones(people)
        if self._goal is None or not np.array_equal(g, self._goal):
            self._check_goal(g, people)
            self._goal = g.copy()

        target = steer(x, g, placed, people, self.walls, self.settings)
        zones = [(*z.foci.ravel(), z.semi_axes[0], *p.velocity) for z, p in zip(placed, people, strict=True)]
        parameters = np.concatenate([x, target, *zones, self.walls.ravel()])
        solver = Ipopt.build(self.settings, len(people), len(self.walls))

        guess = np.r_[self._plan[2:], self._plan[-2:]]
        plan, status, numbers = self._solve(solver, guess, parameters)
        self._plan = plan
        cost, rows, states = numbers
        return Step(
            control=plan[:2].copy(),
            predicted=states,
            status=status,
            slack=float(max(0.0, -rows.min())),
            residual=rows[: solver.n_cbf].reshape(-1, self.settings.N_h),
            h=self._h(x[:2], placed),
            target=target,
            cost=cost,
            solve_time=perf_counter() - began,
        )

    def _solve(
        self, solver: Ipopt, guess: Array, parameters: Array
    ) -> tuple[Array, Status, tuple[float, Array, Array]]:
        for solve in (solver.solve_hard, solver.solve_relaxed):
            plan, converged = solve(guess, parameters)
            if converged and np.isfinite(plan).all():
                numbers = _numbers(solver, plan, parameters)
                if numbers[1].min() >= -TOLERANCE:
                    return plan, "optimal", numbers
                if solve == solver.solve_relaxed:
                    return plan, "relaxed", numbers
        plan = self._brake(parameters[2:4])
        return plan, "braking", _numbers(solver, plan, parameters)

    def _brake(self, velocity: Array) -> Array:
        """The inputs that bring the robot to rest soonest along its path, shape (2N,) [m/s2]."""
        s, v, plan = self.settings, velocity.copy(), []
        for _ in range(s.N):
            u = -v / max(s.dt, float(np.abs(v).max()) / s.a_max)
            v = v + s.dt * u
            plan.append(u)
        return np.concatenate(plan)

    def placed_zones(self, people: Sequence[Person]) -> list[Ellipse]:
        """The zone of each person, in the world frame."""
        speed = self.settings.zone_speed
        zones = [self.zone if p.zone is None else as_ellipse(p.zone, speed) for p in people]
        return [z.placed(p.position, cast(float, p.heading)) for z, p in zip(zones, people, strict=True)]

    def barriers(self, position: ArrayLike, people: Sequence[Person] = ()) -> Array:
        """h of every person and then of every wall at a position, shape (people + walls,) [m]."""
        return self._h(finite("position", position, (2,)), self.placed_zones(people))

    def _h(self, point: Array, placed: Sequence[Ellipse]) -> Array:
        distances = [ellipse_distance(point, zone) for zone in placed]
        distances += [segment_distance(point, *wall) for wall in self.walls]
        return np.asarray(barrier(np.array(distances, float), self.settings.r_robot, self.settings.eps))

    def _check_goal(self, goal: Array, people: Sequence[Person]) -> None:
        standing = [p for p in people if p.stands]
        h = self.barriers(goal, standing)
        if (h < 0).any():
            i = int(h.argmin())
            if i < len(standing):
                what = f"in the zone of the person who stands at {standing[i].position}"
            else:
                what = f"too close to the wall {self.walls[i - len(standing)].tolist()}"
            raise SolverError(
                f"the goal {goal.tolist()} cannot be reached: it lies {what} (h = {h[i]:.3f} m); "
                "choose one where h >= 0"
            )


def _numbers(solver: Ipopt, plan: Array, parameters: Array) -> tuple[float, Array, Array]:
    """Cost, hard rows and states (N+1, 4) of a plan, calculated without the solver."""
    cost, rows, states = solver.evaluate(plan, parameters)
    return float(cost), np.asarray(rows).ravel(), np.asarray(states).T
