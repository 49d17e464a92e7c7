"""The meetings can be driven, vary as they say, and walls hide whom they should."""

import pickle
from dataclasses import replace

import numpy as np
import pytest

import szlib
from szlib.simulation.baseline_controllers import StraightController
from szlib.simulation.catalogue import MEETINGS
from szlib.simulation.closed_loop import LoopSettings, drive
from szlib.simulation.crowds import VisiblePeople, is_visible
from szlib.simulation.monte_carlo import RolloutSetup, identify, rollouts
from szlib.simulation.scenario import Variations

ZONE = szlib.Ellipse((0.05, 0.0), (1.0, 0.7))
SETTINGS = szlib.MPCSettings()


def test_the_meetings_of_the_source_are_there():
    assert set(MEETINGS) >= {
        "frontal approach", "pedestrian obstruction", "narrow hallway", "narrow doorway", "overtaking",
        "intersection", "blind corner", "parallel traffic", "perpendicular traffic", "circular crossing",
        "robot crowding",
    }  # fmt: skip
    assert szlib.MEETINGS is MEETINGS


@pytest.mark.parametrize("name", MEETINGS)
def test_alone_the_robot_drives_straight_to_the_goal(name):
    alone = replace(MEETINGS[name], people=())
    log = drive(alone, StraightController(alone, SETTINGS))
    assert log.success and log.metrics()["overlaps"] == 0
    assert np.abs(log.states[:, 1]).max() < 1e-9


@pytest.mark.parametrize("name", MEETINGS)
def test_people_and_the_robot_start_and_walk_clear_of_walls_and_each_other(name):
    scenario = MEETINGS[name]
    controller = szlib.MPCCBF(ZONE, walls=scenario.walls)
    assert controller.barriers(scenario.start[:2], scenario.people).min() > 0.5
    assert controller.barriers(scenario.goal).min(initial=1.0) > 0.5
    for person in scenario.people:
        assert np.hypot(*person.velocity) <= 0.8 + 1e-9
        for wall in scenario.walls:
            path = np.array([person.after(t).position for t in np.linspace(0, 40, 401)])
            near = szlib.segment_distance(path, *wall).min()
            assert near > 0.25, "people keep off the walls"


@pytest.mark.parametrize("name", MEETINGS)
def test_the_controller_arrives_and_its_safety_claims_hold(name):
    scenario = Variations(MEETINGS[name], ZONE, shift=0.0, pace=(1.0, 1.0))(0)
    controller = szlib.MPCCBF(ZONE, walls=scenario.walls)
    metrics = drive(
        scenario, controller, LoopSettings(behaviour=VisiblePeople())
    ).metrics()
    assert metrics["success"] and metrics["overlaps"] == 0
    assert metrics["unflagged_violations"] == 0


# --- variations --------------------------------------------------------------------------------------


def test_variations_are_close_to_the_scene_and_the_same_for_a_seed():
    scene = MEETINGS["perpendicular traffic"]
    vary = Variations(scene, ZONE, shift=0.3, pace=(0.9, 1.1))
    drawn = [vary(seed) for seed in range(200)]
    starts = np.array([each.start[:2] - scene.start[:2] for each in drawn])
    assert 0.25 < np.abs(starts).max() <= 0.3
    for each in drawn:
        for now, before in zip(each.people, scene.people, strict=True):
            assert np.abs(np.subtract(now.position, before.position)).max() <= 0.3
            assert 0.9 <= np.hypot(*now.velocity) / np.hypot(*before.velocity) <= 1.1
            assert now.heading == before.heading and now.zone == ZONE
    assert vary(7).people == drawn[7].people and vary(8).people != drawn[7].people
    assert np.array_equal(vary(7).goal, scene.goal) and np.array_equal(
        vary(7).walls, scene.walls
    )


def test_variations_without_a_zone_keep_the_zones_of_people():
    own = replace(
        MEETINGS["overtaking"], people=(szlib.Person((0, 0), (0.3, 0), zone=ZONE),)
    )
    assert Variations(own)(0).people[0].zone == ZONE
    assert Variations(MEETINGS["overtaking"])(0).people[0].zone is None


def test_variations_have_no_prediction_of_another_start():
    turns = szlib.control.Prediction([1.0, 2.0], [(3.5, 0.0), (3.5, 0.5)])
    person = szlib.Person((4.0, 0.0), (-0.5, 0.0), prediction=turns)
    scene = szlib.Scenario("turn", (-4, 0, 0, 0), (4, 0), (person,))
    (varied,) = Variations(scene)(0).people
    expected = np.add(varied.position, varied.velocity)
    assert varied.after(1.0).position == pytest.approx(expected)


def test_variations_are_worlds_for_rollouts(tmp_path):
    def run(scene, **options):
        worlds = Variations(MEETINGS[scene], ZONE, **options)
        return rollouts(
            2,
            RolloutSetup(
                worlds=worlds, behaviour=VisiblePeople(), controller=StraightController
            ),
            out=tmp_path,
            n_jobs=1,
            progress=False,
        )

    first = run("overtaking")
    assert first["seed"].tolist() == [0, 1] and len(first["path_length"].unique()) == 2
    run("overtaking", shift=0.1)
    run("frontal approach")
    assert run("overtaking").equals(first)
    assert sum(path.is_dir() for path in tmp_path.iterdir()) == 3


# --- in sight ----------------------------------------------------------------------------------------


def test_walls_hide_people_behind_them():
    wall = np.array([[(0.0, -1.0), (0.0, 1.0)]])
    here = np.array([-1.0, 0.0])
    assert not is_visible(here, (1.0, 0.5), wall)
    assert is_visible(here, (-0.5, 0.5), wall)  # before it
    assert is_visible(here, (1.0, 2.5), wall)  # beside it
    assert is_visible(here, (1.0, 0.5), np.zeros((0, 2, 2)))


def test_hidden_people_are_present_but_not_seen():
    scenario = Variations(MEETINGS["blind corner"], ZONE, shift=0.0, pace=(1.0, 1.0))(0)
    controller = szlib.MPCCBF(ZONE, walls=scenario.walls)
    log = drive(scenario, controller, LoopSettings(behaviour=VisiblePeople()))
    given = ~np.isnan(log.residual[:, 0, 0])
    sight = [
        is_visible(x[:2], p[:2], scenario.walls)
        for x, p in zip(log.states, log.people[:, 0], strict=True)
    ]
    assert given.tolist() == sight
    assert 0 < given.sum() < len(given)
    assert log.is_present.all() and np.isfinite(log.h).all()
    assert np.isfinite(log.residual[:, 1:]).all()  # of the walls


def test_the_identity_of_a_crowd_model_does_not_depend_on_runs():
    model, used = VisiblePeople(), VisiblePeople()
    used.start(MEETINGS["blind corner"], 0)(0.0, np.zeros(4))
    assert identify(model) == identify(used)
    assert vars(pickle.loads(pickle.dumps(used))) == {}
