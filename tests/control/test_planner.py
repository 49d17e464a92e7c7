"""Plans: optimal by independent solvers, the paper's numbers, priorities, terminal rest, and time."""

from __future__ import annotations

from dataclasses import replace
from itertools import count, islice, pairwise
from typing import Any

import numpy as np
import pytest
from helpers.random_states import PAPER_ZONE, ZONE, meetings, questions
from scipy.optimize import linprog, minimize
from studies.ipopt import ByIpopt

import szlib
from szlib.control import Body, HalfPlane, Obstacles, Priority, Wall, Zone, mpc, planner
from szlib.control.controller import advance
from szlib.control.planner import Planner, Program
from szlib.control.problem import Question, list_conditions
from szlib.control.settings import TOLERANCE

GOAL = (4.0, 0.0)
FACING = szlib.Person((0.0, 0.0), heading=np.pi)
GRID = {"grid": (1, 1, 2, 3), "jerk_weight": 1.0}
PRICED = {**GRID, "decay_price": 100.0, "body_gap": 0.2, "gamma": 0.2}
FORMULATIONS = ({}, {"N_h": 8}, {"terminal": "rest"}, GRID)


def settings_of(**settings):
    """Settings without a time limit, so that a busy machine changes nothing."""
    return szlib.MPCSettings(**{"time_limit": np.inf} | settings)


def controller_of(walls=(), make=szlib.MPCCBF, **settings):
    return make(ZONE, walls=walls, settings=settings_of(**settings))


def roll_out(s, state, inputs):
    states = [np.asarray(state, float)]
    for u, m in zip(inputs, s.step_lengths, strict=True):
        states.append(advance(states[-1], u, m * s.dt))
    return np.array(states)


def measure_cost(s, state, target, inputs, last=(0.0, 0.0)):
    """The cost of a plan: written anew, with NumPy only, from the paper."""
    x, m = roll_out(s, state, inputs), np.array(s.step_lengths)[:, None]
    error = x - np.r_[target, 0, 0]
    on_way = (m[:-1] * error[1:-1] ** 2 @ np.array(s.Q)[:, None]).sum()
    change = np.diff(np.vstack([last, inputs]), axis=0) ** 2 / m
    on_inputs = (m * inputs**2 @ np.array(s.R)[:, None]).sum()
    return error[-1] ** 2 @ s.P + on_way + on_inputs + s.jerk_weight * change.sum()


def find_reference(state, target, people, controller, guess):
    """The same problem by SLSQP."""
    s = controller.settings

    def rows(flat):
        x = roll_out(s, state, flat.reshape(-1, 2))
        h = [
            controller.barriers(x[k, :2], [p.after(k * s.dt) for p in people])
            for k in range(s.N_h + 1)
        ]
        cbf = [after - (1 - s.gamma) * before for before, after in pairwise(h)]
        return np.r_[np.concatenate(cbf), s.v_max**2 - (x[1:, 2:] ** 2).sum(axis=1)]

    scale = measure_cost(s, state, target, guess.reshape(-1, 2))
    best = minimize(
        lambda flat: measure_cost(s, state, target, flat.reshape(-1, 2)) / scale,
        guess,
        method="SLSQP",
        bounds=[(-s.a_max, s.a_max)] * guess.size,
        constraints={"type": "ineq", "fun": rows},
        options={"ftol": 1e-13, "maxiter": 500},
    )
    return best.fun * scale, rows(best.x).min(), best.success


