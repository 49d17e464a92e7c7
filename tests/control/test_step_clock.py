"""The clock at the controller: late looks, clocks that differ, rates, latency, deadlines, no progress."""

from itertools import count

import numpy as np
import pytest
from szlib.control.verification import euclidean_to_ellipse

import szlib
from szlib.control import problem
from szlib.control.controller import advance
from szlib.control.differential_drive import Unicycle
from szlib.control.step_clock import OLDEST_STATE, STUCK_AFTER
from szlib.zones.ellipses import BODY_RADIUS

ZONE = szlib.Ellipse((0.1, 0.0), (1.0, 0.7))
SMALL = szlib.Ellipse((0.0, 0.0), (0.3, 0.3))
START, GOAL = (-4.0, 0.0, 0.0, 0.0), (4.0, 0.0)
FACING = szlib.Person((0.0, 0.0), heading=np.pi)


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


def test_a_look_that_is_older_than_the_known_one_is_ignored():
    tracker = szlib.Tracker()
    tracker.see([[0.0, 0.0, 1.0, 0.0]], ids=["a"], stamps=5.0, now=5.0)
    late = tracker.see([[-0.5, 0.3, 0.0, 1.0]], ids=["a"], stamps=4.8, now=5.1)
    assert positions(late) == [(0.1, 0.0)] and late[1:] == (0, 0)
    assert positions(
        tracker.see([[0.3, 0.0, 1.0, 0.0]], ids=["a"], stamps=5.2, now=5.2)
    ) == [(0.3, 0.0)]


def test_a_clock_that_goes_back_forgets_nobody_and_the_step_says_so():
    controller, seen = szlib.MPCCBF(ZONE), [[0.0, 0.0, 1.0, 0.0], [5.0, 5.0, 0.0, 0.0]]
    controller.step(START, GOAL, seen, ids=["a", "b"], now=9.9)
    controller.step(START, GOAL, np.add(seen, [0.1, 0, 0, 0]), ids=["a", "b"], now=10.0)
    back = controller.step(START, GOAL, seen[1:], ids=["b"], now=8.0)
    assert [person.id for person in back.scene.people] == ["b", "a"], (
        "who is hidden is remembered"
    )
    assert positions(back.scene.tracked)[1] == (0.2, 0.0), "a step further"
    assert back.unknown == 0 and "the clock went back by 2 s" in back.explain()
    after = controller.step(START, GOAL, seen[1:], ids=["b"], now=8.1)
    assert positions(after.scene.tracked)[1] == (0.3, 0.0) and after.clock == ""
    assert (
        len(controller.step(START, GOAL, seen[1:], ids=["b"], now=9.2).scene.people)
        == 1
    ), "memory ends"


# ids


@pytest.mark.parametrize("ids", [[np.nan], [float("nan")], [np.float64("nan")]])
def test_an_id_that_is_nan_is_no_id(ids):
    tracker = szlib.Tracker()
    for k in range(5):
        assert (
            len(tracker.see([[0.1 * k, 0.0, 1.0, 0.0]], ids=ids, now=0.1 * k).people)
            == 1
        )
    assert tracker.see(now=0.5).people == ()


def test_an_id_that_two_people_have_at_once_is_no_id():
    tracker, rows = szlib.Tracker(), [[0.0, 0.0, 0.0, 0.0], [4.0, 0.0, 1.0, 0.0]]
    for k in range(5):
        seen = tracker.see(rows, ids=["a", "a"], now=0.1 * k)
        assert (
            positions(seen) == [(0.0, 0.0), (4.0, 0.0)]
            and seen.people[0].heading is None
        )
    assert tracker.see([[np.nan] * 4, rows[1]], ids=["a", "a"], now=0.6).unknown == 1


def test_an_id_reused_metres_away_is_another_person_and_the_first_is_remembered():
    tracker = szlib.Tracker()
    tracker.see([[0.0, 0.0, 1.0, 0.0]], ids=["a"], now=0.0)
    seen = tracker.see([[5.0, 3.0, 0.0, 0.0]], ids=["a"], now=0.1)
    assert positions(seen) == [(5.0, 3.0), (0.1, 0.0)]
    assert [person.heading for person in seen.people] == [None, 0.0], (
        "no heading of somebody else"
    )
    assert positions(tracker.see([[5.0, 3.0, 0.0, 0.0]], ids=["a"], now=1.5)) == [
        (5.0, 3.0)
    ]
    near = tracker.see([[6.0, 3.0, 0.0, 0.0]], ids=["a"], now=1.6)
    assert positions(near) == [(6.0, 3.0)], "a metre is noise"


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


