"""A differential drive: what its module proves, its limits, and the true disc on a fine grid."""

import copy
import pickle
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from itertools import islice
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from studies.distances import euclidean_to_ellipse, euclidean_to_segment

import szlib
from szlib.control.differential_drive import Unicycle
from szlib.control.obstacles import ellipse_distance, segment_distance
from szlib.control.settings import TOLERANCE
from szlib.simulation.scenario import Worlds, draw_zone
from szlib.zones.ellipses import BODY_RADIUS

ZONE = szlib.Ellipse((0.1, 0.0), (1.0, 0.7), 0.0)
OPEN, GOAL = (6.0, 1.0), (4.0, 0.0)
FACING = szlib.Person((0.0, 0.0), heading=np.pi)
AT_LEISURE = szlib.MPCSettings(time_limit=np.inf)


def drives(seed):
    """Robots of all kinds: slow and fast, nimble and not, with a point near or far."""
    rng = np.random.default_rng(seed)
    while True:
        settings = szlib.MPCSettings(
            dt=rng.uniform(0.05, 0.3),
            v_max=rng.uniform(0.2, 2.0),
            r_robot=rng.uniform(0.1, 0.6),
        )
        ahead = rng.choice([None, rng.uniform(0.05, 1.0)])
        yield szlib.DifferentialDrive(
            ZONE,
            settings=settings,
            omega_max=rng.uniform(0.5, 8.0),
            ahead=ahead,
        )


def integrate(own, control, dt, times):
    """Poses (n, 3) at times, by an independent integration of the differential equation."""
    v, omega = control
    turn = solve_ivp(
        lambda _, pose: [v * np.cos(pose[2]), v * np.sin(pose[2]), omega],
        (0, dt),
        own[:3],
        t_eval=times,
        rtol=1e-10,
        atol=1e-12,
    )
    return turn.y.T


def barriers_of_point(drive, at, people):
    """h of the point ahead of the axle: what the plan keeps."""
    drive.reset()
    tracked = szlib.control.TrackedPeople(tuple(people))
    return drive._make_scene(
        (*at, 0.0, 0.0), tuple(at), tracked, is_point=True
    ).barriers.h(*at)


def point_of(pose, ahead):
    return pose[..., :2] + ahead * np.stack(
        [np.cos(pose[..., 2]), np.sin(pose[..., 2])], axis=-1
    )


def loop(drive, own, goal, people=(), steps=150):
    """States and steps of a closed loop with people who walk on."""
    states, decided, dt = [own], [], drive.settings.dt
    for k in range(steps):
        decided.append(drive.step(states[-1], goal, [p.after(k * dt) for p in people]))
        states.append(drive.robot.advance(states[-1], decided[-1].control, dt))
    return np.array(states), decided


# --- the construction --------------------------------------------------------------------------------


def test_the_point_lands_where_the_plan_says_near_its_chord_and_within_the_limits():
    rng = np.random.default_rng(0)
    for drive in islice(drives(1), 60):
        s, own = (
            drive.settings,
            np.r_[rng.uniform(-5, 5, 2), rng.uniform(-np.pi, np.pi), 0, 0],
        )
        way = drive.v_max * s.dt * rng.choice([1.0, rng.uniform()])
        angle = rng.uniform(-np.pi, np.pi)
        start = point_of(own, drive.ahead)
        end = start + way * np.array([np.cos(angle), np.sin(angle)])
        (_, reached), (control,) = drive._wheels.follow(
            own, np.array([start, end]), [0.0, s.dt]
        )
        v, omega = control
        assert abs(v) <= s.v_max * (1 + 1e-12)
        assert abs(omega) <= drive.omega_max * (1 + 1e-12)
        poses = integrate(own, control, s.dt, np.linspace(0, s.dt, 21))
        points = point_of(poses, drive.ahead)
        assert points[-1] == pytest.approx(end, abs=1e-9)
        assert drive.robot.advance(own, control, s.dt)[:2] == pytest.approx(
            poses[-1, :2], abs=1e-9
        )
        assert reached[:2] == pytest.approx(poses[-1, :2], abs=1e-9)
        across = np.array([-np.sin(angle), np.cos(angle)])
        assert np.abs((points - start) @ across).max() <= drive.chord_error + 1e-12
        assert np.hypot(*(poses[:, :2] - points).T) == pytest.approx(drive.ahead)


