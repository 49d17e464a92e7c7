"""The controller: predictions, invariances, head-on meetings, failures, arguments, copies and threads."""

import copy
import pickle
import re
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely

import szlib
from szlib.control import STATUSES
from szlib.control.controller import advance
from szlib.control.settings import TOLERANCE

ZONE = szlib.Ellipse((0.1, 0.0), (1.0, 0.7), 0.0)
GOAL = (4.0, 0.0)
FACING = szlib.Person((0.0, 0.0), heading=np.pi)


def controller_of(walls=(), **settings):
    """Without a time limit, so that a busy machine changes nothing."""
    chosen = szlib.MPCSettings(**{"time_limit": np.inf} | settings)
    return szlib.MPCCBF(ZONE, walls=walls, settings=chosen)


def test_the_predicted_states_follow_the_paper_and_keep_every_bound():
    controller = controller_of()
    state = np.array([-3.0, 0.4, 0.5, 0.0])
    step = controller.step(state, GOAL, [FACING])
    dt = 0.1
    a = np.array([[1, 0, dt, 0], [0, 1, 0, dt], [0, 0, 1, 0], [0, 0, 0, 1]])
    b = np.array([[dt**2 / 2, 0], [0, dt**2 / 2], [dt, 0], [0, dt]])
    inputs = np.diff(step.predicted[:, 2:], axis=0) / dt
    for x, u, after in zip(
        step.predicted[:-1], inputs, step.predicted[1:], strict=True
    ):
        assert after == pytest.approx(a @ x + b @ u, abs=1e-12)
    assert step.predicted.shape == (9, 4)
    assert step.predicted[0] == pytest.approx(state)
    assert inputs[0] == pytest.approx(step.control)
    assert np.abs(inputs).max() <= 1 + 1e-9
    assert np.hypot(*step.predicted[1:, 2:].T).max() <= 1 + TOLERANCE


def test_the_residual_is_the_barrier_condition_along_the_plan():
    people = [szlib.Person((0.5, 0.2), (-0.5, 0.1)), FACING]
    controller = controller_of([((-5, 2), (5, 2))], N_h=4)
    step = controller.step((-5.0, 0.0, 0.6, 0.0), GOAL, people)
    h = np.array(
        [
            controller.barriers(
                step.predicted[k, :2], [p.after(k * 0.1) for p in people]
            )
            for k in range(5)
        ]
    )
    assert step.residual == pytest.approx((h[1:] - 0.95 * h[:-1]).T, abs=1e-12)
    assert step.h == pytest.approx(h[0])
    assert step.safe


def test_after_a_reset_the_same_states_give_the_same_steps():
    controller, states = (
        controller_of(),
        np.linspace((-4, 0.2, 0, 0), (-3, 0, 0.8, 0), 6),
    )
    first = [controller.step(x, GOAL, [FACING]).control for x in states]
    walker = replace(FACING, position=(-2, 1), heading=2.0, id="a")
    controller.step((0, 5, 0, 0), (9, 9), [walker])
    controller.reset()
    assert not controller.step((-4, 0, 0, 0), GOAL).scene.people, "they are forgotten"
    controller.reset()
    assert np.array_equal(
        first, [controller.step(x, GOAL, [FACING]).control for x in states]
    )


def test_the_start_of_the_solver_does_not_change_the_plan():
    warm, cold = controller_of(), controller_of()
    state = np.array([-4.0, 0.9, 0.0, 0.0])
    for _ in range(40):
        cold.reset()
        step = warm.step(state, GOAL, [FACING])
        assert step.control == pytest.approx(
            cold.step(state, GOAL, [FACING]).control, abs=1e-4
        )
        state = advance(state, step.control, 0.1)


