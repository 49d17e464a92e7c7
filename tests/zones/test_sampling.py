"""Draws from a density are those of the density, and ensembles that disagree are noticed."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from szlib.zones.sampling import diagnose, sample

COVARIANCE = np.array([[1.0, 0.8], [0.8, 1.0]]) * np.outer([0.3, 0.02], [0.3, 0.02])


def test_draws_have_the_moments_of_the_density() -> None:
    wide = np.array([20.0, 20.0])
    density = stats.multivariate_normal(np.zeros(2), COVARIANCE).logpdf
    spread = np.full(2, 0.01)
    found = sample(
        density, np.zeros(2), -wide, wide, np.random.default_rng(0), spread=spread, n_reported=2
    )  # fmt: skip
    assert found.has_converged
    assert found.values.mean(axis=0) == pytest.approx([0, 0], abs=0.05)
    assert np.cov(found.values.T) == pytest.approx(COVARIANCE, rel=0.25)


def test_bounds_are_kept_and_a_flat_density_is_flat() -> None:
    found = sample(
        lambda p: 0.0, np.array([0.9]), np.array([0.0]), np.array([1.0]),
        np.random.default_rng(1), spread=np.array([0.1]), n_reported=1,
    )  # fmt: skip
    counts = np.histogram(found.values, bins=4, range=(0, 1))[0] / len(found.values)
    assert counts == pytest.approx(np.full(4, 0.25), abs=0.06)
    assert ((found.values > 0) & (found.values < 1)).all()


def test_one_seed_gives_the_same_draws_and_another_seed_others() -> None:
    def draw(seed: int) -> np.ndarray:
        return sample(
            lambda p: -float(p @ p) / 2, np.zeros(1), np.array([-9.0]), np.array([9.0]),
            np.random.default_rng(seed), spread=np.array([0.1]), n_reported=1,
        ).values  # fmt: skip

    assert (draw(0) == draw(0)).all()
    assert draw(0)[0] != draw(1)[0]


def test_ensembles_that_never_meet_have_not_converged() -> None:
    """Two peaks, so far apart that no walker crosses: which one an ensemble is on is left to its start."""
    found = sample(
        lambda p: float(np.logaddexp(*-np.square((p[0] + [-1, 1]) / 0.001))),
        np.zeros(1), np.array([-2.0]), np.array([2.0]),
        np.random.default_rng(0), spread=np.array([0.3]), n_reported=1,
    )  # fmt: skip
    assert not found.has_converged


def test_ensembles_that_disagree_or_stick_are_noticed() -> None:
    rng = np.random.default_rng(2)
    shape = (4, 400, 5, 1)
    apart = rng.normal(size=shape) + np.arange(4)[:, None, None, None]
    assert diagnose(apart)[0] > 1.5
    walk = rng.normal(size=shape).cumsum(axis=1)
    assert diagnose(walk)[1] < 100
    assert diagnose(rng.normal(size=shape))[1] > 5000
