"""Crowds: reacting people reach their goals, replayed people are where they were recorded."""

import cmath
import math
import sys

import numpy as np
import pytest
from helpers.crowd_models import scene
from helpers.track_tables import make_tracks, make_walk
from studies.replay import (
    MIN_START_DISTANCE,
    SENSING_RANGE,
    ReplacedWalker,
    find_replays,
)

import szlib
from szlib.control.people import Person, Prediction
from szlib.simulation.crowds import (
    Behaviour,
    ModelFactory,
    ReactingPeople,
    SocialForceModel,
    Walkers,
)
from szlib.simulation.monte_carlo import identify
from szlib.zones.ellipses import BODY_RADIUS

Model = str | ModelFactory
FAR = np.array([50.0, 50.0, 0.0, 0.0])
TWO = (Person((-4.0, 0.0), (0.5, 0.0)), Person((4.0, 0.1), (-0.5, 0.0)))


def walk(crowd, robot=FAR, seconds=20.0):
    """x, y, vx, vy, heading of each person every 0.1 s, shape (n, P, 5); a robot that moves drives on."""
    rows = []
    for k in range(round(seconds * 10) + 1):
        here = np.r_[robot[:2] + 0.1 * k * robot[2:], robot[2:]]
        rows.append(
            [(*p.position, *p.velocity, p.heading) for p in crowd(0.1 * k, here)]
        )
    return np.array(rows)


def gaps(paths):
    """Distance of the first two people at each time [m]."""
    return np.hypot(*(paths[:, 0, :2] - paths[:, 1, :2]).T)


def test_a_person_alone_walks_straight_to_the_goal_at_their_pace(model):
    path = walk(
        ReactingPeople(model, jitter=0).start(scene(TWO[0], duration=10.0), 0),
        seconds=10.0,
    )[:, 0]
    assert path[0, :2] == pytest.approx((-4, 0))
    assert np.abs(path[:, 1]).max() < 1e-6
    assert np.hypot(*path[20:60, 2:4].T) == pytest.approx(0.5, abs=1e-3)
    assert abs(path[-1, 0] - 1.0) <= 0.61, (
        "within the 0.5 m where people stop by social force, and a start from rest"
    )


def test_velocity_is_the_displacement_per_time_step(model):
    paths = walk(ReactingPeople(model).start(scene(*TWO), 3))
    assert np.diff(paths[:, :, :2], axis=0) == pytest.approx(
        0.1 * paths[1:, :, 2:4], abs=1e-6
    )


def test_two_people_who_meet_head_on_pass_each_other(model):
    head_on = (TWO[0], Person((4.0, 0.0), (-0.5, 0.0)))
    paths = walk(ReactingPeople(model).start(scene(*head_on), 1))
    assert paths[-1, 0, 0] > 3 and paths[-1, 1, 0] < -3
    assert gaps(paths).min() > 0.35


def test_people_avoid_the_robot_only_if_they_see_it(model):
    alone = scene(Person((-4.0, 0.1), (0.5, 0.0)))
    robot = np.array([0.0, 0.0, 0.0, 0.0])
    nearest = {
        sees: np.hypot(
            *walk(ReactingPeople(model, sees=sees).start(alone, 0), robot)[:, 0, :2].T
        ).min()
        for sees in ("robot", "person", "nothing")
    }
    assert nearest["nothing"] < 0.25
    assert nearest["person"] > 2 * BODY_RADIUS - 0.11, (
        "JuPedSim's bodies are 5 cm smaller"
    )
    assert nearest["robot"] >= nearest["person"] - 1e-6
    if model != "social force":
        assert nearest["robot"] > 0.5 + BODY_RADIUS - 0.11


def test_people_do_not_walk_through_walls(model):
    wall = [[(0.0, -1.0), (0.0, 1.5)]]
    paths = walk(
        ReactingPeople(model).start(scene(TWO[0], walls=wall), 2), seconds=40.0
    )[:, 0, :2]
    crossing = np.flatnonzero(np.diff(np.sign(paths[:, 0])) != 0)
    assert all(not -1.0 <= paths[k, 1] <= 1.5 for k in crossing)


def test_standing_people_keep_position_and_heading(model):
    standing = Person((0.0, 3.0), heading=1.0)
    path = walk(ReactingPeople(model).start(scene(standing), 0))[:, 0]
    assert path[:, :2] == pytest.approx(np.tile((0.0, 3.0), (201, 1)), abs=1e-3)
    assert (path[:, 4] == 1.0).all()


