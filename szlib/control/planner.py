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
Yuille and Rangarajan, Neural Computation 15, 2003). So full steps are taken. Of many rows, those with a value
above `NEAR` are left out; the next iteration has those that have come nearer.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import dist, hypot, inf
from threading import get_ident
from time import perf_counter, thread_time
from typing import Any, NamedTuple

import daqp
import numpy as np
from numpy.typing import NDArray

from ..core.checks import Array
from ..core.errors import SolverError
from .obstacles import Group, Priority, find_bodies
from .problem import (
    Question,
    bind,
    build_horizon,
    follow_velocities,
    linearise_kind,
    linearise_motion,
    list_conditions,
)
from .settings import TOLERANCE, MPCSettings

# The iterations end if the change of the inputs is smaller, as a vector [m/s2].
CONVERGED = 1e-3
# Price of a metre of decay without `decay_price`, in the unit of the scaled cost: above every multiplier.
HARD_PRICE = 1e5
# Rows of obstacles with a larger value are left out of an iteration [m].
NEAR = 1.0
_MOST_UNFILTERED = 24  # with at most so many obstacles, a problem contains all of them
# A problem contains what is so much farther than what can matter [m], and this number of zones and of walls,
# or a multiple: few sizes of problems.
_FIRST_MARGIN = 0.5
_MULTIPLE = 16
_FEW_ROWS = 64  # up to so many rows of obstacles, all are in the program
_EVERY = slice(None)
_MOST_PROBLEMS = 256  # sizes of problems for which a planner keeps what it has built
_HARD, _EQUAL, _SOFT = np.array([0, 5, 8], np.intc)  # DAQP's kinds of constraints
# DAQP's answers; the second one if it violates rows with a price
_SOLVED = 1
_VIOLATED = 2
# No regularisation of convex programs; beside the exact penalty, a negligible quadratic one.
# A program of ordinary crowds takes at most some 120 iterations, one that many people overlap 10,000.
_DAQP = {
    "primal_tol": 1e-9,
    "eps_prox": 0.0,
    "rho_soft": 1e3,
    "eq_reduction": -1,
    "iter_limit": 5000,
}


