"""The Gymnasium environment of notebooks/examples: its runs and barriers are those of szlib.simulation."""

import importlib
from pathlib import Path

import numpy as np
import pytest

import szlib
from szlib.simulation.closed_loop import LoopSettings

gymnasium = pytest.importorskip("gymnasium")
EXAMPLES = Path(__file__).parents[2] / "notebooks" / "examples"


@pytest.fixture
def example(monkeypatch):
    monkeypatch.syspath_prepend(EXAMPLES)
    return importlib.import_module("gymnasium_env")


def test_gymnasium_finds_no_fault_in_it(example):
    """Warnings are errors in all tests."""
    from gymnasium.utils.env_checker import check_env

    check_env(gymnasium.make("szlib/Social-v0").unwrapped)


@pytest.mark.parametrize("name", ["corridor", "making_room", "world 3"])
def test_a_controller_has_the_run_of_the_closed_loop(example, name):
    scenario = szlib.SCENARIOS[name] if name in szlib.SCENARIOS else szlib.Worlds()(3)
    env = example.SocialEnv(lambda _: scenario)
    controller = szlib.MPCCBF(env.zone, walls=scenario.walls, settings=env.settings)
    log = szlib.simulate(scenario, controller)
    controller.reset()
    env.reset()
    states, ended, total = [env.state], False, 0.0
    while not ended:
        control = controller.step(env.state, scenario.goal, env.people).control
        _, reward, ended, late, info = env.step(control)
        states, total = [*states, env.state], total + reward
        assert not late
    assert np.array(states) == pytest.approx(log.states, abs=1e-6) and log.success
    assert info["min_h"] == pytest.approx(log.metrics()["min_h"], abs=1e-6)
    way = scenario.goal - log.states[[0, -1], :2]
    # progress alone
    assert total == pytest.approx(-np.diff(np.hypot(*way.T))[0], abs=1e-4)


def test_the_observation_has_the_nearest_people_and_walls_with_their_h(
    example,
):
    scenario = szlib.Scenario(
        "hall",
        start=(1.0, 2.0, 0.5, 0.0),
        goal=(4.0, 2.0),
        people=[szlib.Person((1.0 + x, 2.0), (0.0, 0.4)) for x in (9.0, -3.0)],
        walls=[[(0.0, 0.0), (5.0, 0.0)]],
    )
    env = example.SocialEnv(lambda _: scenario)
    seen, _ = env.reset()
    assert seen[:4].tolist() == [0.5, 0.0, 3.0, 0.0]
    rows = seen[4:].reshape(example.PEOPLE + example.WALLS, 5)
    assert rows[:2, :4].tolist() == [[-3.0, 0.0, 0.0, 0.4], [9.0, 0.0, 0.0, 0.4]]
    assert rows[example.PEOPLE, :4].tolist() == [-1.0, -2.0, 4.0, -2.0]
    log = szlib.simulation.drive(
        scenario,
        szlib.MPCCBF(env.zone, walls=scenario.walls, settings=env.settings),
        LoopSettings(max_time=0.1),
    )
    assert rows[[1, 0, example.PEOPLE], 4] == pytest.approx(log.h[0])
    assert (rows[2 : example.PEOPLE] == example.FAR).all() and (
        rows[example.PEOPLE + 1 :] == example.FAR
    ).all()


def test_being_too_close_too_fast_or_too_late_is_seen(example):
    person = szlib.Person((0.5, 0.0), (0.4, 0.0))
    scenario = szlib.Scenario(
        "close", (0.0, 0.0, 3.0, 0.0), (9.0, 0.0), (person,), duration=0.2
    )
    env = example.SocialEnv(lambda _: scenario)
    env.reset()
    _, reward, arrived, late, info = env.step((-9.0, 0.0))  # beyond the limit of 1 m/s2
    assert env.state[2] == pytest.approx(2.9) and not (arrived or late)
    assert (
        reward == pytest.approx(0.295 + 10 * env.h[0] - 1.9)
        and info["min_h"] <= env.h[0] < 0
    )
    assert env.step((0.0, 0.0))[2:4] == (False, True)


def test_a_world_is_drawn_from_the_seed_or_named(example):
    env = example.SocialEnv(szlib.Worlds(people=(2, 2)))
    first, second = env.reset(seed=1)[1]["world"], env.reset()[1]["world"]
    assert first != second and env.reset(seed=1)[1]["world"] == first
    env.reset(options={"world": 7})
    assert env.scenario.goal.tolist() == szlib.Worlds(people=(2, 2))(7).goal.tolist()