def test_people_walk_to_given_goals(model):
    crowd = ReactingPeople(model, goals=((3.0, 4.0),), jitter=0).start(
        scene(Person((0.0, 0.0), heading=0.0)), 0
    )
    path = walk(crowd, seconds=25.0)[:, 0]
    assert np.hypot(*(path[-1, :2] - (3.0, 4.0))) < 0.6


def test_people_who_react_keep_no_outdated_prediction_but_their_group(model):
    ahead = Prediction(times=[1.0, 2.0], positions=[(0.5, 0.0), (1.0, 0.0)])
    person = Person((0.0, 0.0), (0.5, 0.0), prediction=ahead, group="pair")
    reacting = ReactingPeople(model).start(scene(person), 0)
    changing = Behaviour(pace=0.5).start(scene(person), 0)
    for crowd in (reacting, changing):
        crowd(0.0, FAR)
        later = crowd(6.0, FAR)[0]
        assert (later.prediction, later.group) == (None, "pair")
        expected = np.add(later.position, later.velocity)
        assert later.after(1.0).position == pytest.approx(expected)


def test_the_same_seed_gives_the_same_people_and_another_seed_others(
    model,
):
    first, again, other = (
        walk(ReactingPeople(model).start(scene(*TWO), seed)) for seed in (1, 1, 2)
    )
    assert (first == again).all()
    assert not np.allclose(first, other, atol=1e-4)


def test_people_keep_their_zones_and_an_empty_crowd_stays_empty(model):
    zone = szlib.Ellipse((0.1, 0.0), (1.0, 0.7))
    crowd = ReactingPeople(model).start(
        scene(Person((0.0, 0.0), (0.5, 0.0), zone=zone)), 0
    )
    assert [crowd(t, FAR)[0].zone for t in (0.0, 0.1, 0.2)] == [zone] * 3
    empty = ReactingPeople(model).start(scene(), 0)
    assert [len(empty(t, FAR)) for t in (0.0, 0.1)] == [0, 0]


class Straight:
    """People who walk straight on, whatever is there: a `WalkingModel`."""

    def __init__(self, walkers):
        self.walking = walkers.velocities

    def velocities(self, positions, robot, dt):
        return self.walking


def test_a_class_can_be_the_model_of_walking():
    paths = walk(ReactingPeople(Straight).start(scene(*TWO), 0))
    assert paths[:, :, 2:4] == pytest.approx(
        np.tile([(0.5, 0.0), (-0.5, 0.0)], (201, 1, 1))
    )
    assert paths[-1, :, :2] == pytest.approx(np.array([(6.0, 0.0), (-6.0, 0.1)]))


def test_models_of_walking_are_part_of_the_key_of_rollouts():
    models = ["orca", "social force", Straight, SocialForceModel]
    keys = [identify(ReactingPeople(model)) for model in models]
    assert len(set(keys)) == 4
    assert keys == [identify(ReactingPeople(model)) for model in models]


def test_decreasing_time_is_rejected(model):
    crowd = ReactingPeople(model).start(scene(*TWO), 0)
    crowd(0.5, FAR)
    assert crowd(0.5, FAR)[0] == crowd(0.5, FAR)[0]
    with pytest.raises(szlib.SolverError, match=r"it is 0\.5 s; got 0\.4 s"):
        crowd(0.4, FAR)


def test_a_missing_package_is_named_with_its_install_command(
    monkeypatch,
):
    monkeypatch.setitem(sys.modules, "pyrvo", None)
    with pytest.raises(szlib.SolverError, match=r"pip install .*crowds"):
        ReactingPeople("orca").start(scene(*TWO), 0)


def test_invalid_parameters_are_rejected():
    with pytest.raises(
        szlib.SolverError,
        match="orca, social force, or make a model from walkers; got 'boids'",
    ):
        ReactingPeople("boids")
    with pytest.raises(szlib.SolverError, match="robot, person, nothing"):
        ReactingPeople("orca", sees="everything")  # type: ignore[arg-type]
    with pytest.raises(szlib.SolverError, match="jitter must be finite"):
        ReactingPeople("orca", jitter=np.nan)
    with pytest.raises(szlib.SolverError, match="a goal for each of 2 people; got"):
        ReactingPeople("orca", goals=((0.0, 0.0),)).start(scene(*TWO), 0)


