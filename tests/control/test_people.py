"""People as a sensor measures them: headings, changing ids, time stamps, hidden people, unusable numbers."""

import numpy as np
import pandas as pd
import pytest

import szlib
from szlib.control.controller import advance
from szlib.zones.ellipses import circle_around

ZONE = szlib.Ellipse((0.1, 0.0), (1.0, 0.7), 0.0)
GOAL = (4.0, 0.0)
START = (-4.0, 0.0, 0.0, 0.0)


def positions(seen):
    return [pytest.approx(person.position) for person in seen.people]


def controller_of(**more):
    settings = szlib.MPCSettings(time_limit=np.inf)
    return szlib.MPCCBF(ZONE, settings=settings, **more)


def headings(seen):
    return [person.heading for person in seen.people]


# the zone of a person whose heading is unknown


def test_the_circle_contains_the_zone_in_every_heading_and_touches_it():
    rng = np.random.default_rng(0)
    for _ in range(200):
        a = rng.uniform(0.1, 2)
        zone = szlib.Ellipse(
            tuple(rng.uniform(-1, 1, 2)),
            (a, a * rng.uniform(0.05, 1)),
            rng.uniform(-3, 3),
        )
        circle = circle_around(zone)
        outline = zone.curve(5001)
        assert circle.center == (0, 0) and circle.semi_axes[0] == circle.semi_axes[1]
        assert circle.level(outline).max() == pytest.approx(1, abs=1e-6)
        for heading in rng.uniform(-4, 4, 3):
            assert (
                circle.level(zone.placed((0, 0), heading).curve(500)).max() <= 1 + 1e-9
            )
    assert circle_around(circle).semi_axes == pytest.approx(circle.semi_axes)


def test_a_person_with_unknown_heading_gets_the_circle():
    unknown, controller = szlib.Person((0.0, 0.0)), controller_of()
    assert unknown.heading is None and unknown.stands and unknown.after(1.0) == unknown
    zone = controller.zone_of(unknown)
    assert zone == circle_around(ZONE)
    for angle in np.linspace(-3, 3, 7):
        point = 2.0 * np.array([np.cos(angle), np.sin(angle)])
        expected = szlib.ellipse_distance(point, zone) - 0.55
        assert controller.barriers(point, [unknown]) == pytest.approx(expected)
    assert controller.step((-3, 0.4, 0, 0), GOAL, [unknown]).status == "optimal"
    slow = szlib.Person((0.0, 0.0), (0.1, 0.0), heading_unknown=True)
    assert slow.heading is None and slow.after(1.0).heading is None
    assert szlib.Person((0.0, 0.0), (0.1, 0.0)).heading == 0.0


# headings by id


def test_noise_does_not_turn_the_zone_of_a_standing_person():
    rng, tracker = np.random.default_rng(1), szlib.Tracker()
    walked = tracker.see(
        [[-1.0, 0.0, 0.3, 0.4], [2.0, 2.0, 0.0, 0.0]], ids=["a", "b"], now=0.0
    )
    assert headings(walked) == [pytest.approx(np.arctan2(0.4, 0.3)), None]
    for k in range(1, 1001):
        noisy = np.c_[[[0, 0], [2, 2]], np.zeros((2, 2))] + rng.normal(0, 0.02, (2, 4))
        seen = tracker.see(noisy, ids=["a", "b"], now=0.1 * k)
        assert headings(seen) == headings(walked)
        assert [p.velocity for p in seen.people] == [tuple(row[2:]) for row in noisy]
        assert headings(tracker.see(noisy, now=0.1 * k))[:2] == [None, None], (
            "they are unknown without ids"
        )


