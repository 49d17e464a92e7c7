"""Sheet 2, inside out: complementary coordinates, nearest approaches, who is found, LOF's blind spot."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from ...plaza.accuracy import precision_and_recall
from ...zones.outliers import NEIGHBOURS, complementary_points, local_outlier_factors, nearest_approaches
from .task import Case, Rng, Task, formula

WINDOW = 31
"""Samples of one encounter: 3 s at 10 Hz."""
APART = 0.3
"""An intruder's samples are farther than that from everybody's [m]."""
QUOTA = 0.01
"""Share of the samples that LOF takes away."""


def _close_samples(rng: Rng) -> tuple[Any, ...]:
    return rng.uniform(-np.pi, np.pi, 5).round(2), rng.uniform(0.2, 1.4, 5).round(2), 2.0


def _complementary(angle: Any, distance: Any, r_max: float) -> Any:
    return complementary_points(pd.DataFrame({"los_angle": angle, "distance": distance}), r_max=r_max)


def _polar(angle: Any, distance: Any) -> Any:
    return np.asarray(distance)[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])


def _met(rng: Rng) -> tuple[Any, ...]:
    number = np.repeat(rng.permutation(4), rng.integers(4, 8, 4))
    nearest = rng.uniform(0.6, 1.4, 4)
    distance = nearest[number] + rng.uniform(0, 1, len(number))
    return (pd.DataFrame({"encounter": number, "los_angle": 0.0, "distance": distance.round(3)}),)


def _nearest(samples: pd.DataFrame) -> Any:
    return nearest_approaches(samples).sort_values("encounter")["distance"].to_numpy()


def _removed(rng: Rng) -> tuple[Any, ...]:
    intruder = rng.random(80) < 0.2
    return np.where(rng.random(80) < 0.25, ~intruder, intruder), intruder


def _cloud(rng: Rng) -> Case:
    direction, reach = rng.uniform(-np.pi, np.pi, 600), np.sqrt(rng.uniform(0, 1, 600))
    return (_polar(direction, reach) + rng.normal(0, 0.2, 2),), None


def _hidden(args: tuple[Any, ...], _: Any, got: Any) -> str:
    (cloud,), points = args, np.asarray(got, float)
    if points.shape != (WINDOW, 2):
        return f"an encounter has {WINDOW} samples, so an array of shape ({WINDOW}, 2); got {points.shape}"
    gap = np.hypot(*(points[:, None] - cloud).transpose(2, 0, 1)).min()
    if gap < APART:
        return (
            f"this is nobody's intruder: the nearest sample of somebody else is {gap:.2f} m away, expected "
            f"{APART} m or more"
        )
    if len(np.unique(points, axis=0)) < WINDOW:
        return "some of your samples are the very same point, where LOF has no density; a person moves on"
    factors = local_outlier_factors(np.vstack([cloud, points]), NEIGHBOURS)
    quota = np.quantile(factors, 1 - QUOTA)
    found = int((factors[len(cloud) :] > quota).sum())
    if not found:
        return ""
    return (
        f"LOF takes away {found} of your {WINDOW} samples: the {NEIGHBOURS} nearest of a sample must be as "
        "dense as those of its neighbours"
    )


def _far_corner(cloud: Any) -> Any:
    return cloud.max(axis=0) + 1.0


TASKS = (
    Task(
        "complementary",
        5,
        (
            "Who is far away must come to lie near the origin.",
            "The complementary distance is r' = r_max - r; the direction stays.",
            "(r_max - distance)[:, None] * np.column_stack([np.cos(los_angle), np.sin(los_angle)])",
        ),
        formula(_close_samples, _complementary),
        {
            "these are plain positions: the complement r_max - r is forgotten": lambda a, d, r: _polar(a, d),
            "the angles are in radians already": lambda a, d, r: _polar(np.radians(a), r - d),
            "cos and sin are swapped: x' is ahead, where the angle is 0": lambda a, d, r: _polar(a, r - d)[
                :, ::-1
            ],
            "the sign is turned around: the complement is r_max - r, not r - r_max": lambda a, d, r: _polar(
                a, d - r
            ),
        },
        unit="m",
    ),
    Task(
        "nearest",
        10,
        (
            "One number for each encounter: how near did the two come?",
            "A table can be cut into groups: samples.groupby('encounter').",
            "samples.groupby('encounter')['distance'].min().to_numpy()",
        ),
        formula(_met, _nearest),
        {
            "this is the nearest of all samples; each encounter has its own": lambda s: np.full(
                s["encounter"].nunique(), s["distance"].min()
            ),
            "these are means: how near the two came is the smallest distance": lambda s: (
                s.groupby("encounter")["distance"].mean().to_numpy()
            ),
            "these are the first samples, when the window opens": lambda s: (
                s.groupby("encounter")["distance"].first().to_numpy()
            ),
            "these are the largest distances": lambda s: s.groupby("encounter")["distance"].max().to_numpy(),
        },
        unit="m",
    ),
    Task(
        "found",
        10,
        (
            "Of what was removed, how much was right? Of what was wrong, how much was removed?",
            "Both have the same numerator: the samples that are removed and of intruders.",
            "both = (removed & intruder).sum(); return both / removed.sum(), both / intruder.sum()",
        ),
        formula(_removed, precision_and_recall),
        {
            "precision and recall are swapped": lambda r, i: precision_and_recall(r, i)[::-1],
            "these are shares of all samples, not of those removed, and not of the intruders'": lambda r, i: (
                ((r & i).mean(),) * 2
            ),
            "this counts who was kept: precision looks at what was removed": lambda r, i: (
                precision_and_recall(~r, i)
            ),
            "this is about those who are no intruders": lambda r, i: precision_and_recall(r, ~i),
        },
    ),
    Task(
        "blind_spot",
        30,
        (
            f"LOF asks a sample: are your {NEIGHBOURS} nearest neighbours in a denser place than you are?",
            f"An intruder has {WINDOW} samples. Whose samples are the {NEIGHBOURS} nearest of each of them?",
            "Far from the cloud walk on a small circle: every sample is in as dense a place as any other.",
        ),
        _cloud,
        {
            f"an encounter has {WINDOW} samples": lambda cloud: _far_corner(cloud)[None] + [[0.0, 0.0]],
            "this is nobody's intruder": lambda cloud: cloud[:WINDOW] + 0.01,
            "the very same point": lambda cloud: np.tile(_far_corner(cloud), (WINDOW, 1)),
            "LOF takes away": lambda cloud: _far_corner(cloud) + 0.02 * np.arange(WINDOW)[:, None] ** 2,
        },
        judge=_hidden,
        cases=2,
    ),
)
