"""Ways around what is fixed, through space and time; and the target beside people who are met head-on."""

from __future__ import annotations

import copy
import tracemalloc
from dataclasses import replace
from itertools import pairwise
from math import asin, atan2, cos, hypot, pi, sin
from typing import Any

import numpy as np
import pytest
import shapely
from numpy.typing import ArrayLike
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

import szlib
from szlib.control import (
    HalfPlane,
    Obstacles,
    Prediction,
    Wall,
    Zone,
    read_walls,
    walls_from_grid,
)
from szlib.control.controller import advance
from szlib.control.mpc import _shrink_zones
from szlib.control.obstacles import Group, PaperWall
from szlib.control.people import find_places
from szlib.control.planner import Planner
from szlib.control.problem import Question, build_horizon
from szlib.control.ways import (
    CELL,
    GROUP_DISTANCE,
    GROUP_SECOND,
    GROUP_SPEED,
    MOST_CELLS,
    SEARCH_TIME,
    SMALLEST_CELL,
    SWITCH_GAIN,
    SWITCH_VIOLATION,
    ZONE_SECOND,
    Heading,
    Map,
    Surroundings,
    Way,
    WayFinder,
    _find_pairs,
    cross_layers,
    find_target,
)
from szlib.core.checks import Array
from szlib.zones.ellipses import BODY_RADIUS

AHEAD = szlib.MPCSettings(lookahead=4.0, time_limit=np.inf)
PLAIN = szlib.MPCSettings(time_limit=np.inf)
AMONG = szlib.MPCSettings.among_people(r_robot=0.3, time_limit=np.inf)
ROOM = [(-3.0, -3.0), (3.0, -3.0), (3.0, 3.0), (-3.0, 3.0), (-3.0, -3.0)]
BAR = [[(0.0, -2.0), (0.0, 2.0)]]
DOORS = [[(0, -6), (0, -0.5)], [(0, 0.5), (0, 3.5)], [(0, 4.5), (0, 10)]]
ZONE = szlib.Ellipse((0.1, 0.0), (1.0, 0.7))
ROUND = szlib.Ellipse((0.0, 0.0), (0.8, 0.8))
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


def find_route(start: Any, goal: Any, walls: Any, clearance: float) -> Array:
    """A short way around `walls` on a map of cells, shape (m, 2); empty if there is none."""
    c, segments = max(clearance, 0.06), read_walls(walls)
    group = Group(Wall, segments.reshape(-1, 4), np.full(len(segments), c))
    found = Map(Obstacles((group,), c), np.array([start, goal]), c)
    found.measure(start, goal, 1.0, np.zeros(found.shape))
    if not found.is_reached:
        return np.zeros((0, 2))
    return np.vstack([start, found.descend(found.find_cell(start))[1:-1], goal])


def drive(
    controller: szlib.MPCCBF,
    goal: tuple[float, float],
    steps: int,
    people: Any = (),
    start: Any = START,
    **more: object,
) -> list[szlib.Step]:
    state, taken = np.array(start), list[szlib.Step]()
    for _ in range(steps):
        taken.append(controller.step(state, goal, people, **more))
        state = szlib.control.advance(state, taken[-1].control, 0.1)
    return taken


# --- around walls -----------------------------------------------------------------------------------


@pytest.mark.slow
def test_routes_are_free_of_walls_and_nearly_as_short_as_they_can_be() -> None:
    rng, compared, around = np.random.default_rng(0), 0, 0
    for _ in range(40):
        walls, (start, goal) = (
            random_walls(rng, int(rng.integers(1, 7))),
            rng.uniform(-5, 5, (2, 2)),
        )
        near, far = (
            shapely.union_all(
                [shapely.LineString(w).buffer(d, quad_segs=16) for w in walls]
            )
            for d in (0.5 - CELL, 0.5 + 2 * CELL)
        )
        if shapely.contains_xy(far, *np.transpose([start, goal])).any():
            continue
        route = find_route(start, goal, walls, clearance=0.5)
        assert length(route) <= 1.06 * shortest(start, goal, far) + CELL
        assert length(route) >= shortest(start, goal, near) - 1e-9
        if len(route):
            assert (route[[0, -1]] == [start, goal]).all()
            assert not shapely.LineString(route).intersects(near)
        compared, around = (
            compared + 1,
            around + (length(route) > 1.01 * np.hypot(*(goal - start))),
        )
    assert compared > 15 and around > 5


@pytest.mark.parametrize("size", [0.05, 0.4, 1.0, 2.0, 8.0])
@pytest.mark.parametrize("kind", [Wall, PaperWall])
def test_the_box_of_a_wall_holds_all_places_so_near_and_little_more(kind, size) -> None:
    wall = kind(0.0, 0.0, size, 0.0)
    offset = 0.5 + (0.05 if kind is Wall else wall.margin(AHEAD))
    x, y = np.meshgrid(np.linspace(-3, size + 3, 1201), np.linspace(-3, 3, 1201))
    inside = kind.distance(x, y, 0.0, *wall.numbers) < offset
    low, high = kind.bounds(np.array([wall.numbers]), np.array([offset]))
    edge = max(high[0, 1], high[0, 0] - size)
    assert low[0] == pytest.approx([-edge, -edge])
    reach = max(x[inside].max() - size, y[inside].max())
    assert reach <= edge <= 2 / 3**0.5 * reach + 0.02


@pytest.mark.parametrize("clearance", [0.0, 0.02, 0.1])
@pytest.mark.parametrize("angle", np.linspace(0.05, 3.0, 12))
def test_no_step_over_cells_crosses_a_wall(angle, clearance) -> None:
    c, s = 4 * np.cos(angle), 4 * np.sin(angle)
    wall = np.array([[(-c, -s), (c, s)]])
    start, goal = (s, -c), (-s, c)
    route = find_route(start, goal, wall, clearance=clearance)
    assert not shapely.LineString(route).intersects(shapely.LineString(wall[0]))
    assert length(route) > 2 * hypot(4, 4)


def test_a_start_beside_a_wall_leaves_it_but_not_across_the_wall() -> None:
    beside, behind = (-0.2, 0.0), (3.0, 0.0)
    route = find_route(beside, behind, BAR, clearance=0.5)
    assert not shapely.LineString(route).intersects(shapely.LineString(BAR[0]))
    assert length(route) > 5.0


def test_half_planes_and_a_users_obstacles_are_on_the_map() -> None:
    class Pillar(szlib.control.Obstacle):
        @staticmethod
        def distance(x, y, t, px, py, radius):
            return ((x - px) ** 2 + (y - py) ** 2) ** 0.5 - radius

    items = [
        HalfPlane((0.0, -2.0), (0.0, 1.0)),
        Pillar(0.0, 0.0, 1.0),
        Wall(-1, 3, 1, 3),
    ]
    fixed = Obstacles.of(items, PLAIN)
    found = Map(fixed, np.array([(-3.0, 0.0), (3.0, 0.0)]))
    cells = np.argwhere(np.ones(found.shape, bool))
    h = fixed.h(*found.centers(cells).T).min(axis=0)
    inside = (slice(2, -2), slice(2, -2))  # the edge is never free
    assert (found.free == (h >= 0).reshape(found.shape))[inside].all()


