"""The attacks on the controller in short form, and tests of their judge."""

from collections import Counter
from dataclasses import replace

import controller as hostile
import numpy as np
import pytest

import szlib


@pytest.mark.parametrize(("solver", "steps"), [("sqp", 300), ("ipopt", 100)])
def test_every_step_is_as_reported(solver, steps):
    tally = Counter()
    hostile.attack_steps(steps, tally, seed=2, solver=solver)
    assert {what: n for what, n in tally.items() if what.startswith("broken") and n} == {}
    assert tally["steps"] > 0.9 * steps and tally["steps safe"] and tally["steps relaxed"]


@pytest.mark.parametrize("terminal", ["none", "rest"])
def test_every_world_is_as_reported_and_no_wall_is_touched(terminal):
    tally = Counter()
    hostile.attack_worlds(range(5), tally, settings=szlib.MPCSettings(terminal=terminal))
    assert {what: n for what, n in tally.items() if what.startswith("broken") and n} == {}
    assert tally["worlds"] == 5 and tally["worlds with an overlap of a wall"] == 0


@pytest.mark.parametrize("solver", ["sqp", "ipopt"])
def test_steps_from_cruel_states_are_as_reported(solver):
    tally = Counter()
    hostile.attack_time(15 if solver == "sqp" else 5, tally, solver)
    broken = {what: n for what, n in tally.items() if what.startswith("broken") and n}
    assert set(broken) <= {"broken: took longer than two limits"}, "the time itself is for the long suite"


WALL = np.array([(-1.0, 3.0), (0.0, 3.0)])
STATE, GOAL = np.array([-3.0, 0.4, 0.5, 0.0]), (4.0, 0.0)


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        ({"control": np.array([0.3, 0.0])}, "plan is no motion"),
        ({"h": np.array([9.0, 9.0])}, "h or residual"),
        ({"slack": 0.5}, "slack"),
        ({"predicted": np.zeros((9, 4))}, "plan is no motion"),
    ],
)
def test_judge_finds_a_changed_step(change, fault):
    zone = szlib.Ellipse((0.1, 0.0), (1.0, 0.7))
    people = [szlib.Person((4.0, 0.0), heading=np.pi, zone=zone)]
    settings = szlib.MPCSettings()
    step = szlib.MPCCBF(zone, walls=[WALL], settings=settings).step(STATE, GOAL, people)
    judge = hostile.Judge(settings, [WALL], people)
    assert list(judge.faults(STATE, GOAL, step)) == []
    assert fault in list(judge.faults(STATE, GOAL, replace(step, **change)))


def test_judge_finds_a_margin_that_is_too_small():
    paper, zone = szlib.MPCSettings(margin="paper"), szlib.Ellipse((0.1, 0.0), (1.0, 0.7))
    step = szlib.MPCCBF(zone, walls=[WALL], settings=paper).step(STATE, GOAL)
    assert "h or residual" in list(hostile.Judge(szlib.MPCSettings(), [WALL], []).faults(STATE, GOAL, step))


@pytest.mark.parametrize("value", [1e155, -1e300, np.inf, np.nan, 1e-200, "x", None, [], [1], {}])
def test_invalid_numbers_raise_an_error_of_szlib_or_give_a_step(value):
    zone = szlib.Ellipse((0.1, 0.0), (1.0, 0.7))
    controller, person = szlib.MPCCBF(zone), szlib.Person((0.0, 0.0), heading=0.0)
    for ask in (
        lambda: controller.step((value, 0, 0, 0), GOAL, [person]),
        lambda: controller.step((-4, 0, value, 0), GOAL, [person]),
        lambda: controller.step((-4, 0, 0, 0), (value, 5.0), [person]),
        lambda: controller.step((-4, 0, 0, 0), GOAL, [szlib.Person((value, 0), heading=0.0)]),
        lambda: controller.step((-4, 0, 0, 0), GOAL, [szlib.Person((0, 0), (0, value), heading=0.0)]),
        lambda: szlib.MPCCBF(zone, walls=[[(0, 5), (value, 5)]]).step((-4, 0, 0, 0), GOAL, [person]),
        lambda: szlib.MPCCBF(zone, walls=[[(0, value), (1, 5)]]).step((-4, 0, 0, 0), GOAL, [person]),
    ):
        try:
            step = ask()
        except szlib.SzlibError:
            continue
        assert np.isfinite(step.control).all() and np.abs(step.control).max() <= 1