@pytest.mark.parametrize("dt", [0.05, 0.1, 0.4])
def test_a_gamma_rate_lets_h_fall_equally_fast_whatever_dt_is(dt):
    settings = szlib.MPCSettings(dt=dt).with_gamma_rate(0.8)
    assert (1 - settings.gamma) ** (1 / dt) == pytest.approx(np.exp(-0.8))
    assert (
        settings.gamma_rate == pytest.approx(0.8)
        and settings.badges()["gamma"] == "chosen"
    )
    assert szlib.MPCSettings(gamma=1).gamma_rate == np.inf
    with pytest.raises(szlib.SolverError, match="gamma must be in"):
        settings.with_gamma_rate(-1)


# the age of the state


@pytest.mark.parametrize("latency", [0, 1, 3])
def test_a_late_state_costs_nothing_if_its_age_is_given(latency):
    """The controller gets states and people that are so many steps old; its controls act at once."""
    controller = szlib.MPCCBF(ZONE, settings=szlib.MPCSettings(gamma=0.6, N_h=8))
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
    on_time, delayed = szlib.MPCCBF(ZONE), szlib.MPCCBF(ZONE)
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
    "age", [-0.1, OLDEST_STATE + 0.1, np.nan, "x", None, [0.1, 0.2]]
)
def test_an_age_that_cannot_be_used_is_refused(age):
    with pytest.raises(szlib.SolverError, match="state_age must"):
        szlib.MPCCBF(ZONE).step(START, GOAL, state_age=age)


# deadlines


@pytest.mark.parametrize(("deadline", "is_late"), [(np.inf, False), (0.02, True)])
def test_a_deadline_counts_time_in_which_the_thread_does_not_run(
    monkeypatch, deadline, is_late
):
    ticks = count()
    monkeypatch.setattr(problem, "perf_counter", lambda: 0.015 * next(ticks))
    monkeypatch.setattr(problem, "thread_time", lambda: 0.0)
    controller = szlib.MPCCBF(ZONE, settings=szlib.MPCSettings(deadline=deadline))
    step = controller.step((-1.9, 0, 1, 0), GOAL, [FACING])
    assert step.timed_out == is_late
    assert ("time was up after 0.02 s" in step.explain()) == is_late
    with pytest.raises(szlib.SolverError, match="deadline must be a positive number"):
        szlib.MPCSettings(deadline=0)


def test_ipopt_keeps_the_deadline():
    settings = szlib.MPCSettings(solver="ipopt", time_limit=np.inf, deadline=1e-7)
    assert (
        szlib.MPCCBF(ZONE, settings=settings, max_people=1)
        .step(START, GOAL, [FACING])
        .timed_out
    )


# between the samples


def fast_meetings(seed, count):
    """Robots and people who come at up to 8 m/s, at dt = 0.5 s; and the step, with its least true gap."""
    rng = np.random.default_rng(seed)
    settings = szlib.MPCSettings(dt=0.5, v_max=3.0, a_max=3.0, N=4, eps=0.0)
    controller = szlib.MPCCBF(
        SMALL, settings=settings, walls=[[(-9, 6), (9, 6)]], max_people=1
    )
    for _ in range(count):
        angle, way = rng.uniform(-np.pi, np.pi), rng.uniform(0, 8)
        velocity = way * np.array([np.cos(angle), np.sin(angle)])
        middle = rng.uniform(-1.5, 1.5, 2)
        person = szlib.Person(
            tuple(middle - rng.uniform(0, 0.5) * velocity), tuple(velocity)
        )
        state = np.r_[0.0, rng.uniform(-1, 5.4), rng.uniform(-1.5, 1.5, 2)]
        controller.reset()
        step = controller.step(state, (9.0, 0.0), [person])
        t = np.linspace(0, 0.5, 501)[:, None]
        path = state[:2] + t * state[2:] + t**2 / 2 * step.control
        body = (
            np.hypot(*(path - person.position - t * velocity).T).min()
            - BODY_RADIUS
            - 0.5
        )
        yield step, min(body, 6 - path[:, 1].max() - 0.5)


