"""The closed loop takes any controller, any robot, and people who come and go."""

from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from studies.summaries import summarise

import szlib
from szlib.simulation.baseline_controllers import make_mpc_cbf
from szlib.simulation.closed_loop import BODY_ZONE, LoopSettings, drive
from szlib.simulation.crowds import Behaviour, VisiblePeople
from szlib.simulation.monte_carlo import (
    RolloutSetup,
    compare,
    identify,
    rollouts,
)
from szlib.simulation.scenario import Worlds
from szlib.zones.ellipses import circle_around

ZONE = szlib.Ellipse((0.1, 0.0), (1.0, 0.7))
WALK = szlib.Scenario("walk", (-4.0, 0.0, 0.0, 0.0), (4.0, 0.0), duration=20.0)
ALONE = Worlds(people=(0, 0), walls=0.0, start_speed=0.0, duration=12.0)
TIMES = ["solve_time_median", "solve_time_p95", "solve_time_p99", "solve_time_max"]


class Straight:
    """The controller of the protocol's docstring: blind."""

    def __init__(self, pace=1.0):
        self.pace, self.seen = pace, []

    def reset(self):
        self.seen = []

    def step(self, state, goal, people):
        self.seen.append(tuple(people))
        ahead = goal - state[:2]
        wanted = self.pace * ahead / max(1.0, np.hypot(*ahead))
        return SimpleNamespace(control=np.clip(2 * (wanted - state[2:]), -1, 1))


def straight(scenario, settings, pace=1.0):
    return Straight(pace)


def person(x, y, velocity=(0.0, 0.0), zone=None):
    return szlib.Person((x, y), velocity, heading=0.0, zone=zone)


def visitor(t, _):
    """A person who stands beside the way, from 2 s to 4 s only, and a person who never comes."""
    return (person(-1.0, 1.6) if 2 <= t < 4 else None, None)


# --- any controller ----------------------------------------------------------------------------------


def test_a_foreign_controller_drives_and_missing_reports_are_empty(tmp_path):
    log = szlib.simulate(WALK, Straight())
    metrics = log.metrics()
    assert log.success and metrics["outcome"] == "arrived"
    assert log.predicted.shape[1] == log.residual.shape[2] == 0
    assert set(log.status) == {""} and np.isnan(log.slack).all()
    assert (log.solve_time > 0).all()
    log.save(tmp_path / "run")
    back = szlib.SimulationLog.load(tmp_path / "run")
    pd.testing.assert_frame_equal(back.table, log.table)
    assert back.metrics() == pytest.approx(metrics, nan_ok=True)
    assert "arrived" in repr(log)


def test_violations_count_for_a_controller_without_safety_claims():
    scenario = szlib.Scenario(
        "blind", WALK.start, WALK.goal, (person(0.0, 0.0, zone=ZONE),)
    )
    log = szlib.simulate(scenario, Straight())
    metrics = log.metrics()
    inside = int((log.h[1:].min(axis=1) < -1e-6).sum())
    assert metrics["violations"] == inside > 0
    assert metrics["overlaps"] == int((log.clearance[1:].min(axis=1) < -1e-6).sum()) > 0
    assert (
        metrics["claimed_safe_steps"]
        == metrics["flagged_steps"]
        == metrics["unflagged_violations"]
        == 0
    )
    assert metrics["outcome"] == "drove in"
    assert np.isnan(metrics["time_yielding"])


def test_every_step_of_mpc_cbf_is_claimed_safe_or_flagged():
    log = szlib.simulate(
        szlib.SCENARIOS["corridor"],
        szlib.MPCCBF(ZONE, walls=szlib.SCENARIOS["corridor"].walls),
    )
    metrics = log.metrics()
    assert (
        metrics["claimed_safe_steps"] + metrics["flagged_steps"] == len(log.states) - 1
    )
    assert metrics["violations"] == metrics["overlaps"] == 0


