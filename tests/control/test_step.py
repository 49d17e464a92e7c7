"""What a step says of itself: clearance, what "safe" covers, its words, and what helps."""

from itertools import islice

import numpy as np
import pytest
import shapely
from helpers.random_states import ZONE, questions

import szlib
from szlib.control import Priority
from szlib.control.controller import advance
from szlib.simulation.closed_loop import LoopSettings, drive
from szlib.zones.ellipses import BODY_RADIUS

GOAL = (4.0, 0.0)
FACING = szlib.Person((0.0, 0.0), heading=np.pi)
SMALL = szlib.Ellipse((0.0, 0.0), (0.3, 0.3))


def controller_of(walls=(), **settings):
    chosen = szlib.MPCSettings(**{"time_limit": np.inf} | settings)
    return szlib.MPCCBF(ZONE, walls=walls, settings=chosen)


# clearance, and what "safe" covers


def test_clearance_equals_the_gap_that_shapely_computes():
    for question in islice(questions(seed=21), 40):
        step = question.ask(szlib.MPCSettings(time_limit=np.inf))
        for k, (x, y) in enumerate(step.predicted[:, :2]):
            robot, here = (
                shapely.Point(x, y),
                [p.after(0.1 * k).position for p in question.people],
            )
            gaps = [robot.distance(shapely.Point(p)) - BODY_RADIUS for p in here]
            gaps += [
                robot.distance(shapely.LineString(wall)) for wall in question.walls
            ]
            assert step.clearance[:, k] == pytest.approx(np.array(gaps) - 0.5, abs=1e-9)


def end_of_wall(margin):
    """A robot that is sent past the end of a wall of 1 m, 13 cm nearer than its disc allows."""
    wall = np.array([[(0.0, -1.0), (0.0, 0.0)]])
    scenario = szlib.Scenario(
        "end", np.array([-3.0, 0.4, 0, 0]), np.array([3.0, 0.4]), walls=wall
    )
    return drive(
        scenario,
        controller_of(walls=wall, margin=margin, gamma=0.5, N_h=8, guard=False),
        LoopSettings(until_arrival=False),
    )


def test_only_the_margin_of_the_paper_lets_the_disc_touch_the_end_of_a_short_wall():
    paper = end_of_wall("paper")
    for careful in map(end_of_wall, ("euclidean", "required")):
        assert careful.clearance.min() >= -1e-6
        assert careful.h.min() >= -1e-6
    assert paper.clearance.min() < -0.02
    assert paper.h.min() >= -1e-6


def test_a_step_into_an_overlap_is_not_safe_although_every_barrier_holds():
    log = end_of_wall("paper")
    overlaps = log.clearance.min(axis=1) < -1e-6
    assert overlaps.any()
    assert not (log.safe[:-1] & overlaps[1:]).any()
    assert log.metrics()["unflagged_overlaps"] == 0
    assert log.metrics()["min_clearance_walls"] == pytest.approx(log.clearance.min())


def test_a_zone_smaller_than_the_body_does_not_make_an_overlap_safe():
    person = szlib.Person(
        (0.0, 0.0), heading=0.0, zone=szlib.Ellipse((0.0, 0.0), (0.05, 0.05))
    )
    step = controller_of().step((0.62, 0.0, 0.0, 0.0), (5.0, 0.0), [person])
    assert step.feasible and step.h[0] >= 0
    assert step.clearance[0, 0] == pytest.approx(0.62 - 0.5 - BODY_RADIUS)
    assert not step.safe


# whatever people do


def test_a_goal_where_a_person_stands_sets_goal_blocked_and_raises_nothing():
    controller = controller_of()
    assert not controller.step((-3, 0.5, 0.8, 0), GOAL, [FACING]).goal_blocked
    step = controller.step((-2.92, 0.5, 0.8, 0), (0.3, 0.2), [FACING])
    assert step.goal_blocked and np.abs(step.control).max() <= 1
    walker = szlib.Person((0.0, 0.0), (0.1, 0.0))
    assert not controller.step((-2.9, 0.5, 0.8, 0), (0.3, 0.2), [walker]).goal_blocked
    state = np.array([-4.0, 0.5, 0.3, 0.0])
    for _ in range(200):
        step = controller.step(state, (0.3, 0.2), [FACING])
        assert step.goal_blocked and step.safe
        state = advance(state, step.control, 0.1)
    assert np.hypot(*state[2:]) < 1e-2, "it waits"