def test_turning_and_shifting_the_world_turns_the_plan():
    angle, shift = 0.7, np.array([3.0, -2.0])
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    # a_max out of reach: a box on (ax, ay) does turn with the axes
    settings = szlib.MPCSettings(a_max=50.0, time_limit=np.inf)
    wall = np.array([(-4.0, 2.0), (4.0, 2.0)])
    here = szlib.MPCCBF(ZONE, walls=[wall], settings=settings)
    there = szlib.MPCCBF(ZONE, walls=[wall @ turn.T + shift], settings=settings)
    person = szlib.Person((0.0, 0.3), (-0.4, 0.1))
    moved = szlib.Person(
        tuple(turn @ person.position + shift), tuple(turn @ person.velocity)
    )
    state = np.array([-2.5, -0.5, 0.5, 0.1])
    step = here.step(state, GOAL, [person])
    other = there.step(
        np.r_[turn @ state[:2] + shift, turn @ state[2:]], turn @ GOAL + shift, [moved]
    )
    assert other.inputs == pytest.approx(step.inputs @ turn.T, abs=1e-4)
    assert other.h == pytest.approx(step.h) and other.safe == step.safe


def test_the_zone_of_a_person_replaces_the_controllers():
    wide = szlib.Ellipse((0.0, 0.0), (1.6, 1.2))
    controller = szlib.MPCCBF(ZONE)
    people = [
        szlib.Person((0, 0), heading=0.0),
        szlib.Person((0, 0), heading=0.0, zone=wide),
    ]
    assert controller.barriers((-3, 0), people) == pytest.approx(
        [szlib.ellipse_distance((-3, 0), zone) - 0.55 for zone in (ZONE, wide)]
    )


def test_a_zone_that_depends_on_speed_is_used_at_the_speed_of_the_settings():
    class Growing:
        def ellipse(self, speed):
            return szlib.Ellipse((0.0, 0.0), (speed, speed / 2))

    assert szlib.MPCCBF(Growing()).zone == szlib.Ellipse((0.0, 0.0), (1.1, 0.55))
    with pytest.raises(szlib.ZoneError, match=r"got \(1.0, 0.7\)"):
        szlib.MPCCBF((1.0, 0.7))


# head-on


def drive(controller, state, goal, people, steps=350):
    states, statuses = [np.asarray(state, float)], []
    for _ in range(steps):
        step = controller.step(states[-1], goal, people)
        statuses.append(step.status)
        states.append(advance(states[-1], step.control, controller.settings.dt))
        people = [p.after(controller.settings.dt) for p in people]
        if np.hypot(*(states[-1][:2] - goal)) < 0.1:
            return np.array(states), statuses
    raise AssertionError(
        f"deadlock: from {state} the robot came to {states[-1]}, and not to {goal}"
    )


@pytest.mark.parametrize("walks", [False, True])
@pytest.mark.parametrize("side", ["right", "left"])
def test_a_symmetric_meeting_at_any_angle_is_passed_on_the_chosen_side(side, walks):
    rng = np.random.default_rng(3)
    for _ in range(10):
        angle, before, behind = rng.uniform((-np.pi, 3.0, 1.6), (np.pi, 6.0, 6.0))
        along = np.array([np.cos(angle), np.sin(angle)])
        position = rng.uniform(-3, 3, 2)
        velocity = tuple(-0.5 * along) if walks else (0.0, 0.0)
        person = szlib.Person(tuple(position), velocity, heading=angle + np.pi)
        controller = controller_of(pass_side=side)
        states, statuses = drive(
            controller,
            [*(position - before * along), 0, 0],
            position + behind * along,
            [person],
        )
        assert set(statuses) == {"optimal"}
        there = position + np.outer(np.arange(len(states)) * 0.1, velocity)
        offset = states[:, :2] - there
        abeam = int(np.flatnonzero(offset @ along >= 0)[0])
        to_the_left = offset[abeam] @ np.array([-along[1], along[0]])
        assert (to_the_left > 0) == (side == "left")