def test_the_chord_error_and_the_limits_are_attained():
    """No slack is left in the bounds: some motion turns at omega_max, and bows as far as allowed."""
    for drive in islice(drives(2), 20):
        if drive.v_max < drive.settings.v_max:  # the turning rate is what limits
            dt, side = (
                drive.settings.dt,
                np.arccos(-drive.v_max * drive.settings.dt / 2 / drive.ahead),
            )
            end = [
                drive.ahead + drive.v_max * dt * np.cos(side),
                drive.v_max * dt * np.sin(side),
            ]
            _, (control,) = drive._wheels.follow(
                np.zeros(5), np.array([end, end]), [0.0, dt]
            )
            assert control[1] == pytest.approx(drive.omega_max)
            points = point_of(
                integrate(np.zeros(3), control, dt, [0, dt / 2, dt]), drive.ahead
            )
            assert np.hypot(
                *(points[1] - points[[0, 2]].mean(axis=0))
            ) == pytest.approx(drive.chord_error, rel=1e-6)


def test_the_disc_is_safe_at_any_heading_where_the_point_is_safe():
    """For people and walls, of any length: also those so short that their own margin is more than eps."""
    rng, near = np.random.default_rng(3), 0
    for _ in range(50):
        s = szlib.MPCSettings(
            eps=rng.choice([0.0, 0.05]),
            margin=rng.choice(["required", "euclidean", "paper"]),
        )
        wall = rng.uniform(-2, 2, 2) + np.outer(
            [-1, 1], rng.uniform(-1, 1, 2)
        ) * rng.choice([0.1, 2.0])
        drive = szlib.DifferentialDrive(
            ZONE, walls=[wall], settings=s, ahead=rng.uniform(0.1, 0.6)
        )
        person = szlib.Person(
            tuple(rng.uniform(-2, 2, 2)),
            heading=rng.uniform(-3, 3),
            zone=draw_zone(rng),
        )
        zone = person.zone.placed(person.position, person.heading)
        for point in rng.uniform(-5, 5, (60, 2)):
            h = barriers_of_point(drive, point, [person])
            if h.min() < 0 or h.min() > 0.2:
                continue
            near += 1
            angle = rng.uniform(-np.pi, np.pi, 30)
            discs = point - drive.ahead * np.column_stack(
                [np.cos(angle), np.sin(angle)]
            )
            for disc in discs:
                assert drive.barriers(disc, [person]).min() >= -1e-12
            assert euclidean_to_segment(discs, *wall).min() >= s.r_robot
            assert euclidean_to_ellipse(discs, zone).min() >= s.r_robot + s.eps - 1e-9
    assert near > 60


def test_the_barriers_are_those_of_the_disc():
    wall = np.array([[3.0, -1.0], [3.0, 0.2]])
    drive = szlib.DifferentialDrive(ZONE, walls=[wall])
    person = szlib.Person((1.0, 2.0), (0.3, 0.1))
    plain = szlib.MPCCBF(ZONE, walls=[wall])
    for position in np.random.default_rng(4).uniform(-4, 4, (20, 2)):
        assert drive.barriers(position, [person]) == pytest.approx(
            plain.barriers(position, [person])
        )
    step = drive.step((-2.0, 0.0, 0.3), OPEN, [person])
    assert step.h == pytest.approx(plain.barriers((-2.0, 0.0), [person]))
    assert step.h[1] == pytest.approx(
        segment_distance([-2.0, 0.0], *wall) - 0.5 - 0.25 / 1.2
    )
    assert step.h[0] == pytest.approx(
        ellipse_distance([-2.0, 0.0], ZONE.placed((1.0, 2.0), person.heading)) - 0.55
    )


