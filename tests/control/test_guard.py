"""The promises of the guard: no wall is ever touched, and the robot rests when somebody walks into it.

Gaps are computed here from the states alone, at ten times within each step.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
import shapely

import szlib
from szlib.control import Body, HalfPlane, Obstacles, advance
from szlib.control.controller import find_stopping_path
from szlib.control.obstacles import Group, Path, find_bodies

ZONE = szlib.Ellipse((-0.05, 0.017), (1.084, 0.625), -0.28)
BODY = 0.25
SETTINGS = {
    "default": szlib.MPCSettings(time_limit=np.inf),
    "among people": szlib.MPCSettings.among_people(time_limit=np.inf),
    "small and fast": szlib.MPCSettings.among_people(
        time_limit=np.inf, r_robot=0.3, v_max=1.5, dt=0.2
    ),
    "wheels": szlib.MPCSettings.among_people(time_limit=np.inf, r_robot=0.3),
}


def build(name: str, **more: Any) -> Any:
    kind = szlib.DifferentialDrive if name == "wheels" else szlib.MPCCBF
    return kind(ZONE, settings=SETTINGS[name], **more)


def follow(robot: Any, own: Any, control: Any, dt: float) -> np.ndarray:
    """States of the disc within a step, (11, 4)."""
    times = np.linspace(0.0, dt, 11)
    return np.array([robot.body(robot.advance(own, control, t)) for t in times])


def measure_walls(walls: Any, points: np.ndarray) -> float:
    lines = shapely.multilinestrings(np.asarray(walls, float))
    return float(shapely.distance(lines, shapely.points(points)).min())


def test_the_robot_of_the_issue_stays_on_its_side_of_the_wall() -> None:
    """Two people, 2 m away and more, walk towards it: it used to drive through the wall at 0.43 m/s."""
    controller = szlib.MPCCBF(ZONE, walls=[[(-20, 0), (20, 0)]])
    x = np.array([0, 0.7, 0, 0.0])
    people = np.array([[-0.3, 4, 0, -1.0], [0.3, 4, 0, -1.0]])
    for _ in range(60):
        step = controller.step(x, (6, 0.7), people)
        assert step.walls_safe and step.passively_safe
        x = np.r_[
            x[:2] + 0.1 * x[2:] + 0.005 * step.control, x[2:] + 0.1 * step.control
        ]
        people[:, :2] += 0.1 * people[:, 2:]
        assert x[1] - 0.5 > 0
    assert step.verify().ok


# --- walls, whatever people do -----------------------------------------------------------------------


def draw_world(rng: np.random.Generator, radius: float) -> tuple[Any, Any] | None:
    """Walls of any length around a robot that can stop, and its state; None if it cannot."""
    middle = rng.uniform(-2.5, 2.5, (rng.integers(1, 7), 1, 2))
    half = rng.uniform(0.02, 3.0, middle.shape[:1])[:, None]
    angle = rng.uniform(0, np.pi, half.shape)
    along = half * np.column_stack([np.cos(angle), np.sin(angle)])
    walls = middle + along[:, None] * np.array([[-1], [1]])
    speed, heading = rng.uniform(0, 1.0), rng.uniform(-np.pi, np.pi)
    velocity = speed * np.array([np.cos(heading), np.sin(heading)])
    stop = velocity * np.abs(velocity).max() / 2 * 1.3
    way = np.linspace(0, 1, 21)[:, None] * stop
    if measure_walls(walls, way) < radius + 0.08:
        return None
    return walls, np.r_[0.0, 0.0, velocity]


def draw_people(rng: np.random.Generator, state: Any) -> Iterator[tuple[Any, Any]]:
    """People who appear, vanish, jump, and whose measurements are sometimes no numbers."""
    n = int(rng.integers(1, 6))
    people = np.c_[rng.uniform(-3, 3, (n, 2)), rng.uniform(-1.6, 1.6, (n, 2))]
    while True:
        people[:, :2] += 0.1 * people[:, 2:]
        jumps = rng.random(n) < 0.04
        people[jumps] = np.c_[rng.uniform(-2, 2, (n, 2)), rng.uniform(-2, 2, (n, 2))][jumps]  # fmt: skip
        turns = rng.random(n) < 0.1
        people[turns, 2:] = rng.uniform(-1.6, 1.6, (n, 2))[turns]
        seen = people.copy()
        seen[rng.random((n, 4)) < 0.01] = rng.choice([np.nan, np.inf, 1e300])
        present = rng.random(n) < 0.9
        ids = rng.choice(["a", "b", "c", 1, 2], n, replace=False).tolist()
        yield seen[present], [ids[i] for i in np.flatnonzero(present)]


UNUSUAL = "small and fast"  # its steps are short, so its runs are long
ROBOTS = [
    pytest.param(each, marks=pytest.mark.slow) if each == UNUSUAL else each
    for each in SETTINGS
]


@pytest.mark.parametrize("name", ROBOTS)
def test_no_wall_is_touched_whatever_people_do_and_whatever_a_sensor_says(
    name: str,
) -> None:
    rng, driven, verified, braked = np.random.default_rng(17), 0, 0, 0
    radius, dt = SETTINGS[name].r_robot, SETTINGS[name].dt
    extra = (
        0.35 if name == "wheels" else 0.0
    )  # where the point ahead must be able to stop
    worlds = 20 if name == UNUSUAL else 6  # tests/hostile/walls.py searches many more
    while driven < worlds:
        world = draw_world(rng, radius + extra)
        if world is None:
            continue
        walls, state = world
        controller, own = build(name, walls=walls), state
        if name == "wheels":
            own = controller.robot.start(np.r_[state[:2], 0.5 * state[2:]])
        people = draw_people(rng, state)
        for k in range(35):
            if k % 12 == 0:
                goal = rng.uniform(-6, 6, 2)
            rows, ids = next(people)
            step = controller.step(own, goal, rows, ids=ids)
            assert step.walls_safe, (driven, k, step)
            way = follow(controller.robot, own, step.control, dt)
            assert measure_walls(walls, way[:, :2]) >= radius - 1e-6, (driven, k)
            if k % 6 == 0:
                verified += 1
                assert step.verify().ok, step.verify().faults
            braked += step.status == "braking"
            own = controller.robot.advance(own, step.control, dt)
        driven += 1
    assert verified > 3 * worlds and braked > 0


@pytest.mark.parametrize("name", ["default", "among people", "wheels"])
@pytest.mark.parametrize("width", [2.0, 3.0])
def test_two_people_abreast_in_a_corridor_press_nobody_into_a_wall(
    name: str, width: float
) -> None:
    walls = [[(-15.0, y), (15.0, y)] for y in (-width / 2, width / 2)]
    radius, dt = SETTINGS[name].r_robot, 0.1
    for pace, offset in ((0.8, 0.0), (1.2, 0.1), (1.6, -0.2)):
        controller = build(name, walls=walls)
        own = controller.robot.start(np.array([0.0, offset, 0.0, 0.0]))
        people = np.array([[5.0, 0.35, -pace, 0.0], [5.0, -0.35, -pace, 0.0]])
        for _ in range(80):
            step = controller.step(own, (8.0, 0.0), people)
            assert step.walls_safe
            way = follow(controller.robot, own, step.control, dt)
            assert measure_walls(walls, way[:, :2]) >= radius - 1e-6
            own = controller.robot.advance(own, step.control, dt)
            people[:, :2] += dt * people[:, 2:]


def test_a_state_that_cannot_stop_is_said_to_be_and_brakes_as_well_as_it_can() -> None:
    walls = [[(-20.0, 0.0), (20.0, 0.0)]]
    controller, x = szlib.MPCCBF(ZONE, walls=walls), np.array([0.0, 0.75, 0.0, -0.9])
    lowest = []
    for _ in range(15):
        step = controller.step(x, (0.0, 0.7))
        lowest.append(step.walls_safe)
        assert step.verify().ok
        x = advance(x, step.control, 0.1)
    first = controller.step((0.0, 0.75, 0.0, -0.9), (0.0, 0.7))
    assert not lowest[0] and "cannot stop before a wall" in first.explain()
    # full braking would end 0.155 m inside
    assert abs(x[3]) < 0.5 and x[1] > 0.75 - 0.405 - 0.02


@pytest.mark.parametrize("status", ["walls", "bodies"])
def test_the_guard_of_the_paper_is_off_and_its_claims_are_true(status: str) -> None:
    """`paper()` applies its plan; the claims are made all the same."""
    settings = szlib.MPCSettings.paper()
    walls = [[(-20.0, 0.0), (20.0, 0.0)]] if status == "walls" else []
    controller = szlib.MPCCBF(ZONE, walls=walls, settings=settings)
    rng, claims = np.random.default_rng(4), set()
    for _ in range(60):
        controller.reset()
        state = np.r_[0.0, rng.uniform(0.55, 1.2), rng.uniform(-0.7, 0.7, 2)]
        people = [] if status == "walls" else [[1.2, 0.8, -0.6, 0.0]]
        step = controller.step(state, (5.0, -2.0), people)
        assert step.verify().ok and step.status != "braking"
        claims.add(step.walls_safe if status == "walls" else step.passively_safe)
    assert claims == {True, False}


# --- bodies ------------------------------------------------------------------------------------------


def drive_in_room(
    seed: int, name: str, n: int = 2
) -> Iterator[tuple[Any, Any, np.ndarray, np.ndarray]]:
    """A robot at rest in a closed room, and people who keep walking through it; step by step."""
    rng, dt = np.random.default_rng(seed), SETTINGS[name].dt
    corners = 3.0 * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    walls = np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)
    angles = rng.uniform(-np.pi, np.pi, n)
    starts = 6 * np.c_[np.cos(angles), np.sin(angles)]
    courses = rng.uniform(-2, 2, (n, 2)) - starts
    courses *= (rng.uniform(0.3, 1.6, n) / np.hypot(*courses.T))[:, None]
    people = np.c_[starts, courses]
    controller = build(name, walls=walls)
    own = controller.robot.start(np.r_[rng.uniform(-2, 2, 2), 0, 0])
    goal = rng.uniform(-2, 2, 2)
    for _ in range(90):
        step = controller.step(own, goal, people)
        way = follow(controller.robot, own, step.control, dt)
        times = np.linspace(0, dt, 11)[:, None, None]
        places = people[:, :2] + times * people[:, 2:]
        gaps = np.hypot(*np.moveaxis(places - way[:, None, :2], -1, 0)) - BODY
        yield step, way, gaps - SETTINGS[name].r_robot, people
        own = controller.robot.advance(own, step.control, dt)
        people = people + dt * np.c_[people[:, 2:], np.zeros((n, 2))]


@pytest.mark.parametrize("name", ROBOTS)
def test_a_passively_safe_robot_rests_when_people_who_keep_walking_reach_it(
    name: str,
) -> None:
    overlapped = steps = 0
    for seed in range(12):
        was_safe = True
        for step, way, gaps, _ in drive_in_room(seed, name):
            steps += 1
            assert step.walls_safe
            # from a passively safe state the next one is: people keep their velocity
            assert step.passively_safe or not was_safe, (seed, step.explain())
            was_safe = step.passively_safe
            is_moving = np.hypot(*np.diff(way[:, :2], axis=0).T).max() > 1e-4
            if was_safe and is_moving and gaps[0].min() >= 0:
                assert gaps.min() >= -1e-5, (seed, step.explain())
            overlapped += gaps.min() < 0
    # among people the robot has gone out of the way, 3 s ahead
    assert overlapped > 0 or name != "default", "somebody walks into a robot at rest"


@pytest.mark.parametrize("name", ROBOTS)
def test_the_robot_never_moves_towards_a_body_that_it_overlaps(name: str) -> None:
    """People may jump onto it; then it stays or goes away from where they are, from sample to sample."""
    rng, controller, found = np.random.default_rng(23), build(name), 0
    radius, dt = SETTINGS[name].r_robot, SETTINGS[name].dt
    bow = np.sqrt(2) * SETTINGS[name].a_max * dt**2 / 8
    for _ in range(25):
        controller.reset()
        own = controller.robot.start(np.zeros(4))
        for k in range(4):
            angle, near = rng.uniform(-np.pi, np.pi), rng.uniform(0.2, radius + BODY)
            place = near * np.array([np.cos(angle), np.sin(angle)]) + own[:2]
            rows = [
                [*place, *rng.uniform(-1, 1, 2)],
                [*rng.uniform(-3, 3, 2), 0.0, 0.3],
            ]
            step = controller.step(
                own, rng.uniform(-5, 5, 2), rows[: rng.integers(1, 3)]
            )
            way = follow(controller.robot, own, step.control, dt)[:, :2]
            if step.passively_safe:
                found += 1
                moved = (way - way[0]) @ (place - way[0]) / np.hypot(*(place - way[0]))
                assert moved[-1] <= 1e-6 and moved.max() <= bow, (k, step.explain())
            assert k or step.passively_safe, "from rest it can always stay"
            own = controller.robot.advance(own, step.control, dt)
    assert found > 40


def test_bodies_that_overlap_and_bodies_that_do_not_are_bounded_number_by_number() -> (
    None
):
    """One body is met half way, between two points of the path; another is overlapped and neared by 1 cm."""
    controller = build("default")
    path = Path(np.array([(0.0, 0.0), (1.0, 0.0)]), np.array([0.0, 0.1]), np.zeros(1))
    reach = controller.settings.r_robot + BODY
    met, overlapped = [0.5, reach - 0.02, 0.0, 0.0], [0.01, 0.3, 0.0, 0.0]
    found = []
    for rows in ([met], [overlapped], [met, overlapped]):
        group = Group(Body, np.array(rows), np.full(len(rows), reach))
        bodies = Obstacles((group,), controller.settings.r_robot)
        found.append(controller._bound_bodies(bodies, path))
    alone, neared, both = found
    assert alone.lower < -0.02 and alone.seen > 0.1
    assert neared == pytest.approx((-0.01, -0.01))
    assert both == pytest.approx((alone.lower, -0.01))


@pytest.mark.parametrize("name", ["default", "among people"])
def test_people_who_are_left_out_of_the_check_cannot_be_touched(name: str) -> None:
    rng, controller, far = np.random.default_rng(1), build(name), 0
    s = controller.settings
    for _ in range(1000):
        velocity, control = rng.uniform(-1, 1, (2, 2)) * [[s.v_max], [s.a_max]]
        places, walks = rng.uniform(-3, 3, (2, 2)), rng.uniform(-1.6, 1.6, (2, 2))
        people = [szlib.Person(tuple(places[i]), tuple(walks[i])) for i in range(2)]
        scene = controller._ask((0.0, 0.0, *velocity), (5.0, 5.0), people)
        _, near = controller._find_near(scene, control)
        if near.groups:
            continue
        far += 1
        for inputs in (control[None], np.zeros((0, 2))):
            path = find_stopping_path(scene.state, inputs, s)
            assert find_bodies(scene.zones, s).bound(path).is_safe
    assert far > 300


def test_a_robot_that_rests_is_passively_safe_whoever_comes() -> None:
    controller = build("default", walls=[[(-1.0, 0.6), (1.0, 0.6)]])
    for speed in (0.5, 2.0, 8.0):
        people = [[speed * 0.08 + 0.75, 0.0, -speed, 0.0], [0.0, -0.6, 0.0, 0.4]]
        step = controller.step((0.0, 0.0, 0.0, 0.0), (-5.0, 0.0), people)
        if np.hypot(*step.control) < 1e-9:
            assert step.passively_safe
        assert step.verify().ok, step.verify().faults


def test_a_half_plane_belongs_to_the_promise() -> None:
    rng = np.random.default_rng(5)
    for _ in range(5):
        angle = rng.uniform(-np.pi, np.pi)
        normal = np.array([np.cos(angle), np.sin(angle)])
        edge = HalfPlane(-0.7 * normal, normal)
        controller, state = build("among people", obstacles=[edge]), np.zeros(4)
        people = draw_people(rng, state)
        for _ in range(25):
            rows, ids = next(people)
            step = controller.step(state, -6 * normal, rows, ids=ids)
            way = follow(controller.robot, state, step.control, 0.1)[:, :2]
            assert step.walls_safe
            assert ((way + 0.7 * normal) @ normal).min() >= 0.5 - 1e-6
            state = advance(state, step.control, 0.1)


@pytest.mark.parametrize("a_max", [0.05, 0.3, 1.0])
def test_a_stopping_path_is_passed_at_its_times(a_max):
    """Also if it is looked at in pieces of several steps: people are where they are at these times."""
    s = szlib.MPCSettings(a_max=a_max)
    path = find_stopping_path((0.0, 0.0, 1.0, 0.0), np.array([[-a_max, 0.0]]), s)
    t = path.times.clip(max=1.0 / a_max)
    assert 1.0 / a_max <= path.times[-1] + 1e-9 < 1.1 / a_max + 0.2
    expected = np.column_stack([t - a_max * t**2 / 2, 0 * t])
    assert path.points == pytest.approx(expected, abs=path.bows.max())
    assert path.points[:-1] == pytest.approx(expected[:-1], abs=1e-9)


def test_two_wheels_that_were_pushed_keep_their_promise_about_walls():
    """They measure -12 m/s, and obey a command of 2 m/s at once: the planned point is no faster."""
    walls = [[(3.056, 3.462), (4.689, 3.722)], [(0.091, 3.848), (0.862, 4.19)]]
    s = szlib.MPCSettings(dt=0.2, a_max=3, v_max=2, time_limit=np.inf, max_iterations=8)
    drive = szlib.DifferentialDrive(ZONE, walls=walls, settings=s)
    own = np.array([0.336, 2.736, -2.153, -12.556, -0.261])
    rows = [(1.386, 2.799, -0.126, -2.380), (0.378, 2.290, -0.361, -0.204)]
    later = [(2.732, 3.522, -2.272, -1.305), (-1.445, 2.577, 0.066, -0.417)]
    for k in range(12):
        step = drive.step(own, (-1.418, -1.309), later if k else rows)
        assert step.walls_safe and step.verify().ok
        assert (
            drive._walls.gaps(*follow(drive.robot, own, step.control, 0.2).T[:2]).min()
            > 0
        )
        own = drive.robot.advance(own, step.control, 0.2)


def test_a_control_that_spares_a_wall_is_not_given_up_for_a_body():
    """A robot that moves at a wall, before which it cannot stop on its path, turns away from it."""
    s = szlib.MPCSettings.among_people(r_robot=0.3, dt=0.2, time_limit=np.inf)
    controller = szlib.MPCCBF(ZONE, walls=[[(-5, 0.351), (8, 0.351)]], settings=s)
    state, person = np.array([0.0, 0.0, 0.9, 0.18]), szlib.Person((0.78, 0), (-0.16, 0))
    for k in range(8):
        step = controller.step(state, (4.0, 0.0), [person.after(0.2 * k)])
        assert step.walls_safe and step.verify().ok
        way = follow(controller.robot, state, step.control, 0.2)
        assert (0.351 - 0.3 - way[:, 1]).min() > 0.0
        state = advance(state, step.control, 0.2)


@pytest.mark.parametrize(("dt", "a_max"), [(0.02, 0.7), (0.02, 0.5), (0.1, 0.1)])
def test_a_robot_that_can_just_stop_can_stop_after_each_step(dt, a_max):
    """Also if it needs more than 64 steps to rest: the bound is that of the same pieces of its way."""
    wall = [(0.0, -50.0), (0.0, 50.0)]
    for speed in np.linspace(0.8, 1.2, 8):
        s = szlib.MPCSettings(dt=dt, a_max=a_max, v_max=1.3, time_limit=np.inf)
        controller = szlib.MPCCBF(ZONE, walls=[wall], settings=s)
        state = np.array([-(speed**2) / 2 / a_max - 0.6, 0.0, speed, 0.0])
        path = find_stopping_path(state.tolist(), np.zeros((0, 2)), s)
        state[0] += controller._walls.bound(path).lower - 1e-7
        for _ in range(12):
            step = controller.step(state, (5.0, 0.0))
            assert step.walls_safe
            state = advance(state, step.control, dt)


def test_a_post_is_seen_by_the_guard_though_the_paper_hardly_sees_it() -> None:
    """With the paper's margin a short wall has h > 0 where the robot touches it; the guard takes the gap."""
    settings = szlib.MPCSettings(
        margin="paper", v_max=0.1, gamma=0.5, N=2, R=(300.0, 300.0), time_limit=np.inf
    )
    post = [[(2.0, -7.5e-4), (2.0, 7.5e-4)]]
    far = [[(30.0 + i, 30.0), (30.0 + i, 31.0)] for i in range(40)]
    controller = szlib.MPCCBF(ZONE, walls=post + far, settings=settings)
    state = np.array([0.85, 0.0, 0.0, 0.0])
    for _ in range(250):
        step = controller.step(state, (1.83, 0.0))
        assert step.walls_safe and step.verify().ok, step.verify().faults
        state = advance(state, step.control, 0.1)
    assert state[0] > 1.4, "it comes near the post"


