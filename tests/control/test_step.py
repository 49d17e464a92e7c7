"""What a step says of itself, whatever people do; threads; and the time it may take."""

import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from itertools import count, islice

import numpy as np
import pytest
import shapely
from helpers.random_states import ZONE, questions
from szlib.control.verification import required_margin, wall_margin

import szlib
from szlib.control import problem
from szlib.control.controller import advance
from szlib.simulation.closed_loop import drive
from szlib.zones.ellipses import BODY_RADIUS

SOLVERS = ("sqp", "ipopt")
GOAL = (4.0, 0.0)
FACING = szlib.Person((0.0, 0.0), heading=np.pi)


def controller_of(solver="sqp", walls=(), **settings):
    return szlib.MPCCBF(
        ZONE, walls=walls, settings=szlib.MPCSettings(solver=solver, **settings)
    )


# clearance, and what "safe" covers


def test_clearance_equals_the_gap_that_shapely_computes():
    for question in islice(questions(seed=21), 40):
        step = question.ask(szlib.MPCSettings())
        for k, (x, y) in enumerate(step.predicted[:, :2]):
            robot, here = (
                shapely.Point(x, y),
                [p.after(0.1 * k).position for p in question.people],
            )
            gaps = [robot.distance(shapely.Point(p)) - BODY_RADIUS for p in here]
            gaps += [
                robot.distance(shapely.LineString(wall)) for wall in question.walls
            ]
            assert step.clearance[:, k] == pytest.approx(np.array(gaps) - 0.5, abs=1e-9)


def end_of_wall(margin):
    """A robot that is sent past the end of a wall of 1 m, 13 cm nearer than its disc allows."""
    wall = np.array([[(0.0, -1.0), (0.0, 0.0)]])
    scenario = szlib.Scenario(
        "end", np.array([-3.0, 0.4, 0, 0]), np.array([3.0, 0.4]), walls=wall
    )
    return drive(
        scenario,
        controller_of(walls=wall, margin=margin, gamma=0.5, N_h=8),
        until_arrival=False,
    )


def test_only_the_euclidean_margin_keeps_the_disc_off_the_end_of_a_short_wall():
    careful, paper = end_of_wall("euclidean"), end_of_wall("paper")
    assert careful.clearance.min() >= -1e-6
    assert careful.h.min() >= -1e-6
    assert paper.clearance.min() < -0.02
    assert paper.h.min() >= -1e-6


def test_a_step_into_an_overlap_is_not_safe_although_every_barrier_holds():
    log = end_of_wall("paper")
    overlaps = log.clearance.min(axis=1) < -1e-6
    assert overlaps.any()
    assert not (log.safe[:-1] & overlaps[1:]).any()
    assert log.metrics()["unflagged_overlaps"] == 0
    assert log.metrics()["min_clearance_walls"] == pytest.approx(log.clearance.min())


def test_a_zone_smaller_than_the_body_does_not_make_an_overlap_safe():
    person = szlib.Person(
        (0.0, 0.0), heading=0.0, zone=szlib.Ellipse((0.0, 0.0), (0.05, 0.05))
    )
    step = controller_of().step((0.62, 0.0, 0.0, 0.0), (5.0, 0.0), [person])
    assert step.feasible and step.h[0] >= 0
    assert step.clearance[0, 0] == pytest.approx(0.62 - 0.5 - BODY_RADIUS)
    assert not step.safe


@pytest.mark.parametrize("length", [0.001, 0.1, 0.5, 1.0, 5.0, 12.0])
def test_the_margin_of_a_wall_is_what_it_requires_and_never_less_than_eps(length):
    wall = [(0.0, 0.0), (length, 0.0)]
    s = szlib.MPCSettings()
    assert wall_margin(wall, s) == max(0.05, required_margin(wall, 0.5))
    assert wall_margin(wall, replace(s, margin="paper")) == 0.05
    controller = controller_of(walls=[wall])
    touching = np.array([(length + 0.5, 0.0), (-0.3, 0.4), (length + 0.3, -0.4)])
    assert all(controller.barriers(p)[0] <= 1e-9 for p in touching)
    beside = (length / 2, 0.5 * (1 + 0.42) + 0.05)
    assert controller.barriers(beside)[0] >= 0, (
        "no more than 0.42 r of room is given away"
    )


