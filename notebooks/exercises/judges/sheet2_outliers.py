"""Sheet 2: complementary coordinates, nearest approaches, precision and recall, LOF's blind spot."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from szlib.plaza.accuracy import precision_and_recall
from szlib.zones.outliers import N_NEIGHBOURS, complementary_points, local_outlier_factors

from .task import Case, Rng, formula, make_task

_WINDOW = 31  # samples of one encounter: 3 s at 10 Hz
_MIN_GAP = 0.3  # least distance of an intruder's samples to all other samples [m]


def _draw_close_samples(rng: Rng) -> tuple[Any, ...]:
    return rng.uniform(-np.pi, np.pi, 5).round(2), rng.uniform(0.2, 1.4, 5).round(2), 2.0


def _complementary(los_angle: Any, distance: Any, r_max: float) -> Any:
    return complementary_points(pd.DataFrame({"los_angle": los_angle, "distance": distance}), r_max=r_max)


def _positions(angle: Any, distance: Any) -> Any:
    return np.asarray(distance)[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])


def _draw_encounters(rng: Rng) -> tuple[Any, ...]:
    number = np.repeat(rng.permutation(4), rng.integers(4, 8, 4))
    nearest = rng.uniform(0.6, 1.4, 4)
    distance = nearest[number] + rng.uniform(0, 1, len(number))
    return (pd.DataFrame({"encounter": number, "los_angle": 0.0, "distance": distance.round(3)}),)


def _by_encounter(samples: pd.DataFrame, statistic: str) -> Any:
    return samples.groupby("encounter")["distance"].agg(statistic).to_numpy()


def _draw_removed(rng: Rng) -> tuple[Any, ...]:
    intruder = rng.random(80) < 0.2
    return np.where(rng.random(80) < 0.25, ~intruder, intruder), intruder


def _draw_cloud(rng: Rng) -> Case:
    direction, distance = rng.uniform(-np.pi, np.pi, 600), np.sqrt(rng.uniform(0, 1, 600))
    return (_positions(direction, distance) + rng.normal(0, 0.2, 2),), None


def _judge_intruder(args: tuple[Any, ...], _: Any, got: Any) -> str:
    """Accept an intruder far from the cloud that LOF does not find."""
    (cloud,), points = args, np.asarray(got, float)
    if points.shape != (_WINDOW, 2):
        return f"an encounter has {_WINDOW} samples: expected shape ({_WINDOW}, 2); got {points.shape}"
    gap = np.hypot(*(points[:, None] - cloud).transpose(2, 0, 1)).min()
    if gap < _MIN_GAP:
        return f"this is not an intruder: the cloud is {gap:.2f} m away; expected {_MIN_GAP} m or more"
    if len(np.unique(points, axis=0)) < _WINDOW:
        return "some of your samples are the same point, where LOF has no density; a person moves"
    factors = local_outlier_factors(np.vstack([cloud, points]), N_NEIGHBOURS)
    removed = factors > np.quantile(factors, 0.99)  # LOF removes one sample in a hundred
    found = int(removed[len(cloud) :].sum())
    if not found:
        return ""
    return (
        f"LOF removes {found} of your {_WINDOW} samples: each sample and its {N_NEIGHBOURS} nearest samples "
        "must lie in equally dense places"
    )


TASKS = (
    make_task(
        "complementary",
        formula(_draw_close_samples, _complementary),
        plain=lambda angle, distance, r_max: _positions(angle, distance),
        radians=lambda angle, distance, r_max: _positions(np.radians(angle), r_max - distance),
        swapped=lambda angle, distance, r_max: _positions(angle, r_max - distance)[:, ::-1],
        sign=lambda angle, distance, r_max: _positions(angle, distance - r_max),
    ),
    make_task(
        "nearest",
        formula(_draw_encounters, lambda samples: _by_encounter(samples, "min")),
        overall=lambda samples: np.full(samples["encounter"].nunique(), samples["distance"].min()),
        mean=lambda samples: _by_encounter(samples, "mean"),
        first=lambda samples: _by_encounter(samples, "first"),
        largest=lambda samples: _by_encounter(samples, "max"),
    ),
    make_task(
        "found",
        formula(_draw_removed, precision_and_recall),
        swapped=lambda removed, intruder: precision_and_recall(removed, intruder)[::-1],
        of_all=lambda removed, intruder: ((removed & intruder).mean(),) * 2,
        not_removed=lambda removed, intruder: precision_and_recall(~removed, intruder),
        not_intruders=lambda removed, intruder: precision_and_recall(removed, ~intruder),
    ),
    make_task("blind_spot", _draw_cloud, judge=_judge_intruder),
)
