"""Only obstacles in reach are in the problem of many; plans and claims stay about all of them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from studies.distances import euclidean_to_segment

import szlib
from szlib.control import HalfPlane, Obstacles, Wall, Zone, advance, planner
from szlib.control.obstacles import find_bodies
from szlib.control.problem import build_horizon, follow_velocities
from szlib.core.checks import Array

ZONE = szlib.Ellipse((0.1, 0.0), (1.0, 0.7))
S = szlib.MPCSettings(time_limit=np.inf)
AMONG_PEOPLE = szlib.MPCSettings.among_people(time_limit=np.inf)
START, GOAL = (0.0, 0.0), (15.0, 9.0)


def scattered(n: int, seed: int = 0, size: float = 40.0) -> Array:
    """Short and long walls, none within 1.5 m of start and goal."""
    rng, walls = np.random.default_rng(seed), list[Array]()
    while len(walls) < n:
        middle, angle, half = (
            rng.uniform(-size / 2, size / 2, 2),
            rng.uniform(0, np.pi),
            rng.uniform(0.01, 2),
        )
        along = half * np.array([np.cos(angle), np.sin(angle)])
        if (
            euclidean_to_segment([START, GOAL], middle - along, middle + along).min()
            > 1.5
        ):
            walls.append(np.array([middle - along, middle + along]))
    return np.array(walls)


def drive(controller: szlib.MPCCBF, steps: int) -> list[szlib.Step]:
    state, taken = np.array([0.0, 0.0, 0.3, 0.1]), list[szlib.Step]()
    for _ in range(steps):
        taken.append(
            controller.step(state, GOAL, [szlib.Person((2.0, 1.0), (-0.3, 0.0))])
        )
        state = advance(state, taken[-1].control, 0.1)
    return taken


@pytest.mark.parametrize("settings", [S, AMONG_PEOPLE], ids=["default", "people"])
def test_the_plan_is_that_with_all_walls(
    monkeypatch: pytest.MonkeyPatch, settings: szlib.MPCSettings
) -> None:
    """Asked at the same states, step by step: two runs may part where two plans cost the same.

    Without a time limit, so that no plan depends on the speed of the machine.
    """
    walls, state = scattered(90), np.array([0.0, 0.0, 0.3, 0.1])
    near = szlib.MPCCBF(ZONE, walls=walls, settings=settings)
    whole = szlib.MPCCBF(ZONE, walls=walls, settings=settings)
    person = szlib.Person((2.0, 1.0), (-0.3, 0.0))
    for k in range(40):
        a = near.step(state, GOAL, [person.after(0.1 * k)])
        with monkeypatch.context() as patched:
            patched.setattr(planner, "_MOST_UNFILTERED", 1000)
            b = whole.step(state, GOAL, [person.after(0.1 * k)])
        assert a.inputs == pytest.approx(b.inputs, abs=1e-4)
        assert a.h.shape == b.h.shape == (91,) and a.residual.shape == b.residual.shape
        assert a.clearance.shape == b.clearance.shape
        assert a.h == pytest.approx(b.h)
        claims = "safe", "status", "walls_safe", "passively_safe"
        assert [getattr(a, c) for c in claims] == [getattr(b, c) for c in claims]
        assert a.verify().ok, a.verify().faults
        state = advance(state, a.control, 0.1)
    of_near, of_whole = (
        {key[2][1] for key in each._planner._programs} for each in (near, whole)
    )
    assert of_whole == {90} and max(of_near) < 85


@pytest.mark.parametrize("settings", [S, AMONG_PEOPLE], ids=["default", "people"])
def test_the_plan_is_that_with_everybody(
    monkeypatch: pytest.MonkeyPatch, settings: szlib.MPCSettings
) -> None:
    """Of a crowd that walks, most are too far away to matter."""
    rng, state = np.random.default_rng(3), np.array([0.0, 0.0, 0.3, 0.1])
    places = rng.uniform(-20, 20, (60, 2))
    places = places[np.hypot(*places.T) > 3.0]
    people = np.hstack([places, rng.uniform(-0.8, 0.8, places.shape)])
    near, whole = (szlib.MPCCBF(ZONE, settings=settings) for _ in range(2))
    for _ in range(40):
        a = near.step(state, GOAL, people)
        with monkeypatch.context() as patched:
            patched.setattr(planner, "_MOST_UNFILTERED", 1000)
            b = whole.step(state, GOAL, people)
        assert a.inputs == pytest.approx(b.inputs, abs=1e-4)
        assert a.status == b.status and a.verify().ok, a.verify().faults
        state = advance(state, a.control, 0.1)
        people[:, :2] += 0.1 * people[:, 2:]
    sizes = {key[1][1] for key in near._planner._programs if len(key) > 1}
    assert max(sizes) < 40 < len(people)


class Exhibit(szlib.control.Obstacle):
    """A place around which a visitor is kept off far beyond what could be touched."""

    kind = "exhibit"

    @staticmethod
    def distance(x: Any, y: Any, t: Any, *numbers: Any) -> Any:
        px, py = numbers
        return ((x - px) ** 2 + (y - py) ** 2) ** 0.5 - 3.0

    @classmethod
    def gap(cls, x: Any, y: Any, t: Any, *numbers: Any) -> Any:
        return cls.distance(x, y, t, *numbers) + 2.9

    def margin(self, settings: szlib.MPCSettings) -> float:
        return 2.0


class Cart(szlib.control.Obstacle):
    """A cart that drives, of the priority of a body."""

    kind = "cart"
    priority = szlib.control.Priority.BODY

    @staticmethod
    def distance(x: Any, y: Any, t: Any, *numbers: Any) -> Any:
        px, py, vx, vy = numbers
        return ((x - px - t * vx) ** 2 + (y - py - t * vy) ** 2) ** 0.5 - 0.5

    @classmethod
    def speeds(cls, numbers: Array) -> Array:
        return np.hypot(numbers[:, 2], numbers[:, 3])


def test_a_users_obstacle_among_many_is_kept_off_by_its_own_distance_and_margin() -> (
    None
):
    far = [Exhibit(100.0 + i, 100.0) for i in range(40)]
    fast = szlib.MPCSettings(gamma=0.3, a_max=3.0, time_limit=np.inf)
    controller = szlib.MPCCBF(ZONE, obstacles=[Exhibit(10.0, 0.3), *far], settings=fast)
    state = np.array([0.0, 0.0, 0.8, 0.0])
    for _ in range(120):
        step = controller.step(state, (20.0, 0.0))
        assert step.feasible and step.h.min() >= 0
        state = advance(state, step.control, 0.1)
    assert state[0] > 3.5, "it came as near as it may"


@pytest.mark.parametrize("n", [4, 40])
def test_an_obstacle_that_comes_fast_is_met_though_many_others_are_near(n: int) -> None:
    posts = [[(4.0 + 0.1 * i, -3.0), (4.0 + 0.1 * i, -3.05)] for i in range(n)]
    quick = szlib.MPCSettings.among_people(gamma=0.9, a_max=3.0, time_limit=np.inf)
    cart = Cart(5.8, 8.0, 0.0, -3.0)
    controller = szlib.MPCCBF(ZONE, walls=posts, obstacles=[cart], settings=quick)
    for _ in range(2):
        step = controller.step((3.5, 0.0, 0.8, 0.0), (20.0, 0.0))
    assert step.status == "optimal" and step.feasible


def test_what_is_left_out_keeps_its_zone_and_its_body_whatever_the_plan() -> None:
    """Bodies as well, where the gap to them reaches beyond the zone."""
    s = szlib.MPCSettings.among_people(body_gap=1.5, v_max=0.4)
    rng, n_left_out = np.random.default_rng(4), 0
    small = szlib.Ellipse((0.1, 0.0), (0.3, 0.25))
    times = np.array(s.times)
    for _ in range(60):
        x, y, vx, vy = rng.uniform(-4, 4, (4, 30)) * [[1.0], [1.0], [0.1], [0.1]]
        rows = [
            Zone(*Zone.place(small, each[:2], 0.0, each[2:]))
            for each in zip(x, y, vx, vy, strict=True)
        ]
        zones = Obstacles.of(rows, s)
        state = (0.0, 0.0, *rng.uniform(-0.4, 0.4, 2))
        question = planner.Question(state, GOAL, (0.0, 0.0), zones)
        inputs = follow_velocities(s, state[2:], rng.uniform(-0.4, 0.4, (s.N, 2)))
        left_out = planner.Planner(s)._find_spare(question, inputs) > 0
        at = build_horizon(s).states(np.array(state), inputs)[:, :2].T
        h = zones.h(*at, times)
        keep = (1 - s.gamma) ** np.array(s.step_lengths)
        bodies = find_bodies(zones, s, as_predicted=True).h(*at, times)
        assert (h[left_out, 1:] >= keep * h[left_out, :-1]).all()
        assert (h[left_out] >= 0).all() and (bodies[left_out] >= 0).all()
        n_left_out += left_out.sum()
    assert n_left_out > 100


def test_a_plan_that_is_cut_short_before_all_its_obstacles_are_known_is_not_optimal() -> (
    None
):
    hasty = szlib.MPCSettings.among_people(time_limit=1e-9, deadline=1e-9)
    for seed in range(4):
        walls = scattered(200, seed, size=16.0)
        controller = szlib.MPCCBF(ZONE, walls=walls, settings=hasty)
        step = controller.step((0.0, 0.0, 0.0, 0.0), GOAL)
        assert step.timed_out and (step.feasible or step.status != "optimal")


@pytest.mark.parametrize("seed", (1, 2, 5, 6))
def test_a_plan_that_leaves_its_guess_meets_the_walls_that_it_did_not_know(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The guess leads away from the goal, so that the first problem lacks the walls on the way."""
    rng = np.random.default_rng(seed)
    walls = scattered(200, seed, size=20.0)
    fixed = szlib.MPCCBF(ZONE, walls=walls, settings=AMONG_PEOPLE)._fixed
    state, target = (*START, *rng.uniform(-0.7, 0.7, 2)), (4.0, 2.5)
    question = planner.Question(state, target, (0.0, 0.0), fixed)
    backwards = np.tile((-0.8, -0.6), (AMONG_PEOPLE.N, 1))
    away = follow_velocities(AMONG_PEOPLE, state[2:], backwards)
    asked = list[int]()
    of_some = planner.Planner._plan_among

    def count(self: Any, question: Any, guess: Array) -> Any:
        asked.append(question.barriers.size)
        return of_some(self, question, guess)

    monkeypatch.setattr(planner.Planner, "_plan_among", count)
    plan = planner.Planner(AMONG_PEOPLE).plan(question, away)
    assert asked == sorted(asked) and len(asked) > 1 and asked[-1] < 200
    program = planner.Planner(AMONG_PEOPLE).prepare(question, has_floors=True)
    program.inputs[:] = plan.inputs
    program.evaluate()
    assert program.is_violated() == plan.is_relaxed
    if plan.is_relaxed:
        assert program.sum_violations() == pytest.approx(plan.violations, abs=1e-4)


