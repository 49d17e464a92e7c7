"""The solver pool: unused slots and sizes built ahead change nothing; walls of any shape; copies."""

import copy
import pickle
import threading
from concurrent.futures import ThreadPoolExecutor
from itertools import islice

import numpy as np
import pytest
import shapely
from helpers.random_states import ZONE, questions
from szlib.control.obstacles import compute_h, read_walls

import szlib
from szlib.control import problem
from szlib.control.controller import advance
from szlib.control.solvers import solver_pool
from szlib.control.solvers.solver_pool import (
    INACTIVE_H,
    padded_parameters,
    round_up_size,
)

GOAL = (4.0, 0.0)
SOLVERS = ("sqp", "ipopt")
FORMULATIONS = ({}, {"N_h": 8}, {"terminal": "rest"})


def controller_of(solver="sqp", walls=(), max_people=None, **settings):
    chosen = szlib.MPCSettings(solver=solver, time_limit=np.inf, **settings)
    return szlib.MPCCBF(ZONE, walls=walls, settings=chosen, max_people=max_people)


def crowd(n, k=0):
    """People around the way, k steps of 0.1 s later."""
    rng = np.random.default_rng(6)
    rows = np.c_[
        rng.uniform(-6, 10, 40),
        rng.choice([-1, 1], 40) * rng.uniform(1.8, 5, 40),
        np.zeros((40, 2)),
    ]
    rows[:, 2:] = rng.uniform(-0.2, 0.2, (40, 2))
    return (rows + 0.1 * k * np.c_[rows[:, 2:], np.zeros((40, 2))])[:n]


def drive(controller, numbers, turn=None):
    """The states and controls of a robot among so many people at each step."""
    state, found = np.array([-4.0, 0.0, 0.0, 0.0]), []
    for k, n in enumerate(numbers):
        if turn is not None:
            turn(controller, k)
        step = controller.step(state, GOAL, crowd(n, k))
        found.append(np.r_[state, step.control])
        state = advance(state, step.control, 0.1)
    return np.array(found)


def wait_for_the_builder(controller, _=None):
    if controller._pool._builder is not None:
        controller._pool._builder.join()


# empty slots


def test_sizes_are_powers_of_two_and_three_quarters_of_them():
    assert sorted({round_up_size(n) for n in range(49)}) == [
        0,
        1,
        2,
        3,
        4,
        6,
        8,
        12,
        16,
        24,
        32,
        48,
    ]
    assert all(n <= round_up_size(n) < 1.5 * n for n in range(1, 1000))


@pytest.mark.parametrize("formulation", FORMULATIONS, ids=str)
@pytest.mark.parametrize(("solver", "count"), [("sqp", 60), ("ipopt", 3)])
def test_empty_slots_do_not_change_the_control(monkeypatch, solver, count, formulation):
    for question in islice(questions(seed=31), count):
        answers = []
        for size in (lambda n: n, lambda n: 4 if n <= 4 else 8):
            monkeypatch.setattr(solver_pool, "round_up_size", size)
            controller = controller_of(
                solver, question.walls, max_people=0, **formulation
            )
            steps = [
                controller.step(question.state, question.goal, question.people)
                for _ in range(2)
            ]
            answers.append(steps)
        assert controller._pool.get(
            len(question.people), len(question.walls)
        ).evaluate.size == (4, 4)
        for exact, padded in zip(*answers, strict=True):
            assert padded.control == pytest.approx(exact.control, abs=1e-6)
            assert padded.fallback == exact.fallback
            assert padded.slack == pytest.approx(exact.slack, abs=1e-6)
            assert (
                padded.h == pytest.approx(exact.h)
                and padded.residual.shape == exact.residual.shape
            )
            assert padded.residual == pytest.approx(exact.residual, abs=1e-5)
            assert (
                max(
                    np.abs(padded.h).max(initial=0),
                    np.abs(padded.residual).max(initial=0),
                )
                < INACTIVE_H / 100
            )


# building ahead


def test_empty_slots_are_far_from_everything():
    parameters = padded_parameters((3.0, -2.0, 1.0, 0.0), [], [], (2, 2))
    people, walls = (
        np.reshape(parameters[:18], (2, 9))[:, :7],
        np.reshape(parameters[18:], (2, 5)),
    )
    for x, y in ((3.0, -2.0), (13.0, -2.0), (3.0, 8.0)):
        h = compute_h(x, y, people.tolist(), walls.tolist(), r_robot=0.5, eps=0.05)
        assert min(h) > INACTIVE_H


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_run_is_the_same_whether_or_not_a_size_was_built_ahead(monkeypatch, solver):
    numbers = [3] * 3 + [4] * 3 + [9] * 3 + [3] * 2 + [20] * 3 + [0] * 2
    ahead = drive(controller_of(solver), numbers, wait_for_the_builder)
    racing = drive(controller_of(solver), numbers)
    monkeypatch.setattr(solver_pool.Thread, "start", lambda _: None)
    in_place = drive(controller_of(solver), numbers)
    assert np.array_equal(ahead, racing) and np.array_equal(ahead, in_place)


