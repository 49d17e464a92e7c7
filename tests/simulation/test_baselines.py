"""The baselines reach the goal, give way as they say, and keep the limits of the robot."""

import numpy as np
import pytest

import szlib
from szlib.simulation.baseline_controllers import (
    CONTROLLERS,
    DynamicWindowController,
    SocialForceController,
    StraightController,
)
from szlib.simulation.closed_loop import drive
from szlib.simulation.monte_carlo import RolloutSetup, rollouts
from szlib.simulation.scenario import Worlds

SETTINGS = szlib.MPCSettings()
BASELINES = [make for name, make in CONTROLLERS.items() if name != "MPC-CBF"]
START, GOAL = (-4.0, 0.0, 0.0, 0.0), (4.0, 0.0)
LANE = [((-6.0, y), (6.0, y)) for y in (1.2, -1.2)]


def person(x, y, velocity=(0.0, 0.0)):
    return szlib.Person((x, y), velocity, heading=np.pi)


def run(factory, people=(), walls=(), start=START, goal=GOAL):
    scenario = szlib.Scenario("scene", start, goal, people, walls, duration=25.0)
    return drive(scenario, factory(scenario, SETTINGS))


def test_baselines_are_listed_by_name():
    assert set(CONTROLLERS) >= {"MPC-CBF", "straight", "social force", "dynamic window"}


@pytest.mark.parametrize("factory", BASELINES)
@pytest.mark.parametrize("walls", [(), LANE])
def test_the_goal_is_reached_where_nothing_is_in_the_way(factory, walls):
    metrics = run(factory, walls=walls).metrics()
    assert metrics["success"] and metrics["overlaps"] == 0
    assert metrics["path_length"] == pytest.approx(8, abs=0.15)
    assert metrics["time_to_goal"] < 14


def test_straight_stops_and_waits_for_a_standing_person():
    log = run(StraightController, (person(0.0, 0.0),))
    assert not log.success and log.metrics()["overlaps"] == 0
    assert np.abs(log.states[:, 1]).max() == 0
    assert log.speed[-1] < 0.05 and 0.05 < log.clearance[-1, 0] < 1.0


@pytest.mark.parametrize("factory", BASELINES)
def test_baselines_let_a_person_cross(factory):
    metrics = run(factory, (person(0.0, -2.0, (0.0, 0.5)),)).metrics()
    assert metrics["success"] and metrics["overlaps"] == 0


@pytest.mark.parametrize("factory", [SocialForceController, DynamicWindowController])
def test_other_baselines_go_around_a_standing_person(factory):
    metrics = run(factory, (person(0.0, 0.05),)).metrics()
    assert metrics["success"] and metrics["overlaps"] == 0
    assert metrics["passing_side"] == "right"  # the person is a little to the left


def test_social_force_passes_a_person_straight_ahead_on_the_right():
    assert (
        run(SocialForceController, (person(0.0, 0.0),)).metrics()["passing_side"]
        == "right"
    )


@pytest.mark.parametrize("factory", [StraightController, DynamicWindowController])
def test_baselines_stop_before_a_wall(factory):
    log = run(factory, walls=[((0.0, -8.0), (0.0, 8.0))])
    assert not log.success and log.metrics()["overlaps"] == 0


@pytest.mark.parametrize("factory", [StraightController, SocialForceController])
# Of equal velocities the dynamic window takes the first one, so that it has no such symmetry.
def test_rotating_the_world_rotates_the_path(factory):
    # by a right angle: the box of accelerations stays a box
    turn = np.array([[0.0, -1.0], [1.0, 0.0]])
    people = (person(0.0, 0.4, (-0.3, 0.1)),)
    turned = (
        szlib.Person(tuple(turn @ (0.0, 0.4)), tuple(turn @ (-0.3, 0.1)), heading=0.0),
    )
    one = run(factory, people)
    other = run(factory, turned, start=(*(turn @ START[:2]), 0, 0), goal=turn @ GOAL)
    assert one.states[:, :2] @ turn.T == pytest.approx(other.states[:, :2], abs=1e-6)


@pytest.mark.parametrize("factory", BASELINES)
def test_limits_are_kept_in_every_world(factory):
    rows = rollouts(
        8, RolloutSetup(controller=factory, measure=largest), n_jobs=1, progress=False
    )
    assert (rows["max_speed"] <= SETTINGS.v_max + 1e-9).all()
    assert (rows["largest"] <= SETTINGS.a_max + 1e-9).all()


def largest(log):
    return {"largest": float(np.abs(log.controls).max())}


STILL = Worlds(standing=1.0, walls=1.0, start_speed=0.0)


@pytest.mark.parametrize("factory", [StraightController, DynamicWindowController])
def test_baselines_do_not_touch_people_who_stand(factory):
    rows = rollouts(
        8, RolloutSetup(worlds=STILL, controller=factory), n_jobs=1, progress=False
    )
    assert rows["overlaps"].sum() == 0
    assert rows["success"].any()


def test_the_social_force_between_two_people_is_that_of_its_source():
    """A walker at 1.3 m/s meets a person who stands 2 m ahead, 0.3 m to the left: Moussaid et al. (2009)."""
    v, offset = 1.3, np.array([2.0, 0.3])
    d = np.hypot(*offset)
    e = offset / d
    interaction = 2.0 * np.array([v, 0.0]) + e
    size = np.hypot(*interaction)
    t = interaction / size
    n = np.array([-t[1], t[0]])
    b = 0.35 * size
    theta = np.arctan2(e[1], e[0]) - np.arctan2(t[1], t[0])
    slow = -4.5 * np.exp(-d / b - (3 * b * theta) ** 2)  # n' = 3
    turn = -4.5 * np.sign(theta) * np.exp(-d / b - (2 * b * theta) ** 2)  # n = 2
    equal = szlib.MPCSettings(r_robot=0.25)  # a robot as large as a person
    model = SocialForceController(szlib.Scenario("two", START, GOAL), equal)
    # the source has no bias of the angle here; it turns theta by 0.005 B
    state, goal = np.array([0.0, 0.0, v, 0.0]), np.array(GOAL)
    alone, beside = (
        model.desired_velocity(state, goal, people)
        for people in ((), (person(*offset),))
    )
    found = (beside - alone) / equal.dt
    assert found == pytest.approx(slow * t + turn * n, abs=0.05)


def test_other_obstacles_push_as_walls_do():
    edge = szlib.control.HalfPlane((0.0, -0.7), (0.0, 1.0))
    wall = ((-99.0, -0.7), (99.0, -0.7))
    scenes = [
        szlib.Scenario("beside", START, GOAL, walls=walls, obstacles=obstacles)
        for walls, obstacles in (((), ()), ((wall,), ()), ((), (edge,)))
    ]
    free, by_wall, by_edge = (
        SocialForceController(scene, SETTINGS).desired_velocity(np.zeros(4), GOAL, ())
        for scene in scenes
    )
    push = SETTINGS.dt * 3.0 * np.exp(-(0.7 - SETTINGS.r_robot) / 0.1)
    assert by_wall - free == pytest.approx((0.0, push))
    assert by_edge == pytest.approx(by_wall)
