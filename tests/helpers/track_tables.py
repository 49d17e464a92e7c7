"""Make track tables, and find the folder of real data."""

from __future__ import annotations

import os
from collections.abc import Sequence
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import szlib

DAY = "2012-10-24"


def make_walk(
    start: Sequence[float],
    velocity: Sequence[float],
    *,
    person: int = 1,
    day: str = DAY,
    begin: float = 0.0,
    duration: float = 4.0,
) -> pd.DataFrame:
    """A person who walks straight on: the rows of a track table."""
    tick = round(begin * 10) + np.arange(round(duration * 10) + 1)
    since = (tick - tick[0])[:, None] / 10
    rows = pd.DataFrame({"day": day, "id": person, "t": tick / 10})
    rows[["x", "y"]] = np.asarray(start, float) + since * np.asarray(velocity, float)
    rows[["vx", "vy"]] = np.broadcast_to(np.asarray(velocity, float), (len(tick), 2))
    return rows


def make_tracks(*walks: pd.DataFrame) -> pd.DataFrame:
    """A track table of several people."""
    return pd.concat(walks, ignore_index=True).astype({"day": "category"})


@cache
def make_crowd(
    seed: int,
    *,
    people: int = 14,
    seconds: int = 40,
    square: szlib.Area = szlib.ATC_SQUARE,
) -> pd.DataFrame:
    """People who come and go, wander through the square, stop, and are sometimes out of sight.

    Made once for each seed: copy it to change it.
    """
    rng = np.random.default_rng(seed)
    walks = []
    for person in range(people):
        n = int(rng.integers(40, 180))
        heading = rng.uniform(-np.pi, np.pi) + np.cumsum(rng.normal(0, 0.03, n))
        pace = np.clip(
            rng.normal(1.0, 0.3) + np.cumsum(rng.normal(0, 0.02, n)), 0.0, 2.0
        )
        velocity = pace[:, None] * np.column_stack([np.cos(heading), np.sin(heading)])
        middle = [rng.uniform(*square.x), rng.uniform(*square.y)]
        position = (
            middle + (np.cumsum(velocity, axis=0) - velocity[: n // 2].sum(axis=0)) / 10
        )
        walk = pd.DataFrame(
            {
                "day": DAY,
                "id": 100 + person,
                "t": (rng.integers(seconds * 10) + np.arange(n)) / 10,
            }
        )
        walk[["x", "y"]], walk[["vx", "vy"]] = position, velocity
        if rng.random() < 0.3:
            gap = int(rng.integers(10, n - 10))
            walk = walk.drop(index=range(gap, min(gap + 8, n)))
        walks.append(walk)
    return make_tracks(*walks)


@cache
def make_hall(
    seed: int = 0,
    *,
    people: int = 250,
    pillar: tuple[float, ...] = (),
    size: tuple[float, float] = (12, 8),
) -> pd.DataFrame:
    """People who walk straight through a hall from wall to wall, but not through the pillar.

    Made once for each seed: copy it to change it.
    """
    rng = np.random.default_rng(seed)
    walks = []
    for person in range(people):
        a, b = rng.uniform(0, size, (2, 2))
        a[person % 2], b[person % 2] = 0, size[person % 2]
        span = np.linspace(0, 1, 200)[:, None]
        path = a + span * (b - a)
        if pillar and ((path > pillar[:2]) & (path < pillar[2:])).all(axis=1).any():
            continue
        duration = round(float(np.hypot(*(b - a))) / 1.2, 1)
        walks.append(
            make_walk(
                a,
                (b - a) / duration,
                person=person,
                begin=2.0 * person,
                duration=duration,
            )
        )
    return make_tracks(*walks)


def real_data(folder: str) -> Path:
    """A folder of real data; the test is skipped, saying why, where there is none."""
    root = os.environ.get("SZLIB_DATA_DIR")
    if not root:
        pytest.skip("SZLIB_DATA_DIR is not set: no real data")
    if not (Path(root) / folder).is_dir():
        pytest.skip(f"SZLIB_DATA_DIR has no folder {folder}")
    return Path(root) / folder
