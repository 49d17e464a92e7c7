"""The laboratory computes what a simulation computes, says why, and no drag or setting breaks it."""

import doctest
import io
import json
from threading import Thread

import laboratory
import numpy as np
import pytest
import shapely
from helpers import recorded_worlds
from laboratory import (
    PRESETS,
    Axis,
    Laboratory,
    Recording,
    RobotOptions,
    World,
    explain,
    show_sliders,
)
from laboratory.explanation import name_limit
from PIL import Image

import szlib
from szlib.control.planner import Planner
from szlib.workbook import folders

ZONE = szlib.Ellipse((0.03, 0.0), (0.97, 0.75))
PAPER, AMONG_PEOPLE = (
    RobotOptions(f"MPCSettings.{name}") for name in ("paper", "among_people")
)
FAST = RobotOptions(changes={"gamma": 0.5})


@pytest.fixture(autouse=True)
def unlimited_time(monkeypatch):
    """No step ends early on a busy machine: a run that is computed again is the same."""
    monkeypatch.setattr(Planner, "is_late", False)


def make_world(name="corridor", n=0, robots=()):
    return advance(World(PRESETS[name], ZONE, robots or [RobotOptions()]), n)


def advance(world, n):
    for _ in range(n):
        world.advance()
    return world


def describe(world):
    """Everything that a user sees, exactly."""
    controls = [step.control.tolist() for step in world.steps]
    scene, states = world.scenario, [state.tolist() for state in world.states]
    shown = [
        world.n,
        states,
        controls,
        world.people,
        scene.goal.tolist(),
        scene.walls.tolist(),
        world.robots,
    ]
    return repr(shown)


@pytest.mark.parametrize(
    "module", ["world", "admissible_controls", "explanation", "widget"]
)
def test_examples_run(module):
    assert doctest.testmod(getattr(laboratory, module)).failed == 0


# --- the world ---------------------------------------------------------------------------------------


def test_each_robot_moves_as_in_a_simulation_of_its_own():
    world, states = make_world(robots=(RobotOptions(), FAST)), []
    for _ in range(30):
        states.append(world.states)
        world.advance()
    for i, options in enumerate(world.robots):
        scene = PRESETS["corridor"]
        controller = szlib.MPCCBF(ZONE, walls=scene.walls, settings=options.settings)
        alone = szlib.simulate(scene, controller, max_time=2.9)
        assert np.array_equal([each[i] for each in states], alone.states)


EDITS = [
    {"people": {0: {"position": [1.0, 0.5]}}},
    {"people": {0: {"heading": 2.0, "speed": 1.2}, 1: {"position": [0.0, -1.5]}}},
    {"people": {0: None}},
    {"goal": [3.0, -1.0]},
    {"walls": [[-6, 2.0, 7, 2.5]]},
    {"start": [-3.0, 0.5]},
    {"robots": [AMONG_PEOPLE]},
    {
        "robots": [
            RobotOptions("MPCSettings.paper", {"v_max": 0.8, "N": 10}),
            RobotOptions(),
        ]
    },
]


@pytest.mark.parametrize("edit", EDITS, ids=lambda edit: "-".join(edit))
@pytest.mark.parametrize("after", [0, 13])
def test_shared_code_computes_exactly_what_is_on_the_screen(edit, after):
    world = make_world(n=15)
    world.change(**edit)
    advance(world, after)
    shared = {}
    exec(world.code(), shared)
    for suffix, state, step in zip(("", "_b"), world.states, world.steps, strict=False):
        log = shared[f"log{suffix}"]
        assert np.array_equal(log.controls[-1], step.control)
        assert np.array_equal(log.states[-1], state)
        assert np.array_equal(log.residual[-1], step.residual)
        assert shared[f"settings{suffix}"] == step.scene.settings
    places = [
        (*person.position, person.heading, *person.velocity) for person in world.people
    ]
    assert np.array_equal(log.people[-1], np.reshape(places, (-1, 5)))
    assert np.array_equal(log.scenario.walls, world.scenario.walls)
    assert ("log_b" in shared) == (len(world.robots) == 2)


