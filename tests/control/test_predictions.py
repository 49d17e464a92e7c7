"""Predictions of people: what the problem, the ways, the tracker and the check of a step make of them."""

import numpy as np
import pytest

import szlib
from szlib.control import Prediction, predict
from szlib.control.people import SPREAD

ZONE = szlib.Ellipse((0.1, 0.0), (1.0, 0.7))
AHEAD = np.arange(1, 9) * 0.4
SETTINGS = {
    "default": szlib.MPCSettings(time_limit=np.inf),
    "among people": szlib.MPCSettings.among_people(time_limit=np.inf),
}
STATE, GOAL = (0.0, 0.0, 0.8, 0.0), (8.0, 0.0)


def steady(position: tuple[float, float], velocity: tuple[float, float]) -> Prediction:
    return Prediction(AHEAD, np.array(position) + AHEAD[:, None] * velocity)


def step(settings: szlib.MPCSettings, *people: szlib.Person) -> szlib.control.Step:
    return szlib.MPCCBF(ZONE, settings=settings).step(STATE, GOAL, people)


@pytest.mark.parametrize("name", SETTINGS)
def test_a_prediction_at_constant_velocity_changes_nothing(name: str) -> None:
    place, velocity = (5.0, 1.2), (-0.6, -0.1)
    plain = step(SETTINGS[name], szlib.Person(place, velocity))
    as_before = szlib.Person(place, velocity, prediction=steady(place, velocity))
    found = step(SETTINGS[name], as_before)
    assert found.inputs == pytest.approx(plain.inputs, abs=1e-6)
    assert found.way == plain.way and found.safe == plain.safe


@pytest.mark.parametrize("name", SETTINGS)
def test_h_of_the_plan_is_that_of_a_zone_at_the_predicted_place_that_has_grown(
    name: str,
) -> None:
    """At each time of the plan: the barrier of a person who stands there, less 1.64 deviations."""
    settings = SETTINGS[name]
    places = [(5.0 - 0.4 * k, 1.2 - 0.02 * k**2) for k in range(1, 9)]
    turns = Prediction(AHEAD, places, 0.03 * AHEAD)
    person = szlib.Person((5.0, 1.2), (-0.6, 0.0), prediction=turns)
    found, plain = step(settings, person), szlib.MPCCBF(ZONE, settings=settings)
    for k, time in enumerate(settings.times[1:], 1):
        x, y = (
            np.interp(time, [0.0, *AHEAD], [start, *each])
            for start, each in zip((5.0, 1.2), np.transpose(places), strict=True)
        )
        there = szlib.Person((x, y), heading=np.pi)
        (h,) = plain.barriers(found.predicted[k, :2], [there])
        x, y, *_ = found.predicted[k]
        (claimed,) = found.scene.barriers.h(x, y, time)
        assert claimed == pytest.approx(h - SPREAD * 0.03 * time, abs=1e-9)


@pytest.mark.parametrize("name", SETTINGS)
def test_steps_among_any_predictions_are_verified(name: str) -> None:
    rng = np.random.default_rng(5)
    for _ in range(25):
        people = rng.uniform((1, -3, -1, -1), (7, 3, 1, 1), (3, 4))
        wander = rng.normal(0, 0.3, (3, 8, 2)).cumsum(axis=1)
        places = people[:, None, :2] + AHEAD[:, None] * people[:, None, 2:] + wander
        given = predict(people, AHEAD, places, spread=rng.uniform(0, 0.3, (3, 8)))
        found = step(SETTINGS[name], *given)
        assert found.verify().faults == ()


def drive(prediction: Prediction | None, walks: tuple[float, float]) -> float:
    """Time to the goal past a person who comes near the way, and then `walks` on, after 2 s [s]."""
    controller = szlib.MPCCBF(ZONE, settings=SETTINGS["among people"])
    state, person = np.array(STATE), szlib.Person((3.0, 2.0), (0.0, -0.6))
    for k in range(200):
        if np.hypot(*(state[:2] - GOAL)) < 0.3:
            break
        left = None if prediction is None else prediction.later(k * 0.1)
        (x, y), velocity = person.position, (0.0, -0.6) if k < 20 else walks
        person = szlib.Person((x, y), velocity, prediction=left)
        control = controller.step(state, GOAL, [person]).control
        state = szlib.control.advance(state, control, 0.1)
        person = szlib.Person((x + 0.1 * velocity[0], y + 0.1 * velocity[1]))
    return k * 0.1