def test_times_to_the_goal_are_those_of_straight_ways_on_free_floor() -> None:
    found = Map(Obstacles((), 0.5), np.array([(0.0, 0.0), (6.0, 2.0)]))
    found.measure((0.0, 0.0), (6.0, 2.0), 2.0, np.zeros(found.shape))
    assert found.is_reached
    end = found.centers(found.find_cell((6.0, 2.0)))
    centers = found.centers(np.argwhere(found.free))
    straight = np.hypot(*(centers - end).T) / 2.0
    far = found.seconds_to_goal[found.free]
    assert (far >= straight - 1e-9).all() and (far <= 1.03 * straight + 1e-9).all()


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
    assert stuck.way == "" and stuck.ways == ()


def test_without_walls_a_finite_lookahead_only_shortens_the_way_ahead() -> None:
    step = szlib.MPCCBF(ZONE, settings=AHEAD).step(START, (7.0, 0.0))
    x, y = step.target
    assert 1.0 - CELL <= x <= 1.0 and y == 0.0 and step.way_length == 10.0
    assert step.way == "straight to the goal"
    step = szlib.MPCCBF(ZONE, settings=AHEAD).step(START, (0.5, 0.0))
    assert step.target == pytest.approx((0.5, 0.0))


def test_the_target_is_always_in_sight() -> None:
    rng, around = np.random.default_rng(1), 0
    for _ in range(30):
        walls = random_walls(rng, 5)
        at, goal = rng.uniform(-5, 5, (2, 2))
        controller = szlib.MPCCBF(ZONE, walls=walls, settings=AHEAD)
        if min(controller.barriers(at).min(), controller.barriers(goal).min()) < 0.1:
            continue
        step = controller.step((*at, 0.0, 0.0), goal)
        if step.way_length < np.inf:
            line = shapely.LineString([at, step.target])
            assert all(not line.intersects(shapely.LineString(wall)) for wall in walls)
            around += step.way_length > np.hypot(*(goal - at)) + 0.01
    assert around > 3


def test_in_a_closed_room_the_robot_goes_as_near_as_it_can_and_says_so() -> None:
    assert find_route((0.0, 0.0), (8.0, 0.0), ROOM, clearance=0.5).shape == (0, 2)
    controller = szlib.MPCCBF(ZONE, walls=ROOM, settings=AHEAD)
    steps = drive(controller, (8.0, 0.0), 80, start=(0.0, 0.0, 0.0, 0.0))
    assert steps[0].way_length == np.inf and steps[0].goal_blocked
    assert "nearest point that it can reach" in steps[0].explain()
    end = steps[-1].predicted[0]
    assert end[:2] == pytest.approx((2.45, 0.0), abs=CELL)
    assert np.hypot(*end[2:]) < 0.05


def test_that_there_is_no_way_is_found_once(monkeypatch) -> None:
    counted, measure = list[int](), Map.measure
    monkeypatch.setattr(
        Map, "measure", lambda *given: (counted.append(1), measure(*given))[1]
    )
    controller = szlib.MPCCBF(ZONE, walls=ROOM, settings=AHEAD)
    drive(controller, (8.0, 0.0), 30, start=(0.0, 0.0, 0.0, 0.0))
    assert len(counted) == 1
    controller.step((0.0, 0.0, 0.0, 0.0), (8.0, 3.0))
    assert len(counted) == 2


def test_a_copy_takes_the_same_steps_and_a_reset_forgets_the_way() -> None:
    people = [szlib.Person((0.0, 0.5), (-0.4, 0.0)), szlib.Person((1.0, -2.5))]
    controller = szlib.MPCCBF(ZONE, walls=BAR, settings=AHEAD)
    first = drive(controller, (3.0, 0.0), 5, people)
    copied = copy.copy(controller)
    state = (-0.8, 0.3, 0.0, 0.0)
    for _ in range(6):
        one, other = (c.step(state, (3.0, 0.0), people) for c in (controller, copied))
        assert (one.control == other.control).all() and one.way == other.way
    controller.reset()
    again = drive(controller, (3.0, 0.0), 5, people)
    assert all(
        (a.control == b.control).all() for a, b in zip(first, again, strict=True)
    )


def test_new_walls_and_a_new_goal_give_a_new_way() -> None:
    controller = szlib.MPCCBF(ZONE, walls=BAR, settings=AHEAD)
    assert controller.step(START, (3.0, 0.0)).way_length > 6.5
    assert controller.step(START, (-3.0, 3.0)).way_length == pytest.approx(3.0)
    controller.set_walls([])
    assert controller.step(START, (3.0, 0.0)).way_length == pytest.approx(6.0)


def test_a_wall_of_short_pieces_keeps_its_clearance() -> None:
    pieces = [[(1.03, a), (1.03, a + 0.05)] for a in np.arange(-1, 1, 0.05)]
    for clearance in (0.1, 0.3):
        route = find_route((0.0, 0.0), (2.0, 0.0), pieces, clearance)
        gap = shapely.LineString(route).distance(
            shapely.LineString([(1.03, -1), (1.03, 1)])
        )
        assert gap > clearance - CELL


@pytest.mark.parametrize("goal", [(3000.0, 3000.0), (1e5, -1e5)])
def test_a_goal_far_away_is_headed_for(goal) -> None:
    steps = drive(szlib.MPCCBF(ZONE, settings=AHEAD), goal, 15, start=(0, 0, 0, 0))
    assert np.hypot(*steps[-1].predicted[0, :2]) > 0.5
    assert (steps[-1].predicted[0, :2] * np.sign(goal) > 0).all()


def test_the_name_of_a_way_follows_people_who_are_listed_in_another_order() -> None:
    ann, bob = szlib.Person((3.0, 0.1), id="ann"), szlib.Person((3.0, -4.0), id="bob")
    controller = szlib.MPCCBF(ZONE, settings=AMONG)
    for people in ([ann, bob], [bob, ann]):
        step = controller.step((0.0, 0.0, 0.0, 0.0), (8.0, 0.0), people)
        assert step.way.endswith(f"of person {people.index(ann)}")


@pytest.mark.parametrize("away", [1e3, 1e5, 1e8])
def test_a_map_of_any_size_has_about_as_many_cells_as_it_may(away: float) -> None:
    points = np.array([(0.0, 0.0), (away, 0.0)])
    free = Map(Obstacles((), 0.5), points).free
    assert 0.5 * MOST_CELLS < free.size <= 1.2 * MOST_CELLS