def test_people_without_a_zone_get_that_of_the_controller_or_their_body():
    scenario = szlib.Scenario(
        "met", WALK.start, WALK.goal, (person(0.0, 3.0), person(1.0, 3.0, zone=ZONE))
    )
    assert szlib.simulate(scenario, Straight()).zones == (BODY_ZONE, ZONE)
    other = szlib.Ellipse((0.0, 0.0), (0.5, 0.5))
    log = szlib.simulate(scenario, szlib.MPCCBF(other))
    assert log.zones == (other, ZONE)


def test_plans_of_different_lengths_are_kept():
    class Planner(Straight):
        def step(self, state, goal, people):
            control = super().step(state, goal, people).control
            return SimpleNamespace(
                control=control, predicted=np.tile(state, (2 + len(self.seen) % 2, 1))
            )

    log = szlib.simulate(WALK, Planner())
    assert log.predicted.shape == (len(log.states), 3, 4)
    assert np.array_equal(log.predicted[:, 1], log.states)
    assert np.isnan(log.predicted[1::2, 2]).all()


# --- any robot ---------------------------------------------------------------------------------------


class Cart:
    """A differential drive: (x, y, angle), driven by (v, omega); its disc's centre is the axle's."""

    inputs = ("v", "omega")

    def start(self, state):
        return np.array([*state[:2], 0.0, 0.0])

    def body(self, own):
        x, y, angle, v = own
        return np.array([x, y, v * np.cos(angle), v * np.sin(angle)])

    def advance(self, own, control, dt):
        (x, y, angle, _), (v, omega) = own, control
        middle = angle + dt * omega / 2
        return np.array(
            [
                x + dt * v * np.cos(middle),
                y + dt * v * np.sin(middle),
                angle + dt * omega,
                v,
            ]
        )


class Steered:
    """Turns to the goal, and drives there as it sees it."""

    robot = Cart()

    def reset(self):
        pass

    def step(self, state, goal, people):
        assert state.shape == (4,)
        x, y, angle, _ = state
        distance = np.hypot(*(goal - state[:2]))
        off = np.angle(np.exp(1j * (np.arctan2(goal[1] - y, goal[0] - x) - angle)))
        v = min(1.0, distance) * max(0.0, np.cos(off)) if distance > 0.05 else 0.0
        return SimpleNamespace(control=[v, np.clip(2 * off, -1, 1) if v else 0.0])


def test_another_robot_is_logged_by_its_disc():
    scenario = szlib.Scenario(
        "turn", (0.0, 0.0, 0.0, 0.0), (0.0, 4.0), (person(5.0, 0.0),), duration=20
    )
    log = szlib.simulate(scenario, Steered())
    assert log.success
    moved = np.diff(log.states[:, :2], axis=0) / 0.1
    after = log.states[1:, 2:]
    # arcs of 5 deg at most: chords
    assert np.hypot(*moved.T) == pytest.approx(np.hypot(*after.T))
    assert log.inputs == ("v", "omega")
    assert log.table["omega"].to_numpy() == pytest.approx(log.controls[:, 1])
    assert log.clearance[0, 0] == pytest.approx(5.0 - 0.25 - 0.5)


# --- people who come and go, and react ---------------------------------------------------------------


@pytest.mark.parametrize("controller", [Straight(), szlib.MPCCBF(ZONE)])
def test_absent_people_are_nan_in_the_log(controller):
    log = szlib.simulate(WALK, controller, crowd=visitor)
    there = (log.time >= 2) & (log.time < 4)
    assert log.people.shape == (len(log.states), 2, 5)
    for values in (log.people[:, 0, 0], log.h[:, 0], log.clearance[:, 0]):
        assert np.array_equal(~np.isnan(values), there)
    assert np.isnan(log.people[:, 1]).all() and np.isnan(log.h[:, 1]).all()
    metrics = log.metrics()
    assert metrics["people"] == 2
    assert metrics["min_h"] == np.nanmin(log.h) and metrics[
        "min_clearance"
    ] == np.nanmin(log.clearance)
    assert metrics["outcome"] == "arrived" and metrics["violations"] == 0
    assert log.table["clearance"][0] == np.inf


