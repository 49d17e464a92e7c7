"""Pedestrian tracks on one clock, in one table.

The track table has a row for each person at each tick of the clock:

    day  local calendar date of the time stamp, "YYYY-MM-DD" (EWAP files: the file's name)
    id   person; unique within a day only, the key is (day, id)
    t    time [s], a multiple of 0.1 s
    x y  position in the world [m]
    vx vy  velocity [m/s], central difference over +-0.5 s

It is sorted by day, id, t, without duplicates.  Where two successive ticks of a person are further apart than
one step of the clock, the person was not seen in between; positions are not interpolated across such a gap.

A loader for a new data set is a function that returns such a table: it collects day, id, t [s], x, y [m] in
any order and at any rate, counts rejected rows with `funnels.stage`, and calls `to_clock`.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import pandas as pd

from ..core.checks import check_columns, check_rows
from ..core.errors import DataError
from ..core.input_files import require, require_memory
from . import funnels
from .readers import list_sources, read_raw
from .recipe import SHORTEST_GAP, Recipe, advise, find_recipe

TICKS_PER_SECOND = 10  # the common clock: positions at multiples of 0.1 s

VELOCITY_SPAN = 0.5
"""Half the time over which displacement gives velocity [s] (assumed)."""

# Longest gap across which positions are interpolated, unless the user allows more [s] (assumed).
_LONGEST_INTERVAL = 5.0

# rounding error of time stamps [s]; those near 1e9 s are exact to 2e-7 s
_ROUNDING = 1e-6

_LAST_SECOND = 1e11  # latest time [s]; up to here ticks are exact

# If more samples than this share, and than so many, have no tick, times or ids were misread (assumed).
_MOST_LOST = 0.5
_FEW = 20

_BYTES_PER_TICK = 200  # memory of a tick while a table is brought to the clock [bytes] (measured: 188)

COLUMNS = ["day", "id", "t", "x", "y", "vx", "vy"]


def read_tracks(
    paths: Any,
    *,
    recipe: Recipe | None = None,
    exclude: Iterable[str] = (),
    **parameters: Any,
) -> pd.DataFrame:
    """Read files or tables, one or many, into one track table on the common clock.

    Parameters
    ----------
    paths : a file, or several, plain or .gz: a table as text, Parquet, Feather or SQLite; ATC raw, ATC 1 Hz,
        EWAP obsmat, TrajNet++, THOR-MAGNI; by PedPy's loaders texts and HDF5 of
        Juelich's archive, Viswalk, Vadere, JuPedSim (extra `pedpy`).  Or tables: of pandas, Polars, Arrow,
        PedPy's TrajectoryData.
    recipe : how files are read; None takes the `reading.json` beside the first file, or finds one.
    exclude : days "YYYY-MM-DD" to leave out, as event days were left out in the paper (sec. 2).
    parameters : single values of `szlib.Recipe` in place of those of `recipe`, such as unit, frame_rate or
        columns; None leaves its own.

    Returns
    -------
    The track table; its funnel is in ``.attrs["funnel"]``, and a DataWarning counts the rejected rows.
    ``.attrs["area"]`` is the area of the recipe, or of files of the ATC mall; ``.attrs["recipe"]`` says how
    the first file was read.

    Raises
    ------
    DataError : names the file and line, what was found, what was expected and what to do.

    Examples
    --------
    >>> import numpy as np, pandas as pd, szlib
    >>> walk = pd.DataFrame({"t": np.arange(5.0), "id": 1, "x": 1.2 * np.arange(5), "y": 0.0})
    >>> walk.to_csv("walk.csv", index=False)
    >>> tracks = szlib.read_tracks("walk.csv", max_gap=2.0)
    >>> list(tracks.columns), len(tracks)
    (['day', 'id', 't', 'x', 'y', 'vx', 'vy'], 41)
    """
    sources = list_sources(paths)
    recipe = find_recipe(sources, recipe, **parameters)
    return interpolate(
        read_raw(sources, recipe=recipe, exclude=exclude), recipe.max_gap
    )


def to_clock(raw: pd.DataFrame, *, max_gap: float | None = None) -> pd.DataFrame:
    """Bring positions to multiples of 0.1 s by linear interpolation within gap-free pieces.

    Parameters
    ----------
    raw : a table of day, id, t [s], x, y [m], in any order.
    max_gap : a longer gap between two samples ends a piece [s]; as in `szlib.Recipe`.

    Returns
    -------
    The track table.  Each piece gives the ticks between its first and its last sample; samples of a piece
    without a tick are counted in the funnel.  Velocity is the displacement over +-0.5 s (less at the ends of
    a piece) divided by its duration; a piece of a single tick has none (NaN).

    Raises
    ------
    DataError : a column is missing, a value is not finite, a person has two rows at one time, or the samples
        are further apart than `max_gap`.

    Examples
    --------
    >>> import pandas as pd
    >>> from szlib.tracks import to_clock
    >>> raw = pd.DataFrame({"day": "any", "id": 1, "t": [0.0, 0.25], "x": [0.0, 0.5], "y": 0.0})
    >>> to_clock(raw)[["t", "x", "vx"]]
         t    x   vx
    0  0.0  0.0  2.0
    1  0.1  0.2  2.0
    2  0.2  0.4  2.0
    """
    _check_rows(raw, COLUMNS[:5])
    return interpolate(raw, max_gap)


def interpolate(raw: pd.DataFrame, max_gap: float | None) -> pd.DataFrame:
    """As `to_clock`, of rows `raw` that have been checked; `max_gap` is as there."""
    order, t, same, step = _order_rows(raw, raw["t"].to_numpy(float))
    raw = raw.iloc[order]
    if max_gap is None:
        max_gap = _usual_gap(step[same], raw.attrs.get("max_gap"))
    require(max_gap > SHORTEST_GAP, "max_gap", max_gap, "longer than the clock's 0.1 s")
    within = same & (step <= max_gap + _ROUNDING)
    steps = step[within]
    seconds = float(steps.sum())
    ticks = seconds * TICKS_PER_SECOND
    require_memory(
        ticks * _BYTES_PER_TICK, f"the clock: {ticks:,.0f} ticks of {len(t):,} rows"
    )
    row, columns, n_covered = _on_clock(t, raw[["x", "y"]].to_numpy(float).T, within)
    day = raw["day"].astype("category").array
    columns = [day.take(row), raw["id"].to_numpy()[row], *columns]
    table = pd.DataFrame(dict(zip(COLUMNS, columns, strict=True)), copy=False)
    n_lost = len(t) - n_covered
    if n_lost > _MOST_LOST * len(t) + _FEW:
        raise DataError(
            f"{n_lost:,} of {len(t):,} samples lie in pieces shorter than a step of 0.1 s: "
            "are times seconds, and ids people?  Else pass frame_rate, or a longer max_gap, or if times are "
            f"Excel's days, {advise(time_unit='days')}"
        )
    table.attrs |= {k: raw.attrs[k] for k in ("area", "recipe") if k in raw.attrs}
    reason = "in a gap-free piece that covers no tick"
    stage = funnels.stage("clock: samples", len(t), n_covered, {reason: n_lost})
    sizes = np.diff(np.flatnonzero(np.r_[True, ~within, True]))
    stage["recorded"] = {
        "squares": int(sizes @ sizes),
        "seconds": seconds,
        "cubes": float(steps @ steps**2),
    }
    return funnels.attach(table, [*funnels.get(raw), stage])


def _on_clock(
    t: np.ndarray, xy: np.ndarray, within: np.ndarray
) -> tuple[np.ndarray, list[np.ndarray], int]:
    """The ticks of all pieces: a row of the piece; t, x, y, vx, vy; how many rows have a tick.

    `within` says of each row but the first whether it continues a piece.
    """
    begin = np.flatnonzero(np.r_[True, ~within])
    size = np.diff(begin, append=len(t))
    first_t = t[begin]
    last_t = t[begin + size - 1]
    first = np.ceil((first_t - _ROUNDING) * TICKS_PER_SECOND).astype(np.int64)
    last = np.floor((last_t + _ROUNDING) * TICKS_PER_SECOND).astype(np.int64)
    count = np.maximum(last - first + 1, 0)
    start = np.cumsum(count) - count
    piece = np.repeat(np.arange(len(begin)), count)
    at = np.arange(len(piece))
    moment = (at + (first - start)[piece]) / TICKS_PER_SECOND
    # One time for all pieces, in which they follow each other, a second apart.
    shift = np.cumsum(last_t - first_t + 1) - last_t
    own = t + np.repeat(shift, size)
    when = np.clip(moment, first_t[piece], last_t[piece]) + shift[piece]
    x, y = (np.interp(when, own, each) for each in xy)
    reach = round(VELOCITY_SPAN * TICKS_PER_SECOND)
    low = np.maximum(at - reach, start[piece])
    high = np.minimum(at + reach, (start + count - 1)[piece])
    duration = np.where(high > low, (high - low) / TICKS_PER_SECOND, np.nan)
    vx, vy = ((each[high] - each[low]) / duration for each in (x, y))
    return begin[piece], [moment, x, y, vx, vy], int(size[count > 0].sum())


def compute_velocities(tracks: pd.DataFrame) -> np.ndarray:
    """Velocities vx, vy of rows `tracks` on the clock, from their positions, shape (n, 2) [m/s]."""
    return to_clock(tracks, max_gap=1.5 / TICKS_PER_SECOND)[["vx", "vy"]].to_numpy()


def nearest_tick(t: np.ndarray) -> np.ndarray:
    """Number of the clock's tick nearest to each time `t` [s], counted from t = 0."""
    return np.asarray(np.rint(t * TICKS_PER_SECOND).astype(np.int64))


