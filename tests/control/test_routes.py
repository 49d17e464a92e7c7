"""Routes: as short as they can be, free of walls, followed by the robot, and quick."""

from __future__ import annotations

import copy
from dataclasses import replace

import numpy as np
import pytest
import shapely
from scipy.sparse.csgraph import dijkstra
from szlib.control.obstacles import compute_h
from szlib.control.verification import find_safe_boundary, walls_with_margins

import szlib
from szlib.checks import Array
from szlib.control import find_route
from szlib.control.routes import find_boxes

AHEAD = szlib.MPCSettings(lookahead=4.0)
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
        (row,) = walls_with_margins(
            np.array([[(0.0, 0.0), (size, 0.0)]]), szlib.MPCSettings()
        )
        edge = find_safe_boundary([row[:2], row[2:4]], 0.5 + row[4], n=200_001)
        reach = np.abs(edge - (size / 2, 0.0)).max(axis=0)
        assert find_boxes([row], 0.5)[0] == pytest.approx(reach, rel=1e-4)


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
    stuck = drive(szlib.MPCCBF(ZONE, walls=BAR), (3.0, 0.5), 120)[-1]
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
        rows = walls_with_margins(walls, AHEAD)
        at, goal = rng.uniform(-5, 5, (2, 2))
        if min(compute_h(*at, (), rows, r_robot=0.5, eps=0.05)) < 0.1:
            continue
        controller = szlib.MPCCBF(ZONE, walls=walls, settings=AHEAD)
        if controller.goal_blocked(goal):
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
    for settings in (AHEAD, szlib.MPCSettings(), szlib.MPCSettings(lookahead=1.5)):
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


@pytest.mark.parametrize("wrong", [0.0, -1.0, np.nan, "4"])
def test_a_lookahead_that_is_no_positive_number_is_refused(wrong: object) -> None:
    with pytest.raises(
        szlib.SolverError, match="lookahead must be a positive number of metres"
    ):
        replace(szlib.MPCSettings(), lookahead=wrong)  # type: ignore[arg-type]


def test_a_route_that_is_none_is_refused() -> None:
    with pytest.raises(szlib.SolverError, match="route"):
        szlib.MPCCBF(ZONE).step(START, (3.0, 0.0), route=[1.0, 2.0, 3.0])
    with pytest.raises(szlib.SolverError, match="clearance"):
        find_route((0.0, 0.0), (1.0, 0.0), BAR, clearance=-1.0)
