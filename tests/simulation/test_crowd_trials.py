"""Safety claims hold among reacting and recorded people.  In full: `notebooks/studies/crowd_trials.py`."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from helpers.crowd_models import scene
from helpers.track_tables import make_tracks, make_walk
from studies.crowd_trials import CROWDED, measure, violated_by_who_kept
from studies.replay import ReplacedWalker, find_replays
from studies.safety_claims import safety_violations
from studies.social_metrics import compute_replay_metrics

import szlib
from szlib.control.people import Person
from szlib.simulation.closed_loop import LoopSettings, drive
from szlib.simulation.crowds import ReactingPeople
from szlib.simulation.monte_carlo import RolloutSetup
from szlib.simulation.scenario import Scenario

ZONE = szlib.Ellipse((0.1, 0.0), (1.0, 0.7))


class Careless:
    """Drives on as it began, and claims that each step is safe."""

    settings = szlib.MPCSettings()
    zone = ZONE

    def reset(self): ...

    def step(self, state, goal, people):
        return SimpleNamespace(control=np.zeros(2), safe=True)


def straight(*people, y=0.0):
    """The robot drives from (-4, y) to (4, y) at 1 m/s."""
    return Scenario(
        "straight",
        np.array([-4.0, y, 1.0, 0.0]),
        np.array([4.0, y]),
        people,
        duration=10.0,
    )


@pytest.mark.parametrize("sees", ["robot", "nothing"])
def test_claims_hold_for_people_who_keep_their_velocity(model, sees):
    rows = szlib.rollouts(
        3,
        RolloutSetup(
            worlds=CROWDED, behaviour=ReactingPeople(model, sees=sees), measure=measure
        ),
        n_jobs=1,
        progress=False,
    )
    assert len(rows) == 3
    assert (rows["to_who_kept"] == 0).all(), "from positions alone"
    assert (rows["unexplained"] == 0).all(), "and as `safety_violations` reports"
    assert (rows["broken_steps"] <= rows["unflagged_violations"]).all()


def crossing(seed):
    """A person walks 10 m; eight people cross, turn, stop, come and go."""
    rng, walks = (
        np.random.default_rng(seed),
        [make_walk((0, 0), (1.0, 0.0), person=1, duration=10.0)],
    )
    for person in range(2, 10):
        start, begin = rng.uniform((0, -6), (10, 6)), float(rng.integers(0, 8))
        for _leg in range(3):
            velocity = rng.uniform(-1.3, 1.3, 2)
            walks.append(
                make_walk(start, velocity, person=person, begin=begin, duration=2.9)
            )
            start, begin = walks[-1][["x", "y"]].to_numpy()[-1], begin + 3.0
    return make_tracks(*walks)


def h_if_they_had_kept_on(log):
    """h one step after each but the last, if each person keeps their velocity, shape (n - 1, P).

    By the sum of the distances to the foci, from positions alone; NaN for people who are absent.
    """
    x, y, heading, vx, vy = np.moveaxis(log.people[:-1], -1, 0)
    there = x + 1j * y + log.settings.dt * (vx + 1j * vy)
    robot = (log.states[1:, 0] + 1j * log.states[1:, 1])[:, None]
    foci = np.array([zone.foci @ (1, 1j) for zone in log.zones])
    turned = there[..., None] + np.exp(1j * heading)[..., None] * foci
    a = np.array([zone.semi_axes[0] for zone in log.zones])
    return (
        np.abs(robot[..., None] - turned).sum(axis=-1) / 2
        - a
        - log.settings.r_robot
        - log.settings.eps
    )


def test_claims_hold_among_recorded_people_who_keep_their_velocity():
    rows = []
    for seed in (0, 3, 5):  # claims are void in the last two
        for made in find_replays(crossing(seed), 3, zone=ZONE):
            log = drive(
                made.scenario,
                szlib.MPCCBF(ZONE),
                LoopSettings(behaviour=made, until_arrival=False),
            )
            rows.append(measure(log))
            promised = h_if_they_had_kept_on(log)[log.safe[:-1]]
            assert (promised[~np.isnan(promised)] >= -1e-6).all(), (
                "claims hold for people as seen"
            )
    table = pd.DataFrame(rows)
    assert table["broken_steps"].sum() > 0, (
        "people come and turn so near that a claim is void"
    )
    assert (
        table[["unexplained", "to_who_kept", "kept their velocity", "wall"]] == 0
    ).all(axis=None)


def test_false_safety_claims_are_found():
    log = drive(straight(Person((0.0, 0.2), (-0.3, 0.0))), Careless())
    broken = safety_violations(log)
    assert set(broken["change"]) == {"kept their velocity"}
    assert not broken["explained"].any()
    assert broken["h"].to_numpy() == pytest.approx(
        broken["h_claimed"].to_numpy(), abs=1e-9
    )
    assert len(broken) == violated_by_who_kept(log) > 5
    wall = Scenario(
        "wall",
        np.array([-4.0, 0, 1, 0]),
        np.zeros(2),
        walls=[[(0, -1), (0, 1)]],
        duration=4.0,
    )
    assert set(safety_violations(drive(wall, Careless()))["change"]) == {"wall"}


@pytest.mark.parametrize(
    ("given", "walked", "turned", "did"),
    [
        ((-1.0, 0.0), (0.0, -1.0), 0.0, "turned"),
        ((-0.4, 0.0), (-0.5, 0.6), 0.0, "turned"),
        ((-0.4, 0.0), (-1.0, 0.0), 0.0, "sped up"),
        ((0.0, 0.0), (-1.0, 0.0), 0.0, "sped up"),
        ((0.9, 0.0), (0.2, 0.0), 0.0, "slowed down"),
        ((0.9, 0.0), (0.0, 0.0), 1.0, "slowed down"),
        ((0.5, 0.0), (0.5, 0.0), 1.0, "faced elsewhere"),
        ((0.5, 0.0), (0.5, 0.0), 2 * np.pi, "kept their velocity"),
        ((np.nan, np.nan), (0.5, 0.0), 0.0, "appeared"),
    ],
)
def test_the_change_of_motion_is_classified(given, walked, turned, did):
    log = drive(
        straight(Person((0.0, 0.0), heading=0.0)),
        Careless(),
        LoopSettings(max_time=0.1),
    )
    at = log.states[1, :2] + (0.5, 0.0)
    before = np.array([*(at - 0.1 * np.array(walked)), 0.0, *given])
    people = np.array(
        [before * (np.nan if did == "appeared" else 1.0), [*at, turned, *walked]]
    )
    (row,) = safety_violations(replace(log, people=people[:, None])).to_dict("records")
    assert (row["change"], row["t"], row["person"]) == (did, 0.1, 0)
    if did != "appeared":
        assert row["deviation"] == pytest.approx(
            0.1 * np.hypot(*np.subtract(walked, given))
        )
    assert row["h"] < 0


def test_intrusions_are_counted_from_geometry():
    circle = szlib.Ellipse((0.0, 0.0), (1.0, 1.0))
    through = drive(
        straight(Person((0.0, 0.6), heading=0.0)),
        Careless(),
        LoopSettings(until_arrival=False),
    )
    seen = compute_replay_metrics(through, circle)
    assert seen["time_intruding"] == pytest.approx(2 * 0.8, abs=0.11), (
        "a chord of 2 sqrt(1 - 0.36) at 1 m/s"
    )
    assert (seen["intrusions"], seen["nearest"]) == (1, pytest.approx(0.6))
    assert (seen["reached"], seen["time_to_goal"]) == (1, pytest.approx(7.5))
    assert seen["path_efficiency"] == pytest.approx(1.0)
    two = drive(
        straight(Person((0.0, 0.6), heading=0.0), Person((0.5, -0.6), heading=0.0)),
        Careless(),
    )
    assert compute_replay_metrics(two, circle)["intrusions"] == 2
    assert compute_replay_metrics(two, circle)["time_intruding"] == pytest.approx(
        1.6 + 0.5, abs=0.11
    ), "not twice at once"
    empty = compute_replay_metrics(drive(straight(), Careless()), circle)
    assert (empty["intrusions"], empty["time_intruding"]) == (0, 0)
    assert np.isnan(empty["nearest"])


def test_the_replaced_walker_is_measured_with_their_time_and_path():
    for made in find_replays(crossing(0), 9, zone=ZONE):
        log = drive(
            made.scenario,
            ReplacedWalker(made),
            LoopSettings(behaviour=made, until_arrival=False),
        )
        path = made.walker.states[:, :2]
        away = np.hypot(*(path - path[-1]).T)
        assert compute_replay_metrics(log)["time_to_goal"] == pytest.approx(
            0.1 * (away <= 0.5).argmax(), abs=0.101
        ), "0.5 m may lie on a tick"
        assert log.states[: len(path), :2] == pytest.approx(path)


def test_replays_are_worlds_and_behaviour_of_rollouts():
    made = find_replays(crossing(3), 2, zone=ZONE)
    rows = szlib.rollouts(
        len(made),
        RolloutSetup(worlds=made, behaviour=made, measure=compute_replay_metrics),
        n_jobs=1,
        progress=False,
    )
    alone = drive(
        made[0].scenario,
        szlib.MPCCBF(ZONE),
        LoopSettings(behaviour=made[0], until_arrival=False),
    )
    assert rows.loc[0, list(compute_replay_metrics(alone))].astype(
        float
    ).to_dict() == pytest.approx(compute_replay_metrics(alone), nan_ok=True)
    assert scene().people == ()
