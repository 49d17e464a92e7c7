"""Smoothed paths: straight and curved ones stay, gaps and other encounters do not matter, noise is less."""

import numpy as np
import pandas as pd
import pytest
from helpers.passers import passers

from szlib.zones.outliers import smooth_paths


@pytest.fixture(scope="module")
def samples():
    return passers(10)


def test_smoothing_keeps_straight_and_evenly_curved_paths():
    t = np.arange(31) / 10
    x, y = 3 - 1.5 * t + 0.2 * t**2, 0.7 + 0.1 * t - 0.05 * t**2
    path = pd.DataFrame(
        {
            "encounter": 0,
            "t": t,
            "los_angle": np.arctan2(y, x),
            "distance": np.hypot(x, y),
        }
    )
    angle, distance = smooth_paths(path)
    np.testing.assert_allclose(angle, path["los_angle"], atol=1e-12)
    np.testing.assert_allclose(distance, path["distance"], atol=1e-12)


def test_smoothing_stops_at_gaps_and_at_other_encounters(samples):
    some = samples[samples["encounter"] < 3].reset_index(drop=True)
    gap = some[(some["encounter"] != 1) | ((some["t"] - 10).abs() > 0.25)]
    together = smooth_paths(gap)
    parts = [gap[gap["encounter"] == 0], gap[(gap["encounter"] == 1) & (gap["t"] < 10)]]
    parts += [
        gap[(gap["encounter"] == 1) & (gap["t"] > 10)],
        gap[gap["encounter"] == 2],
    ]
    for k in (0, 1):
        np.testing.assert_allclose(
            np.concatenate([smooth_paths(p)[k] for p in parts]), together[k], atol=1e-12
        )
    untimed = smooth_paths(some.drop(columns="t"))
    np.testing.assert_array_equal(untimed[1], some["distance"])


def test_smoothing_treats_past_and_future_alike():
    path = passers(1, noise=0.05)
    back = path.assign(t=-path["t"].to_numpy())
    for forward, backward in zip(smooth_paths(path), smooth_paths(back), strict=True):
        np.testing.assert_allclose(forward, backward, atol=1e-12)


def test_smoothing_reduces_noise():
    still, noisy = passers(200), passers(200, noise=0.05)
    error = smooth_paths(noisy)[1] - still["distance"]
    assert error.std() < 0.6 * (noisy["distance"] - still["distance"]).std()