def test_the_loop_of_the_point_is_that_of_a_double_integrator():
    """From sample to sample: the position is the planned one, and the plan begins at the planned velocity."""
    drive = szlib.DifferentialDrive(ZONE)
    person = szlib.Person((2.5, 0.4), (-0.3, 0.0))
    states, steps = loop(drive, np.r_[-1.0, 0.0, 2.0, 0.0, 0.0], OPEN, [person], 60)
    for k in range(1, 60):
        assert point_of(states[k], drive.ahead) == pytest.approx(
            steps[k - 1].planned[1, :2], abs=1e-9
        )
        assert steps[k].planned[0, 2:] == pytest.approx(
            steps[k - 1].planned[1, 2:], abs=1e-9
        )
        assert steps[k - 1].predicted[1, :2] == pytest.approx(states[k, :2], abs=1e-12)


# --- the robot ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("heading", np.linspace(-3, 3, 7))
def test_the_drive_reaches_its_goal_past_a_person_from_any_heading(heading):
    drive = szlib.DifferentialDrive(ZONE)
    person = szlib.Person((3.0, 0.5), heading=np.pi)
    states, steps = loop(drive, np.r_[0.0, 0.0, heading, 0.0, 0.0], OPEN, [person])
    assert np.hypot(*(states[-1, :2] - OPEN)) <= 0.1
    assert np.abs(states[-1, 3:]).max() <= 0.05
    assert all(step.safe for step in steps)


def test_every_step_is_safe_where_there_is_nobody_and_no_wall():
    _, steps = loop(szlib.DifferentialDrive(ZONE), np.zeros(5), OPEN, steps=3)
    assert all(step.safe for step in steps)


@pytest.mark.slow
def test_the_disc_stays_clear_between_samples_after_every_safe_step():
    """People and walls, by Euclidean distance, ten times within each step; positions by integration."""
    checked = 0
    for seed in range(4):
        rng = np.random.default_rng(seed)
        zone, wall = (
            draw_zone(rng),
            np.array([[1.0, -4.0], [1.0 + rng.uniform(-1, 1), -1.2]]),
        )
        people = [
            szlib.Person(
                tuple(rng.uniform((2, -2), (5, 2))),
                tuple(rng.uniform(-0.5, 0.5, 2)),
                zone=zone,
            )
            for _ in range(3)
        ]
        drive = szlib.DifferentialDrive(ZONE, walls=[wall], settings=AT_LEISURE)
        own = Unicycle(rng.uniform(-np.pi, np.pi)).start(
            [-2.0, rng.uniform(-2, 2), 0.0, 0.0]
        )
        states, steps = loop(drive, own, OPEN, people)
        for k, step in enumerate(steps):
            if not step.safe:
                continue
            checked += 1
            times = np.linspace(0, 0.1, 11)
            discs = integrate(states[k], step.control, 0.1, times)[:, :2]
            assert euclidean_to_segment(discs, *wall).min() >= 0.5
            for person in people:
                at = [person.after(0.1 * k + t).position for t in times]
                gap = (
                    euclidean_to_ellipse(
                        discs - at, zone.placed((0, 0), person.heading)
                    )
                    - 0.5
                )
                assert gap[[0, -1]].min() >= 0.05 - 2 * TOLERANCE  # eps, at the samples
                assert (
                    gap.min() >= 0.05 - (1.5 * 0.1) ** 2 / 8 / 0.8 - drive.chord_error
                )
                assert (np.hypot(*(discs - at).T) - 0.5 - BODY_RADIUS).min() >= 0
    assert checked > 500


def test_plans_that_end_at_rest_stay_feasible_among_standing_people():
    """Recursive feasibility, proved of the double integrator in `szlib.control.mpc`, holds of the wheels."""
    settings, quiet = (
        szlib.MPCSettings(terminal="rest", time_limit=np.inf),
        Worlds(standing=1.0, start_speed=0.0, min_h=0.6),
    )
    for seed in range(10):
        scene = quiet(seed)
        drive = szlib.DifferentialDrive(ZONE, walls=scene.walls, settings=settings)
        own = Unicycle(np.random.default_rng(seed).uniform(-np.pi, np.pi)).start(
            scene.start
        )
        assert (
            barriers_of_point(drive, point_of(own, drive.ahead), scene.people).min()
            >= 0
        )
        states, steps = loop(drive, own, scene.goal, scene.people, 100)
        assert all(step.safe for step in steps)
        assert (
            min(drive.barriers(state[:2], scene.people).min() for state in states)
            >= -TOLERANCE
        )


