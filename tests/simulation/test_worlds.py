"""Random worlds are what they promise, whatever the seed."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from studies.distances import euclidean_to_segment

import szlib
from szlib.simulation.crowds import Behaviour
from szlib.simulation.scenario import ONE_PERSON, Worlds

seeds = st.integers(0, 2**32)


@given(seeds)
def test_a_seed_always_gives_the_same_world(seed):
    one, two = Worlds()(seed), Worlds()(seed)
    assert np.array_equal(one.start, two.start)
    assert np.array_equal(one.walls, two.walls)
    assert one.people == two.people


@given(seeds)
def test_the_start_is_safe_and_the_goal_can_be_reached(seed):
    scenario = Worlds()(seed)
    controller = szlib.MPCCBF(scenario.people[0].zone, walls=scenario.walls)
    assert controller.barriers(scenario.start[:2], scenario.people).min() >= 0
    assert (
        controller.barriers(
            scenario.goal, [p for p in scenario.people if p.stands]
        ).min(initial=1)
        >= 0
    )
    assert 1 <= len(scenario.people) <= 5
    assert len(scenario.walls) <= 4
    assert np.hypot(*scenario.start[2:]) <= 1
    for person in scenario.people:
        path = np.array(
            [person.after(t).position for t in np.linspace(0, scenario.duration, 31)]
        )
        assert all(
            euclidean_to_segment(path, *wall).min() >= 0.25 for wall in scenario.walls
        )


@pytest.mark.parametrize("seed", range(5))
def test_all_people_have_the_given_zone_and_the_start_lies_outside(seed):
    learned = szlib.Ellipse((0.3, 0.0), (1.5, 0.6))
    scenario = Worlds(zone=learned)(seed)
    assert all(person.zone == learned for person in scenario.people)
    controller = szlib.MPCCBF(learned, walls=scenario.walls)
    assert controller.barriers(scenario.start[:2], scenario.people).min() >= 0


@given(seeds)
def test_one_person_in_open_space(seed):
    scenario = ONE_PERSON(seed)
    (person,) = scenario.people
    controller = szlib.MPCCBF(person.zone)
    assert controller.barriers(scenario.start[:2], scenario.people).min() >= 0.3
    assert not scenario.start[2:].any()
    assert np.hypot(*person.velocity) <= 0.5 + 1e-12
    assert not len(scenario.walls)


def test_half_have_walls_and_half_of_the_people_stand():
    worlds = [Worlds()(seed) for seed in range(400)]
    assert np.mean([len(w.walls) > 0 for w in worlds]) == pytest.approx(0.5, abs=0.1)
    assert np.mean([p.stands for w in worlds for p in w.people]) == pytest.approx(
        0.5, abs=0.1
    )


def test_invalid_worlds_are_rejected():
    with pytest.raises(szlib.SolverError, match="no world of seed 3"):
        Worlds(people=(1, 1), size=0.5, travel=(0.1, 0.2), walls=0.0)(3)
    with pytest.raises(szlib.SolverError, match="travel must be a range"):
        Worlds(travel=(3.0, 2.0))
    with pytest.raises(szlib.SolverError, match="standing must be a fraction"):
        Worlds(standing=1.5)
    with pytest.raises(szlib.SolverError, match="noise must be finite and >= 0"):
        Behaviour(noise=-0.1)


WALKER = szlib.Person((0.0, 0.0), (0.5, 0.0))
STANDING = szlib.Person((3.0, 0.0), heading=1.0)
MEETING = szlib.Scenario("meeting", np.zeros(4), np.ones(2), people=(WALKER, STANDING))


@pytest.mark.parametrize(
    ("behaviour", "pace", "turn"),
    [
        (Behaviour(), 0.5, 0.0),
        (Behaviour(pace=2.0), 1.0, 0.0),
        (Behaviour(pace=0.0), 0.0, 0.0),
        (Behaviour(turn=1.0), 0.5, 1.0),
    ],
)
def test_behaviours_change_velocities_without_jumps(behaviour, pace, turn):
    crowd = behaviour.start(MEETING, seed=1)
    paths = [crowd(t, np.zeros(4)) for t in np.linspace(0, 10, 101).tolist()]
    walker, standing = zip(*paths, strict=True)
    assert set(standing) == {STANDING}
    assert walker[0] == WALKER
    assert np.hypot(*walker[-1].velocity) == pytest.approx(pace)
    assert abs(walker[-1].heading) == pytest.approx(turn)
    steps = np.hypot(*np.diff([p.position for p in walker], axis=0).T)
    assert steps.max() <= 0.1 * max(pace, 0.5) + 1e-9


def test_noise_changes_observations_and_not_people():
    rng = np.random.default_rng(0)
    seen = [
        Behaviour(noise=0.1).observe((WALKER,), rng)[0].position for _ in range(2000)
    ]
    assert np.std(seen, axis=0) == pytest.approx([0.1, 0.1], rel=0.1)
    assert Behaviour(noise=0.1).start(MEETING, 0)(2.0, np.zeros(4)) == [
        WALKER.after(2.0),
        STANDING,
    ]