# whatever people do


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_goal_where_a_person_stands_sets_goal_blocked_and_raises_nothing(solver):
    controller = controller_of(solver)
    assert not controller.step((-3, 0.5, 0.8, 0), GOAL, [FACING]).goal_blocked
    step = controller.step((-2.92, 0.5, 0.8, 0), (0.3, 0.2), [FACING])
    assert step.goal_blocked and np.abs(step.control).max() <= 1
    walker = szlib.Person((0.0, 0.0), (0.1, 0.0))
    assert not controller.step((-2.9, 0.5, 0.8, 0), (0.3, 0.2), [walker]).goal_blocked
    state = np.array([-4.0, 0.5, 0.3, 0.0])
    for _ in range(200):
        step = controller.step(state, (0.3, 0.2), [FACING])
        assert step.goal_blocked and step.safe
        state = advance(state, step.control, 0.1)
    assert np.hypot(*state[2:]) < 1e-2, "it waits"


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_second_person_under_terminal_person_makes_the_plan_end_at_rest(solver):
    controller = controller_of(solver, terminal="person")
    walker, other = (
        szlib.Person((1.0, 0.3), (-0.4, 0.0)),
        szlib.Person((3.0, 2.5), (0.0, -0.3)),
    )
    state, said = np.array([-3.0, 0.0, 0.0, 0.0]), []
    for people in [[walker]] * 5 + [[walker, other]] * 10 + [[]] + [[walker]] * 3:
        step = controller.step(state, GOAL, people)
        said.append(step.terminal)
        if step.feasible:
            end = walker.velocity if step.terminal == "person" else (0.0, 0.0)
            assert step.predicted[-1, 2:] == pytest.approx(end, abs=1e-6)
        assert np.abs(step.control).max() <= 1
        state = advance(state, step.control, 0.1)
    assert said == ["person"] * 5 + ["rest"] * 11 + ["person"] * 3
    assert controller_of(solver).step(state, GOAL).terminal == "none"


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("large", [1e7, 1e8])
def test_the_largest_numbers_get_a_control(solver, large):
    controller = controller_of(solver, walls=[[(large - 1, 3.0), (large, 3.0)]])
    for person in (
        szlib.Person((large, 0.0), (-large, 0.0)),
        szlib.Person((0.0, -large), (0.0, 1.0)),
    ):
        step = controller.step(
            (-large / 2, 0.0, 0.0, large), (large / 3, 0.0), [person]
        )
        assert np.isfinite(step.control).all() and np.abs(step.control).max() <= 1
        assert not step.safe


def test_a_robot_on_the_focus_of_a_zone_to_the_last_digit_gets_a_control():
    person = szlib.Person(
        (0.0, 0.0), heading=0.0, zone=szlib.Ellipse((0.0, 0.0), (0.8, 0.8))
    )
    step = controller_of().step((1e-170, 0.0, 0.0, 0.0), GOAL, [person])
    assert np.isfinite(step.control).all() and not step.safe


def test_a_zone_that_is_too_large_raises_an_error():
    huge = szlib.Ellipse((0.0, 0.0), (1e155, 1.0))
    with pytest.raises(szlib.ZoneError, match="within 1e\\+08 m of its person"):
        szlib.MPCCBF(huge)
    with pytest.raises(szlib.ZoneError, match="within 1e\\+08 m of its person"):
        szlib.Person((0.0, 0.0), heading=0.0, zone=huge)


# threads


ONE_EACH = """
import threading
import numpy as np, szlib

here = [(-3.0, 0.3 * i, 0.5, 0.0) for i in range(4)]
zone, person = szlib.Ellipse((0.1, 0.0), (1.0, 0.7)), szlib.Person((0.0, 0.0), heading=np.pi)

def drive(i, ready=None):
    controller = ready or szlib.MPCCBF(zone, settings=settings)
    for k in range(n_steps):
        answers[i].append(controller.step((here[i][0] + 0.01 * k, *here[i][1:]), (4, 0), [person]).control)

def answers_of(controllers, threads):
    global answers
    answers = [[] for _ in here]
    workers = [threading.Thread(target=drive, args=(i, controllers[i])) for i in range(4)]
    for worker in workers:
        worker.start()
        threads or worker.join()
    for worker in workers:
        worker.join()
    return np.array(answers)

for solver, n_steps in (("sqp", 60), ("ipopt", 10)):
    settings = szlib.MPCSettings(solver=solver, time_limit=float("inf"))
    built_here = [[szlib.MPCCBF(zone, settings=settings) for _ in here] for _ in range(2)]
    alone = answers_of(built_here[0], threads=False)
    for controllers in (built_here[1], [None] * 4, [None] * 4):
        assert np.array_equal(answers_of(controllers, threads=True), alone), solver
"""


