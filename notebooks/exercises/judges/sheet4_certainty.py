"""Sheet 4: a quantile, the nearest of many approaches, a p-value, the time-shifted null model."""

from __future__ import annotations

from typing import Any

import numpy as np

from .task import Rng, formula, make_task


def _draw_approaches(rng: Rng) -> tuple[Any, ...]:
    n = int(rng.integers(40, 90))
    return (0.8 + rng.exponential(0.3, n)).round(3), round(rng.uniform(0.04, 0.3), 3)


def _quantile(nearest: Any, q: float) -> Any:
    return np.quantile(nearest, q, method="inverted_cdf")


def _draw_mean_distance(rng: Rng) -> tuple[Any, ...]:
    return round(rng.uniform(0.1, 0.5), 2), int(rng.integers(20, 400))


def _draw_null_values(rng: Rng) -> tuple[Any, ...]:
    null = rng.normal(0, 1, int(rng.choice([19, 39, 99]))).round(3)
    return round(float(np.sort(null)[-3] - 1e-3), 3), null


def _p_value(observed: float, null: Any) -> float:
    return float((1 + (np.asarray(null) >= observed).sum()) / (1 + len(null)))


def _draw_recording(rng: Rng) -> tuple[Any, ...]:
    person = np.repeat(np.arange(4), 6)
    t = rng.uniform(0, 500, 4)[person] + np.tile(np.arange(6), 4)
    return t.round(1), person, rng.uniform(100, 500, 4).round(1) * [1, -1, 1, -1], 600.0


TASKS = (
    make_task(
        "quantile_radius",
        formula(_draw_approaches, _quantile),
        nearest=lambda nearest, q: nearest.min(),
        other_end=lambda nearest, q: _quantile(nearest, 1 - q),
        interpolated=lambda nearest, q: np.quantile(nearest, q),
    ),
    make_task(
        "expected_nearest",
        formula(_draw_mean_distance, lambda mean, n: mean / n),
        mean=lambda mean, n: mean / np.sqrt(n),
        one_person=lambda mean, n: mean,
        uniform=lambda mean, n: mean / (n + 1),
        median=lambda mean, n: mean * np.log(2) / n,
    ),
    make_task(
        "p_value",
        formula(_draw_null_values, _p_value),
        no_data=lambda observed, null: float((null >= observed).mean()),
        other_side=lambda observed, null: float((1 + (null <= observed).sum()) / (1 + len(null))),
        two_sided=lambda observed, null: 2 * _p_value(observed, null),
        count=lambda observed, null: float((null >= observed).sum()),
    ),
    make_task(
        "shifted",
        formula(_draw_recording, lambda t, person, shift, period: (t + shift[person]) % period),
        same_shift=lambda t, person, shift, period: (t + shift[0]) % period,
        outside=lambda t, person, shift, period: t + shift[person],
        torn=lambda t, person, shift, period: (t + np.resize(shift, len(t))) % period,
        clipped=lambda t, person, shift, period: np.clip(t + shift[person], 0, period),
    ),
)