def test_a_change_begins_at_this_instant_and_changes_nothing_else():
    world = make_world(n=20)
    states, people = [state.tolist() for state in world.states], world.people
    world.change(
        people={0: {"heading": 1.0}, 1: {"position": [0.0, 1.0], "speed": 0.5}}
    )
    assert world.n == 20 and [state.tolist() for state in world.states] == states
    assert world.people[0].position == people[0].position
    assert world.people[0].velocity == pytest.approx(
        (0.5 * np.cos(1.0), 0.5 * np.sin(1.0))
    )
    assert world.people[1].velocity == (0.5, 0.0)
    world.change(people={0: None}, robots=[RobotOptions(), PAPER])
    assert [person.position for person in world.people] == [(0.0, 1.0)]
    assert np.array_equal(*world.states), "a second robot begins beside the first"


def test_the_past_can_be_visited_and_goes_on_as_before():
    world, shown = make_world(), {}
    for n in range(45):
        shown[n] = describe(world)
        if n in (12, 30):
            world.change(people={0: {"position": [3.0, 0.1 * n]}})
            shown[n] = describe(world)
        world.advance()
    world.rewind(40)
    assert describe(world) == shown[40]
    for n in (30, 20, 12):
        world.rewind(n)
        assert describe(world) == shown[n]
    advance(world, 8)
    assert describe(world) == shown[20]
    for n in (-1, 21, 3.5, None):
        with pytest.raises(szlib.SolverError, match="n must be 0 to 20"):
            world.rewind(n)


REFUSED = {
    "goal must be finite": {"goal": [1.0, np.nan]},
    "0.001 m long or longer": {"goal": [1, 1], "walls": [[0, 0, 0, 0]]},
    "N_h must be at most N": {"robots": [RobotOptions(changes={"N": 4, "N_h": 8})]},
    "the number of robots must be 1 to 2": {"robots": [RobotOptions()] * 3},
}


@pytest.mark.parametrize("reason", REFUSED)
def test_a_refused_change_leaves_everything_as_it_was(reason):
    world, untouched = make_world(n=15), make_world(n=15)
    before = describe(world)
    with pytest.raises(szlib.SolverError, match=reason):
        world.change(**REFUSED[reason])
    assert describe(world) == before
    advance(world, 5)
    advance(untouched, 5)
    # Two solvers of one problem may differ in the last bit.
    np.testing.assert_allclose(world.states, untouched.states, rtol=0, atol=1e-9)
    assert repr(world.people) == repr(untouched.people)
    assert world.robots == untouched.robots
    for name in ("goal", "walls"):
        one, other = (getattr(each.scenario, name) for each in (world, untouched))
        np.testing.assert_array_equal(one, other)


# --- why did it do this? -----------------------------------------------------------------------------


@pytest.mark.parametrize("name", PRESETS)
def test_a_limit_is_named_if_and_only_if_the_acceleration_lies_on_its_edge(name):
    world, control = make_world(name, 5), None
    for _ in range(8):
        step, reasons = advance(world, 5).steps[0], explain(world.steps[0])
        control = shapely.Point(step.control)
        for limit in reasons.active:
            assert f"{name_limit(step, limit)} " in reasons.sentence
            assert shapely.LineString(limit.curve).distance(control) <= 0.02
        at_edge = {
            limit.row
            for limit in reasons.found.limits
            if shapely.LineString(limit.curve).distance(control) <= 0.02
        }
        assert len(reasons.active) == min(2, len(at_edge))
        assert reasons.sentence.endswith("a step.") == bool(reasons.active)
        assert reasons.safety.startswith("Safe") == step.safe


