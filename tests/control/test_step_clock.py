"""The clock at the controller: clocks that differ, rates, latency, and no progress."""

import numpy as np
import pytest
from studies.distances import euclidean_to_ellipse

import szlib
from szlib.control import controller as base
from szlib.control.controller import OLDEST_STATE, STUCK_AFTER, advance
from szlib.control.differential_drive import Unicycle
from szlib.zones.ellipses import BODY_RADIUS

ZONE = szlib.Ellipse((0.1, 0.0), (1.0, 0.7))
START, GOAL = (-4.0, 0.0, 0.0, 0.0), (4.0, 0.0)
FACING = szlib.Person((0.0, 0.0), heading=np.pi)
AT_LEISURE = szlib.MPCSettings(time_limit=np.inf)


def positions(seen):
    return [pytest.approx(person.position) for person in seen.people]


# the clocks of sensors


@pytest.mark.parametrize("offset", [-30.0, -1.1, 1.1, 30.0])
def test_a_person_measured_too_long_from_now_is_unknown(offset):
    person = [[0.0, 0.0, -0.5, 0.0]]
    step = szlib.MPCCBF(ZONE).step(
        (-1.3, 0, 0.3, 0), GOAL, person, ids=["a"], stamps=100 + offset, now=100
    )
    assert (step.rejected, step.unknown, step.safe) == (1, 1, False)
    assert step.scene.people[0].position == (0.0, 0.0), (
        "standing where they were measured"
    )
    assert (
        f"measured {abs(offset):.3g} s from now" in step.clock
        and step.clock in step.explain()
    )


def test_a_robot_whose_clock_is_off_hits_nobody_while_it_calls_itself_safe():
    controller, state, walker = (
        szlib.MPCCBF(ZONE),
        np.array([-3.0, 0, 0, 0]),
        np.array([1.0, 0.1]),
    )
    for k in range(80):
        row = [[*walker, -0.5, 0.0]]
        step = controller.step(
            state, GOAL, row, ids=[1], stamps=[0.1 * k], now=0.1 * k + 30
        )
        gap = np.hypot(*(state[:2] - walker)) - BODY_RADIUS - 0.5
        assert not step.safe and (gap > 0 or np.hypot(*state[2:]) < 1e-3), (
            "at rest, it is run into"
        )
        state, walker = advance(state, step.control, 0.1), walker - (0.05, 0.0)


def test_a_clock_that_goes_back_forgets_nobody_and_the_step_says_so():
    controller, seen = szlib.MPCCBF(ZONE), [[0.0, 0.0, 1.0, 0.0], [5.0, 5.0, 0.0, 0.0]]
    controller.step(START, GOAL, seen, ids=["a", "b"], now=9.9)
    controller.step(START, GOAL, np.add(seen, [0.1, 0, 0, 0]), ids=["a", "b"], now=10.0)
    back = controller.step(START, GOAL, seen[1:], ids=["b"], now=8.0)
    assert [person.id for person in back.scene.people] == ["b", "a"], (
        "a hidden person is remembered"
    )
    assert positions(back.scene.tracked)[1] == (0.2, 0.0), "a step further"
    assert back.unknown == 0 and "the clock went back by 2 s" in back.explain()
    after = controller.step(START, GOAL, seen[1:], ids=["b"], now=8.1)
    assert positions(after.scene.tracked)[1] == (0.3, 0.0) and after.clock == ""
    assert (
        len(controller.step(START, GOAL, seen[1:], ids=["b"], now=9.2).scene.people)
        == 1
    ), "memory ends"


# the rate of the loop


def test_a_loop_at_another_rate_is_noticed_and_one_late_step_is_not():
    for period, is_noticed in ((0.1, False), (0.11, False), (0.2, True), (0.03, True)):
        controller = szlib.MPCCBF(ZONE)
        steps = [
            controller.step(START, GOAL, now=7 + period * k + (k > 6))
            for k in range(15)
        ]
        assert ("steps come every" in steps[-1].explain()) == is_noticed
        assert steps[3].clock == ""
    assert "gamma is per dt" in steps[-1].clock
    controller = szlib.MPCCBF(ZONE)
    assert not any(controller.step(START, GOAL).clock for _ in range(15)), (
        "without a clock"
    )


def call_each(monkeypatch, periods, **settings):
    """The steps of calls without `now`, so many seconds apart by the computer's clock."""
    controller, time = (
        szlib.MPCCBF(ZONE, settings=szlib.MPCSettings(**settings)),
        [50.0],
    )
    with monkeypatch.context() as patched:
        patched.setattr(base, "perf_counter", lambda: time[0])
        steps = []
        for period in periods:
            time[0] += period
            steps.append(controller.step(START, GOAL))
    return steps


