"""Ellipses: their geometry, and a proof for each smallest one that no smaller one encloses the points."""

from itertools import count

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mpmath import MPContext
from scipy.optimize import nnls

from szlib.core.errors import SzlibError, ZoneError
from szlib.zones.ellipses import Ellipse, circle_around
from szlib.zones.enclosing_ellipse import (
    minimum_enclosing_ellipse,
    minimum_enclosing_ellipse_of_curve,
)

mp = MPContext()
mp.dps = 50
AREA = 1e-9  # relative agreement in area with a bound of 50 digits
INSIDE = 1e-12  # excess of the level that rounding explains


def rotation(angle):
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def circle(angles):
    return np.column_stack([np.cos(angles), np.sin(angles)])


def regular(n):
    return circle(2 * np.pi * np.arange(n) / n)


def flower(angles):
    """A smooth closed curve with three bulges, on no side symmetric."""
    return (1 + 0.3 * np.cos(angles) + 0.1 * np.sin(3 * angles))[:, None] * circle(
        angles
    )


CLOUDS = {
    "three points": lambda rng: rng.normal(size=(3, 2)),
    "four points": lambda rng: rng.normal(size=(4, 2)),
    "seven points": lambda rng: rng.normal(size=(7, 2)),
    "normal": lambda rng: rng.normal(size=(200, 2)),
    "heavy tails": lambda rng: np.exp(rng.normal(size=(60, 2))),
    "cocircular": lambda rng: circle(rng.uniform(0, 2 * np.pi, 300)),
    "nearly cocircular": lambda rng: circle(rng.uniform(0, 7, 300)) * rng.normal(1, 1e-12, (300, 1)),
    "regular polygon": lambda rng: regular(360),
    "grid": lambda rng: np.array(np.meshgrid(np.arange(9.0), np.arange(5.0))).reshape(2, -1).T,
    "duplicates": lambda rng: np.repeat(rng.normal(size=(40, 2)), 5, axis=0),
    "near duplicates": lambda rng: np.repeat(rng.normal(size=(9, 2)), 5, 0) + rng.normal(0, 1e-9, (45, 2)),
    "dense curve": lambda rng: flower(np.linspace(0, 2 * np.pi, 3000)),
}  # fmt: skip


# --- a bound of 50 digits ------------------------------------------------------------------------------


def exact(points):
    """Points as numbers of 50 digits: doubles are taken for exact."""
    return [(mp.mpf(float(x)), mp.mpf(float(y))) for x, y in points]


def proven_area(ellipse):
    """A lower bound on the area of every ellipse around the support, proven by weak duality.

    Weights w >= 0 of sum 1 give the bound 2 pi sqrt(det sum w q q^T), q = (1, x, y), however they were found.
    """
    unit = (
        (ellipse.support - ellipse.center) @ rotation(ellipse.angle) / ellipse.semi_axes
    )
    x, y = unit.T
    weights, _ = nnls(
        np.array([np.ones_like(x), x, y, x * x, x * y, y * y]), [1, 0, 0, 0.5, 0, 0.5]
    )
    weights = [mp.mpf(w) for w in weights]
    moment = mp.zeros(3)
    for w, p in zip(weights, exact(ellipse.support), strict=True):
        q = mp.matrix([1, *p])
        moment += w / mp.fsum(weights) * q * q.T
    return 2 * mp.pi * mp.sqrt(mp.det(moment))


def assert_smallest(ellipse, points, rounding=AREA):
    """It encloses the points, and nothing smaller encloses even its at most five support points."""
    assert np.max(ellipse.level(points)) <= 1 + INSIDE
    assert 3 <= len(ellipse.support) <= 5
    assert {tuple(p) for p in ellipse.support} <= {
        tuple(p) for p in np.asarray(points, float)
    }
    assert ellipse.area <= proven_area(ellipse) * (1 + rounding)


# --- the ellipse itself ------------------------------------------------------------------------------

ELLIPSES = [
    Ellipse((0, 0), (1, 1)),
    Ellipse((0.3, -2), (1.5, 0.7), 0.4),
    Ellipse((-5, 1), (3, 0.01), np.pi / 2),
    Ellipse((1e3, 1e3), (2, 1), -1.5),
]