def test_a_plan_begins_at_the_true_velocity_of_a_robot_that_was_stopped():
    """With (v, omega) the stop is seen; without, the robot is assumed to follow its commands."""
    own, held, trusted = (
        np.zeros(5),
        szlib.DifferentialDrive(ZONE),
        szlib.DifferentialDrive(ZONE),
    )
    for _ in range(8):
        fast = held.step(own, OPEN)
        trusted.step(own[:3], OPEN)
        own = held.robot.advance(own, fast.control, 0.1)
    assert fast.control[0] > 0.5
    own[3:] = 0.0
    assert np.hypot(*held.step(own, OPEN).planned[0, 2:]) == 0.0
    assert trusted.step(own[:3], OPEN).control[0] > fast.control[0]


def test_the_pose_is_enough_for_a_robot_that_follows_its_commands():
    person = szlib.Person((2.5, 0.4), (-0.3, 0.0))
    drive = szlib.DifferentialDrive(ZONE)
    states, steps = loop(drive, np.r_[0.0, 0.0, 1.0, 0.0, 0.0], OPEN, [person], 40)
    drive.reset()
    for k, (state, step) in enumerate(zip(states[:-1], steps, strict=True)):
        assert drive.step(
            state[:3], OPEN, [person.after(0.1 * k)]
        ).control == pytest.approx(step.control)


def test_turning_and_moving_the_world_does_not_change_the_commands():
    """By a quarter turn: the box of accelerations is the same again."""
    rotation, shift = np.array([[0.0, -1.0], [1.0, 0.0]]), np.array([30.0, -8.0])
    person = szlib.Person((2.5, 0.4), (-0.3, 0.05))
    moved = szlib.Person(
        tuple(rotation @ person.position + shift), tuple(rotation @ person.velocity)
    )
    goal = rotation @ OPEN + shift
    here, _ = loop(szlib.DifferentialDrive(ZONE), np.zeros(5), OPEN, [person], 100)
    there, _ = loop(
        szlib.DifferentialDrive(ZONE), np.r_[shift, np.pi / 2, 0, 0], goal, [moved], 100
    )
    assert there[:, :2] == pytest.approx(here[:, :2] @ rotation.T + shift, abs=1e-2)


@pytest.mark.parametrize("name", list(szlib.SCENARIOS))
def test_the_drive_reaches_the_goal_in_the_scenarios_of_the_paper(name):
    """In the loop of szlib. At 8 rad/s: with 4, two passages are too narrow for the point ahead."""
    scenario = szlib.SCENARIOS[name]
    log = szlib.simulate(
        scenario,
        szlib.DifferentialDrive(
            ZONE, walls=scenario.walls, settings=AT_LEISURE, omega_max=8.0
        ),
    )
    numbers = log.metrics()
    assert numbers["success"]
    assert numbers["flagged_steps"] == numbers["unflagged_violations"] == 0
    assert numbers["min_h"] >= 0
    assert list(log.table.columns[6:8]) == ["v", "omega"]


def test_a_collision_by_a_person_is_flagged_before_it_happens():
    person = szlib.Person((2.2, 0.0), (-2.0, 0.0))
    drive = szlib.DifferentialDrive(ZONE)
    own = np.zeros(5)
    for k in range(12):
        now = person.after(0.1 * k)
        step = drive.step(own, OPEN, [now])
        own = drive.robot.advance(own, step.control, 0.1)
        if drive.barriers(own[:2], [now.after(0.1)]).min() < 0:
            assert not step.safe
            return
    raise AssertionError("no person ran into the robot: the test is void")


# --- limits and arguments ------------------------------------------------------------------------------