def test_the_heading_is_the_direction_of_walking_unless_it_is_given():
    for angle in np.linspace(-3, 3, 13):
        tracker = szlib.Tracker()
        step = 0.2 * np.array([np.cos(angle), np.sin(angle)])
        (person,) = tracker.see([[0, 0, *(1.0001 * step)]], ids=[7], now=0.0).people
        assert person.heading == pytest.approx(angle)
        assert headings(tracker.see([[0, 0, *(0.99 * step)]], ids=[7], now=0.0)) == [
            person.heading
        ]
        assert headings(tracker.see([szlib.Person((0, 0), id=7)], now=0.0)) == [
            person.heading
        ]
        turned = szlib.Person((0, 0), (1.0, 0.0), heading=2.0, id=8)
        assert tracker.see([turned], now=0.0).people[0] == turned
        facing = szlib.Person((0, 0), heading=0.0, id=9)
        assert tracker.see([facing], now=0.0).people[0] == facing
    assert headings(tracker.see([[0, 0, 0, 0]], ids=[7], now=9.0)) == [None], (
        "forgotten meanwhile"
    )


def test_persons_without_id_are_used_unchanged():
    people = (szlib.Person((0, 0), (0.01, 0.02)), szlib.Person((1, 1), heading=1.0))
    assert szlib.Tracker().see(people, now=3.0) == (people, 0, 0, "")


# ids that identify nobody


@pytest.mark.parametrize(
    "ids", [[np.nan], [float("nan")], [np.float64("nan")], [pd.NA]]
)
def test_an_id_that_is_nan_is_no_id(ids):
    tracker = szlib.Tracker()
    for k in range(5):
        assert (
            len(tracker.see([[0.1 * k, 0.0, 1.0, 0.0]], ids=ids, now=0.1 * k).people)
            == 1
        )
    assert tracker.see(now=0.5).people == ()


def test_an_id_that_two_people_have_at_once_is_no_id():
    tracker, rows = szlib.Tracker(), [[0.0, 0.0, 0.0, 0.0], [4.0, 0.0, 1.0, 0.0]]
    for k in range(5):
        seen = tracker.see(rows, ids=["a", "a"], now=0.1 * k)
        assert (
            positions(seen) == [(0.0, 0.0), (4.0, 0.0)]
            and seen.people[0].heading is None
        )
    assert tracker.see([[np.nan] * 4, rows[1]], ids=["a", "a"], now=0.6).unknown == 1


# ids that change


def walk(tracker, make_id, n=60, hide=lambda k: False, noise=0.02):
    """What the tracker knows of a person who walks at 1.2 m/s past another one with the id "b"."""
    rng, found = np.random.default_rng(8), []
    for k in range(n):
        rows = np.array([[0.12 * k, 0.0, 1.2, 0.0], [3.0, 1.0, 0.0, 0.0]])
        rows += rng.normal(0, noise, (2, 4))
        kept = [1] if hide(k) else [0, 1]
        ids = [(make_id(k), "b")[i] for i in kept]
        found.append(tracker.see(rows[kept], ids=ids, now=0.1 * k))
    return found