def test_the_plan_is_optimal_by_an_independent_solver():
    rng, compared = np.random.default_rng(0), 0
    walls = [((-3.0, 2.5), (5.0, 2.5)), ((3.0, -4.0), (3.0, -1.5))]
    controller = controller_of(walls)
    while compared < 6:
        people = [
            szlib.Person((0.0, 0.0), tuple(rng.uniform(-0.5, 0.5, 2))),
            szlib.Person(tuple(rng.uniform(-4, 4, 2)), heading=rng.uniform(-3, 3)),
        ]
        state = np.r_[rng.uniform(-4, 2, 2), rng.uniform(-0.6, 0.6, 2)]
        if controller.barriers(state[:2], people).min() < 0.05:
            continue
        controller.reset()
        step = controller.step(state, (5.0, 0.5), people)
        if step.status != "optimal":
            continue
        guess = step.inputs.ravel() * 0.9
        cost, row, success = find_reference(
            state, step.target, people, controller, guess
        )
        if not success or row < -1e-7:
            continue
        compared += 1
        found = measure_cost(controller.settings, state, step.target, step.inputs)
        assert found == pytest.approx(cost, rel=1e-6)
        assert step.residual.min() >= -TOLERANCE


@pytest.mark.parametrize("formulation", FORMULATIONS, ids=str)
def test_ipopt_finds_the_same_plan_or_another_local_one_of_the_same_problem(
    formulation,
):
    same = other = only_one = 0
    settings = settings_of(head_on_share=0.0, **formulation)
    for question in islice(questions(seed=1), 50):
        sqp, ipopt = (question.ask(settings, make) for make in (szlib.MPCCBF, ByIpopt))
        if not (sqp.status == ipopt.status == "optimal"):
            only_one += sqp.status != ipopt.status
            continue
        assert sqp.feasible and sqp.residual.min(initial=0) >= -TOLERANCE
        one, two = (
            measure_cost(settings, question.state, step.target, step.inputs)
            for step in (sqp, ipopt)
        )
        if one == pytest.approx(two, rel=1e-6):
            same += 1
            assert sqp.control == pytest.approx(ipopt.control, abs=1e-3)
        else:
            other += 1
    assert same > 35 and other <= 1 and only_one <= 1


# --- the scenarios of the paper ----------------------------------------------------------------------

PAPER_RUNS = {
    "passing": (11.0, 0.171),
    "corridor": (14.8, 0.143),
    "waiting": (21.9, 0.102),
    "making_room": (23.4, 0.090),
}
"""Time to the goal [s] and least h [m] of the paper's controller with the paper's zone."""


@pytest.mark.parametrize("name", PAPER_RUNS)
def test_the_papers_controller_keeps_its_numbers(name):
    scenario, settings = szlib.SCENARIOS[name], szlib.MPCSettings.paper()
    controller = szlib.MPCCBF(PAPER_ZONE, walls=scenario.walls, settings=settings)
    log = szlib.simulate(scenario, controller)
    time, least = PAPER_RUNS[name]
    metrics = log.metrics()
    assert metrics["time_to_goal"] == pytest.approx(time, abs=1e-9)
    assert metrics["min_h"] == pytest.approx(least, abs=5e-4)
    assert metrics["infeasible_steps"] == 0 and set(log.status) == {"optimal"}


@pytest.mark.parametrize("name", szlib.SCENARIOS)
def test_the_scenarios_of_the_paper_keep_their_claims(name):
    scenario = szlib.SCENARIOS[name]
    log = szlib.simulate(scenario, controller_of(walls=scenario.walls))
    assert log.success and log.h.min() >= -TOLERANCE
    for claim in scenario.claims:
        holds, value = claim.check(log)
        assert holds, (claim.text, value)


@pytest.mark.parametrize("name", szlib.SCENARIOS)
def test_a_zone_that_is_entered_at_its_price_is_reported(name):
    """With `decay_price` the robot may cut into a zone, says so, and touches neither body nor wall."""
    scenario = szlib.SCENARIOS[name]
    settings = szlib.MPCSettings.among_people(time_limit=np.inf)
    controller = szlib.MPCCBF(ZONE, walls=scenario.walls, settings=settings)
    metrics = szlib.simulate(scenario, controller).metrics()
    assert metrics["success"] and metrics["min_clearance"] > 0.0
    assert metrics["unflagged_violations"] == metrics["unflagged_overlaps"] == 0


# --- the rows ----------------------------------------------------------------------------------------


