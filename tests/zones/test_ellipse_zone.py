"""A zone of one ellipse for each speed: its boundary lies on it; between speeds it turns and grows evenly."""

import numpy as np
import pytest

import szlib
from szlib.zones.ellipses import DIRECTIONS, EllipseZone, ellipse_reach

KNOWN = np.array(
    [
        [0.08, -0.05, 0.95, 0.75, 0.4],
        [-0.15, 0.0, 0.8, 0.7, np.pi / 2],
        [0.0, 0.0, 0.9, 0.9, 0.0],
        [0.3, 0.2, 1.2, 0.6, -0.7],
    ]
)


def ellipse_of(row):
    return szlib.Ellipse(row[:2], row[2:4], row[4])


def test_the_reach_of_an_ellipse_ends_on_it():
    for row, reach in zip(KNOWN, ellipse_reach(KNOWN), strict=True):
        ellipse = szlib.Ellipse(row[:2], row[2:4], row[4])
        points = reach[:, None] * np.column_stack(
            [np.cos(DIRECTIONS), np.sin(DIRECTIONS)]
        )
        np.testing.assert_allclose(ellipse.level(points), 1, rtol=1e-12)
    assert np.isnan(
        ellipse_reach(np.array([2.0, 0.0, 1.0, 0.5, 0.0]))
    ).all()  # the person is outside


@pytest.mark.parametrize("row", KNOWN)
def test_the_boundary_at_a_fitted_speed_lies_on_its_ellipse(row):
    zone = EllipseZone({0.9: ellipse_of(KNOWN[2]), 1.1: ellipse_of(row)})
    assert zone.ellipse(1.1) == ellipse_of(row)
    points = zone.boundary(1.1, DIRECTIONS)
    np.testing.assert_allclose(ellipse_of(row).level(points), 1, rtol=1e-12)
    angles = np.arctan2(points[:, 1], points[:, 0])
    np.testing.assert_allclose(np.exp(1j * angles), np.exp(1j * DIRECTIONS), atol=1e-12)
    assert zone.boundary(1.1, 0.0).shape == (2,)


def test_half_way_between_two_speeds_the_squares_of_the_axes_are_half_way():
    slow, fast = szlib.Ellipse((0, 0), (1, 0.6)), szlib.Ellipse((0.2, 0), (1.4, 0.8))
    middle = EllipseZone({0.5: slow, 1.5: fast}).ellipse(1.0)
    np.testing.assert_allclose(middle.center, (0.1, 0))
    np.testing.assert_allclose(middle.semi_axes, np.sqrt([1.48, 0.5]))
    assert abs(middle.angle) < 1e-12


@pytest.mark.parametrize("turn", [0.3, 1.5, 3.0])
def test_turned_ellipses_are_turned_between_speeds_too(turn):
    """Also where their angles lie on both sides of the jump from pi / 2 to - pi / 2."""
    ends = {0.5: ellipse_of(KNOWN[0]), 1.5: ellipse_of(KNOWN[3])}
    turned = {v: e.placed((0, 0), turn) for v, e in ends.items()}
    found = EllipseZone(turned).ellipse(0.8)
    expected = EllipseZone(ends).ellipse(0.8).placed((0, 0), turn)
    np.testing.assert_allclose(found.parameters, expected.parameters, atol=1e-12)


@pytest.mark.parametrize("speed", [0.4, 1.6, np.nan])
def test_there_is_no_zone_outside_of_the_fitted_speeds(speed):
    zone = EllipseZone({0.5: ellipse_of(KNOWN[0]), 1.5: ellipse_of(KNOWN[1])})
    message = r"undefined: it was fitted for 0\.5 to 1\.5 m/s"
    with pytest.raises(szlib.ZoneError, match=message):
        zone.ellipse(speed)


def test_a_zone_without_ellipses_is_refused():
    with pytest.raises(szlib.ZoneError, match="needs an ellipse for one speed"):
        EllipseZone({})
