"""Tables that are committed beside the notebooks: how each was made, and whether a row is still the same.

The first line of such a CSV file is a comment, ``# {"command": ..., "seed": ..., "commit": ...}``: the
command that made the table, its seed, and the commit of the code that it ran; and, if the column or the rows
that are computed again were added later, the commit that computed them, as "probe".
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from .. import folders

TABLES = folders.NOTEBOOKS / "tables"
"""The folder of the committed tables."""
RELATIVE, ABSOLUTE = 5e-4, 5e-5
"""Differences that are due to rounding to four digits, relative to a number and absolute."""


def read_table(name: str) -> pd.DataFrame:
    """Read `name`.csv from `TABLES`; its `attrs` are command, seed and commit."""
    with (TABLES / f"{name}.csv").open(encoding="utf-8") as file:
        header = file.readline()
        table = pd.read_csv(file)
    table.attrs |= json.loads(header.removeprefix("# "))
    return table


def find_differences(
    row: pd.Series[Any], again: Mapping[str, Any]
) -> dict[str, list[Any]]:
    """The values of a `row` and those computed `again`, by column, where they differ."""
    return {
        name: [row[name], value]
        for name, value in again.items()
        if not _is_same(row[name], value)
    }


def _is_same(stored: Any, value: Any) -> bool:
    if isinstance(stored, str) or isinstance(value, str):
        return bool(stored == value)
    return bool(np.isclose(stored, value, rtol=RELATIVE, atol=ABSOLUTE, equal_nan=True))
