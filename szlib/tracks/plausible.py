"""What people can do, and what is wrong with a table where they cannot: units, times, columns, degrees.

People walk at 1 to 2 m/s, are seen every few seconds at the latest, and a site is neither wider than a
kilometre nor smaller than a metre.  A table in which most people do something else is held against what it
would say if it were read differently, and the first reading in which people are people again is told.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from itertools import permutations
from pathlib import Path
from typing import NamedTuple

import numpy as np
import polars as pl

from ..errors import DataError, DataWarning
from .formats.layouts import Format

_MAX_SITE = 1000.0
"""A site wider than this [m] means that millimetres were read as metres."""
_MIN_SITE = 0.5
"""A site that reaches less far than this [m] means that metres were read as millimetres."""
_FASTEST = (4.0, 6.0)
"""Half of all steps of a second are slower than the first, nine of ten slower than the second [m/s]."""
_SLOWEST, _SLOWEST_FRAMES = 0.1, 0.3
"""One of ten steps is faster [m/s] where anybody walks; where times are whole numbers, and may be frames."""
_LONGEST_STEP = 5.0
"""People are seen at least so often [s]."""
_ENOUGH, _ROWS = 20, 200_000
"""Steps that tell something; rows that are looked at."""
_REGULAR = 0.5
"""Quartiles of these steps, over their median: a clock's are less apart."""
_DEGREE = 111_320.0
"""Metres in a degree of latitude, or of longitude at the equator."""
_FRAMES = 25.0
"""Frames a second, where it matters only that they are some ten."""


class Motion(NamedTuple):
    """What people do: half of their steps are slower than `median`, nine of ten than `fast` [m/s].

    `step` is the median time between samples of a person [s] and `ragged` the distance of its quartiles, over
    it; `spread` is the width of the site [m]; `whole` whether all times are whole numbers; `doubled` the
    share of rows at whose time the person has two, and `people` whether ids are whole numbers.
    """

    median: float
    fast: float
    step: float
    ragged: float
    spread: float
    whole: bool
    doubled: float
    people: bool

    @property
    def fault(self) -> str:
        """Why people cannot be like that; empty where they can."""
        if self.median > _FASTEST[0] or self.fast > _FASTEST[1]:
            return f"people move at {self.median:.3g} m/s (median), expected 0 to {_FASTEST[0]:g}"
        if self.fast < (_SLOWEST_FRAMES if self.whole and self.step <= 1 else _SLOWEST):
            return f"nobody walks: nine of ten steps are slower than {self.fast:.2g} m/s"
        return ""

    @property
    def walks(self) -> bool:
        """Whether this is how people walk, and are seen, beyond doubt."""
        pace = self.median <= 3 and 0.3 <= self.fast <= _FASTEST[0] and self.ragged <= _REGULAR
        seen = 0.005 <= self.step <= _LONGEST_STEP and 1 <= self.spread <= _MAX_SITE
        return pace and seen and self.people and self.doubled < 0.01


def motion(rows: np.ndarray) -> Motion | None:
    """What the people of rows t [s], id, x, y [m], shape (4, n), do; None where there is too little of it."""
    rows = rows[:, np.isfinite(rows).all(axis=0)]
    t, person, x, y = rows[:, np.lexsort((rows[0], rows[1]))]
    same = person[1:] == person[:-1]
    steps = np.diff(t)[same]
    first = np.flatnonzero(np.r_[True, ~same | (np.diff(np.floor(t)) != 0)][: len(t)])  # one row a second
    by_second = person[first][1:] == person[first][:-1]
    if by_second.sum() < _ENOUGH:
        return None
    moved = np.hypot(np.diff(x[first]), np.diff(y[first]))[by_second]
    median, fast = np.quantile(moved / np.diff(t[first])[by_second], [0.5, 0.9])
    low, step, high = np.quantile(steps, [0.25, 0.5, 0.75])
    spread = float(np.ptp(np.quantile([x, y], [0.01, 0.99], axis=1), axis=0).max())
    whole, people = bool((t % 1 == 0).all()), bool((person % 1 == 0).all())
    ragged = float((high - low) / step) if step > 0 else np.inf
    doubled = float((steps <= 0).mean())
    return Motion(float(median), float(fast), float(step), ragged, spread, whole, doubled, people)