def test_only_an_ahead_below_the_default_makes_the_robot_slower():
    settings = szlib.MPCSettings(v_max=0.8)
    assert szlib.DifferentialDrive(ZONE, settings=settings).v_max == pytest.approx(0.8)
    near = szlib.DifferentialDrive(ZONE, settings=settings, ahead=0.1, omega_max=2.0)
    assert near.v_max == pytest.approx(0.2, rel=0.01)
    assert near.v_max < 0.2
    assert near._s.r_robot == pytest.approx(0.5 + 0.05 + 0.1 + near.chord_error)


def test_people_may_be_an_array_with_ids_and_an_unknown_person_makes_the_step_unsafe():
    rows = np.array([[3.0, 0.4, -0.3, 0.0], [2.0, 3.0, 0.0, 0.0]])
    by_row, by_person = szlib.DifferentialDrive(ZONE), szlib.DifferentialDrive(ZONE)
    people = [szlib.Person((3.0, 0.4), (-0.3, 0.0)), szlib.Person((2.0, 3.0))]
    step = by_row.step(np.zeros(3), OPEN, rows, ids=["a", "b"])
    assert step.control == pytest.approx(
        by_person.step(np.zeros(3), OPEN, people).control
    )
    assert step.safe
    lost = by_row.step(
        np.zeros(3), OPEN, np.vstack([rows, np.full(4, np.nan)]), ids=["a", "b", "c"]
    )
    assert not lost.safe
    assert lost.unknown == 1


def test_walls_may_change_between_steps_and_a_copy_continues_identically():
    drive = szlib.DifferentialDrive(ZONE)
    own = np.zeros(5)
    for _ in range(5):
        own = drive.robot.advance(own, drive.step(own, OPEN).control, 0.1)
    drive.set_walls([((2.0, -0.5), (2.0, 0.5), (3.0, 0.5))])
    twins = [pickle.loads(pickle.dumps(drive)), copy.deepcopy(drive), copy.copy(drive)]
    step = drive.step(own, OPEN)
    assert step.h == pytest.approx(
        szlib.MPCCBF(ZONE, walls=drive.walls).barriers(own[:2])
    )
    assert len(step.h) == 2
    for twin in twins:
        assert np.array_equal(twin.step(own, OPEN).control, step.control)
    with ThreadPoolExecutor(1) as thread:  # built here, used there
        there = szlib.DifferentialDrive(ZONE, walls=drive.walls)
        assert thread.submit(there.step, np.zeros(3), OPEN).result().safe


def test_a_goal_too_close_to_a_wall_raises_nothing_at_the_first_step():
    drive = szlib.DifferentialDrive(ZONE, walls=[((4.0, -3.0), (4.0, 3.0))])
    step = drive.step((0.0, 0.0, 0.0), (3.9, 0.0))
    assert step.goal_blocked
    assert step.safe


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"omega_max": 0.0}, "omega_max must be in"),
        ({"omega_max": 40.0}, "omega_max must be in"),
        ({"omega_max": np.nan}, "omega_max must be finite"),
        ({"ahead": 0.0}, "ahead must be positive"),
        ({"ahead": -0.2}, "ahead must be positive"),
    ],
)
def test_limits_that_cannot_be_used_raise_an_error(given, message):
    with pytest.raises(szlib.SolverError, match=message):
        szlib.DifferentialDrive(ZONE, **given)


def test_a_state_of_the_wrong_shape_and_a_goal_inside_a_wall_raise_an_error():
    drive = szlib.DifferentialDrive(ZONE, walls=[((4.0, -3.0), (4.0, 3.0))])
    expected = (
        r"\(x, y, theta\) or \(x, y, theta, v, omega\) .*; got \(0.0, 0.0, 0.0, 0.0\)"
    )
    with pytest.raises(szlib.SolverError, match=expected):
        drive.step((0.0, 0.0, 0.0, 0.0), (2.0, 0.0))
    with pytest.raises(szlib.SolverError, match="m for wall 0"):
        drive.check_start((0.0, 0.0, 0.0, 0.0), (3.9, 0.0), [])
    drive.check_start((0.0, 0.0, 0.0, 0.0), (3.0, 0.0), [])


