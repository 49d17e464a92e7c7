"""Tasks: complementary coordinates, nearest approaches, precision and recall, LOF's blind spot."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from szlib.plaza import precision_and_recall
from szlib.zones.outliers import N_NEIGHBOURS, complementary_points, local_outlier_factors

from .task import Args, Rng, check_form, make_task, repeat

_WINDOW = 31  # samples of one encounter: 3 s at 10 Hz
_MIN_GAP = 0.3  # least distance of an intruder's samples to all other samples [m]


def _draw_close_samples(rng: Rng) -> Args:
    r_max = round(rng.uniform(1.5, 2.5), 1)
    return rng.uniform(-np.pi, np.pi, 5).round(2), rng.uniform(0.2, 1.4, 5).round(2), r_max


def _complementary(los_angle: Any, distance: Any, r_max: float) -> Any:
    return complementary_points(pd.DataFrame({"los_angle": los_angle, "distance": distance}), r_max=r_max)


def _positions(angle: Any, distance: Any) -> Any:
    return np.asarray(distance)[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])


def _draw_encounters(rng: Rng) -> Args:
    number = np.repeat(rng.permutation(4), rng.integers(4, 8, 4))
    nearest = rng.uniform(0.6, 1.4, 4)
    distance = nearest[number] + rng.uniform(0, 1, len(number))
    return (pd.DataFrame({"encounter": number, "los_angle": 0.0, "distance": distance.round(3)}),)


def _by_encounter(samples: pd.DataFrame, statistic: str = "min", *, sort: bool = True) -> Any:
    return samples.groupby("encounter", sort=sort)["distance"].agg(statistic).to_numpy()


def _draw_removed(rng: Rng) -> Args:
    intruder = rng.random(40) < 0.3
    return np.where(rng.random(40) < 0.25, ~intruder, intruder), intruder


def _draw_cloud(rng: Rng) -> Args:
    direction, distance = rng.uniform(-np.pi, np.pi, 600), np.sqrt(rng.uniform(0, 1, 600))
    return (_positions(direction, distance * rng.uniform(0.6, 2)) + rng.normal(0, 2, 2),)


def _judge_intruder(args: Args, got: Any) -> str:
    """Accept an intruder far from the cloud that LOF does not find."""
    if form := check_form(np.zeros((_WINDOW, 2)), got):
        return f"an encounter has {_WINDOW} samples: {form}"
    (cloud,), points = args, np.asarray(got, float)
    if not np.isfinite(points).all():
        return "some of your samples are not finite"
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
    make_task(globals(), "complementary", repeat(_draw_close_samples), solution=_complementary),
    make_task(globals(), "nearest", repeat(_draw_encounters, 15), solution=_by_encounter),
    make_task(globals(), "found", repeat(_draw_removed), solution=precision_and_recall),
    make_task(globals(), "blind_spot", repeat(_draw_cloud, 3), judge=_judge_intruder),
)
