"""The control problem of a step, and its solution by priorities.

    min over u_0 .. u_{N-1}
        (x_N - g)' P (x_N - g) + sum_{k=1}^{N-1} m_{k-1} (x_k - g)' Q (x_k - g)
            + sum_{k=0}^{N-1} m_k u_k' R u_k + j |u_k - u_{k-1}|^2 / m_k
    subject to
        x_{k+1} = A_k x_k + B_k u_k,  x_0 given                       double integrator   (paper, eq. 8)
        -a_max <= u_k <= a_max                                        acceleration        k = 0 .. N-1
        |(vx, vy)_k|^2 <= v_max^2                                     Euclidean speed     k = 1 .. N
        h_i(x_{k+1}, t_{k+1}) - (1 - gamma)^{m_k} h_i(x_k, t_k) >= 0  each barrier i      k = 0 .. N_h-1
        (vx, vy)_N = 0                                                with terminal="rest"

(paper, eq. 1-2), where x = (x, y, vx, vy), u = (ax, ay), and h_i(., t) takes people at constant velocity, t
seconds ahead. Step k takes m_k dt; in the paper m_k = 1 and the weight j of jerk is 0. `g` is the target at
rest. The states are eliminated: 2 N unknowns remain.

*Priorities.* Where these rows contradict each other, or with `decay_price`, each row has a level, and
*floors* join them (see `Priority`):

    walls     h_{k+1} >= (1 - gamma_w)^{m_k} h_k,  gamma_w = a_max dt / v_max: the robot can always stop
    bodies    h_{k+1} >= 0, by `body_gap`
    zones     h_{k+1} >= 0                                            or at `zone_price`
    decay     the barrier conditions above, at `decay_price`

What is violated at a price counts as cost.

Level by level, the sum of violations is made as small as the levels above allow, and is fixed for the levels
below. So no wall is touched to spare a zone, however many people there are. The usual step violates no floor;
then all levels are one quadratic program.

*Method.* Each iteration linearises the rows at the plan. h is convex, so that a linearised floor implies the
true one: an iteration with all rows satisfied keeps them, and lowers the cost (a convex-concave procedure:
Yuille and Rangarajan, Neural Computation 15, 2003). So full steps are taken. Rows that cannot become active
within the iteration are left out.
"""

from __future__ import annotations

from math import inf
from time import perf_counter, thread_time
from typing import Any, NamedTuple

import daqp
import numpy as np
from numpy.typing import NDArray

from ..core.checks import Array
from .obstacles import Priority, find_bodies
from .problem import (
    HARD_PRICE,
    LinearProblem,
    Question,
    limit_speed,
)
from .settings import TOLERANCE, MPCSettings

# The iterations end if the change of the inputs is smaller, as a vector [m/s2].
CONVERGED = 1e-3
# Rows with a larger value are left out of an iteration [m]; smaller where the plan cannot change so much.
NEAR = 1.0
_ROWS = 16  # programs are built for multiples of so many rows
_FEW_ROWS = 64  # up to so many rows of obstacles, all are in the program
# Largest multiplier of the speed limit. Rows that contradict each other give huge ones, which would spoil
# the next steps.
_MOST_CURVED = 1e3
_MOST_PROBLEMS = 256  # numbers of obstacles for which a planner keeps what it has built
_EQUAL, _SOFT = 5, 8  # DAQP's kinds of constraints
_SOLVED, _VIOLATED = (
    1,
    2,
)  # DAQP's answers; the second one if it violates rows with a price
# No regularisation of convex programs; beside the exact penalty, a negligible quadratic one.
_DAQP = {"primal_tol": 1e-9, "eps_prox": 0.0, "rho_soft": 1e3}


class Plan(NamedTuple):
    """A plan, and how well it obeys the rows.

    Attributes
    ----------
    inputs : accelerations, shape (N, 2) [m/s2].
    cost : with the prices of what is violated, before the last change if it converged.
    violations : if rows without a price contradict each other, the sums of the violations of walls, bodies
        and zones [m]; else empty.
    is_relaxed : True if rows without a price contradict each other.
    timed_out : True if time was up before it converged.
    """

    inputs: Array
    cost: float
    violations: tuple[float, ...]
    is_relaxed: bool
    timed_out: bool

    @property
    def rank(self) -> tuple[Any, ...]:
        """Of two plans the better one has the lesser rank: by violations, and then by cost."""
        return self.violations, self.cost