@pytest.mark.parametrize("name", ["making_room", "corridor", "blind corner"])
def test_the_sentence_names_the_price_if_the_acceleration_lies_outside_the_green_area(
    name,
):
    world, n_outside = make_world(name, robots=[AMONG_PEOPLE]), 0
    for _ in range(10):
        step, reasons = advance(world, 5).steps[0], explain(world.steps[0])
        off = reasons.found.polygon.distance(shapely.Point(step.control))
        is_outside = step.feasible and not off <= 0.02  # nan: no area
        assert reasons.sentence.endswith(", at a price.") == is_outside
        assert not (is_outside and reasons.active)
        n_outside += is_outside
    assert 3 < n_outside < 10


def sentence(world):
    return explain(world.steps[0]).sentence


def test_the_sentence_says_what_the_robot_does_and_why():
    assert sentence(make_world()).startswith(
        "It sets off: only the bound of its acceleration limits it"
    )
    assert sentence(make_world(n=20)) == (
        "It keeps its speed: 1 m/s is its highest speed, and no person and no wall limits it."
    )
    both = r"It brakes: person 0 comes closer at 0.7 m/s (h = 1.55 m), wall 1 comes closer at 0.5 m/s"
    assert sentence(make_world(n=40)).startswith(both)
    assert sentence(make_world(n=40)).endswith(
        "and h may shrink by at most 5 % a step."
    )
    assert "at most 10 % a step" in sentence(make_world(n=16, robots=[AMONG_PEOPLE]))
    assert sentence(make_world("making_room", 20)).startswith("It goes back")
    there = make_world("passing", 95)
    assert sentence(there).startswith(
        "It brakes: no person and no wall limits it, and its goal is 0."
    )
    assert sentence(advance(there, 20)).endswith(": it is at its goal.")


def test_danger_and_goals_that_cannot_be_reached_are_said_in_words():
    world = make_world("passing", 25)
    world.change(goal=[0.8, 0.8])
    (note,) = explain(world.steps[0]).notes
    assert note.startswith("The goal (0.8, 0.8) cannot be reached, h < 0 there")
    x, y = world.states[0][:2]
    world.change(people={0: {"position": [x + 1.2, y]}})
    reasons = explain(world.steps[0])
    assert reasons.safety == "Not safe: the robot is already too close to person 0."
    world = make_world("corridor", robots=[AMONG_PEOPLE])
    said = [sentence(advance(world, 1)) for _ in range(60)]
    assert any("it comes nearer to person" in each for each in said)
    fast = make_world(robots=[FAST])
    while fast.steps[0].feasible:
        fast.advance()
    reasons = explain(fast.steps[0])
    assert ": no plan keeps every limit, so the plan is relaxed" in reasons.sentence
    assert reasons.active == () and reasons.notes[0].startswith(
        "The plan violates the condition of person 0"
    )


def test_the_ways_are_drawn_and_named_and_none_where_none_is_looked_for():
    (shown,) = ask(Laboratory("two_doors", zone=ZONE), "show")["snapshots"]
    assert shown["ways"] == [] and shown["way"] == ""
    lab = Laboratory("two_doors", zone=ZONE, robots=[AMONG_PEOPLE])
    (shown,) = ask(lab, "show")["snapshots"]
    (step,) = lab.world.steps
    assert shown["way"].startswith(f"Way: {step.way}.") and step.ways
    assert not any(note.startswith(("Way", "Not: ")) for note in shown["notes"])
    assert np.allclose(shown["ways"][0][-1], PRESETS["two_doors"].goal, atol=0.2)
    assert len(shown["ways"]) == len(step.ways)


def test_among_people_takes_the_second_door():
    robots = [AMONG_PEOPLE, RobotOptions()]
    world, highest = make_world("two_doors", robots=robots), [0.0, 0.0]
    for _ in range(200):
        world.advance()
        highest = [max(y, s[1]) for y, s in zip(highest, world.states, strict=True)]
    there, waits = (state[:2] for state in world.states)
    assert highest[0] > 2.4 and np.hypot(*(there - (6, 0))) < 0.2
    assert highest[1] < 2.4 and waits[0] < 2, "the defaults wait before the person"


# --- the page ----------------------------------------------------------------------------------------


def ask(lab, kind, n=0, **changes):
    return json.loads(
        json.dumps(
            lab.answer({"kind": kind, "n": n, "changes": changes}), allow_nan=False
        )
    )


