"""Each social metric on a log made by hand, whose answer is known."""

import numpy as np
import pytest
from helpers.made_runs import make_log
from studies import social_metrics
from studies.social_metrics import compute_replay_metrics, compute_social_metrics

import szlib

ZONE = szlib.Ellipse((0.0, 0.0), (0.8, 0.8))


def made(states, people=(), walls=(), arrival=None, goal=(10.0, 0.0)):
    """A log of these states (n, 4), and of each person their (x, y, heading, vx, vy), (n, 5); dt is 0.1 s."""
    states = np.asarray(states, float)
    scenario = szlib.Scenario("made", states[0], goal, walls=walls)
    around = np.zeros((len(states), len(people), 5))
    for i, person in enumerate(people):
        around[:, i] = person
    return make_log(
        scenario, states, around, zone=ZONE, arrival=arrival, has_safety_claims=False
    )


def line(xs, v=1.0):
    xs = np.asarray(xs, float)
    return np.column_stack(
        [xs, np.zeros_like(xs), np.full_like(xs, v), np.zeros_like(xs)]
    )


def still(n, x, y, velocity=(0.0, 0.0)):
    return np.tile([x, y, 0.0, *velocity], (n, 1))


def test_halls_distances_are_fractions_of_time():
    # distances of the disc (0.5 m) to a person at the origin: 0.2, 0.44, 0.45, 1.1, 1.2, 3.5, 3.6, 9
    gaps = np.array([0.2, 0.44, 0.451, 1.1, 1.201, 3.5, 3.601, 9.0])
    found = compute_social_metrics(made(line(0.5 + gaps), [still(8, 0.0, 0.0)]))
    assert (found["intimate"], found["personal"], found["social"]) == (
        2 / 8,
        2 / 8,
        2 / 8,
    )
    assert found["closest_person"] == pytest.approx((gaps - 0.25).mean())


def test_each_distance_belongs_to_one_of_halls(monkeypatch):
    monkeypatch.setitem(social_metrics.HALL_DISTANCES, "personal", (0.25, 1.0))
    monkeypatch.setitem(social_metrics.HALL_DISTANCES, "social", (1.0, 2.0))
    gaps = np.array([0.25, 1.0, 1.0, 2.0])  # exact in binary
    found = compute_social_metrics(made(line(0.5 + gaps), [still(4, 0.0, 0.0)]))
    assert (found["personal"], found["social"]) == (1 / 4, 2 / 4)


def test_only_the_nearest_present_person_counts():
    far, near = still(4, 0.0, 4.0), still(4, 0.0, 1.5)
    near[2:] = np.nan
    found = compute_social_metrics(made(line([0.0] * 4, 0.0), [far, near]))
    assert found["closest_person"] == pytest.approx((0.75 + 0.75 + 3.25 + 3.25) / 4)
    assert (found["personal"], found["social"]) == (0.5, 0.5)


def test_social_metrics_without_people():
    found = compute_social_metrics(made(line([0.0, 0.1])))
    assert np.isnan(found["closest_person"])
    assert found["intimate"] == found["personal"] == found["social"] == 0
    assert found["robot_on_person"] == found["person_on_robot"] == 0


@pytest.mark.parametrize(
    ("robot", "person", "expected"),
    [
        (1.0, 0.0, (1, 0)),  # the robot drives into a standing person
        (0.0, -1.0, (0, 1)),  # a person walks into a standing robot
        (1.0, -0.4, (1, 0)),  # both, the robot faster
        (0.3, -1.0, (0, 1)),  # both, the person faster
        (1.0, 0.5, (1, 0)),  # from behind
        (-0.2, -1.0, (0, 1)),  # it backs away and is caught
    ],
)
def test_a_collision_is_assigned_to_the_faster_one(robot, person, expected):
    t = 0.1 * np.arange(60)
    xs, at = robot * t, 2.0 + person * t
    people = np.column_stack([at, 0 * t, 0 * t, 0 * t + person, 0 * t])
    found = compute_social_metrics(made(line(xs, robot), [people]))
    assert (found["robot_on_person"], found["person_on_robot"]) == expected


def test_a_collision_counts_once_and_again_after_a_gap():
    xs = np.array([0.0, 1.4, 1.5, 1.4, 0.0, 1.4, 1.4])
    found = compute_social_metrics(made(line(xs), [still(7, 2.0, 0.0)]))
    assert (found["robot_on_person"], found["person_on_robot"]) == (2, 0)


def test_a_person_who_appears_in_the_robot_is_a_collision():
    ghost = still(4, 0.2, 0.0, (-1.0, 0.0))
    ghost[:2] = np.nan
    found = compute_social_metrics(made(line([0.0] * 4, 0.0), [ghost]))
    assert (found["robot_on_person"], found["person_on_robot"]) == (0, 1)