def test_people_who_touch_are_no_pair_to_pass_between() -> None:
    """Of 200 people at one place there would be 19,900 pairs, each with prices of its own."""
    rows = [szlib.Person((x, 0.0)) for x in (0.0, 0.45, 1.2)]
    people = find_places(rows, np.array([0.0, 0.1]))
    assert _find_pairs(people, [None] * 3).tolist() == [[0, 1], [2, 2]]
    assert _find_pairs(people[[0] * 200], [None] * 200).shape == (2, 0)


def test_a_door_of_a_large_building_stays_open() -> None:
    """Of a building that has too many cells the map is the part around robot and goal."""
    rows = [[(4, -200), (4, -0.7)], [(4, 0.7), (4, 200)], [(-200, 200), (200, 204)]]
    step = szlib.MPCCBF(ZONE, walls=rows, settings=AHEAD).step((0, 0, 0, 0), (9.0, 0.0))
    assert step.way_length == pytest.approx(9.0, abs=0.2) and not step.goal_blocked


def test_a_robot_that_was_moved_to_another_room_looks_for_its_way_anew() -> None:
    walls = [*zip(ROOM, ROOM[1:], strict=False)]
    controller = szlib.MPCCBF(ZONE, walls=walls, settings=AHEAD)
    inside, outside = (0.0, 0.0, 0.0, 0.0), (-6.0, 0.0, 0.0, 0.0)
    for state, length in ((outside, 2.0), (inside, np.inf), (outside, 2.0)):
        for _ in range(5):
            step = controller.step(state, (-8.0, 0.0))
        assert step.way_length == pytest.approx(length)
        assert (step.way == "straight to the goal") == (length < np.inf)


def test_a_goal_that_moved_a_little_is_reached():
    controller = szlib.MPCCBF(ZONE, walls=BAR, settings=AHEAD)
    drive(controller, (3.0, 0.0), 5)
    steps = drive(controller, (3.0, 0.3), 150)
    assert np.hypot(*(steps[-1].predicted[0, :2] - (3.0, 0.3))) < 0.05


def test_a_goal_that_moved_to_the_other_side_of_a_wall_is_reached() -> None:
    small = szlib.MPCSettings.among_people(r_robot=0.1, time_limit=np.inf)
    controller = szlib.MPCCBF(ZONE, walls=[[(-2, 0), (6, 0)]], settings=small)
    *_, last = drive(controller, (1.0, -0.2), 10, start=(0.0, -0.25, 0.0, 0.0))
    *_, last = drive(controller, (1.0, 0.2), 200, start=last.scene.state)
    assert np.hypot(*(last.predicted[0, :2] - (1.0, 0.2))) < 0.05


def test_a_goal_that_moved_out_of_a_solid_is_blocked_no_more() -> None:
    controller = szlib.MPCCBF(ZONE, walls=shapely.box(2, -1, 4, 1), settings=AMONG)
    start = (0.0, 0.0, 0.0, 0.0)
    assert controller.step(start, (3.0, 0.95)).goal_blocked
    *_, last = drive(controller, (3.0, 1.42), 10, start=start)
    assert (
        not last.goal_blocked and last.way != "to the nearest point that it can reach"
    )


def make_slit(width: float, door: bool) -> list[Any]:
    """A room with a slit of this `width`, and perhaps a `door` of 1 m."""
    ends = [(-6, -5), (-4, -width / 2)] if door else [(-6, -width / 2)]
    middle = [[(3, a), (3, b)] for a, b in (*ends, (width / 2, 6))]
    return [[(-3, -6), (9, -6), (9, 6), (-3, 6), (-3, -6)], *middle]


def cut_wall(around: list[Any], *others: Any) -> list[Any]:
    """The segments of a polygonal chain, and the `others`."""
    return [*map(list, pairwise(around)), *others]


def test_an_earlier_goal_in_a_wall_does_not_close_a_door() -> None:
    controller = szlib.MPCCBF(ZONE, walls=make_slit(0.66, door=True), settings=AMONG)
    *_, last = drive(controller, (3.0, 3.0), 60, start=(0.0, 0.0, 0.0, 0.0))
    *_, last = drive(controller, (6.0, 0.0), 200, start=last.scene.state)
    assert np.hypot(*(last.predicted[0, :2] - (6.0, 0.0))) < 0.05


@pytest.mark.parametrize("width", [0.62, 0.66, 0.69, 0.71, 0.76])
def test_a_door_is_a_way_if_the_robot_fits(width: float) -> None:
    """It needs 0.7 m, wherever the cells of the map lie; to 1 cm."""
    for shift in np.random.default_rng(0).uniform(-0.5, 0.5, (10, 2)):
        walls = np.array(cut_wall(*make_slit(width, door=False))) + shift
        controller = szlib.MPCCBF(ZONE, walls=walls, settings=AMONG)
        step = controller.step((0.0, 0.1, 0.0, 0.0), (6.0, -0.2))
        assert step.goal_blocked == (width < 0.7), shift


def test_a_narrow_door_is_taken_beside_a_slit_that_is_too_narrow() -> None:
    """No cell's centre is free in either; the slit is on the shorter way."""
    walls = [[(3, -6), (3, -3.4)], [(3, -2.6), (3, -0.33)], [(3, 0.33), (3, 6)]]
    walls += [[(-3, y), (9, y)] for y in (-6, 6)] + [[(x, -6), (x, 6)] for x in (-3, 9)]
    controller = szlib.MPCCBF(ZONE, walls=walls, settings=AMONG)
    *_, last = drive(controller, (6.0, 0.07), 200, start=(0.0, 0.07, 0.0, 0.0))
    assert np.hypot(*(last.predicted[0, :2] - (6.0, 0.07))) < 0.05


def test_a_long_narrow_corridor_of_many_walls_takes_little_memory() -> None:
    ends = np.linspace(0, 50, 2501)
    pieces = np.stack([ends[:-1], ends[1:]], axis=1)
    walls = [np.dstack([pieces, np.full_like(pieces, y)]) for y in (-0.355, 0.355)]
    controller = szlib.MPCCBF(ZONE, walls=np.concatenate(walls), settings=AMONG)
    tracemalloc.start()
    step = controller.step((-2.0, 0.0, 0.0, 0.0), (52.0, 0.0))
    assert not step.goal_blocked
    assert tracemalloc.get_traced_memory()[1] < 5e8
    tracemalloc.stop()


def test_the_free_end_of_a_wall_is_no_door() -> None:
    for half in (4, 9, 12):
        walls = [[(3, -half), (3, half)]]
        step = szlib.MPCCBF(ZONE, walls=walls, settings=AMONG).step(START, (6.0, 0.0))
        assert step.way == "around obstacles"


def test_cells_of_a_tiny_robot_are_not_smaller_than_can_be_searched() -> None:
    fixed = Obstacles((), 0.0)
    found = Map(fixed, np.array([(0.0, 0.0), (6.0, 0.0)]), clearance=0.02)
    assert found.cell == SMALLEST_CELL


