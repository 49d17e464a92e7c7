"""Samples as many as in the paper, made at once."""

import numpy as np
import pandas as pd

PAPER_SAMPLES = 16_181 * 31
"""16,181 encounters in the paper, 31 samples each."""


def paper_samples(n: int = PAPER_SAMPLES, seed: int = 0) -> pd.DataFrame:
    """Samples as many as in the paper, all around the zone of a person, at speeds from 0.4 to 1.8 m/s."""
    rng = np.random.default_rng(seed)
    angle, speed = rng.uniform(-np.pi, np.pi, n), rng.uniform(0.4, 1.8, n)
    nearest = 0.5 + 0.2 * speed + 0.1 * np.cos(angle)
    return pd.DataFrame(
        {
            "encounter": np.arange(n) // 31,
            "los_angle": angle,
            "distance": np.minimum(nearest + rng.exponential(0.5, n), 1.99),
            "speed": speed,
        }
    )