@pytest.mark.parametrize("ellipse", ELLIPSES)
def test_curve_has_level_one_and_is_closed(ellipse):
    curve = ellipse.curve(101)
    assert curve.shape == (101, 2)
    np.testing.assert_allclose(ellipse.level(curve), 1, rtol=1e-9)
    np.testing.assert_allclose(curve[0], curve[-1], atol=1e-12)
    assert ellipse.level(ellipse.center) == 0


@pytest.mark.parametrize("ellipse", ELLIPSES)
def test_distances_to_the_foci_add_up_to_the_major_axis(ellipse):
    distances = np.linalg.norm(ellipse.curve()[:, None] - ellipse.foci, axis=-1)
    np.testing.assert_allclose(
        distances.sum(axis=1), 2 * ellipse.semi_axes[0], rtol=1e-12
    )


@pytest.mark.parametrize("ellipse", ELLIPSES)
def test_area_is_that_of_its_curve(ellipse):
    x, y = (ellipse.curve(20001) - ellipse.center).T
    assert ellipse.area == pytest.approx(
        np.sum(x[:-1] * y[1:] - x[1:] * y[:-1]) / 2, rel=1e-6
    )


@pytest.mark.parametrize("ellipse", ELLIPSES)
@pytest.mark.parametrize("heading", [0, 0.7, np.pi, -2.5])
def test_placed_ellipse_is_the_curve_turned_and_moved(ellipse, heading):
    position = np.array([4.0, -3.0])
    placed = ellipse.placed(position, heading)
    np.testing.assert_allclose(
        placed.level(ellipse.curve() @ rotation(heading).T + position), 1, rtol=1e-9
    )
    assert placed.semi_axes == ellipse.semi_axes


@pytest.mark.parametrize(
    "angle", [*np.linspace(-10, 10, 41), np.nextafter(np.pi / 2, 2)]
)
def test_angle_is_normalised_to_half_a_turn(angle):
    ellipse, turned = (Ellipse((1, 2), (2, 1), angle + turn) for turn in (0, 3 * np.pi))
    assert -np.pi / 2 < ellipse.angle <= np.pi / 2
    np.testing.assert_allclose(turned.level(ellipse.curve()), 1, rtol=1e-12)
    assert abs(np.sin(ellipse.angle - angle)) < 1e-14


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (((0, 0), (1, 2)), "a = 1.0, b = 2.0"),
        (((0, 0), (1, 0)), "b = 0.0"),
        (((0, 0), (1, -1)), "b = -1.0"),
        (((0, np.nan), (1, 1)), "finite"),
        (((0, 0), (np.inf, 1)), "finite"),
        (((0, 0), (1, 1), np.nan), "finite"),
    ],
)
def test_impossible_ellipse_is_refused(arguments, words):
    with pytest.raises(ZoneError, match=words):
        Ellipse(*arguments)


def test_circle_around_a_zone_is_the_smallest():
    rng = np.random.default_rng(2)
    for _ in range(100):
        axes = np.sort(rng.uniform(0.2, 2.0, 2))[::-1]
        zone = Ellipse(tuple(rng.uniform(-1, 1, 2)), tuple(axes), rng.uniform(-2, 2))
        circle = circle_around(zone)
        assert circle.center == (0.0, 0.0)
        assert circle.semi_axes[0] == pytest.approx(
            np.hypot(*zone.curve(20_001).T).max(), rel=1e-7
        )


# --- the smallest one around points ------------------------------------------------------------------


@pytest.mark.parametrize("cloud", CLOUDS)
@pytest.mark.parametrize("aspect", [1, 1e3, 1e6])
def test_no_smaller_ellipse_encloses_even_the_support(cloud, aspect):
    points = (
        CLOUDS[cloud](np.random.default_rng(1)) @ np.diag([aspect, 1]) @ rotation(0.7).T
    )
    # cos, sin and the angle itself are doubles: their rounding, times the aspect ratio, moves the far ends
    assert_smallest(
        minimum_enclosing_ellipse(points),
        points,
        max(AREA, 8 * np.finfo(float).eps * aspect),
    )


@pytest.mark.parametrize("cloud", CLOUDS)
@pytest.mark.parametrize(("size", "offset"), [(1e-3, 0), (1, 1e4), (1e6, 0)])
def test_result_does_not_depend_on_scale_and_position(cloud, size, offset):
    points = size * CLOUDS[cloud](np.random.default_rng(2)) + [offset, -offset]
    assert_smallest(minimum_enclosing_ellipse(points), points)