def test_a_goal_that_walks_away_leaves_the_map() -> None:
    controller = szlib.MPCCBF(ZONE, walls=BAR, settings=AHEAD)
    for k in range(140):
        step = controller.step((-3.0, 0, 0, 0), (-4 - 0.1 * k, 0.0))
        assert step.target == pytest.approx((max(-7.0, -4 - 0.1 * k), 0.0), abs=0.5)


@pytest.mark.parametrize("radius", [0.05, 0.1])
def test_targets_of_small_robots_lie_on_this_side_of_thin_walls(radius) -> None:
    rng = np.random.default_rng(2)
    s = szlib.MPCSettings.among_people(r_robot=radius, eps=0.03)
    for _ in range(25):
        angle = rng.uniform(0, pi)
        end = 3 * np.array([cos(angle), sin(angle)])
        at = rng.uniform(-1, 1, 2)
        controller = szlib.MPCCBF(ZONE, walls=[[-end, end]], settings=s)
        if controller.barriers(at).min() < 0:
            continue
        step = controller.step((*at, 0, 0), tuple(-at * 2))
        line = shapely.LineString([at, step.target])
        assert not line.intersects(shapely.LineString([-end, end]))


# --- through space and time -------------------------------------------------------------------------


def test_the_search_finds_the_cheapest_way_of_all() -> None:
    """Against Dijkstra's algorithm on the graph of all cells at all times."""
    rng = np.random.default_rng(3)
    for _ in range(5):
        costs = rng.choice([0.1, 0.3, 5.0, np.inf], (7, 5, 6), p=[0.5, 0.2, 0.2, 0.1])
        far, begin = rng.uniform(0, 1, (5, 6)), (2, 3)
        costs[:, 2, 3] = 0.2
        number = np.arange(8 * 30, dtype=np.intc).reshape(8, 5, 6)
        rows = []
        for k, i, j in np.ndindex(7, 5, 6):
            for a, b in np.ndindex(3, 3):
                to = i + a - 1, j + b - 1
                if 0 <= to[0] < 5 and 0 <= to[1] < 6 and np.isfinite(costs[k, *to]):
                    price = costs[k, *to] + 0.015 * (abs(a - 1) + abs(b - 1))
                    rows.append((price, number[k, i, j], number[k + 1, *to]))
        price, start, end = map(np.array, zip(*rows, strict=True))
        graph = coo_array((price, (start, end)), shape=(240, 240)).tocsr()
        reached = dijkstra(graph, indices=number[0, 2, 3])[number] + far
        reached[:-1, 1:-1, 1:-1] = np.inf  # inside it goes on to the end
        cells = cross_layers(costs.astype(np.float32), begin, far)
        moves = np.abs(np.diff(cells, axis=0))
        k = len(moves)
        found = costs[np.arange(k), *cells[1:].T].sum() + 0.015 * moves.sum()
        assert moves.max() <= 1 and tuple(cells[0]) == begin
        assert found + far[tuple(cells[-1])] == pytest.approx(reached.min(), abs=1e-5)


def side_by_side(n: int, apart: float = 0.6, x: float = 0.0) -> list[szlib.Person]:
    return [szlib.Person((x, (i - (n - 1) / 2) * apart)) for i in range(n)]


@pytest.mark.parametrize("n", [3, 5])
def test_a_row_of_people_is_passed_on_either_side(n) -> None:
    controller = szlib.MPCCBF(ROUND, settings=AMONG)
    steps = drive(controller, (4.0, 0.0), 130, side_by_side(n), (-4.0, 0.0, 0.0, 0.0))
    assert np.hypot(*(steps[-1].predicted[0, :2] - (4.0, 0.0))) < 0.1
    last = n - 1
    sides = {f"{side} of person {i}" for side, i in (("left", last), ("right", 0))}
    assert {way.name.split(", ")[0] for way in steps[0].ways} | sides
    assert len(steps[0].ways) >= 2
    across = [np.interp(0.0, *way.points[:60].T) for way in steps[0].ways[:2]]
    assert min(across) < -0.3 * n and max(across) > 0.3 * n


def test_a_second_door_is_taken_where_a_person_stands_in_the_first() -> None:
    controller = szlib.MPCCBF(ROUND, walls=DOORS, settings=AMONG)
    start = (-4.0, 0.0, 0.0, 0.0)
    steps = drive(controller, (4.0, 0.0), 160, [szlib.Person((0.0, 0.0))], start)
    places = np.array([step.predicted[0, :2] for step in steps])
    assert np.hypot(*(places[-1] - (4.0, 0.0))) < 0.1
    assert np.interp(0.0, *places.T) == pytest.approx(4.0, abs=0.3)
    assert all(step.walls_safe and step.passively_safe for step in steps)
    alone = drive(szlib.MPCCBF(ROUND, walls=DOORS, settings=AMONG), (4.0, 0.0), 3)
    assert np.abs(alone[0].ways[0].points[:, 1]).max() < 0.5


def test_the_robot_waits_at_the_only_door_and_then_goes_on() -> None:
    walls = [(0, 0.6), (0, 6), (-8, 6), (-8, -6), (0, -6), (0, -0.6)]  # a room
    controller = szlib.MPCCBF(ROUND, walls=walls, settings=AMONG)
    state, walking = np.array([-4.0, 0.0, 0.0, 0.0]), [[0.0, 0.0, 0.0, 0.0]]
    for _ in range(100):
        step = controller.step(state, (4.0, 0.0), walking)
        state = szlib.control.advance(state, step.control, 0.1)
    assert state[0] < -0.5 and np.hypot(*state[2:]) < 0.05
    for _ in range(90):
        state = szlib.control.advance(
            state, controller.step(state, (4.0, 0.0)).control, 0.1
        )
    assert state[:2] == pytest.approx((4.0, 0.0), abs=0.1)


@pytest.mark.parametrize("turn", [0.0, pi / 2, pi])
def test_ways_pass_in_front_of_or_behind_a_person_who_crosses(turn) -> None:
    def turned(x: float, y: float) -> tuple[float, float]:
        return x * cos(turn) - y * sin(turn), x * sin(turn) + y * cos(turn)

    person = szlib.Person(turned(0.0, -3.0), turned(0.0, 1.0))
    controller = szlib.MPCCBF(ROUND, settings=AMONG)
    at, goal = turned(-3.0, 0.0), turned(5.0, 0.0)
    steps = [controller.step((*at, 0.0, 0.0), goal, [person])]
    names = {way.name for way in steps[0].ways}
    assert any("behind person 0" in name for name in names)
    explained = steps[0].explain()
    assert f"way: {steps[0].way}" in explained
    for other in steps[0].ways[1:]:
        assert f"not: {other.name}" in explained


@pytest.mark.parametrize(("side", "sign"), [("right", -1), ("left", 1)])
def test_a_person_met_head_on_is_passed_on_the_preferred_side(side, sign) -> None:
    settings = szlib.MPCSettings.among_people(pass_side=side, r_robot=0.3)
    person = [szlib.Person((3.0, 0.0), (-1.0, 0.0))]
    step = szlib.MPCCBF(ROUND, settings=settings).step(START, (7.0, 0.0), person)
    assert sign * step.target[1] > 0.1 and step.way == f"{side} of person 0"