def scene_of(rng, n_walls=2, n_people=2, spread=2.0):
    """Walls and a half-plane, and people, near the origin."""
    zones, people = [], rng.uniform(-spread, spread, (n_people, 4))
    for x, y, vx, vy in people.tolist():
        zones.append(Zone(*Zone.place(ZONE, (x, y), np.arctan2(vy, vx), (vx, vy))))
    walls = [
        Wall(*ends) for ends in rng.uniform(-spread, spread, (n_walls, 4)).tolist()
    ]
    return zones, [*walls, HalfPlane(rng.uniform(-2, 2, 2), rng.normal(size=2))]


def ask(s, state, target, zones, fixed):
    of_zones, of_fixed = Obstacles.of(zones, s), Obstacles.of(fixed, s)
    return Question(tuple(state), target, (0.0, 0.0), of_zones.joined(of_fixed))


@pytest.mark.parametrize("formulation", [{"N": 4, "N_h": 2}, GRID, PRICED], ids=str)
@pytest.mark.parametrize("has_floors", [False, True])
def test_linearised_rows_equal_those_by_differences(formulation, has_floors):
    s, rng = settings_of(**formulation), np.random.default_rng(3)
    zones, fixed = scene_of(rng)
    bodies = [Body(*z.numbers[7:9], *z.numbers[5:7]) for z in zones]
    groups = [
        group
        for items in (zones, fixed[:2], fixed[2:], bodies)
        for group in Obstacles.of(items, s).groups
        if list_conditions(s, group.kind, has_floors)
    ]
    shapes = tuple((g.kind, *g.numbers.shape) for g in groups)
    problem = Program(s, shapes, has_floors)
    problem.take(groups)
    state, target = rng.uniform(-1, 1, 4), (5.0, 1.0)
    problem.given[:4], problem.given[4:6] = state, target

    def rows(inputs):
        x = roll_out(s, state, inputs)
        found = []
        for group in groups:
            h = Obstacles((group,), s.r_robot).h(x[:, 0], x[:, 1], np.array(s.times))
            for own in h:
                for _, keep in list_conditions(s, group.kind, has_floors):
                    found.extend(
                        own[k + 1] - each * own[k] for k, each in enumerate(keep)
                    )
        return np.array(found)

    scale = max(1.0, np.hypot(*(state[:2] - target)))
    for _ in range(3):
        problem.inputs[:] = u = rng.uniform(-1, 1, (s.N, 2))
        problem.evaluate()
        n, first = 2 * s.N, problem.first
        assert problem.lower[first:] == pytest.approx(-rows(u), abs=1e-10)
        assert float(problem.cost[0]) == pytest.approx(
            measure_cost(s, state, target, u) / scale
        )
        for j in range(n):
            nudge = np.zeros(n)
            nudge[j] = 1e-6
            up, down = u + nudge.reshape(-1, 2), u - nudge.reshape(-1, 2)
            slope = (rows(up) - rows(down)) / 2e-6
            assert problem.slopes[first:, j] == pytest.approx(slope, abs=1e-7)
            rise = measure_cost(s, state, target, up) - measure_cost(
                s, state, target, down
            )
            assert problem.gradient[j] == pytest.approx(rise / 2e-6 / scale, abs=1e-6)


def test_walls_floors_keep_a_robot_that_obeys_them_able_to_stop():
    """h_{k+1} >= (1 - gamma_w) h_k is obeyed by a robot that brakes, and not by one that cannot stop."""
    s = settings_of(N=20)
    (floor,) = [c for c in list_conditions(s, Wall, True) if c.level == Priority.WALL]
    for v in np.linspace(0.05, 1.0, 20):
        h = [v * s.v_max / s.a_max]  # from where h falls by the share gamma_w of dt
        for keep in floor.keep:
            h.append(keep * h[-1])
        speeds = -np.diff(h) / s.dt
        assert (np.diff(speeds) <= 1e-12).all() and speeds[0] <= s.v_max + 1e-9
        assert (-np.diff(speeds) / s.dt <= s.a_max + 1e-9).all()


