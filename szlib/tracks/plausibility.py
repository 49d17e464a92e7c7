"""Whether tracks can be those of people; if not, which unit, time or column was probably misread.

People walk at 1 to 2 m/s, are seen every few seconds at the latest, and a site is between a metre and a
kilometre wide.  Where most people of a table do something else, other readings are tried: other units, other
times, exchanged columns, degrees.  The error message suggests the first one in which people walk.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import polars as pl

from ..core.errors import DataError, warn
from .motion import FASTEST, MAX_SITE, REGULAR, find_walking, measure_motion
from .recipe import TIME_UNITS, UNITS, Recipe, advise
from .shapes import SHAPES

_MIN_SITE = 0.5  # a smaller site [m] means that metres were read as millimetres
# nobody is faster [m/s]; a sensor that confuses two people errs by less [m]
_SPRINT, _JUMP = (12.5, 100.0)
_ROWS = 200_000  # number of rows that are looked at
_DEGREE = 111_320.0  # metres in a degree of latitude, or of longitude at the equator
_WALK = 1.2  # a usual walking speed [m/s]
_FRAMES = 25.0  # a usual frame rate [1/s], for suggestions
_SURE = ("atc-raw", "ewap")  # shapes whose units cannot be others


def check_people(
    rows: pl.DataFrame, recipe: Recipe, path: Path, *, is_unit_given: bool
) -> None:
    """Raise DataError where people cannot move as they do in a table, and suggest another reading.

    Parameters
    ----------
    rows : t [s], id, x, y [m].
    recipe, path : how the file was read, and the file.
    is_unit_given : whether the user has given the unit; then a DataWarning is enough, as where people may
        just all be standing.
    """
    if is_table_known(recipe):
        return
    seen = first_rows(rows)
    found = measure_motion(seen)
    if found is None:
        days = (seen[0] - seen[0].min()) * TIME_UNITS["days"]
        motion = measure_motion(np.vstack([days, seen[1:]]))
        if "t" in (recipe.columns or {}) and motion and motion.is_walking:
            advice = advise(time_unit="days")
            raise DataError(f"{path}: times look like days of Excel: {advice}")
        return
    if not (found.fault or found.irregularity > REGULAR):
        return
    advice = suggest_reading(seen, recipe)
    if not (found.fault or advice):
        return  # people may be seen at irregular times
    message = f"{path}: {found.fault or 'people are seen at irregular times'}" + (
        f"; {advice}" if advice else ""
    )
    if is_unit_given and advice:
        warn(message)
    elif not is_unit_given and (advice or found.high_speed > FASTEST[1]):
        if found.median_speed > FASTEST[0]:
            scale = float(f"{_WALK / found.median_speed:.2g}")
            message += f"; if they are pixels in which people walk at {_WALK:g} m/s, {advise(scale=scale)}"
        raise DataError(f"{message}; if people do move like that, {advise(unit='m')}")


def is_table_known(recipe: Recipe) -> bool:
    """Whether files of the shape in the `recipe` cannot have other units or columns."""
    shape = SHAPES[recipe.file_format or "tidy"]
    return shape.parse is not None or shape.name in _SURE


def find_implausible(rows: pl.DataFrame) -> list[str]:
    """What people cannot do in `rows` day, id, t [s], x, y [m], sorted by day, id and t, as texts."""
    person = pl.struct("day", "id").rle_id()
    first = (
        rows.head(_ROWS)
        .select("t", person.alias("id"), "x", "y")
        .to_numpy()
        .astype(float)
    )
    motion, n_jumps, fastest = measure_motion(first.T), 0, 0.0
    step, moved = (
        pl.col("t").diff(),
        (pl.col("x").diff() ** 2 + pl.col("y").diff() ** 2).sqrt(),
    )
    is_jump = (person.diff() == 0) & (moved > _JUMP + _SPRINT * step)
    for block in rows.iter_slices(
        1 << 20
    ):  # a table of the steps of a whole day would double its memory
        speeds = block.select((moved / step).filter(is_jump)).to_series()
        n_jumps, fastest = n_jumps + len(speeds), max([fastest, *speeds.top_k(1)])
    texts = [motion.fault] if motion is not None and motion.fault else []
    if n_jumps:
        texts.append(
            f"people jump {n_jumps:,} times, at up to {fastest:,.0f} m/s: positions or ids are wrong"
        )
    return texts


def suggest_reading(seen: np.ndarray, recipe: Recipe) -> str:
    """Advice for the first reading, other than the `recipe`, in which people walk; empty if there is none.

    The rows t [s], id, x, y [m] were `seen` with the recipe, shape (4, n).
    """
    seen = seen[:, np.isfinite(seen).all(axis=0)]
    if not seen.size:
        return ""
    for reading, advice in _readings(seen, recipe):
        found = measure_motion(reading)
        if found is not None and found.is_walking:
            return advice
    order, columns = find_walking(seen), dict(recipe.columns or {})
    if order is None or order == (0, 1, 2, 3) or "t" not in columns:
        return ""
    names = ("t", "id", "x", "y")
    exchanged = {names[k]: columns[names[at]] for k, at in enumerate(order) if at != k}
    if any(isinstance(at, int) for at in columns.values()):
        exchanged = {name: columns[name] for name in names} | exchanged
    return f"columns look exchanged: if they are, {advise(columns=exchanged)}"


def check_unit(rows: pl.DataFrame, recipe: Recipe, path: Path) -> None:
    """Raise DataError where `rows` x, y [m] of file `path`, read with a `recipe`, span an impossible site."""
    positions, metres = rows.select("x", "y").to_numpy(), recipe.metres or 1.0
    if metres < 1 and (reach := float(np.abs(positions).max())) < _MIN_SITE:
        raise DataError(
            f"{path}: positions reach only {reach / metres:.3g}, expected millimetres as in "
            f"{recipe.file_format}; if they are metres, {advise(unit='m')}; if the site is that small, "
            f"{advise(unit='mm')}"
        )
    low, high = np.quantile(positions, [0.01, 0.99], axis=0)
    if metres == 1 and (spread := float((high - low).max())) > MAX_SITE:
        raise DataError(
            f"{path}: positions spread over {spread:.3g}, expected metres as in {recipe.file_format}; if "
            f"they are millimetres, {advise(unit='mm')}; if the site is that wide, {advise(unit='m')}"
        )


def first_rows(rows: pl.DataFrame) -> np.ndarray:
    """The first of `rows` as t, id, x, y, shape (4, n)."""
    large = pl.col("id").abs().max() >= 2**53  # floats do not tell such ids apart
    person = pl.when(large).then(pl.col("id").rank("dense")).otherwise("id")
    return rows.head(_ROWS).select("t", person, "x", "y").to_numpy().astype(float).T


def _readings(rows: np.ndarray, recipe: Recipe) -> Iterator[tuple[np.ndarray, str]]:
    """Other readings of rows (4, n), the likeliest first, each with its advice."""
    t, person, x, y = rows
    metres = recipe.metres or 1.0
    for name, unit in (("millimetres", "mm"), ("centimetres", "cm"), ("feet", "ft")):
        factor = UNITS[unit] / metres
        yield (
            np.array([t, person, x * factor, y * factor]),
            f"positions look like {name}: {advise(unit=unit)}",
        )
    time = (recipe.columns or {}).get("t")
    if time is not None and recipe.time_unit is None:
        yield (
            np.array([t / 1000, person, x, y]),
            f"times look like milliseconds: {advise(time_unit='ms')}",
        )
        if (t % 1 == 0).all():
            columns = {"frame": time}
            if isinstance(time, int):
                columns |= {
                    name: (recipe.columns or {})[name] for name in ("id", "x", "y")
                }
            yield (
                np.array([t / _FRAMES, person, x, y]),
                "times look like numbers of frames: name them, and give the frame rate of the video; "
                f"{_FRAMES:g} is only a guess: {advise(columns=columns, frame_rate=_FRAMES)}",
            )
    for one, other, names in (
        (x, y, "longitude and latitude"),
        (y, x, "latitude and longitude: exchange the columns x and y, and"),
    ):
        if (np.abs(one) <= 180).all() and (np.abs(other) <= 90).all():
            east, north = one * _DEGREE * np.cos(np.radians(other)), other * _DEGREE
            origin = [round(float(np.median(values)), 2) for values in (one, other)]
            yield (
                np.array([t, person, east, north]),
                f"positions look like degrees of {names}: {advise(unit='deg', origin=origin)}",
            )
