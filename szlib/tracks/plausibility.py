"""Advice for files in which people do not walk: another recipe with which they would, or a map of the rows.

`suggest_columns` tries other units, times and columns.  `describe_rows` shows how and where people move.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import permutations
from typing import Any

import numpy as np
import polars as pl

from .funnels import MAX_ROWS, first_rows, measure_motion
from .recipe import DEGREES, TIME_UNITS, UNITS, Recipe, advise

_DEGREE = 111_320.0  # metres in a degree of latitude, or of longitude at the equator
_FRAMES = 25.0  # a usual frame rate [1/s], for suggestions
# letters in a line of a map; letters from nobody to most people
_MAP, _INK = (60, " .:+#")

Columns = Mapping[str | int, np.ndarray]
"""Numbers of some columns; those of t in seconds."""


def suggest_columns(columns: Columns, recipe: Recipe) -> str:
    """Advice for the first change of a `recipe` with which people walk; empty if there is none.

    The `columns` that the recipe names are taken as they are.
    """
    for change, known, factors in _changes(columns, recipe):
        order = _find_walking(columns, known, factors)
        named = dict(zip(known, order, strict=False))
        if not named.items() <= recipe.columns.items():
            change = {"columns": named, **change}
        if order and change:
            rate = f"{_FRAMES:g} frames a second are only a guess: "
            guess = rate if "frame_rate" in change else ""
            return f"people walk if it is read like this: {guess}{advise(**change)}"
    return ""


def _changes(
    columns: Columns, recipe: Recipe
) -> Iterator[tuple[dict[str, Any], dict[str, Any], list[float]]]:
    """Changes of a `recipe`, the likeliest first.

    Each comes with the columns of t (or frame), id, x and y, None where one has to be found, and with the
    factors of these four.
    """
    given, metres = recipe.columns, recipe.metres
    people: dict[str, Any] = {name: given.get(name) for name in ("id", "x", "y")}
    known = {"t": given.get("t"), **people}
    rate, is_frame = recipe.frame_rate or _FRAMES, "frame" in given
    more: dict[str, Any] = {} if recipe.frame_rate else {"frame_rate": rate}
    counted = {"frame": given.get("frame", given.get("t")), **people}, more, 1 / rate
    for names, extra, t in [counted] if is_frame else [(known, {}, 1.0), counted]:
        yield extra, names, [t, 1, metres, metres]
        for unit in ("m", "mm", "cm", "ft"):
            yield {"unit": unit, **extra}, names, [t, 1, UNITS[unit], UNITS[unit]]
    if None in known.values():
        return
    for unit in () if recipe.time_unit else ("ms", "days"):
        yield {"time_unit": unit}, known, [TIME_UNITS[unit], 1, metres, metres]
    x, y = columns[known["x"]], columns[known["y"]]
    if (np.abs(x) <= 180).all() and (np.abs(y) <= 90).all():
        lon, lat = (round(float(np.median(each)), 2) for each in (x, y))
        east = _DEGREE * np.cos(np.radians(lat))
        yield {"unit": DEGREES, "origin": [lon, lat]}, known, [1, 1, east, _DEGREE]
    yield {}, dict.fromkeys(known), [1, 1, metres, metres]  # in another order


def _find_walking(
    columns: Columns, known: Mapping[str, Any], factors: Sequence[float]
) -> list[Any]:
    """The columns in which people walk, as t, id, x, y; empty where there are none.

    Of several orders, the one with the smoothest ways is taken, then the one with the most regular times,
    then the one in which fewest columns change their places.
    """
    found: list[Any] = []
    kept = list(known.values())
    free = [name for name in columns if name not in kept]
    for choice in permutations(free, kept.count(None)):
        rest = iter(choice)
        order = [next(rest) if name is None else name for name in kept]
        values = np.array([columns[name] for name in order])
        whole = values[:2] if "frame" in known else values[1]
        if (whole[np.isfinite(whole)] % 1 != 0).any():
            continue
        motion = measure_motion(values * np.array(factors)[:, None])
        if motion and motion.is_walking:
            moved = [a != b for a, b in zip(order, columns, strict=False)]
            scores = round(motion.roughness, 1), round(motion.irregularity, 3)
            found.append((*scores, sum(moved), len(found), order))
    return min(found)[-1] if found else []


def describe_rows(rows: pl.DataFrame, recipe: Recipe, name: str) -> str:
    """The first of `rows` t [s], id, x, y [m] of a file called `name`, and its `recipe`, in a few lines.

    The lines say how and where people move, and draw a map.
    """
    shown = ", ".join(f"{name} = {at}" for name, at in recipe.columns.items())
    lines = [f"{name} is read as {recipe.file_format}: {shown}"]
    if rows.height == 0:
        return lines[0]
    t, _, x, y = seen = first_rows(rows)
    first = "first " if len(t) == MAX_ROWS else ""
    lines.append(
        f"{first}{len(t):,} rows: {rows['id'].n_unique():,} people in {np.ptp(t):,.1f} s"
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
