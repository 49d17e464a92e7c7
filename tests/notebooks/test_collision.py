"""The study of distance and time to collision: motion against a small simulation, and known ratios."""

from itertools import product

import numpy as np
import pandas as pd
import pytest
from studies import collision

RNG = np.random.default_rng(0)


def make_samples(n):
    """Samples of `n` pairs, and position and velocity of the second person relative to the first."""
    place, one, other = (RNG.normal(0, s, (n, 2)) @ [1, 1j] for s in (2.0, 1.0, 1.0))
    samples = pd.DataFrame(
        {
            "encounter": np.arange(n),
            "distance": np.abs(place),
            "los_angle": np.angle(place / one),
            "speed": np.abs(one),
            "other_los_angle": np.angle(-place / other),
            "other_speed": np.abs(other),
        }
    )
    return samples, place, other - one


def test_motion_is_that_of_two_people_who_walk_straight_on():
    samples, place, velocity = make_samples(200)
    motion = collision.describe_motion(samples)
    times = np.arange(0, 20, 1e-3)
    step = 1e-6
    slope = (np.abs(place) - np.abs(place + step * velocity)) / step
    assert motion["approach"].to_numpy() == pytest.approx(slope, abs=1e-4)
    assert motion["relative"].to_numpy() == pytest.approx(np.abs(velocity))
    for k, time in enumerate(motion["time to collision"]):
        touches = np.flatnonzero(
            np.abs(place[k] + times * velocity[k]) <= collision.CONTACT
        )
        assert (times[touches[0]] if len(touches) else np.inf) == pytest.approx(
            time, abs=2e-3
        )


def test_half_is_where_the_ratio_rises_through_one_half():
    value = np.arange(0.05, 2, 0.1)
    expected, n = np.ones(len(value)), np.full(len(value), 50)
    assert collision.find_half(
        value, np.clip(value, 0, 1), expected, n
    ) == pytest.approx(0.5)
    assert collision.find_half(value, expected, expected, n) == 0
    assert np.isnan(collision.find_half(value, 0.4 * expected, expected, n))
    assert np.isnan(collision.find_half(value, expected, expected, 0 * n))


@pytest.mark.slow
def test_a_circle_that_nobody_enters_is_found_at_the_nearest_approach():
    """Pairs who pass straight by each other at 0 to 5 m; those of the data at no less than `CIRCLE`."""
    n, t = 4000, np.arange(-3, 3.01, 0.2)
    miss, speed = RNG.uniform(-5, 5, n), RNG.uniform(1.2, 2.2, n)
    place = (speed[:, None] * t + 1j * miss[:, None]).ravel()
    samples = pd.DataFrame(
        {
            "encounter": np.repeat(np.arange(n), len(t)),
            "distance": np.abs(place),
            "los_angle": np.angle(place),
            "speed": 0.6,
            "other_los_angle": np.angle(-place),
            "other_speed": np.repeat(speed, len(t)) + 0.6,
        }
    )
    samples = samples[samples["distance"] < collision.R_MAX]
    sides = [
        collision.describe_motion(each)
        for each in (collision.keep_out(samples), samples)
    ]
    rows = product(collision.BINS, collision.BANDS)
    table = pd.DataFrame(collision.compare(sides, *row) for row in rows)
    half = table.set_index(["variable", "slowest"])["half"]
    assert half["nearest approach", 1.1] == pytest.approx(collision.CIRCLE, abs=0.05)
    assert half["distance", 1.7] > half["distance", 0.5] > collision.CIRCLE - 0.05