@settings(max_examples=100, derandomize=True, deadline=None)
@given(
    st.lists(st.tuples(st.integers(-6, 6), st.integers(-6, 6)), min_size=3, max_size=30)
)
def test_lattice_points_are_enclosed_or_reported_collinear(points):
    if np.linalg.matrix_rank(np.subtract(points, points[0])) < 2:
        with pytest.raises(ZoneError, match=r"distinct points"):
            minimum_enclosing_ellipse(points)
    else:
        assert_smallest(minimum_enclosing_ellipse(points), points)


@pytest.mark.parametrize("cloud", CLOUDS)
def test_support_alone_has_the_same_ellipse(cloud):
    points = CLOUDS[cloud](np.random.default_rng(3))
    ellipse = minimum_enclosing_ellipse(points)
    alone = minimum_enclosing_ellipse(ellipse.support)
    np.testing.assert_allclose(ellipse.level(ellipse.support), 1, atol=INSIDE)
    assert alone.area == pytest.approx(ellipse.area, rel=AREA)
    np.testing.assert_allclose(ellipse.level(alone.curve()), 1, atol=1e-6)


@pytest.mark.parametrize("truth", ELLIPSES)
def test_an_ellipse_is_recovered_from_points_on_it(truth):
    ellipse = minimum_enclosing_ellipse(truth.curve(97))
    np.testing.assert_allclose(ellipse.center, truth.center, atol=1e-9)
    np.testing.assert_allclose(ellipse.semi_axes, truth.semi_axes, rtol=1e-9)
    assert (
        truth.semi_axes[0] == truth.semi_axes[1]
        or abs(np.sin(ellipse.angle - truth.angle)) < 1e-9
    )


@pytest.mark.parametrize(
    ("points", "words"),
    [
        (np.zeros((4, 3)), r"shape \(n, 2\).*\(4, 3\)"),
        (np.zeros(6), r"\(6,\)"),
        (np.zeros((0, 2)), r"\(0, 2\)"),
        ([(0, 0), (1, 1)], r"n >= 3.*\(2, 2\)"),
        ([(0, 0), (1,), (2, 2)], "numbers"),
        ([("a", "b")] * 3, "numbers"),
        (
            [(0, 0), (1, 0), (np.nan, 1), (np.inf, 1)],
            r"point 2 is \[nan, 1.0\].*repair",
        ),
        ([(0, 0), (1, 0), (1, -np.inf)], r"point 2 is \[1.0, -inf\]"),
        ([(1, 2)] * 9, "3 distinct points; got 1"),
        ([(1, 2), (3, 4)] * 9, "3 distinct points; got 2"),
        (
            [(0, 0), (1, 1), (2, 2), (5, 5)],
            "the 4 distinct points lie on a line.*add points beside",
        ),
        ([(0, 0), (1, 1e-11), (2, 0)], "lie on a line"),
        (np.outer(np.linspace(0, 1, 20), [0.6, 0.8]) + 1e4, "lie on a line"),
    ],
)
def test_points_without_an_ellipse_are_refused(points, words):
    with pytest.raises(ZoneError, match=words) as caught:
        minimum_enclosing_ellipse(points)
    assert isinstance(caught.value, SzlibError)


# --- the smallest one around a curve -----------------------------------------------------------------

DENSE = np.linspace(-np.pi, np.pi, 200_001)


def zone(polygon, r_max=2.0):
    """Boundary r_max - R'(theta) of a convex polygon around the origin (paper, sec. 2), and its corners."""
    side = np.roll(polygon, -1, axis=0) - polygon
    normal = (
        np.column_stack([side[:, 1], -side[:, 0]])
        / np.linalg.norm(side, axis=1)[:, None]
    )
    distance = np.sum(normal * polygon, axis=1)

    def curve(angles):
        direction = circle(angles)
        return (r_max - 1 / np.max(direction @ (normal / distance[:, None]).T, axis=1))[
            :, None
        ] * direction

    return curve, np.arctan2(polygon[:, 1], polygon[:, 0])


