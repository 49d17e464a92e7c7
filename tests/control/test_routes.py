"""Routes, as short as they can be and free of walls; and the target beside people who are met head-on."""

from __future__ import annotations

import copy
from math import asin, atan2, cos, pi, sin
from typing import Any

import numpy as np
import pytest
import shapely
from scipy.sparse.csgraph import dijkstra

import szlib
from szlib.checks import Array
from szlib.control import Obstacles, Wall, Zone, find_route
from szlib.control.routes import find_boxes, find_target
from szlib.control.verification import find_safe_boundary

AHEAD = szlib.MPCSettings(lookahead=4.0, time_limit=np.inf)
PLAIN = szlib.MPCSettings(time_limit=np.inf)
ROOM = [(-3.0, -3.0), (3.0, -3.0), (3.0, 3.0), (-3.0, 3.0), (-3.0, -3.0)]
BAR = [[(0.0, -2.0), (0.0, 2.0)]]
ZONE = szlib.Ellipse((0.1, 0.0), (1.0, 0.7))
START = (-3.0, 0.0, 0.0, 0.0)


def random_walls(rng: np.random.Generator, n: int) -> Array:
    middle, angle, half = (
        rng.uniform(-4, 4, (n, 2)),
        rng.uniform(0, np.pi, n),
        rng.uniform(0.5, 3, n),
    )
    along = half[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    return np.stack([middle - along, middle + along], axis=1)


def length(route: Array) -> float:
    return float(np.hypot(*np.diff(route, axis=0).T).sum()) if len(route) else np.inf


def shortest(start: Array, goal: Array, boxes: shapely.Geometry) -> float:
    """Length of the shortest way, from all pairs of all corners of the union of the boxes."""
    points = np.array([start, goal, *shapely.get_coordinates(boxes)])
    lines = shapely.linestrings(
        np.stack(np.broadcast_arrays(points[:, None], points[None]), axis=2)
    )
    free = ~shapely.intersects(boxes.buffer(-1e-6, join_style="mitre"), lines)
    return float(dijkstra(np.where(free, shapely.length(lines), 0.0), indices=0)[1])


def drive(
    controller: szlib.MPCCBF, goal: tuple[float, float], steps: int, **more: object
) -> list[szlib.Step]:
    state, taken = np.array(START), list[szlib.Step]()
    for _ in range(steps):
        taken.append(controller.step(state, goal, **more))
        state = szlib.control.advance(state, taken[-1].control, 0.1)
    return taken


def test_routes_are_free_of_walls_and_as_short_as_they_can_be() -> None:
    rng, compared, around = np.random.default_rng(0), 0, 0
    for _ in range(40):
        walls, (start, goal) = (
            random_walls(rng, int(rng.integers(1, 7))),
            rng.uniform(-5, 5, (2, 2)),
        )
        boxes = shapely.union_all(
            [shapely.LineString(w).buffer(0.5, cap_style="square") for w in walls]
        )
        if shapely.contains_xy(boxes, *np.transpose([start, goal])).any():
            continue
        route = find_route(start, goal, walls, clearance=0.5)
        assert length(route) == pytest.approx(shortest(start, goal, boxes), abs=0.05)
        if len(route):
            assert (route[[0, -1]] == [start, goal]).all()
            assert not shapely.LineString(route).intersects(
                boxes.buffer(-1e-6, join_style="mitre")
            )
        compared, around = compared + 1, around + (len(route) > 2)
    assert compared > 15 and around > 5


def test_a_box_is_the_smallest_around_the_unsafe_side_of_a_barrier() -> None:
    for size in (0.05, 0.4, 1.0, 2.0, 8.0):
        wall, ends, s = Wall(0.0, 0.0, size, 0.0), [(0.0, 0.0), (size, 0.0)], AHEAD
        edge = find_safe_boundary(ends, 0.5 + wall.margin(s), n=200_001)
        reach = np.abs(edge - (size / 2, 0.0)).max(axis=0)
        assert find_boxes([wall], s)[0] == pytest.approx(reach, rel=1e-4)


def test_a_start_beside_a_wall_leaves_its_box_but_not_across_the_wall() -> None:
    beside, behind = (-0.2, 0.0), (3.0, 0.0)
    route = find_route(beside, behind, BAR, clearance=0.5)
    assert not shapely.LineString(route).intersects(shapely.LineString(BAR[0]))
    assert length(route) > 5.0
    assert len(find_route(beside, (-3.0, 0.0), BAR, clearance=0.5)) == 2
    assert len(find_route((-3.0, 0.0), beside, BAR, clearance=0.5)) == 2


def test_a_robot_goes_around_a_wall_only_with_a_finite_lookahead() -> None:
    controller = szlib.MPCCBF(ZONE, walls=BAR, settings=AHEAD)
    steps = drive(controller, (3.0, 0.5), 120)
    assert np.hypot(*(steps[-1].predicted[0, :2] - (3.0, 0.5))) < 0.1
    assert all(step.safe and step.verify().ok for step in steps)
    assert (
        max(np.hypot(*(step.target - step.predicted[0, :2])) for step in steps)
        <= 4.0 + 1e-9
    )
    assert np.max([np.hypot(*step.control) for step in steps]) > 0.5
    plain = szlib.MPCCBF(ZONE, walls=BAR, settings=PLAIN)
    stuck = drive(plain, (3.0, 0.5), 120)[-1]
    assert stuck.predicted[0, 0] < 0 and (stuck.target == (3.0, 0.5)).all()


def test_without_walls_a_finite_lookahead_only_shortens_the_way_ahead() -> None:
    step = szlib.MPCCBF(ZONE, settings=AHEAD).step(START, (7.0, 0.0))
    assert step.target == pytest.approx((1.0, 0.0)) and step.way_length == 10.0
    step = szlib.MPCCBF(ZONE, settings=AHEAD).step(START, (0.5, 0.0))
    assert step.target == pytest.approx((0.5, 0.0))


def test_the_target_is_always_in_sight() -> None:
    rng, around = np.random.default_rng(1), 0
    for _ in range(30):
        walls = random_walls(rng, 5)
        at, goal = rng.uniform(-5, 5, (2, 2))
        controller = szlib.MPCCBF(ZONE, walls=walls, settings=AHEAD)
        if controller.barriers(at).min() < 0.1 or controller.goal_blocked(goal):
            continue
        step = controller.step((*at, 0.0, 0.0), goal)
        if step.way_length < np.inf:
            line = shapely.LineString([at, step.target])
            assert all(not line.intersects(shapely.LineString(wall)) for wall in walls)
            around += step.way_length > np.hypot(*(goal - at)) + 0.01
    assert around > 3


def test_the_rule_of_the_side_acts_on_the_point_ahead() -> None:
    person = szlib.Person((0.0, 0.0), (-0.5, 0.0))
    straight = szlib.MPCCBF(ZONE, settings=AHEAD).step(START, (20.0, 0.0))
    met = szlib.MPCCBF(ZONE, settings=AHEAD).step(START, (20.0, 0.0), [person])
    assert straight.target[1] == 0 and met.target[1] < -0.1
    assert np.hypot(*(met.target - START[:2])) == pytest.approx(4.0)


def test_a_closed_room_has_no_route_and_the_step_says_so() -> None:
    assert find_route((0.0, 0.0), (8.0, 0.0), ROOM, clearance=0.5).shape == (0, 2)
    step = szlib.MPCCBF(ZONE, walls=ROOM, settings=AHEAD).step(
        (0.0, 0.0, 0.0, 0.0), (8.0, 0.0)
    )
    assert step.way_length == np.inf and "no way to the goal" in step.explain()
    assert (step.target == (8.0, 0.0)).all() and not step.goal_blocked


def test_a_users_route_is_followed_to_the_goal() -> None:
    detour = [(-3.0, 0.0), (-3.0, -4.0), (3.0, -4.0), (3.0, 0.0)]
    for settings in (AHEAD, PLAIN, szlib.MPCSettings(lookahead=1.5)):
        controller = szlib.MPCCBF(ZONE, walls=BAR, settings=settings)
        steps = drive(controller, (3.0, 0.5), 200, route=detour)
        places = np.array([step.predicted[0, :2] for step in steps])
        assert np.hypot(*(places[-1] - (3.0, 0.5))) < 0.1
        assert places[:, 1].min() < -2.5  # it takes the side that the route takes
    assert steps[0].way_length == pytest.approx(4 + 6 + 4 + 0.5)


def test_a_route_out_of_sight_is_replaced_by_an_own_one() -> None:
    controller = szlib.MPCCBF(ZONE, walls=BAR, settings=AHEAD)
    behind = controller.step(
        (-1.0, 0.0, 0.0, 0.0), (3.0, 0.5), route=[(2.0, 0.5), (2.5, 0.5)]
    )
    own = szlib.MPCCBF(ZONE, walls=BAR, settings=AHEAD).step(
        (-1.0, 0.0, 0.0, 0.0), (3.0, 0.5)
    )
    assert (behind.target == own.target).all()


def test_a_copy_takes_the_same_steps_and_a_reset_forgets_the_route() -> None:
    controller = szlib.MPCCBF(ZONE, walls=BAR, settings=AHEAD)
    first = drive(controller, (3.0, 0.0), 5)
    copied = copy.copy(controller)
    state = (-0.8, 0.3, 0.0, 0.0)
    assert (
        controller.step(state, (3.0, 0.0)).target
        == copied.step(state, (3.0, 0.0)).target
    ).all()
    controller.reset()
    again = drive(controller, (3.0, 0.0), 5)
    assert all(
        (a.control == b.control).all() for a, b in zip(first, again, strict=True)
    )


def test_new_walls_and_a_new_goal_give_a_new_route() -> None:
    controller = szlib.MPCCBF(ZONE, walls=BAR, settings=AHEAD)
    assert controller.step(START, (3.0, 0.0)).way_length > 6.5
    assert controller.step(START, (-3.0, 3.0)).way_length == pytest.approx(3.0)
    controller.set_walls([])
    assert controller.step(START, (3.0, 0.0)).way_length == pytest.approx(6.0)


def test_a_route_that_is_none_is_refused() -> None:
    with pytest.raises(szlib.SolverError, match="route"):
        szlib.MPCCBF(ZONE).step(START, (3.0, 0.0), route=[1.0, 2.0, 3.0])
    with pytest.raises(szlib.SolverError, match="clearance"):
        find_route((0.0, 0.0), (1.0, 0.0), BAR, clearance=-1.0)


# --- people who are met head-on ---------------------------------------------------------------------

CIRCLE = szlib.Ellipse((0.0, 0.0), (0.7, 0.7))


def place(person: szlib.Person, zone: szlib.Ellipse) -> tuple[float, ...]:
    return Zone.place(zone, person.position, person.heading or 0.0, person.velocity)


def stand_still(rows: Any, settings: szlib.MPCSettings) -> Obstacles:
    """Walls (xa, ya, xb, yb)."""
    return Obstacles.of([Wall(*row) for row in rows], settings)


STANDING = place(szlib.Person((0.0, 0.0), heading=pi), CIRCLE)
ROBOT = (-3.0, 0.0)


def find_turn(bearing: float, settings: szlib.MPCSettings) -> float:
    """Angle from the goal, 8 m away at a `bearing`, to the target [rad], both seen from the robot."""
    goal = (ROBOT[0] + 8 * cos(bearing), ROBOT[1] + 8 * sin(bearing))
    x, y = find_target(ROBOT, goal, [STANDING], stand_still([], settings), settings)
    assert np.hypot(x - ROBOT[0], y - ROBOT[1]) == pytest.approx(8), (
        "as far away as the goal"
    )
    return atan2(y - ROBOT[1], x - ROBOT[0]) - bearing


def half_angle(settings: szlib.MPCSettings) -> float:
    """Half the angle under which the robot sees the set h < 0 of a round zone."""
    return asin((0.7 + settings.r_robot + settings.eps) / 3)


@pytest.mark.parametrize("share", [0.1, 0.25, 0.5])
@pytest.mark.parametrize(("side", "sign"), [("right", -1), ("left", 1)])
def test_the_target_lies_along_the_tangent_and_turns_back_without_a_jump(
    side, sign, share
):
    settings = szlib.MPCSettings(pass_side=side, head_on_share=share)
    w = half_angle(settings)
    leads = np.linspace(-0.999, 2.5, 400)
    turns = sign * np.array(
        [find_turn(sign * lead * share * w, settings) for lead in leads]
    )
    expected = (w - leads * share * w) * np.clip(2 - leads, 0, 1)
    assert turns == pytest.approx(expected, abs=1e-9)
    assert np.abs(np.diff(turns)).max() < 2 * w * (leads[1] - leads[0]), (
        "without a jump"
    )


def test_the_robot_passes_on_the_other_side_if_the_goal_lies_there() -> None:
    settings = szlib.MPCSettings(pass_side="right")
    limit = settings.head_on_share * half_angle(settings)
    assert find_turn(0.99 * limit, settings) < 0 < find_turn(1.01 * limit, settings)
    assert find_turn(2.01 * limit, settings) == pytest.approx(0)


def test_a_person_who_walks_across_does_not_hide_one_ahead() -> None:
    across = place(szlib.Person((-1.0, -3.0), (0.0, 1.0)), CIRCLE)
    s = szlib.MPCSettings(head_on_share=0.25)
    empty = stand_still([], s)
    alone = find_target(ROBOT, (5.0, 0.0), [STANDING], empty, s)
    assert (
        find_target(ROBOT, (5.0, 0.0), [across, STANDING], empty, s)
        == alone
        != (5.0, 0.0)
    )


@pytest.mark.parametrize("side", ["right", "left"])
@pytest.mark.parametrize("walls", [(), (-1.6,), (1.6,), (-2.2, 2.2), (-1.6, 1.6)])
def test_the_target_moves_and_turns_with_the_scene(side, walls):
    settings = szlib.MPCSettings(pass_side=side)
    zone = szlib.Ellipse((0.1, 0.05), (0.8, 0.6), 0.3)

    def find(angle, shift):
        def move(x, y):
            return x * cos(angle) - y * sin(angle) + shift[0], x * sin(angle) + y * cos(
                angle
            ) + shift[1]

        person = szlib.Person(move(0.0, 0.0), heading=pi + angle)
        rows = [(*move(-9.0, y), *move(9.0, y)) for y in walls]
        fixed = stand_still(rows, settings)
        robot, goal = move(*ROBOT), move(5.0, 0.0)
        x, y = np.subtract(
            find_target(robot, goal, [place(person, zone)], fixed, settings), shift
        )
        return x * cos(angle) + y * sin(angle), y * cos(angle) - x * sin(angle)

    expected = find(0.0, (0.0, 0.0))
    assert find(0.0, (30.0, -20.0)) == pytest.approx(expected)
    assert find(2.3, (-4.0, 7.0)) == pytest.approx(expected)
    free = {"right": -1.6 not in walls, "left": 1.6 not in walls}
    other = "left" if side == "right" else "right"
    passed = side if free[side] else other if free[other] else "none"
    assert np.sign(expected[1]) == {"right": -1, "left": 1, "none": 0}[passed]


@pytest.mark.parametrize("turned", [0.0, pi / 2])
@pytest.mark.parametrize(("more", "is_free"), [(-0.01, False), (0.01, True)])
def test_a_side_is_free_if_the_robot_fits_between_the_zone_and_the_wall(
    turned, more, is_free
):
    """Beside the set h < 0 of an ellipse the robot's disc needs its radius and the wall's margin."""
    settings = szlib.MPCSettings(pass_side="right")
    zone = szlib.Ellipse((0.0, 0.0), (1.0, 0.6), turned)
    person = place(szlib.Person((0.0, 0.0), heading=pi), zone)
    reach = 1.0 + settings.r_robot + settings.eps
    widest = reach if turned else np.sqrt(reach**2 - 1.0**2 + 0.6**2)
    y = -(widest + settings.r_robot + settings.eps + more)
    wall = stand_still([(-50.0, y, 50.0, y)], settings)
    target = find_target(ROBOT, (4.0, 0.0), [person], wall, settings)
    assert (target[1] < 0) == is_free
    assert target[1] != 0, "otherwise it passes on the left"


@pytest.mark.parametrize("end", [-1.89, -1.91])
@pytest.mark.parametrize("shift", [0.0, 0.5, -7.3])
def test_a_wall_that_just_reaches_into_the_space_makes_the_side_not_free(end, shift):
    """A wall 1 m long, end on; 1.4 m beside the person's centre the disc passes 0.5 m from it."""
    settings = szlib.MPCSettings(pass_side="right")
    zone = szlib.Ellipse((0.0, 0.0), (0.85, 0.85))
    person = place(szlib.Person((shift, shift), heading=pi), zone)
    wall = (shift - 0.05, shift + end, shift - 0.05, shift + end - 1.0)
    target = find_target(
        (shift - 3.0, shift),
        (shift + 4.0, shift),
        [person],
        stand_still([wall], settings),
        settings,
    )
    assert (target[1] > shift) == (end == -1.89)
