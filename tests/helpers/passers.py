"""Samples of people who pass a walking person, around a known zone or at any distance."""

from __future__ import annotations

import numpy as np
import pandas as pd

TRUTH = np.array([0.05, 0.0, 0.95, 0.75, 0.0])


def passers(
    n: int, *, seed: int = 0, clearance: float = 0.1, noise: float = 0.0
) -> pd.DataFrame:
    """People who pass straight, at an exponential `clearance` [m] from the ellipse `TRUTH`."""
    rng = np.random.default_rng(seed)
    m, _, a, b, _ = TRUTH
    phi = rng.uniform(-np.pi, np.pi, n)
    normal = np.column_stack([np.cos(phi) / a, np.sin(phi) / b])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    nearest = np.column_stack([m + a * np.cos(phi), b * np.sin(phi)])
    nearest += rng.exponential(clearance, n)[:, None] * normal
    return _walked(nearest, np.column_stack([-normal[:, 1], normal[:, 0]]), rng, noise)


def wanderers(n: int, *, seed: int = 0) -> pd.DataFrame:
    """People who pass straight at any distance up to 2 m, without avoiding each other."""
    rng = np.random.default_rng(seed)
    phi = rng.uniform(-np.pi, np.pi, n)
    normal = np.column_stack([np.cos(phi), np.sin(phi)])
    tangent = np.column_stack([-normal[:, 1], normal[:, 0]])
    return _walked(rng.uniform(0, 2, n)[:, None] * normal, tangent, rng, 0.0)


def _walked(
    nearest: np.ndarray, tangent: np.ndarray, rng: np.random.Generator, noise: float
) -> pd.DataFrame:
    n, t = len(nearest), np.arange(31) / 10 - 1.5
    pace = rng.uniform(0.5, 2.0, n) * rng.choice([-1, 1], n)
    path = nearest[:, None] + (pace[:, None] * t)[..., None] * tangent[:, None]
    x, y = np.moveaxis(path + rng.normal(0, noise, path.shape), -1, 0).reshape(2, -1)
    number = np.repeat(np.arange(n), len(t))
    return pd.DataFrame(
        {
            "encounter": number,
            "ref_id": 2 * number,
            "other_id": 2 * number + 1,
            "t": np.tile(t, n) + 10 * number,
            "los_angle": np.arctan2(y, x),
            "distance": np.hypot(x, y),
            "speed": np.repeat(rng.uniform(0.9, 1.3, n), len(t)),
        }
    )
