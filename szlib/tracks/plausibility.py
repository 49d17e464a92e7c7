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
from .formats import TrackFormat
from .motion import FASTEST, MAX_SITE, REGULAR, find_walking, measure_motion
from .options import FRAMES, UNITS, advise

_MIN_SITE = 0.5  # a smaller site [m] means that metres were read as millimetres
# nobody is faster [m/s]; a sensor that confuses two people errs by less [m]
_SPRINT, _JUMP = (12.5, 100.0)
_ROWS = 200_000  # number of rows that are looked at
_DEGREE = 111_320.0  # metres in a degree of latitude, or of longitude at the equator
_WALK = 1.2  # a usual walking speed [m/s]


def check_people(
    rows: pl.DataFrame, layout: TrackFormat, path: Path, *, is_unit_given: bool
) -> None:
    """Raise DataError where people cannot move as they do in a table, and suggest another reading.

    Parameters
    ----------
    rows : t, id, x, y in the units of the file.
    layout, path : the format of the file, and the file.
    is_unit_given : whether the user has given the unit; then a DataWarning is enough, as where people may
        just all be standing.
    """
    found = measure_motion(_convert(rows, layout))
    if found is None or not (found.fault or found.irregularity > REGULAR):
        return
    advice = suggest_reading(rows, layout)
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


def suggest_reading(rows: pl.DataFrame, layout: TrackFormat) -> str:
    """Advice for the first other reading of `rows`, read as `layout`, in which people walk; empty if none."""
    seen = _convert(rows, layout)
    for reading, advice in _readings(seen, layout):
        found = measure_motion(reading)
        if found is not None and found.is_walking:
            return advice
    order = find_walking(seen)
    if order is None or order == (0, 1, 2, 3):
        return ""
    names = ("t", "id", "x", "y")
    exchanged = {names[k]: names[at] for k, at in enumerate(order) if at != k}
    return f"columns look exchanged: if they are, {advise(columns=layout.name_columns(**exchanged))}"


def check_unit(rows: pl.DataFrame, layout: TrackFormat, path: Path) -> None:
    """Raise DataError where `rows` x, y of file `path`, read as `layout`, span an impossible site."""
    positions = rows.select("x", "y").to_numpy()
    if (
        layout.metres < 1
        and (reach := float(np.abs(positions).max())) * layout.metres < _MIN_SITE
    ):
        raise DataError(
            f"{path}: positions reach only {reach:.3g}, expected millimetres as in {layout.name}; if they "
            f"are metres, {advise(unit='m')}; if the site is that small, {advise(unit='mm')}"
        )
    if layout.metres == 1:
        low, high = np.quantile(positions, [0.01, 0.99], axis=0)
        if (spread := float((high - low).max())) > MAX_SITE:
            raise DataError(
                f"{path}: positions spread over {spread:.3g}, expected metres as in {layout.name}; if they "
                f"are millimetres, {advise(unit='mm')}; if the site is that wide, {advise(unit='m')}"
            )


def _convert(rows: pl.DataFrame, layout: TrackFormat) -> np.ndarray:
    """The first rows as t [s], id, x, y [m], shape (4, n)."""
    large = pl.col("id").abs().max() >= 2**53  # floats do not tell such ids apart
    person = pl.when(large).then(pl.col("id").rank("dense")).otherwise("id")
    first = rows.head(_ROWS).select("t", person, "x", "y").to_numpy().astype(float).T
    return np.asarray(
        first * np.array([[layout.seconds], [1.0], [layout.metres], [layout.metres]])
    )


def _readings(
    rows: np.ndarray, layout: TrackFormat
) -> Iterator[tuple[np.ndarray, str]]:
    """Other readings of rows (4, n), the likeliest first, each with its advice."""
    t, person, x, y = rows[:, np.isfinite(rows).all(axis=0)]
    for name, unit in (("millimetres", "mm"), ("centimetres", "cm"), ("feet", "ft")):
        scaled = np.array([t, person, x * UNITS[unit], y * UNITS[unit]])
        yield scaled, f"positions look like {name}: {advise(unit=unit)}"
    for name, rate in (("milliseconds", 1000.0), ("numbers of frames", FRAMES)):
        if name == "milliseconds" or (t % 1 == 0).all():
            advice = advise(columns=layout.name_columns(frame="t"), frame_rate=rate)
            yield (
                np.array([t / rate, person, x, y]),
                f"times look like {name}: {advice}",
            )
    project = "project them to metres first: x = 111320 cos(lat) (lon - lon0), y = 111320 (lat - lat0)"
    for one, other, names in (
        (x, y, "longitude and latitude"),
        (y, x, "latitude and longitude"),
    ):
        if (np.abs(one) <= 180).all() and (np.abs(other) <= 90).all():
            east, north = one * _DEGREE * np.cos(np.radians(other)), other * _DEGREE
            yield (
                np.array([t, person, east, north]),
                f"positions look like degrees of {names}: {project}",
            )