def push_of_person(here, other, v, w):
    """The push of Moussaid et al. (2009), with the numbers of PySocialForce, in complex numbers."""
    away = (here - other) / abs(here - other)
    along = away - 2 * (v - w)
    reach = 0.35 * abs(along)
    along /= abs(along)
    theta = cmath.phase(along / away)
    near = abs(here - other) / reach
    push = math.exp(-near - (3 * reach * theta) ** 2)
    turn = math.copysign(math.exp(-near - (2 * reach * theta) ** 2), theta)
    return 5.1 * (push - 1j * turn) * along


def test_social_force_is_the_formula_of_its_source():
    """One step of three people and the robot beside a wall, person by person and point by point."""
    rng = np.random.default_rng(0)
    places, goals = rng.uniform(-2, 2, (2, 3)) + 1j * rng.uniform(-2, 2, (2, 3))
    motions = rng.uniform(-0.5, 0.5, 3) + 1j * rng.uniform(-0.5, 0.5, 3)
    speeds, robot, dt = np.abs(motions), np.array([0.3, -0.2, 0.4, 0.1]), 0.1
    wall = np.linspace(-1 + 2.5j, 1 + 2.5j, 20)
    ends = np.array([[(-1.0, 2.5), (1.0, 2.5)]])
    pairs = [np.column_stack([z.real, z.imag]) for z in (places, motions, 9 * goals)]
    model = SocialForceModel(Walkers(*pairs, speeds, ends, 0.5))
    found = model.velocities(pairs[0], robot, dt)
    others = [
        *zip(places, motions, strict=True),
        (robot[:2] @ (1, 1j), robot[2:] @ (1, 1j)),
    ]
    for i, (here, v) in enumerate(zip(places, motions, strict=True)):
        course = 9 * goals[i] - here
        force = (course / abs(course) * speeds[i] - v) / 0.5
        for j, (other, w) in enumerate(others):
            force += push_of_person(here, other, v, w) if j != i else 0
        for point in wall:
            gap = abs(here - point) - 0.35
            force += 10 * math.exp(-gap / 0.2) * (here - point) / abs(here - point)
        expected = v + dt * force
        expected *= min(1.0, speeds[i] / abs(expected))
        assert found[i] @ (1, 1j) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("turn", [1j, -1, -1j, cmath.exp(2j)])
def test_social_force_does_not_depend_on_the_direction_of_x(turn):
    def velocities(factor):
        """Of two people who meet head-on in a scene that is turned by a `factor`."""
        meet = np.array([[-1, 1 + 0.02j], [1 - 0.03j, -1 + 0.02j], [9, -9]]) * factor
        pairs = np.stack([meet.real, meet.imag], axis=-1)
        people = Walkers(*pairs, np.ones(2), np.zeros((0, 2, 2)), None)
        return SocialForceModel(people).velocities(pairs[0], np.zeros(4), 0.1) @ (1, 1j)

    assert velocities(turn) == pytest.approx(turn * velocities(1), abs=1e-12)


# --- replay ------------------------------------------------------------------------------------------


def recording():
    """One walks 8 m; one crosses in front of them; one comes late; one stands; one is far away."""
    return make_tracks(
        make_walk((0, 0), (1.0, 0.0), person=1, begin=10.0, duration=8.0),
        make_walk((4, -4), (0.0, 1.0), person=2, begin=9.0, duration=9.0),
        make_walk((8, 4), (-1.0, 0.0), person=3, begin=12.0, duration=5.0),
        make_walk((4, 3), (0.0, 0.0), person=4, begin=0.0, duration=40.0),
        make_walk((90, 90), (0.5, 0.0), person=5, begin=0.0, duration=40.0),
    )


def replay_of(tracks, person):
    return next(each for each in find_replays(tracks, 99) if each.walker.id == person)


def test_a_replay_has_the_start_and_goal_of_the_walker_and_all_other_people():
    replay = replay_of(recording(), 1)
    assert replay.scenario.start == pytest.approx((0, 0, 0.99, 0)), (
        "as fast as they were, or as it may be"
    )
    assert replay.scenario.goal == pytest.approx((8, 0))
    assert replay.scenario.duration == 16.0
    assert {other.id for other in replay.others} == {2, 3, 4, 5}