def test_one_controller_a_thread_gives_the_same_answers_as_one_after_another():
    done = subprocess.run(
        [sys.executable, "-c", ONE_EACH], capture_output=True, text=True
    )
    assert done.returncode == 0, (done.returncode, done.stderr)


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_controller_used_in_a_second_thread_raises_an_error(solver):
    def ask(controller):
        try:
            return controller.step((-4, 0, 0, 0), GOAL).status
        except szlib.SolverError as error:
            return str(error)

    with ThreadPoolExecutor(max_workers=1) as other:
        mine, theirs = controller_of(solver), controller_of(solver)
        assert ask(mine) == "optimal"
        assert (
            "belongs to another thread; build one in each"
            in other.submit(ask, mine).result()
        )
        assert other.submit(ask, theirs).result() == "optimal", (
            "built here, used there alone"
        )
        assert "belongs to another thread" in ask(theirs)
        assert ask(mine) == other.submit(ask, theirs).result() == "optimal"


def test_controllers_with_the_same_settings_share_their_ipopt_solvers():
    settings = szlib.MPCSettings(solver="ipopt", max_iterations=98)
    one, two = (szlib.MPCCBF(ZONE, settings=settings, max_people=0) for _ in range(2))
    assert one._pool.get(0, 0)._hard is two._pool.get(0, 0)._hard
    other = szlib.MPCCBF(
        ZONE, settings=replace(settings, max_iterations=97), max_people=0
    )
    assert other._pool.get(0, 0)._hard is not one._pool.get(0, 0)._hard


# the time of a step


def ticking(monkeypatch, seconds):
    """Clocks that advance by so much each time they are read."""
    wall, thread = count(), count()
    monkeypatch.setattr(problem, "perf_counter", lambda: seconds * next(wall))
    monkeypatch.setattr(problem, "thread_time", lambda: seconds * next(thread))


@pytest.mark.parametrize("terminal", ["none", "rest"])
@pytest.mark.parametrize("tick", [1e-4, 3e-3, 0.02, 1.0])
def test_a_step_out_of_time_uses_the_next_fallback_and_reports_it(
    monkeypatch, tick, terminal
):
    for question in islice(questions(seed=22), 15):
        s = szlib.MPCSettings(terminal=terminal)
        controller = szlib.MPCCBF(ZONE, walls=question.walls, settings=s, max_people=3)
        with monkeypatch.context() as clock:
            ticking(clock, tick)
            step = controller.step(question.state, question.goal, question.people)
        assert np.isfinite(step.control).all() and np.abs(step.control).max() <= 1
        assert step.timed_out <= (step.status != "optimal")
        assert step.feasible == (step.slack <= 1e-6)
        if tick == 1.0 and step.fallback not in ("warm", "kept"):
            assert step.timed_out
        if tick == 1e-4 and not step.timed_out:
            unhurried = question.ask(replace(s, time_limit=np.inf))
            assert step.control == pytest.approx(unhurried.control, abs=1e-9)


def test_an_unfinished_plan_is_used_only_if_it_violates_no_more_than_braking(
    monkeypatch,
):
    for question in islice(questions(seed=23), 20):
        controller = szlib.MPCCBF(ZONE, walls=question.walls, max_people=3)
        with monkeypatch.context() as clock:
            ticking(clock, 4e-3)
            step = controller.step(question.state, question.goal, question.people)
        if step.timed_out:
            controller = szlib.MPCCBF(ZONE, walls=question.walls, max_people=3)
            for solver in controller._pool._solvers.values():

                def answer(guess, numbers, of=solver):
                    return of.evaluate(guess, numbers), False

                for name in ("hard", "relaxed"):
                    monkeypatch.setattr(solver, name, answer)
            assert (
                step.slack
                <= controller.step(question.state, question.goal, question.people).slack
                + 1e-9
            )


def test_ipopt_stops_when_the_time_is_up():
    steps = []
    for question in islice(questions(seed=24), 12):
        steps.append(question.ask(szlib.MPCSettings(solver="ipopt", time_limit=1e-7)))
        assert (
            np.isfinite(steps[-1].control).all()
            and np.abs(steps[-1].control).max() <= 1
        )
        assert steps[-1].feasible == (steps[-1].slack <= 1e-6)
        assert not question.ask(
            szlib.MPCSettings(solver="ipopt", time_limit=np.inf)
        ).timed_out
    assert any(step.timed_out and step.status != "optimal" for step in steps)
