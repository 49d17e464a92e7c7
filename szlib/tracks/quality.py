"""What a file of tracks was read as, by its first rows: columns, people, speeds, a map."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import polars as pl

from .motion import measure_motion
from .readers import open_file, rejection_reason
from .recipe import Recipe, find_recipe

ROWS = 200_000
"""Number of rows by which a file is described."""

# letters in a line of a map; letters from nobody to most people
_MAP, _INK = (60, " .:+#")


@contextmanager
def _usable_rows(
    path: str | Path, recipe: Recipe | None
) -> Iterator[tuple[Recipe, pl.LazyFrame]]:
    """The recipe of a file, and a scan of its usable rows: id, t [s], x, y [m], and what else it holds."""
    with open_file(path := Path(path), find_recipe([path], recipe)) as (found, scan):
        yield (
            found,
            scan.filter(rejection_reason(scan).is_null()).with_columns(id="exact_id"),
        )


def find_reading(path: Path, recipe: Recipe) -> Recipe:
    """The complete recipe by which file `path` is read with a `recipe`."""
    with open_file(path, recipe) as (found, _):
        return found


def describe_file(path: str | Path, recipe: Recipe | None = None) -> str:
    """Describe the file `path`, read with a `recipe`, in a few lines, by its first rows.

    They say what it was taken for, how people move in it and where, and draw a map.

    Examples
    --------
    >>> import numpy as np, pandas as pd
    >>> from szlib.tracks.quality import describe_file
    >>> walk = pd.DataFrame({"time": np.arange(30) / 2, "ped": 1, "x": 0.6 * np.arange(30), "y": 0.0})
    >>> walk.to_csv("walk.csv", index=False)
    >>> print(describe_file("walk.csv"))  # doctest: +ELLIPSIS
    walk.csv is read as tidy: t = time, id = ped, x = x, y = y
    ...
    """
    path = Path(path)
    with _usable_rows(path, recipe) as (found, scan):
        rows = scan.head(ROWS).select("t", "id", "x", "y").collect()
    t, person, x, y = rows.to_numpy().T
    lines = [
        f"{path.name} is read as {found.file_format}: "
        + ", ".join(f"{name} = {at}" for name, at in (found.columns or {}).items())
    ]
    if rows.height == 0:
        return lines[0]
    seconds, motion = float(np.ptp(t)), measure_motion(np.array([t, person, x, y]))
    first = "first " if rows.height == ROWS else ""
    lines.append(
        f"{first}{rows.height:,} rows: {rows['id'].n_unique():,} people in {seconds:,.1f} s"
    )
    if motion is not None:
        speeds = f"speed {motion.median_speed:.2f} m/s (median), {motion.high_speed:.2f} (90 % quantile)"
        lines.append(f"{speeds}; a person is seen every {motion.interval:.3g} s")
    (west, east), (south, north) = ((each.min(), each.max()) for each in (x, y))
    lines.append(
        f"x {west:.1f} to {east:.1f} m, y {south:.1f} to {north:.1f} m; where people were seen:"
    )
    shape = (
        max(1, round(_MAP * min((north - south) / max(east - west, 1e-9), 1.0) / 2)),
        _MAP,
    )
    counts = np.histogram2d(y, x, bins=shape)[0][::-1]
    levels = np.ceil(
        np.minimum(counts / max(np.quantile(counts, 0.95), 1.0), 1.0) * (len(_INK) - 1)
    )
    return "\n".join(
        [*lines, *("".join(_INK[int(level)] for level in row) for row in levels)]
    )
