"""Make raw days, and check that the selected rows have the encounters of the whole day."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

import szlib
from szlib.encounters.finding import select_near
from szlib.tracks import funnels
from szlib.tracks.clock import to_clock
from szlib.tracks.readers import load_files, merge_files, read_raw

SPACE = szlib.AttentionalSpace(length=2.5, width=2.0)


def make_raw_day(seed: int, *, people: int = 60, wild: bool = True) -> pd.DataFrame:
    """Rows of a raw file: people cross the square; some are not seen for a while, some jump in one frame."""
    rng = np.random.default_rng(seed)
    walks = []
    for person in range(people):
        n = int(rng.integers(2, 500))
        heading = rng.uniform(-np.pi, np.pi) + np.cumsum(rng.normal(0, 0.02, n))
        pace = rng.uniform(0.3, 1.8)
        step = 0.04 * pace * np.column_stack([np.cos(heading), np.sin(heading)])
        middle = [rng.uniform(-25, -1), rng.uniform(-16, 14)]
        where = middle + np.cumsum(step, axis=0) - step[: n // 2].sum(axis=0)
        if (
            wild and rng.random() < 0.5
        ):  # the sensor takes somebody else for them, for a moment
            at = int(rng.integers(n))
            where[at : at + int(rng.integers(1, 30))] += rng.uniform(-60, 60, 2)
        walk = pd.DataFrame(
            {
                "t": 1351038629 + 0.04 * (rng.integers(1500) + np.arange(n)),
                "id": 100 * person,
            }
        )
        walk[["x", "y"]] = where * 1000
        walks.append(walk[rng.random(n) > (0.15 if wild else 0)])
    rows = pd.concat(walks).sort_values(["t", "id"], kind="stable")
    return rows.assign(z=1500.0, v=1000.0, motion=0.1, facing=0.1)


def write_raw_day(path: Path, rows: pd.DataFrame) -> Path:
    rows.to_csv(path, header=False, index=False, float_format="%.3f")
    return path


def encounters(raw: pd.DataFrame, **parameters: object) -> pd.DataFrame:
    return szlib.find_encounters(
        to_clock(raw, max_gap=parameters.pop("max_gap", None)), **parameters
    )


def read_near(
    path: Path, area: object, duration: float = 3.0, max_gap: float | None = None
) -> pd.DataFrame:
    """The rows of a file that windows of a `duration` in an `area` can depend on."""
    settings = szlib.EncounterSettings(area=area, duration=duration)
    recipe = szlib.Recipe(max_gap=max_gap)
    loaded = load_files(path, recipe)
    return merge_files(loaded, select=partial(select_near, settings))


def assert_selected_as_whole(
    path: Path, *, square: szlib.Area, duration: float, max_gap: float | None = None
) -> int:
    """Check that both ways agree to the last bit, and return the number of samples."""
    near = read_near(path, square, duration, max_gap)
    given = {"square": square, "duration": duration, "max_gap": max_gap, "space": SPACE}
    selected, whole = encounters(near, **given), encounters(read_raw(path), **given)
    pd.testing.assert_frame_equal(selected, whole, check_exact=True)
    of_near, of_whole = funnels.get(selected), funnels.get(whole)
    assert of_near[-1] == of_whole[-1], "windows are rejected for the same reasons"
    assert {
        k: v for k, v in of_near[-2]["rejected"].items() if k != "not in the area"
    } == {k: v for k, v in of_whole[-2]["rejected"].items() if k != "not in the area"}
    assert of_near[0] == of_whole[0], "every row of the file is counted"
    for before, after in zip(of_near[:2], of_near[1:3], strict=True):
        assert before["kept"] == after["entered"]
    return len(selected)
