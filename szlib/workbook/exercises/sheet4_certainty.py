"""Sheet 4, how sure: a quantile, why extremes shrink, a p-value, people who take no notice of each other."""

from __future__ import annotations

from typing import Any

import numpy as np

from .task import Rng, Task, formula


def _approaches(rng: Rng) -> tuple[Any, ...]:
    n = int(rng.integers(40, 90))
    return (0.8 + rng.exponential(0.3, n)).round(3), round(rng.uniform(0.04, 0.3), 3)


def _quantile(nearest: Any, q: float) -> Any:
    return np.quantile(nearest, q, method="inverted_cdf")


def _clearance(rng: Rng) -> tuple[Any, ...]:
    return round(rng.uniform(0.1, 0.5), 2), int(rng.integers(20, 400))


def _null(rng: Rng) -> tuple[Any, ...]:
    null = rng.normal(0, 1, int(rng.choice([19, 39, 99]))).round(3)
    return round(float(np.sort(null)[-3] - 1e-3), 3), null


def _p_value(observed: float, null: Any) -> float:
    return float((1 + (np.asarray(null) >= observed).sum()) / (1 + len(null)))


def _recorded(rng: Rng) -> tuple[Any, ...]:
    person = np.repeat(np.arange(4), 6)
    t = rng.uniform(0, 500, 4)[person] + np.tile(np.arange(6), 4)
    return t.round(1), person, rng.uniform(100, 500, 4).round(1) * [1, -1, 1, -1], 600.0


def _shifted(t: Any, person: Any, shift: Any, period: float) -> Any:
    return (t + shift[person]) % period


TASKS = (
    Task(
        "quantile_radius",
        10,
        (
            "Sort the approaches. How many of them make a share q of all?",
            "The least approach such that at least a share q of encounters came as near, or nearer.",
            "np.sort(nearest)[math.ceil(q * len(nearest)) - 1], or np.quantile with method='inverted_cdf'",
        ),
        formula(_approaches, _quantile),
        {
            "this is the nearest of all; a share q of encounters may come nearer": lambda d, q: d.min(),
            "this is the far end: a share q came nearer, not farther": lambda d, q: _quantile(d, 1 - q),
            "this lies between two encounters, where nobody came; take the approach of somebody": (
                lambda d, q: np.quantile(d, q)
            ),
        },
        unit="m",
    ),
    Task(
        "expected_nearest",
        15,
        (
            "How likely is it that one person keeps more than x? That all n do?",
            "exp(-x / mean), and so exp(-n x / mean): that is an exponential distribution again.",
            "Its mean is mean / n: with every day of data the nearest comes nearer.",
        ),
        formula(_clearance, lambda mean, n: mean / n),
        {
            "this is how a mean settles; an extreme goes with 1 / n": lambda m, n: m / np.sqrt(n),
            "this does not depend on n: the nearest of many is nearer than anybody": lambda m, n: m,
            "this is for distances spread evenly; these are exponential": lambda m, n: m / (n + 1),
            "this is the nearest's median; its mean is asked": lambda m, n: m * np.log(2) / n,
        },
        unit="m",
        tolerance=1e-9,
    ),
    Task(
        "p_value",
        10,
        (
            "If nobody minded anybody, the data would be one more draw of the null model.",
            "How many of all the draws, the data among them, are at least as large?",
            "(1 + (null >= observed).sum()) / (1 + len(null))",
        ),
        formula(_null, _p_value),
        {
            "the data is a draw as well: without 1 + above and below, p could be 0": lambda x, null: float(
                (null >= x).mean()
            ),
            "this is the other side: count the draws that are as large or larger": lambda x, null: float(
                (1 + (null <= x).sum()) / (1 + len(null))
            ),
            "this is two-sided; only large values speak for respect": lambda x, null: 2 * _p_value(x, null),
            "this is a count; p is a share": lambda x, null: float((null >= x).sum()),
        },
    ),
    Task(
        "shifted",
        15,
        (
            "Paths and speeds stay, who met whom goes: each person comes at another time, all of a person's "
            "samples together.",
            "shift[person] gives each sample the shift of its person.",
            "The recording is closed to a circle: (t + shift[person]) % period.",
        ),
        formula(_recorded, _shifted),
        {
            "everybody is moved by the same time, so who met whom stays": lambda t, p, s, w: (t + s[0]) % w,
            "some times lie outside of the recording: who leaves at its end comes in at its beginning": (
                lambda t, p, s, w: t + s[p]
            ),
            "the samples of one person are moved apart: their path is torn": lambda t, p, s, w: (
                (t + np.resize(s, len(t))) % w
            ),
            "times are cut off at the ends of the recording, where people would gather": lambda t, p, s, w: (
                np.clip(t + s[p], 0, w)
            ),
        },
        unit="s",
    ),
)