def test_who_is_predicted_to_turn_back_delays_the_robot_less() -> None:
    times = np.arange(1, 21) * 0.4
    y = np.where(times < 2.0, 2.0 - 0.6 * times, 0.8 + 0.6 * (times - 2.0))
    turns_back = Prediction(times, np.column_stack([np.full(20, 3.0), y]))
    assert drive(turns_back, (0.0, 0.6)) < drive(None, (0.0, 0.6))


def test_who_is_predicted_to_step_into_the_way_is_passed_on_the_other_side() -> None:
    stands = szlib.Person((4.0, 1.9))
    comes = Prediction(AHEAD, [(4.0, 1.9 - 0.5 * t) for t in AHEAD])
    settings = SETTINGS["among people"]
    assert step(settings, stands).way == "right of person 0"
    y = step(settings, szlib.Person((4.0, 1.9), prediction=comes)).ways[0].points[:, 1]
    assert np.abs(y).max() > 0.3


def test_a_late_measurement_is_moved_along_its_prediction() -> None:
    turns = Prediction([0.5, 1.0], [(0.5, 0.0), (0.5, 0.5)], [0.1, 0.2])
    late = szlib.Person((0.0, 0.0), (1.0, 0.0), id="ann", prediction=turns)
    tracker = szlib.Tracker()
    (found,) = tracker.see([late], now=10.0, stamps=9.5).people
    assert found.position == (0.5, 0.0)
    left = found.prediction
    assert left is not None and left.times.tolist() == [0.5]
    (hidden,) = tracker.see([], now=10.5).people
    assert hidden.position == (0.5, 0.5) and hidden.prediction is None


def test_covariances_count_by_their_largest_deviation() -> None:
    turn = np.array([[0.6, -0.8], [0.8, 0.6]])
    matrix = turn @ np.diag([0.04, 0.01]) @ turn.T
    found = Prediction([1.0], [(0.0, 0.0)], [matrix])
    assert found.spread.tolist() == pytest.approx([0.2])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"times": [0.0, 1.0]}, "positive and increasing"),
        ({"times": [1.0, 1.0]}, "positive and increasing"),
        ({"times": [1.0, np.nan]}, "finite"),
        ({"times": 1.0}, r"shape \(1, 2\)"),
        ({"positions": [(0.0, 0.0)]}, r"shape \(2, 2\)"),
        ({"positions": [(0.0, 0.0), (np.nan, 0.0)]}, "finite"),
        ({"spread": [0.1]}, "at least 0"),
        ({"spread": -0.1}, "at least 0"),
        ({"spread": [0.1, np.inf]}, "finite"),
    ],
)
def test_what_cannot_be_used_is_named(changes: dict, message: str) -> None:
    good = {"times": [1.0, 2.0], "positions": [(0.0, 0.0), (1.0, 0.0)]}
    with pytest.raises(szlib.SolverError, match=message):
        Prediction(**{**good, **changes})


def test_arrays_of_another_number_of_people_are_refused() -> None:
    people = [[0.0, 0.0, 1.0, 0.0], [3.0, 0.0, 1.0, 0.0]]
    with pytest.raises(
        szlib.SolverError, match=r"positions must have shape \(2, 1, 2\)"
    ):
        predict(people, [1.0], [[(1.0, 0.0)]])
    places = [[(1.0, 0.0)], [(4.0, 0.0)]]
    with pytest.raises(szlib.SolverError, match="one for each of 2 people"):
        predict(people, [1.0], places, [0.1, 0.1, 0.1])
    with pytest.raises(szlib.SolverError, match="must be a Prediction"):
        szlib.Person((0.0, 0.0), prediction=[(1.0, 0.0)])


def test_a_reference_zone_is_a_zone() -> None:
    zone = szlib.reference_zone("grand-central-strangers")
    assert szlib.MPCCBF(zone).zone == zone.ellipse
    with pytest.raises(szlib.ZoneError, match=r"\.ellipse\(speed\)"):
        szlib.MPCCBF(3.0)


def test_no_people_are_predicted_as_no_people() -> None:
    assert predict([], [1.0], []) == []
    assert predict(np.zeros((0, 4)), [1.0, 2.0], np.zeros((0, 2, 2))) == []


def test_a_person_who_stands_blocks_a_goal_though_the_place_gets_uncertain():
    """Standing is a matter of the velocity: a zone that grows does not walk away."""
    waits = Prediction([1.0, 2.0], [(1.0, 0.0)] * 2, spread=[0.2, 0.4])
    person = szlib.Person((1.0, 0.0), prediction=waits)
    step = szlib.MPCCBF(ZONE).step((-3.0, 0.0, 0.0, 0.0), (1.2, 0.3), [person])
    assert step.goal_blocked
