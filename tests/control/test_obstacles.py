"""Distances against an independent geometry, bounds on paths, and every kind of obstacle in use."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Sequence
from math import hypot
from pathlib import Path as File
from typing import Any

import casadi as ca
import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from laboratory import plot_admissible_controls
from studies.ipopt import ByIpopt

import szlib
from szlib.control import HalfPlane, Obstacle, Obstacles, Priority, Wall, Zone
from szlib.control.controller import advance, find_stopping_path
from szlib.control.obstacles import (
    Body,
    PaperWall,
    Path,
    barrier,
    cbf_residual,
    describe,
    ellipse_formula,
    number_kinds,
    restore,
    segment_formula,
)
from szlib.zones.ellipses import BODY_RADIUS

coordinate = st.floats(-5, 5)
point = st.tuples(coordinate, coordinate)
ZONE = szlib.Ellipse((0.3, -0.2), (1.0, 0.7), 0.4)
S = szlib.MPCSettings(time_limit=np.inf)
AMONG = szlib.MPCSettings.among_people(time_limit=np.inf)
EUCLIDEAN = szlib.MPCSettings(time_limit=np.inf, margin="euclidean")


def identify(obstacles):
    """What makes obstacles the same: their kinds and numbers."""
    return [(type(each), each.numbers) for each in obstacles]


def far_apart(a, b):
    return np.hypot(a[0] - b[0], a[1] - b[1]) > 0.1


@settings(derandomize=True, max_examples=200)
@given(point, point, st.floats(0, 1))
def test_a_segment_is_at_distance_zero_from_itself(a, b, share):
    if far_apart(a, b):
        on = (1 - share) * np.array(a) + share * np.array(b)
        assert szlib.segment_distance(on, a, b) == pytest.approx(0, abs=1e-12)


@settings(derandomize=True, max_examples=200)
@given(point, point, point)
def test_off_the_segment_the_distance_is_positive_and_euclidean_within_its_disc(
    p, a, b
):
    if not far_apart(a, b):
        return
    true = shapely.distance(shapely.Point(p), shapely.LineString([a, b]))
    found = szlib.segment_distance(p, a, b)
    if true > 1e-6:
        assert found > 0
    radius = np.hypot(a[0] - b[0], a[1] - b[1]) / 2
    if np.hypot(p[0] - (a[0] + b[0]) / 2, p[1] - (a[1] + b[1]) / 2) <= radius:
        line = shapely.LineString([2 * np.array(a) - b, 2 * np.array(b) - a])
        assert found == pytest.approx(true, abs=1e-9)
        assert found == pytest.approx(
            shapely.distance(shapely.Point(p), line), abs=1e-9
        )


def test_beyond_its_end_the_distance_is_euclidean_to_first_order():
    gaps = np.array([1e-2, 1e-3, 1e-4])
    found = szlib.segment_distance(np.c_[3 + gaps, 0 * gaps], (0, 0), (3, 0))
    assert np.abs(found - gaps) == pytest.approx(gaps**2 / 3, rel=1e-6)


@settings(derandomize=True, max_examples=100)
@given(point, point, point, st.floats(-np.pi, np.pi), point)
def test_moving_and_turning_everything_or_swapping_the_ends_changes_nothing(
    p, a, b, angle, shift
):
    if not far_apart(a, b):
        return
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    moved = [turn @ q + shift for q in (p, a, b)]
    here = szlib.segment_distance(p, a, b)
    assert szlib.segment_distance(*moved) == pytest.approx(here, abs=1e-6, rel=1e-9)
    assert szlib.segment_distance(p, b, a) == pytest.approx(here, abs=1e-9)
    here = szlib.ellipse_distance(p, ZONE)
    assert szlib.ellipse_distance(
        turn @ p + shift, ZONE.placed(shift, angle)
    ) == pytest.approx(here, abs=1e-9)


def test_the_ellipse_is_its_own_zero_level_and_divides_the_plane():
    assert szlib.ellipse_distance(ZONE.curve(100), ZONE) == pytest.approx(0, abs=1e-12)
    points = np.random.default_rng(0).uniform(-3, 3, (1000, 2))
    inside = shapely.contains_xy(shapely.Polygon(ZONE.curve(20_000)), points)
    assert ((szlib.ellipse_distance(points, ZONE) < 0) == inside).all()


def test_the_distance_to_a_circle_is_euclidean():
    circle = szlib.Ellipse((1.0, 2.0), (0.8, 0.8))
    points = np.random.default_rng(1).uniform(-3, 5, (200, 2))
    assert szlib.ellipse_distance(points, circle) == pytest.approx(
        np.hypot(*(points - (1, 2)).T) - 0.8
    )


@pytest.mark.parametrize(
    ("formula", "numbers"),
    [
        (segment_formula, (-1.0, 0.5, 2.0, 1.5)),
        (ellipse_formula, (-0.6, 0.1, 0.7, -0.2, 0.9)),
    ],
)
def test_numbers_and_symbols_agree_and_so_do_the_gradients(formula, numbers):
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    expression = formula(x, y, *numbers)
    both = ca.Function(
        "both", [x, y], [expression, ca.jacobian(expression, ca.vertcat(x, y))]
    )
    for px, py in np.random.default_rng(2).uniform(-4, 4, (50, 2)):
        value, gradient = (np.asarray(part).ravel() for part in both(px, py))
        assert value == pytest.approx(formula(px, py, *numbers), rel=1e-12)
        e = 1e-6
        numeric = [
            (formula(px + e, py, *numbers) - formula(px - e, py, *numbers)) / (2 * e),
            (formula(px, py + e, *numbers) - formula(px, py - e, *numbers)) / (2 * e),
        ]
        assert gradient == pytest.approx(numeric, abs=1e-7)


def test_distances_have_the_shape_of_the_points():
    assert szlib.segment_distance(np.zeros((4, 3, 2)), (0, 1), (1, 1)).shape == (4, 3)
    assert szlib.ellipse_distance((0, 0), ZONE).shape == ()


def test_the_condition_allows_h_to_fall_by_the_fraction_gamma_only():
    h = barrier(2.0, 0.5, 0.05)
    assert h == pytest.approx(1.45)
    assert cbf_residual((1 - 0.05) * h, h, 0.05) == pytest.approx(0)
    assert cbf_residual(0.9 * h, h, 0.05) < 0 < cbf_residual(0.96 * h, h, 0.05)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (((0, 0), (1, 2), (1, 2)), r"two different end points.*got \[\[1.0, 2.0\]"),
        (((0, np.nan), (0, 0), (1, 0)), "points must be finite"),
        (((0, 0), (0, 0), (np.inf, 0)), "wall must be finite"),
        (((0, 0, 0), (0, 0), (1, 0)), r"points must have shape .* got \(3,\)"),
        ((("a", "b"), (0, 0), (1, 0)), "points must be numbers"),
    ],
)
def test_points_and_walls_that_cannot_be_used_raise_an_error(arguments, message):
    with pytest.raises(szlib.SolverError, match=message):
        szlib.segment_distance(*arguments)


# --- kinds of obstacles ------------------------------------------------------------------------------


class Table(Obstacle):
    """A round table, as a user would write it: (x, y, radius) [m]."""

    kind = "table"

    @staticmethod
    def distance(x: Any, y: Any, t: Any, *numbers: Any) -> Any:
        px, py, radius = numbers
        return ((x - px) ** 2 + (y - py) ** 2) ** 0.5 - radius


def some_of_each(rng: np.random.Generator) -> list[Obstacle]:
    """Obstacles of every kind, sorted by kind."""
    zone = szlib.Ellipse((0.1, 0.05), (0.9, 0.6), rng.uniform(-3, 3))
    velocities = [tuple(v) for v in rng.uniform(-2, 2, (2, 2)).tolist()]
    places = [tuple(p) for p in rng.uniform(-3, 3, (2, 2)).tolist()]
    zones = [
        Zone(*Zone.place(zone, p, rng.uniform(-3, 3), v))
        for p, v in zip(places, velocities, strict=True)
    ]
    return [
        *zones,
        *(Body(*p, *v) for p, v in zip(places, velocities, strict=True)),
        *(Wall(*ends) for ends in rng.uniform(-3, 3, (3, 4)).tolist()),
        PaperWall(*rng.uniform(-3, 3, 4).tolist()),
        HalfPlane(rng.uniform(-3, 3, 2), rng.normal(size=2)),
        Table(*rng.uniform(-3, 3, 2).tolist(), 0.6),
    ]


def as_measured(each: Obstacle, s: szlib.MPCSettings) -> Obstacle:
    """The obstacle that measures this one by these settings: of a wall, a `PaperWall` or a `Wall`."""
    (found,) = Obstacles.of([each], s).items
    return found


@pytest.mark.parametrize("s", [S, EUCLIDEAN], ids=["required", "euclidean"])
def test_h_of_a_table_of_obstacles_is_that_of_each_obstacle(s):
    rng = np.random.default_rng(3)
    items = [as_measured(each, s) for each in some_of_each(rng)]
    table, (x, y) = Obstacles.of(items, s), rng.uniform(-4, 4, (2, 5, 6))
    t = rng.uniform(0, 2, (5, 6))
    assert identify(table.items) == identify(items) and table.size == len(items)
    h, gaps = table.h(x, y, t), table.gaps(x, y, t)
    assert h.shape == gaps.shape == (len(items), 5, 6)
    for each, own_h, own_gap in zip(items, h, gaps, strict=True):
        offset = s.r_robot + each.margin(s)
        assert own_h == pytest.approx(each.distance(x, y, t, *each.numbers) - offset)
        assert own_gap == pytest.approx(each.gap(x, y, t, *each.numbers) - s.r_robot)
    assert table.h(0.3, 0.4).shape == (len(items),)
    assert Obstacles((), s.r_robot).h(x, y, t).shape == (0, 5, 6)
    walls = Obstacles.of(items[4:7], s)
    both = Obstacles.of(items[:2], s).joined(walls)
    assert identify(both.items) == identify([*items[:2], *items[4:7]])


def test_each_kind_has_one_formula_for_numbers_and_symbols():
    rng, symbols = np.random.default_rng(4), ca.SX.sym("xyt", 3)
    for each in some_of_each(rng):
        for formula in (each.distance, each.gap):
            value = ca.Function(
                "f", [symbols], [formula(*ca.vertsplit(symbols), *each.numbers)]
            )
            for point in rng.uniform(-4, 4, (10, 3)):
                expected = formula(*point.tolist(), *each.numbers)
                assert float(value(point)) == pytest.approx(expected, rel=1e-11)


def test_no_distance_changes_by_more_than_the_robot_and_the_obstacle_move():
    """As `Obstacle` requires of `gap`, from which ways are bounded."""
    rng = np.random.default_rng(5)
    for _ in range(20):
        for each in some_of_each(rng):
            (speed,) = each.speeds(np.array([each.numbers]))
            p, t = rng.uniform(-4, 4, (50, 2)), rng.uniform(0, 2, 50)
            q, later = p + rng.normal(0, 0.2, (50, 2)), t + rng.uniform(0, 0.3, 50)
            moved = np.hypot(*(q - p).T) + speed * (later - t)
            change = each.gap(*q.T, later, *each.numbers) - each.gap(
                *p.T, t, *each.numbers
            )
            assert (np.abs(change) <= moved + 1e-9).all(), each


@pytest.mark.parametrize("length", [1e-3, 0.1, 1.0, 10.0, 100.0])
def test_the_distance_of_the_paper_is_between_the_true_one_and_that_ahead_of_an_end(
    length,
):
    """s <= d <= s + s^2/L, and s = F^-1(d) changes by no more than the robot moves."""
    rng, ends = np.random.default_rng(6), (-length / 2, 0.0, length / 2, 0.0)
    p = rng.normal(size=(20000, 2)) * (length + np.geomspace(1e-3, 50, 20000))[:, None]
    q = p + rng.normal(0, 0.2, p.shape)
    d = [PaperWall.distance(*each.T, 0.0, *ends) for each in (p, q)]
    true = Wall.distance(*p.T, 0.0, *ends)
    assert (true <= d[0] + 1e-9).all()
    assert (d[0] <= (true + true**2 / length) * (1 + 1e-9) + 1e-9).all()
    s = [length / 2 * (np.sqrt(1 + 4 * each / length) - 1) for each in d]
    assert (np.abs(s[1] - s[0]) <= np.hypot(*(q - p).T) + 1e-9).all()


def test_a_wall_is_measured_as_the_settings_say():
    wall, ahead = Wall(-1.0, 0.0, 0.0, 0.0), (1.0, 0.0)
    expected = {"euclidean": 1.0 - 0.55, "paper": 2.0 - 0.55, "required": 2.0 - 0.75}
    for margin, h in expected.items():
        settings = szlib.MPCSettings(margin=margin)
        assert Obstacles.of([wall], settings).h(*ahead) == pytest.approx(h)
        assert Obstacles.of([wall], settings).gaps(*ahead) == pytest.approx(0.5)
    assert type(restore(describe(PaperWall(*wall.numbers)))) is Wall


class ThickWall(Wall):
    """A wall of a user, 0.3 m thick on each side, around which the robot keeps 0.1 m."""

    kind = "thick wall"

    @staticmethod
    def distance(x: Any, y: Any, t: Any, *numbers: Any) -> Any:
        return Wall.distance(x, y, t, *numbers) - 0.3

    gap = distance

    def margin(self, settings: szlib.MPCSettings) -> float:
        return 0.1


@pytest.mark.parametrize("s", [S, AMONG], ids=["default", "among people"])
def test_a_kind_of_wall_of_a_user_keeps_its_distance_and_margin(s):
    wall = ThickWall(0.0, -5.0, 0.0, 5.0)
    controller = szlib.MPCCBF(ZONE, obstacles=[wall], settings=s)
    step = controller.step((-2.0, 0.0, 0.0, 0.0), (-1.0, 0.0))
    assert identify(step.obstacles) == identify([wall])
    assert step.h == pytest.approx([2.0 - 0.3 - 0.6])
    assert step.clearance[0, 0] == pytest.approx(2.0 - 0.3 - 0.5)
    assert step.verify().ok


def test_a_zone_in_the_world_is_the_zone_placed_at_its_person():
    rng, person = np.random.default_rng(6), szlib.Person((1.0, -2.0), (0.4, 0.3))
    numbers = Zone.place(ZONE, person.position, person.heading, person.velocity)
    for t in (0.0, 1.5):
        points = rng.uniform(-4, 4, (40, 2))
        placed = ZONE.placed(person.after(t).position, person.heading)
        expected = szlib.ellipse_distance(points, placed)
        assert Zone.distance(*points.T, t, *numbers) == pytest.approx(expected)
        gaps = np.hypot(*(points - person.after(t).position).T) - BODY_RADIUS
        assert Zone.gap(*points.T, t, *numbers) == pytest.approx(gaps)


@pytest.mark.parametrize("length", [0.001, 0.1, 0.5, 1.0, 5.0, 12.0])
def test_the_margin_of_a_wall_is_what_it_requires_and_never_less_than_eps(length):
    wall, paper = Wall(0.0, 0.0, length, 0.0), szlib.MPCSettings(margin="paper")
    assert wall.margin(S) == max(0.05, 0.25 / length)
    assert wall.margin(paper) == wall.margin(EUCLIDEAN) == 0.05
    table = Obstacles.of([wall], S)
    for touching in ((length + 0.5, 0.0), (-0.3, 0.4), (length + 0.3, -0.4)):
        assert table.h(*touching)[0] <= 1e-9
    beside = (length / 2, 0.5 * (1 + 0.42) + 0.05)
    assert table.h(*beside)[0] >= 0, "no more than 0.42 r of room is given away"


# --- bounds on a path --------------------------------------------------------------------------------


def braking_paths(seed: int, n: int) -> list[tuple[Path, Any]]:
    """Paths of a robot that holds a control and then brakes, and its positions at many times."""
    rng, found = np.random.default_rng(seed), list[Any]()
    for _ in range(n):
        state = np.r_[rng.uniform(-2, 2, 2), rng.uniform(-1.5, 1.5, 2)]
        control = rng.uniform(-1, 1, 2)
        path = find_stopping_path(state.tolist(), control[None], S)

        def move(t, state=state, control=control):
            """Where the robot is at a time: it brakes in steps of dt, the last one as far as needed."""
            while t > S.dt:
                state, t = advance(state, control, S.dt), t - S.dt
                lasts = max(S.dt, np.abs(state[2:]).max() / S.a_max)
                control = -state[2:] / lasts
            return advance(state, control, t)[:2]

        found.append((path, move))
    return found


def test_the_stopping_path_passes_where_the_robot_is():
    for path, move in braking_paths(7, 30):
        for k, (point, time) in enumerate(zip(path.points, path.times, strict=True)):
            assert move(time) == pytest.approx(point, abs=1e-9), k
        for k, bow in enumerate(path.bows):
            t = np.linspace(path.times[k], path.times[k + 1], 11)
            at = np.array([move(each) for each in t])
            straight = np.linspace(path.points[k], path.points[k + 1], 11)
            assert np.hypot(*(at - straight).T).max() <= bow + 1e-9


@pytest.mark.parametrize("is_barrier", [False, True])
def test_the_bound_of_a_path_is_below_every_gap_on_it_and_not_far_below(is_barrier):
    rng, slack = np.random.default_rng(8), list[float]()
    for path, move in braking_paths(9, 60):
        items = some_of_each(rng)
        # h of walls beyond their ends changes by more than the robot moves
        some = items[:2] if is_barrier else items
        t = np.linspace(0, path.times[-1], 801)
        x, y = np.array([move(each) for each in t]).T
        for each in some:
            table = Obstacles.of([each], S)
            measure = table.h if is_barrier else table.gaps
            bound, seen = table.bound(path, is_barrier=is_barrier)
            true, at_points = (
                measure(x, y, t)[0],
                measure(*path.points.T, path.times)[0],
            )
            if bound == np.inf:
                assert true.min() > 0, "it is left out only where it cannot be reached"
                continue
            assert bound <= true.min() + 1e-9
            assert at_points.min() - 1e-9 <= seen <= at_points[1:].min() + 1e-9
            if true.min() < 0.5 and bound < 0:
                slack.append(true.min() - bound)
        together = Obstacles.of(some, S).bound(path, is_barrier=is_barrier)
        alone = [
            Obstacles.of([each], S).bound(path, is_barrier=is_barrier) for each in some
        ]
        assert together == pytest.approx(np.min(alone, axis=0))
    assert len(slack) > 30 and np.median(slack) < 0.01


def test_a_path_among_no_obstacles_has_no_bound():
    path = find_stopping_path((0.0, 0.0, 1.0, 0.0), np.zeros((1, 2)), S)
    assert Obstacles((), 0.5).bound(path) == (np.inf, np.inf)


# --- a half-plane, and an obstacle of a user ---------------------------------------------------------

EDGE = HalfPlane(point=(0.0, -1.0), normal=(0.0, 2.0))
NEAR_EDGE = HalfPlane(point=(0.0, -0.7), normal=(0.0, 1.0))


@settings(derandomize=True, max_examples=100)
@given(point, point, st.floats(-np.pi, np.pi))
def test_h_of_a_half_plane_is_the_signed_distance_to_its_edge(p, on, angle):
    normal = np.array([np.cos(angle), np.sin(angle)])
    edge = HalfPlane(on, 3.0 * normal)
    along = 100 * np.array([-normal[1], normal[0]])
    line = shapely.LineString([np.array(on) - along, np.array(on) + along])
    distance = line.distance(shapely.Point(p))
    side = np.sign((np.array(p) - on) @ normal)
    found = Obstacles.of([edge], S)
    assert found.h(*p)[0] == pytest.approx(side * distance - 0.55, abs=1e-9)
    assert found.gaps(*p)[0] == pytest.approx(side * distance - 0.5, abs=1e-9)


@pytest.mark.parametrize(
    ("point", "normal"),
    [((0, 0), (0, 0)), ((0, np.nan), (0, 1)), ((0, 0, 0), (0, 1)), ((0, 0), "up")],
)
def test_a_half_plane_without_a_direction_is_refused(point, normal):
    with pytest.raises(szlib.SolverError, match=r"normal must|point must"):
        HalfPlane(point, normal)


def drive_of(kind: Any, obstacles: Sequence[Obstacle], **changes: Any) -> Any:
    chosen = szlib.MPCSettings.among_people if changes.pop("people", 0) else None
    made = (chosen or szlib.MPCSettings)(**{"time_limit": np.inf} | changes)
    return kind(ZONE, obstacles=obstacles, settings=made)


CONTROLLERS = {
    "default": lambda obstacles: drive_of(szlib.MPCCBF, obstacles),
    "among people": lambda obstacles: drive_of(szlib.MPCCBF, obstacles, people=1),
    "two wheels": lambda obstacles: drive_of(
        szlib.DifferentialDrive, obstacles, r_robot=0.3
    ),
}


@pytest.mark.parametrize("kind", CONTROLLERS)
def test_no_robot_crosses_a_half_plane_whoever_comes(kind):
    """Its goal lies beyond the edge, and then two people walk towards it."""
    controller = CONTROLLERS[kind]([EDGE])
    own = controller.robot.start(np.array([-2.0, 1.0, 0.6, -0.6]))
    radius, lowest = controller.settings.r_robot, np.inf
    people = np.array([[0.0, 3.0, 0.0, -1.2], [3.0, 3.0, -0.5, -1.1]])
    for k in range(90):
        seen = people if k > 40 else people[:0]
        step = controller.step(own, (1.0, -3.0), seen)
        assert step.walls_safe and step.verify().ok, step.explain()
        own = controller.robot.advance(own, step.control, 0.1)
        y = controller.robot.body(own)[1]
        lowest = min(lowest, y + 1.0 - radius)
        people[:, :2] += 0.1 * people[:, 2:] * (k > 40)
    assert 0.0 <= lowest < 0.6


def test_a_step_names_a_half_plane():
    controller = drive_of(szlib.MPCCBF, [EDGE, HalfPlane((9.0, 0.0), (-1.0, 0.0))])
    step = controller.step((0.0, -0.2, 0.0, 0.0), (0.0, -5.0), [[2.0, 3.0, 0.0, 0.0]])
    assert [each.kind for each in step.obstacles] == ["person", "half-plane", "half-plane"]  # fmt: skip
    assert step.scene.name(1) == "half-plane 0 (0, -1, 0, 1)"
    assert step.scene.name(2).startswith("half-plane 1 (9, 0, -1")
    assert "nearest is half-plane 0 (0, -1, 0, 1)" in step.explain()
    assert step.goal_blocked and "cannot be reached" in step.explain()
    with pytest.raises(szlib.SolverError, match="m for half-plane 0"):
        controller.check_start((0.0, 0.0, 0.0, 0.0), (0.0, -5.0))
    assert repr(EDGE) == "half-plane (0, -1, 0, 1)"


@pytest.mark.parametrize("obstacle", [NEAR_EDGE, Table(0.0, -0.3, 0.7)], ids=["edge", "table"])  # fmt: skip
@pytest.mark.parametrize("kind", CONTROLLERS)
def test_an_obstacle_goes_through_run_log_and_figures(obstacle, kind, tmp_path: File):
    """A half-plane, and a kind that szlib does not know: only the class is written."""
    import matplotlib.pyplot as plt
    import plots

    walls, person = [((-6.0, 2.5), (6.0, 2.5))], szlib.Person((5.0, 0.8), (-0.6, 0.1))
    scenario = szlib.Scenario(
        "hall", (-3.0, 0.2, 0, 0), (3.0, 0.2), (person,), walls, obstacles=[obstacle]
    )
    controller = CONTROLLERS[kind]([obstacle])
    controller.set_walls(walls)
    log = szlib.simulate(scenario, controller, max_time=6.0)
    if obstacle is NEAR_EDGE:
        expected = log.states[:, 1] + 0.7
    else:
        expected = np.hypot(*(log.states[:, :2] - (0.0, -0.3)).T) - 0.7
    radius = log.settings.r_robot
    assert log.clearance[:, 2] == pytest.approx(expected - radius)
    assert log.h[:, 2] == pytest.approx(expected - radius - 0.05)
    assert log.clearance[:, 1:].min() >= 0
    assert log.table[f"h_{obstacle.kind}_0"].to_numpy() == pytest.approx(log.h[:, 2])
    metrics = log.metrics()
    assert metrics["unflagged_violations"] == metrics["unflagged_overlaps"] == 0

    log.save(tmp_path / "run")
    loaded = szlib.SimulationLog.load(tmp_path / "run")
    assert identify(loaded.scenario.obstacles) == identify([obstacle])
    assert np.array_equal(loaded.h, log.h) and loaded.metrics() == metrics

    ax = log.plot()
    assert obstacle.kind in [text.get_text() for text in ax.get_legend().get_texts()]
    step = controller.step(log.states[-1] if kind != "two wheels" else [0, 0.9, 0], (3.0, 0.2))  # fmt: skip
    point = getattr(step, "point", step)
    plots.plot_step(point)
    plot_admissible_controls(point)
    plt.close("all")
    assert step.verify().ok and point.scene.name(1).startswith(f"{obstacle.kind} 0 (")


def test_a_table_is_avoided_by_the_plans_of_ipopt_too_and_by_copies():
    table = Table(0.0, 0.2, 0.6)
    question = (-2.0, 0.0, 0.3, 0.0), (4.0, 0.0)
    sqp, ipopt = (drive_of(make, [table], N_h=8) for make in (szlib.MPCCBF, ByIpopt))
    step = sqp.step(*question)
    assert step.residual.min() == pytest.approx(0, abs=1e-5), (
        "the table bounds the plan"
    )
    assert ipopt.step(*question).control == pytest.approx(step.control, abs=1e-3)
    for again in (copy.deepcopy(sqp), pickle.loads(pickle.dumps(sqp))):
        sqp.reset()
        again.reset()
        assert np.array_equal(
            again.step(*question).control, sqp.step(*question).control
        )


def test_something_that_is_no_obstacle_is_refused():
    for wrong in ("table", (0.0, 0.0, 1.0), Wall):
        with pytest.raises(szlib.SolverError, match="an obstacle must be an Obstacle"):
            szlib.MPCCBF(ZONE, obstacles=[wrong])
    with pytest.raises(szlib.SolverError, match=r"numbers of a table must be finite"):
        szlib.MPCCBF(ZONE, obstacles=[Table(0.0, np.nan, 1.0)])


@pytest.mark.parametrize(
    "distance",
    [
        lambda x, y, t, px: hypot(x - px, y),
        lambda x, y, t, px: max(x - px, y),
        lambda x, y, px: x - px,
        lambda x, y, t, px: np.linalg.norm([x - px, y]),
    ],
)
def test_a_distance_that_is_no_formula_is_refused_with_advice(distance):
    kind = type("Odd", (Obstacle,), {"distance": staticmethod(distance)})
    with pytest.raises(szlib.SolverError, match=r"odd \(5\): .* by operators only"):
        szlib.MPCCBF(ZONE, obstacles=[kind(5.0)])


@pytest.mark.parametrize("obstacles", [None, HalfPlane((0.0, 0.0), (0.0, 1.0))])
def test_obstacles_must_be_a_list(obstacles):
    with pytest.raises(szlib.SolverError, match="obstacles must be a list"):
        szlib.MPCCBF(ZONE, obstacles=obstacles)


def test_an_obstacle_is_restored_from_its_kind_and_numbers():
    for each in some_of_each(np.random.default_rng(10)):
        restored = restore(describe(each))
        assert restored.numbers == each.numbers
        for s in (S, EUCLIDEAN):
            assert type(as_measured(restored, s)) is type(as_measured(each, s))
    with pytest.raises(
        szlib.SolverError, match=r"kind of an obstacle must be that of a class.*'sofa'"
    ):
        restore({"kind": "sofa", "numbers": [1.0]})
    names = number_kinds([Wall(0, 0, 1, 0), EDGE, Wall(0, 1, 1, 1)])
    assert names == ["wall_0", "half-plane_0", "wall_1"]


class Disc(Obstacle):
    """A disc of a user, whose violation is as bad as that of a zone."""

    priority = Priority.ZONE

    @staticmethod
    def distance(x, y, t, px, py, radius):
        return ((x - px) ** 2 + (y - py) ** 2) ** 0.5 - radius


class Bollard(Disc):
    priority = Priority.BODY


class Polygon(Obstacle):
    """The half-planes of a convex polygon, of any number."""

    @staticmethod
    def distance(x, y, t, *edges):
        lines = [edges[k : k + 3] for k in range(0, len(edges), 3)]
        distances = [nx * x + ny * y - d for nx, ny, d in lines]
        return sum(d**2 for d in distances) ** 0.5


@pytest.mark.parametrize("kind", [Disc, Bollard])
@pytest.mark.parametrize("n", [0, 1, 2])
def test_a_step_beside_a_users_obstacle_of_any_priority_is_verified(kind, n):
    people = [[k, 3, 0, 0] for k in range(n)]
    controller = szlib.MPCCBF(ZONE, obstacles=[kind(2, 0.1, 0.3)], settings=S)
    assert controller.step((0, 0, 0.5, 0), (5, 0), people).verify().ok


def test_no_body_of_a_user_is_bought_at_the_price_of_a_zone():
    settings = szlib.MPCSettings.among_people(time_limit=np.inf)
    rng = np.random.default_rng(0)
    for x, y, speed in rng.uniform((1, -0.3, 0.5), (2, 0.3, 0.9), (40, 3)):
        controller = szlib.MPCCBF(
            ZONE, obstacles=[Bollard(x, y, 0.3)], settings=settings
        )
        step = controller.step((0, 0, speed, 0), (5, 0))
        assert step.status != "optimal" or step.feasible


def test_obstacles_of_one_class_may_have_different_numbers():
    triangle = Polygon(0, 1, 3, 1, 0, 3, 0, -1, 3)
    two = Polygon(0, 1, 3, 1, 0, 3)
    step = szlib.MPCCBF(ZONE, obstacles=[triangle, two, triangle]).step(
        (0, 0, 0, 0), (1, 0)
    )
    np.testing.assert_allclose(
        step.h, np.array([27, 18, 27]) ** 0.5 - S.r_robot - S.eps
    )


@pytest.mark.parametrize("level", [Priority.WALL, Priority.BODY, Priority.ZONE])
@pytest.mark.parametrize("settings", [S, szlib.MPCSettings.among_people()])
def test_an_obstacle_without_a_barrier_condition_is_verified_and_run(level, settings):
    class Rug(Obstacle):
        kind, priority, has_barrier = "rug", level, False

        @staticmethod
        def distance(x, y, t, px, py, radius):
            return ((x - px) ** 2 + (y - py) ** 2) ** 0.5 - radius

    people = (szlib.Person((3, 1), (-0.5, 0)),)
    rug = (Rug(2.0, 0.1, 0.4),)
    scenario = szlib.Scenario("rug", (0, 0, 0, 0), (4, 0), people, obstacles=rug)
    controller = szlib.MPCCBF(ZONE, obstacles=rug, settings=settings)
    step = controller.step((0, 0, 0.5, 0), (4, 0), people)
    assert step.verify().faults == () and step.residual.shape == (2, settings.N_h)
    assert szlib.simulate(scenario, controller).metrics()["outcome"] == "arrived"


def test_an_obstacle_without_numbers_is_refused():
    class Pool(Obstacle):
        distance = staticmethod(lambda x, y, t: ((x - 2) ** 2 + y**2) ** 0.5 - 0.5)

    with pytest.raises(szlib.SolverError, match=r"the numbers of a pool .*\(1,\)"):
        Pool()


def test_decay_is_no_priority_of_an_obstacle():
    with pytest.raises(szlib.SolverError, match="priority of rug must be WALL, BODY"):

        class Rug(Obstacle):
            priority = Priority.DECAY


def test_new_walls_and_obstacles_hold():
    controller = szlib.MPCCBF(ZONE)
    controller.set_walls([[(2, -3), (2, 3)]])
    controller.obstacles = [HalfPlane((0.0, -2.0), (0.0, 1.0))]
    step = controller.step((0, 0, 0, 0), (5, 0))
    assert [each.kind for each in step.obstacles] == ["wall", "half-plane"]
    controller.set_walls([])
    assert [each.kind for each in controller.obstacles] == ["half-plane"]
    with pytest.raises(szlib.SolverError, match="an obstacle must be an Obstacle"):
        controller.obstacles = [3]
    assert len(controller.obstacles) == 1 and len(controller.walls) == 0


@pytest.mark.parametrize("level", [Priority.WALL, Priority.BODY, Priority.ZONE])
def test_a_row_without_a_barrier_is_a_row_of_the_plan(level):
    class Rug(Obstacle):
        priority = level
        has_barrier = False

        @staticmethod
        def distance(x, y, t, px, py, radius):
            return ((x - px) ** 2 + (y - py) ** 2) ** 0.5 - radius

    controller = szlib.MPCCBF(ZONE, obstacles=[Rug(1.3, 0.0, 0.3)])
    step = controller.step((0, 0, 1, 0), (5, 0))
    assert step.violations[level] == pytest.approx(step.slack) and step.slack > 0.01
    assert not step.feasible and not step.safe
    assert step.verify().ok and "the plan violates" in step.explain()


def test_what_moves_is_no_wall():
    class Gate(Obstacle):
        @staticmethod
        def distance(x, y, t, px, py, vx, vy):
            return ((x - px - t * vx) ** 2 + (y - py - t * vy) ** 2) ** 0.5

    with pytest.raises(szlib.SolverError, match="walls stand still"):
        szlib.MPCCBF(ZONE, obstacles=[Gate(1.0, 0.0, -1.5, 0.0)])
