"""The problem of a step in symbols and matrices: motion, cost, limits, and the conditions on obstacles.

`szlib.control.planner` states the problem.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from math import hypot, inf
from threading import Lock
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from ..core.checks import Array
from .obstacles import Group, Obstacle, Obstacles, Priority
from .settings import TOLERANCE, MPCSettings


class Question(NamedTuple):
    """What a plan is made for.

    Attributes
    ----------
    state : (x, y, vx, vy) of the robot [m, m/s].
    target : (x, y), which attracts the plan [m].
    last : control of the step before [m/s2].
    barriers : everything with a barrier condition.
    """

    state: Sequence[float]
    target: Sequence[float]
    last: Sequence[float]
    barriers: Obstacles


@lru_cache
def build_motion(settings: MPCSettings) -> tuple[Any, ...]:
    """The motion of a double integrator, and the cost of a plan, for these `settings`, in symbols.

    Returns
    -------
    inputs : u_0 .. u_{N-1}, shape (2, N).
    given : the state, the target, and the last input, 8 numbers.
    states : x_0 .. x_N, shape (4, N+1).
    cost : of the plan.
    """
    s = settings
    inputs = ca.SX.sym("u", 2, settings.N)
    given = ca.SX.sym("given", 8)
    states = [given[:4]]
    for k, length in enumerate(s.step_lengths):
        position = states[-1][:2]
        velocity = states[-1][2:]
        a = inputs[:, k]
        dt = length * s.dt
        moved = position + dt * velocity + 0.5 * dt**2 * a
        states.append(ca.vertcat(moved, velocity + dt * a))
    x = ca.horzcat(*states)
    lengths = np.array(s.step_lengths, float)
    weights = ca.DM(np.column_stack([np.zeros(4), np.outer(s.Q, lengths[:-1]), s.P]))
    error = x - ca.repmat(ca.vertcat(given[4:6], 0, 0), 1, s.N + 1)
    cost = ca.dot(weights, error**2) + ca.dot(ca.DM(np.outer(s.R, lengths)), inputs**2)
    change = inputs - ca.horzcat(given[6:], inputs[:, :-1])
    by_jerk = np.outer((s.jerk_weight, s.jerk_weight), 1 / lengths)
    cost += ca.dot(ca.DM(by_jerk), change**2)
    return inputs, given, x, cost


class Horizon(NamedTuple):
    """The states are linear in the inputs of each axis.

    Attributes
    ----------
    times : of the states, shape (N+1,) [s].
    to_positions, to_velocities : of x_1 .. x_N, shape (N, N).
    """

    times: Array
    to_positions: Array
    to_velocities: Array

    def states(self, state: Array, inputs: Array) -> Array:
        """States x_0 .. x_N, shape (N+1, 4), from a `state` by `inputs`, shape (N, 2)."""
        states = np.empty((len(self.times), 4))
        states[0] = state
        ahead = self.times[1:, None] * state[2:]
        states[1:, :2] = state[:2] + ahead + self.to_positions @ inputs
        states[1:, 2:] = state[2:] + self.to_velocities @ inputs
        return states


@lru_cache
def build_horizon(settings: MPCSettings) -> Horizon:
    """The matrices of the motion for these `settings`."""
    times = settings.times
    past = np.tri(settings.N)
    dt = np.diff(times)
    ends = times[1:]
    return Horizon(times, past * dt * (ends[:, None] - ends + dt / 2), past * dt)


def follow_velocities(
    s: MPCSettings, velocity: Sequence[float], targets: Array
) -> Array:
    """Inputs with which a robot reaches the velocities `targets` as nearly as it can, shape (N, 2) [m/s2].

    Each change of velocity has the direction of its target. The robot is at no time too fast; one that is too
    fast now slows down as it can.

    Parameters
    ----------
    s : settings of the controller.
    velocity : of the robot now [m/s].
    targets : velocities at the end of each step, shape (N, 2) [m/s].
    """
    # complex numbers: velocities vx + i vy
    v = complex(*velocity)
    slowest = hypot(*velocity)
    plan = list[complex]()
    wanted = (targets @ (1, 1j)).tolist()
    times = s.times[1:].tolist()
    for w, length, time in zip(wanted, s.step_lengths, times, strict=True):
        dt = s.dt * length
        limit = max(s.v_max, slowest - s.a_max * time)
        change = min(1.0, limit / (hypot(w.real, w.imag) or 1.0)) * w - v
        seconds = max(dt, abs(change.real) / s.a_max, abs(change.imag) / s.a_max)
        plan.append(change / seconds)
        v += dt * change / seconds
    return np.array(plan).view(float).reshape(-1, 2).clip(-s.a_max, s.a_max)


def plan_braking(s: MPCSettings, velocity: Sequence[float]) -> Array:
    """Inputs that bring the robot from `velocity` to rest soonest on its path, within `s`, shape (N, 2)."""
    return follow_velocities(s, velocity, np.zeros((s.N, 2)))


class Condition(NamedTuple):
    """A condition on h of an obstacle: h_{k+1} >= keep_k h_k, for each k.

    Attributes
    ----------
    level : its priority.
    keep : share of h to be kept, one for each k.
    """

    level: Priority
    keep: tuple[float, ...]


@lru_cache
def list_conditions(
    settings: MPCSettings, kind: type[Obstacle], has_floors: bool
) -> tuple[Condition, ...]:
    """The conditions on an obstacle of a `kind` by the `settings`.

    With the floors of `szlib.control.planner` if it `has_floors`.
    """
    s = settings
    lengths = s.step_lengths
    if not kind.has_barrier:
        return (Condition(kind.priority, (0.0,) * s.N),)
    falls = tuple((1 - s.gamma) ** m for m in lengths[: s.N_h])
    decay = Condition(Priority.DECAY, falls)
    if not has_floors:
        return (decay,)
    if kind.priority > Priority.WALL:
        return decay, Condition(kind.priority, (0.0,) * s.N_h)
    stop = min(1.0, s.a_max * s.dt / s.v_max)
    floor = Condition(Priority.WALL, tuple((1 - stop) ** m for m in lengths))
    is_implied = stop <= s.gamma + TOLERANCE and s.N_h == s.N
    return (floor,) if is_implied else (decay, floor)


def _write_conditions(
    s: MPCSettings, kind: Any, has_floors: bool, numbers: Any, at: Any
) -> Any:
    """Values of the conditions on an obstacle of a `kind`, in symbols: satisfied where they are >= 0.

    Parameters
    ----------
    s, kind, has_floors : as of `list_conditions`.
    numbers : of the obstacle, and its offset.
    at : positions of the robot, shape (2, N+1).
    """
    *own, offset = ca.vertsplit(numbers)
    h = [
        kind.distance(at[0, k], at[1, k], time, *own) - offset
        for k, time in enumerate(s.times.tolist())
    ]
    conditions = list_conditions(s, kind, has_floors)
    found = [
        h[k + 1] - keep * h[k]
        for each in conditions
        for k, keep in enumerate(each.keep)
    ]
    return ca.vertcat(*found)


@lru_cache(maxsize=1024)
def _linearise_kind(
    settings: MPCSettings, kind: Any, has_floors: bool, n: int, count: int
) -> Any:
    """(positions, numbers and offsets) -> (bounds, slopes) of all conditions on `n` obstacles of a kind."""
    if n > 1:
        of_one = _linearise_kind(settings, kind, has_floors, 1, count)
        return of_one.map(n, [True, False], [False, False])
    at = ca.SX.sym("at", 2, settings.N + 1)
    numbers = ca.SX.sym("numbers", count + 1)
    values = _write_conditions(settings, kind, has_floors, numbers, at)
    # the first state is given
    moves = ca.DM(np.kron(build_horizon(settings).to_positions, np.eye(2)))
    slopes = (ca.jacobian(values, ca.vec(at[:, 1:])) @ ca.sparsify(moves)).T
    results = [-values, ca.densify(slopes)]
    return ca.Function("rows", [at, numbers], results, {"cse": True})


# Largest multiplier of the speed limit. Rows that contradict each other give huge ones, which would spoil
# the next steps.
_MOST_CURVED = 1e3


@lru_cache
def _linearise_motion(settings: MPCSettings) -> Any:
    """The part of a quadratic program without obstacles: see `LinearProblem`."""
    s = settings
    inputs, given, states, cost = build_motion(settings)
    horizon = build_horizon(s)
    u = ca.vec(inputs)
    n = s.N
    distance = ca.norm_2(given[4:6] - given[:2])
    multipliers = ca.SX.sym("speed", n)
    curved_by = ca.fmin(ca.fmax(-multipliers, 0), _MOST_CURVED)
    scale = 2 / (distance + 1 + ca.fabs(distance - 1))
    velocity = states[2:, 1:]
    # a robot that is too fast slows down as it can
    slowed = ca.norm_2(given[2:4]) - s.a_max * ca.DM(horizon.times[1:])
    limit = ca.fmax(s.v_max, slowed)
    speed = limit**2 - ca.sum1(velocity**2).T
    curved = ca.hessian(scale * cost - ca.dot(curved_by, speed), u)[0]
    if s.terminal == "rest":
        speed = ca.vertcat(speed, velocity[:, -1])
    is_end = np.arange(speed.numel()) >= n
    outputs = [
        states[:2, :],
        ca.vertcat(-s.a_max - u, -speed),
        ca.vertcat(s.a_max - u, ca.if_else(ca.DM(is_end), -speed, 1e30)),
        ca.jacobian(speed, u).T,
        curved,
        scale * ca.gradient(cost, u),
        scale * cost,
    ]
    arguments = [inputs, given, multipliers]
    dense = [ca.densify(each) for each in outputs]
    return ca.Function("motion", arguments, dense, {"cse": True})


class LinearProblem:
    """The problem linearised at a plan, in arrays that stay where they are: set `inputs`, then `evaluate`.

    The unknown is the change d of the inputs; the rows are the limits of d, the speed limits, rest at the
    end, and then the conditions on obstacles: lower <= slopes d <= upper, where the first 2 N slopes, of the
    limits, are left out: zeros.

    Parameters
    ----------
    settings : of the controller.
    shapes : kind, number and count of numbers of each group of obstacles.
    has_floors : as of `list_conditions`.

    Attributes
    ----------
    inputs, given, multipliers : of the plan, shape (N, 2); see `build_motion`; of the speed limits, negative
        where one holds. To be filled.
    lower, upper, slopes : of the rows.
    hessian, gradient, cost : of the Lagrangian and of the cost, for each metre to the target (at least 1 m).
    first : number of rows before those of obstacles.
    levels, steps : of each row of obstacles, its level and its k.
    """

    def __init__(
        self, settings: MPCSettings, shapes: tuple[Any, ...], has_floors: bool
    ) -> None:
        s = settings
        n = 2 * settings.N
        motion = _linearise_motion(settings)
        kinds = [kind for kind, number, _ in shapes for _ in range(number)]
        rows = [
            (condition.level, k)
            for kind in kinds
            for condition in list_conditions(s, kind, has_floors)
            for k in range(len(condition.keep))
        ]
        self.levels, self.steps = np.reshape(rows, (-1, 2)).astype(int).T
        self.first = motion.numel_out(1)
        size = self.first + len(rows)
        self.inputs = np.zeros((s.N, 2))
        self.given = np.zeros(8)
        self.multipliers = np.zeros(s.N)
        self.lower = np.zeros(size)
        self.upper = np.full(size, 1e30)
        self.slopes = np.zeros((size, n))
        self.hessian = np.zeros((n, n))
        self.gradient = np.zeros(n)
        self.cost = np.zeros(1)
        arguments = [self.inputs, self.given, self.multipliers]
        positions = np.zeros((s.N + 1, 2))
        begin = self.first
        results = [
            positions,
            self.lower,
            self.upper,
            self.slopes[n:],
            self.hessian,
            self.gradient,
            self.cost,
        ]
        self._calls = [_call(motion, arguments, results)]
        self._numbers = list[Array]()
        for kind, number, count in shapes:
            numbers = np.zeros((number, count + 1))
            function = _linearise_kind(s, kind, has_floors, number, count)
            results = [self.lower[begin:], self.slopes[begin:]]
            self._calls.append(_call(function, (positions, numbers), results))
            self._numbers.append(numbers)
            begin += function.numel_out(0)

    def take(self, groups: Sequence[Group]) -> None:
        """Take the numbers of `groups` of obstacles of these shapes."""
        for numbers, group in zip(self._numbers, groups, strict=True):
            numbers[:, :-1], numbers[:, -1] = group.numbers, group.offsets

    def evaluate(self) -> None:
        """Fill the arrays at the `inputs`."""
        for call, _ in self._calls:
            call()


def _call(function: Any, arguments: Sequence[Array], results: Sequence[Array]) -> Any:
    """A call of a CasADi function on fixed arrays, and what must live as long.

    It saves the conversions of an ordinary call, which take ten times as long as these functions.
    """
    buffer, call = function.buffer()
    for i, array in enumerate(arguments):
        buffer.set_arg(i, array.data)
    for i, array in enumerate(results):
        buffer.set_res(i, array.data)
    return call, (buffer, arguments, results)


# Measured on the approach to a person: 7 iterations instead of 9.4, in 0.65 of the time.
_IPOPT: dict[str, Any] = {
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
# One thread calls IPOPT at a time: it keeps its iterations in memory of its own.
_CALL_LOCK = Lock()


def solve_by_ipopt(
    settings: MPCSettings, question: Question, guess: Array
) -> Array | None:
    """The inputs that satisfy every row and cost least, by IPOPT as in the paper, shape (N, 2); None if none.

    Parameters
    ----------
    settings : of the controller.
    question : what is asked.
    guess : inputs to begin with, shape (N, 2) [m/s2].
    """
    s = settings
    groups = question.barriers.groups
    shapes = tuple((kind, *numbers.shape) for kind, numbers, _ in groups)
    numbers = [np.column_stack(group[1:]).ravel() for group in groups]
    given = [*question.state, *question.target, *question.last]
    with _CALL_LOCK:
        solver = _build_ipopt(s, shapes)
        upper = np.full(solver.numel_out("g"), inf)
        if s.terminal == "rest":
            upper[-2:] = 0.0
        found = solver(
            x0=guess.ravel(),
            p=np.concatenate([given, *numbers]),
            lbx=-s.a_max,
            ubx=s.a_max,
            lbg=0,
            ubg=upper,
        )
        is_solved = bool(solver.stats()["success"])
    inputs = np.clip(np.asarray(found["x"]).ravel(), -s.a_max, s.a_max)
    return inputs.reshape(-1, 2) if is_solved else None


@lru_cache
def _build_ipopt(settings: MPCSettings, shapes: tuple[Any, ...]) -> Any:
    """The problem in symbols, and its solver."""
    s = settings
    inputs, given, x, cost = build_motion(settings)
    numbers = list[Any]()
    rows = list[Any]()
    for kind, n, count in shapes:
        own = ca.SX.sym(kind.kind, count + 1, n)
        numbers.append(ca.vec(own))
        rows += [_write_conditions(s, kind, False, own[:, i], x) for i in range(n)]
    rows.append(s.v_max**2 - ca.sum1(x[2:, 1:] ** 2).T)
    if s.terminal == "rest":
        rows.append(x[2:, s.N])
    of_ipopt = _IPOPT | {"max_iter": s.max_iterations}
    for name, limit in (("cpu", s.time_limit), ("wall", s.deadline)):
        if limit < inf:
            of_ipopt[f"max_{name}_time"] = limit / 2
    options: dict[str, Any] = {
        "expand": True,
        "print_time": False,
        "calc_lam_p": False,
        "show_eval_warnings": False,  # a failure shows in `Step.status`
        "ipopt": of_ipopt,
    }
    parameters = ca.vertcat(given, *numbers)
    problem = {"x": ca.vec(inputs), "p": parameters, "f": cost, "g": ca.vertcat(*rows)}
    return ca.nlpsol("hard", "ipopt", problem, options)
