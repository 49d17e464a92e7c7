"""Encounters of pairs of people on straight paths, seen by both, and their null model."""

from __future__ import annotations

import numpy as np
import pandas as pd

import szlib

R_MAX = 2.0
TIMES = np.arange(31) / 10
KINDS = np.array(["opposite", "crossing"])


def passing_pairs(n: int, seed: int) -> pd.DataFrame:
    """Samples of `n` pairs who ignore each other: straight paths that pass at any distance up to 2 m."""
    rng = np.random.default_rng(seed)
    heading = rng.uniform(-np.pi, np.pi, n)
    kind = (np.abs(heading) < 3 * np.pi / 4).astype(int)
    speed, other_speed = rng.uniform(0.5, 1.7, (2, n))
    # of the other person, in the person's frame
    velocity = other_speed * np.exp(1j * heading) - speed
    passing = rng.uniform(-R_MAX, R_MAX, n) * 1j * velocity / np.abs(velocity)
    at = passing[:, None] + velocity[:, None] * (
        TIMES - rng.uniform(0.5, 2.5, n)[:, None]
    )
    table = pd.DataFrame(
        {
            "encounter": np.repeat(np.arange(n), len(TIMES)),
            "ref_id": np.repeat(2 * np.arange(n), len(TIMES)),
            "other_id": np.repeat(2 * np.arange(n) + 1, len(TIMES)),
            "t": np.tile(TIMES, n),
            "los_angle": np.angle(at).ravel(),
            "distance": np.abs(at).ravel(),
            "speed": speed.repeat(len(TIMES)),
            "other_los_angle": np.angle(-at / np.exp(1j * heading)[:, None]).ravel(),
            "other_speed": other_speed.repeat(len(TIMES)),
            "kind": KINDS[kind].repeat(len(TIMES)),
        }
    )
    return table[table["distance"] < R_MAX].reset_index(drop=True)


def exchanged(samples: pd.DataFrame) -> pd.DataFrame:
    """The same encounters from the other person's point of view."""
    names = {
        "ref_id": "other_id",
        "los_angle": "other_los_angle",
        "speed": "other_speed",
    }
    return samples.rename(
        columns=names | {there: here for here, there in names.items()}
    )


def respecting(
    samples: pd.DataFrame, zone: szlib.Ellipse, careless: float = 0.0, seed: int = 0
) -> pd.DataFrame:
    """The encounters in which nobody enters the other's zone, and a share of the others."""
    inside = np.zeros(len(samples), bool)
    for angle in ("los_angle", "other_los_angle"):
        directions = np.column_stack([np.cos(samples[angle]), np.sin(samples[angle])])
        inside |= zone.level(samples["distance"].to_numpy()[:, None] * directions) < 1
    entered = samples["encounter"][inside].unique()
    kept = entered[np.random.default_rng(seed).random(len(entered)) < careless]
    return samples[
        ~samples["encounter"].isin(entered) | samples["encounter"].isin(kept)
    ]


def null_of(samples: pd.DataFrame, shifts: int = 20) -> szlib.NullEncounters:
    """A null model that holds `samples`."""
    samples = samples.assign(shift=samples["encounter"] % shifts)
    groups = samples.groupby("encounter")
    encounters = groups.agg(
        shift=("shift", "first"), kind=("kind", "first"), nearest=("distance", "min")
    )
    return szlib.NullEncounters(samples, encounters.reset_index(), shifts, R_MAX)