@pytest.mark.parametrize("tilt", [-0.05, 0.05])
@pytest.mark.parametrize("side", ["right", "left"])
@pytest.mark.parametrize("gamma", [0.05, 0.4, 1.0])
def test_the_side_is_chosen_before_the_plan_meets_the_zone_whatever_gamma(
    gamma, side, tilt
):
    zone = replace(ZONE, angle=tilt)
    settings = szlib.MPCSettings(gamma=gamma, N_h=8, pass_side=side)
    # h = 0.65 m: the last of the plan's 0.8 m lies in the zone
    state = (-2.1, 0.0, 1.0, 0.0)
    step = szlib.MPCCBF(zone, settings=settings).step(state, GOAL, [FACING])
    # drawn around; else the tilt would decide
    assert step.target[1] * (1 if side == "left" else -1) > 1.0


def test_the_two_sides_are_mirror_images():
    mirror = np.array([1, -1, 1, -1])
    for person in (FACING, szlib.Person((2.0, 0.0), (-0.5, 0.0))):
        right = controller_of(pass_side="right")
        left = controller_of(pass_side="left")
        one, _ = drive(right, (-4, 0, 0, 0), GOAL, [person])
        other, _ = drive(left, (-4, 0, 0, 0), GOAL, [person])
        assert one == pytest.approx(other * mirror, abs=1e-3)


def test_without_the_rule_only_rounding_would_choose_a_side():
    in_front = (-1.8, 0.0, 0.0, 0.0)
    undecided = controller_of(head_on_share=0.0).step(in_front, GOAL, [FACING])
    assert undecided.status == "optimal"
    assert undecided.control == pytest.approx(undecided.control * (1, 0), abs=1e-6)
    for side, sign in (("right", -1), ("left", 1)):
        step = controller_of(pass_side=side).step(in_front, GOAL, [FACING])
        assert step.control[1] * sign > 0.5


def test_a_wall_on_the_chosen_side_sends_the_robot_around_the_other():
    controller = szlib.MPCCBF(ZONE, walls=[((-6, -1.2), (6, -1.2))])
    states, statuses = drive(controller, (-4, 0, 0, 0), GOAL, [FACING])
    assert set(statuses) == {"optimal"}
    assert states[:, 1].max() > 1
    assert controller.step((-2.5, 0, 0, 0), GOAL, [FACING]).target[1] > 0


def test_the_target_is_the_goal_unless_a_person_is_met_head_on():
    controller = szlib.MPCCBF(ZONE)
    state = (-3, 0, 0, 0)
    crossing, beside = (
        szlib.Person((0, -1.0), (0, 0.5)),
        szlib.Person((0, 2.5), heading=0.0),
    )
    behind_goal = szlib.Person((6.0, 0.0), heading=np.pi)
    for people in ([], [crossing], [beside], [behind_goal]):
        assert controller.step(state, GOAL, people).target == pytest.approx(GOAL)
    assert controller.step(state, GOAL, [FACING]).target[1] < -0.5
    blocked = controller_of([((-6, -1.2), (6, -1.2)), ((-6, 1.2), (6, 1.2))])
    assert blocked.step(state, GOAL, [FACING]).target == pytest.approx(GOAL)


# when there is no way


def test_an_impossible_step_is_relaxed_flagged_and_stays_within_bounds():
    controller = controller_of()
    step = controller.step((-1.9, 0.0, 1.0, 0.0), GOAL, [FACING])
    assert step.status in ("relaxed", "restarted", "braking")
    assert step.slack > 1e-3
    assert step.slack == pytest.approx(-step.residual.min())
    assert not step.safe
    assert np.abs(step.control).max() <= 1
    assert step.control[0] == pytest.approx(-1, abs=1e-6)