def test_a_way_is_kept_until_another_is_clearly_cheaper() -> None:
    """A person who stands in the way steps aside, little by little: the robot changes the side once."""
    controller = szlib.MPCCBF(ROUND, settings=AMONG)
    sides = list[float]()
    for y in np.linspace(-1.2, 1.2, 61):
        person = szlib.Person((0.0, float(y)))
        for _ in range(4):
            step = controller.step(START, (3.0, 0.0), [person])
        way = step.ways[0]
        sides.append(np.sign(np.interp(0.0, *way.points.T) - y))
        assert way.cost < min(each.cost for each in step.ways) + SWITCH_GAIN
    assert sides[0] > 0 > sides[-1]
    changes = np.flatnonzero(np.diff(sides))
    assert len(changes) == 1 and np.linspace(-1.2, 1.2, 61)[changes[0]] > 0.05


def test_ways_are_chosen_by_refined_plans_which_know_how_the_robot_moves() -> None:
    """The search sees the same for both robots; one of them moves to the left already."""
    person = szlib.Person((1.2, 0.0))
    taken = {}
    for vy in (0.0, 0.9):
        controller = szlib.MPCCBF(ROUND, settings=AMONG)
        step = controller.step((0.0, 0.0, 0.3, vy), (6.0, 0.0), [person])
        costs = [way.cost for way in step.ways]
        assert len(costs) == 2 and costs == sorted(costs)
        taken[vy] = step.way
    assert taken == {0.0: "right of person 0", 0.9: "left of person 0"}


def test_a_way_whose_plan_violates_less_is_taken_though_it_is_longer() -> None:
    """By priorities: a body counts more than any time, and so does a wall more than a body."""
    short, long = (Way(np.zeros((2, 2)), np.zeros(2), cost) for cost in (5.0, 50.0))
    assert short.rank() < long.rank() < short.rank((0.0, 0.1, 0.0))
    assert long.rank((0.0, 0.3, 0.0)) < short.rank((0.1, 0.0, 0.0))
    assert long.rank((0.1, 0.0, 0.0)) < short.rank((0.1, 0.2, 0.0))


def test_the_way_that_is_kept_may_violate_and_cost_a_little_more() -> None:
    other = Way(np.zeros((2, 2)), np.zeros(2), 5.0)
    for more, is_better in ((SWITCH_GAIN - 0.1, True), (SWITCH_GAIN + 0.1, False)):
        kept = other._replace(cost=other.cost + more, is_kept=True)
        assert (kept.rank() < other.rank()) == is_better
    kept = other._replace(is_kept=True)
    assert kept.rank((0.0, SWITCH_VIOLATION - 0.01, 0.0)) < other.rank()
    assert other.rank() < kept.rank((0.0, SWITCH_VIOLATION + 0.01, 0.0))


def test_a_wall_is_never_violated_for_the_way_that_is_kept() -> None:
    way = Way(np.zeros((2, 2)), np.zeros(2), 5.0)
    assert way.rank() < way._replace(is_kept=True).rank((0.01, 0.0, 0.0))


def test_the_way_that_is_taken_is_kept_until_the_next_search() -> None:
    """The search alone prefers the right, the plans the left: the next step knows that."""
    person = [szlib.Person((1.2, 0.0))]
    controller = szlib.MPCCBF(ROUND, settings=AMONG)
    state = np.array([0.0, 0.0, 0.3, 0.9])
    names = []
    for _ in range(3):
        step = controller.step(state, (6.0, 0.0), person)
        names.append(step.way)
        state = advance(state, step.control, AMONG.dt)
    assert names == ["left of person 0"] * 3
    found = WayFinder(Obstacles((), 0.3), AMONG)
    zones = Obstacles.of([Zone(*Zone.place(ROUND, (1.2, 0.0), 0.0, (0, 0)))], AMONG)
    first, _ = found.find((0.0, 0.0), (6.0, 0.0), person, zones)
    assert first.ways[0].name == "right of person 0"


def test_a_way_that_is_cheaper_is_left_if_its_plan_hits_somebody(monkeypatch) -> None:
    """Violations of its plan are made up: the other way is taken then, at any cost."""
    plan = Planner.plan

    def hits_on_the_right(planner: Planner, question: Question, *guesses: Array) -> Any:
        found = plan(planner, question, *guesses)
        is_right = question.target[1] < 0
        return found._replace(violations=(0.0, 0.3, 0.0) if is_right else ())

    person = [szlib.Person((1.5, 0.3))]
    at = (0.0, 0.0, 0.5, 0.0), (6.0, 0.0)
    ways = szlib.MPCCBF(ROUND, settings=AMONG).step(*at, person).ways
    assert [way.name for way in ways] == ["right of person 0", "left of person 0"]
    monkeypatch.setattr(Planner, "plan", hits_on_the_right)
    step = szlib.MPCCBF(ROUND, settings=AMONG).step(*at, person)
    assert (
        step.way == "left of person 0" and step.ways[0].cost > step.ways[1].cost + 0.5
    )
    assert "not: right of person 0, whose plan would violate more" in step.explain()


@pytest.mark.parametrize("speed", [0.0, 0.5, 1.0])
def test_the_time_that_a_plan_loses_hardly_depends_on_its_target(speed) -> None:
    """A robot alone on a straight way sees less of it, or more."""
    controller = szlib.MPCCBF(ROUND, settings=AMONG)
    points = np.column_stack([AMONG.v_max * AMONG.times, 0 * AMONG.times])
    lost = []
    for x in (0.45, 1.0, 2.0, 4.0):
        state = (0.0, 0.0, speed, 0.0)
        question = Question(state, (x, 0.0), (0.0, 0.0), Obstacles((), 0.3))
        plan = controller._planner.plan(question, np.zeros((AMONG.N, 2)))
        promised = points[1:]
        lost.append(controller._planner.find_time_lost(question, plan, promised))
    assert min(lost) > 0.0 and max(lost) < 0.05 + 0.5 * (1 - speed)
    assert lost == pytest.approx([lost[0]] * 4, abs=0.05 + 0.25 * (1 - speed))


def test_a_wait_of_a_second_costs_about_a_second() -> None:
    controller = szlib.MPCCBF(ROUND, settings=AMONG)
    planner = controller._planner
    question = Question(
        (0.0, 0.0, 1.0, 0.0), (30.0, 0.0), (0.0, 0.0), Obstacles((), 0.3)
    )
    plan = planner.plan(question, np.zeros((AMONG.N, 2)))
    points = np.column_stack([AMONG.v_max * AMONG.times, 0 * AMONG.times])[1:]
    late = points - (1.0, 0.0)
    more = planner.find_time_lost(question, plan, points)
    less = planner.find_time_lost(question, plan, late)
    assert more - less == pytest.approx(1.0, abs=0.05)


