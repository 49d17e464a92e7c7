"""The audit of the paper's distances: against shapely's, and margins against their definition."""

import doctest

import matplotlib.pyplot as plt
import numpy as np
import pytest
import shapely
from hypothesis import example, given
from hypothesis import strategies as st
from studies import distances
from studies.distances import (
    compare_distances,
    compute_distance_error,
    euclidean_to_ellipse,
    euclidean_to_segment,
    find_safe_boundary,
    plot_distance_error,
    required_margin,
)

import szlib

coordinate = st.floats(-3, 3, allow_subnormal=False)
points = st.tuples(coordinate, coordinate)
ellipses = st.builds(
    lambda center, a, share, angle: szlib.Ellipse(center, (a, share * a), angle),
    points, st.floats(0.1, 2), st.floats(0.05, 1), st.floats(-3, 3),
)  # fmt: skip
lengths = st.floats(0.1, 20)
radii = st.floats(0.1, 1)


def test_examples_run():
    assert doctest.testmod(distances).failed == 0
    plt.close("all")


@pytest.mark.parametrize(
    ("shape", "n_margins"),
    [([(-1.0, 0.0), (1.0, 0.0)], 2), (szlib.Ellipse((0.1, 0.0), (1.0, 0.7)), 1)],
)
def test_the_figure_of_the_error_draws_each_margin_that_differs(shape, n_margins):
    ax = plot_distance_error(shape, r_robot=0.5, eps=0.05)
    assert ax.get_aspect() == 1 and ax.get_xlabel().endswith("[m]")
    labels = [text.get_text() for text in ax.get_legend().get_texts()]
    assert sum(label.startswith("h = 0, eps") for label in labels) == n_margins
    plt.close(ax.figure)


@given(points, points, points)
def test_euclidean_distance_to_a_segment_equals_shapelys(point, a, b):
    if np.hypot(*np.subtract(a, b)) < 1e-3:
        return
    exact = shapely.LineString([a, b]).distance(shapely.Point(point))
    assert euclidean_to_segment(point, a, b) == pytest.approx(exact, abs=1e-9)


@given(st.lists(points, min_size=1, max_size=20), ellipses)
def test_focal_distance_never_overestimates(some, ellipse):
    true = euclidean_to_ellipse(some, ellipse)
    assert (np.abs(szlib.ellipse_distance(some, ellipse)) <= np.abs(true) + 1e-9).all()
    assert (compute_distance_error(some, ellipse)[true > 0] <= 1e-9).all()


@given(lengths, radii, st.floats(0, 2 * np.pi), st.floats(0, 1))
@example(1.0, 0.5, 0.0, 1.0)
def test_required_margin_of_a_wall_is_enough(length, radius, phi, share):
    """Wherever the robot's disc touches the wall, d < r + margin."""
    half = np.array([length / 2, 0.0])
    point = np.array([share * length / 2 + radius * np.cos(phi), radius * np.sin(phi)])
    true = euclidean_to_segment(point, -half, half)
    assert true <= radius + 1e-12
    margin = required_margin([-half, half], radius)
    assert szlib.segment_distance(point, -half, half) <= radius + margin + 1e-9


@given(lengths, radii)
def test_no_margin_of_a_wall_below_the_required_one_is_enough(length, radius):
    half = np.array([length / 2, 0.0])
    tip = half + np.array([radius, 0.0])
    assert szlib.segment_distance(tip, -half, half) == pytest.approx(
        radius + required_margin([-half, half], radius)
    )


@given(ellipses, st.floats(0.05, 1.5))
def test_safe_boundary_of_an_ellipse_lies_at_its_distance(ellipse, distance):
    assert szlib.ellipse_distance(
        find_safe_boundary(ellipse, distance, 50), ellipse
    ) == pytest.approx(distance, abs=1e-9)


@given(points, points, st.floats(0.05, 1.5))
def test_safe_boundary_of_a_wall_lies_at_its_distance(a, b, distance):
    if np.hypot(*np.subtract(a, b)) < 1e-2:
        return
    edge = find_safe_boundary([a, b], distance, 50)
    assert szlib.segment_distance(edge, a, b) == pytest.approx(distance, abs=1e-6)


@pytest.mark.parametrize(("length", "widest"), [(0.4, 0.4), (3.0, 0.5)])
def test_safe_boundary_of_a_wall_goes_around_it_once(length, widest):
    edge = find_safe_boundary([(0.0, 0.0), (0.6 * length, 0.8 * length)], 0.5, 400)
    around = np.unwrap(np.arctan2(*(edge - (0.3 * length, 0.4 * length)).T[::-1]))
    turns = np.diff(around)
    assert (turns >= -1e-9).all() or (turns <= 1e-9).all()
    assert abs(around[-1] - around[0]) == pytest.approx(2 * np.pi, abs=0.1)
    assert np.abs((edge - edge.mean(axis=0)) @ (-0.8, 0.6)).max() == pytest.approx(
        widest, abs=1e-3
    )


def test_the_margin_of_the_paper_is_too_small_for_short_walls_only():
    wall = lambda length: [(-length / 2, 0.0), (length / 2, 0.0)]  # noqa: E731
    one = compare_distances(wall(1.0), r_robot=0.5, eps=0.05)
    # d = s + s^2/L on the line
    assert one.nearest == pytest.approx((np.sqrt(1 + 4 * 0.55) - 1) / 2 - 0.5)
    assert compare_distances(wall(5.0), r_robot=0.5, eps=0.05).nearest == pytest.approx(
        0, abs=1e-12
    )
    for length in (0.3, 1.0, 3.0):
        enough = compare_distances(
            wall(length), r_robot=0.5, eps=required_margin(wall(length), 0.5)
        )
        assert enough.nearest == pytest.approx(0, abs=1e-9)
    zone = compare_distances(
        szlib.Ellipse((0.1, 0.0), (1.0, 0.7)), r_robot=0.5, eps=0.05
    )
    assert zone.nearest == pytest.approx(0.05)
    assert zone.farthest > 0.05


def test_controller_keeps_the_required_margin_of_each_wall():
    walls = [[(0.0, 0.0), (1.0, 0.0)], [(0.0, 5.0), (9.0, 5.0)]]
    settings = szlib.MPCSettings(
        margin="paper", eps=max(required_margin(wall, 0.5) for wall in walls)
    )
    assert settings.eps == 0.25
    controller = szlib.MPCCBF(
        szlib.Ellipse((0.0, 0.0), (1.0, 0.7)), walls=walls, settings=settings
    )
    assert controller.barriers((1.5, 0.0))[0] == pytest.approx(0)
