"""Each metric of motion on a run made by hand, whose answer is known."""

import tracemalloc

import numpy as np
import pytest
from helpers.made_runs import make_log

import szlib
from szlib.control import STATUSES
from szlib.simulation.metrics import (
    compute_metrics,
    find_avoidance_start,
    find_passing_side,
    find_yielding_steps,
    locate_along_course,
)

SETTINGS = szlib.MPCSettings()
FAR_AWAY = (50.0, 50.0)


def make_run(states, *people, walls=(), goal=(10.0, 0.0), **steps):
    """A run in these states (n, 4) among people who stand at (x, y), or are at (n, 2); dt is 0.1 s."""
    states = np.array(states, float)
    around = np.zeros((len(states), len(people), 5))
    for i, place in enumerate(people):
        around[:, i, :2] = place
    persons = tuple(szlib.Person((9, 9)) for _ in people)
    scenario = szlib.Scenario("made", states[0], goal, persons, walls)
    return make_log(scenario, states, around, **steps)


def with_speeds(speeds):
    """States along x at these speeds, each for 0.1 s."""
    speeds = np.array(speeds, float)
    x = np.append(0.0, np.cumsum(0.1 * speeds)[:-1])
    return np.column_stack([x, 0 * x, speeds, 0 * x])


STAND, START, CRUISE, SLOW, BRAKE = (
    [0.0] * 3,
    [0.5] * 7,
    [1.0] * 10,
    [0.6] * 5,
    [0.97, 0.5, 0.0],
)
JOURNEY = STAND + START + CRUISE + [0.04] * 4 + SLOW + CRUISE + BRAKE


def test_speeds_and_times_of_a_journey():
    states = with_speeds(JOURNEY + [0.8] * 5)
    n = len(JOURNEY)
    found = compute_metrics(make_run(states, arrival=n - 1))
    assert found["success"] and found["time_to_goal"] == pytest.approx(0.1 * (n - 1))
    assert found["path_length"] == pytest.approx(states[n - 1, 0])
    assert found["mean_speed"] == pytest.approx(np.mean(JOURNEY))
    assert found["max_speed"] == 1.0
    assert found["min_speed"] == 0.04, "neither the start nor the braking counts"
    assert found["time_stopped"] == pytest.approx(0.4), (
        "neither the start nor the last state counts"
    )
    alone = compute_metrics(
        make_run(with_speeds(STAND + START + CRUISE + BRAKE), arrival=22)
    )
    assert alone["min_speed"] == 0.97


def test_without_arrival_every_state_counts():
    found = compute_metrics(make_run(with_speeds(JOURNEY + [0.0] * 5)))
    assert not found["success"] and np.isnan(found["time_to_goal"])
    assert found["time_stopped"] == pytest.approx(0.4 + 0.5)


def test_the_start_up_lasts_a_second():
    for standing, least in ((9, 1.0), (10, 1.0), (11, 0.0)):
        speeds = [0.0] * standing + [1.0] * 10
        assert compute_metrics(make_run(with_speeds(speeds)))["min_speed"] == least


def test_jerk_is_the_mean_square_of_the_second_derivative_of_velocity():
    t = 0.1 * np.arange(12)
    states = np.column_stack([0 * t, 0 * t, t**2, 1.5 * t**2])
    assert compute_metrics(make_run(states))["jerk"] == pytest.approx(2**2 + 3**2)
    assert compute_metrics(make_run(states[:2]))["jerk"] == 0


def test_distances_to_people_and_walls_are_separate():
    states = with_speeds([1.0] * 41)
    wall = [[(-5.0, -2.0), (20.0, -2.0)]]
    found = compute_metrics(make_run(states, (2.0, 1.5), FAR_AWAY, walls=wall))
    assert found["min_h_people"] == pytest.approx(
        1.5 - 0.7 - 0.5 - SETTINGS.eps, abs=1e-6
    )
    assert found["min_clearance_people"] == pytest.approx(1.5 - 0.25 - 0.5)
    assert found["min_clearance_walls"] == pytest.approx(2.0 - 0.5)
    assert found["min_h"] == found["min_h_people"] < found["min_h_walls"]
    assert found["min_clearance"] == found["min_clearance_people"]
    assert (found["people"], found["walls"], found["violations"]) == (2, 1, 0)
    alone = compute_metrics(make_run(states))
    assert np.isnan(alone["min_h_people"]) and np.isnan(alone["min_clearance_walls"])


def test_a_robot_that_stops_in_a_large_hall_is_measured_in_little_memory():
    places = np.mgrid[0:40:4, 0:20:2].reshape(2, -1).T
    walls = np.stack([places, places + np.array([1, 0])], axis=1)
    run = make_run([(2.5, 1.0, 0.0, 0.0)] * 9, walls=walls, goal=(38.5, 17.0))
    tracemalloc.start()
    assert compute_metrics(run)["outcome"] == "deadlock"
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert most < 50e6, "h of 100 walls at all cells takes 90 MB"


