"""The two solvers compared, the fallbacks, and the guarantees of the terminal conditions."""

import re
from dataclasses import replace
from itertools import islice
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from helpers.random_states import ZONE, meetings, questions

import szlib
from szlib.control.controller import advance
from szlib.control.problem import PlanEvaluation, build_problem, remaining_distance
from szlib.control.settings import TOLERANCE, Crowding
from szlib.control.solvers import fallbacks, sqp
from szlib.control.solvers.sqp_functions import QuadraticProgram, build_sqp_functions

SOLVERS = ("sqp", "ipopt")
GOAL = (4.0, 0.0)
FACING = szlib.Person((0.0, 0.0), heading=np.pi)
CROWDED = {
    "grid": (1, 1, 2, 3),
    "jerk_weight": 1.0,
    "crowding": Crowding(few=1, many=2),
}
FORMULATIONS = ({}, {"N_h": 8}, {"terminal": "rest"}, CROWDED)


def settings_of(solver, **settings):
    """Settings without a time limit, so that a busy machine changes nothing."""
    return szlib.MPCSettings(solver=solver, **{"time_limit": np.inf} | settings)


def controller_of(solver, walls=(), **settings):
    return szlib.MPCCBF(ZONE, walls=walls, settings=settings_of(solver, **settings))


@pytest.mark.parametrize(
    ("formulation", "count"),
    [*zip(FORMULATIONS, (50, 50, 100, 100), strict=True)],
    ids=str,
)
def test_both_solvers_find_the_same_plan_or_another_local_one_of_the_same_problem(
    formulation, count
):
    same = other = only_one = 0
    for question in islice(questions(seed=1), count):
        sqp, ipopt = (
            question.ask(settings_of(solver, head_on_share=0.0, **formulation))
            for solver in SOLVERS
        )
        if not (sqp.status == ipopt.status == "optimal"):
            only_one += sqp.status != ipopt.status
            continue
        assert sqp.feasible and (
            "crowding" in formulation or sqp.residual.min(initial=0) >= -TOLERANCE
        )
        if sqp.cost == pytest.approx(ipopt.cost, rel=1e-6):
            same += 1
            assert sqp.control == pytest.approx(ipopt.control, abs=1e-3)
        else:
            other += 1
    most = 0.03 if "crowding" in formulation else 0.02  # prices make more local minima
    assert same > 0.7 * count and other <= most * count and only_one <= 0.01 * count


@pytest.mark.parametrize("name", szlib.SCENARIOS)
def test_both_solvers_drive_the_scenarios_of_the_paper_alike(name):
    scenario = szlib.SCENARIOS[name]
    sqp, ipopt = (
        szlib.simulate(scenario, controller_of(s, scenario.walls)) for s in SOLVERS
    )
    for log in (sqp, ipopt):
        assert log.metrics()["infeasible_steps"] == 0
        assert all(claim.check(log)[0] for claim in scenario.claims)
    assert sqp.metrics()["passing_side"] == ipopt.metrics()["passing_side"]
    assert sqp.metrics()["time_to_goal"] == pytest.approx(
        ipopt.metrics()["time_to_goal"], abs=0.2
    )


def test_each_solver_package_is_imported_by_its_modules_only():
    found = {"casadi": set(), "daqp": set()}
    for file in Path(szlib.__file__).parent.rglob("*.py"):
        text = file.read_text(encoding="utf-8")
        for package, where in found.items():
            if re.search(rf"^\s*(import|from) {package}\b", text, re.MULTILINE):
                where.add(file.stem)
    assert found == {"casadi": {"problem", "ipopt", "sqp_functions"}, "daqp": {"sqp"}}