def test_the_robot_starts_in_its_direction_of_motion_or_at_the_given_heading():
    robot = Unicycle(heading=1.0)
    assert robot.start([1, 2, 0, 0]) == pytest.approx([1, 2, 1, 0, 0])
    assert robot.start([1, 2, 0, -0.5]) == pytest.approx([1, 2, -np.pi / 2, 0.5, 0])
    state = np.array([1.0, 2.0, 0.3, -0.4])
    assert robot.body(robot.start(state)) == pytest.approx(state)


def test_by_default_the_robot_turns_as_fast_as_a_common_one():
    assert szlib.DifferentialDrive(ZONE).omega_max == 4.0


@pytest.mark.parametrize("state", [[[1], [1, 2]], "x", None, [0.0] * 4])
def test_a_state_of_another_shape_is_refused(state):
    with pytest.raises(szlib.SolverError, match="state must"):
        szlib.DifferentialDrive(ZONE).step(state, (4.0, 0.0))


# --- ways, and goals close to a wall ---------------------------------------------------------------


def drive_to(
    goal: tuple[float, float], walls: Any, steps: int, **more: Any
) -> list[Any]:
    drive = szlib.DifferentialDrive(
        ZONE, walls=walls, settings=szlib.MPCSettings(lookahead=4.0, time_limit=np.inf)
    )
    own, taken = drive.robot.start((-3.0, 0.0, 0.0, 0.0)), []
    for _ in range(steps):
        taken.append(drive.step(own, goal, **more))
        own = drive.robot.advance(own, taken[-1].control, 0.1)
    return taken


def test_a_drive_goes_around_a_wall() -> None:
    steps = drive_to((3.0, 0.3), [[(0.0, -2.0), (0.0, 2.0)]], 150)
    assert np.hypot(*(steps[-1].predicted[0, :2] - (3.0, 0.3))) < 0.1
    assert all(step.safe for step in steps) and steps[80].verify().ok


@pytest.mark.parametrize("gap", [0.75, 0.9])
def test_a_drive_turns_its_back_to_a_wall_behind_the_goal(gap: float) -> None:
    wall = [[(gap, -3.0), (gap, 3.0)]]
    steps = drive_to((0.0, 0.0), wall, 200)
    assert min(np.hypot(*step.predicted[0, :2]) for step in steps) < 0.1
    assert all(step.safe for step in steps)
    # the point ahead would be m for the wall
    assert abs(steps[-1].own[2]) > 1.5


# --- the step ---------------------------------------------------------------------------------------


def test_a_drive_step_is_verified_and_explained():
    drive = szlib.DifferentialDrive(ZONE, walls=[[(-6, 4), (6, 4)]])
    step = drive.step(
        (-4.0, 0.0, 0.1), GOAL, [szlib.Person((0.0, 0.2), (-0.5, 0.0), id="ann")]
    )
    assert step.verify().ok and step.verify().safe == step.safe
    assert repr(step).startswith(
        "DriveStep(optimal, safe, control=("
    ) and "\n" not in repr(step)
    said = step.explain()
    assert (
        said.startswith("Step: optimal")
        and "person 0 (id 'ann')" in said
        and "WRONG" not in said
    )


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        (
            lambda step: {"control": np.add(step.control, (0.01, 0))},
            "motion of the disc",
        ),
        (
            lambda step: {"own": np.add(step.own, (0, 0, 0.01, 0, 0))},
            "motion of the disc",
        ),
        (lambda step: {"inputs": step.inputs + 0.1}, "motion of the disc"),
        (lambda step: {"scene": step.of_point}, "h differs"),
    ],
)
def test_a_false_claim_of_a_drive_step_is_a_fault(change, fault):
    step = szlib.DifferentialDrive(ZONE, settings=AT_LEISURE).step(
        (-4.0, 0.0, 0.1, 0.5, 0.1), GOAL, [FACING]
    )
    assert step.verify().ok
    lie = replace(step, **change(step))
    assert any(fault in found for found in lie.verify().faults), lie.verify().faults
    assert "WRONG" in lie.explain()