def test_a_safe_plan_is_kept_where_the_new_one_is_not_safe() -> None:
    """A person comes from behind, another one crosses: a robot that brakes stops in front of them."""
    walls = [((-20.0, y), (20.0, y)) for y in (1.5, -1.5)]
    people = np.array([[-4.701, 0.65, 0.497, -0.05], [-1.234, -0.996, 0.956, 1.023]])
    controller = szlib.MPCCBF(
        szlib.Ellipse((0.1, 0.0), (1.0, 0.7)), walls=walls, settings=SETTINGS["default"]
    )
    x, statuses = np.zeros(4), []
    for _ in range(40):
        step = controller.step(x, (6.0, 0.0), people)
        statuses.append(step.status)
        assert step.passively_safe and step.verify().ok, step.explain()
        way = follow(controller.robot, x, step.control, 0.1)
        places = people[:, :2] + np.linspace(0, 0.1, 11)[:, None, None] * people[:, 2:]
        gaps = np.hypot(*np.moveaxis(places - way[:, None, :2], -1, 0)) - BODY - 0.5
        is_moving = np.hypot(*np.diff(way[:, :2], axis=0).T).max() > 1e-4
        assert not is_moving or gaps[:, gaps[0] >= 0].min(initial=1.0) >= -1e-5
        x = advance(x, step.control, 0.1)
        people[:, :2] += 0.1 * people[:, 2:]
    assert "kept" in statuses