def test_a_start_inside_a_zone_or_a_wall_is_flagged_and_left():
    controller = szlib.MPCCBF(ZONE, walls=[((-6, -2.0), (6, -2.0))])
    for state in ((-1.2, 0.1, 0.3, 0.0), (3.0, -1.7, 0.0, 0.0)):
        step = controller.step(state, GOAL, [FACING])
        assert step.h.min() < 0
        assert not step.safe
        x = np.array(state)
        for _ in range(80):
            x = advance(x, controller.step(x, GOAL, [FACING]).control, 0.1)
        assert controller.barriers(x[:2], [FACING]).min() > -0.05


def test_a_robot_that_is_too_fast_slows_down_and_reports_slack():
    step = controller_of().step((-4, -5, 1.5, 0.0), (9.0, -5.0))
    assert not step.feasible
    assert step.slack == pytest.approx(1.4**2 - 1, rel=1e-3)
    assert step.control == pytest.approx((-1, 0), abs=1e-3)


def test_where_a_distance_has_no_gradient_the_robot_still_gets_a_control():
    controller = controller_of([((-1, 3), (1, 3))])
    focus = controller.zone_of(FACING).placed(FACING.position, FACING.heading).foci[0]
    for position in (focus, (0.0, 3.0)):
        step = controller.step((*position, 0, 0), GOAL, [FACING])
        assert not step.safe
        assert np.isfinite(step.control).all() and np.abs(step.control).max() <= 1


def test_every_state_gets_a_control_within_bounds_and_a_true_status():
    rng = np.random.default_rng(7)
    seen = set()
    for _ in range(150):
        walls = [
            np.array([p, p + rng.uniform(0.5, 3, 2)])
            for p in rng.uniform(-4, 4, (rng.integers(0, 3), 2))
        ]
        people = [
            szlib.Person(tuple(rng.uniform(-3, 3, 2)), tuple(rng.uniform(-0.6, 0.6, 2)))
            for _ in range(rng.integers(1, 4))
        ]
        step = controller_of(walls).step(
            np.r_[rng.uniform(-4, 4, 2), rng.uniform(-0.9, 0.9, 2)],
            (20.0, 20.0),
            people,
        )
        seen.add(step.status)
        assert step.status in STATUSES
        assert np.isfinite(step.control).all() and np.abs(step.control).max() <= 1
        assert step.slack <= TOLERANCE or step.status != "optimal"
        if step.status == "optimal":
            assert step.residual.min() >= -TOLERANCE
            assert np.hypot(*step.predicted[1:, 2:].T).max() <= 1 + TOLERANCE
    assert {"optimal", "relaxed"} <= seen


# bad input


@pytest.mark.parametrize(
    ("state", "goal", "message"),
    [
        ((0, 0, np.nan, 0), GOAL, "state must be finite"),
        ((0, 0, 0), GOAL, r"state must have shape \(4,\); got \(3,\)"),
        ((-4, 0, 0, 0), (np.inf, 0), "goal must be finite"),
        ((-4, 0, 0, 0), (1, 2, 3), r"goal must have shape \(2,\)"),
        ((1e155, 0, 0, 0), GOAL, r"state must lie within \+-1e\+08"),
        ((0, 0, 0, -2e8), GOAL, r"state must lie within"),
        ((0, 0, 0, 0), (1e155, 0), r"goal must lie within"),
        ((10**400, 0.0, 0.0, 0.0), GOAL, r"state must be numbers"),
        ((0, 0, 0, 0), (10**400, 0.0), r"goal must be numbers"),
    ],
)
def test_a_state_or_goal_that_cannot_be_used_raises_an_error(state, goal, message):
    controller = szlib.MPCCBF(ZONE)
    with pytest.raises(szlib.SolverError, match=message):
        controller.step(state, goal, [FACING])


def test_a_person_who_stops_on_the_goal_raises_nothing_while_the_robot_moves():
    controller = szlib.MPCCBF(ZONE)
    assert (
        controller.step((0, 0, 0, 0), GOAL, [szlib.Person((3, 0), (0.5, 0))]).status
        == "optimal"
    )
    step = controller.step((0.1, 0, 0.5, 0), GOAL, [szlib.Person((4, 0), heading=0.0)])
    assert np.isfinite(step.control).all()