FINITE_PRICE = 1e-3
"""A level is above the next ones by a high price, so that its violation may exceed the least by this [m]."""


# --- priorities --------------------------------------------------------------------------------------


def find_least_violations(problem, chosen):
    """Least sums of violations of the `chosen` rows, level by level, by HiGHS."""
    n, first = len(problem.gradient), problem.first
    slopes = np.vstack([np.eye(n), problem.slopes[n:]])
    lower, upper, levels = problem.lower, problem.upper, problem.levels
    a, b, found = [], [], []
    for sign, bound in ((1.0, upper), (-1.0, -lower)):
        keep = np.abs(bound[:first]) < 1e29
        a.append(sign * slopes[:first][keep])
        b.append(bound[:first][keep])
    for level in list(Priority)[:3]:
        rows = np.flatnonzero((levels == level) & chosen)
        m, width = len(rows), n + len(rows)
        if not m:
            found.append(0.0)
            continue
        above = np.vstack(a)
        above = np.hstack([above, np.zeros((len(above), m))])
        own = np.hstack([-slopes[first + rows], -np.eye(m)])
        solved = linprog(
            np.r_[np.zeros(n), np.ones(m)],
            A_ub=np.vstack([above, own]),
            b_ub=np.concatenate([*b, -lower[first + rows]]),
            bounds=[(None, None)] * n + [(0, None)] * m,
            method="highs",
        )
        assert solved.status == 0, solved.message
        found.append(solved.fun)
        # the sum is fixed for the next levels, whichever rows are violated
        extra = np.zeros((m, width))
        extra[:, :n], extra[:, n:] = -slopes[first + rows], -np.eye(m)
        a = [np.hstack([each, np.zeros((len(each), m))]) for each in a]
        a += [extra, np.hstack([np.zeros((m, n)), -np.eye(m)])]
        a.append(np.r_[np.zeros(n), np.ones(m)][None])
        b += [-lower[first + rows], np.zeros(m), np.array([solved.fun + 1e-6])]
        slopes, n = np.hstack([slopes, np.zeros((len(slopes), m))]), width
    return found


def solve_once(s, question, guess):
    """The linear problem at a guess, the change of the inputs there, and the rows that can matter to it."""
    problem = Planner(s).prepare(question, has_floors=True)
    problem.inputs[:] = guess
    problem.evaluate()
    solved = problem.solve()
    assert solved is not None
    is_small = len(problem.levels) <= planner._FEW_ROWS
    is_near = is_small | (problem.lower > -planner.NEAR)
    return (
        problem,
        solved[0],
        np.broadcast_to(is_near, len(problem.lower))[problem.first :],
    )


def sum_violations(problem, change, chosen):
    left = problem.slopes[problem.first :] @ change
    short = np.maximum(problem.lower[problem.first :] - left, 0.0)
    return [
        short[chosen & (problem.levels == each)].sum() for each in list(Priority)[:3]
    ]


def contradictions(seed, n):
    """Questions whose floors contradict each other more often than not, and a guess."""
    rng = np.random.default_rng(seed)
    for _ in range(n):
        zones, fixed = scene_of(
            rng, int(rng.integers(1, 4)), int(rng.integers(1, 5)), 1.5
        )
        state = np.r_[rng.uniform(-0.5, 0.5, 2), rng.uniform(-0.7, 0.7, 2)]
        yield state, zones, fixed, rng


@pytest.mark.parametrize("formulation", [{}, {"N_h": 8}, PRICED], ids=str)
def test_each_level_is_violated_as_little_as_the_levels_above_allow(formulation):
    """Level by level against linear programs on the same rows; by their sums, whichever rows are violated."""
    s, relaxed = settings_of(**formulation), np.zeros(3, int)
    for state, zones, fixed, rng in contradictions(11, 60):
        question = ask(s, state, (6.0, 0.0), zones, fixed)
        guess = rng.uniform(-0.3, 0.3, (s.N, 2))
        problem, change, near = solve_once(s, question, guess)
        least = find_least_violations(problem, near)
        found = sum_violations(problem, change, near)
        assert found[0] == pytest.approx(least[0], abs=FINITE_PRICE), "walls"
        # with the split of the violation of walls that the planner chose
        if least[0] < 1e-6:
            assert found[1] == pytest.approx(least[1], abs=FINITE_PRICE), "bodies"
        if max(least[:2]) < 1e-6:
            assert found[2] == pytest.approx(least[2], abs=FINITE_PRICE), "zones"
        relaxed += np.array(least) > 1e-3
    assert (
        relaxed[0] > 10 and relaxed[1] > 5 and (relaxed[2] > 5 or s.decay_price < 1e9)
    )