def test_steps_are_counted_if_their_control_is_applied():
    """The person is in the way: h < 0 within 1.25 m of them, an overlap within 0.75 m."""
    states = with_speeds([2.0] * 11)  # x = 0, 0.2, ..., 2.0
    n, person = len(states), (2.0, 0.0)
    statuses = {"optimal": 2, "restarted": 1, "relaxed": 2, "kept": 1, "braking": 4}
    status = np.array([*np.repeat(list(statuses), list(statuses.values())), "optimal"])
    safe = np.arange(n) != 7
    slack = np.array([0.0, 2e-6, *[0.1] * 8, 5.0])
    found = compute_metrics(
        make_run(
            states,
            person,
            status=status,
            safe=safe,
            slack=slack,
            solve_time=np.arange(n) / 10,
        )
    )
    assert (found["violations"], found["overlaps"]) == (7, 4)
    assert (found["claimed_safe_steps"], found["flagged_steps"]) == (9, 1)
    assert (found["unflagged_violations"], found["unflagged_overlaps"]) == (6, 3)
    assert (found["infeasible_steps"], found["max_slack"]) == (9, 0.1)
    assert {name: found[f"steps_{name}"] for name in STATUSES} == statuses
    assert found["solve_time_median"] == pytest.approx(0.5)
    assert found["solve_time_p95"] == pytest.approx(0.95)
    assert found["solve_time_p99"] == pytest.approx(0.99)
    assert found["solve_time_max"] == 1.0


def test_a_start_in_violation_is_no_step():
    states = with_speeds([0.0, 0.0])
    assert compute_metrics(make_run(states, (1.0, 0.0)))["violations"] == 1


def test_the_robot_yields_while_a_person_holds_it_back():
    speeds = [1.0] * 12 + [0.049] * 5 + [0.051] * 5 + [-0.5] * 3 + [1.0] * 3
    run = make_run(with_speeds(speeds), FAR_AWAY, residual=1e-4)
    assert np.flatnonzero(find_yielding_steps(run)).tolist() == [
        *range(12, 17),
        *range(22, 25),
    ]
    assert compute_metrics(run)["time_yielding"] == pytest.approx(0.8)
    free = make_run(with_speeds(speeds), FAR_AWAY, residual=2e-4)
    assert compute_metrics(free)["time_yielding"] == 0
    unknown = make_run(with_speeds(speeds), FAR_AWAY, residual=np.nan)
    assert compute_metrics(unknown)["time_yielding"] == 0


def test_neither_the_first_second_nor_standing_at_the_goal_is_yielding():
    early = make_run(with_speeds([0.0] * 15), FAR_AWAY, residual=0.0)
    assert np.flatnonzero(find_yielding_steps(early)).tolist() == [10, 11, 12, 13]
    for distance, steps in ((0.09, 0), (0.11, 4)):
        near = make_run(
            with_speeds([0.0] * 15), FAR_AWAY, residual=0.0, goal=(distance, 0.0)
        )
        assert find_yielding_steps(near).sum() == steps
    over = make_run(with_speeds([0.0] * 25), FAR_AWAY, residual=0.0, arrival=14)
    assert len(find_yielding_steps(over)) == 14


def test_the_course_has_the_goal_ahead():
    states = np.array([[0, 0, 0, 0], [3, 4, 0, 0]], float)
    ahead, left = locate_along_course(
        make_run(states, (-4.0, 3.0), (3.0, 4.0), goal=(6.0, 8.0)), 0
    )
    assert ahead == pytest.approx([0, -5]) and left == pytest.approx([5, 5])


@pytest.mark.parametrize(("y", "side"), [(1.0, "right"), (-1.0, "left")])
def test_the_side_is_that_of_the_nearest_person(y, side):
    states = with_speeds([1.0] * 41)
    assert find_passing_side(make_run(states, (2.0, y))) == side
    assert (
        find_passing_side(make_run(states, (1.0, -2.0 * y), (2.0, y), (3.0, -2.0 * y)))
        == side
    )
    assert find_passing_side(make_run(states, (4.5, y))) == "none", "never abeam"
    assert find_passing_side(make_run(states, (-0.5, y))) == "none", (
        "behind from the start"
    )
    assert find_passing_side(make_run(states, (2.0, y), goal=(0.0, 0.0))) == "none", (
        "no course"
    )
    assert find_passing_side(make_run(states)) == "none"


def test_who_is_overtaken_twice_is_passed_on_the_last_side():
    states = with_speeds([1.0] * 41)
    x = np.where(np.arange(41) < 15, 1.0, np.where(np.arange(41) < 20, 2.5, 3.0))
    person = np.column_stack([x, np.where(np.arange(41) < 15, 1.0, -1.0)])
    assert find_passing_side(make_run(states, person)) == "left"


def test_avoidance_starts_at_a_tenth_of_a_metre_from_the_line():
    # 0.2 m beside
    states = np.array([[0, 0, 0, 0], [3, 4, 0, 0], [6.16, 7.88, 0, 0], [9, 12, 0, 0]])
    run = make_run(states, (9.0, 12.0), goal=(9.0, 12.0))
    distance, h = find_avoidance_start(run)
    halfway = np.array([4.58, 5.94])
    assert distance == pytest.approx(np.hypot(*(halfway - (9, 12))))
    assert h == pytest.approx(run.h[1:3, 0].mean())
    off = find_avoidance_start(run, deviation=0.05)[0]
    assert off == pytest.approx(np.hypot(*(np.array([3.79, 4.97]) - (9, 12))))
    assert np.isnan(find_avoidance_start(run, deviation=0.3)).all()


def test_the_inputs_of_a_controller_of_another_robot_are_unknown():
    run = make_run(with_speeds(CRUISE), inputs=("a", "omega"))
    with pytest.raises(szlib.DataError, match=r"inputs must be \('ax', 'ay'\)"):
        run.controller_inputs(0.0)