@pytest.mark.parametrize(
    "wall",
    [
        ((1, 1), (1, 1)),
        ((0, 0), (np.nan, 1)),
        ((0, 0, 0), (1, 1, 1)),
        ((0, 0), (1e-200, 0)),
        ((0, 0), (1e155, 0)),
    ],
)
def test_an_invalid_wall_raises_an_error(wall):
    with pytest.raises(szlib.SolverError, match="wall"):
        szlib.MPCCBF(ZONE, walls=[wall])


def test_a_step_prints_nothing(capfd):
    controller_of().step((-3, 0, 0, 0), GOAL, [FACING])
    assert capfd.readouterr().out == ""


# goals that cannot be reached


@pytest.mark.parametrize("kind", [szlib.MPCCBF, szlib.DifferentialDrive])
@pytest.mark.parametrize("goal", [(3.0, 2.9), (3.0, 3.0), (3.0, 9.0)])
def test_a_goal_in_a_wall_never_raises_in_a_step_and_always_in_check_start(kind, goal):
    """It is treated alike at the first step and at every other one."""
    block = [[(-6, 3), (12, 3)], [(-6, 3), (-6, 30)], [(12, 3), (12, 30)]]
    settings = szlib.MPCSettings(time_limit=np.inf)
    controller = kind(ZONE, walls=[*block, [(3, 9), (3.5, 9)]], settings=settings)
    start = np.array([-4.0, 0.0, 0.0, 0.0])
    with pytest.raises(szlib.SolverError, match=r"cannot be reached.* m for"):
        controller.check_start(start, goal, [])
    own = controller.robot.start(start)
    for k in range(200):
        step = controller.step(own, goal)
        assert getattr(step, "point", step).goal_blocked
        assert step.safe and step.walls_safe, k
        own = controller.robot.advance(own, step.control, 0.1)
    assert "cannot be reached" in step.explain() and "another goal" in step.explain()
    if kind is szlib.MPCCBF and goal[1] < 4:
        assert own[[0, 2, 3]] == pytest.approx((3, 0, 0), abs=1e-2), "it waits"
        assert 0 <= step.h[0] < 0.15


def test_check_start_refuses_starts_and_goals_that_violate_something():
    controller = controller_of(walls=[[(-6, 3), (6, 3)]])
    controller.check_start((-4.0, 0.0, 0.0, 0.0), GOAL, [FACING])
    for state, goal, people, message in (
        ((-1.0, 0.0, 0.0, 0.0), GOAL, [FACING], "starts in violation.*person 0"),
        ((-4.0, 2.8, 0.0, 0.0), GOAL, [], "starts in violation.*wall 0"),
        ((-4.0, 0.0, 0.0, 0.0), (0.3, 0.0), [FACING], "m for person 0"),
        (
            (-4.0, 0.0, 1.2, 0.0),
            GOAL,
            [],
            "speed at the start must be at most v_max = 1 m/s; got 1.2",
        ),
    ):
        with pytest.raises(szlib.SolverError, match=message):
            controller.check_start(state, goal, people)


def test_walls_set_around_the_goal_of_a_moving_robot_block_it():
    controller = controller_of()
    assert not controller.step((-4, 0, 0, 0), GOAL).goal_blocked
    controller.set_walls([[(4, -1), (4, 1)]])
    assert controller.step((-4, 0, 0, 0), GOAL).goal_blocked
    with pytest.raises(szlib.SolverError, match="wall"):
        controller.set_walls([[(0, 0), (0, 0)]])
    assert len(controller.walls) == 1, "it keeps those that it had"