def clock_index(tracks: pd.DataFrame) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Order and ticks of a track table.

    Parameters
    ----------
    tracks : a track table, sorted or not.

    Returns
    -------
    Integer arrays: the order of rows by person and time; in that order, the number of the tick, and of the
    gap-free piece.

    Raises
    ------
    DataError : a time is not on the clock, or a person has two rows at one tick.

    Examples
    --------
    >>> import pandas as pd
    >>> from szlib.tracks import clock_index, to_clock
    >>> raw = pd.DataFrame({"day": "any", "id": 1, "t": [0.0, 0.2, 9.0, 9.1], "x": 0.0, "y": 0.0})
    >>> _, tick, piece = clock_index(to_clock(raw))
    >>> tick.tolist(), piece.tolist()
    ([0, 1, 2, 90, 91], [0, 0, 0, 1, 1])
    """
    _check_rows(tracks, COLUMNS)
    t = tracks["t"].to_numpy(float)
    tick = nearest_tick(t)
    expected = "t is not a multiple of 0.1 s; bring the table to the clock with szlib.tracks.clock.to_clock"
    check_rows(tracks, np.abs(t * TICKS_PER_SECOND - tick) < 1e-3, ["t"], expected)
    order, tick, same, step = _order_rows(tracks, tick)
    return order, tick, np.r_[0, np.cumsum(~(same & (step == 1)))]


def _order_rows(
    frame: pd.DataFrame, time: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Order of rows by person and `time`, and the times in that order.

    Then, of each row but the first: whether it has the same person as the row before, and the time between
    them.  Raises DataError where a person has two rows at one time.
    """
    day = frame["day"].astype("category").cat.codes.to_numpy()
    person = frame["id"].to_numpy()
    order = np.lexsort((time, person, day))
    day = day[order]
    person = person[order]
    time = time[order]
    same = (day[1:] == day[:-1]) & (person[1:] == person[:-1])
    step = np.diff(time)
    if (same & (step <= 0)).any():
        expected = "this person has two rows at this time; keep one of them"
        good = np.r_[True, ~same | (step > 0)]
        check_rows(frame.iloc[order], good, ["id", "t"], expected)
    return order, time, same, step


