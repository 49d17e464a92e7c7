"""Distances against an independent geometry, and one formula for numbers and symbols alike."""

import casadi as ca
import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from szlib.control.obstacles import (
    barrier,
    cbf_residual,
    ellipse_formula,
    segment_formula,
)

import szlib

coordinate = st.floats(-5, 5)
point = st.tuples(coordinate, coordinate)
ZONE = szlib.Ellipse((0.3, -0.2), (1.0, 0.7), 0.4)


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
        (((0, 0), (1, 2), (1, 2)), r"two different end points; got \[1.0, 2.0\]"),
        (((0, np.nan), (0, 0), (1, 0)), "points must be finite"),
        (((0, 0), (0, 0), (np.inf, 0)), "wall must be finite"),
        (((0, 0, 0), (0, 0), (1, 0)), r"points must have shape .* got \(3,\)"),
        ((("a", "b"), (0, 0), (1, 0)), "points must be numbers"),
    ],
)
def test_points_and_walls_that_cannot_be_used_raise_an_error(arguments, message):
    with pytest.raises(szlib.SolverError, match=message):
        szlib.segment_distance(*arguments)