def test_replayed_people_are_at_their_recorded_positions():
    tracks = recording()
    crowd, robot = (
        replay_of(tracks, 1).start(scene(), 0),
        np.array([4.0, 0.0, 0.0, 0.0]),
    )
    for t in np.arange(0.0, 16.0, 0.1):
        seen = [p for p in crowd(t, robot) if p is not None]
        now = tracks[np.isclose(tracks["t"], 10.0 + t) & (tracks["id"] != 1)]
        near = now[np.hypot(now["x"] - 4.0, now["y"]) <= SENSING_RANGE]
        was, true = (
            sorted(p.position for p in seen),
            sorted(zip(near["x"], near["y"], strict=True)),
        )
        assert np.reshape(was, (-1, 2)) == pytest.approx(np.reshape(true, (-1, 2)))
        assert {p.velocity for p in seen if p.heading} <= {(0.0, 1.0), (-1.0, 0.0)}
    assert [len([p for p in crowd(t, robot) if p]) for t in (0.0, 5.0, 15.0)] == [
        2,
        3,
        1,
    ]


def test_positions_between_ticks_are_interpolated():
    crowd = replay_of(recording(), 1).start(scene(), 0)
    (other,) = (
        p
        for p in crowd(1.23, np.array([4.0, -2.0, 0, 0]))
        if p is not None and p.velocity[1]
    )
    assert other.position == pytest.approx((4.0, -4.0 + 1.0 + 1.23))


def test_a_person_who_stops_keeps_their_heading():
    tracks = make_tracks(
        make_walk((0, 0), (1.0, 0.0), person=1, duration=8.0),
        make_walk((0, 3), (0.0, 1.0), person=2, duration=2.0),
        make_walk((0, 5), (0.0, 0.0), person=2, begin=2.1, duration=6.0),
    )
    crowd = replay_of(tracks, 1).start(scene(), 0)
    facing = [crowd(t, np.zeros(4))[0].heading for t in (0.0, 2.0, 5.0, 8.0)]
    assert facing == pytest.approx([np.pi / 2] * 4)


def test_the_walker_replaced_can_be_driven_like_a_controller():
    replay = replay_of(recording(), 1)
    walker = ReplacedWalker(replay)
    own = walker.robot.start(replay.scenario.start)
    bodies = []
    for _ in range(101):
        bodies.append(walker.robot.body(own))
        own = walker.robot.advance(
            own, walker.step(own, replay.scenario.goal, ()).control, 0.1
        )
    assert np.array(bodies)[:81] == pytest.approx(replay.walker.states[:, :4])
    assert np.array(bodies)[81:, :2] == pytest.approx(np.tile((8.0, 0.0), (20, 1)))


def test_replays_start_and_end_in_the_area_away_from_people():
    area = szlib.Square(x=(1.0, 7.0), y=(-5.0, 5.0))
    (replay,) = (
        each for each in find_replays(recording(), 99, area=area) if each.walker.id == 1
    )
    assert (replay.scenario.start[0], replay.scenario.goal[0]) == pytest.approx(
        (1.0, 7.0)
    )
    beside = make_walk(
        (0, MIN_START_DISTANCE - 0.1), (1.0, 0.0), person=9, begin=10.0, duration=8.0
    )
    ids = {
        each.walker.id for each in find_replays(make_tracks(recording(), beside), 99)
    }
    assert ids.isdisjoint({1, 9}), "the robot has no companions"
    with pytest.raises(szlib.DataError, match=r"no walker covers 5.0 m"):
        find_replays(recording(), 5, area=szlib.Square(x=(0.0, 1.0), y=(0.0, 1.0)))


def test_the_seed_selects_the_walkers():
    ids = [
        [each.walker.id for each in find_replays(recording(), 2, seed=seed)]
        for seed in (0, 0, 1, 2, 3)
    ]
    assert ids[0] == ids[1]
    assert len({tuple(each) for each in ids}) > 1


def test_each_day_is_a_separate_scene():
    other_day = make_walk(
        (4, 1), (0.0, 1.0), person=2, begin=10.0, duration=9.0, day="2012-10-28"
    )
    first = next(
        r
        for r in find_replays(make_tracks(recording(), other_day), 99)
        if r.walker.id == 1
    )
    assert [other.id for other in first.others].count(2) == 1