def test_a_controller_is_built_for_eight_people_and_doubles_when_half_are_present(
    caplog,
):
    caplog.set_level("INFO", logger="szlib")
    controller = controller_of()
    built = controller._pool._solvers
    assert {people for people, _ in built} == {0, 1, 2, 3, 4, 6, 8}
    drive(controller, [3])
    wait_for_the_builder(controller)
    assert max(built)[0] == 8
    for n, largest in ((4, 16), (8, 32), (15, 32), (16, 64)):
        drive(controller, [n])
        wait_for_the_builder(controller)
        assert max(built)[0] == largest
    assert not caplog.records, "nothing had to be built in place"
    drive(controller_of(), [20])
    assert "built for 8 people and now grows to 24" in caplog.text


def test_a_controller_with_a_given_number_of_people_builds_no_more_sizes():
    controller = controller_of(max_people=4)
    drive(controller, [4])
    assert controller._pool._builder is None
    assert {people for people, _ in controller._pool._solvers} == {0, 1, 2, 3, 4}


# walls


BOX = shapely.box(0, 0, 4, 2)


@pytest.mark.parametrize(
    ("walls", "count"),
    [
        ([], 0),
        (np.zeros((0, 2, 2)), 0),
        ([[(0, 0), (1, 0)], [(1, 0), (1, 1)]], 2),
        ([(0, 0), (1, 0), (1, 1)], 2),
        (np.array([(0, 0), (1, 0), (1, 1), (0, 1)]), 3),
        ([[(0, 0), (1, 0), (1, 1)], [(5, 5), (6, 6)]], 3),
        (shapely.LineString([(0, 0), (1, 0), (1, 0), (1, 1)]), 2),
        (shapely.LineString([(0, 0, 7), (1, 0, 7)]), 1),
        ([shapely.LineString([(0, 0), (1, 0)]), [(2, 2), (3, 3)]], 2),
        (BOX, 4),
        (BOX.difference(shapely.box(1, 0.5, 2, 1)), 8),
        (shapely.MultiLineString([[(0, 0), (1, 0)], [(2, 0), (3, 0), (4, 0)]]), 3),
        (shapely.GeometryCollection([BOX, shapely.LineString([(9, 9), (8, 8)])]), 5),
        (shapely.union(BOX, shapely.box(8, 0, 9, 1)), 8),
        (BOX.exterior, 4),
    ],
    ids=lambda each: type(each).__name__ if not isinstance(each, int) else str(each),
)
def test_walls_may_be_segments_lines_and_shapes(walls, count):
    segments = read_walls(walls)
    assert segments.shape == (count, 2, 2)
    if hasattr(walls, "boundary") and hasattr(walls, "length"):
        assert np.hypot(*(segments[:, 1] - segments[:, 0]).T).sum() == pytest.approx(
            walls.length
        )
    assert np.array_equal(szlib.MPCCBF(ZONE, walls=walls, max_people=0).walls, segments)


def test_the_same_wall_in_any_shape_gives_the_same_control():
    rings = [BOX, BOX.exterior, list(BOX.exterior.coords), read_walls(BOX)]
    steps = [
        controller_of(walls=walls).step((-1.0, 1.0, 0.4, 0), (5.0, -2.0))
        for walls in rings
    ]
    assert all(np.array_equal(step.control, steps[0].control) for step in steps)
    assert len(steps[0].h) == 4


@pytest.mark.parametrize(
    "walls",
    [
        5,
        "wall",
        None,
        shapely.Point(0, 0),
        [(0, 0)],
        [(0, 0, 0), (1, 1, 1)],
        [[(0, 0), (0, 0), (0, 0)]],
    ],
)
def test_objects_that_are_not_walls_raise_an_error(walls):
    with pytest.raises(szlib.SolverError, match="wall"):
        szlib.MPCCBF(ZONE, walls=walls)


