"""Polar zones: the fit finds a known ellipse, gaps have messages, invalid radii are refused."""

import numpy as np
import pytest
from studies.quantile_zone import (
    PolarZone,
    _parametric_reach,
    fill_gaps,
    fit_ellipses,
)

import szlib
from szlib.zones.ellipses import DIRECTIONS, ellipse_reach

KNOWN = np.array(
    [
        [0.08, -0.05, 0.95, 0.75, 0.4],
        [-0.15, 0.0, 0.8, 0.7, np.pi / 2],
        [0.0, 0.0, 0.9, 0.9, 0.0],
        [0.3, 0.2, 1.2, 0.6, -0.7],
    ]
)


def same(found, expected, metres):
    """Centre and axes, and the angle where the axes tell it."""
    np.testing.assert_allclose(found[..., :4], expected[..., :4], rtol=0, atol=metres)
    turn = (found[..., 4] - expected[..., 4] + np.pi / 2) % np.pi - np.pi / 2
    long = expected[..., 2] - expected[..., 3] > 0.01
    np.testing.assert_allclose(turn[long], 0, atol=10 * metres)


def test_the_slope_of_the_reach_is_that_of_small_changes():
    parameters = np.array([[0.1, -0.2, 1.3, 0.2, 1.1], [0.0, 0.05, 0.9, -0.1, 1.6]])
    unit = np.column_stack([np.cos(DIRECTIONS), np.sin(DIRECTIONS)])
    slope = _parametric_reach(parameters, unit)[1]
    for k, small in enumerate(1e-6 * np.eye(5)):
        ends = [
            _parametric_reach(parameters + sign * small, unit)[0] for sign in (1, -1)
        ]
        np.testing.assert_allclose(
            slope[..., k], (ends[0] - ends[1]) / 2e-6, rtol=1e-6, atol=1e-8
        )


def test_fit_recovers_an_ellipse_from_its_radii():
    same(fit_ellipses(ellipse_reach(KNOWN)), KNOWN, 1e-8)


def test_no_ellipse_is_nearer_to_noisy_radii():
    rng = np.random.default_rng(0)
    radii = ellipse_reach(KNOWN[:1]) + rng.normal(0, 0.05, (1, len(DIRECTIONS)))
    found = fit_ellipses(radii)
    least = np.sum((ellipse_reach(found) - radii) ** 2)
    for _ in range(200):
        other = found + rng.normal(0, 10.0 ** rng.uniform(-5, -1), 5)
        assert np.sum((ellipse_reach(other) - radii) ** 2) >= least * (1 - 1e-9)


def test_gaps_below_half_a_turn_are_filled():
    radii = ellipse_reach(KNOWN[:1])
    radii[0, 3:9] = np.nan
    radii[0, -1] = np.nan  # across the seam
    whole = fill_gaps(radii)
    assert np.isfinite(whole).all()
    seen = np.isfinite(radii)
    np.testing.assert_array_equal(whole[seen], radii[seen])
    assert min(radii[0, 2], radii[0, 9]) <= whole[0, 5] <= max(radii[0, 2], radii[0, 9])
    radii[0, :36] = np.nan
    assert np.isnan(fill_gaps(radii)).all()


def test_gap_of_half_a_turn_is_undefined_and_named():
    radii = ellipse_reach(KNOWN[:1])
    radii[0, 10:50] = np.nan
    zone = PolarZone(np.array([1.1]), DIRECTIONS, radii)
    with pytest.raises(
        szlib.ZoneError, match=r"at 1\.1 m/s .* from -135 counter-clockwise to 70 deg"
    ):
        zone.ellipse(1.1)
    assert np.isnan(zone.boundary(1.1, np.radians([0.0]))).all()
    assert np.isfinite(zone.boundary(1.1, np.radians([100.0]))).all()
    empty = PolarZone(np.array([1.1]), DIRECTIONS, np.full((1, 72), np.nan))
    with pytest.raises(szlib.ZoneError, match="no person was seen"):
        empty.ellipse(1.1)
    with pytest.raises(szlib.ZoneError, match="no ellipse around the person fits"):
        PolarZone(np.array([1.1]), DIRECTIONS, np.zeros((1, 72))).ellipse(1.1)


def test_between_speeds_radii_are_linear():
    zone = PolarZone(
        np.array([0.5, 1.5]), DIRECTIONS, np.array([np.full(72, 0.8), np.full(72, 1.0)])
    )
    np.testing.assert_allclose(zone.radii_at(1.0), 0.9)
    np.testing.assert_array_equal(zone.radii_at(1.5), 1.0)
    np.testing.assert_allclose(np.hypot(*zone.boundary(0.75, DIRECTIONS).T), 0.85)
    for speed in (0.4, 1.6, np.nan):
        with pytest.raises(
            szlib.ZoneError, match=r"undefined: it was fitted for 0\.5 to 1\.5 m/s"
        ):
            zone.radii_at(speed)


@pytest.mark.parametrize(
    ("speeds", "directions", "radii", "message"),
    [
        ([1.0], [0.0, 1.0], [[1.0]], "must have shape"),
        ([], [0.0], [], "must have shape"),
        ([1.1], [], [[]], "must have shape"),
        ([1.0, 0.9], [0.0], [[1.0], [1.0]], "must be finite and ascend"),
        ([1.0], [1.0, 0.0], [[1.0, 1.0]], "must be finite and ascend"),
        ([np.inf], [0.0], [[1.0]], "must be finite"),
        ([1.0], [0.0], [[-1.0]], "must not be negative; got -1"),
    ],
)
def test_invalid_radii_are_refused(speeds, directions, radii, message):
    with pytest.raises(szlib.ZoneError, match=message):
        PolarZone(np.array(speeds), np.array(directions), np.array(radii))


def test_the_boundary_is_linear_between_directions_all_around():
    directions = np.radians([-120.0, -30.0, 60.0, 150.0])
    zone = PolarZone(
        speeds=[1.0, 2.0],
        directions=directions,
        radii=[[1.0, 2.0, 3.0, 4.0], [3.0] * 4],
    )
    theta = np.radians([-120.0, -75.0, 60.0, 105.0, 195.0, 217.5, -150.0])
    expected = [1.0, 1.5, 3.0, 3.5, 2.5, 1.75, 2.0]
    found = zone.boundary(1.0, theta)
    np.testing.assert_allclose(np.hypot(*found.T), expected)
    np.testing.assert_allclose(
        found, np.array(expected)[:, None] * np.c_[np.cos(theta), np.sin(theta)]
    )
    np.testing.assert_allclose(zone.radii_at(1.5), [2.0, 2.5, 3.0, 3.5])
