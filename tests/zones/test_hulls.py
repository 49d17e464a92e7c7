"""Hull, slices and the zone's boundary, against linear programming and ray casting."""

import re

import numpy as np
import pytest
from scipy.optimize import linprog
from shapely import LineString, MultiPoint, Point, Polygon

import szlib
from szlib.zones.hulls import Slice, hull_vertices, slice_hull

R_MAX = 2.0
CUBE = np.array(
    [(x, y, v) for x in (-1.0, 1.0) for y in (-1.0, 1.0) for v in (0.0, 2.0)]
)


def cloud(seed, n=60):
    """Points all around the origin of the complementary plane, at all speeds."""
    rng = np.random.default_rng(seed)
    angle, radius = rng.uniform(-np.pi, np.pi, n), 1.5 * np.sqrt(rng.uniform(0, 1, n))
    return np.column_stack(
        [radius * np.cos(angle), radius * np.sin(angle), rng.uniform(0.3, 1.8, n)]
    )


def within_hull(points, query):
    """Whether weights exist that mix the points to the query: the definition of a hull."""
    mix = linprog(
        np.zeros(len(points)),
        A_eq=np.vstack([points.T, np.ones(len(points))]),
        b_eq=[*query, 1],
        bounds=(0, None),
    )
    return mix.status == 0


# --- the hull ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(3))
def test_vertices_are_the_points_outside_the_hull_of_the_others(seed):
    points = cloud(seed, 30)
    vertices = {tuple(v) for v in hull_vertices(points)}
    for k, point in enumerate(points):
        assert (tuple(point) in vertices) == (
            not within_hull(np.delete(points, k, axis=0), point)
        )


def test_points_inside_and_copies_add_no_vertex():
    rng = np.random.default_rng(0)
    more = np.vstack(
        [CUBE, CUBE, rng.uniform(-0.9, 0.9, (50, 3)) + np.array([0, 0, 1])]
    )
    assert {tuple(v) for v in hull_vertices(more)} == {tuple(v) for v in CUBE}


@pytest.mark.parametrize(
    ("points", "message"),
    [
        (CUBE[:3], r"n >= 4, .*got \(3, 3\)"),
        (CUBE[:0], r"n >= 4, .*got \(0, 3\)"),
        (CUBE[:, :2], r"shape \(n, 3\), .*x', y', speed.*got \(8, 2\)"),
        (CUBE * [1, 1, 0], r"all 8 points lie in one plane .* 2 m, 2 m, 0 m/s"),
        (CUBE * [1, 0, 0], "lie in one plane"),
        (np.ones((9, 3)), "lie in one plane"),
        (np.vstack([CUBE, [0, np.nan, 1]]), "must be finite; point 8 is"),
        (np.vstack([[0, 0, np.inf], CUBE]), "must be finite; point 0 is"),
    ],
)
def test_points_without_a_hull_are_refused(points, message):
    with pytest.raises(szlib.ZoneError, match=message):
        hull_vertices(points)
    with pytest.raises(szlib.ZoneError, match=message):
        slice_hull(points, 1.0, r_max=R_MAX)


# --- slices ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("speed", [0.7, 1.1])
def test_a_point_is_in_the_slice_where_it_is_in_the_hull(seed, speed):
    points = cloud(seed)
    section = Polygon(slice_hull(points, speed, r_max=R_MAX).polygon)
    rng = np.random.default_rng(seed)
    inside = 0
    for x, y in rng.uniform(-1.6, 1.6, (40, 2)):
        assert section.contains(Point(x, y)) == within_hull(
            points, np.array([x, y, speed])
        )
        inside += section.contains(Point(x, y))
    assert 0 < inside < 40


def test_slice_exists_at_the_speed_of_a_vertex():
    pyramid = np.array(
        [(1, 1, 0), (-1, 1, 0), (-1, -1, 0), (1, -1, 0), (0, 0, 2), (1.5, 0, 1)], float
    )
    section = Polygon(slice_hull(pyramid, 1.0, r_max=R_MAX).polygon)
    expected = MultiPoint(
        [(x / 2, y / 2) for x, y, _ in pyramid[:4]] + [(1.5, 0)]
    ).convex_hull
    assert section.symmetric_difference(expected).area < 1e-12


def test_slice_exists_in_the_plane_of_many_vertices():
    """Two boxes on top of each other: every vertex of the middle lies in the slice."""
    stack = np.vstack([CUBE, CUBE + np.array([0, 0, 2])])
    assert Polygon(slice_hull(stack, 2.0, r_max=R_MAX).polygon).area == pytest.approx(4)


@pytest.mark.parametrize("seed", range(3))
def test_polygons_are_convex_and_counter_clockwise(seed):
    corners = slice_hull(cloud(seed), 1.0, r_max=R_MAX).polygon
    along = np.roll(corners, -1, axis=0) - corners
    following = np.roll(along, -1, axis=0)
    assert (along[:, 0] * following[:, 1] - along[:, 1] * following[:, 0] > 0).all()


