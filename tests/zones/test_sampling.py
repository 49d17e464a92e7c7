"""Draws from a density are those of the density, and chains that disagree are noticed."""

from __future__ import annotations

import numpy as np
import pytest

from szlib.zones.sampling import diagnose, sample

COVARIANCE = np.array([[1.0, 0.8], [0.8, 1.0]]) * np.outer([0.3, 0.02], [0.3, 0.02])


def gaussian(p: np.ndarray) -> tuple[float, np.ndarray]:
    slope = np.linalg.solve(COVARIANCE, p)
    return float(p @ slope) / 2, slope


def test_draws_have_the_moments_of_the_density() -> None:
    wide = np.array([20.0, 20.0])
    rng = np.random.default_rng(0)
    found = sample(gaussian, np.zeros(2), -wide, wide, rng, n_reported=2)
    assert found.has_converged
    assert found.values.mean(axis=0) == pytest.approx([0, 0], abs=0.05)
    assert np.cov(found.values.T) == pytest.approx(COVARIANCE, rel=0.25)


def test_bounds_are_kept_and_a_flat_density_is_flat() -> None:
    found = sample(
        lambda p: (0.0, np.zeros(1)), np.array([0.9]), np.array([0.0]), np.array([1.0]),
        np.random.default_rng(1), n_reported=1,
    )  # fmt: skip
    counts = np.histogram(found.values, bins=4, range=(0, 1))[0] / len(found.values)
    assert counts == pytest.approx(np.full(4, 0.25), abs=0.06)
    assert ((found.values > 0) & (found.values < 1)).all()


def test_chains_that_disagree_or_stick_are_noticed() -> None:
    rng = np.random.default_rng(2)
    apart = rng.normal(size=(4, 400, 1)) + np.arange(4)[:, None, None]
    assert diagnose(apart)[0] > 1.5
    walk = rng.normal(size=(4, 400, 1)).cumsum(axis=1)
    assert diagnose(walk)[1] < 100
    assert diagnose(rng.normal(size=(4, 400, 1)))[1] > 1000