@pytest.mark.parametrize("solver", SOLVERS)
def test_walls_set_between_steps_give_the_steps_of_a_controller_built_with_them(solver):
    some, more = [[(-6, 1.5), (6, 1.5)]], shapely.box(-8, -3, 9, 3)
    state, controller = np.array([-4.0, 0.0, 0.0, 0.0]), controller_of(solver, some)
    for k, walls in enumerate([some, more, [], some, more] * 3):
        controller.set_walls(walls)
        anew = controller_of(solver, walls)
        step, other = (c.step(state, GOAL, crowd(2, k)) for c in (controller, anew))
        assert step.h == pytest.approx(other.h)
        assert step.control == pytest.approx(other.control, abs=1e-4)
        state = advance(state, step.control, 0.1)


def test_a_wall_set_around_the_goal_of_a_moving_robot_sets_goal_blocked():
    controller = controller_of()
    assert not controller.step((-4, 0, 0, 0), GOAL).goal_blocked
    controller.set_walls([[(4, -1), (4, 1)]])
    assert controller.step((-4, 0, 0, 0), GOAL).goal_blocked
    with pytest.raises(szlib.SolverError, match="wall"):
        controller.set_walls([[(0, 0), (0, 0)]])
    assert len(controller.walls) == 1, "it keeps those that it had"
    with pytest.raises(szlib.SolverError, match="open space"):
        controller_of(terminal="person").set_walls(BOX)


# copies


@pytest.mark.parametrize(
    "again", [copy.copy, copy.deepcopy, lambda c: pickle.loads(pickle.dumps(c))]
)
@pytest.mark.parametrize("solver", SOLVERS)
def test_a_copy_gives_the_steps_of_its_original_bit_for_bit(solver, again):
    original = controller_of(solver, walls=[[(-6, 2), (6, 2)]], max_people=4)
    state = np.array([-4.0, 0.3, 0.0, 0.0])
    rows = np.array([[0.0, 0.2, -0.3, 0.0], [2.0, -1.0, 0.0, 0.0]])
    for k in range(25):
        if k == 20:
            rows[0, 2:] = 0.0
        step = original.step(state, GOAL, rows, ids="ab")
        state, rows = (
            advance(state, step.control, 0.1),
            rows + 0.1 * np.c_[rows[:, 2:], np.zeros((2, 2))],
        )
    twin = again(original)
    assert (
        np.array_equal(twin.walls, original.walls)
        and twin.settings == original.settings
    )
    for _ in range(10):
        step, other = (c.step(state, GOAL, rows, ids="ab") for c in (original, twin))
        assert np.array_equal(other.predicted, step.predicted)
        assert (
            np.array_equal(other.residual, step.residual)
            and other.fallback == step.fallback
        )
        assert [p.heading for p in other.scene.people] == [
            p.heading for p in step.scene.people
        ]
        state = advance(state, step.control, 0.1)
    assert step.scene.people[0].heading == pytest.approx(np.pi), "remembered"


def test_copies_can_be_used_in_other_threads():
    controller = controller_of()
    expected = drive(controller, [2] * 30)
    with (
        pytest.raises(szlib.SolverError, match="another thread"),
        ThreadPoolExecutor(1) as other,
    ):
        other.submit(controller.step, (0, 0, 0, 0), GOAL).result()
    controller.reset()
    copies = [copy.deepcopy(controller) for _ in range(4)]
    with ThreadPoolExecutor(4) as pool:
        ready = threading.Barrier(4)

        def run(each):
            ready.wait()
            return drive(each, [2] * 30)

        assert all(np.array_equal(found, expected) for found in pool.map(run, copies))


# the time of a step


@pytest.mark.parametrize(
    ("wall", "thread", "share", "is_spent"),
    [
        (0.4, 0.4, 1.0, False), (0.6, 0.4, 1.0, False), (0.4, 0.6, 1.0, False), (0.6, 0.6, 1.0, True),
        (0.3, 0.3, 0.5, True), (0.2, 0.3, 0.5, False),
    ],
)  # fmt: skip
def test_time_is_up_by_both_clocks(monkeypatch, wall, thread, share, is_spent):
    """A busy machine stops the thread, and a coarse clock of the thread runs ahead."""
    clocks = {"perf_counter": 100.0, "thread_time": 7.0}
    for name in clocks:
        monkeypatch.setattr(problem, name, lambda name=name: clocks[name])
    budget = problem.TimeBudget(0.5)
    assert not budget.is_spent(share)
    clocks["perf_counter"] += wall
    clocks["thread_time"] += thread
    assert budget.is_spent(share) == is_spent
    budget.begin()
    assert not budget.is_spent(share)
