"""The problem of a step in symbols and matrices: motion, cost, limits, and the conditions on obstacles.

`szlib.control.planner` states the problem.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from ..core.checks import Array
from .obstacles import Obstacle, Obstacles, Priority
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
    slowest = abs(v)
    plan = []
    wanted = (targets @ (1, 1j)).tolist()
    times = s.times[1:].tolist()
    for w, length, time in zip(wanted, s.step_lengths, times, strict=True):
        dt = s.dt * length
        limit = max(s.v_max, slowest - s.a_max * time)
        change = min(1.0, limit / (abs(w) or 1.0)) * w - v
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


@lru_cache(maxsize=1024)
def linearise_kind(
    settings: MPCSettings, kind: Any, has_floors: bool, n: int, count: int
) -> Any:
    """(positions, numbers and offsets) -> (bounds, slopes) of all conditions on `n` obstacles of a `kind`.

    Each has `count` numbers; `settings` and `has_floors` as of `list_conditions`.
    """
    if n > 1:
        of_one = linearise_kind(settings, kind, has_floors, 1, count)
        return of_one.map(n, [True, False], [False, False])
    at = ca.SX.sym("at", 2, settings.N + 1)
    numbers = ca.SX.sym("numbers", count + 1)
    *own, offset = ca.vertsplit(numbers)
    times = enumerate(settings.times.tolist())
    h = [kind.distance(at[0, k], at[1, k], time, *own) - offset for k, time in times]
    values = [
        h[k + 1] - keep * h[k]
        for condition in list_conditions(settings, kind, has_floors)
        for k, keep in enumerate(condition.keep)
    ]
    # the first state is given
    moves = ca.DM(np.kron(build_horizon(settings).to_positions, np.eye(2)))
    rows = ca.vertcat(*values)
    slopes = (ca.jacobian(rows, ca.vec(at[:, 1:])) @ ca.sparsify(moves)).T
    results = [-rows, ca.densify(slopes)]
    return ca.Function("rows", [at, numbers], results, {"cse": True})


# Largest multiplier of the speed limit. Rows that contradict each other give huge ones, which would spoil
# the next steps.
_MOST_CURVED = 1e3


@lru_cache
def linearise_motion(settings: MPCSettings) -> Any:
    """The part of a quadratic program without obstacles, for these `settings`: see `planner.Program`."""
    s = settings
    n = s.N
    inputs = ca.SX.sym("u", 2, n)
    given = ca.SX.sym("given", 8)
    state = given[:4]
    target = ca.vertcat(given[4:6], 0, 0)
    last = given[6:]
    states = [state]
    cost: Any = 0.0
    for k, m in enumerate(s.step_lengths):
        dt = m * s.dt
        a = inputs[:, k]
        moved = dt * state[2:] + 0.5 * dt**2 * a
        state += ca.vertcat(moved, dt * a)
        weights = m * ca.DM(s.Q) if k < n - 1 else ca.DM(s.P)
        cost += ca.dot(weights, (state - target) ** 2) + m * ca.dot(ca.DM(s.R), a**2)
        cost += s.jerk_weight / m * ca.sumsqr(a - last)
        last = a
        states.append(state)
    positions, velocity = ca.vertsplit(ca.horzcat(*states), 2)
    horizon = build_horizon(s)
    u = ca.vec(inputs)
    distance = ca.norm_2(given[4:6] - given[:2])
    multipliers = ca.SX.sym("speed", n)
    curved_by = ca.fmin(ca.fmax(-multipliers, 0), _MOST_CURVED)
    scale = 2 / (distance + 1 + ca.fabs(distance - 1))
    velocity = velocity[:, 1:]
    # a robot that is too fast slows down as it can
    slowed = ca.norm_2(given[2:4]) - s.a_max * ca.DM(horizon.times[1:])
    limit = ca.fmax(s.v_max, slowed)
    speed = limit**2 - ca.sum1(velocity**2).T
    curved = ca.hessian(scale * cost - ca.dot(curved_by, speed), u)[0]
    if s.terminal == "rest":
        speed = ca.vertcat(speed, velocity[:, -1])
    is_end = np.arange(speed.numel()) >= n
    outputs = [
        positions,
        ca.vertcat(-s.a_max - u, -speed),
        ca.vertcat(s.a_max - u, ca.if_else(ca.DM(is_end), -speed, 1e30)),
        ca.jacobian(speed, u).T,
        curved,
        scale * ca.gradient(cost, u),
        scale * cost,
    ]
    dense = [ca.densify(each) for each in outputs]
    return ca.Function("motion", [inputs, given, multipliers], dense, {"cse": True})


def bind(function: Any, arguments: Sequence[Array], results: Sequence[Array]) -> Any:
    """A call of a CasADi `function` on fixed `arguments` and `results`, and what must live as long.

    It saves the conversions of an ordinary call, which take ten times as long as these functions.
    """
    buffer, call = function.buffer()
    for i, array in enumerate(arguments):
        buffer.set_arg(i, array.data)
    for i, array in enumerate(results):
        buffer.set_res(i, array.data)
    return call, (buffer, arguments, results)