def check_people(rows: pl.DataFrame, layout: Format, path: Path, *, metres: float, sure: bool) -> None:
    """Raise DataError where people move as none can, and say what the table would be if they did.

    `rows` has t, id, x, y in the file's own units; `metres` in a unit of position.  Where `sure` (a unit was
    given), or where it may just be that nobody walks, a DataWarning says so.
    """
    seen = _seen(rows, layout, metres)
    found = motion(seen)
    if found is None or not (found.fault or found.ragged > _REGULAR):
        return
    remedy = _remedy(seen, layout)
    if not (found.fault or remedy):
        return  # people may be seen at any time
    why = found.fault or "the times at which people are seen are no clock's"
    told = f"{path}: {why}" + (f"; {remedy}" if remedy else "")
    if sure or (found.fast <= _FASTEST[1] and not remedy):
        warnings.warn(told, DataWarning, stacklevel=2)
    else:
        raise DataError(f"{told}; if people do move like that, pass unit=")


def suggestion(rows: pl.DataFrame, layout: Format, *, metres: float) -> str:
    """How a table of which most rows cannot be used might be read; empty where nothing fits."""
    return _remedy(_seen(rows, layout, metres), layout)


def check_unit(rows: pl.DataFrame, layout: Format, path: Path) -> None:
    """Raise DataError where a site of that size cannot be."""
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


def _seen(rows: pl.DataFrame, layout: Format, metres: float) -> np.ndarray:
    """The first rows as t [s], id, x, y [m], shape (4, n)."""
    first = rows.select("t", "id", "x", "y").head(_ROWS).to_numpy().astype(float).T
    return np.asarray(first * np.array([[layout.seconds], [1.0], [metres], [metres]]))


def _remedy(rows: np.ndarray, layout: Format) -> str:
    """The first other reading in which people walk, and how to ask for it."""
    for read, told in _readings(rows):
        found = motion(read)
        if found is not None and found.walks:
            return told
    return _exchanged(rows, layout)


def _readings(rows: np.ndarray) -> Iterator[tuple[np.ndarray, str]]:
    """Other readings of rows (4, n), the likeliest first, each with the advice that belongs to it."""
    t, person, x, y = rows[:, np.isfinite(rows).all(axis=0)]
    for unit, name, factor in (("mm", "millimetres", 1e-3), ("cm", "centimetres", 1e-2)):
        yield np.array([t, person, x * factor, y * factor]), f"positions look like {name}: pass unit={unit!r}"
    yield (
        np.array([t / 1000, person, x, y]),
        "times look like milliseconds: divide them by 1000",
    )
    if (t % 1 == 0).all():
        yield (
            np.array([t / _FRAMES, person, x, y]),
            "times look like numbers of frames: pass columns={'frame': 't'} and frame_rate=, frames a second",
        )
    project = "project them to metres first: x = 111320 cos(lat) (lon - lon0), y = 111320 (lat - lat0)"
    for one, other, names in (
        (x, y, "longitude and latitude"),
        (y, x, "latitude and longitude"),
    ):
        if (np.abs(one) <= 180).all() and (np.abs(other) <= 90).all():
            east, north = one * _DEGREE * np.cos(np.radians(other)), other * _DEGREE
            yield np.array([t, person, east, north]), f"positions look like degrees of {names}: {project}"


def _exchanged(rows: np.ndarray, layout: Format) -> str:
    """Advice where the columns, exchanged, are those of people who walk; the most regular clock is time."""
    names, found = ["t", "id", "x", "y"], []
    for order in permutations(range(4)):
        seen = motion(rows[list(order)])
        if seen is not None and seen.walks:
            moved = sum(k != at for k, at in enumerate(order))
            found.append((round(seen.ragged, 3), moved, order))
    if not found or (order := min(found)[2]) == (0, 1, 2, 3):
        return ""
    if layout.header:
        columns: dict[str, str | int] = {names[k]: names[at] for k, at in enumerate(order) if at != k}
    else:
        columns = {names[k]: layout.columns[names[at]] for k, at in enumerate(order)}
    return f"columns look exchanged: if they are, pass columns={columns}"