@pytest.mark.parametrize("formulation", [{}, PRICED], ids=str)
def test_more_people_never_raise_the_violation_of_walls(formulation):
    s, contradicted = settings_of(**formulation), 0
    for state, zones, fixed, rng in contradictions(12, 30):
        guess = rng.uniform(-0.3, 0.3, (s.N, 2))
        walls = []
        for n in (0, 1, len(zones)):
            question = ask(s, state, (6.0, 0.0), zones[:n], fixed)
            problem, change, near = solve_once(s, question, guess)
            walls.append(sum_violations(problem, change, near)[0])
        assert walls == pytest.approx([walls[0]] * 3, abs=FINITE_PRICE)
        contradicted += walls[0] > 1e-3
    assert contradicted > 8


@pytest.mark.parametrize("formulation", [{"N_h": 8}, PRICED], ids=str)
def test_a_plan_that_has_converged_violates_the_least_by_a_linear_program_there(
    formulation,
):
    """With all rows, from the plan itself: no change of the plan has a lower violation of walls."""
    s, compared = settings_of(**formulation), 0
    for state, zones, fixed, _ in contradictions(13, 40):
        question = ask(s, state, (6.0, 0.0), zones, fixed)
        plan = Planner(s).plan(question, np.zeros((s.N, 2)))
        problem, change, near = solve_once(s, question, plan.inputs)
        has_floors = plan.is_relaxed or s.decay_price < np.inf
        if not has_floors or np.abs(change).max() > 1e-2:
            continue  # or it was stopped by the number of iterations
        every = np.ones_like(near)
        least = find_least_violations(problem, every)[0]
        found = sum_violations(problem, np.zeros(2 * s.N), every)[0]
        assert found == pytest.approx(least, abs=5e-3)
        compared += found > 1e-2
    assert compared > 5


def test_a_step_between_a_wall_and_people_violates_zones_and_no_wall():
    walls, people = [[(-20.0, 0.0), (20.0, 0.0)]], [[0.0, 2.0, 0.0, -1.2], [0.6, 2.2, 0.0, -1.2]]  # fmt: skip
    converged = {"time_limit": np.inf, "max_iterations": 100}
    for settings in (settings_of(N_h=8), szlib.MPCSettings.among_people(**converged)):
        step = szlib.MPCCBF(ZONE, walls=walls, settings=settings).step(
            (0.0, 0.62, 0.0, 0.0), (6.0, 0.62), people
        )
        assert step.status in ("relaxed", "restarted", "braking", "optimal")
        assert step.violations[Priority.WALL] <= TOLERANCE
        assert max(step.violations.values()) > 0.01 and step.walls_safe
        assert step.verify().ok


def test_one_iteration_solves_one_program_where_no_floor_is_violated(monkeypatch):
    solved, original = [], planner.Program._solve_rows
    monkeypatch.setattr(
        planner.Program,
        "_solve_rows",
        lambda *given: solved.append(1) or original(*given),
    )
    for question in islice(questions(seed=5), 30):
        solved.clear()
        step = question.ask(settings_of(max_iterations=1))
        assert step.status != "optimal" or len(solved) == 1