def test_a_step_says_that_time_was_up_while_another_way_was_refined(
    monkeypatch,
) -> None:
    """The ways that were not refined are known all the same, and no plan is made after that."""
    plan, made = Planner._plan_from, []

    def late_from_the_third_on(planner: Planner, question: Question, guess: Array):
        made.append(guess)
        found = plan(planner, question, guess)
        return found._replace(timed_out=len(made) >= 3)

    monkeypatch.setattr(Planner, "_plan_from", late_from_the_third_on)
    people = [szlib.Person((3.0, y)) for y in (-1.0, 0.0, 1.0)]
    step = szlib.MPCCBF(ROUND, settings=AMONG).step(
        (0.0, 0.0, 0.0, 0.0), (6.0, 0.0), people
    )
    assert step.timed_out and len(made) == 3
    monkeypatch.undo()
    usual = szlib.MPCCBF(ROUND, settings=AMONG).step(
        (0.0, 0.0, 0.0, 0.0), (6.0, 0.0), people
    )
    assert {way.name for way in step.ways} == {way.name for way in usual.ways}


def test_a_zone_that_is_entered_at_a_price_is_no_violation(monkeypatch) -> None:
    """Else a way would be left for one that costs more, because of a zone that both enter."""
    plan, found = Planner.plan, []

    def spy(planner: Planner, question: Question, *guesses: Array) -> Any:
        found.append(plan(planner, question, *guesses))
        return found[-1]

    monkeypatch.setattr(Planner, "plan", spy)
    people = [(1.5 + 0.8 * k, 0.7 * (-1) ** k, -0.3, 0.0) for k in range(4)]
    walls = [[(-1, side), (8, side)] for side in (-1.9, 1.9)]
    controller = szlib.MPCCBF(ROUND, walls=walls, settings=AMONG)
    state = np.array([0.0, 0.0, 0.8, 0.0])
    for k in range(25):
        moved = np.array(people)
        moved[:, 0] -= 0.03 * k
        state = advance(state, controller.step(state, (8.0, 0.0), moved).control, 0.1)
    relaxed = [each.violations for each in found if each.is_relaxed]
    assert max(body for _, body, _ in relaxed) > 0
    assert {zone for _, _, zone in relaxed} == {0.0}


def test_among_unknown_people_no_way_is_forgotten() -> None:
    """The robot brakes then: no plan along the ways is compared."""
    known = [0.0, 0.0, 0.0, 0.0]
    at = (-1.5, 0.0, 0.8, 0.0), (6.0, 0.0)
    names = []
    for people in ([known], [known, [np.nan, 0.0, 0.0, 0.0]]):
        step = szlib.MPCCBF(ROUND, settings=AMONG).step(*at, np.array(people))
        names.append([way.name for way in step.ways])
    assert step.unknown == 1 and len(names[0]) == 2 and names[0] == names[1]


def test_explain_says_why_another_way_is_not_taken() -> None:
    """It costs more; it is not much cheaper than the way that is kept; or its plan violates more."""
    controller = szlib.MPCCBF(ROUND, settings=AMONG)
    step = controller.step(
        (-1.5, 0.0, 0.8, 0.0), (6.0, 0.0), [szlib.Person((0.0, 0.0))]
    )
    taken, other = step.ways
    reasons = {}
    for is_kept, more in ((False, 0.4), (True, -0.4), (False, -0.4), (True, -1.4)):
        ways = (
            taken._replace(is_kept=is_kept),
            other._replace(cost=taken.cost + more),
        )
        reasons[is_kept, more] = replace(step, ways=ways).explain()
    name = "not: left of person 0, "
    assert f"{name}which costs 0.4 s more" in reasons[False, 0.4]
    assert f"{name}which is only 0.4 s cheaper" in reasons[True, -0.4]
    assert f"{name}whose plan would violate more" in reasons[False, -0.4]
    assert f"{name}whose plan would violate more" in reasons[True, -1.4]


def test_each_way_gets_a_plan_of_its_own_on_its_own_side(monkeypatch) -> None:
    """The plans that are compared pass the person on the sides that their ways name."""
    plans, plan = [], Planner.plan

    def spy(planner: Planner, question: Question, *guesses: Array) -> Any:
        plans.append((question, plan(planner, question, *guesses)))
        return plans[-1][1]

    monkeypatch.setattr(Planner, "plan", spy)
    controller = szlib.MPCCBF(ROUND, settings=AMONG)
    at = (-1.5, 0.0, 0.8, 0.0)
    step = controller.step(at, (6.0, 0.0), [szlib.Person((0.0, 0.0))])
    assert [way.name for way in step.ways] == ["right of person 0", "left of person 0"]
    ends = [
        build_horizon(AMONG).states(np.array(at), found.inputs)[-1, 1]
        for _, found in plans
    ]
    assert len(ends) == 2 and ends[0] < -0.1 and ends[1] > 0.1
    assert (step.inputs == plans[0][1].inputs).all()


def test_a_zone_is_crossed_only_where_the_way_around_costs_more() -> None:
    """A corridor with a person: through the zone costs `ZONE_SECOND` a second."""
    walls = [[(-9, -1.4), (9, -1.4)], [(-9, 1.4), (9, 1.4)]]
    for walls_here, crosses in (((), False), (walls, True)):
        controller = szlib.MPCCBF(ROUND, walls=walls_here, settings=AMONG)
        step = controller.step(START, (3.0, 0.0), [szlib.Person((0.0, 0.0))])
        points = step.ways[0].points
        inside = np.hypot(*points.T) < 0.8 + 0.3
        assert inside.any() == crosses
        assert step.ways[0].cost == pytest.approx(
            step.ways[0].times[-1] + ZONE_SECOND * 0.15 * inside.sum() * crosses,
            rel=0.2,
        )


@pytest.mark.parametrize("rates", [(0.0, 0.0), (1.0, 1.2), (1.0, -1.0)])
@pytest.mark.parametrize("apart", [1.4, 1.6])
def test_between_two_people_who_are_together_a_way_has_its_price(apart, rates) -> None:
    people = [
        szlib.Person((0.0, side * apart / 2), (rate, 0.0))
        for side, rate in zip((-1, 1), rates, strict=True)
    ]
    zones = Obstacles.of(
        [Zone(*Zone.place(ROUND, p.position, 0.0, p.velocity)) for p in people], AMONG
    )
    found = Map(Obstacles((), 0.3), np.zeros((1, 2)), 0.12)
    near = Surroundings(people, zones, (0.0, 0.0), found, AMONG)
    rows = np.ones(len(near.places), bool)
    price = near.find_prices(rows, np.array([2.0]), np.zeros(2, int), found.shape)
    places = found.centers(np.argwhere(price[0] == GROUP_SECOND))
    is_group = apart < GROUP_DISTANCE and abs(rates[0] - rates[1]) < GROUP_SPEED
    assert len(near.places) == 2 + is_group and (len(places) > 0) == is_group
    if is_group:
        middle = 2.0 * sum(rates) / 2
        assert np.hypot(*(places - (middle, 0.0)).T).max() < apart / 2 + 0.15