def test_forged_claims_of_the_guard_are_faults_of_a_drive_step():
    """They are about the disc, and recomputed on its arcs."""
    s = szlib.MPCSettings(time_limit=np.inf, r_robot=0.3)
    near = szlib.DifferentialDrive(ZONE, walls=[[(0.6, -5), (0.6, 5)]], settings=s)
    step = near.step((0.0, 0.0, 0.0, 0.95, 0.0), GOAL)
    assert not step.walls_safe and step.verify().ok
    lie = replace(step, walls_safe=True)
    assert any("cannot" in fault for fault in lie.verify().faults)
    person = [[1.0, 0.0, -1.2, 0.0]]
    met = szlib.DifferentialDrive(ZONE, settings=s).step(
        (0, 0, 0, 0.95, 0), GOAL, person
    )
    assert not met.passively_safe and met.verify().ok
    lie = replace(met, passively_safe=True)
    assert any("does not" in fault for fault in lie.verify().faults)


@pytest.mark.slow
@pytest.mark.parametrize("omega_max", [2.0, 4.0])
@pytest.mark.parametrize("seed", range(6))
def test_a_robot_never_moves_towards_a_person_whom_it_overlaps(seed, omega_max):
    """Where its wheels cannot leave them it stands still, until they go; then it goes on."""
    rng = np.random.default_rng(seed)
    settings = szlib.MPCSettings.among_people(r_robot=0.3, v_max=0.8)
    drive = szlib.DifferentialDrive(ZONE, settings=settings, omega_max=omega_max)
    contact = settings.r_robot + BODY_RADIUS
    away, angle = rng.uniform(0.2, contact - 0.02), rng.uniform(-np.pi, np.pi)
    person = szlib.Person((away * np.cos(angle), away * np.sin(angle)))
    own = np.array([0.0, 0.0, rng.uniform(-np.pi, np.pi), 0.0, 0.0])
    gaps = [away - contact]
    for _ in range(200):
        step = drive.step(own, GOAL, [person])
        assert step.verify().ok
        own = drive.robot.advance(own, step.control, settings.dt)
        gaps.append(np.hypot(*(own[:2] - person.position)) - contact)
    overlap = np.minimum(gaps, 0.0)
    assert np.diff(overlap).min() > -1e-3
    here = own[:2].copy()
    for _ in range(40):
        own = drive.robot.advance(own, drive.step(own, GOAL).control, settings.dt)
    left = np.hypot(*(GOAL - here)), np.hypot(*(GOAL - own[:2]))
    assert left[1] < max(left[0] - 1.0, 0.2)


def test_a_robot_that_overlaps_somebody_rests_while_another_person_is_unknown():
    settings = szlib.MPCSettings.among_people(r_robot=0.3, v_max=0.8)
    drive = szlib.DifferentialDrive(ZONE, settings=settings, omega_max=2.0)
    own = np.zeros(5)
    for _ in range(20):
        step = drive.step(own, GOAL, [[0.156, -0.233, 0.0, 0.0], [np.nan] * 4])
        own = drive.robot.advance(own, step.control, settings.dt)
    assert own[:3] == pytest.approx(0.0, abs=1e-9) and step.unknown == 1


def test_explain_names_the_goal_that_was_given():
    """Near the goal the wheels plan for a point beside it."""
    drive = szlib.DifferentialDrive(ZONE)
    step = drive.step((2.5, 0.0, 1.5), (3.0, 0.0), [szlib.Person((3.0, 0.5))])
    assert step.scene.goal == (3.0, 0.0) and step.goal_blocked
    assert "the goal (3.0, 0.0) cannot be reached" in step.explain()


@pytest.mark.parametrize("heading", [-1.6, 0.0, 1.6])
def test_a_goal_is_blocked_or_not_whatever_the_heading_is(heading: float) -> None:
    """The disc fits at both goals; at the second one it would touch the wall."""
    settings = szlib.MPCSettings(r_robot=0.3)
    drive = szlib.DifferentialDrive(
        ZONE, walls=[((-5.0, 0.6), (5.0, 0.6))], settings=settings
    )
    assert not drive.step((0.0, -3.0, heading), (0.0, 0.0)).goal_blocked
    assert drive.step((0.0, -3.0, heading), (0.0, 0.4)).goal_blocked
