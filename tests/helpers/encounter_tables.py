"""Compare tables of encounters."""

from __future__ import annotations

import numpy as np
import pandas as pd

from szlib.encounters.geometry import Square, wrap_angle
from szlib.encounters.occupants import SAMPLE_COLUMNS

ROOM = Square(x=(-20, 20), y=(-20, 20))


def assert_same_samples(samples: pd.DataFrame, expected: pd.DataFrame) -> None:
    assert list(samples.columns) == [*SAMPLE_COLUMNS, "kind"]
    assert list(expected.columns[: len(SAMPLE_COLUMNS)]) == SAMPLE_COLUMNS
    labels = SAMPLE_COLUMNS[:4]
    assert (
        samples[labels].astype(str).to_numpy().tolist()
        == expected[labels].astype(str).to_numpy().tolist()
    )
    for name in ("t", "distance", "speed", "other_speed"):
        np.testing.assert_allclose(samples[name], expected[name], rtol=0, atol=1e-9)
    for name in ("los_angle", "other_los_angle"):
        turn = wrap_angle(samples[name].to_numpy() - expected[name].to_numpy())
        np.testing.assert_allclose(turn, 0, atol=1e-9)