@pytest.mark.parametrize("frames", [1, 2, 3, 7])
def test_a_person_whose_id_changes_stays_one_person(frames):
    for seen in walk(szlib.Tracker(), lambda k: k // frames):
        assert len(seen.people) == 2 and seen.rejected == seen.unknown == 0
    # hidden in every fifth frame, and then with a new id
    for seen in walk(szlib.Tracker(), lambda k: k // 5, hide=lambda k: k % 5 == 4):
        assert len(seen.people) == 2


def test_a_new_id_keeps_the_heading_of_the_person_who_was_lost():
    tracker = szlib.Tracker()
    tracker.see([[0.0, 0.0, 0.6, 0.8]], ids=["a"], now=0.0)
    heading = np.arctan2(0.8, 0.6)
    for k, name in enumerate("bcd", start=1):
        seen = tracker.see([[0.06, 0.08, 0.01, 0.0]], ids=[name], now=0.1 * k)
        assert headings(seen) == [pytest.approx(heading)]


def test_a_new_id_farther_away_or_beside_a_person_who_is_seen_is_another_person():
    far = szlib.Tracker()
    far.see([[0.0, 0.0, 1.0, 0.0]], ids=["a"], now=0.0)
    seen = far.see([[0.1, 0.51, 1.0, 0.0]], ids=["b"], now=0.1)
    assert len(seen.people) == 2, "0.51 m from where the first one is expected"
    near = szlib.Tracker()
    near.see([[0.0, 0.0, 1.0, 0.0]], ids=["a"], now=0.0)
    rows = [[0.1, 0.0, 1.0, 0.0], [0.1, 0.4, 1.0, 0.0]]
    assert len(near.see(rows, ids=["a", "b"], now=0.1).people) == 2
    assert len(near.see(rows, ids=["b", "c"], now=0.2).people) == 2
    assert len(near.see(rows, ids=["c", "b"], now=0.3).people) == 2


def test_each_lost_person_gives_their_place_to_one_new_id():
    tracker, rows = szlib.Tracker(), [[0.0, 0.0, 0.0, 0.0], [0.0, 0.3, 0.0, 0.0]]
    tracker.see(rows, ids=["a", "b"], now=0.0)
    for k in range(1, 9):
        seen = tracker.see(rows, ids=[f"c{k}", f"d{k}"], now=0.1 * k)
        assert len(seen.people) == 2
    three = [*rows, [0.0, 0.15, 0.0, 0.0]]
    assert len(tracker.see(three, ids=["x", "y", "z"], now=1.0).people) == 3


def test_a_robot_does_not_yield_to_ghosts():
    """With an id that changes every three frames, each step is the one with the true id."""
    controllers = [controller_of(), controller_of()]
    state, person = np.array([-3.0, 0.0, 0.5, 0.0]), np.array([3.0, 0.4, -0.9, 0.0])
    for k in range(50):
        steps = [
            each.step(state, GOAL, person[None], ids=[name])
            for each, name in zip(controllers, ("a", f"a{k // 3}"), strict=True)
        ]
        assert len(steps[1].h) == 1
        assert np.array_equal(steps[0].inputs, steps[1].inputs)
        state = advance(state, steps[0].control, 0.1)
        person[:2] += 0.1 * person[2:]


# time


def test_a_look_that_is_older_than_the_known_one_is_ignored():
    tracker = szlib.Tracker()
    tracker.see([[0.0, 0.0, 1.0, 0.0]], ids=["a"], stamps=5.0, now=5.0)
    late = tracker.see([[-0.5, 0.3, 0.0, 1.0]], ids=["a"], stamps=4.8, now=5.1)
    assert positions(late) == [(0.1, 0.0)] and late[1:] == (0, 0, "")
    assert positions(
        tracker.see([[0.3, 0.0, 1.0, 0.0]], ids=["a"], stamps=5.2, now=5.2)
    ) == [(0.3, 0.0)]


def test_people_are_moved_forward_to_now():
    rng, tracker = np.random.default_rng(2), szlib.Tracker()
    rows, stamps = rng.uniform(-2, 2, (5, 4)), rng.uniform(1.7e9 - 0.5, 1.7e9, 5)
    seen = tracker.see(rows, ids=range(5), stamps=stamps, now=1.7e9)
    assert [p.position for p in seen.people] == [
        pytest.approx(row[:2] + (1.7e9 - t) * row[2:], abs=1e-6)
        for row, t in zip(rows, stamps, strict=True)
    ]
    alone = tracker.see([szlib.Person((0, 0), (1.0, 0.5))], stamps=9.0, now=10.0)
    assert alone.people[0].position == (1.0, 0.5)


def test_people_not_seen_any_more_are_remembered_at_constant_velocity():
    tracker = szlib.Tracker(memory=0.5)
    tracker.see([[0, 0, 1.0, 0], [5, 5, 0, 0.5]], ids=["a", "b"], now=0.0)
    for k in range(1, 6):
        seen = tracker.see([[5, 5, 0, 0.5]], ids=["b"], now=0.1 * k)
        assert [p.id for p in seen.people] == ["b", "a"]
        assert seen.people[1].position == pytest.approx((0.1 * k, 0))
        assert seen.rejected == seen.unknown == 0
    assert [p.id for p in tracker.see([[5, 5, 0, 0.5]], ids=["b"], now=0.6).people] == [
        "b"
    ]
    tracker.reset()
    assert tracker.see(now=0.6).people == ()


def test_without_a_time_each_step_is_dt_after_the_last():
    controller = controller_of(tracker=szlib.Tracker(memory=0.25))
    controller.step((-3, 0, 0, 0), GOAL, [[0, 1, 0.5, 0]], ids=["a"])
    there = [controller.step((-3, 0, 0, 0), GOAL).scene.people for _ in range(3)]
    assert [len(people) for people in there] == [1, 1, 0]
    assert there[1][0].position == pytest.approx((0.1, 1.0))
    stamped = controller.step(
        (-3, 0, 0, 0), GOAL, [[0, 1, 0.5, 0]], ids=["a"], stamps=[49.8], now=50.0
    )
    assert stamped.scene.people[0].position == pytest.approx((0.1, 1.0))


# numbers that are none


BAD = [np.nan, np.inf, -np.inf, 1e300]


@pytest.mark.parametrize("bad", BAD)
def test_known_people_with_bad_numbers_are_moved_forward_and_counted(bad):
    tracker = szlib.Tracker()
    tracker.see([[0, 0, 1.0, 0]], ids=["a"], now=0.0)
    for column in (0, 1):
        row = [0.1, 0, 1.0, 0]
        row[column] = bad
        seen = tracker.see([row], ids=["a"], now=0.2)
        assert (seen.rejected, seen.unknown) == (1, 0)
        assert seen.people[0].position == pytest.approx((0.2, 0))
    seen = tracker.see([[0.3, 0.1, bad, 0]], ids=["a"], now=0.3)
    assert (seen.rejected, seen.unknown) == (1, 0)
    (person,) = seen.people
    assert person.position == pytest.approx((0.3, 0.0)), "rejected as a whole"
    assert person.velocity == (1.0, 0.0)
    seen = tracker.see([[0.3, 0.1, 1, 0]], ids=["a"], stamps=bad, now=0.4)
    assert (seen.rejected, seen.unknown) == (1, 0)
    assert seen.people[0].position == pytest.approx((0.4, 0.0))
    assert tracker.see([[bad] * 4], ids=["a"], now=2.0)[1:] == (1, 1, ""), (
        "too long ago"
    )


@pytest.mark.parametrize("bad", BAD)
def test_the_robot_brakes_if_the_position_of_a_person_is_unknown(bad):
    controller, dt = controller_of(), 0.1
    state = np.array([-4.0, 1.4, 0.9, 0.3])
    assert controller.step(state, GOAL, [[0, 0, 0, 0]]).safe
    for _ in range(15):
        step = controller.step(state, GOAL, [[0, 0, 0, 0], [bad, 0, 0, 0]])
        assert (step.rejected, step.unknown, step.safe) == (1, 1, False)
        assert len(step.h) == 1 and step.h.min() >= 0, "the other one is kept out of"
        state = advance(state, step.control, dt)
    assert np.hypot(*state[2:]) < 0.05
    assert state[0] < -3.5, "hardly farther than full braking, 0.45 m"
    assert controller.step(state, GOAL, [[0, 0, 0, 0]]).safe


def test_a_person_without_usable_velocity_keeps_a_zone_and_counts_as_unknown():
    step = controller_of().step(
        (-3, 0, 0.5, 0), GOAL, [[0, 0, np.nan, np.nan]], ids=["new"]
    )
    assert (step.rejected, step.unknown) == (1, 1) and not step.safe
    assert step.h == pytest.approx(
        controller_of().barriers((-3, 0), [szlib.Person((0, 0))])
    )


def test_with_unknown_people_the_target_is_where_full_braking_ends():
    step = controller_of().step(
        (-3, 1, 0.6, -0.2), GOAL, [[0, 0, np.nan, np.nan]], ids=["new"]
    )
    time = 0.6 / step.scene.settings.a_max
    assert step.target == pytest.approx((-3 + 0.6 * time / 2, 1 - 0.2 * time / 2))


@pytest.mark.parametrize(
    ("people", "more", "message"),
    [
        ([[0, 0, 0]], {}, r"shape \(n, 4\): x, y, vx, vy.*\[\[0, 0, 0\]\]"),
        ([0, 0, 0, 0], {}, r"got \[0, 0, 0, 0\]"),
        ([["a", 0, 0, 0]], {}, "Persons, or numbers"),
        ([[0, 0, 0, 0]], {"ids": [1, 2]}, r"ids .*, one for each; .*\[1, 2\]"),
        (
            [[0, 0, 0, 0]],
            {"stamps": [1, 2], "now": 3},
            r"stamps must be one time .* \[1, 2\]",
        ),
        ([[0, 0, 0, 0]], {"stamps": 1.0}, "now must be given with `stamps`"),
        ([[0, 0, 0, 0]], {"now": np.nan}, "now must be a finite number"),
    ],
)
def test_arguments_of_the_wrong_shape_raise_an_error(people, more, message):
    with pytest.raises(szlib.SolverError, match=message):
        controller_of().step((-4, 0, 0, 0), GOAL, people, **more)


@pytest.mark.parametrize("name", ["memory", "walking_speed"])
@pytest.mark.parametrize("value", [-1, np.inf, np.nan, "one"])
def test_tracker_parameters_must_be_finite_and_not_negative(name, value):
    with pytest.raises(szlib.SolverError, match=f"{name} must be"):
        szlib.Tracker(**{name: value})


# zones that do not hold their person


def test_a_zone_that_does_not_contain_its_person_is_refused():
    for bad in (szlib.Ellipse((50, 0), (1, 0.7)), szlib.Ellipse((0, 0.71), (1, 0.7))):
        with pytest.raises(szlib.ZoneError, match="must contain its person"):
            szlib.MPCCBF(bad)
        with pytest.raises(szlib.ZoneError, match="must contain its person"):
            szlib.Person((0, 0), zone=bad)

        class Fitted:
            def ellipse(self, speed, bad=bad):
                return bad

        with pytest.raises(szlib.ZoneError, match="must contain its person"):
            szlib.MPCCBF(ZONE).step(
                START, GOAL, [szlib.Person((0, 0), heading=0.0, zone=Fitted())]
            )
    for edge in (
        szlib.Ellipse((0, 0.7), (1, 0.7)),
        szlib.Ellipse((0, 0), (0.05, 0.05)),
    ):
        assert szlib.MPCCBF(edge).zone == edge


# arrays


@pytest.mark.parametrize("side", ["right", "left"])
def test_head_on_rule_holds_for_people_given_as_arrays(side):
    settings = szlib.MPCSettings(pass_side=side)
    controller = szlib.MPCCBF(ZONE, settings=settings)
    by_persons = szlib.MPCCBF(ZONE, settings=settings)
    state, person = np.array([-4.0, 0.0, 0.0, 0.0]), np.array([2.0, 0.0, -0.5, 0.0])
    passed = None
    for _ in range(250):
        step = controller.step(state, GOAL, person[None], ids=[3])
        same = by_persons.step(
            state, GOAL, [szlib.Person(tuple(person[:2]), tuple(person[2:]))]
        )
        assert np.array_equal(step.control, same.control)
        assert step.safe
        state, person = (
            advance(state, step.control, 0.1),
            person + 0.1 * np.r_[person[2:], 0, 0],
        )
        if passed is None and state[0] > person[0]:
            passed = state[1]
    assert (passed > 0) == (side == "left")
    assert state[:2] == pytest.approx(GOAL, abs=0.1)


def test_a_person_met_head_on_is_passed_despite_noise():
    rng, controller = np.random.default_rng(4), controller_of()
    state, person = np.array([-4.0, 0.0, 0.0, 0.0]), np.array([2.0, 0.0, -0.5, 0.0])
    for k in range(300):
        if k == 60:
            person[2:] = 0.0
        step = controller.step(
            state, GOAL, [person + rng.normal(0, 0.02, 4)], ids=["a"]
        )
        assert np.abs(step.control).max() <= 1
        state, person = (
            advance(state, step.control, 0.1),
            person + 0.1 * np.r_[person[2:], 0, 0],
        )
    assert state[:2] == pytest.approx(GOAL, abs=0.1)


# a person on the goal


def test_a_person_standing_on_the_goal_blocks_it_despite_noise():
    rng, controller = np.random.default_rng(5), controller_of()
    assert all(
        controller.step(
            (-3, 0, 0, 0), GOAL, [np.r_[GOAL, rng.normal(0, 0.02, 2)]]
        ).goal_blocked
        for _ in range(200)
    )
    assert not controller.step((-3, 0, 0, 0), GOAL, [[*GOAL, 0.1, 0.0]]).goal_blocked


@pytest.mark.parametrize("ids", [[[]], [{}], 5, [np.zeros(2)]])
def test_ids_that_have_no_hash_are_refused(ids):
    with pytest.raises(
        szlib.SolverError, match="ids must be a list of hashable values"
    ):
        szlib.Tracker().see([[0.0, 0.0, 0.0, 0.0]], now=0.0, ids=ids)


@pytest.mark.parametrize(
    "now", [np.nan, np.inf, "x", None, [], [1.0], 10**400, np.zeros(2)]
)
def test_now_that_is_no_finite_number_is_refused(now):
    with pytest.raises(szlib.SolverError, match="now must be"):
        szlib.Tracker().see([[0.0, 0.0, 0.0, 0.0]], now=now)


@pytest.mark.parametrize("stamps", ["x", {}, [[1.0], []], 10**400])
def test_stamps_that_are_no_numbers_are_refused(stamps):
    rows = [[0.0, 0.0, 0.0, 0.0]]
    with pytest.raises(szlib.SolverError, match="stamps must be"):
        szlib.Tracker().see(rows, now=0.0, stamps=stamps)
    controller = szlib.MPCCBF(ZONE)
    with pytest.raises(szlib.SolverError, match="stamps must be"):
        controller.step((0, 0, 0, 0), GOAL, rows, now=0.0, stamps=stamps)


def test_masked_numbers_of_a_measurement_are_missing():
    rows = np.ma.array([[1.0, 1.0, 0.0, 0.0], [2.0, 0.0, 0.0, 0.0]])
    rows[0, 0] = np.ma.masked
    seen = szlib.Tracker().see(rows, now=0.0)
    assert (seen.rejected, seen.unknown, len(seen.people)) == (1, 1, 1)


@pytest.mark.parametrize(
    "people", [None, 5, "abcd", [[10**400] * 4], [[1.0], [1.0, 2.0]]]
)
def test_people_that_are_no_rows_are_refused(people):
    with pytest.raises(szlib.SolverError, match="people"):
        szlib.Tracker().see(people, now=0.0)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"position": (0, np.nan), "heading": 0.0}, "position must be finite"),
        ({"position": (0, 0), "velocity": (np.inf, 0)}, "velocity must be finite"),
        ({"position": (0, 0, 0), "heading": 0.0}, "position must have shape"),
        ({"position": (0, 0), "heading": np.nan}, "heading must be finite"),
        ({"position": (1e155, 0), "heading": 0.0}, "position must lie within"),
        ({"position": (0, 0), "velocity": (0, -1e155)}, "velocity must lie within"),
    ],
)
def test_a_person_with_unusable_numbers_raises_an_error(arguments, message):
    with pytest.raises(szlib.SolverError, match=message):
        szlib.Person(**arguments)


def test_a_group_that_is_no_name_is_refused():
    with pytest.raises(szlib.SolverError, match=r"a group must be hashable.*\[1\]"):
        szlib.Person((0.0, 0.0), group=[1])


def test_a_tracker_that_was_reset_is_as_a_new_one():
    """The time between its steps is forgotten, too: a clock that goes back is taken to go on by it."""
    found = []
    for earlier in ((), (10.0, 10.5)):
        tracker = szlib.Tracker()
        for now in earlier:
            tracker.see([], now=now)
        tracker.reset()
        tracker.see([[0.0, 0.0, 1.0, 0.0]], ids=["a"], now=0.0)
        found.append(tracker.see([], ids=[], now=-5.0).people[0].position)
    assert found[0] == found[1]