@pytest.mark.parametrize("speed", [-1.0, 0.0, 2.0, 5.0, np.nan, np.inf])
def test_a_speed_outside_the_data_names_the_range(speed):
    with pytest.raises(
        szlib.ZoneError, match=rf"at {speed:g} m/s .* covers 0.000 to 2.000 m/s"
    ):
        slice_hull(CUBE, speed, r_max=R_MAX)


@pytest.mark.parametrize("speed", [1e-300, 1e-15, 1e-9, 2 - 1e-15])
def test_a_slice_at_the_very_edge_is_whole_or_undefined(speed):
    """A cone's tip has no extent; the box has it to its very end."""
    assert Polygon(slice_hull(CUBE, speed, r_max=R_MAX).polygon).area == pytest.approx(
        4
    )
    cone = np.vstack([CUBE[CUBE[:, 2] > 1] * [1, 1, 1], [0, 0, 0]])
    try:
        section = slice_hull(cone, speed, r_max=R_MAX)
    except szlib.ZoneError as error:
        assert "undefined" in str(error)
    else:
        assert Polygon(section.polygon).area == pytest.approx(speed**2, rel=1e-6)


# --- the zone's boundary -----------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(4))
def test_boundary_is_the_rest_of_a_ray_through_the_slice(seed):
    section = slice_hull(cloud(seed), 1.0, r_max=R_MAX)
    rim = Polygon(section.polygon).exterior
    theta = np.random.default_rng(seed).uniform(-np.pi, np.pi, 200)
    for angle, point in zip(theta, section.boundary(theta), strict=True):
        direction = np.array([np.cos(angle), np.sin(angle)])
        hit = rim.intersection(LineString([(0, 0), 9 * direction]))
        assert hit.geom_type == "Point"
        np.testing.assert_allclose(
            point, (R_MAX - np.hypot(hit.x, hit.y)) * direction, atol=1e-9
        )


def test_shapes_follow_theta():
    section = slice_hull(cloud(1), 1.0, r_max=R_MAX)
    theta = np.linspace(0, 6, 12).reshape(3, 4)
    assert section.reach(theta).shape == (3, 4)
    assert section.boundary(theta).shape == (3, 4, 2)
    np.testing.assert_array_equal(
        section.boundary(theta[1, 2]), section.boundary(theta)[1, 2]
    )
    np.testing.assert_allclose(
        section.boundary(theta + 2 * np.pi), section.boundary(theta), atol=1e-12
    )


def test_between_corner_angles_the_boundary_is_that_of_one_edge():
    """1 / R' is a sum of one cosine and one sine there; so it is smooth, as the ellipse needs it."""
    section = slice_hull(cloud(2), 1.0, r_max=R_MAX)
    angles = section.corner_angles
    assert len(angles) == len(section.polygon)
    for low, high in zip(
        angles, np.append(angles[1:], angles[0] + 2 * np.pi), strict=True
    ):
        theta = np.linspace(low, high, 7)
        basis = np.column_stack([np.cos(theta), np.sin(theta)])
        inverse = 1 / section.reach(theta)
        wave = np.linalg.lstsq(basis, inverse, rcond=None)[0]
        np.testing.assert_allclose(basis @ wave, inverse, rtol=1e-6)


# --- the origin outside ------------------------------------------------------------------------------


def missing_directions(message):
    low, high = re.search(
        r"directions from (-?\d+) counter-clockwise to (-?\d+) deg", message
    ).groups()
    return int(low), int(high)


@pytest.mark.parametrize("towards", range(-180, 180, 15))
def test_the_missing_directions_are_those_that_miss_the_slice(towards):
    angle = np.radians(towards)
    corners = np.array([(0.2, 0.1), (1.0, -0.3), (1.4, 0.2), (0.9, 0.6)])
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    box = np.vstack(
        [np.column_stack([corners @ turn.T, np.full(4, v)]) for v in (0.5, 1.5)]
    )
    with pytest.raises(
        szlib.ZoneError, match=r"at 1\.1 m/s is undefined: no person was seen"
    ) as error:
        slice_hull(box, 1.1, r_max=R_MAX)
    low, high = missing_directions(str(error.value))
    assert max(abs(low), abs(high)) <= 180
    polygon = Polygon(corners @ turn.T)
    for degrees in np.arange(0.5, 360):
        direction = np.array([np.cos(np.radians(degrees)), np.sin(np.radians(degrees))])
        missing = 1 < (degrees - low) % 360 < (high - low) % 360 - 1
        met = polygon.intersects(LineString([(0, 0), 9 * direction]))
        near_an_end = (
            min(abs((degrees - end + 180) % 360 - 180) for end in (low, high)) < 1
        )
        assert near_an_end or missing != met


@pytest.mark.parametrize(
    ("corners", "low", "high"),
    [
        ([(0, -1), (1, 0), (0, 1)], 90, -90),  # the origin on an edge
        ([(0, 0), (0, 1), (-1, 1)], 135, 90),  # the origin on a corner
        ([(-1, -0.5), (-0.2, 0), (-1, 0.5)], -153, 153),
    ],
)
def test_origin_on_or_outside_the_rim_is_undefined(corners, low, high):
    with pytest.raises(szlib.ZoneError) as error:
        Slice(np.array(corners, float), 1.1, R_MAX)
    assert missing_directions(str(error.value)) == (low, high)