def test_the_first_door_is_named_and_nobody_is_waited_for_at_the_goal() -> None:
    walls = [
        [(x, y), (x, 5 * np.sign(y))] for x in (2.0, 5.0) for y in (-0.62, 0.62)
    ] + [[(-4, y), (9, y)] for y in (-5, 5)]
    step = szlib.MPCCBF(ZONE, walls=walls, settings=AMONG).step(START, (8.0, 0.0))
    x, y = map(float, step.way.split("(")[1].rstrip(")").split(","))
    assert (x, y) == pytest.approx((2.0, 0.0), abs=0.3)
    leaves = [szlib.Person((-3.0, 1.5), (-0.5, 0.0))]
    step = szlib.MPCCBF(ROUND, settings=AMONG).step((0, 0, 0, 0), (1.5, 0.0), leaves)
    assert step.way == "straight to the goal"


def test_a_plan_whose_floors_all_hold_is_no_restart() -> None:
    """Few iterations: the first problem is not solved, the one with floors is."""
    settings = szlib.MPCSettings(dt=0.3, max_iterations=3)
    controller = szlib.MPCCBF(ZONE, walls=[[(-3, 1.5), (4, 1.5)]], settings=settings)
    people = [
        szlib.Person((-0.59059844, 0.97353498), (0.00417197, 1.79574451)),
        szlib.Person((-0.66370339, 0.1403039), (0.91678956, -1.23668284)),
    ]
    state = (-1.8798728, -0.88716361, 0.14008909, -0.30287018)
    assert controller.step(state, (4.0, 0.0), people).status in szlib.control.STATUSES


def test_a_way_stays_at_the_goal() -> None:
    way = Way(np.array([(0.0, 0.0), (2.0, 0.0)]), np.array([0.0, 2.0]), 2.0)
    assert way.at(np.array([0.5, 2.0, 9.0])).tolist() == [[0.5, 0], [2, 0], [2, 0]]


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


def test_a_group_that_is_given_is_passed_around_though_its_members_are_far_apart() -> (
    None
):
    """Two who stand 2.8 m apart: between them if they are strangers, around them if they are together."""
    zone, sides = szlib.Ellipse((0.0, 0.0), (0.4, 0.4)), []
    for groups in ((None, None), ("a", "b"), ("a", "a")):
        settings = szlib.MPCSettings.among_people(time_limit=np.inf)
        people = [
            szlib.Person((4.0, y), group=group)
            for y, group in zip((-1.4, 1.4), groups, strict=True)
        ]
        step = szlib.MPCCBF(zone, settings=settings).step(
            (0.0, 0.0, 1.0, 0.0), (8.0, 0.0), people
        )
        sides.append(float(np.abs(step.ways[0].points[:, 1]).max()))
    assert sides[0] == sides[1] < 1.0 and sides[2] > 1.4


def test_a_reset_controller_is_as_a_new_one():
    used, new = (
        szlib.MPCCBF(ZONE, walls=[[(2, -6), (2, -0.2)]], settings=AMONG)
        for _ in range(2)
    )
    used.step((-3.3, 0.41, 0, 0), (7.1, 0.77))
    used.reset()
    one, other = (each.step((0, 0, 0, 0), (6, 0)) for each in (used, new))
    np.testing.assert_array_equal(one.target, other.target)
    np.testing.assert_array_equal(one.control, other.control)


def drive_alone(
    walls: Any, start: ArrayLike, goal: ArrayLike, r_robot: float, seconds: float
) -> float:
    """Time in which a robot arrives; inf if it does not."""
    settings = szlib.MPCSettings.among_people(time_limit=np.inf, r_robot=r_robot)
    controller = szlib.MPCCBF(ZONE, walls=walls, settings=settings)
    x = np.array([*start, 0.0, 0.0])
    for k in range(round(10 * seconds)):
        x = advance(x, controller.step(x, goal).control, 0.1)
        if np.hypot(*(x[:2] - goal)) < 0.12:
            return k / 10
    return np.inf


@pytest.mark.slow
@pytest.mark.parametrize("r_robot", [0.3, 0.5])
def test_a_corridor_at_any_angle_a_little_wider_than_the_robot_is_passed(
    r_robot: float,
) -> None:
    """No cell's centre may be free: it is 10 cm wider than the robot and its margins."""
    w = r_robot + 0.1
    for angle in np.arange(12) * np.pi / 12:
        turn = np.array(
            [[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]]
        )
        walls = np.array([[(-5, w), (5, w)], [(-5, -w), (5, -w)], [(-5, w), (-5, -w)]])
        start, goal = np.array([(-3.0, 0.0), (7.0, -0.4)]) @ turn
        assert drive_alone(walls @ turn, start, goal, r_robot, 20.0) < 20.0, angle


def test_a_way_never_leads_through_a_wall_to_the_nearest_free_cell() -> None:
    a = 0.57
    store = [[(-4, -a), (-4, a)], [(-4, a), (4, a)], [(4, -a), (-4, -a)]]
    assert drive_alone(store, (0.3, 3.0), (0.0, 0.0), 0.5, 40.0) < 20.0
    narrow = [[(0, y), (6, y)] for y in (0.555, -0.555)]
    assert drive_alone(narrow, (3.0, 0.0), (9.0, 0.0), 0.5, 20.0) < 10.0


@pytest.mark.parametrize("slope", [0.3, 0.8])
def test_a_corridor_of_a_grid_that_is_not_along_it_is_passed(slope: float) -> None:
    """Its outline has many short walls, whose conditions contradict each other at first."""
    y, x = np.mgrid[0:200, 0:200] * 0.05 - 4.975
    across = np.abs(y - slope * x) / np.hypot(1, slope)
    walls = walls_from_grid((across > 0.65) & (across < 0.9), 0.05, (-5, -5, 0))
    along = np.array([1, slope]) / np.hypot(1, slope)
    assert drive_alone(walls, -3.5 * along, 3.5 * along, 0.3, 30.0) < 20.0


def test_a_bent_corridor_is_passed_alike_however_its_walls_are_cut() -> None:
    times = list[float]()
    for pieces in (7, 14, 35):
        angles = np.linspace(0, np.pi / 2, pieces + 1)
        bend = np.column_stack([np.cos(angles), np.sin(angles)])
        walls = [(4.0 + side) * bend for side in (-0.65, 0.65)]
        times.append(drive_alone(walls, (4.0, 0.05), (0.05, 4.0), 0.3, 30.0))
    assert max(times) < 1.2 * min(times) < 12.0