def test_a_price_that_no_plan_pays_changes_nothing():
    """A decay with a price is the exact penalty of the hard one: a high price gives the same plan."""
    compared = 0
    for question in islice(questions(seed=6), 40):
        hard = question.ask(settings_of(N_h=8))
        priced = question.ask(settings_of(N_h=8, decay_price=5e4))
        if hard.status == "optimal" and hard.violations[Priority.WALL] <= TOLERANCE:
            compared += 1
            assert priced.control == pytest.approx(hard.control, abs=1e-3)
    assert compared > 20


def test_one_step_of_an_even_grid_is_the_step_without_a_grid():
    person, plain = szlib.Person((0.0, 0.3), (-0.5, 0.0)), settings_of(N=6, N_h=6)
    steps = [
        szlib.MPCCBF(ZONE, settings=each).step((-2.6, 0.0, 0.6, 0.0), GOAL, [person])
        for each in (plain, replace(plain, grid=(1,) * 6))
    ]
    assert steps[1].control == pytest.approx(steps[0].control, abs=1e-9)


def test_rows_that_are_left_out_change_no_plan(monkeypatch):
    """Beyond 64 rows a program holds those near their bound: the same plan as with all of them."""
    rng, compared = np.random.default_rng(9), 0
    s = szlib.MPCSettings.among_people(time_limit=np.inf, max_iterations=100)
    for _ in range(12):
        people = np.c_[rng.uniform(-6, 6, (9, 2)), rng.uniform(-1, 1, (9, 2))]
        if np.hypot(*people[:, :2].T).min() < 1.2:
            continue
        steps = []
        for few in (64, 10_000):
            monkeypatch.setattr(planner, "_FEW_ROWS", few)
            controller = szlib.MPCCBF(ZONE, settings=s)
            steps.append(controller.step((0.0, 0.0, 0.4, 0.0), (8.0, 0.0), people))
        assert steps[0].inputs == pytest.approx(steps[1].inputs, abs=2e-3)
        compared += 1
    assert compared > 4


# --- the terminal condition --------------------------------------------------------------------------


def drive(controller, state, goal, people, steps):
    """States and steps among people who walk as predicted."""
    for _ in range(steps):
        step = controller.step(state, goal, people)
        yield state, step
        state = advance(state, step.control, controller.settings.dt)
        people = [p.after(controller.settings.dt) for p in people]


@pytest.mark.parametrize(("make", "worlds"), [(szlib.MPCCBF, 30), (ByIpopt, 1)])
def test_terminal_rest_keeps_plans_feasible_among_walls_and_standing_people(
    make, worlds
):
    asked = 0
    for question in islice(questions(seed=2), worlds):
        people = [replace(p, velocity=(0.0, 0.0)) for p in question.people]
        controller = controller_of(question.walls, make, terminal="rest")
        state = np.r_[question.state[:2], 0, 0]
        places = state[:2], question.goal
        if min(controller.barriers(p, people).min(initial=0) for p in places) < 0:
            continue
        for x, step in drive(controller, state, question.goal, people, 120):
            asked += 1
            assert step.feasible, (x, step.status, step.slack)
            assert step.h.min(initial=0) >= -TOLERANCE
            assert np.abs(step.predicted[-1, 2:]).max() <= TOLERANCE
    assert asked > 40 * worlds


def test_a_robot_too_fast_to_stop_within_the_horizon_brakes():
    controller = controller_of(terminal="rest")
    step = controller.step((-4.0, 0.0, 1.0, 0.0), GOAL, [FACING])
    assert step.control == pytest.approx((-1.0, 0.0))
    assert step.slack == pytest.approx(0.2) and not step.feasible
    assert step.status == "braking"


# --- meetings head-on --------------------------------------------------------------------------------


def test_symmetric_meetings_are_passed_on_the_chosen_side_or_on_the_free_one():
    for scenario, place in islice(meetings(seed=5), 30):
        log = szlib.simulate(scenario, controller_of(scenario.walls))
        assert log.success, (place, scenario)
        side = "left" if place == "wall" else "right"
        assert log.metrics()["passing_side"] == side, (place, scenario)


