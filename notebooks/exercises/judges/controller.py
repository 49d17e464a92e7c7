"""Tasks: a CBF-QP, an MPC and an MPC-CBF, first on a road, then in the plane, judged in closed loop.

A world holds a robot, its goal, and people who stand or walk. The judge drives the robot with the learner's
function until it arrives. It refuses h < 0, inputs beyond their limits, and a robot that does not arrive;
then each result must be the minimum of its problem, which is unique.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial
from typing import Any

import numpy as np

from .answers import Refusal
from .qp import Infeasible, solve_qp
from .task import Answer, Args, Rng, Task, check_form, make_task

DT = 0.1  # time of a step [s]
RADIUS = 1.0  # distance from a person's centre at which h = 0 [m]
V_MAX = 1.0  # largest velocity of the robot without inertia, on each axis [m/s]
A_MAX = 2.0  # largest acceleration of the robot with inertia, on each axis [m/s2]
N = 15  # steps of a plan
WEIGHTS = (1.0, 2.0)  # of position and velocity in the cost; that of the input is 1
_ARRIVED, _TIME = 0.15, 40.0  # distance to the goal [m] and time limit [s]
_RIM = 1e-6  # numerical error of h [m] and of inputs


# --- worlds and the closed loop ----------------------------------------------------------------------


@dataclass(frozen=True)
class World:
    """A robot that starts at rest at the origin, its goal (d,), and people (n, d); d is 1 on a road."""

    goal: Any
    people: Any
    velocities: Any
    turn: int = 10**6  # step at which each person turns round
    gamma: float = 0.1
    n_h: int = N
    a_max: float = A_MAX
    time: float = _TIME

    def people_at(self, step: int) -> tuple[Any, Any]:
        """Positions and velocities of the people at a step."""
        walked = min(step, self.turn) - max(step - self.turn, 0)
        return self.people + DT * walked * self.velocities, self.velocities * (1 if step < self.turn else -1)


@dataclass
class Run:
    """Positions of the robot and the people, h and inputs of each step, and what went wrong."""

    robot: list[Any] = field(default_factory=list)
    people: list[Any] = field(default_factory=list)
    h: list[float] = field(default_factory=list)
    inputs: list[Any] = field(default_factory=list)
    fault: str = ""


# Function of position, velocity, people and their velocities that returns an input and the plan's positions.
Decide = Callable[[Any, Any, Any, Any], Any]


def _run(world: World, decide: Decide, *, has_inertia: bool = True) -> Run:
    """Drive the robot of a world until it arrives or something goes wrong."""
    run, limit = Run(), world.a_max if has_inertia else V_MAX
    x, v = np.zeros_like(world.goal), np.zeros_like(world.goal)
    for step in range(round(world.time / DT)):
        people, velocities = world.people_at(step)
        h = float((np.linalg.norm(x - people, axis=1) - RADIUS).min(initial=np.inf))
        run.robot, run.people, run.h = ([*run.robot, x], [*run.people, people], [*run.h, h])
        after = f"after {step * DT:.1f} s"
        if h < -_RIM:
            run.fault = f"{after} h = {h:.3f} m: the robot is too near to a person"
        elif np.linalg.norm(x - world.goal) < _ARRIVED:
            return run
        try:
            u = np.zeros_like(x) if run.fault else decide(x, v, people, velocities)
        except Infeasible as error:
            wrong_row = "" if step else ": nobody is near yet, so a row has the wrong sign"
            run.fault = f"{after} {error}{wrong_row}"
        if not run.fault and not (np.abs(u) <= limit + _RIM).all():
            run.fault = f"{after} the input is {np.round(u, 3)}; each number may be at most {limit} in size"
        if run.fault:
            return run
        run.inputs.append(u)
        x, v = (x + DT * v + DT**2 / 2 * u, v + DT * u) if has_inertia else (x + DT * u, u)
    left = np.linalg.norm(x - world.goal)
    run.fault = (
        f"after {world.time:.0f} s the robot is {left:.2f} m from its goal: it does not arrive in time"
    )
    return run


def _numbers(got: Any, *shape: int) -> Any:
    if form := check_form(np.zeros(shape), got):
        raise Refusal(form)
    return np.asarray(got, float)


# --- the controllers; their options make the mistakes ------------------------------------------------


def filter_1d(x: float, wish: float, person: float, velocity: float, gamma: float) -> Any:
    limit = gamma * (person - x - RADIUS) / DT + velocity
    return np.clip(min(wish, limit), -V_MAX, V_MAX)


def filter_2d(
    x: Any, wish: Any, people: Any, velocities: Any, gamma: float, *, sign: float = 1, moves: float = 1,
    dt: float = DT, radius: float = RADIUS, v_max: float = V_MAX,
) -> Any:  # fmt: skip
    away = (x - people) / np.linalg.norm(x - people, axis=1)[:, None]
    h = np.linalg.norm(x - people, axis=1) - radius
    least = moves * (away * velocities).sum(axis=1) - gamma * h / dt
    return solve_qp(2 * np.eye(2), -2 * wish, sign * away, least, -v_max, v_max)


@lru_cache
def predict(n: int, late: int = 0, b: tuple[float, float] = (DT**2 / 2, DT)) -> Any:
    powers = [np.linalg.matrix_power(np.array([[1, DT], [0, 1]]), k) for k in range(n + 2)]
    inputs = np.zeros((n, 2, n))
    for k in range(n):
        for j in range(k + 1):
            inputs[k, :, j] = powers[k - j + late] @ b
    return np.hstack([np.vstack(powers[1 : n + 1]), inputs.reshape(2 * n, n)])


def plan(
    x: Any, v: Any, goal: Any, people: Any = (), velocities: Any = (), gamma: float = 0.1, n_h: int = 0,
    guess: Any = None, *, n: int = N, a_max: float = A_MAX, weights: Any = WEIGHTS, effort: float = 1.0,
    pull: float = 1.0, matrix: Any = None, sign: float = 1, moves: float = 1, late: int = 0, radius: float = RADIUS,
    share: Callable[[float, int], float] = lambda gamma, k: (1 - gamma) ** k,
) -> Any:  # fmt: skip
    """The plan (n, d) of an MPC-CBF; without people, of an MPC."""
    free, inputs = np.split(predict(n) if matrix is None else matrix, [2], axis=1)
    free, q = free @ np.stack([x, v]), np.resize(weights, 2 * n)[:, None]
    error = free - np.tile(np.stack([goal, 0 * goal]), (n, 1))
    hessian = 2 * (inputs.T @ (q * inputs) + effort * np.eye(n))
    rows, least = [], []
    for person, velocity in zip(people, velocities, strict=True):
        h = np.linalg.norm(x - person) - radius
        for k in range(1, n_h + 1):
            there = person + moves * (k - late) * DT * velocity
            away = sign * (guess[k - 1] - there) / np.linalg.norm(guess[k - 1] - there)
            rows.append(np.kron(away, inputs[2 * k - 2]))
            least.append(share(gamma, k) * h + radius - away @ (free[2 * k - 2] - there))
    linear = 2 * pull * (inputs.T @ (q * error)).T.ravel()
    return solve_qp(np.kron(np.eye(len(x)), hessian), linear, rows, least, -a_max, a_max).reshape(-1, n).T


def mpc_1d(state: Any, goal: float, **options: Any) -> Any:
    return plan(state[:1], state[1:], np.array([goal]), **options)[:, 0]


def plan_1d(
    state: Any, goal: float, person: float, velocity: float, gamma: float, n_h: int, **options: Any
) -> Any:
    x, v, goals, people, velocities = np.array([*state, goal, person, velocity])[:, None]
    guess = np.full((N, 1), people - 1e3 * np.sign(people - x))  # far away, on the robot's side
    return plan(x, v, goals, [people], [velocities], gamma, n_h, guess, **options)[:, 0]


def plan_2d(
    state: Any, goal: Any, people: Any, velocities: Any, gamma: float, n_h: int, guess: Any, **options: Any
) -> Any:
    return plan(state[:2], state[2:], goal, people, velocities, gamma, n_h, guess, **options)


# --- the learner's function in the closed loop -------------------------------------------------------


def _drive_filter_1d(ask: Answer, world: World) -> Run:
    def decide(x: Any, v: Any, people: Any, velocities: Any) -> Any:
        wish = 1.5 * (world.goal[0] - x[0])
        return _numbers(ask(x[0], wish, people[0, 0], velocities[0, 0], world.gamma))[None]

    return _run(world, decide, has_inertia=False)


def _drive_filter_2d(ask: Answer, world: World) -> Run:
    aside = np.array([0.0, 1.3])
    ask(world.people[0] + aside, aside, world.people, world.velocities, world.gamma)  # a wish to go away

    def decide(x: Any, v: Any, people: Any, velocities: Any) -> Any:
        wish = (world.goal - x) * min(1.3 / np.linalg.norm(world.goal - x), 2.0)
        return _numbers(ask(x, wish, people, velocities, world.gamma), 2)

    return _run(world, decide, has_inertia=False)


def _drive_predict(ask: Answer, world: World) -> Run:
    matrix = _numbers(ask(world.n_h), 2 * world.n_h, 2 + world.n_h)
    return _run(world, lambda x, v, *_: plan(x, v, world.goal, n=world.n_h, matrix=matrix)[0])


def _drive_mpc_1d(ask: Answer, world: World) -> Run:
    ask(np.array([1.0, 0.5]), world.goal[0])  # not at rest
    return _run(world, lambda x, v, *_: _numbers(ask(np.array([x[0], v[0]]), world.goal[0]), N)[:1])


def _drive_mpc_cbf_1d(ask: Answer, world: World) -> Run:
    def decide(x: Any, v: Any, people: Any, velocities: Any) -> Any:
        state, person = np.array([x[0], v[0]]), (people[0, 0], velocities[0, 0])
        return _numbers(ask(state, world.goal[0], *person, world.gamma, world.n_h), N)[:1]

    return _run(world, decide)


def _drive_mpc_cbf_2d(ask: Answer, world: World) -> Run:
    ahead: list[Any] = []  # positions of the last plan, without the first

    def decide(x: Any, v: Any, people: Any, velocities: Any) -> Any:
        guess, state = np.array(ahead or [x] * N), np.array([*x, *v])
        controls = _numbers(ask(state, world.goal, people, velocities, world.gamma, world.n_h, guess), N, 2)
        positions = (predict(N) @ np.vstack([x, v, controls]))[::2]
        ahead[:] = [*positions[1:], 2 * positions[-1] - positions[-2]]
        return controls[0]

    return _run(world, decide)


def _drive_tuned(ask: Answer, world: World) -> Run:
    gamma, n_h = _numbers(ask(world.a_max), 2)
    if not (0 < gamma <= 1 and 2 <= n_h <= N and n_h == int(n_h)):
        raise Refusal(f"expected 0 < gamma <= 1 and a whole number N_h from 2 to {N}; got {gamma}, {n_h}")
    best = partial(plan_1d, a_max=world.a_max)
    return _drive_mpc_cbf_1d(best, replace(world, gamma=gamma, n_h=int(n_h)))


# --- draws -------------------------------------------------------------------------------------------


def _draw_roads(rng: Rng) -> Iterator[Args]:
    """A person who stands beyond the goal, one who walks ahead, and one who comes and then turns round."""
    goal, pace, way = rng.uniform(4, 6), rng.uniform(0.3, 0.6), rng.uniform(0.5, 0.7)
    people = ((goal + 1.4, 0.0, 10**6), (rng.uniform(2.2, 3.0), pace, 10**6), (goal + 2, -way, 60))
    for start, velocity, turn in people:
        gamma, n_h = round(rng.uniform(0.05, 0.09), 3), int(rng.integers(4, N))
        yield (World(np.array([goal]), np.array([[start]]), np.array([[velocity]]), turn, gamma, n_h),)


@lru_cache(maxsize=8)
def _draw_planes(drive: Callable[[Answer, World], Run], solution: Answer, seed: int) -> list[Args]:
    """Three worlds that the solution drives through: two people each, who stand, cross or come."""
    rng = np.random.default_rng(seed)
    drawn: list[Args] = []
    while len(drawn) < 3:
        side, way = rng.choice([-1, 1], 2), rng.uniform(0.3, 0.6)
        people = np.array([[2.5, side[0] * rng.uniform(0.2, 0.6)], [5.2, side[1] * rng.uniform(0.2, 0.6)]])
        walks = np.array([[0, 0], [0, -side[1] * way], [-way, 0]])[[0, 1 + len(drawn) % 2]]
        people = people - walks * rng.uniform(3, 5)
        gamma, n_h = round(rng.uniform(0.05, 0.09), 3), int(rng.integers(4, N))
        world = World(np.array([7.5, 0.0]), people, walks, gamma=gamma, n_h=n_h)
        if not drive(solution, world).fault:
            drawn.append((world,))
    return drawn


def _draw_goals(rng: Rng) -> Iterator[Args]:
    """Empty roads, with goals on both sides and horizons of different lengths."""
    for side in (-1, 1):
        goal, nobody = np.array([side * rng.uniform(3, 6)]), np.zeros((0, 1))
        yield (World(goal, nobody, nobody, n_h=int(rng.integers(10, 20))),)


def _draw_brakes(rng: Rng) -> Iterator[Args]:
    """Robots with a weak and a good brake, before a person who stands and one who comes.

    A weak brake needs gamma < 0.028, and a good one gamma > 0.034 to be in time: no pair suits both.
    """
    for a_max, time in ((rng.uniform(0.25, 0.3), 28.0), (rng.uniform(1.6, 2.0), 9.6)):
        world = World(np.array([6.0]), np.array([[7.2]]), np.zeros((1, 1)), a_max=round(a_max, 2), time=time)
        yield (world,)
        comes = np.array([[-rng.uniform(0.5, 0.65)]])
        yield (replace(world, people=np.array([[8.0]]), velocities=comes, turn=60, time=_TIME),)


def draw(run: Run, world: World) -> Any:
    """Plot a run: where the robot and the people are, and h over time."""
    import matplotlib.pyplot as plt

    figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.4), layout="constrained")
    t, is_road = DT * np.arange(len(run.h)), len(world.goal) == 1
    goal = np.tile(world.goal, (len(t), 1))
    people = [("C1--", "person", path) for path in np.array(run.people).swapaxes(0, 1)]
    for style, label, path in [("C0-", "robot", np.array(run.robot)), ("k:", "goal", goal), *people]:
        path = np.column_stack([t, path]) if is_road else path
        left.plot(*path.T, style, label=None if label in left.get_legend_handles_labels()[1] else label)
        left.plot(*path[-1], "o", color=left.lines[-1].get_color())
    left.set(xlabel="t [s]" if is_road else "x [m]", ylabel="x [m]" if is_road else "y [m]")
    left.legend()
    right.plot(t, run.h)
    right.axhline(0, color="black", linestyle=":")
    right.set(xlabel="t [s]", ylabel="h [m]")
    figure.suptitle(run.fault or "The robot arrives")
    return figure


def _task(name: str, drive: Callable[[Answer, World], Run], cases: Any, **options: Any) -> Task:
    return make_task(
        globals(), name, cases,
        drive=lambda ask, args: drive(ask, *args).fault,
        plot=lambda answer, args: draw(drive(answer, *args), *args), **options,
    )  # fmt: skip


def _planes(drive: Callable[[Answer, World], Run], solution: Answer) -> Callable[[Rng], list[Args]]:
    return lambda rng: _draw_planes(drive, solution, int(rng.integers(2**31)))


TASKS = (
    _task("filter_1d", _drive_filter_1d, _draw_roads, solution=filter_1d),
    _task(
        "filter_2d",
        _drive_filter_2d,
        _planes(_drive_filter_2d, filter_2d),
        solution=filter_2d,
        tolerance=1e-3,
    ),
    _task("predict", _drive_predict, _draw_goals, solution=predict),
    _task("mpc_1d", _drive_mpc_1d, _draw_goals, solution=mpc_1d, tolerance=1e-2),
    _task("mpc_cbf_1d", _drive_mpc_cbf_1d, _draw_roads, solution=plan_1d, tolerance=1e-2),
    _task(
        "mpc_cbf_2d", _drive_mpc_cbf_2d, _planes(_drive_mpc_cbf_2d, plan_2d), solution=plan_2d, tolerance=1e-2
    ),
    _task("tuned", _drive_tuned, _draw_brakes),
)