def test_a_robot_on_the_focus_of_a_zone_to_the_last_digit_gets_a_control():
    person = szlib.Person(
        (0.0, 0.0), heading=0.0, zone=szlib.Ellipse((0.0, 0.0), (0.8, 0.8))
    )
    step = controller_of().step((1e-170, 0.0, 0.0, 0.0), GOAL, [person])
    assert np.isfinite(step.control).all() and not step.safe


# between the samples


def fast_meetings(seed, count):
    """Robots and people who come at up to 8 m/s, at dt = 0.5 s; and the step, with its least true gap."""
    rng = np.random.default_rng(seed)
    settings = szlib.MPCSettings(
        dt=0.5, v_max=3.0, a_max=3.0, N=4, eps=0.0, time_limit=np.inf
    )
    controller = szlib.MPCCBF(SMALL, settings=settings, walls=[[(-9, 6), (9, 6)]])
    for _ in range(count):
        angle, way = rng.uniform(-np.pi, np.pi), rng.uniform(0, 8)
        velocity = way * np.array([np.cos(angle), np.sin(angle)])
        middle = rng.uniform(-1.5, 1.5, 2)
        person = szlib.Person(
            tuple(middle - rng.uniform(0, 0.5) * velocity), tuple(velocity)
        )
        state = np.r_[0.0, rng.uniform(-1, 5.4), rng.uniform(-1.5, 1.5, 2)]
        controller.reset()
        step = controller.step(state, (9.0, 0.0), [person])
        t = np.linspace(0, 0.5, 501)[:, None]
        path = state[:2] + t * state[2:] + t**2 / 2 * step.control
        body = (
            np.hypot(*(path - person.position - t * velocity).T).min()
            - BODY_RADIUS
            - 0.5
        )
        yield step, min(body, 6 - path[:, 1].max() - 0.5)


def test_a_safe_step_covers_the_closest_approach_between_samples():
    n_safe = n_free = n_tunnelled = 0
    for step, gap in fast_meetings(seed=3, count=200):
        report = step.verify()
        assert report.ok and not (report.safe and gap < -1e-6)
        assert not step.safe or gap >= 0
        n_safe += step.safe
        ends = step.clearance[:, :2].min() >= 0 and step.feasible and step.h.min() >= 0
        n_free += ends and gap >= 0.2
        n_tunnelled += ends and gap < 0
    assert n_tunnelled >= 5, "people who pass through the robot between two samples"
    assert n_safe >= 0.95 * n_free > 50, "the bound is tight"


def test_a_robot_that_slides_along_a_wall_or_touches_it_at_rest_is_safe():
    wall = [(-20.0, -0.56), (20.0, -0.56)]
    controller = szlib.MPCCBF(ZONE, walls=[wall])
    assert controller.step((0.0, 0.0, 1.0, 0.0), (9.0, 0.0)).safe
    touching = szlib.MPCCBF(
        ZONE, walls=[[(-20.0, -0.5), (20.0, -0.5)]], settings=szlib.MPCSettings(eps=0.0)
    )
    assert touching.step((0.0, 0.00625, 0.0, 0.0), (0.0, 0.00625)).safe


# violations, and what helps


def test_violations_are_those_of_each_priority():
    """A robot between a person and a wall: by the formulas of `planner`, from its plan."""
    wall = [[(-9.0, -0.9), (9.0, -0.9)]]
    controller = controller_of(walls=wall, N_h=8)
    step = controller.step((-1.7, 0.0, 0.8, -0.3), GOAL, [FACING])
    s, x = step.scene.settings, step.predicted
    h = np.array([controller.barriers(each[:2], [FACING]) for each in x]).T
    keep = 1 - s.a_max * s.dt / s.v_max
    decay = max(0.0, -(h[:, 1:] - (1 - s.gamma) * h[:, :-1]).min())
    body = np.hypot(*x[1:, :2].T).min() - BODY_RADIUS - s.r_robot
    expected = {
        Priority.WALL: max(0.0, -(h[1, 1:] - keep * h[1, :-1]).min()),
        Priority.BODY: max(0.0, -body),
        Priority.ZONE: max(0.0, -h[0, 1:].min()),
        Priority.DECAY: decay,
    }
    assert step.violations == pytest.approx(expected, abs=1e-12)
    assert step.slack == pytest.approx(decay) and decay > 1e-3