class Plan(NamedTuple):
    """A plan, and how well it obeys the rows.

    Attributes
    ----------
    inputs : accelerations, shape (N, 2) [m/s2].
    cost : with the prices of what is violated, before the last change if it converged.
    violations : if rows without a price contradict each other, the sums of the violations of walls, bodies
        and zones, without those at a price [m]; else empty.
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


class Program:
    """The problem linearised at a plan, and its solution by priorities, in arrays that stay where they are.

    Set `inputs`, then `evaluate` and `solve`.

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
    inputs, given, multipliers : of the plan, shape (N, 2); the state, the target and the last input, 8
        numbers; of the speed limits, negative where one holds. To be filled.
    lower, upper, slopes : of the rows.
    hessian, gradient, cost : of the Lagrangian and of the cost, for each metre to the target (at least 1 m).
    first : number of rows before those of obstacles.
    levels : of each row of obstacles.
    prices : of the violation of rows; 0: none.
    """

    def __init__(
        self, settings: MPCSettings, shapes: tuple[Any, ...], has_floors: bool
    ) -> None:
        s = settings
        n = 2 * settings.N
        motion = linearise_motion(settings)
        kinds = [kind for kind, number, _ in shapes for _ in range(number)]
        rows = [
            (condition.level, k)
            for kind in kinds
            for condition in list_conditions(s, kind, has_floors)
            for k in range(len(condition.keep))
        ]
        self.levels, k = np.reshape(rows, (-1, 2)).astype(int).T
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
        self._calls = [bind(motion, arguments, results)]
        self._numbers = list[Array]()
        for kind, number, count in shapes:
            numbers = np.zeros((number, count + 1))
            function = linearise_kind(s, kind, has_floors, number, count)
            results = [self.lower[begin:], self.slopes[begin:]]
            self._calls.append(bind(function, (positions, numbers), results))
            self._numbers.append(numbers)
            begin += function.numel_out(0)
        self.prices = np.zeros(size)
        zone_price = s.zone_price if s.zone_price < inf else 0.0
        of_level = np.array([0.0, 0.0, zone_price, s.decay_price])
        of_row = of_level[self.levels] * np.array(s.step_lengths)[k]
        self.prices[self.first :] = of_row.clip(max=HARD_PRICE)
        self._is_hard = s.decay_price == inf
        self._sense = np.where(self.prices > 0, _SOFT, _HARD)
        self._sense[3 * s.N : self.first] = _EQUAL
        self._models = dict[Any, Any]()

    def take(self, groups: Sequence[Group]) -> None:
        """Take the numbers of `groups` of obstacles of these shapes."""
        for numbers, group in zip(self._numbers, groups, strict=True):
            numbers[:, :-1], numbers[:, -1] = group.numbers, group.offsets

    def evaluate(self) -> None:
        """Fill the arrays at the `inputs`."""
        for call, _ in self._calls:
            call()

    def solve(self) -> tuple[Array, bool] | None:
        """The change of least cost by the priorities, True if it is relaxed; sets the multipliers of speed.

        None if nothing satisfies the rows that are always there.
        """
        rows: Any = _EVERY
        if len(self.levels) > _FEW_ROWS:
            is_near = self.lower > -NEAR
            is_near[: self.first] = True
            rows = np.flatnonzero(is_near)
        found = self._solve_rows(rows, self.lower, self.prices)
        is_relaxed = found is None or (found[2] and self._is_hard)
        if found is None:
            found = self._solve_levels(np.arange(len(self.lower))[rows])
        if found is None:
            return None
        n = len(self.gradient)
        self.multipliers[:] = found[1][n : n + len(self.multipliers)]
        return found[0], is_relaxed

    def _solve_rows(
        self, rows: Any, lower: Array, prices: Array
    ) -> tuple[Array, Array, bool] | None:
        """d, the multipliers of the rows, and whether rows with a price are violated.

        Of the problem it has these rows, with other lower bounds and prices; those with a price are soft.
        None if hard rows contradict each other. To change a model of DAQP takes half the time of a new one,
        and its answers are the same; the number of rows with a price must not change, because it sizes the
        memory.
        """
        weights = prices[rows]
        slopes = self.slopes[rows][len(self.gradient) :]
        given = self.hessian, self.gradient, slopes, self.upper[rows], lower[rows]
        sense = self._sense[rows]
        if prices is not self.prices:  # level by level
            sense = np.where(weights > 0, _SOFT, np.where(sense == _SOFT, _HARD, sense))
        size = None if rows is _EVERY else (len(weights), np.count_nonzero(weights))
        model = self._models.pop(size, None)
        if model is None:
            model = daqp.Model()
            model.settings = _DAQP
            flag, _ = model.setup(*given, sense)
            model.soft_weights(w_l=weights, w_u=weights)
        else:
            flag = model.update(*given, sense)
            if size:  # all rows together always have the same prices
                model.soft_weights(w_l=weights, w_u=weights)
        if flag < 0:
            return None
        step, _, flag, info = model.solve()
        if flag not in (_SOLVED, _VIOLATED):
            return None
        if len(self._models) < _MOST_PROBLEMS:
            self._models[size] = model
        return step, info["lam"], flag == _VIOLATED

    def _solve_levels(self, near: NDArray[np.intp]) -> tuple[Array, Array, bool] | None:
        """Level by level: the least violation, which is fixed for the next levels."""
        found = None
        lower = self.lower.copy()
        prices = self.prices.copy()
        chosen, near = np.split(near, [self.first])
        levels = self.levels[near - self.first]
        for level in np.unique(levels):
            rows = near[levels == level]
            prices[rows] = np.where(prices[rows] > 0, prices[rows], HARD_PRICE)
            chosen = np.concatenate([chosen, rows])
            solved = self._solve_rows(chosen, lower, prices)
            if solved is None:
                break
            found = solved
            allowed = np.minimum(lower[rows], self.slopes[rows] @ found[0])
            lower[rows] = allowed - 1e-9
            prices[rows] = 0.0
        return found

    def is_violated(self) -> bool:
        """True if the plan violates a row without a price."""
        violated = self.lower[self.first :] > TOLERANCE
        return bool(violated[self._is_hard | (self.prices[self.first :] == 0)].any())

    def sum_violations(self) -> tuple[float, ...]:
        """Sums of the violations of walls, bodies and zones without a price at the plan [m]."""
        violated = self.lower[self.first :].clip(0.0) * (self.prices[self.first :] == 0)
        sums = np.bincount(self.levels, violated, len(Priority))[: Priority.DECAY]
        return tuple(sums.round(4).tolist())


def _find_reach_time(s: MPCSettings) -> float:
    """Time to h = 0 at constant speed from which on no step of a plan can violate a row [s].

    See `Obstacles.find_travel`; with the settings `s`.
    """
    longest = max(s.step_lengths)
    gamma = min(s.gamma, s.a_max * s.dt / s.v_max)
    return float(2 * longest * s.dt / (1 - (1 - gamma) ** longest))


class Planner:
    """Solves the problem of this module by sequential quadratic programs.

    Parameters
    ----------
    settings : of the controller.
    """

    def __init__(self, settings: MPCSettings) -> None:
        self.settings = settings
        # the last change of a plan of long steps may leave it too fast
        self._is_coarse = hypot(*np.diff(settings.times)) > TOLERANCE**0.5 / CONVERGED
        self._programs = dict[Any, Program]()
        self._thread = dict[str, int]()
        self.reset()
        self.begin(perf_counter())

    def reset(self) -> None:
        """Forget the multipliers of the speed limit: they save time, and change answers by rounding only."""
        self._on_speed = np.zeros(self.settings.N)

    def __getstate__(self) -> dict[str, Any]:
        """Everything but the programs, which are built again, and the thread, which may be another."""
        return {**self.__dict__, "_programs": {}, "_thread": {}}

    def check_thread(self) -> None:
        """Raise SolverError in any thread but the first one that called this."""
        if self._thread.setdefault("first", get_ident()) != get_ident():
            raise SolverError(
                "this controller belongs to another thread; build one in each thread"
            )

    def begin(self, began: float) -> None:
        """Start to measure the time of a step that began at `began`, by `perf_counter` [s]."""
        self._began = began
        self._computed = thread_time()

    @property
    def is_late(self) -> bool:
        """True if the time of the step is used up."""
        s = self.settings
        elapsed = perf_counter() - self._began
        if elapsed > s.deadline:
            return True
        return elapsed > s.time_limit and thread_time() - self._computed > s.time_limit

    def plan(self, question: Question, *guesses: Array) -> Plan:
        """The best plan for a `question` from these `guesses`, each of shape (N, 2) [m/s2]."""
        found = list[Plan]()
        for guess in guesses:
            found.append(self._plan_from(question, guess))
            if found[-1].timed_out:
                break
        best = min(found, key=lambda plan: plan.rank)
        return best._replace(timed_out=found[-1].timed_out)

    def _plan_from(self, question: Question, guess: Array) -> Plan:
        """The plan for a `question`, from a `guess`.

        Of many obstacles, the problem contains those near the guess. If the plan comes near others, it is
        made again with them, from there.
        """
        barriers = question.barriers
        if barriers.size <= _MOST_UNFILTERED:
            return self._plan_among(question, guess)
        spare = self._find_spare(question, guess) - _FIRST_MARGIN
        while True:
            near = barriers.select_near(spare, _MULTIPLE)
            plan = self._plan_among(question._replace(barriers=near), guess)
            after = self._find_spare(question, plan.inputs)
            if not ((after <= 0.0) & (spare > 0.0)).any():
                return plan
            if plan.timed_out:
                return plan._replace(is_relaxed=True)
            spare = np.minimum(spare, after)
            guess = plan.inputs

    def find_time_lost(self, question: Question, plan: Plan, points: Array) -> float:
        """About the time that a `plan` for a `question` loses against `points`, with its prices [s].

        The points, shape (N, 2), count until they are nearest to the target, where the plan ends. A second is
        v_max times the weights of x and y if the target is far, and less if it is near.
        """
        s = self.settings
        weights = np.vstack([np.outer(s.step_lengths[:-1], s.Q[:2]), s.P[:2]])
        offsets = points - question.target
        nearest = np.hypot(*offsets.T).argmin()
        offsets[nearest:] = offsets[nearest]
        distance = max(1.0, dist(question.state[:2], question.target))
        promised = (weights * offsets**2).sum() / distance
        return float((plan.cost - promised) / s.v_max / (weights.sum() or 1.0))

    def _find_spare(self, question: Question, inputs: Array) -> Array:
        """By how much each obstacle is farther from a plan than what can matter, shape (n,) [m]."""
        s = self.settings
        barriers = question.barriers
        states = build_horizon(s).states(np.array(question.state), inputs)
        x, y = states[:, :2].T
        reach = np.hypot(*states[:, 2:].T).max() + barriers.speeds
        reach *= _find_reach_time(s)
        travel = barriers.find_travel(x, y, s.times, s.body_gap).min(axis=1)
        return np.asarray(travel - reach)

    def _plan_among(self, question: Question, guess: Array) -> Plan:
        """The plan for a `question`, with all its obstacles.

        Without `decay_price`, floors join only if the barrier conditions contradict each other.
        """
        if self.settings.decay_price < inf:
            return self._plan(question, guess, has_floors=True)
        plan = self._plan(question, guess, has_floors=False)
        if plan.is_relaxed and not plan.timed_out:
            plan = self._plan(question, plan.inputs, has_floors=True)
            return plan._replace(is_relaxed=True)
        return plan

    def prepare(self, question: Question, has_floors: bool) -> Program:
        """The program of a `question`; `has_floors` as of `list_conditions`."""
        obstacles = question.barriers
        if has_floors:
            obstacles = obstacles.joined(
                find_bodies(obstacles, self.settings, as_predicted=True)
            )
        groups = obstacles.groups
        key = has_floors, *[(kind, *of.shape) for kind, of, _ in groups]
        program = self._programs.get(key)
        if program is None:
            if len(self._programs) >= _MOST_PROBLEMS:
                self._programs.clear()
            program = Program(self.settings, key[1:], has_floors)
            self._programs[key] = program
            self._computed = thread_time()  # this is done once for each size
        program.take(groups)
        given = program.given
        given[:4], given[4:6], given[6:] = question[:3]
        return program

    def _plan(self, question: Question, guess: Array, has_floors: bool) -> Plan:
        program = self.prepare(question, has_floors)
        s = self.settings
        program.inputs[:], program.multipliers[:] = guess, self._on_speed
        before: Array | None = None
        for _ in range(s.max_iterations):
            program.evaluate()
            solved = program.solve()
            if solved is None:
                self._on_speed[:] = 0.0
                return Plan(program.inputs.copy(), 0.0, (inf,), True, self.is_late)
            step, is_relaxed = solved
            if before is not None and step @ before < -(before @ before) / 2:
                step = step / 2  # two plans would follow each other for ever
            before = step
            program.inputs += step.reshape(-1, 2)
            is_converged = hypot(*step.tolist()) <= CONVERGED
            timed_out = not is_converged and self.is_late
            if is_converged or timed_out:
                break
        self._on_speed[:] = program.multipliers
        inputs = np.minimum(np.maximum(program.inputs, -s.a_max), s.a_max)
        is_exact = is_converged and not self._is_coarse
        if not is_exact:
            states = build_horizon(s).states(np.array(question.state), inputs)
            inputs = follow_velocities(s, question.state[2:], states[1:, 2:])
        program.inputs[:] = inputs
        if is_relaxed or not is_exact:
            program.evaluate()
            is_relaxed = is_relaxed or program.is_violated()
        violations = program.sum_violations() if is_relaxed else ()
        cost = 0.0
        if is_relaxed or s.lookahead < inf:  # it may be compared
            cost = float(program.cost[0] + program.lower.clip(0.0) @ program.prices)
        return Plan(inputs, cost, violations, is_relaxed, timed_out)