def test_heading_changes_of_a_square_a_turn_back_and_a_circle():
    def changes(velocities):
        return compute_social_metrics(made(np.pad(velocities, ((0, 0), (2, 0)))))[
            "heading_changes"
        ]

    assert changes([[1.0, 0], [0, 1], [-1, 0], [0, -1], [1, 0]]) == pytest.approx(
        2 * np.pi
    )
    angle = np.linspace(0, -2 * np.pi, 500)
    assert changes(np.column_stack([np.cos(angle), np.sin(angle)])) == pytest.approx(
        2 * np.pi
    )
    nearly_at_rest = [0.01, 0.01]  # has no direction
    assert changes([[1.0, 0], nearly_at_rest, [-1, 0]]) == pytest.approx(np.pi)
    assert changes(np.zeros((3, 2))) == 0


def test_time_not_moving_is_until_the_arrival():
    states = line([0.0, 0.0, 1.0, 2.0, 10.0, 10.0, 10.0])
    states[[0, 1, 4, 5, 6], 2] = 0.0
    assert compute_social_metrics(made(states, arrival=4))[
        "time_not_moving"
    ] == pytest.approx(0.3)
    assert compute_social_metrics(made(states))["time_not_moving"] == pytest.approx(0.5)


def test_path_efficiency():
    straight = line([0.0, 5.0, 10.0])
    assert compute_social_metrics(made(straight, arrival=2))["path_efficiency"] == 1
    corner = np.array(
        [[0, 0, 0, 0], [0, 10, 0, 0], [10, 10, 0, 0], [10, 0, 0, 0]], float
    )
    assert compute_social_metrics(made(corner, arrival=3))[
        "path_efficiency"
    ] == pytest.approx(1 / 3)
    assert np.isnan(compute_social_metrics(made(straight))["path_efficiency"])
    across = [[(5.0, -3.0), (5.0, 3.0)]]
    assert np.isnan(
        compute_social_metrics(made(corner, walls=across, arrival=3))["path_efficiency"]
    )
    beside = [[(0.0, 3.0), (9.0, 3.0)]]
    assert compute_social_metrics(made(corner, walls=beside, arrival=3))[
        "path_efficiency"
    ] == pytest.approx(1 / 3)


def test_a_replay_is_measured_until_half_a_metre_from_the_goal():
    """The robot drives at 1 m/s along x, in steps of 0.2 m; the goal is at 3 m. A zone has radius 0.8 m."""
    states = line(0.2 * np.arange(20))
    states[3:6, 1] = 0.1
    person, late = still(20, 1.0, 0.1), still(20, 3.8, 0.0)
    found = compute_replay_metrics(made(states, [person, late], goal=(3.0, 0.0)))
    assert (found["reached"], found["time_to_goal"]) == (1, pytest.approx(1.3))
    driven = 0.2 * 11 + 2 * np.hypot(0.2, 0.1)
    assert found["path_efficiency"] == pytest.approx(2.6 / driven)
    assert (found["intrusions"], found["time_intruding"]) == (1, pytest.approx(0.7))
    assert found["nearest"] == pytest.approx(0.0)
    with_larger = compute_replay_metrics(
        made(states, [person, late], goal=(3.0, 0.0)), szlib.Ellipse((0, 0), (1.3, 1.3))
    )
    assert (with_larger["intrusions"], with_larger["time_intruding"]) == (
        2,
        pytest.approx(1.3),
    )
    apart = compute_replay_metrics(
        made(states, [still(20, 1.0, 2.0)], goal=(30.0, 0.0))
    )
    assert (apart["reached"], apart["intrusions"], apart["time_intruding"]) == (0, 0, 0)
    assert np.isnan(apart["time_to_goal"]) and np.isnan(apart["path_efficiency"])
    assert apart["nearest"] == pytest.approx(1.9)


def test_social_metrics_do_not_depend_on_the_frame():
    t = np.linspace(0, 6, 61)
    states = np.column_stack([t, 0.3 * np.sin(t), np.ones_like(t), 0.3 * np.cos(t)])
    people = np.column_stack(
        [3 - 0.5 * t, 0.5 + 0 * t, np.pi + 0 * t, -0.5 + 0 * t, 0 * t]
    )
    moved = np.add(people, [7.0, -3.0, 0, 0, 0])
    one = compute_social_metrics(made(states, [people], arrival=60, goal=(6.0, 0.0)))
    other = compute_social_metrics(
        made(np.add(states, [7.0, -3.0, 0, 0]), [moved], arrival=60, goal=(13.0, -3.0))
    )
    assert one == pytest.approx(other)
    assert one["robot_on_person"] == 1
