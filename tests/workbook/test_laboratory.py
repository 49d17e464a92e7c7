"""The laboratory computes what the simulation computes; no drag and no setting breaks it."""

from dataclasses import asdict
from threading import Thread

import laboratory
import numpy as np
import pytest

import szlib

ZONES = {"quantile": szlib.Ellipse((0.05, 0.0), (0.95, 0.75)), "hull": szlib.Ellipse((0.0, 0.0), (0.9, 0.7))}
WALLS = [-6.0, 2.3, 7.0, 2.3, -6.0, -2.3, 7.0, -2.3]


def make_experiment():
    scene = laboratory.make_scene([4.0, 0.0], [4.0, 0.0, 180.0], 0.5, WALLS, start=[-4.0, 0.0])
    robots = laboratory.RobotOptions(), laboratory.RobotOptions(gamma=0.2, N_h=9)
    return laboratory.Experiment(scene, ZONES, robots)


def test_each_robot_moves_as_in_a_simulation_of_its_own():
    experiment, states = make_experiment(), []
    for _ in range(30):
        states.append([*experiment.states])
        experiment.step()
    for i, options in enumerate(experiment.robots):
        walls = experiment.scenario.walls
        controller = szlib.MPCCBF(options.zone(ZONES), walls=walls, settings=options.settings())
        alone = szlib.simulate(experiment.scenario, controller, max_time=2.9)
        assert np.array_equal([each[i] for each in states], alone.states)


def test_deciding_lets_no_time_pass():
    experiment = make_experiment()
    experiment.step()
    t, states, people = experiment.t, [*experiment.states], [*experiment.people]
    experiment.decide()
    assert (experiment.t, experiment.people) == (t, people)
    assert np.array_equal(experiment.states, states)


def test_an_option_changes_its_robot_only():
    experiment = make_experiment()
    experiment.configure_robot(1, a_max=0.5, size=2.0, estimator="hull")
    first, second = experiment.decide()
    assert first.scene.settings.a_max == 1.0 and second.scene.settings.a_max == 0.5
    assert second.scene.person_zones[0].semi_axes == pytest.approx((1.8, 1.4))
    with pytest.raises(szlib.SolverError, match="estimator must be one of quantile, hull; got 'circle'"):
        experiment.configure_robot(0, estimator="circle")
    with pytest.raises(szlib.SolverError, match="gamma"):
        experiment.configure_robot(0, gamma=2.0)
    assert experiment.robots[0] == laboratory.RobotOptions()


def test_a_move_during_the_run_does_not_change_the_start():
    experiment = make_experiment()
    experiment.step()
    experiment.move(goal=[3.0, 1.0], people={0: [1.0, -0.5]}, walls=[[-6, 2, 7, 2]], speed=1.0)
    step = experiment.decide()[0]
    assert step.scene.goal == (3.0, 1.0)
    assert step.scene.people[0].position == (1.0, -0.5)
    assert step.scene.people[0].velocity == pytest.approx((-1.0, 0.0))
    assert [wall[:4] for wall in step.scene.walls] == [[-6, 2, 7, 2]]
    experiment.restart()
    assert experiment.people[0].position == (4.0, 0.0)
    experiment.move(people={0: [2.0, 0.0]})  # before the first step: the start
    experiment.step()
    experiment.restart()
    assert experiment.people[0].position == (2.0, 0.0)


def test_a_wall_without_length_gives_an_error_and_moves_nothing():
    widget = laboratory.LaboratoryWidget(make_experiment())
    answer = widget.answer({"kind": "step", "changes": {"goal": [1, 1], "walls": [[0, 0, 0, 0]]}})
    assert answer["kind"] == "error"
    assert "two different end points" in answer["text"]
    assert answer["layout"]["goal"] == [4, 0] and len(answer["layout"]["walls"]) == 2
    assert widget.experiment.t == 0