@pytest.mark.parametrize("formulation", FORMULATIONS, ids=str)
def test_structured_derivatives_equal_automatic_ones(formulation):
    settings = szlib.MPCSettings(**formulation)
    p = build_problem(settings, 2, 1)
    values = ca.vertcat(p.rows, p.terminal)
    multipliers = ca.SX.sym("multipliers", values.numel())
    arguments = [p.inputs, p.parameters, multipliers]
    cost = p.cost / remaining_distance(*(p.parameters[i] for i in (0, 1, 4, 5)))
    on_speed = ca.dot(multipliers[p.n_cbf : p.rows.numel()], p.rows[p.n_cbf :])
    expected = ca.Function(
        "expected",
        arguments,
        [
            ca.gradient(cost, p.inputs),
            ca.jacobian(values, p.inputs),
            ca.hessian(cost + ca.dot(multipliers, values), p.inputs)[0],
            ca.hessian(cost + on_speed, p.inputs)[0],
        ],
    )
    rng, at = (
        np.random.default_rng(8),
        [np.zeros(symbols.numel()) for symbols in arguments],
    )
    program = QuadraticProgram(build_sqp_functions(settings, 2, 1), settings.N_h, *at)
    for _ in range(5):
        for array in at:
            array[:] = rng.normal(size=array.size)
        program.derive()
        found = program.gradient, program.jacobian, program.exact, program.gauss
        for one, other in zip(found, expected(*at), strict=True):
            assert one.reshape(other.shape) == pytest.approx(
                np.asarray(other), rel=1e-11, abs=1e-11
            )


@pytest.mark.parametrize("formulation", FORMULATIONS, ids=str)
def test_steps_that_raise_the_merit_at_first_lead_to_the_same_plan(
    monkeypatch, formulation
):
    asked = list(islice(questions(seed=9), 60))
    answers = []
    for rises in (0, 1, sqp.RISES):
        monkeypatch.setattr(sqp, "RISES", rises)
        answers.append(
            [question.ask(settings_of("sqp", **formulation)) for question in asked]
        )
    for steps in zip(*answers, strict=True):
        assert len({step.fallback for step in steps}) == 1
        for step in steps[1:]:
            assert step.control == pytest.approx(steps[0].control, abs=1e-5)


# the ladder


def broken(monkeypatch, controller, *names):
    solver = controller._pool.get(1, 0)
    for name in names:
        monkeypatch.setattr(
            solver,
            name,
            lambda guess, numbers: (solver.evaluate(guess, numbers), False),
        )


@pytest.mark.parametrize("solver", SOLVERS)
def test_fallbacks_warm_and_cold_give_the_same_control(solver):
    controller = controller_of(solver)
    state = np.array([-3.0, 0.4, 0.5, 0.0])
    warm = controller.step(state, GOAL, [FACING])
    controller._plan[:] = np.nan
    cold = controller.step(state, GOAL, [FACING])
    assert (warm.fallback, cold.fallback) == ("warm", "cold")
    assert cold.control == pytest.approx(warm.control, abs=1e-5)
    assert warm.feasible and cold.feasible


@pytest.mark.parametrize("solver", SOLVERS)
def test_fallback_kept_follows_the_last_plan_while_it_is_feasible(solver, monkeypatch):
    controller = controller_of(solver, terminal="rest")
    state = np.array([-2.6, 0.4, 0.5, 0.0])
    before = controller.step(state, GOAL, [FACING])
    broken(monkeypatch, controller, "hard", "relaxed")
    for k in range(1, 8):
        state = advance(state, before.control if k == 1 else step.control, 0.1)  # noqa: F821
        step = controller.step(state, GOAL, [FACING])
        assert step.fallback == step.status == "kept" and step.feasible
        assert state == pytest.approx(before.predicted[k])
    assert step.predicted[1, 2:] == pytest.approx((0, 0), abs=TOLERANCE)


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("formulation", ({}, {"N_h": 8}), ids=str)
def test_fallback_relaxed_reports_the_violation_of_the_hard_problem(
    solver, formulation
):
    step = controller_of(solver, **formulation).step(
        (-1.9, 0.0, 0.7, 0.0), GOAL, [FACING]
    )
    assert step.fallback == step.status == "relaxed"
    assert step.slack == pytest.approx(-step.residual.min()) and step.slack > 1e-3
    assert not step.feasible and not step.safe