def test_the_controller_gets_present_people_with_their_zones():
    controller = Straight()
    log = szlib.simulate(WALK, controller, crowd=visitor)
    there = (log.time >= 2) & (log.time < 4)
    assert [len(seen) for seen in controller.seen] == there.astype(int).tolist()
    assert {p.zone for seen in controller.seen for p in seen} == {BODY_ZONE}


def test_residuals_belong_to_people_who_are_present():
    log = szlib.simulate(WALK, szlib.MPCCBF(ZONE), crowd=visitor)
    there = (log.time >= 2) & (log.time < 4)
    assert np.array_equal(~np.isnan(log.residual[:, 0, 0]), there)
    assert (
        np.isfinite(log.cbf_people[there]).all()
        and (log.cbf_people[~there] == np.inf).all()
    )
    assert log.metrics()["time_yielding"] == 0


def test_an_absent_person_changes_nothing():
    alone = szlib.simulate(WALK, szlib.MPCCBF(ZONE))
    awaited = szlib.simulate(WALK, szlib.MPCCBF(ZONE), crowd=lambda t, _: [None])
    assert np.array_equal(alone.states, awaited.states)
    drop = [*TIMES, "people"]
    ours, theirs = (pd.Series(log.metrics()).drop(drop) for log in (alone, awaited))
    pd.testing.assert_series_equal(ours, theirs)


def test_a_person_who_appears_in_the_robot_counts_as_run_into():
    def ghost(t, state):
        return [person(state[0] + 0.5, state[1]) if t >= 3 else None]

    log = szlib.simulate(WALK, Straight(), crowd=ghost, max_time=5.0)
    assert log.metrics()["outcome"] == "run into"


def test_a_crowd_sees_the_robot():
    states = []

    def mirror(t, state):
        states.append(state)
        return [person(state[0], state[1] + 3.0, (0.1, 0.0))]

    log = szlib.simulate(WALK, Straight(), crowd=mirror)
    assert np.array_equal(states, log.states)
    assert log.people[:, 0, 1] - log.states[:, 1] == pytest.approx(3.0)
    assert (log.people[:, 0, 3] == 0.1).all()


def test_people_without_a_heading_get_a_circle_or_keep_their_last_heading():
    def crowd(t, _):
        still, walked = (
            szlib.Person((0.0, 2.0)),
            szlib.Person((-6.0 + min(t, 5.0), -3.0), (0.0 + (t < 5), 0.0)),
        )
        return [still, walked]

    log = szlib.simulate(WALK, szlib.MPCCBF(ZONE), crowd=crowd)
    assert log.zones == (circle_around(ZONE), ZONE)
    assert np.isfinite(log.h).all() and (log.people[:, :, 2] == 0).all()
    barriers = szlib.MPCCBF(ZONE).barriers(
        log.states[0, :2], [szlib.Person((0.0, 2.0))]
    )
    assert log.h[0, 0] == pytest.approx(barriers[0])
    assert log.metrics()["violations"] == 0


def test_a_log_with_absent_people_is_saved_and_loaded(tmp_path):
    log = szlib.simulate(WALK, szlib.MPCCBF(ZONE), crowd=visitor)
    log.save(tmp_path / "run")
    back = szlib.SimulationLog.load(tmp_path / "run")
    pd.testing.assert_frame_equal(back.table, log.table)
    assert back.metrics() == log.metrics()
    assert np.array_equal(back.residual, log.residual, equal_nan=True)


def test_walls_hide_people_of_a_given_crowd():
    scene = replace(WALK, walls=[((0.0, -1.0), (0.0, 1.0))])
    controller = Straight()
    loop = LoopSettings(
        behaviour=VisiblePeople(),
        crowd=lambda t, _: (person(2.0, 0.0), person(-2.0, 1.5)),
        max_time=0.1,
    )
    drive(scene, controller, loop)
    assert [[p.position for p in seen] for seen in controller.seen] == [[(-2, 1.5)]] * 2