LARGEST = """
import sys
import numpy as np, szlib
zone, large = szlib.Ellipse((0.1, 0.0), (1.0, 0.7)), float(sys.argv[1])
settings = szlib.MPCSettings(time_limit=np.inf)
controller = szlib.MPCCBF(zone, walls=[[(large - 1, 3.0), (large, 3.0)]], settings=settings)
for person in (szlib.Person((large, 0.0), (-large, 0.0)), szlib.Person((0.0, -large), (0.0, 1.0))):
    step = controller.step((-large / 2, 0.0, 0.0, large), (large / 3, 0.0), [person])
    if not (np.isfinite(step.control).all() and np.abs(step.control).max() <= 1) or step.safe:
        raise SystemExit(f"{step!r}")
    if not step.verify().ok:
        raise SystemExit(f"{step.verify().faults}")
"""


@pytest.mark.parametrize("large", ["1e7", "1e8"])
def test_the_largest_numbers_get_a_control_that_is_verified(large):
    """In a process of its own, which a step that takes time in proportion to the speed would never end."""
    command = [sys.executable, "-c", LARGEST, large]
    done = subprocess.run(command, capture_output=True, text=True, timeout=20)
    assert done.returncode == 0, done.stderr


# one controller, copies, and threads


def crowd(n, k=0):
    """People around the way, k steps of 0.1 s later."""
    rng = np.random.default_rng(6)
    rows = np.c_[
        rng.uniform(-6, 10, 40),
        rng.choice([-1, 1], 40) * rng.uniform(1.8, 5, 40),
        rng.uniform(-0.2, 0.2, (40, 2)),
    ]
    rows[:, :2] += 0.1 * k * rows[:, 2:]
    return rows[:n]


def drive_among(controller, numbers):
    """The states and controls of a robot among so many people at each step."""
    state, found = np.array([-4.0, 0.0, 0.0, 0.0]), []
    for k, n in enumerate(numbers):
        step = controller.step(state, GOAL, crowd(n, k))
        found.append(np.r_[state, step.control])
        state = advance(state, step.control, 0.1)
    return np.array(found)


@pytest.mark.parametrize("people", [False, True])
def test_the_number_of_people_may_change_at_any_step(people):
    """A controller that prepared its problems before gives the same run."""
    chosen = szlib.MPCSettings.among_people if people else szlib.MPCSettings
    settings = chosen(time_limit=np.inf)
    numbers = [3] * 3 + [4] * 3 + [9] * 3 + [3] * 2 + [20] * 3 + [0] * 2 + [40]
    fresh = drive_among(szlib.MPCCBF(ZONE, settings=settings), numbers)
    used = szlib.MPCCBF(ZONE, settings=settings)
    drive_among(used, numbers[::-1])
    used.reset()
    assert np.array_equal(drive_among(used, numbers), fresh)


def test_walls_set_between_steps_give_the_steps_of_a_controller_built_with_them():
    some, more = [[(-6, 1.5), (6, 1.5)]], shapely.box(-8, -3, 9, 3)
    state, controller = np.array([-4.0, 0.0, 0.0, 0.0]), controller_of(some)
    for k, walls in enumerate([some, more, [], some, more] * 3):
        controller.set_walls(walls)
        anew = controller_of(walls)
        step, other = (c.step(state, GOAL, crowd(2, k)) for c in (controller, anew))
        assert step.h == pytest.approx(other.h)
        assert step.control == pytest.approx(other.control, abs=1e-4)
        state = advance(state, step.control, 0.1)


SETTINGS = {
    "default": szlib.MPCSettings(time_limit=np.inf),
    "paper": szlib.MPCSettings.paper(),
    "rest": szlib.MPCSettings(time_limit=np.inf, terminal="rest"),
    "among people": szlib.MPCSettings.among_people(time_limit=np.inf),
}