@pytest.mark.parametrize("solver", SOLVERS)
def test_fallback_braking_is_used_when_no_solver_finds_a_plan(solver, monkeypatch):
    controller = controller_of(solver)
    broken(monkeypatch, controller, "hard", "relaxed")
    step = controller.step((-3.0, 0.0, 0.8, -0.4), GOAL, [FACING])
    assert step.fallback == step.status == "braking"
    assert step.control == pytest.approx((-1.0, 0.5))
    assert step.predicted[-1, 2:] == pytest.approx((0, 0), abs=1e-12)


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_robot_too_fast_to_stop_within_the_horizon_brakes(solver):
    controller = controller_of(solver, terminal="rest")
    step = controller.step((-4.0, 0.0, 1.0, 0.0), GOAL, [FACING])
    assert step.fallback == "braking"
    assert step.slack == pytest.approx(0.2) and not step.feasible
    assert step.control == pytest.approx((-1.0, 0.0))


def test_the_metrics_count_each_fallback():
    close = szlib.Person((0.0, 0.0), (-0.5, 0.0))
    scenario = szlib.Scenario("close", (-1.9, 0.0, 0.0, 0.0), (4.0, 0.0), (close,))
    log = szlib.simulate(scenario, controller_of("sqp"))
    counts = {k: v for k, v in log.metrics().items() if k.startswith("steps_")}
    assert sum(counts.values()) == len(log.table) - 1, (
        "the control of the last state is not applied"
    )
    assert (
        counts["steps_relaxed"] == (log.table["fallback"][:-1] == "relaxed").sum() > 0
    )
    assert (
        log.metrics()["infeasible_steps"]
        == (log.table["slack"][:-1] > TOLERANCE).sum()
        > 0
    )


# guarantees of the terminal conditions


def drive(controller, state, goal, people, steps):
    """States, steps and people, as predicted."""
    for _ in range(steps):
        step = controller.step(state, goal, people)
        yield state, step, people
        state = advance(state, step.control, controller.settings.dt)
        people = [p.after(controller.settings.dt) for p in people]


@pytest.mark.parametrize(("solver", "worlds"), [("sqp", 40), ("ipopt", 1)])
def test_terminal_rest_keeps_plans_feasible_among_walls_and_standing_people(
    solver, worlds
):
    asked = 0
    for question in islice(questions(seed=2), worlds):
        people = [replace(p, velocity=(0.0, 0.0)) for p in question.people]
        controller = controller_of(solver, question.walls, terminal="rest")
        state = np.r_[question.state[:2], 0, 0]
        if (
            min(
                controller.barriers(p, people).min(initial=0)
                for p in (state[:2], question.goal)
            )
            < 0
        ):
            continue
        for x, step, _ in drive(controller, state, question.goal, people, 120):
            asked += 1
            assert step.feasible, (x, step.fallback, step.slack)
            assert step.h.min(initial=0) >= -TOLERANCE
            assert np.abs(step.predicted[-1, 2:]).max() <= TOLERANCE
    assert asked > 40 * worlds


def rooms(seed):
    """A robot at rest in a closed room, and two people who keep walking through it at up to 1.2 m/s."""
    rng = np.random.default_rng(seed)
    corners = 3.0 * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    walls = np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)
    while True:
        angles = rng.uniform(-np.pi, np.pi, 2)
        starts = 6 * np.c_[np.cos(angles), np.sin(angles)]
        courses = rng.uniform(-2, 2, (2, 2)) - starts
        paces = rng.uniform(0.3, 1.2, 2) / np.hypot(*courses.T)
        people = [
            szlib.Person(tuple(p), tuple(v * pace))
            for p, v, pace in zip(starts, courses, paces, strict=True)
        ]
        yield np.r_[rng.uniform(-2, 2, 2), 0, 0], rng.uniform(-2, 2, 2), people, walls


@pytest.mark.parametrize(("solver", "worlds"), [("sqp", 40), ("ipopt", 1)])
def test_terminal_rest_never_lets_a_moving_robot_hit_a_person_who_walks_as_predicted(
    solver, worlds
):
    fallbacks, reached = set(), 0
    for state, goal, people, walls in islice(rooms(seed=3), worlds):
        controller = controller_of(solver, walls, terminal="rest")
        for x, step, _ in drive(controller, state, goal, people, 150):
            fallbacks.add(step.fallback)
            if step.h.min() < -10 * TOLERANCE:
                reached += 1
                assert x[2:] == pytest.approx((0, 0), abs=1e-5)
                break
    assert reached >= worlds // 10
    assert solver == "ipopt" or {"warm", "kept", "relaxed"} <= fallbacks


