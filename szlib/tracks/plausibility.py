"""Whether tracks can be those of people; if not, with which other recipe they would be.

People walk at 1 to 2 m/s, are seen every few seconds at the latest, and a site is between a metre and a
kilometre wide.  Where most people of a table do something else, other units, times and columns are tried.
The error message suggests the first of them with which people walk.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import permutations
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import polars as pl

from ..core.errors import DataError, warn
from .recipe import DEGREES, TIME_UNITS, UNITS, Recipe, advise
from .shapes import SHAPES

# widest site [m]; a smaller site [m] means that metres were read as millimetres
_SITES = (0.5, 1000.0)
# greatest median and greatest 90 % quantile of the speed of people [m/s]
_FASTEST = (3.0, 6.0)
# smallest and greatest 90 % quantile of the speed where people certainly walk [m/s]
_WALKS = (0.6, 4.0)
# shortest and longest usual time between two samples of a person [s]
_STEPS = (0.005, 5.0)
_ROUGH = 1.0  # greatest roughness of ways; people who are mixed up have 1.4 and more
_MIN_STEPS = 20  # number of steps that allows a judgement
# greatest interquartile range of the sampling interval, over its median, of a regular clock
_REGULAR = 0.5
# nobody is faster [m/s]; a sensor that confuses two people errs by less [m]
_SPRINT, _JUMP = (12.5, 100.0)
MOST_SHOWN = 200_000  # number of rows that are looked at
_DEGREE = 111_320.0  # metres in a degree of latitude, or of longitude at the equator
_WALK = 1.2  # a usual walking speed [m/s]
_FRAMES = 25.0  # a usual frame rate [1/s], for suggestions
# letters in a line of a map; letters from nobody to most people
_MAP, _INK = (60, " .:+#")


class Motion(NamedTuple):
    """How people move in a table.

    Attributes
    ----------
    median_speed, high_speed : median and 90 % quantile of the speed of people [m/s].
    interval : median time between two samples of a person [s].
    irregularity : interquartile range of that time, over its median.
    width : width of the site [m].
    roughness : median change of the velocity from one second to the next, over the median speed.
    """

    median_speed: float
    high_speed: float
    interval: float
    irregularity: float
    width: float
    roughness: float

    @property
    def fault(self) -> str:
        """Why people cannot move like this; empty where they can."""
        if self.median_speed > _FASTEST[0] or self.high_speed > _FASTEST[1]:
            return f"people move at {self.median_speed:.3g} m/s (median), expected 0 to {_FASTEST[0]:g}"
        if self.high_speed < _WALKS[0]:
            quantiles = f"the median of their speed is {self.median_speed:.2g} m/s, the 90 % quantile"
            return f"nobody walks: {quantiles} {self.high_speed:.2g} m/s"
        return ""

    @property
    def is_walking(self) -> bool:
        """Whether people certainly walk, and are sampled regularly."""
        return (
            not self.fault
            and self.high_speed <= _WALKS[1]
            and self.irregularity <= _REGULAR
            and _STEPS[0] <= self.interval <= _STEPS[1]
            and 1 <= self.width <= _SITES[1]
            and self.roughness < _ROUGH
        )


def measure_motion(rows: np.ndarray) -> Motion | None:
    """How people move in `rows` t [s], id, x, y [m], shape (4, n); None where there are too few steps."""
    rows = rows[:, np.isfinite(rows).all(axis=0)]
    t, person, x, y = rows[:, np.lexsort((rows[0], rows[1]))]
    same = person[1:] == person[:-1]
    steps = np.diff(t)[same]
    # one row a second
    first = np.flatnonzero(np.r_[True, ~same | (np.diff(np.floor(t)) != 0)][: len(t)])
    by_second = person[first][1:] == person[first][:-1]
    if by_second.sum() < _MIN_STEPS:
        return None
    moved = np.diff([x[first], y[first]], axis=1)
    velocity = moved / np.where(by_second, np.diff(t[first]), np.nan)
    speed = np.hypot(*velocity)[by_second]
    change = np.hypot(*np.diff(velocity, axis=1))
    change = change[np.isfinite(change)]
    median, fast = np.quantile(speed, [0.5, 0.9])
    low, step, high = np.quantile(steps, [0.25, 0.5, 0.75])
    return Motion(
        median_speed=float(median),
        high_speed=float(fast),
        interval=float(step),
        irregularity=float((high - low) / step) if step > 0 else np.inf,
        width=_spread(np.array([x, y])),
        roughness=float(np.median(change) / median) if len(change) and median else 0.0,
    )


def check_people(
    rows: pl.DataFrame,
    recipe: Recipe,
    given: Recipe,
    path: Path,
    suggest: Callable[[], str],
) -> None:
    """Raise DataError where people cannot move as in a table, or on such a site; suggest another reading.

    Where the user has given the unit, a DataWarning is enough, as where people may just all be standing.

    Parameters
    ----------
    rows : t [s], id, x, y [m].
    recipe, path : how the file was read, and the file.
    given : the recipe that the user gave.
    suggest : gives advice how to read the file.
    """
    seen, is_given = first_rows(rows), given.has_places
    if not is_table_known(recipe):
        found = measure_motion(seen)
        fault = found.fault if found else "people are seen too briefly"
        is_fast = found is not None and found.high_speed > _FASTEST[1]
        is_odd = fault or (found and found.irregularity > _REGULAR)
        advice = suggest() if is_odd else ""
        message = f"{path}: {fault or 'people are seen at irregular times'}"
        message += f"; {advice}" if advice else ""
        if is_given and advice:
            warn(message)
        elif not is_given and (advice or is_fast):
            if found and found.median_speed > _FASTEST[0]:
                scale = float(f"{_WALK / found.median_speed:.2g}")
                advice = advise(scale=scale)
                message += f"; if they are pixels in which people walk at {_WALK:g} m/s, {advice}"
            raise DataError(
                f"{message}; if people do move like that, {advise(unit='m')}"
            )
    metres, reach = recipe.metres or 1.0, np.abs(seen[2:]).max()
    is_small = metres < 1 and reach < _SITES[0]
    spread = reach if is_small else _spread(seen[2:])
    if not is_given and (is_small or (metres == 1 and spread > _SITES[1])):
        unit, other = ("m", "mm") if is_small else ("mm", "m")
        raise DataError(
            f"{path}: positions span {spread:.3g} m, read as {recipe.file_format}; if they are in {unit}, "
            f"{advise(unit=unit)}; if the site is of that size, {advise(unit=other)}"
        )


def _spread(places: np.ndarray) -> float:
    """The wider side of the rectangle that holds nearly all `places`, shape (2, n)."""
    low, high = np.quantile(places, [0.01, 0.99], axis=1)
    return float((high - low).max())


def is_table_known(recipe: Recipe) -> bool:
    """Whether files of the shape in the `recipe` cannot have other units or columns."""
    shape = SHAPES[recipe.file_format or "tidy"]
    return shape.is_sure or bool(shape.parse)


def find_implausible(rows: pl.DataFrame) -> list[str]:
    """What people cannot do in `rows` day, id, t [s], x, y [m], sorted by day, id and t, as texts."""
    person = pl.struct("day", "id").rle_id()
    first = rows.head(MOST_SHOWN).select("t", person.alias("id"), "x", "y").to_numpy()
    motion = measure_motion(first.astype(float).T)
    step, x, y = (pl.col(name).diff() for name in ("t", "x", "y"))
    moved = (x**2 + y**2).sqrt()
    is_jump = (person.diff() == 0) & (moved > _JUMP + _SPRINT * step)
    speeds = rows.select((moved / step).filter(is_jump)).to_series()
    texts = [motion.fault] if motion and motion.fault else []
    if n := len(speeds):
        fastest = speeds.to_numpy().max()
        texts.append(
            f"people jump {n:,} times, at up to {fastest:,.0f} m/s: positions or ids are wrong"
        )
    return texts


def first_rows(rows: pl.DataFrame) -> np.ndarray:
    """The first of `rows` as t, id, x, y, shape (4, n)."""
    large = pl.col("id").abs().max() >= 2**53  # floats do not tell such ids apart
    person = pl.when(large).then(pl.col("id").rank("dense")).otherwise("id")
    return (
        rows.head(MOST_SHOWN).select("t", person, "x", "y").to_numpy().astype(float).T
    )


# --- other recipes ------------------------------------------------------------------------------------


def suggest_columns(
    values: np.ndarray,
    names: Sequence[str | int],
    known: Sequence[int | None],
    recipe: Recipe,
) -> str:
    """Advice for the first change of a `recipe` with which people walk; empty if there is none.

    Parameters
    ----------
    values : numbers of some columns, shape (m, n); those of t in seconds.
    names : of the columns.
    known : number of the column of t, id, x and y, None where it is unknown.
    recipe : with the columns that are known.
    """
    given = recipe.columns or {}
    for change, factors, is_counted, at in _changes(values, recipe, known):
        order = _find_walking(values, at, factors, is_counted=is_counted)
        if order is None:
            continue
        quantities = ("frame" if is_counted else "t", "id", "x", "y")
        columns = {name: names[k] for name, k in zip(quantities, order, strict=True)}
        if not columns.items() <= given.items():
            change = {"columns": columns, **change}
        if change:
            rate = f"{_FRAMES:g} frames a second are only a guess: "
            guess = rate if "frame_rate" in change else ""
            return f"people walk if it is read like this: {guess}{advise(**change)}"
    return ""


Change = tuple[dict[str, Any], list[float], bool, Sequence[int | None]]


def _changes(
    values: np.ndarray, recipe: Recipe, known: Sequence[int | None]
) -> Iterator[Change]:
    """Changes of a `recipe`, the likeliest first, where the columns of t, id, x, y are `known`, or some.

    Each with the factors of t, id, x and y, whether t is counted in frames, and the columns that it keeps.
    """
    is_frame, metres = "frame" in (recipe.columns or {}), recipe.metres or 1.0
    for is_counted in (True,) if is_frame else (False, True):
        more = {"frame_rate": _FRAMES} if is_counted and not recipe.frame_rate else {}
        t = 1 / (recipe.frame_rate or _FRAMES) if is_counted else 1.0
        yield more, [t, 1, metres, metres], is_counted, known
        for unit in ("m", "mm", "cm", "ft"):
            change, factor = {"unit": unit, **more}, UNITS[unit]
            yield change, [t, 1, factor, factor], is_counted, known
    if is_frame or None in known:
        return
    if recipe.time_unit is None:
        for unit in ("ms", "days"):
            factors = [TIME_UNITS[unit], 1, metres, metres]
            yield {"time_unit": unit}, factors, False, known
    if (np.abs(values[2]) <= 180).all() and (np.abs(values[3]) <= 90).all():
        lon, lat = (round(float(np.median(each)), 2) for each in values[2:4])
        east = _DEGREE * np.cos(np.radians(lat))
        degrees = {"unit": DEGREES, "origin": [lon, lat]}
        yield degrees, [1, 1, east, _DEGREE], False, known
    yield {}, [1, 1, metres, metres], False, [None] * 4  # in another order


def _find_walking(
    values: np.ndarray,
    known: Sequence[int | None],
    factors: Sequence[float],
    *,
    is_counted: bool,
) -> list[int] | None:
    """The columns in which people walk, as t, id, x, y; None where there are none.

    Of several orders, ways are smoothest, t has the most regular clock, and most columns are in place.
    """
    found = []
    free = [k for k in range(len(values)) if k not in known]
    for choice in permutations(free, known.count(None)):
        rest = iter(choice)
        order = [next(rest) if k is None else k for k in known]
        t, person = values[order[0]], values[order[1]]
        whole = [person, t] if is_counted else [person]
        if any((each[np.isfinite(each)] % 1 != 0).any() for each in whole):
            continue
        motion = measure_motion(values[order] * np.array(factors)[:, None])
        if motion is not None and motion.is_walking:
            n_moved = sum(k != place for place, k in enumerate(order))
            scores = round(motion.roughness, 1), round(motion.irregularity, 3), n_moved
            found.append((scores, order))
    return min(found)[-1] if found else None


# --- what a file was read as --------------------------------------------------------------------------


def describe_rows(rows: pl.DataFrame, recipe: Recipe, name: str) -> str:
    """The first of `rows` t [s], id, x, y [m] of a file called `name`, and its `recipe`, in a few lines.

    They say how people move and where, and draw a map.
    """
    rows, columns = rows.head(MOST_SHOWN), recipe.columns or {}
    shown = ", ".join(f"{name} = {at}" for name, at in columns.items())
    lines = [f"{name} is read as {recipe.file_format}: {shown}"]
    if rows.height == 0:
        return lines[0]
    t, _, x, y = seen = first_rows(rows)
    first = "first " if rows.height == MOST_SHOWN else ""
    lines.append(
        f"{first}{rows.height:,} rows: {rows['id'].n_unique():,} people in {np.ptp(t):,.1f} s"
    )
    if (motion := measure_motion(seen)) is not None:
        speeds = f"speed {motion.median_speed:.2f} m/s (median), {motion.high_speed:.2f} (90 % quantile)"
        lines.append(f"{speeds}; a person is seen every {motion.interval:.3g} s")
    (west, east), (south, north) = ((each.min(), each.max()) for each in (x, y))
    lines.append(
        f"x {west:.1f} to {east:.1f} m, y {south:.1f} to {north:.1f} m; where people were seen:"
    )
    aspect = min((north - south) / max(east - west, 1e-9), 1.0)
    shape = max(1, round(_MAP * aspect / 2)), _MAP
    counts = np.histogram2d(y, x, bins=shape)[0][::-1]
    shares = np.minimum(counts / max(np.quantile(counts, 0.95), 1.0), 1.0)
    levels = np.ceil(shares * (len(_INK) - 1)).astype(int)
    return "\n".join([*lines, *("".join(_INK[k] for k in row) for row in levels)])