@pytest.mark.parametrize("period", [0.05, 0.2])
def test_calls_at_another_rate_without_a_time_are_reported(monkeypatch, period):
    """At 20 Hz with dt = 0.1 s h may fall twice as fast as gamma says."""
    steps = call_each(monkeypatch, [period] * 15)
    assert f"steps come every {period:g} s, not every dt = 0.1 s" in steps[-1].clock
    assert "give `now`, or call every dt" in steps[-1].clock
    assert steps[-1].clock in steps[-1].explain() and steps[4].clock == ""
    uneven = np.diff(np.random.default_rng(0).uniform(-0.2, 0.2, 61)) + 1
    steps = call_each(monkeypatch, period * uneven)
    assert sum(bool(step.clock) for step in steps) > 30


def test_calls_every_dt_or_as_fast_as_a_simulation_are_not_reported(monkeypatch):
    rng = np.random.default_rng(2)
    for periods in (
        [0.1] * 30,
        [0.001] * 30,
        rng.uniform(0.085, 0.115, 30),
        [0.1] * 10 + [0.3] + [0.1] * 20,
        [2.0] * 30,
    ):
        steps = call_each(monkeypatch, periods)
        assert not any(step.clock for step in steps), periods
    assert not any(step.clock for step in call_each(monkeypatch, [0.05] * 30, dt=0.05))


# the age of the state


@pytest.mark.parametrize("latency", [0, 1, 3])
def test_a_late_state_costs_nothing_if_its_age_is_given(latency):
    """The controller gets states and people that are so many steps old; its controls act at once."""
    controller = szlib.MPCCBF(
        ZONE, settings=szlib.MPCSettings(gamma=0.6, N_h=8, time_limit=np.inf)
    )
    walker = szlib.Person((1.5, 0.2), (-0.5, 0.0), id="w")
    states, age = [np.array(START)], 0.1 * latency
    for k in range(130):
        then = max(0, k - latency)
        seen = walker.after(0.1 * then)
        step = controller.step(
            states[then],
            GOAL,
            [seen],
            stamps=0.1 * then,
            now=0.1 * k,
            state_age=0.1 * (k - then),
        )
        assert step.safe and step.predicted[0] == pytest.approx(states[-1], abs=1e-9)
        assert step.verify().ok
        states.append(advance(states[-1], step.control, 0.1))
        gap = euclidean_to_ellipse(
            states[-1][:2] - walker.after(0.1 * (k + 1)).position,
            ZONE.placed((0, 0), np.pi),
        )
        assert gap >= 0.5 - 1e-9
    assert states[-1][:2] == pytest.approx(GOAL, abs=0.2), f"it arrives, {age} s late"


def test_a_control_that_takes_effect_late_is_a_state_of_that_age_at_a_later_now():
    """Controls act 0.2 s after they are decided: `now` is that time, and the state is 0.2 s old then."""
    on_time, delayed = (szlib.MPCCBF(ZONE, settings=AT_LEISURE) for _ in range(2))
    state, queue = np.array(START), [np.zeros(2)] * 2
    for k in range(100):
        now = 0.1 * k + 0.2
        step = delayed.step(
            state,
            GOAL,
            [FACING],
            now=now,
            stamps=0.1 * k,
            state_age=0.2 if k > 1 else 0.1 * k,
        )
        expected = on_time.step(step.predicted[0], GOAL, [FACING], now=now)
        assert step.control == pytest.approx(expected.control, abs=1e-6) and step.safe
        queue.append(step.control)
        state = advance(state, queue.pop(0), 0.1)
        if k > 3:
            assert advance(
                advance(state, queue[0], 0.1), queue[1], 0.1
            ) == pytest.approx(advance(step.predicted[0], step.control, 0.1), abs=1e-9)


def test_a_drive_brings_a_late_state_to_the_present_along_its_arcs():
    drive, robot = szlib.DifferentialDrive(ZONE), Unicycle()
    owns = [robot.start(START)]
    for k in range(60):
        then = max(0, k - 3)
        step = drive.step(
            owns[then], GOAL, [FACING], now=0.1 * k, state_age=0.1 * (k - then)
        )
        assert step.predicted[0] == pytest.approx(robot.body(owns[-1]), abs=1e-9)
        assert step.safe and step.verify().ok
        owns.append(robot.advance(owns[-1], step.control, 0.1))


@pytest.mark.parametrize(
    "age", [-0.11, OLDEST_STATE + 0.1, np.nan, "x", None, [0.1, 0.2]]
)
def test_an_age_that_cannot_be_used_is_refused(age):
    with pytest.raises(szlib.SolverError, match="state_age must"):
        szlib.MPCCBF(ZONE).step(START, GOAL, state_age=age)