ZONES = {
    "triangle": zone(regular(3) * [1.6, 1.1] + [0.1, 0.05]),
    "seven sides": zone(1.4 * regular(7) @ rotation(0.3).T * [1.2, 0.8]),
    "sixty sides": zone(regular(60) * [1.5, 1.1]),
    "near the origin": zone(regular(5) + np.array([0.79, 0])),
    "flower": (flower, []),
}


@pytest.mark.parametrize("name", ZONES)
def test_whole_curve_is_inside_the_smallest_ellipse(name):
    curve, corners = ZONES[name]
    ellipse = minimum_enclosing_ellipse_of_curve(curve, corners)
    assert np.max(ellipse.level(curve(DENSE))) <= 1 + INSIDE
    assert 3 <= len(ellipse.support) <= 5
    assert ellipse.area <= proven_area(ellipse) * (1 + AREA)
    angles = np.arctan2(*ellipse.support.T[::-1])
    np.testing.assert_allclose(curve(angles), ellipse.support, atol=1e-12)


@pytest.mark.parametrize("name", ZONES)
def test_samples_alone_are_not_enough(name):
    curve, corners = ZONES[name]
    sampled = minimum_enclosing_ellipse(curve(np.linspace(-np.pi, np.pi, 100)))
    assert np.max(sampled.level(curve(DENSE))) > 1 + 1e-6
    assert minimum_enclosing_ellipse_of_curve(curve, corners).area > sampled.area


@pytest.mark.parametrize(
    "truth", [Ellipse((0, 0), (1, 1)), Ellipse((0.3, -2), (1.5, 0.7), 0.4)]
)
def test_an_ellipse_is_recovered_from_its_curve(truth):
    def curve(angles):
        return circle(angles) * truth.semi_axes @ rotation(truth.angle).T + truth.center

    ellipse = minimum_enclosing_ellipse_of_curve(curve)
    assert ellipse.area == pytest.approx(truth.area, rel=AREA)
    np.testing.assert_allclose(ellipse.center, truth.center, atol=1e-9)


def test_order_and_full_turns_of_breaks_do_not_matter():
    curve, corners = ZONES["seven sides"]
    ellipse = minimum_enclosing_ellipse_of_curve(curve, corners)
    again = minimum_enclosing_ellipse_of_curve(
        curve, np.append(corners[::-1] + 4 * np.pi, corners[0])
    )
    assert again.area == pytest.approx(ellipse.area, rel=AREA)
    # the area is flat at its least: 1e-12 in area leaves the square root of it in the other numbers
    np.testing.assert_allclose(again.center, ellipse.center, atol=1e-6)


def test_a_spike_thinner_than_any_sampling_is_found_at_its_break():
    def curve(angles):
        away = np.abs((angles - 0.4 + np.pi) % (2 * np.pi) - np.pi)
        return (1 + 0.5 * np.clip(1 - away / 1e-5, 0, 1))[:, None] * circle(angles)

    tip = curve(np.array([0.4]))
    ellipse = minimum_enclosing_ellipse_of_curve(curve, [0.4 - 1e-5, 0.4, 0.4 + 1e-5])
    np.testing.assert_allclose(ellipse.level(tip), 1, atol=1e-9)
    assert np.max(ellipse.level(curve(DENSE))) <= 1 + INSIDE


def growing():
    """A curve that is larger at every call: no function of the angle at all."""
    calls = count()
    return lambda angles: flower(angles) * (1 + 1e-6 * next(calls))


@pytest.mark.parametrize(
    ("curve", "breaks", "words"),
    [
        (
            lambda angles: np.cos(angles),
            [],
            r"points \(n, 2\); got \(\d+,\) for n = \d+",
        ),
        (
            lambda angles: np.where(angles[:, None] > 3, np.nan, circle(angles)),
            [],
            "finite; at 3.* rad",
        ),
        (circle, [0, np.nan], "breaks must be finite"),
        (circle, [[0, 1]], r"shape \(k,\)"),
        (lambda angles: circle(angles) * [1, 0], [], "lie on a line"),
        (growing(), [], "still leaves its ellipse.*list every corner"),
    ],
)
def test_curves_without_an_ellipse_are_refused(curve, breaks, words):
    with pytest.raises(ZoneError, match=words):
        minimum_enclosing_ellipse_of_curve(curve, breaks)