@pytest.mark.parametrize("name", PRESETS)
def test_every_scene_can_be_shown_and_run(name):
    lab = Laboratory(name, zone=ZONE, robots=[RobotOptions(), AMONG_PEOPLE])
    first, second = ask(lab, "show")["snapshots"]
    assert first["robot"] == second["robot"] == PRESETS[name].start[:2].tolist()
    answer = ask(lab, "step")
    assert (answer["n"], answer["scenario"], len(answer["speeds"])) == (
        1,
        name,
        len(PRESETS[name].people),
    )
    assert answer["snapshots"][0]["allowed"] and answer["snapshots"][0]["sentence"]


def test_the_view_stays_when_a_change_is_refused():
    lab = Laboratory(zone=ZONE)
    before = ask(lab, "step")
    refused = ask(lab, "show", 1, walls=[[-6, 2.3, 50, 2.3], [0, 0, 0, 0]])
    assert refused.pop("kind") == "error"
    assert "0.001 m long or longer" in refused.pop("text")
    assert refused == {
        key: value for key, value in before.items() if key not in ("kind", "text")
    }
    wider = ask(lab, "show", 1, walls=[[-6, 2.3, 50, 2.3]])
    assert (
        wider["kind"] == "snapshots"
        and wider["layout"]["limits"] == before["layout"]["limits"]
    )


def test_a_request_goes_back_first_and_a_scene_begins_anew():
    lab = Laboratory(zone=ZONE)
    steps = [ask(lab, "step", n) for n in range(10)]
    assert ask(lab, "step", 4) == steps[4]
    moved = ask(lab, "show", 3, people={"0": {"position": [2, 1]}})
    assert (moved["n"], moved["snapshots"][0]["people"][0][:2]) == (3, [2, 1])
    robots = [{"constructor": "MPCSettings", "changes": {"gamma": 0.2}}]
    assert ask(lab, "show", 3, robots=robots)["robots"] == robots
    begun = ask(lab, "show", 3, scenario="waiting")
    assert (begun["n"], begun["scenario"], begun["robots"]) == (0, "waiting", robots)
    assert "szlib.MPCSettings(gamma=0.2)" in ask(lab, "share")["text"]


def test_a_scene_of_ones_own_is_opened():
    scene = szlib.Scenario("my hall", (0, 0, 0, 0), (5, 0), [szlib.Person((3, 1))])
    lab = Laboratory(scene, zone=ZONE)
    assert lab.content["presets"][0] == ask(lab, "show")["scenario"] == "my hall"
    with pytest.raises(
        szlib.SolverError, match="scenario must be one of passing, corridor"
    ):
        Laboratory("nowhere")


def test_a_recording_opens_the_laboratory_on_its_scene(monkeypatch):
    axes = [Axis("gamma", "gamma", (0.05, 0.3), 1), Axis("y", "y [m]", (0.5,))]
    recording = Recording("Passing", recorded_worlds.make_world, axes, longest=0.2)
    assert recording.open_live() is None, "a headless run has no page"
    monkeypatch.setenv("JPY_SESSION_NAME", "chapter.ipynb")
    monkeypatch.delenv(folders.RUN_VARIABLE, raising=False)
    world = recording.open_live().world
    assert world.people[0].position == (0.0, 0.5)
    assert world.robots[0].settings.gamma == 0.3 and world.zone == ZONE