def test_commands_faster_than_dt_are_remembered_as_long_as_a_state_may_be_old():
    controller, x, states = szlib.MPCCBF(ZONE, settings=AT_LEISURE), np.zeros(4), []
    for k in range(60):
        states.append(x)
        step = controller.step(x, (9, 0), now=0.02 * k)
        x = advance(x, step.control, 0.02)
    step = controller.step(states[30], (9, 0), now=1.2, state_age=0.6)
    np.testing.assert_allclose(step.scene.state, x, atol=1e-9)


# no progress


def drive_behind_a_wall(controller, steps, state):
    for k in range(steps):
        step = controller.step(
            state, (6.0, 1.0), [szlib.Person((1.0, 2.9), id="ann")], now=0.1 * k
        )
        yield step
        state = controller.robot.advance(state, step.control, 0.1)


@pytest.mark.parametrize("kind", [szlib.MPCCBF, szlib.DifferentialDrive])
def test_a_robot_that_makes_no_progress_says_since_when_how_far_and_what_holds_it(kind):
    controller = kind(ZONE, walls=[[(3, -1), (3, 4)]], settings=AT_LEISURE)
    steps = list(
        drive_behind_a_wall(
            controller, 220, controller.robot.start(np.array([-1.0, 1.0, 0, 0]))
        )
    )
    stuck = np.array([step.stuck for step in steps])
    assert not stuck[:50].any() and stuck[-1] > 8
    assert np.diff(stuck[-30:]) == pytest.approx(0.1) and stuck[
        stuck > 0
    ].min() == pytest.approx(STUCK_AFTER)
    said = steps[-1].explain()
    assert (
        f"no progress for {stuck[-1]:.1f} s" in said
        and "m from the goal; held by wall 0 (3, -1, 3, 4)" in said
    )
    assert "no progress" not in steps[20].explain()
    controller.reset()
    assert next(drive_behind_a_wall(controller, 1, steps[-1].scene.state if kind is szlib.MPCCBF else
                                    controller.robot.start(np.array([2.0, 1, 0, 0])))).stuck == 0  # fmt: skip


def test_a_robot_that_arrived_approaches_or_has_a_new_goal_is_not_stuck():
    controller = szlib.MPCCBF(ZONE)
    rests = [controller.step((0.05, 0, 0, 0), (0.0, 0.0)).stuck for _ in range(80)]
    assert not any(rests), "it has arrived"
    held = [controller.step((0, 0, 0, 0), (3.0, 0.0)).stuck for _ in range(80)]
    assert held[-1] > STUCK_AFTER
    assert controller.step((0.05, 0, 0, 0), (3.0, 0.0)).stuck == 0, "it is on its way"
    assert controller.step((0, 0, 0, 0), (3.1, 0.0)).stuck > STUCK_AFTER, (
        "a goal that drifts"
    )
    assert controller.step((0, 0, 0, 0), (0.0, 3.0)).stuck == 0, "a new goal"
    controller.step((0, 0, 0, 0), (0.0, 3.0), now=100.0)
    assert controller.step((0, 0, 0, 0), (0.0, 3.0), now=1.7e9).stuck == 0, (
        "a clock that jumps is no waiting"
    )


def test_a_robot_on_a_longer_way_is_not_stuck_because_the_shorter_one_was_closed():
    room = [[(5, -6), (5, -0.6)], [(5, 0.6), (5, 6)], [(-3, -6), (5, -6)]]
    settings = szlib.MPCSettings.among_people(r_robot=0.3)
    controller, x = szlib.MPCCBF(ZONE, walls=room, settings=settings), np.zeros(4)
    for k in range(220):
        if k == 30:
            controller.set_walls([*room, [(5, -0.6), (5, 0.6)]])  # the door closes
        step = controller.step(x, (8.0, 0.0))
        assert step.stuck == 0.0
        x = advance(x, step.control, 0.1)
    assert np.hypot(*(x[:2] - (8, 0))) < 0.2


def test_a_robot_that_follows_a_goal_is_not_stuck():
    controller, x = szlib.MPCCBF(ZONE), np.zeros(4)
    for k in range(200):
        step = controller.step(x, (2 + 0.08 * k, 0.0))
        x = advance(x, step.control, 0.1)
    assert step.stuck == 0.0 and x[0] > 14.0


def test_a_state_that_is_a_little_ahead_of_now_is_that_of_now():
    ahead, now = (
        szlib.MPCCBF(ZONE).step(START, GOAL, state_age=age) for age in (-0.05, 0.0)
    )
    assert ahead.control.tolist() == now.control.tolist()