# --- time --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("wall", "thread", "is_spent"),
    [(0.4, 0.4, False), (0.6, 0.4, False), (0.4, 0.6, False), (0.6, 0.6, True)],
)
def test_time_is_up_by_both_clocks(monkeypatch, wall, thread, is_spent):
    """A busy machine stops the thread, and a coarse clock of the thread runs ahead."""
    clocks = {"perf_counter": 100.0, "thread_time": 7.0}
    for name in clocks:
        monkeypatch.setattr(planner, name, lambda name=name: clocks[name])
    budget = Planner(szlib.MPCSettings(time_limit=0.5))
    assert not budget.is_late
    clocks["perf_counter"] += wall
    clocks["thread_time"] += thread
    assert budget.is_late == is_spent
    budget.begin(clocks["perf_counter"])
    assert not budget.is_late


def tick(monkeypatch: Any, seconds: float) -> None:
    """Clocks that advance by so much each time they are read."""
    wall, thread = count(), count()
    monkeypatch.setattr(planner, "perf_counter", lambda: seconds * next(wall))
    monkeypatch.setattr(planner, "thread_time", lambda: seconds * next(thread))


@pytest.mark.parametrize("terminal", ["none", "rest"])
@pytest.mark.parametrize("seconds", [1e-4, 0.02, 1.0])
def test_a_step_out_of_time_reports_it_and_keeps_its_promises(
    monkeypatch, seconds, terminal
):
    for question in islice(questions(seed=22), 15):
        s = szlib.MPCSettings(terminal=terminal)
        controller = szlib.MPCCBF(ZONE, walls=question.walls, settings=s)
        with monkeypatch.context() as clock:
            tick(clock, seconds)
            step = controller.step(question.state, question.goal, question.people)
        assert np.isfinite(step.control).all() and np.abs(step.control).max() <= 1
        assert step.verify().ok and step.feasible == (step.slack <= 1e-6)
        at_leisure = question.ask(replace(s, time_limit=np.inf))
        assert step.walls_safe >= at_leisure.walls_safe
        if not step.timed_out:
            assert step.control == pytest.approx(at_leisure.control, abs=1e-9)


@pytest.mark.parametrize(("deadline", "is_late"), [(np.inf, False), (0.02, True)])
def test_a_deadline_counts_time_in_which_the_thread_does_not_run(
    monkeypatch, deadline, is_late
):
    ticks = count()
    for module in (planner, mpc):
        monkeypatch.setattr(module, "perf_counter", lambda: 0.015 * next(ticks))
    monkeypatch.setattr(planner, "thread_time", lambda: 0.0)
    settings = szlib.MPCSettings(deadline=deadline)
    step = szlib.MPCCBF(ZONE, settings=settings).step((-1.9, 0, 1, 0), GOAL, [FACING])
    assert step.timed_out == is_late
    assert ("time was up after 0.02 s" in step.explain()) == is_late


@pytest.mark.parametrize("price", [100.0, 1e5, 1e6])
def test_a_finite_price_buys_a_violation_however_high_it_is(price):
    """The report and the planner agree on which rows have a price."""
    controller = controller_of(decay_price=price, N_h=8)
    person = szlib.Person((0.0, 0.0), (-0.5, 0.0))
    step = controller.step((-2.8, 0.0, 1.0, 0.0), GOAL, [person])
    assert step.violations[Priority.DECAY] > TOLERANCE
    assert step.feasible and step.status == "optimal"


def test_a_plan_of_long_steps_that_is_optimal_is_feasible():
    """The last change of the inputs moves a velocity by no more than the square root of the tolerance."""
    controller = controller_of(dt=0.5, grid=(1, 2, 4, 4, 4))
    rng = np.random.default_rng(0)
    starts = [(0.43624991, 4.35072424), *rng.uniform(-5, 5, (40, 2))]
    goals = [(3.15853554, -4.972615), *rng.uniform(-5, 5, (40, 2))]
    for start, goal in zip(starts, goals, strict=True):
        controller.reset()
        step = controller.step((*start, 0.0, 0.0), goal)
        assert step.status == "optimal" and step.feasible, step.slack
