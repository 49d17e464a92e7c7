"""A description of the rows of a file, with a map: how and where people move."""

from __future__ import annotations

import numpy as np
import polars as pl

from .funnels import MAX_ROWS, first_rows, measure_motion
from .recipe import Recipe

# letters in a line of a map; letters from nobody to most people
_MAP, _INK = (60, " .:+#")


def describe_rows(rows: pl.DataFrame, recipe: Recipe, name: str) -> str:
    """The first of `rows` t [s], id, x, y [m] of a file called `name`, and its `recipe`, in a few lines.

    The lines say how and where people move, and draw a map.
    """
    shown = [f"{name} = {at}" for name, at in recipe.columns.items()]
    lines = [f"{name} is read as {recipe.file_format}: {', '.join(shown)}"]
    if rows.height == 0:
        return lines[0]
    t, people, x, y = seen = first_rows(rows)
    lines.append(
        f"{'first ' if len(t) == MAX_ROWS else ''}{len(t):,} rows: "
        f"{len(np.unique(people)):,} people in {np.ptp(t):,.1f} s"
    )
    if motion := measure_motion(seen):
        lines.append(
            f"speed {motion.median_speed:.2f} m/s (median), {motion.high_speed:.2f} (90 % quantile); a "
            f"person is seen every {motion.interval:.3g} s"
        )
    (west, south), (east, north) = seen[2:].min(axis=1), seen[2:].max(axis=1)
    lines.append(
        f"x {west:.1f} to {east:.1f} m, y {south:.1f} to {north:.1f} m; where people were seen:"
    )
    aspect = min((north - south) / max(east - west, 1e-9), 1.0)
    shape = max(1, round(_MAP * aspect / 2)), _MAP
    counts = np.histogram2d(y, x, bins=shape)[0][::-1]
    shares = np.minimum(counts / max(np.quantile(counts, 0.95), 1.0), 1.0)
    levels = np.ceil(shares * (len(_INK) - 1)).astype(int)
    return "\n".join([*lines, *("".join(_INK[k] for k in row) for row in levels)])