def test_a_crowd_model_needs_only_two_methods():
    class Circling:
        def start(self, scenario, seed):
            center = (
                np.mean([p.position for p in scenario.people], axis=0)
                if scenario.people
                else np.zeros(2)
            )
            return lambda t, _: [
                person(center[0] + np.cos(t), center[1] + 3 + np.sin(t), (0.1, 0), ZONE)
            ]

        def observe(self, people, rng):
            return people

    log = drive(WALK, Straight(), LoopSettings(behaviour=Circling(), seed=3))
    assert log.people[:, 0, 0] == pytest.approx(np.cos(log.time))
    assert log.zones == (ZONE,)


# --- what cannot be ----------------------------------------------------------------------------------


class Broken(Straight):
    def __init__(self, **step):
        super().__init__()
        self.more = step

    def step(self, state, goal, people):
        return SimpleNamespace(**({"control": np.zeros(2)} | self.more))


class Silent(Straight):
    def step(self, state, goal, people):
        """It forgets to return what it decides."""


@pytest.mark.parametrize(
    ("controller", "crowd", "message"),
    [
        (
            Broken(control=[np.nan, 0.0]),
            None,
            r"the control at 0 s must be finite; got .*nan",
        ),
        (
            Broken(control=np.zeros(3)),
            None,
            r"the control at 0 s must have shape \(2,\)",
        ),
        (None, None, "controller must be an object with reset and step"),
        (Silent(), None, "a step must be an object with control; got None"),
        (
            Broken(residual=np.zeros((1, 2))),
            lambda t, _: [person(0.0, y) for y in (2, 3)],
            "got 1 rows, expected 2",
        ),
        (Straight(), lambda t, _: [None] * (1 + (t > 1)), "was 1, and now is 2"),
    ],
)
def test_invalid_controllers_and_crowds_are_rejected(controller, crowd, message):
    with pytest.raises(szlib.SolverError, match=message):
        szlib.simulate(WALK, controller, crowd=crowd, max_time=2.0)


@pytest.mark.parametrize("seconds", [-1.0, np.inf, np.nan])
def test_time_limits_that_are_negative_or_no_numbers_are_rejected(seconds):
    with pytest.raises(szlib.SolverError, match="max_time must be finite, at least 0"):
        szlib.simulate(WALK, Straight(), max_time=seconds)
    assert len(szlib.simulate(WALK, Straight(), max_time=0.0).states) == 1


EDGE = szlib.control.HalfPlane(point=(0.0, -1.0), normal=(0.0, 1.0))


@pytest.mark.parametrize("of_controller", [(), (EDGE,)])
@pytest.mark.parametrize("kind", [szlib.MPCCBF, szlib.DifferentialDrive])
def test_a_controller_with_other_obstacles_is_rejected(kind, of_controller):
    of_scenario = () if of_controller else (EDGE,)
    platform = replace(WALK, obstacles=of_scenario)
    with pytest.raises(szlib.SolverError, match="knows other obstacles than 'walk'"):
        szlib.simulate(platform, kind(ZONE, obstacles=of_controller))


def test_the_same_obstacles_are_accepted_whatever_object_they_are():
    again = szlib.control.HalfPlane(point=(0.0, -1.0), normal=(0.0, 1.0))
    controller = szlib.MPCCBF(ZONE, obstacles=[again])
    log = szlib.simulate(replace(WALK, obstacles=(EDGE,)), controller)
    assert log.success and log.h.min() >= 0


def test_settings_with_another_dt_are_rejected():
    with pytest.raises(szlib.SolverError, match=r"every 0.1 s, the loop every 0.2 s"):
        drive(
            WALK, szlib.MPCCBF(ZONE), LoopSettings(settings=szlib.MPCSettings(dt=0.2))
        )