def test_a_safe_step_covers_the_closest_approach_between_samples():
    n_safe = n_free = n_tunnelled = 0
    for step, gap in fast_meetings(seed=3, count=200):
        report = step.verify()
        assert report.ok and not (report.safe and gap < -1e-6)
        assert not step.safe or gap >= 0
        n_safe += step.safe
        ends = step.clearance[:, :2].min() >= 0 and step.feasible and step.h.min() >= 0
        n_free += ends and gap >= 0.2
        n_tunnelled += ends and gap < 0
    assert n_tunnelled >= 5, "people who pass through the robot between two samples"
    assert n_safe >= 0.95 * n_free > 50, "the bound is tight"


def test_a_robot_that_slides_along_a_wall_or_touches_it_at_rest_is_safe():
    wall = [(-20.0, -0.56), (20.0, -0.56)]
    controller = szlib.MPCCBF(ZONE, walls=[wall])
    assert controller.step((0.0, 0.0, 1.0, 0.0), (9.0, 0.0)).safe
    touching = szlib.MPCCBF(
        ZONE, walls=[[(-20.0, -0.5), (20.0, -0.5)]], settings=szlib.MPCSettings(eps=0.0)
    )
    assert touching.step((0.0, 0.00625, 0.0, 0.0), (0.0, 0.00625)).safe


# zones that do not hold their person


def test_a_zone_that_does_not_contain_its_person_is_refused():
    for bad in (szlib.Ellipse((50, 0), (1, 0.7)), szlib.Ellipse((0, 0.71), (1, 0.7))):
        with pytest.raises(szlib.ZoneError, match="must contain its person"):
            szlib.MPCCBF(bad)
        with pytest.raises(szlib.ZoneError, match="must contain its person"):
            szlib.Person((0, 0), zone=bad)

        class Fitted:
            def ellipse(self, speed, bad=bad):
                return bad

        with pytest.raises(szlib.ZoneError, match="must contain its person"):
            szlib.MPCCBF(ZONE).step(
                START, GOAL, [szlib.Person((0, 0), heading=0.0, zone=Fitted())]
            )
    for edge in (
        szlib.Ellipse((0, 0.7), (1, 0.7)),
        szlib.Ellipse((0, 0), (0.05, 0.05)),
    ):
        assert szlib.MPCCBF(edge).zone == edge


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
    controller = kind(ZONE, walls=[[(3, -1), (3, 4)]])
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
        and "m from the goal; held by wall 0 (3, -1)-(3, 4)" in said
    )
    assert "no progress" not in steps[20].explain()
    controller.reset()
    assert next(drive_behind_a_wall(controller, 1, steps[-1].scene.state if kind is szlib.MPCCBF else
                                    controller.robot.start(np.array([2.0, 1, 0, 0])))).stuck == 0  # fmt: skip


def test_who_is_there_approaches_or_has_a_new_goal_is_not_stuck():
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


# the step of a drive


def test_a_drive_step_is_verified_and_explained():
    drive = szlib.DifferentialDrive(ZONE, walls=[[(-6, 4), (6, 4)]])
    step = drive.step(
        (-4.0, 0.0, 0.1), GOAL, [szlib.Person((0.0, 0.2), (-0.5, 0.0), id="ann")]
    )
    assert step.verify().ok and step.verify().safe == step.safe
    assert step.verify().h == pytest.approx(step.h.min())
    assert repr(step).startswith("DriveStep(warm, safe, v=") and "\n" not in repr(step)
    said = step.explain()
    assert (
        said.startswith(repr(step))
        and "person 0 (id 'ann')" in said
        and "WRONG" not in said
    )


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        (
            lambda step: {"control": np.add(step.control, (0.01, 0.0))},
            "motion of the disc",
        ),
        (lambda step: {"heading": step.heading + 0.01}, "motion of the disc"),
        (lambda step: {"h": step.h + 1e-4}, "h of the disc"),
        (lambda step: {"safe": not step.safe}, "safe of the disc"),
        (
            lambda step: {"point": szlib.Step(**vars(step.point) | {"slack": 0.1})},
            "slack",
        ),
    ],
)
def test_a_false_claim_of_a_drive_step_is_a_fault(change, fault):
    step = szlib.DifferentialDrive(ZONE).step(
        (-4.0, 0.0, 0.1, 0.5, 0.1), GOAL, [FACING]
    )
    lie = type(step)(**vars(step) | change(step))
    assert any(fault in found for found in lie.verify().faults), lie.verify().faults
    assert "WRONG" in lie.explain()
