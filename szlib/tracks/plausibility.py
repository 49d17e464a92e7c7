"""Whether tracks can be those of people; if not, which unit, time or column was probably misread.

People walk at 1 to 2 m/s, are seen every few seconds at the latest, and a site is between a metre and a
kilometre wide.  Where most people of a table do something else, other readings are tried: other units, other
times, exchanged columns, degrees.  The error message suggests the first one in which people walk.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import permutations
from pathlib import Path
from typing import NamedTuple

import numpy as np
import polars as pl

from ..errors import DataError, warn
from .formats import TrackFormat

_MAX_SITE = 1000.0  # a wider site [m] means that millimetres were read as metres
_MIN_SITE = 0.5  # a smaller site [m] means that metres were read as millimetres
_FASTEST = (3.0, 6.0)  # greatest median and greatest 90 % quantile of the speed of people [m/s]
_FAST_WALK = 4.0  # greatest 90 % quantile of the speed where people certainly walk [m/s]
_SLOWEST = 0.6  # smallest 90 % quantile of the speed of people [m/s]; less is usual only where they stand
_SPRINT, _JUMP = 12.5, 100.0  # nobody is faster [m/s]; a sensor that confuses two people errs by less [m]
_LONGEST_STEP = 5.0  # longest time between two samples of a person [s]
_MIN_STEPS, _ROWS = 20, 200_000  # number of steps that allows a judgement; number of rows that are looked at
_REGULAR = 0.5  # greatest interquartile range of the sampling interval, over its median, of a regular clock
_DEGREE = 111_320.0  # metres in a degree of latitude, or of longitude at the equator
_FRAMES = 25.0  # a typical frame rate [1/s]


class Motion(NamedTuple):
    """How people move in a table.

    Attributes
    ----------
    median_speed, high_speed : median and 90 % quantile of the speed of people [m/s].
    interval : median time between two samples of a person [s].
    irregularity : interquartile range of that time, over its median.
    width : width of the site [m].
    has_whole_times, has_whole_ids : whether all times, and all ids, are whole numbers.
    doubled : fraction of rows at whose time the person has another row.
    """

    median_speed: float
    high_speed: float
    interval: float
    irregularity: float
    width: float
    has_whole_times: bool
    has_whole_ids: bool
    doubled: float

    @property
    def fault(self) -> str:
        """Why people cannot move like this; empty where they can."""
        if self.median_speed > _FASTEST[0] or self.high_speed > _FASTEST[1]:
            return f"people move at {self.median_speed:.3g} m/s (median), expected 0 to {_FASTEST[0]:g}"
        if self.high_speed < _SLOWEST:
            quantiles = f"the median of their speed is {self.median_speed:.2g} m/s, the 90 % quantile"
            return f"nobody walks: {quantiles} {self.high_speed:.2g} m/s"
        return ""

    @property
    def is_walking(self) -> bool:
        """Whether people certainly walk, and are sampled regularly."""
        return (
            self.median_speed <= _FASTEST[0]
            and _SLOWEST <= self.high_speed <= _FAST_WALK
            and self.irregularity <= _REGULAR
            and 0.005 <= self.interval <= _LONGEST_STEP
            and 1 <= self.width <= _MAX_SITE
            and self.has_whole_ids
            and self.doubled < 0.01
        )


def measure_motion(rows: np.ndarray) -> Motion | None:
    """How people move in `rows` t [s], id, x, y [m], shape (4, n); None where there are too few steps."""
    rows = rows[:, np.isfinite(rows).all(axis=0)]
    t, person, x, y = rows[:, np.lexsort((rows[0], rows[1]))]
    same = person[1:] == person[:-1]
    steps = np.diff(t)[same]
    first = np.flatnonzero(np.r_[True, ~same | (np.diff(np.floor(t)) != 0)][: len(t)])  # one row a second
    by_second = person[first][1:] == person[first][:-1]
    if by_second.sum() < _MIN_STEPS:
        return None
    moved = np.hypot(np.diff(x[first]), np.diff(y[first]))[by_second]
    median, fast = np.quantile(moved / np.diff(t[first])[by_second], [0.5, 0.9])
    low, step, high = np.quantile(steps, [0.25, 0.5, 0.75])
    return Motion(
        median_speed=float(median),
        high_speed=float(fast),
        interval=float(step),
        irregularity=float((high - low) / step) if step > 0 else np.inf,
        width=float(np.ptp(np.quantile([x, y], [0.01, 0.99], axis=1), axis=0).max()),
        has_whole_times=bool((t % 1 == 0).all()),
        has_whole_ids=bool((person % 1 == 0).all()),
        doubled=float((steps <= 0).mean()),
    )


def check_people(rows: pl.DataFrame, layout: TrackFormat, path: Path, *, is_unit_given: bool) -> None:
    """Raise DataError where people cannot move as they do in a table, and suggest another reading.

    Parameters
    ----------
    rows : t, id, x, y in the units of the file.
    layout, path : the format of the file, and the file.
    is_unit_given : whether the user has given the unit; then a DataWarning is enough, as where people may
        just all be standing.
    """
    found = measure_motion(_convert(rows, layout))
    if found is None or not (found.fault or found.irregularity > _REGULAR):
        return
    advice = suggest_reading(rows, layout)
    if not (found.fault or advice):
        return  # people may be seen at irregular times
    fault = found.fault or "people are seen at irregular times"
    message = f"{path}: {fault}" + (f"; {advice}" if advice else "")
    if is_unit_given and advice:
        warn(message)
    elif not is_unit_given and (advice or found.high_speed > _FASTEST[1]):
        advice = "" if advice else "; convert other units, such as pixels, to metres"
        raise DataError(f"{message}{advice}; if people do move like that, pass unit=")


def find_implausible(rows: pl.DataFrame) -> list[str]:
    """What people cannot do in `rows` day, id, t [s], x, y [m], sorted by day, id and t, as texts."""
    person = pl.struct("day", "id").rle_id()
    first = rows.head(_ROWS).select("t", person.alias("id"), "x", "y").to_numpy().astype(float)
    motion, n_jumps, fastest = measure_motion(first.T), 0, 0.0
    step, moved = pl.col("t").diff(), (pl.col("x").diff() ** 2 + pl.col("y").diff() ** 2).sqrt()
    is_jump = (person.diff() == 0) & (moved > _JUMP + _SPRINT * step)
    for block in rows.iter_slices(1 << 20):  # a table of the steps of a whole day would double its memory
        speeds = block.select((moved / step).filter(is_jump)).to_series()
        n_jumps, fastest = n_jumps + len(speeds), max([fastest, *speeds.top_k(1)])
    texts = [motion.fault] if motion is not None and motion.fault else []
    if n_jumps:
        texts.append(
            f"people jump {n_jumps:,} times, at up to {fastest:,.0f} m/s: positions or ids are wrong"
        )
    return texts


def suggest_reading(rows: pl.DataFrame, layout: TrackFormat) -> str:
    """Advice for the first other reading of `rows`, read as `layout`, in which people walk; empty if none."""
    seen = _convert(rows, layout)
    for reading, advice in _readings(seen):
        found = measure_motion(reading)
        if found is not None and found.is_walking:
            return advice
    return _suggest_columns(seen, layout)


def check_unit(rows: pl.DataFrame, layout: TrackFormat, path: Path) -> None:
    """Raise DataError where `rows` x, y of file `path`, read as `layout`, span an impossible site."""
    positions = rows.select("x", "y").to_numpy()
    if layout.metres < 1 and (reach := float(np.abs(positions).max())) * layout.metres < _MIN_SITE:
        raise DataError(
            f"{path}: positions reach only {reach:.3g}, expected millimetres as in {layout.name}; if they "
            "are metres, pass unit='m' (if the site is that small, unit='mm')"
        )
    if layout.metres == 1:
        low, high = np.quantile(positions, [0.01, 0.99], axis=0)
        if (spread := float((high - low).max())) > _MAX_SITE:
            raise DataError(
                f"{path}: positions spread over {spread:.3g}, expected metres as in {layout.name}; if they "
                "are millimetres, pass unit='mm' (if the site is that wide, unit='m')"
            )


def _convert(rows: pl.DataFrame, layout: TrackFormat) -> np.ndarray:
    """The first rows as t [s], id, x, y [m], shape (4, n)."""
    large = pl.col("id").abs().max() >= 2**53  # floats do not tell such ids apart
    person = pl.when(large).then(pl.col("id").rank("dense")).otherwise("id")
    first = rows.head(_ROWS).select("t", person, "x", "y").to_numpy().astype(float).T
    return np.asarray(first * np.array([[layout.seconds], [1.0], [layout.metres], [layout.metres]]))


def _readings(rows: np.ndarray) -> Iterator[tuple[np.ndarray, str]]:
    """Other readings of rows (4, n), the likeliest first, each with its advice."""
    t, person, x, y = rows[:, np.isfinite(rows).all(axis=0)]
    for name, factor, remedy in (
        ("millimetres", 1e-3, "pass unit='mm'"),
        ("centimetres", 1e-2, "pass unit='cm'"),
        ("feet", 0.3048, "multiply them by 0.3048"),
    ):
        yield np.array([t, person, x * factor, y * factor]), f"positions look like {name}: {remedy}"
    yield np.array([t / 1000, person, x, y]), "times look like milliseconds: divide them by 1000"
    if (t % 1 == 0).all():
        advice = "pass columns={'frame': 't'} and frame_rate=, frames a second"
        yield np.array([t / _FRAMES, person, x, y]), f"times look like numbers of frames: {advice}"
    project = "project them to metres first: x = 111320 cos(lat) (lon - lon0), y = 111320 (lat - lat0)"
    for one, other, names in ((x, y, "longitude and latitude"), (y, x, "latitude and longitude")):
        if (np.abs(one) <= 180).all() and (np.abs(other) <= 90).all():
            east, north = one * _DEGREE * np.cos(np.radians(other)), other * _DEGREE
            yield np.array([t, person, east, north]), f"positions look like degrees of {names}: {project}"


def _suggest_columns(rows: np.ndarray, layout: TrackFormat) -> str:
    """Advice to exchange columns, if people walk then; the column with the most regular clock is time."""
    names, found = ["t", "id", "x", "y"], []
    for order in permutations(range(4)):
        motion = measure_motion(rows[list(order)])
        if motion is not None and motion.is_walking:
            n_moved = sum(k != at for k, at in enumerate(order))
            found.append((round(motion.irregularity, 3), n_moved, order))
    if not found or (order := min(found)[2]) == (0, 1, 2, 3):
        return ""
    if layout.has_header:
        columns: dict[str, str | int] = {names[k]: names[at] for k, at in enumerate(order) if at != k}
    else:
        columns = {names[k]: layout.columns[names[at]] for k, at in enumerate(order)}
    return f"columns look exchanged: if they are, pass columns={columns}"