@pytest.mark.parametrize("v", [1.0, 0.05])
def test_no_move_makes_an_obstacle_out_of_reach_matter(v: float) -> None:
    """Its barrier condition holds wherever the robot goes within the horizon."""
    rng = np.random.default_rng(1)
    reach = v * (planner._find_reach_time(S) + S.dt * S.N)
    fixed = [Wall(-half, 0.0, half, 0.0) for half in (5e-4, 0.05, 0.2, 0.5, 2.0, 20.0)]
    for each in [*fixed, HalfPlane((0.0, 0.0), (0.0, 1.0))]:
        table = Obstacles.of([each], S)
        half = each.numbers[2] if isinstance(each, Wall) else 1.0
        spread = half + 1 + 11 * v
        points = rng.uniform(-spread, spread, (3000, 2)).tolist()
        out = np.array(
            [
                p
                for p in points
                if table.find_travel(*np.transpose([p]), 0.0, 0.0) > reach
            ]
        )
        assert len(out) > 100
        edge = out[np.argsort(np.abs(np.hypot(*out.T) - reach))][:500]
        for step in (0.0, (S.N - 1) * v * S.dt):
            angles = rng.uniform(0, 2 * np.pi, (2, len(edge)))
            to = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
            x = edge + step * to[0]
            h, after = (table.h(*p.T) for p in (x, x + v * S.dt * to[1]))
            assert (after >= (1 - S.gamma) * h).all() and (h > 0).all()