@pytest.mark.slow
def test_a_robot_that_was_passively_safe_is_never_hit_while_it_moves() -> None:
    """Corridors and open floor, people of constant velocity who aim at its way; on a uniform horizon."""
    kept = 0
    for seed in range(300):
        rng = np.random.default_rng(seed)
        walls = [((-20.0, y), (20.0, y)) for y in (1.5, -1.5)] if seed % 2 else []
        angles = rng.uniform(-np.pi, np.pi, 3)
        places = rng.uniform(1.2, 6.0, (3, 1)) * np.c_[np.cos(angles), np.sin(angles)]
        if walls:
            places[:, 1] = places[:, 1].clip(-1.2, 1.2)
        aims = np.c_[rng.uniform(0, 2.5, 3), np.zeros(3)] + rng.normal(0, 0.4, (3, 2))
        courses = aims - places
        courses *= (rng.choice([0.0, 0.5, 1.0, 1.4], 3) / np.hypot(*courses.T))[:, None]
        people = np.c_[places, courses]
        controller = szlib.MPCCBF(ZONE, walls=walls, settings=SETTINGS["default"])
        x, was_safe = np.array([0.0, 0.0, 0.8 * (seed % 3 == 0), 0.0]), False
        for _ in range(40):
            step = controller.step(x, (6.0, 0.0), people)
            kept += step.status == "kept"
            assert step.passively_safe or step.status != "kept"
            was_safe |= step.passively_safe
            way = follow(controller.robot, x, step.control, 0.1)
            times = np.linspace(0, 0.1, 11)[:, None, None]
            offsets = people[:, :2] + times * people[:, 2:] - way[:, None, :2]
            gaps = np.hypot(*np.moveaxis(offsets, -1, 0)) - BODY - 0.5
            speed = np.hypot(*way[:, 2:].T)
            touched = (gaps < -1e-5) & (gaps[0] >= 0) & (speed > 0.05)[:, None]
            assert not (was_safe and touched.any()), (seed, step.explain())
            x = advance(x, step.control, 0.1)
            people[:, :2] += 0.1 * people[:, 2:]
    assert kept > 0