NAN = float("nan")
MALFORMED = [
    3, [], {"robots": 3}, {"robots": [3]}, {"robots": [{"constructor": "x", "changes": {}}]}, {"nope": 1},
    *({"robots": [{"constructor": "MPCSettings", "changes": {"N_h": n}}]} for n in (300, 0, -3, 2.5, "x")),
    *({"robots": [{"constructor": "MPCSettings", "changes": {"gamma": x}}]} for x in (NAN, 1e9, 0, None)),
    {"robots": [{"constructor": "MPCSettings", "changes": {"dt": 1.0}}]}, {"scenario": "x"}, {"scenario": []},
    {"people": 3}, {"people": {"9": {}}}, {"people": {"-1": None}}, {"people": {"1": None}},
    {"people": {"a": {}}}, {"people": {"0": {"position": [NAN, 0]}}}, {"people": {"0": {"speed": 1e9}}},
    {"people": {"0": {"heading": "x"}}}, {"people": {"0": {"position": [1e6, 0]}}}, {"people": {"0": 3}},
    {"walls": [[-6, 2, 7, 2]], "goal": [1]}, {"goal": []}, {"goal": [NAN, 0]}, {"goal": [1e300, 0]},
    {"walls": 3}, {"walls": [[1, 2, 3]]}, {"walls": [["a", 1, 2, 3]]}, {"walls": [[0, 0, 1, 1]] * 1000},
    {"start": "x"},
]  # fmt: skip


def test_a_malformed_message_gives_an_error_and_changes_nothing():
    lab = Laboratory(zone=ZONE)
    ask(lab, "step")
    before = describe(lab.world)
    requests = [{"kind": "step", "n": 1, "changes": changes} for changes in MALFORMED]
    requests += [
        None,
        3,
        "x",
        [],
        {},
        {"kind": "step"},
        {"kind": "x", "n": 1, "changes": {}},
    ]
    requests += [
        {"kind": "step", "n": n, "changes": {}} for n in (-1, 2, "x", None, NAN)
    ]
    for request in requests:
        assert lab.answer(request)["kind"] == "error", request
        assert describe(lab.world) == before, request
    assert lab.answer({"kind": "step", "n": 1, "changes": {}})["kind"] == "snapshots"


def test_messages_may_come_in_any_thread():
    lab, answers = Laboratory(zone=ZONE), []
    lab.send = answers.append
    request = {"kind": "step", "n": 0, "changes": {}}
    lab._handle_custom_msg(request, [])
    other = Thread(target=lab._handle_custom_msg, args=(request, []))
    other.start()
    other.join()
    assert [answer["kind"] for answer in answers] == ["snapshots", "snapshots"]


# --- sliders -----------------------------------------------------------------------------------------


def test_a_headless_run_shows_no_sliders(monkeypatch):
    monkeypatch.delenv("JPY_SESSION_NAME", raising=False)
    assert not laboratory.is_interactive()
    show_sliders(lambda speed: pytest.fail("drawn"), speed=(1.0, 0.5, 1.5, 0.1))
    monkeypatch.setenv("JPY_SESSION_NAME", "05_zones.ipynb")
    assert laboratory.is_interactive()
    monkeypatch.setenv("SZLIB_RUN", "results")
    assert not laboratory.is_interactive()


def test_a_slider_replaces_one_picture_whose_axes_stay(monkeypatch):
    import IPython.display
    import matplotlib.pyplot as plt

    monkeypatch.setenv("JPY_SESSION_NAME", "05_zones.ipynb")
    monkeypatch.delenv("SZLIB_RUN", raising=False)
    shown, open_before = [], plt.get_fignums()
    monkeypatch.setattr(IPython.display, "display", shown.append)

    def draw(speed):
        ax = plt.subplots()[1]
        ax.plot([0, speed], [0, speed], label="x" * round(10 * speed))
        ax.set(xlim=(0, 2), ylim=(0, 2))
        ax.legend(loc="upper left", bbox_to_anchor=(0, -0.1))
        return ax

    show_sliders(draw, speed=(1.0, 0.5, 1.5, 0.1))
    (box,) = shown
    slider, picture = box.children
    before = Image.open(io.BytesIO(picture.value)).convert("L")
    slider.value = 1.4
    after = Image.open(io.BytesIO(picture.value)).convert("L")
    assert plt.get_fignums() == open_before and len(shown) == 1
    assert before.size == after.size
    # the numbers of the y axis
    rows = [np.array(image)[:, :40] for image in (before, after)]
    assert rows[0].min() < 128 and np.array_equal(*rows)
    assert not np.array_equal(np.array(before), np.array(after))