@pytest.mark.parametrize(
    ("state", "goal", "settings", "helps"),
    [
        ((-1.9, 0.0, 1.0, 0.0), GOAL, {}, "brake earlier: a gamma below 0.05"),
        ((-4.0, 0.0, 1.4, 0.0), GOAL, {}, "start at v_max = 1 m/s or slower"),
        ((-4.0, 1.3, 0.0, 1.0), GOAL, {}, "start slower"),
        ((-4.0, 0.0, 0.0, 0.0), (0.0, 2.1), {}, "another goal"),
        ((-0.9, 0.1, 0.9, 0.0), GOAL, {}, "a larger body_gap or a lower v_max"),
        (
            (-1.7, 0.1, 0.9, 0.0), GOAL,
            {"decay_price": 10.0, "body_gap": 0.2, "N_h": 8}, "a decay_price above 10",
        ),
    ],
)  # fmt: skip
def test_explain_says_what_would_help(state, goal, settings, helps):
    step = controller_of(walls=[[(-9.0, 2.2), (9.0, 2.2)]], **settings).step(
        state, goal, [FACING]
    )
    said = step.explain()
    assert "what helps: " in said and helps in said, said


def test_explain_tells_a_zone_that_is_crossed_from_an_overlap():
    settings = {"dt": 0.5, "gamma": 1.0, "guard": False}
    person = szlib.Person((0.0, 0.0), (-0.635, 0.0))
    step = controller_of(**settings).step(
        (-1.4, -0.86, 0.166, -0.672), (3.408, 2.094), [person]
    )
    assert not step.safe and step.clearance[:, :2].min() > 0.1
    assert "may enter a zone on its way" in step.explain()
    hit = szlib.Person((0.0, 0.0), (8.0, 0.0), zone=SMALL)
    step = controller_of(dt=0.5, guard=False).step((2, 0, 0, 0), (2, 0), [hit])
    assert step.h.min() > 0 and "may overlap a body or a wall" in step.explain()


def test_explain_names_no_people_where_only_a_wall_is_unsafe():
    controller = controller_of(walls=[[(0.8, -3.0), (0.8, 3.0)]])
    step = controller.step((0, 0, 1, 0), (5, 0), [szlib.Person((-30.0, 0.0))])
    assert not step.walls_safe and not step.passively_safe
    said = step.explain()
    assert "cannot stop before a wall" in said and "somebody" not in said


def test_explain_of_a_robot_without_progress_names_what_holds_it_and_what_helps():
    wall = [[(3, -1), (3, 4)]]
    plain = controller_of(walls=wall)
    state = np.array([-1.0, 1.0, 0.0, 0.0])
    for _ in range(250):
        step = plain.step(state, (6.0, 1.0))
        state = advance(state, step.control, 0.1)
    said = step.explain()
    assert "held by wall 0 (3, -1, 3, 4); what helps: among_people()" in said
    settings = szlib.MPCSettings.among_people(time_limit=np.inf)
    advised = szlib.MPCCBF(ZONE, walls=wall, settings=settings)
    for _ in range(130):
        step = advised.step(state, (6.0, 1.0))
        state = advance(state, step.control, 0.1)
    assert state[:2] == pytest.approx((6.0, 1.0), abs=0.1), "and that helps"


def test_a_step_is_one_line():
    step = controller_of().step((-4, 0, 0, 0), GOAL, [FACING])
    assert repr(step).startswith("Step(optimal, safe, control=(") and "\n" not in repr(
        step
    )


def test_steps_are_compared_as_objects():
    controller = controller_of()
    steps = [controller.step((-4, 0, 0, 0), GOAL, [FACING]) for _ in range(2)]
    assert steps[0] == steps[0] and steps.index(steps[1]) == 1 and len({*steps}) == 2


def test_a_wall_is_named_to_the_millimetre_on_any_map():
    base = np.array([500123.4, 4001234.5])
    wall = base + np.array([(1.0, -2.0), (1.0, 2.0)])
    step = controller_of(walls=[wall]).step((*base, 0, 0), base - (3, 0))
    name = "wall 0 (500124.4, 4001232.5, 500124.4, 4001236.5)"
    assert f"nearest is {name}: h" in step.explain()
