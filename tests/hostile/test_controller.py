"""The attacks on the controller in short form, and tests of their judge."""

from collections import Counter
from copy import copy

import clocks
import controller as hostile
import drive
import numpy as np
import pytest
import walls

import szlib


def test_every_step_is_as_reported():
    tally = Counter()
    hostile.attack_steps(300, tally, seed=2)
    assert broken(tally) == {}
    assert tally["steps"] > 270 and tally["steps safe"] and tally["steps relaxed"]


@pytest.mark.parametrize("terminal", ["none", "rest"])
def test_every_world_is_as_reported_and_no_wall_is_touched(terminal):
    tally = Counter()
    hostile.attack_worlds(
        range(5), tally, settings=szlib.MPCSettings(terminal=terminal)
    )
    assert broken(tally) == {}
    assert tally["worlds"] == 5


@pytest.mark.slow
@pytest.mark.parametrize(
    ("island", "place"), [(119, 3), (142, 5), (223, 25), (1341, 17)]
)
def test_a_world_that_once_broke_a_claim_breaks_none(island, place):
    """In the first one a robot that creeps at 1.05 mm/s was said to rest.

    In the second one somebody touches the robot to 2 nm: that was an overlap to the controller, and none to
    `Step.verify`. In the third one a plan with steps of 0.3 s bends towards a body by more than a step of
    0.1 s can.
    """
    faults = []
    walls.run_world(walls.find_world(island, place), Counter(), faults.append)
    assert faults == []


def test_steps_from_cruel_states_are_as_reported():
    tally = Counter()
    hostile.attack_time(15, tally)
    assert set(broken(tally)) <= {"broken: took longer than two limits"}, (
        "the time itself is for the long suite"
    )


def broken(tally):
    """What was broken, by its count."""
    return {what: n for what, n in tally.items() if what.startswith("broken") and n}


def test_any_clock_gives_a_step_or_an_error_of_szlib():
    tally = Counter()
    clocks.attack_arguments(200, tally, seed=1)
    assert broken(tally) == {}
    assert tally["steps with a random clock, safe"] and tally["random clocks refused"]


@pytest.mark.parametrize(("name", "change"), clocks.CHANGES.items())
def test_people_measured_late_are_where_the_step_says(name, change):
    tally = Counter()
    clocks.attack_loops(1, tally, name, **change)
    assert broken(tally) == {} and tally[f"steps, {name}"] == clocks.TICKS


def test_a_clock_that_is_not_consistent_is_found(monkeypatch):
    see, tally = szlib.Tracker.see, Counter()
    monkeypatch.setattr(
        szlib.Tracker,
        "see",
        lambda self, people, *, now, ids, **_: see(self, people, now=now, ids=ids),
    )
    clocks.attack_loops(1, tally, "measured late")
    assert broken(tally)


def test_drives_and_nodes_are_as_reported():
    tally = Counter()
    drive.attack_drives(100, tally)
    drive.attack_node(200, tally)
    assert (
        broken(tally) == {}
        and tally["steps of drives, safe"]
        and tally["ticks of nodes that move"]
    )


def test_judge_finds_a_zone_that_is_entered_between_samples():
    person = szlib.Person(
        (0.0, 0.0), heading=0.0, zone=szlib.Ellipse((0.0, 0.0), (0.5, 0.5))
    )
    judge = hostile.Judge(szlib.MPCSettings(), [], [person])
    radius = 0.5 + judge.s.r_robot + judge.s.eps
    a, b = radius * np.array([[np.cos(turn), np.sin(turn)] for turn in (-0.1, 0.1)])
    chord, times = (
        np.array([a + share * (b - a) for share in hostile.BETWEEN]),
        0.1 * hostile.BETWEEN,
    )
    assert judge.h(chord[1]).min() < -1e-3
    assert judge.between(a, b, chord, times, 0.0, 0.1) >= -1e-9
    assert judge.between(a, b, 0.98 * chord, times, 0.0, 0.1) < -1e-3


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
    forged = copy(step)
    vars(forged).update(change)
    assert fault in list(judge.faults(STATE, GOAL, forged))


def test_judge_finds_a_margin_that_is_too_small():
    paper, zone = (
        szlib.MPCSettings(margin="paper"),
        szlib.Ellipse((0.1, 0.0), (1.0, 0.7)),
    )
    step = szlib.MPCCBF(zone, walls=[WALL], settings=paper).step(STATE, GOAL)
    assert "h or residual" in list(
        hostile.Judge(szlib.MPCSettings(), [WALL], []).faults(STATE, GOAL, step)
    )


@pytest.mark.parametrize(
    "value", [1e155, -1e300, np.inf, np.nan, 1e-200, "x", None, [], [1], {}]
)
def test_invalid_numbers_raise_an_error_of_szlib_or_give_a_step(value):
    zone = szlib.Ellipse((0.1, 0.0), (1.0, 0.7))
    controller, person = szlib.MPCCBF(zone), szlib.Person((0.0, 0.0), heading=0.0)
    for ask in (
        lambda: controller.step((value, 0, 0, 0), GOAL, [person]),
        lambda: controller.step((-4, 0, value, 0), GOAL, [person]),
        lambda: controller.step((-4, 0, 0, 0), (value, 5.0), [person]),
        lambda: controller.step(
            (-4, 0, 0, 0), GOAL, [szlib.Person((value, 0), heading=0.0)]
        ),
        lambda: controller.step(
            (-4, 0, 0, 0), GOAL, [szlib.Person((0, 0), (0, value), heading=0.0)]
        ),
        lambda: szlib.MPCCBF(zone, walls=[[(0, 5), (value, 5)]]).step(
            (-4, 0, 0, 0), GOAL, [person]
        ),
        lambda: szlib.MPCCBF(zone, walls=[[(0, value), (1, 5)]]).step(
            (-4, 0, 0, 0), GOAL, [person]
        ),
    ):
        try:
            step = ask()
        except szlib.SzlibError:
            continue
        assert np.isfinite(step.control).all() and np.abs(step.control).max() <= 1
