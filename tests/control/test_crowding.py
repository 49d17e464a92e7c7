"""Graded decay: what the robot gives up among people who leave it no way, and what it never gives up."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.random_states import ZONE

import szlib
from szlib.control.crowding import find_level
from szlib.control.settings import TOLERANCE, Crowding
from szlib.errors import SolverError
from szlib.simulation.closed_loop import drive
from szlib.simulation.monte_carlo import rerun_world
from szlib.simulation.scenarios.random_worlds import Worlds

SETTINGS = szlib.MPCSettings.among_people(time_limit=np.inf)
BODY = 0.25


def people(n, rng, radius=3.5, standing=False):
    """People all around the origin, outside of the robot's body."""
    angles, distances = rng.uniform(0, 2 * np.pi, n), rng.uniform(1.0, radius, n)
    velocities = np.zeros((n, 2)) if standing else rng.normal(0, 0.7, (n, 2))
    places = np.column_stack([np.cos(angles), np.sin(angles)]) * distances[:, None]
    return [
        szlib.Person(tuple(at), tuple(v))
        for at, v in zip(places.tolist(), velocities.tolist(), strict=True)
    ]


def test_the_level_is_the_number_of_people_near():
    rng = np.random.default_rng(0)
    levels = [find_level((0.0, 0.0), people(n, rng), SETTINGS) for n in range(6)]
    assert levels == ["alone", "alone", "few", "few", "crowd", "crowd"]
    assert find_level((0.0, 0.0), people(9, rng), szlib.MPCSettings()) == "alone"
    assert find_level((99.0, 0.0), people(9, rng), SETTINGS) == "alone"


@pytest.mark.parametrize("n", [1, 3, 6])
def test_each_step_holds_what_stays_hard_and_verifies(n):
    rng, controller = np.random.default_rng(n), szlib.MPCCBF(ZONE, settings=SETTINGS)
    feasible = 0
    for _ in range(40):
        controller.reset()
        state = (*rng.uniform(-0.5, 0.5, 2), *rng.uniform(-0.6, 0.6, 2))
        step = controller.step(state, (6.0, 0.0), around := people(n, rng))
        assert step.verify().ok, step.explain()
        if not step.feasible or step.h.min() < 0:
            continue
        feasible += 1
        for k, time in enumerate(SETTINGS.times[1:], start=1):
            at = step.predicted[k, :2]
            gaps = [
                np.hypot(*(at - p.after(time).position)) - BODY - SETTINGS.r_robot
                for p in around
            ]
            if n == 6:
                assert min(gaps) >= SETTINGS.crowding.gap - 1e-5
            else:
                moved = [p.after(time) for p in around]
                assert controller.barriers(at, moved).min() >= -1e-5
        if step.safe:
            moved = [p.after(SETTINGS.dt) for p in around]
            assert controller.barriers(step.predicted[1, :2], moved).min() >= -1e-5
    assert feasible >= 5


def drive_through_a_front(settings):
    """Way of the robot when five people, side by side, 2.2 m apart, come towards it at 1 m/s."""
    controller, state, steps = szlib.MPCCBF(ZONE, settings=settings), np.zeros(4), []
    front = [szlib.Person((4.5, y), (-1.0, 0.0)) for y in np.arange(-4.4, 4.5, 2.2)]
    for k in range(100):
        steps.append(
            controller.step(state, (8.0, 0.0), [p.after(0.1 * k) for p in front])
        )
        state = steps[-1].predicted[1]
    return steps


def test_a_crowd_is_entered_by_choice_and_the_step_says_so():
    steps = drive_through_a_front(SETTINGS)
    clearance = min(step.clearance[:, 0].min() for step in steps)
    assert steps[-1].scene.state[0] > 7.0 and clearance >= SETTINGS.crowding.gap - 1e-3
    inside = [step for step in steps if step.h.min() < -1e-3]
    assert inside and not any(step.safe for step in inside)
    assert any(
        "in a crowd; 2 zones overlap here, keeps 0.2 m" in step.explain()
        for step in inside
    )
    stays = drive_through_a_front(szlib.MPCSettings(time_limit=np.inf))
    assert min(step.scene.state[0] for step in stays) < -2.0, (
        "without prices the robot is driven backwards"
    )


def test_no_step_called_safe_leads_into_a_zone_in_random_worlds():
    worlds = Worlds(people=(3, 8), walls=0.3, size=7.0, duration=8.0)
    checked = 0
    for seed in range(4):
        scenario = worlds(seed)
        controller = szlib.MPCCBF(ZONE, walls=scenario.walls, settings=SETTINGS)
        run = drive(scenario, controller)
        metrics = run.metrics()
        assert metrics["unflagged_violations"] == metrics["unflagged_overlaps"] == 0
        checked += metrics["claimed_safe_steps"]
    assert checked > 100


@pytest.mark.parametrize("name", szlib.SCENARIOS)
def test_the_scenarios_of_the_paper_keep_their_claims(name):
    scenario = szlib.SCENARIOS[name]
    log = szlib.simulate(
        scenario, szlib.MPCCBF(ZONE, walls=scenario.walls, settings=SETTINGS)
    )
    assert log.success and log.h.min() >= -TOLERANCE
    for claim in scenario.claims:
        holds, value = claim.check(log)
        assert holds, (claim.text, value)


def test_the_settings_are_saved_with_a_run(tmp_path):
    scenario = szlib.SCENARIOS["passing"]
    log = szlib.simulate(scenario, szlib.MPCCBF(ZONE, settings=SETTINGS), max_time=1.0)
    log.save(tmp_path / "run")
    assert szlib.SimulationLog.load(tmp_path / "run").settings == SETTINGS


def test_one_step_of_an_even_grid_is_the_step_without_a_grid():
    person = szlib.Person((0.0, 0.3), (-0.5, 0.0))
    plain = szlib.MPCSettings(N=6, N_h=6, time_limit=np.inf)
    steps = [
        szlib.MPCCBF(ZONE, settings=settings).step(
            (-2.6, 0.0, 0.6, 0.0), (4.0, 0.0), [person]
        )
        for settings in (plain, replace(plain, grid=(1,) * 6))
    ]
    assert steps[1].control == pytest.approx(steps[0].control, abs=1e-9)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"grid": (2, 1)}, "grid"),
        ({"grid": (1, 0)}, "grid"),
        ({"grid": (1, 2), "terminal": "rest"}, "grid"),
        ({"jerk_weight": -1.0}, "jerk_weight"),
    ],
)
def test_bad_settings_are_refused(wrong, message):
    with pytest.raises(SolverError, match=message):
        szlib.MPCSettings(**wrong)


@pytest.mark.parametrize(
    "wrong",
    [{"few": 0}, {"many": 1}, {"price": 0.0}, {"gamma": 1.5}, {"radius": np.nan}],
)
def test_bad_crowding_is_refused(wrong):
    with pytest.raises(SolverError, match=next(iter(wrong))):
        Crowding(**wrong)


@pytest.mark.parametrize("seed", [77010607, 77011329])
def test_a_robot_that_starts_fast_towards_a_wall_brakes(seed):
    """With the last plan as the only guess, the relaxed plan led through the wall at full speed."""
    log = rerun_world(seed, settings=SETTINGS)
    assert log.success
    assert log.metrics()["min_clearance"] > 0.1