class TimeBudget:
    """The time of one step; call `begin` at its start.

    Parameters
    ----------
    limit : computing time of the thread [s], or inf.
    deadline : time of a clock on the wall [s], or inf.
    """

    def __init__(self, limit: float, deadline: float = inf) -> None:
        self._limit, self._deadline = limit, deadline
        self.begin(perf_counter())

    def begin(self, began: float) -> None:
        """Start to measure; by the clock on the wall the step `began` earlier [s]."""
        self._began = began
        self.extend()

    def extend(self) -> None:
        """Measure the computing time anew: a problem of a new size was built, which is done once."""
        self._wall = perf_counter()
        # a system call
        self._thread = thread_time() if self._limit < inf else 0.0

    @property
    def is_spent(self) -> bool:
        """True if the time is used up. The thread's clock is slow, so it is read last."""
        now = perf_counter()
        if now - self._began > self._deadline:
            return True
        is_late = now - self._wall > self._limit
        return is_late and thread_time() - self._thread > self._limit


class _Program:
    """A quadratic program with a number of rows for obstacles: some of a `LinearProblem`, or all of them.

    Parameters
    ----------
    problem : whose rows these are.
    size : number of rows for obstacles.
    prices : of the rows, if all are in the program; None: some are chosen at each call.
    """

    def __init__(
        self, problem: LinearProblem, size: int, prices: Array | None = None
    ) -> None:
        n, first, self._model = len(problem.gradient), problem.first, daqp.Model()
        self._problem, self._model.settings, self._has_all = (
            problem,
            _DAQP,
            prices is not None,
        )
        self._lower, self._upper = problem.lower, problem.upper
        self._slopes, self._sense = problem.slopes, np.zeros(first + size, np.intc)
        if not self._has_all:
            self._lower, self._upper = (
                np.zeros(first + size),
                np.full(first + size, 1e30),
            )
            self._slopes = np.zeros((first - n + size, n))
        self._prices = np.zeros(first + size)
        # DAQP makes room for the prices of rows that are soft at first
        self._sense[first:] = _SOFT
        bounds = np.ones(first + size)
        self._model.setup(
            np.eye(n), np.zeros(n), self._slopes, bounds, -bounds, self._sense
        )
        self._sense[3 * n // 2 : first] = _EQUAL
        if prices is not None:
            self._set_prices(prices)

    def _set_prices(self, prices: Array) -> None:
        first = self._problem.first
        self._prices[first : first + len(prices)] = prices
        self._prices[first + len(prices) :] = 0.0
        self._sense[first:] = _SOFT * (self._prices[first:] > 0)
        self._model.soft_weights(w_l=self._prices, w_u=self._prices)

    def choose(self, rows: NDArray[np.intp], lower: Array, prices: Array) -> None:
        """Take these rows of the problem, with other lower bounds and prices; without a price it is hard."""
        problem, first, m = self._problem, self._problem.first, len(rows)
        n = len(problem.gradient)
        k = first - n
        self._slopes[:k], self._slopes[k + m :] = problem.slopes[:k], 0.0
        problem.slopes.take(k + rows, axis=0, out=self._slopes[k : k + m], mode="clip")
        self._lower[:first], self._upper[:first] = (
            problem.lower[:first],
            problem.upper[:first],
        )
        self._lower[first : first + m], self._lower[first + m :] = lower, -1e30
        self._set_prices(prices)

    def solve(self) -> tuple[Array, Array, bool] | None:
        """d, the multipliers of the rows, and whether rows with a price are violated.

        None if rows without a price contradict each other.
        """
        p, model = self._problem, self._model
        rows = self._slopes, self._upper, self._lower, self._sense
        if model.update(p.hessian, p.gradient, *rows) < 0:
            return None
        step, _, flag, info = model.solve()
        is_solved = flag in (_SOLVED, _VIOLATED)
        return (step, info["lam"], flag == _VIOLATED) if is_solved else None


class _Prepared:
    """A linear problem with its programs.

    Parameters
    ----------
    settings : of the controller.
    shapes, has_floors : as of `LinearProblem`.
    """

    def __init__(
        self, settings: MPCSettings, shapes: tuple[Any, ...], has_floors: bool
    ) -> None:
        s, self.problem = settings, LinearProblem(settings, shapes, has_floors)
        k, times = self.problem.steps, np.array(s.times)
        # inputs change by 2 a_max at most on each axis
        change = np.sqrt(2) * s.a_max * (times[1:] ** 2 + times[:-1] ** 2)
        self._near = -np.minimum(change, NEAR)[k]
        self._is_hard = s.decay_price >= HARD_PRICE
        self.prices = np.zeros(len(k))
        lengths, levels = np.array(s.step_lengths)[k], self.problem.levels
        priced = levels == Priority.DECAY
        self.prices[priced] = np.minimum(s.decay_price * lengths[priced], HARD_PRICE)
        if s.zone_price < inf:
            priced = levels == Priority.ZONE
            self.prices[priced] = s.zone_price * lengths[priced]
        self._programs, self._all = dict[int, _Program](), None
        if len(k) <= _FEW_ROWS:
            self._all = _Program(self.problem, len(k), self.prices)

    def _solve_chosen(
        self, rows: NDArray[np.intp], lower: Array, prices: Array
    ) -> tuple[Array, Array, bool] | None:
        size = -(-len(rows) // _ROWS) * _ROWS
        if size not in self._programs:
            self._programs[size] = _Program(self.problem, size)
        self._programs[size].choose(rows, lower, prices)
        return self._programs[size].solve()

    def solve(self) -> tuple[Array, bool] | None:
        """The change of least cost by the priorities, True if it is relaxed; sets the multipliers of speed.

        None if nothing satisfies the rows that are always there.
        """
        problem, found = self.problem, None
        if self._all:
            found = self._all.solve()
        else:
            lower = problem.lower[problem.first :]
            rows = np.flatnonzero(lower > self._near)
            found = self._solve_chosen(rows, lower[rows], self.prices[rows])
        is_relaxed = found is None or (found[2] and self._is_hard)
        if found is None:
            found = self._solve_levels()
        if found is None:
            return None
        on_speed = problem.multipliers
        np.negative(found[1][problem.inputs.size :][: len(on_speed)], out=on_speed)
        np.clip(on_speed, 0.0, _MOST_CURVED, out=on_speed)
        return found[0], is_relaxed

    def _solve_levels(self) -> tuple[Array, Array, bool] | None:
        """Level by level: the least violation, which is fixed for the next levels."""
        p, found = self.problem, None
        bounds, prices, chosen = (
            p.lower[p.first :].copy(),
            self.prices.copy(),
            np.zeros(0, int),
        )
        near = np.flatnonzero(bounds > self._near)
        for level in Priority:
            rows = near[p.levels[near] == level]
            if not len(rows):
                continue
            prices[rows] = np.where(prices[rows] > 0, prices[rows], HARD_PRICE)
            chosen = np.concatenate([chosen, rows])
            solved = self._solve_chosen(chosen, bounds[chosen], prices[chosen])
            if solved is None:
                return found
            found, slopes = solved, p.slopes[p.first - len(p.gradient) + rows]
            violated = np.maximum(bounds[rows] - slopes @ found[0], 0.0)
            bounds[rows] -= violated + 1e-9
            prices[rows] = 0.0
        return found

    def is_violated(self) -> bool:
        """True if the plan violates a row without a price."""
        p = self.problem
        lower = p.lower[p.first :][self._is_hard | (self.prices == 0.0)]
        return bool((lower > TOLERANCE).any())

    def sum_violations(self) -> tuple[float, ...]:
        """Sums of the violations of walls, bodies and zones at the plan [m]."""
        p = self.problem
        violated = np.maximum(p.lower[p.first :], 0.0)
        floors = (each for each in Priority if each < Priority.DECAY)
        sums = (violated[p.levels == each].sum() for each in floors)
        return tuple(round(float(each), 4) for each in sums)

    def sum_cost(self) -> float:
        """The cost of the plan, with the prices of what it violates."""
        p = self.problem
        return float(p.cost[0] + np.maximum(p.lower[p.first :], 0.0) @ self.prices)


class Planner:
    """Solves the problem of this module by sequential quadratic programs.

    Parameters
    ----------
    settings : of the controller.

    Attributes
    ----------
    budget : the computing time of a step.
    """

    def __init__(self, settings: MPCSettings) -> None:
        self.settings = settings
        self.budget = TimeBudget(settings.time_limit, settings.deadline)
        self._prepared = dict[Any, _Prepared]()
        self.reset()

    def reset(self) -> None:
        """Forget the multipliers of the speed limit: they save time, and change answers by rounding only."""
        self._on_speed = np.zeros(self.settings.N)

    def __getstate__(self) -> tuple[MPCSettings, Array]:
        return self.settings, self._on_speed

    def __setstate__(self, state: tuple[MPCSettings, Array]) -> None:
        Planner.__init__(self, state[0])
        self._on_speed = state[1].copy()

    def plan(self, question: Question, guess: Array) -> Plan:
        """The plan for a `question`, from a `guess`, shape (N, 2) [m/s2].

        Without `decay_price`, floors join only if the barrier conditions contradict each other.
        """
        if self.settings.decay_price < inf:
            return self._plan(question, guess, has_floors=True)
        plan = self._plan(question, guess, has_floors=False)
        if plan.is_relaxed and not plan.timed_out:
            plan = self._plan(question, plan.inputs, has_floors=True)
            return plan._replace(is_relaxed=True)
        return plan

    def _prepare(self, question: Question, has_floors: bool) -> _Prepared:
        obstacles = question.barriers
        if has_floors:
            bodies = find_bodies(question.zones, self.settings, as_predicted=True)
            obstacles = obstacles.joined(bodies)
        groups = obstacles.groups
        key = has_floors, *((kind, *of.shape) for kind, of, _ in groups)
        if key not in self._prepared:
            if len(self._prepared) >= _MOST_PROBLEMS:
                self._prepared.clear()
            self._prepared[key] = _Prepared(self.settings, key[1:], has_floors)
            self.budget.extend()
        prepared = self._prepared[key]
        prepared.problem.take(groups)
        given = prepared.problem.given
        given[:4], given[4:6], given[6:] = question[:3]
        return prepared

    def _plan(self, question: Question, guess: Array, has_floors: bool) -> Plan:
        prepared, s = self._prepare(question, has_floors), self.settings
        problem = prepared.problem
        is_relaxed = is_failed = is_converged = timed_out = False
        problem.inputs[:], problem.multipliers[:] = guess, self._on_speed
        before = np.zeros(problem.inputs.size)
        for _ in range(s.max_iterations):
            problem.evaluate()
            solved = prepared.solve()
            if solved is None:
                is_failed = True
                break
            step, is_relaxed = solved
            if step @ before < -(before @ before) / 2:
                step = step / 2  # two plans would follow each other for ever
            before = step
            problem.inputs += step.reshape(-1, 2)
            is_converged = float(step @ step) <= CONVERGED**2
            if is_converged:
                break
            if self.budget.is_spent:
                timed_out = True
                break
        self._on_speed[:] = 0.0 if is_failed else problem.multipliers
        np.minimum(np.maximum(problem.inputs, -s.a_max), s.a_max, out=problem.inputs)
        if not is_converged:
            limit_speed(s, question.state[2:], problem.inputs)
        inputs = problem.inputs.copy()
        if is_failed:
            return Plan(inputs, inf, (inf,), True, False)
        if is_relaxed or not is_converged:
            problem.evaluate()
            is_relaxed = is_relaxed or prepared.is_violated()
        violations = prepared.sum_violations() if is_relaxed else ()
        return Plan(inputs, prepared.sum_cost(), violations, is_relaxed, timed_out)