def test_a_wall_that_comes_near_is_in_the_problem_in_time() -> None:
    row = [[(x, 6.0), (x + 0.5, 6.0)] for x in np.arange(-30.0, 30.0, 0.5)]
    controller, state = szlib.MPCCBF(ZONE, walls=row, settings=S), np.zeros(4)
    for _ in range(100):
        step = controller.step(state, (0.0, 20.0))
        assert step.safe and step.verify().ok
        state = advance(state, step.control, 0.1)
    assert 4.5 < state[1] < 5.5


def test_a_robot_that_is_too_fast_sees_farther() -> None:
    walls = scattered(300)
    counts = []
    for speed in (0.0, 1.0, 2.0):
        controller = szlib.MPCCBF(ZONE, walls=walls)
        controller.step((0.0, 0.0, speed, 0.0), (9.0, 0.0))
        programs = controller._planner._programs
        counts.append(max(sum(of[1] for of in key[1:]) for key in programs))
    assert counts[0] <= counts[1] < counts[2]


def test_new_walls_and_a_reset_are_noticed() -> None:
    controller = szlib.MPCCBF(ZONE, walls=scattered(100), settings=S)
    first = drive(controller, 5)
    controller.set_walls(scattered(100, seed=1))
    other = drive(controller, 5)
    controller.set_walls(scattered(100))
    controller.reset()
    again = drive(controller, 5)
    assert all(np.array_equal(a.h, b.h) for a, b in zip(first, again, strict=True))
    assert not np.array_equal(first[0].h, other[0].h)


@pytest.mark.parametrize("make", [szlib.MPCCBF, szlib.DifferentialDrive])
def test_a_run_among_many_walls_has_a_log_about_all(make: Any) -> None:
    walls = scattered(60)
    scenario = szlib.Scenario(
        "field", (0, 0, 0, 0), (1.0, 0.2), (szlib.Person((3.0, 0.0)),), walls
    )
    log = szlib.simulate(scenario, make(ZONE, walls=walls), max_time=2.0)
    assert log.residual.shape[1] == log.h.shape[1] == 61
    assert log.metrics()["unflagged_violations"] == 0