@pytest.mark.parametrize(("solver", "worlds"), [("sqp", 20), ("ipopt", 1)])
def test_terminal_person_keeps_plans_feasible_although_the_person_walks(solver, worlds):
    rng, asked = np.random.default_rng(4), 0
    while asked < worlds * 100:
        person = szlib.Person(
            tuple(rng.uniform(-1, 1, 2)), tuple(rng.uniform(-0.5, 0.5, 2))
        )
        controller = controller_of(solver, terminal="person")
        state = np.r_[rng.uniform(-4, 4, 2), 0, 0]
        if not controller.step(state, -state[:2], [person]).safe:
            continue
        for x, step, _ in drive(controller, state, -state[:2], [person], 100):
            asked += 1
            assert step.feasible, (x, step.fallback, step.slack)
            assert step.h.min() >= -TOLERANCE
            assert step.predicted[-1, 2:] == pytest.approx(
                person.velocity, abs=TOLERANCE
            )


def test_an_invalid_terminal_condition_raises_an_error():
    with pytest.raises(szlib.SolverError, match="open space; got 1 walls"):
        controller_of("sqp", [((0, 5), (1, 5))], terminal="person")
    for number in (-1, 1001, 10**400, 2.0):
        with pytest.raises(
            szlib.SolverError, match="max_people must be a whole number from 0 to 1000"
        ):
            szlib.MPCCBF(ZONE, max_people=number)
    assert szlib.MPCSettings(terminal="rest").N_h == 8


# head-on


@pytest.mark.parametrize(("solver", "count"), [("sqp", 40), ("ipopt", 2)])
def test_symmetric_meetings_are_passed_on_the_chosen_side_or_on_the_free_one(
    solver, count
):
    for scenario, place in islice(meetings(seed=5), count):
        log = szlib.simulate(scenario, controller_of(solver, scenario.walls))
        assert log.success, (place, scenario)
        assert log.metrics()["passing_side"] == (
            "left" if place == "wall" else "right"
        ), (place, scenario)


def test_a_symmetric_meeting_is_reproducible():
    scenario, _ = next(meetings(seed=6))
    first, again = (
        szlib.simulate(scenario, controller_of("sqp", scenario.walls)) for _ in range(2)
    )
    assert np.array_equal(first.predicted, again.predicted)


@pytest.mark.parametrize(
    ("end", "h", "is_safe"),
    [
        (0, [0.1, -0.1, -0.1, -0.1], True),  # at the terminal velocity from the start
        (0, [-0.1, 0.1, 0.1, 0.1], False),
        (2, [0.1, 0.1, 0.1, -0.1], True),
        (2, [0.1, 0.1, -0.1, 0.1], False),
        (3, [0.1, 0.1, 0.1, 0.1], True),
        (3, [0.1, 0.1, 0.1, -0.1], False),
        (4, [0.1, 0.1, 0.1, 0.1], False),  # never there
    ],
)
def test_a_safe_end_is_the_terminal_velocity_with_every_barrier_held_until_then(
    end, h, is_safe
):
    states = np.zeros((4, 4))
    states[:, 2] = np.where(np.arange(4) < end, 0.5, 0.2)
    plan = PlanEvaluation(
        0.0, 0.0, np.zeros(6), np.zeros(0), states, np.array([[1.0] * 4, h])
    )
    parameters = np.zeros(12)
    parameters[6] = 0.2
    assert fallbacks._reaches_safe_end(plan, parameters) == is_safe


def test_the_merit_of_a_plan_is_its_cost_and_the_price_of_its_violation():
    controller = controller_of("sqp")
    step = controller.step((-1.9, 0.0, 1.0, 0.0), GOAL, [FACING])
    assert step.fallback == "relaxed"
    solver = controller._pool.get(1, 0)
    free, priced = solver._merit(0.0, 0.0), solver._merit(3.0, 0.0)
    violation = solver._after[1]
    assert violation > 1e-3 and priced == pytest.approx(free + 3 * violation)
