"""Draws from a density are those of the density, and groups of draws that disagree are noticed."""

import numpy as np
import pytest
from scipy import stats

from szlib.zones.sampling import diagnose, sample

COVARIANCE = np.array([[1.0, 0.8], [0.8, 1.0]]) * np.outer([0.3, 0.02], [0.3, 0.02])


def test_draws_have_the_moments_of_the_density():
    wide = np.array([20.0, 20.0])
    density = stats.multivariate_normal(np.zeros(2), COVARIANCE).logpdf
    spread = np.full(2, 0.01)
    found = sample(
        density, np.zeros(2), -wide, wide, np.random.default_rng(0), spread=spread, n_reported=2
    )  # fmt: skip
    assert found.has_converged
    assert found.values.mean(axis=0) == pytest.approx([0, 0], abs=0.05)
    assert np.cov(found.values.T) == pytest.approx(COVARIANCE, rel=0.25)


def test_bounds_are_kept_and_a_flat_density_is_flat():
    found = sample(
        lambda p: 0.0, np.array([0.9]), np.array([0.0]), np.array([1.0]),
        np.random.default_rng(1), spread=np.array([0.1]), n_reported=1,
    )  # fmt: skip
    counts = np.histogram(found.values, bins=4, range=(0, 1))[0] / len(found.values)
    assert counts == pytest.approx(np.full(4, 0.25), abs=0.06)
    assert ((found.values > 0) & (found.values < 1)).all()


def test_one_seed_gives_the_same_draws_and_another_seed_others():
    def draw(seed):
        return sample(
            lambda p: -float(p @ p) / 2, np.zeros(1), np.array([-9.0]), np.array([9.0]),
            np.random.default_rng(seed), spread=np.array([0.1]), n_reported=1,
        ).values  # fmt: skip

    assert (draw(0) == draw(0)).all()
    assert draw(0)[0] != draw(1)[0]


def test_skewed_densities_in_many_dimensions_are_drawn():
    """Twelve gamma densities of the logarithm: their quantiles are known.

    500 effective draws leave a standard error of 0.022 in a share, four samples of them 0.011.
    """
    shape, quantiles = np.linspace(0.7, 6, 12), np.array([0.1, 0.5, 0.9])[:, None]
    shares = []
    for seed in range(4):
        found = sample(
            lambda p: float((shape * p - np.exp(p)).sum()), np.log(shape),
            np.full(12, -30.0), np.full(12, 9.0), np.random.default_rng(seed),
            spread=np.full(12, 0.01), n_reported=12,
        )  # fmt: skip
        assert found.has_converged
        at = np.exp(np.quantile(found.values, quantiles.ravel(), axis=0))
        shares.append(stats.gamma(shape).cdf(at))
    expected = np.broadcast_to(quantiles, shares[0].shape)
    assert np.mean(shares, axis=0) == pytest.approx(expected, abs=0.05)


def test_two_narrow_peaks_are_both_drawn_or_not_converged():
    found = sample(
        lambda p: float(np.logaddexp(*-np.square((p[0] + [-1, 1]) / 0.01))),
        np.zeros(1), np.array([-2.0]), np.array([2.0]),
        np.random.default_rng(0), spread=np.array([0.3]), n_reported=1,
    )  # fmt: skip
    on_the_right = (found.values > 0).mean()
    assert not found.has_converged or on_the_right == pytest.approx(0.5, abs=0.1)


def test_few_draws_with_all_the_weight_are_noticed():
    rng = np.random.default_rng(2)
    values = rng.normal(size=(4000, 1))
    assert diagnose(values, np.zeros(4000)) == pytest.approx((1.0, 4000), rel=0.005)
    assert diagnose(values, 20 * rng.normal(size=4000))[1] < 100
    apart = values + (np.arange(4000) % 4)[:, None]
    assert diagnose(apart, np.zeros(4000))[0] > 1.2
