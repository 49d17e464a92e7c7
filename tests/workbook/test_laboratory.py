"""The laboratory: what it computes is the simulation's, and nothing that is dragged or set breaks it."""

from dataclasses import asdict
from threading import Thread

import numpy as np
import pytest

import szlib
from szlib.errors import SolverError
from szlib.workbook import laboratory

ZONES = {"quantile": szlib.Ellipse((0.05, 0.0), (0.95, 0.75)), "hull": szlib.Ellipse((0.0, 0.0), (0.9, 0.7))}
WALLS = [-6.0, 2.3, 7.0, 2.3, -6.0, -2.3, 7.0, -2.3]


def make_bench(*choices):
    scene = laboratory.make_scene([4.0, 0.0], [4.0, 0.0, 180.0], 0.5, WALLS, start=[-4.0, 0.0])
    return laboratory.Experiment(
        scene, ZONES, choices or (laboratory.RobotOptions(), laboratory.RobotOptions(gamma=0.2, N_h=9))
    )


def test_robots_side_by_side_go_as_if_alone():
    bench, driven = make_bench(), []
    for _ in range(30):
        driven.append([*bench.states])
        bench.step()
    for i, choice in enumerate(bench.choices):
        controller = szlib.MPCCBF(choice.zone(ZONES), walls=bench.scenario.walls, settings=choice.settings())
        alone = szlib.simulate(bench.scenario, controller, max_time=2.9)
        assert np.array_equal([states[i] for states in driven], alone.states)


def test_to_look_lets_no_time_pass():
    bench = make_bench()
    bench.step()
    t, states, people = bench.t, [*bench.states], [*bench.people]
    bench.look()
    assert (bench.t, bench.people) == (t, people)
    assert np.array_equal(bench.states, states)


def test_what_is_set_reaches_the_robot_it_is_set_for():
    bench = make_bench()
    bench.choose(1, a_max=0.5, size=2.0, estimator="hull")
    first, second = bench.look()
    assert first.scene.settings.a_max == 1.0 and second.scene.settings.a_max == 0.5
    assert second.scene.kept[0].semi_axes == pytest.approx((1.8, 1.4))
    with pytest.raises(SolverError, match="estimator must be one of quantile, hull; got 'circle'"):
        bench.choose(0, estimator="circle")
    with pytest.raises(SolverError, match="gamma"):
        bench.choose(0, gamma=2.0)
    assert bench.choices[0] == laboratory.RobotOptions()


def test_what_is_moved_is_where_it_was_put():
    bench = make_bench()
    bench.step()
    bench.move(goal=[3.0, 1.0], people={0: [1.0, -0.5]}, walls=[[-6, 2, 7, 2]], speed=1.0)
    step = bench.look()[0]
    assert step.scene.goal == (3.0, 1.0)
    assert step.scene.people[0].position == (1.0, -0.5)
    assert step.scene.people[0].velocity == pytest.approx((-1.0, 0.0))
    assert step.scene.walls == [[-6, 2, 7, 2]]
    bench.restart()
    assert bench.people[0].position == (4.0, 0.0)  # moved in the middle of a run, they begin where they did
    bench.move(people={0: [2.0, 0.0]})
    bench.step()
    bench.restart()
    assert bench.people[0].position == (2.0, 0.0)


def test_a_wall_without_length_is_refused_in_words_and_nothing_moves():
    widget = laboratory.LaboratoryWidget(make_bench())
    said = widget.answer({"kind": "step", "changed": {"goal": [1, 1], "walls": [[0, 0, 0, 0]]}})
    assert said["kind"] == "refused"
    assert "two different end points" in said["text"]
    assert said["stage"]["goal"] == [4, 0] and len(said["stage"]["walls"]) == 2
    assert widget.bench.t == 0


def test_the_page_is_told_every_instant():
    widget = laboratory.LaboratoryWidget(make_bench())
    for k in range(3):
        said = widget.answer(
            {"kind": "step", "changed": {"choices": {"0": {"gamma": 0.1}}} if k == 1 else {}}
        )
    (first, second) = said["moments"]
    assert first["t"] == second["t"] == 0.2
    assert first["rung"] == "warm" and first["told"] == "safe"
    assert first["free"] and len(first["control"]) == 2
    assert widget.bench.choices[0].gamma == 0.1
    again = widget.answer({"kind": "look", "changed": {"restart": True}})["moments"][0]
    assert (again["t"], again["robot"]) == (0.0, [-4, 0])


def test_messages_may_come_in_any_thread():
    widget, said = laboratory.LaboratoryWidget(make_bench()), []
    widget.send = said.append
    asked = {"kind": "step", "changed": {}}
    widget._handle_custom_msg(asked, [])
    other = Thread(target=widget._handle_custom_msg, args=(asked, []))
    other.start()
    other.join()
    assert [message["kind"] for message in said] == ["moments", "moments"]


def test_what_is_shared_begins_with_the_same_scene():
    bench = make_bench()
    bench.move(goal=[3.0, 1.0], people={0: [2.0, 0.5]}, walls=[[-6, 2, 7, 2.5]], speed=0.7)
    bench.choose(1, size=1.5)
    said = laboratory.LaboratoryWidget(bench).answer({"kind": "share", "changed": {}})["text"]
    found = {}
    exec(said, found)
    scene = laboratory.make_scene(
        *(found[name] for name in ("goal", "person", "speed", "walls")), start=[-4, 0]
    )
    assert np.array_equal(scene.walls, bench.scenario.walls) and np.array_equal(scene.goal, [3, 1])
    assert scene.people[0].position == (2.0, 0.5)
    assert scene.people[0].velocity == pytest.approx(bench.people[0].velocity)
    for choice, suffix in zip(bench.choices, ("", "_b"), strict=True):
        assert laboratory.RobotOptions(**{name: found[name + suffix] for name in asdict(choice)}) == choice


def test_without_a_page_nothing_is_shown(monkeypatch):
    monkeypatch.delenv("JPY_SESSION_NAME", raising=False)
    assert not laboratory.is_interactive()
    laboratory.show_sliders(lambda speed: pytest.fail("drawn"), speed=(1.0, 0.5, 1.5, 0.1))
    monkeypatch.setenv("JPY_SESSION_NAME", "20_laboratory.ipynb")
    assert laboratory.is_interactive()
    monkeypatch.setenv("SZLIB_RUN", "results")
    assert not laboratory.is_interactive()
