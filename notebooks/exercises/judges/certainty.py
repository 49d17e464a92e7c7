"""Tasks: a quantile, the nearest of many approaches, a p-value, the time-shifted null model."""

from __future__ import annotations

from typing import Any

import numpy as np

from .task import Args, Rng, make_task, repeat


def _draw_approaches(rng: Rng) -> Args:
    """Approaches of which a share q is a whole number in half of the cases, and far from one in the others."""
    if rng.random() < 0.5:  # powers of two: q n is exact
        n, q = 32 * int(rng.integers(1, 3)), int(rng.integers(2, 9)) / 32
    else:  # at least 0.07 from a whole number: the rounding of q n does not matter
        n = int(rng.integers(40, 60))
        q = round((int(rng.integers(2, 12)) + rng.uniform(0.1, 0.9)) / n, 3)
    return (0.8 + rng.exponential(0.3, n)).round(3), q


def _quantile(nearest: Any, q: float) -> Any:
    """The least approach such that at least a share q came as near as that, or nearer."""
    return min(radius for radius in nearest if np.mean(nearest <= radius) >= q)


def _draw_mean_distance(rng: Rng) -> Args:
    return round(rng.uniform(0.1, 0.5), 2), int(rng.integers(20, 400))


def _draw_null_values(rng: Rng) -> Args:
    """Values of the null model, some of which are exactly as large as the observed one."""
    null = rng.normal(0, 1, int(rng.choice([19, 39, 99]))).round(2)
    observed = float(np.sort(null)[-int(rng.integers(3, 8))])
    null[rng.integers(len(null))] = observed
    return observed, null


def _p_value(observed: float, null: Any) -> float:
    return float((1 + (np.asarray(null) >= observed).sum()) / (1 + len(null)))


def _draw_recording(rng: Rng) -> Args:
    person = np.repeat(np.arange(4), 6)
    t = rng.uniform(0, 500, 4)[person] + np.tile(np.arange(6), 4)
    period = float(rng.integers(520, 700))
    return t.round(1), person, rng.uniform(100, 500, 4).round(1) * [1, -1, 1, -1], period


TASKS = (
    make_task(globals(), "quantile_radius", repeat(_draw_approaches), solution=_quantile),
    make_task(globals(), "expected_nearest", repeat(_draw_mean_distance), solution=lambda mean, n: mean / n),
    make_task(globals(), "p_value", repeat(_draw_null_values), solution=_p_value),
    make_task(
        globals(),
        "shifted",
        repeat(_draw_recording),
        solution=lambda t, person, shift, period: (t + shift[person]) % period,
    ),
)