def _check_rows(frame: pd.DataFrame, columns: Sequence[str]) -> None:
    """Raise DataError if one of the `columns` is missing, or a row has no person or no finite position."""
    check_columns(frame, columns)
    numbers = frame[["t", "x", "y"]].to_numpy(float)
    good = frame[["day", "id"]].notna().to_numpy().all(axis=1)
    good &= np.isfinite(numbers).all(axis=1) & (np.abs(numbers[:, 0]) < _LAST_SECOND)
    expected = "expected a day, an id, t in seconds and finite x, y; drop the row"
    check_rows(frame, good, COLUMNS[:5], expected)


def _usual_gap(intervals: np.ndarray, of_format: float | None) -> float:
    """The longest gap within a track [s]: the format's, or 4 times the median of the sampling intervals."""
    if of_format and 2 * np.count_nonzero(intervals > of_format) < len(intervals) - 1:
        return of_format  # longer than the median
    usual = float(np.median(intervals)) if len(intervals) else 0.0
    max_gap = of_format or float(np.clip(4 * usual, 0.5, _LONGEST_INTERVAL))
    if usual > max_gap:
        raise DataError(
            f"a person's samples are {usual:.3g} s apart (median), expected at most {max_gap:g} s; times "
            "without a type count as seconds: divide milliseconds by 1000; if they are seconds, pass max_gap"
        )
    return max_gap