# --- rollouts and comparisons ------------------------------------------------------------------------


def test_rollouts_accepts_any_controller():
    rows = rollouts(
        3, RolloutSetup(worlds=ALONE, controller=straight), n_jobs=1, progress=False
    )
    assert rows["success"].all() and (rows["claimed_safe_steps"] == 0).all()
    slow = rollouts(
        3,
        RolloutSetup(worlds=ALONE, controller=partial(straight, pace=0.5)),
        n_jobs=1,
        progress=False,
    )
    assert (slow["max_speed"] <= 0.5 + 1e-9).all()
    again = RolloutSetup(worlds=ALONE, controller=straight).run(1).metrics()
    assert again["path_length"] == rows["path_length"][1]
    assert rows["unflagged_violations"].sum() == 0


def scene(seed):
    return szlib.Scenario(
        f"{seed}", (0.0, 0.0, 0.0, 0.0), (1.0 + seed, 0.0), duration=8.0
    )


def test_any_function_of_the_seed_makes_worlds():
    rows = rollouts(
        3, RolloutSetup(worlds=scene, controller=straight), n_jobs=1, progress=False
    )
    assert rows["path_length"].to_numpy() == pytest.approx([1, 2, 3], abs=0.1)


def test_stored_chunks_depend_on_the_controller(tmp_path):
    def run(controller):
        rollouts(
            1,
            RolloutSetup(worlds=ALONE, controller=controller),
            out=tmp_path,
            n_jobs=1,
            progress=False,
        )
        return sum(path.is_dir() for path in tmp_path.iterdir())

    assert run(straight) == run(straight) == 1
    assert run(make_mpc_cbf) == 2
    assert run(partial(straight, pace=0.5)) == 3
    assert run(partial(straight, pace=0.4)) == run(partial(straight, pace=0.5)) == 4
    with pytest.raises(szlib.SolverError, match="define it in a module"):
        run(lambda scenario, settings: Straight())


def test_parts_are_identified_by_their_content():
    parts = [
        None,
        straight,
        Straight,
        szlib.MPCSettings(),
        szlib.MPCSettings(gamma=0.1),
        Behaviour(),
        ALONE,
    ]
    parts += [
        partial(straight, pace=0.5),
        partial(straight, pace=0.4),
        Worlds().__call__,
        ALONE.__call__,
    ]
    assert len({identify(part) for part in parts}) == len(parts)
    assert identify(partial(straight, pace=0.5)) == identify(
        partial(straight, pace=0.5)
    )


class Failing(Straight):
    def step(self, state, goal, people):
        raise KeyError("mine")


def failing(scenario, settings):
    return Failing()


def test_a_failing_controller_is_reported_with_its_world():
    with pytest.raises(KeyError, match="mine") as error:
        rollouts(
            1,
            RolloutSetup(worlds=ALONE, controller=failing),
            seed=4,
            n_jobs=1,
            progress=False,
        )
    assert error.value.__notes__ == ["in world 4"]


def half(zone):
    return szlib.Ellipse(
        zone.center, (zone.semi_axes[0] / 2, zone.semi_axes[1] / 2), zone.angle
    )


def test_compare_takes_names_and_objects():
    rows = compare(
        1,
        controllers={"blind": straight},
        zones={"half": half},
        formulations={"mine": szlib.MPCSettings(gamma=0.2)},
        behaviours={"slower": Behaviour(pace=0.5)},
        n_jobs=1,
        progress=False,
    )
    named = rows[["controller", "zone", "formulation", "behaviour"]]
    assert named.to_numpy().tolist() == [["blind", "half", "mine", "slower"]]
    assert summarise(rows, metrics=["success"])["controller"].tolist() == ["blind"]
    with pytest.raises(szlib.SolverError, match="unknown names: PID; expected MPC-CBF"):
        compare(1, controllers=["PID"])
