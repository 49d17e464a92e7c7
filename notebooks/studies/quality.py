"""The quality of a file of tracks: frames, gaps, visits, and the sensor's speed (notebook 24).

Files are streamed: a full raw day is reduced to one row a person and second.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pandas as pd
import polars as pl

from szlib.tracks.funnels import rejection_reason
from szlib.tracks.readers import open_rows
from szlib.tracks.recipe import Recipe, find_recipe

STANDING = 0.1
"""A person who moves less than this within a second stands [m] (measured: sensor noise is smaller)."""


def summarise_seconds(path: str | Path, recipe: Recipe | None = None) -> pd.DataFrame:
    """Summarise a file by person and second.

    Parameters
    ----------
    path : a file that `szlib.read_tracks` reads, plain or .gz.
    recipe : how it is read; None takes that beside it, or finds one.

    Returns
    -------
    One row a person and second: id, second [s], x, y [m] when first seen in it, rows, sensor_speed [m/s], the
    mean of the file's own speed (NaN without one), and moved [m], the displacement until the next second (NaN
    where the person is not seen then).  Unusable rows are left out.

    Raises
    ------
    DataError : as in `szlib.read_tracks`.

    Examples
    --------
    >>> import numpy as np, pandas as pd
    >>> from studies.quality import summarise_seconds
    >>> walk = pd.DataFrame({"t": np.arange(6) / 2, "id": 1, "x": 0.6 * np.arange(6), "y": 0.0})
    >>> walk.to_csv("walk.csv", index=False)
    >>> summarise_seconds("walk.csv")[["second", "rows", "moved"]]
       second  rows  moved
    0     0.0     2    1.2
    1     1.0     2    1.2
    2     2.0     2    NaN
    """
    with _usable_rows(path, recipe) as (_, scan):
        names = scan.collect_schema().names()
        speed = pl.col("speed").mean() if "speed" in names else pl.lit(np.nan)
        rows = scan.group_by("id", second=pl.col("t").floor())
        summary = rows.agg(pl.col("x", "y").sort_by("t").first(), rows=pl.len(), sensor_speed=speed)
        table = summary.sort("id", "second").collect(engine="streaming").to_pandas()
    step = table[["id", "second", "x", "y"]].diff()
    is_next_second = ((step["id"] == 0) & (step["second"] == 1)).to_numpy()
    moved = np.where(is_next_second, np.hypot(step["x"], step["y"]), np.nan)
    return table.assign(moved=np.r_[moved[1:], np.nan])


def measure_frame_intervals(path: str | Path, recipe: Recipe | None = None) -> np.ndarray:
    """Times from one frame of file `path`, read with a `recipe`, to the next [s].

    A frame is a time at which somebody was seen.

    Examples
    --------
    >>> import pandas as pd
    >>> from studies.quality import measure_frame_intervals
    >>> pd.DataFrame({"t": [0.0, 0.5, 1.5], "id": 1, "x": 0.0, "y": 0.0}).to_csv("stand.csv", index=False)
    >>> measure_frame_intervals("stand.csv")
    array([0.5, 1. ])
    """
    with open_rows(path := Path(path), find_recipe([path], recipe)) as rows:
        frames = rows.table.select(pl.col("t").drop_nulls().unique()).collect(engine="streaming")["t"]
    return np.asarray(np.diff(np.sort(frames.to_numpy())))


def summarise_people(path: str | Path, recipe: Recipe | None = None) -> pd.DataFrame:
    """Summarise the file `path`, read with a `recipe`, by person.

    Columns id, first_seen, last_seen, longest_gap [s], rows.

    Examples
    --------
    >>> import pandas as pd
    >>> from studies.quality import summarise_people
    >>> pd.DataFrame({"t": [0.0, 0.5, 1.5], "id": 1, "x": 0.0, "y": 0.0}).to_csv("stand.csv", index=False)
    >>> summarise_people("stand.csv")
       id  first_seen  last_seen  longest_gap  rows
    0   1         0.0        1.5          1.0     3
    """
    time = pl.col("t")
    with _usable_rows(path, recipe) as (_, scan):
        people = scan.group_by("id")
        gap = time.sort().diff().max()
        summary = people.agg(first_seen=time.min(), last_seen=time.max(), longest_gap=gap, rows=pl.len())
        return summary.sort("id").collect(engine="streaming").to_pandas()


@contextmanager
def _usable_rows(path: str | Path, recipe: Recipe | None) -> Iterator[tuple[Recipe, pl.LazyFrame]]:
    """The recipe of a file, and a scan of its usable rows: id, t [s], x, y [m], and what else it holds."""
    with open_rows(path := Path(path), find_recipe([path], recipe)) as rows:
        yield rows.recipe, rows.table.filter(rejection_reason(rows.table).is_null())


def count_visits_by_hour(rows: pd.DataFrame, *, tz: str = "UTC") -> pd.DataFrame:
    """Count visits and standing people in each hour.

    Parameters
    ----------
    rows : a table from `summarise_seconds`.
    tz : time zone of the hours.

    Returns
    -------
    day, hour, visits (people seen in the hour) and standing (mean number of people who stand).

    Examples
    --------
    >>> import pandas as pd
    >>> from studies.quality import count_visits_by_hour
    >>> rows = pd.DataFrame({"id": [1, 1, 2], "second": [0.0, 1.0, 1.0], "moved": [0.0, 0.0, 1.3]})
    >>> count_visits_by_hour(rows)
              day  hour  visits  standing
    0  1970-01-01     0       2       1.0
    """
    local = pd.to_datetime(rows["second"], unit="s", utc=True).dt.tz_convert(tz)
    keyed = rows.assign(
        day=local.dt.strftime("%Y-%m-%d"),
        hour=local.dt.hour,
        is_standing=rows["moved"] < STANDING,
    )
    grouped = keyed.groupby(["day", "hour"], as_index=False)
    table = grouped.agg(
        visits=("id", "nunique"),
        standing=("is_standing", "sum"),
        seconds=("second", "nunique"),
    )
    return table.assign(standing=table["standing"] / table["seconds"]).drop(columns="seconds")