NAN = float("nan")
MALFORMED_CHANGES = [
    3, [], None, {"robots": 3}, {"robots": {"9": {"gamma": 0.1}}}, {"robots": {"-1": {"gamma": 0.1}}},
    {"robots": {"a": {}}}, {"robots": {"0": 3}}, {"robots": {"0": {"nope": 1}}},
    *({"robots": {"0": {"N_h": n}}} for n in (300, 41, 0, -3, 2.5, True, "x", None, [1], 10**400)),
    *({"robots": {"0": {name: x}}} for name in ("gamma", "a_max", "size") for x in (NAN, 1e9, 0, -1, None)),
    {"robots": {"0": {"estimator": []}}}, {"robots": {"0": {"gamma": 0.3}}, "goal": "x"},
    {"robots": {"0": {"gamma": 0.3}, "1": {"gamma": 7}}, "walls": [[-6, 2, 7, 2]]},
    {"people": 3}, {"people": {"9": [0, 0]}}, {"people": {"-1": [0, 0]}}, {"people": {"0": 3}},
    {"people": {"0": [NAN, 0]}}, {"people": {"0": ["a", 0]}}, {"people": {"0": [1e6, 0]}},
    {"walls": [[-6, 2, 7, 2]], "goal": [1]}, {"goal": []}, {"goal": [NAN, 0]}, {"goal": [1e300, 0]},
    {"walls": 3}, {"walls": [[1, 2, 3]]}, {"walls": [["a", 1, 2, 3]]}, {"walls": [[0, 0, 1, 1e9]]},
    {"walls": [[0, 0, 1, 1]] * 1000}, {"speed": "x"}, {"speed": NAN}, {"speed": 1e9}, {"speed": -1},
]  # fmt: skip


def test_a_malformed_message_gives_an_error_and_changes_nothing():
    widget = laboratory.LaboratoryWidget(make_experiment())
    experiment = widget.experiment
    experiment.step()

    def state():
        scene, walls = experiment.scenario, [c.walls.tolist() for c in experiment._controllers]
        return str([experiment.t, experiment.robots, experiment.states, experiment.people, scene.goal, walls])

    before = state()
    requests = [{"kind": "step", "changes": changes} for changes in MALFORMED_CHANGES]
    requests += [None, 3, "x", [], {}, {"kind": "step"}, {"changes": {}}, {"kind": "x", "changes": {}}]
    for request in [*requests, {"kind": [], "changes": {}}]:
        assert widget.answer(request)["kind"] == "error", request
        assert state() == before, request
    assert widget.answer({"kind": "decide", "changes": {}})["kind"] == "snapshots"


def test_the_page_gets_a_snapshot_of_each_robot():
    widget = laboratory.LaboratoryWidget(make_experiment())
    for k in range(3):
        changes = {"robots": {"0": {"gamma": 0.1}}} if k == 1 else {}
        answer = widget.answer({"kind": "step", "changes": changes})
    first, second = answer["snapshots"]
    assert first["t"] == second["t"] == 0.2
    assert first["fallback"] == "warm" and first["safe"]
    assert first["allowed"] and len(first["control"]) == 2
    assert widget.experiment.robots[0].gamma == 0.1
    again = widget.answer({"kind": "decide", "changes": {"restart": True}})["snapshots"][0]
    assert (again["t"], again["robot"]) == (0.0, [-4, 0])


def test_messages_may_come_in_any_thread():
    widget, answers = laboratory.LaboratoryWidget(make_experiment()), []
    widget.send = answers.append
    request = {"kind": "step", "changes": {}}
    widget._handle_custom_msg(request, [])
    other = Thread(target=widget._handle_custom_msg, args=(request, []))
    other.start()
    other.join()
    assert [answer["kind"] for answer in answers] == ["snapshots", "snapshots"]


def test_a_shared_cell_starts_with_the_same_scene():
    experiment = make_experiment()
    experiment.move(goal=[3.0, 1.0], people={0: [2.0, 0.5]}, walls=[[-6, 2, 7, 2.5]], speed=0.7)
    experiment.configure_robot(1, size=1.5)
    cell = laboratory.LaboratoryWidget(experiment).answer({"kind": "share", "changes": {}})["text"]
    found = {}
    exec(cell, found)
    given = [found[name] for name in ("goal", "person", "speed", "walls")]
    scene = laboratory.make_scene(*given, start=[-4, 0])
    assert np.array_equal(scene.walls, experiment.scenario.walls) and np.array_equal(scene.goal, [3, 1])
    assert scene.people[0].position == (2.0, 0.5)
    assert scene.people[0].velocity == pytest.approx(experiment.people[0].velocity)
    for options, suffix in zip(experiment.robots, ("", "_b"), strict=True):
        assert laboratory.RobotOptions(**{name: found[name + suffix] for name in asdict(options)}) == options


def test_a_headless_run_shows_no_sliders(monkeypatch):
    monkeypatch.delenv("JPY_SESSION_NAME", raising=False)
    assert not laboratory.is_interactive()
    laboratory.show_sliders(lambda speed: pytest.fail("drawn"), speed=(1.0, 0.5, 1.5, 0.1))
    monkeypatch.setenv("JPY_SESSION_NAME", "13_laboratory.ipynb")
    assert laboratory.is_interactive()
    monkeypatch.setenv("SZLIB_RUN", "results")
    assert not laboratory.is_interactive()