@pytest.mark.parametrize(("width", "r_robot"), [(2.6, 0.3), (3.4, 0.5), (3.6, 0.5)])
def test_a_person_who_stands_in_a_corridor_is_passed_as_far_off_as_the_walls_leave(
    width: float, r_robot: float
) -> None:
    """Their zone reaches to the walls, so that the way leads through it."""
    settings = szlib.MPCSettings.among_people(time_limit=np.inf, r_robot=r_robot)
    walls = [[(-8, y), (8, y)] for y in (width / 2, -width / 2)]
    controller = szlib.MPCCBF(ZONE, walls=walls, settings=settings)
    x, goal = np.array([-3.0, 0.0, 0.0, 0.0]), (3.0, 0.0)
    gaps = list[float]()
    while np.hypot(*(x[:2] - goal)) > 0.2 and len(gaps) < 150:
        step = controller.step(x, goal, [szlib.Person((0.0, 0.0))])
        assert step.walls_safe and step.passively_safe
        x = advance(x, step.control, 0.1)
        gaps.append(np.hypot(*x[:2]) - BODY_RADIUS - r_robot)
    assert len(gaps) < 90
    widest = width / 2 - settings.eps - 2 * r_robot - BODY_RADIUS
    assert widest - 0.1 < min(gaps) < widest + 0.05


@pytest.mark.parametrize(
    ("width", "prices"),
    [(2.0, {}), (3.0, {"zone_price": np.inf}), (3.0, {"decay_price": np.inf})],
)
def test_a_robot_waits_where_nobody_can_be_passed_or_no_zone_may_be_entered(
    width: float, prices: dict[str, float]
) -> None:
    settings = szlib.MPCSettings.among_people(time_limit=np.inf, r_robot=0.3, **prices)
    walls = [[(-8, -width / 2), (8, -width / 2), (8, width / 2), (-8, width / 2)]]
    controller = szlib.MPCCBF(ZONE, walls=walls, settings=settings)
    x = np.array([-3.0, 0.0, 0.0, 0.0])
    for _ in range(120):
        step = controller.step(x, (3.0, 0.0), [szlib.Person((0.0, 0.0))])
        x = advance(x, step.control, 0.1)
        assert step.h[0] > -0.01
    assert np.hypot(*x[2:]) < 0.02 and step.stuck > 0


def test_a_goal_in_the_zone_of_a_person_who_stands_is_waited_for() -> None:
    controller, person = szlib.MPCCBF(ZONE, settings=AMONG), szlib.Person((3.0, 0.0))
    x, goal = np.zeros(4), (2.0, 0.3)
    for _ in range(80):
        step = controller.step(x, goal, [person])
        x = advance(x, step.control, 0.1)
        assert step.h[0] > -0.01 and step.goal_blocked
    assert np.hypot(*x[2:]) < 0.05


@pytest.mark.parametrize("walks", [False, True])
def test_only_zones_of_people_who_are_predicted_to_stand_are_shrunk(walks) -> None:
    """The way passes 0.3 m beside the body, and ends outside the zone."""
    later = Prediction([1.0, 2.0], [(1.0, 0.0), (2.0, 0.0)]) if walks else None
    person = szlib.Person((0.0, 0.0), prediction=later)
    scene = szlib.MPCCBF(ZONE, settings=AMONG).step(START, (3, 0), [person]).scene
    times = np.linspace(0.0, 6.0, 61)
    points = np.column_stack([times - 3, np.full(61, 0.85)])
    way = Way(points, times, 6.0)
    given = scene.barriers.groups[0].offsets
    found = _shrink_zones(scene, Heading((3.0, 0.85), 6.0, (way,))).groups[0].offsets
    cut = scene.zones.h(*points.T).min()
    expected = given if walks else given + cut + CELL / 3
    assert cut < -CELL and found == pytest.approx(expected)


def test_ways_know_a_prediction_beyond_the_horizon() -> None:
    """Somebody who is predicted to stop does not walk on."""
    times = np.arange(1.0, 11.0)
    stops = Prediction(times, np.tile([1.0, 0.0], (10, 1)))
    person = szlib.Person((0.0, 0.0), (1.0, 0.0), prediction=stops)
    later = np.array([0.5, 3.0, 6.0, 10.0])
    (places,) = find_places([person], later)
    assert places == pytest.approx(np.array([(0.5, 0), (1, 0), (1, 0), (1, 0)]))
    assert places[2] == pytest.approx(person.after(6.0).position)


@pytest.mark.parametrize("angle", [0.3, 0.9, 2.1, 2.8])
@pytest.mark.parametrize("r_robot", [0.1, 0.15])
def test_a_small_robot_takes_a_door_in_which_it_fits(r_robot, angle) -> None:
    """A room of 10 m with a wall across, and a door that leaves 1 cm to each side of disc and margin."""
    half = r_robot + 0.05 + 0.01
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    lines = np.array([[(0.0, -5.0), (0.0, -half)], [(0.0, half), (0.0, 5.0)]])
    corners = 5.0 * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    room = np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)
    walls = np.concatenate([lines, room]) @ turn
    settings = szlib.MPCSettings.among_people(r_robot=r_robot)
    controller = szlib.MPCCBF(ZONE, walls=walls, settings=settings)
    start, goal = np.array([(-2.5, 0.0), (2.5, 0.0)]) @ turn
    step = controller.step((*start, 0.0, 0.0), goal)
    assert not step.goal_blocked
    assert "through the door" in step.way


def predicted_walker(y: float, speed: float, knots: list[tuple[float, float]]):
    """A person at (2, y) who walks along y, and is predicted to be at each y of the `knots` (t, y)."""
    times, ys = np.transpose(knots)
    prediction = Prediction(times, np.column_stack([np.full(len(ys), 2.0), ys]))
    return szlib.Person((2.0, y), (0.0, speed), prediction=prediction)


@pytest.mark.parametrize(("time", "speed"), [(6.0, 0.5), (4.8, 0.45), (4.8, 0.4)])
def test_a_way_does_not_lead_through_somebody_who_is_predicted_to_come_back(
    time, speed
) -> None:
    """At the end they are where they began; in between they are in the robot's way."""
    person = predicted_walker(1.6, speed, [(time, 1.6 - speed * time)])
    step = szlib.MPCCBF(ZONE, settings=AMONG).step((-1, 0, 0.8, 0), (5, 0), [person])
    times = np.linspace(0.0, SEARCH_TIME, 200)
    (places,) = find_places([person], times)
    gaps = np.hypot(*(step.ways[0].at(times) - places).T) - AMONG.r_robot - BODY_RADIUS
    assert gaps.min() > 0


def test_front_and_behind_are_those_of_the_walk_at_that_time() -> None:
    """They walk to the left now, and are predicted to walk to the right when the robot is there."""
    person = predicted_walker(1.0, 0.5, [(1.0, 1.5), (12.0, -7.3)])
    step = szlib.MPCCBF(ZONE, settings=AMONG).step((-1, 0, 0.8, 0), (5, 0), [person])
    (x, y), times = step.ways[0].points.T, step.ways[0].times
    k = int(np.searchsorted(x, 2.0))
    is_behind = y[k] > person.after(float(times[k])).position[1]
    assert step.way == f"{'behind' if is_behind else 'in front of'} person 0"