@pytest.mark.parametrize(
    "again", [copy.copy, copy.deepcopy, lambda c: pickle.loads(pickle.dumps(c))]
)
@pytest.mark.parametrize("name", SETTINGS)
def test_a_copy_gives_the_steps_of_its_original_bit_for_bit(name, again):
    walls = [[(-6, 2), (6, 2)], [(1.0, -3.0), (1.0, -1.2)]]
    original = szlib.MPCCBF(ZONE, walls=walls, settings=SETTINGS[name])
    state = np.array([-4.0, 0.3, 0.0, 0.0])
    rows = np.array([[0.0, 0.2, -0.3, 0.0], [2.0, -1.0, 0.0, 0.0]])
    for k in range(25):
        if k == 20:
            rows[0, 2:] = 0.0
        step = original.step(state, GOAL, rows, ids="ab")
        state = advance(state, step.control, 0.1)
        rows[:, :2] += 0.1 * rows[:, 2:]
    twin = again(original)
    assert np.array_equal(twin.walls, original.walls)
    assert twin.settings == original.settings
    for _ in range(10):
        step, other = (c.step(state, GOAL, rows, ids="ab") for c in (original, twin))
        assert np.array_equal(other.inputs, step.inputs)
        assert np.array_equal(other.residual, step.residual)
        assert other.status == step.status and np.array_equal(other.target, step.target)
        claims = "safe", "walls_safe", "passively_safe", "stuck", "way_length"
        assert [getattr(other, c) for c in claims] == [getattr(step, c) for c in claims]
        state = advance(state, step.control, 0.1)
    assert step.scene.people[0].heading == pytest.approx(np.pi), "remembered"


def test_a_run_is_the_same_bit_for_bit_each_time():
    for name in ("default", "among people"):
        controllers = [szlib.MPCCBF(ZONE, settings=SETTINGS[name]) for _ in range(2)]
        first, again = (drive_among(each, [4] * 40) for each in controllers)
        assert np.array_equal(first, again)


def test_copies_can_be_used_in_other_threads():
    controller = controller_of()
    expected = drive_among(controller, [2] * 30)
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
            return drive_among(each, [2] * 30)

        assert all(np.array_equal(found, expected) for found in pool.map(run, copies))


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

n_steps, settings = 40, szlib.MPCSettings(time_limit=float("inf"))
built_here = [[szlib.MPCCBF(zone, settings=settings) for _ in here] for _ in range(2)]
alone = answers_of(built_here[0], threads=False)
for controllers in (built_here[1], [None] * 4, [None] * 4):
    assert np.array_equal(answers_of(controllers, threads=True), alone)
"""


def test_one_controller_a_thread_gives_the_same_answers_as_one_after_another():
    done = subprocess.run(
        [sys.executable, "-c", ONE_EACH], capture_output=True, text=True
    )
    assert done.returncode == 0, (done.returncode, done.stderr)


def test_a_controller_used_in_a_second_thread_raises_an_error():
    def ask(controller):
        try:
            return controller.step((-4, 0, 0, 0), GOAL).status
        except szlib.SolverError as error:
            return str(error)

    with ThreadPoolExecutor(max_workers=1) as other:
        mine, theirs = controller_of(), controller_of()
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


def test_each_solver_package_is_imported_by_its_modules_only():
    found = {"casadi": set(), "daqp": set()}
    for file in Path(szlib.__file__).parent.rglob("*.py"):
        text = file.read_text(encoding="utf-8")
        for package, where in found.items():
            if re.search(rf"^\s*(import|from) {package}\b", text, re.MULTILINE):
                where.add(file.stem)
    assert found == {"casadi": {"problem"}, "daqp": {"planner"}}


def test_settings_and_walls_cannot_be_changed_in_silence():
    controller = szlib.MPCCBF(ZONE, walls=[[(0, 3), (5, 3)]])
    with pytest.raises(AttributeError):
        controller.settings = szlib.MPCSettings(v_max=0.3)
    for each in (controller, copy.deepcopy(controller)):
        with pytest.raises(ValueError, match="read-only"):
            each.walls[0, 0] = 1.0
    with pytest.raises(szlib.SolverError, match="settings must be MPCSettings"):
        szlib.MPCCBF(ZONE, settings={})
