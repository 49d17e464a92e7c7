"""The funnel: how many rows entered each stage, how many were rejected, and why.

A table has its funnel in ``DataFrame.attrs["funnel"]``, which Parquet preserves.  Each stage is a plain dict
with the keys stage, entered, kept and rejected, so that the funnel stays with the data.

The reasons are here, too: what makes a row unusable, and what people cannot do.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from itertools import chain
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import polars as pl
from numpy.typing import ArrayLike
from polars import col

from ..core.errors import DataError, SzlibError
from .recipe import NAMES, TIME_UNITS, Recipe, advise
from .sources import Rows

Stages = Sequence[Mapping[str, Any]]
KEY = "funnel"
# How the name of a stage begins that rejects nothing, but says what is implausible.
WARNING = "warning: "
# why a row is rejected
MISSING = "missing or not a number"
NO_ID = "id not a whole number of 0 or more"
# 2100-01-01; later time stamps are not seconds since 1970
LAST_SECOND = 4_102_444_800.0
FARTHEST = 2e7  # farther [m] from the origin of any grid is no place on Earth
# number of rows, the first ones, by which the motion of people is judged
MAX_ROWS = 100_000
# greatest median and greatest 90 % quantile of the speed of people [m/s]
_FASTEST = (3.0, 6.0)
_WALKS = 0.6  # smallest 90 % quantile of the speed where people walk [m/s]
_MIN_STEPS = 10  # number of steps that allows a judgement
# nobody is faster [m/s]; a sensor that confuses two people errs by less [m]
_SPRINT = 12.5
_JUMP = 100.0
_WALK = 1.2  # a usual walking speed [m/s]


def stage(
    name: str, entered: int, kept: int, rejected: Mapping[str, int]
) -> dict[str, Any]:
    """One stage of a funnel.

    Parameters
    ----------
    name : name of the stage.
    entered, kept : number of rows before and after the stage.
    rejected : number of rejected rows by reason.

    Raises
    ------
    SzlibError : `entered` is not `kept` plus the rejected rows.

    Examples
    --------
    >>> from szlib.tracks import funnels
    >>> funnels.stage("read a.csv", 10, 9, {"not finite": 1, "no day": 0})
    {'stage': 'read a.csv', 'entered': 10, 'kept': 9, 'rejected': {'not finite': 1}}
    """
    reasons = {reason: int(count) for reason, count in rejected.items() if count}
    if entered != kept + sum(reasons.values()):
        raise SzlibError(
            f"funnel stage '{name}' does not add up: {entered} != {kept} + {reasons}"
        )
    return {
        "stage": name,
        "entered": int(entered),
        "kept": int(kept),
        "rejected": reasons,
    }


def get(frame: pd.DataFrame) -> list[dict[str, Any]]:
    """The stages that `frame` has gone through (a copy); empty for a table made by hand.

    Examples
    --------
    >>> import pandas as pd
    >>> from szlib.tracks import funnels
    >>> table = funnels.attach(pd.DataFrame({"x": [1]}), [funnels.stage("read", 2, 1, {"not finite": 1})])
    >>> funnels.get(table)[0]["rejected"]
    {'not finite': 1}
    """
    return list(frame.attrs.get(KEY, []))


def warnings(stages: Stages) -> list[str]:
    """What is implausible in the rows of these `stages`, as texts.

    Examples
    --------
    >>> from szlib.tracks import funnels
    >>> funnels.warnings([funnels.stage("warning: nobody walks", 9, 9, {})])
    ['nobody walks']
    """
    return [
        s["stage"].removeprefix(WARNING)
        for s in stages
        if s["stage"].startswith(WARNING)
    ]


def attach(frame: pd.DataFrame, stages: Stages) -> pd.DataFrame:
    """Attach `stages` to `frame` and return it; example at `get`."""
    frame.attrs[KEY] = [dict(s) for s in stages]
    return frame


def select(
    frame: pd.DataFrame, is_kept: ArrayLike, name: str, reason: str
) -> pd.DataFrame:
    """The rows of a `frame` that are kept, with a further stage in its funnel.

    Parameters
    ----------
    frame : any table.
    is_kept : whether each row is kept, shape (n,).
    name : of the stage.
    reason : why the other rows are rejected.
    """
    kept = frame[np.asarray(is_kept)].copy()
    n = len(frame)
    n_kept = len(kept)
    return attach(kept, [*get(frame), stage(name, n, n_kept, {reason: n - n_kept})])


def table(stages: Stages) -> pd.DataFrame:
    """The funnel `stages` as a table: a row for entered and for kept, and one for each reason.

    Examples
    --------
    >>> from szlib.tracks import funnels
    >>> funnels.table([funnels.stage("read", 10, 9, {"not finite": 1})])
      stage          what  rows
    0  read       entered    10
    1  read  - not finite     1
    2  read          kept     9
    """
    rows = []
    for s in stages:
        reasons = [(f"- {reason}", count) for reason, count in s["rejected"].items()]
        counts = ("entered", s["entered"]), *reasons, ("kept", s["kept"])
        rows += [(s["stage"], *count) for count in counts]
    return pd.DataFrame(rows, columns=["stage", "what", "rows"])


def add(funnels: Iterable[Stages]) -> list[dict[str, Any]]:
    """Add up several `funnels`, stage by stage of the same name, in the order of first occurrence.

    Examples
    --------
    >>> from szlib.tracks import funnels
    >>> days = [[funnels.stage("read", 10, 9, {"not finite": 1})], [funnels.stage("read", 5, 5, {})]]
    >>> funnels.add(days)
    [{'stage': 'read', 'entered': 15, 'kept': 14, 'rejected': {'not finite': 1}}]
    """
    added: dict[str, dict[str, Any]] = {}
    for each in chain.from_iterable(funnels):
        total = added.setdefault(each["stage"], {"stage": each["stage"]})
        for key, value in each.items():
            if isinstance(value, Mapping):
                total[key] = dict(Counter(total.get(key, {})) + Counter(value))
            elif key != "stage":
                total[key] = total.get(key, 0) + value
    return list(added.values())


# --- rows ---------------------------------------------------------------------------------------------


def rejection_reason(table: pl.DataFrame | pl.LazyFrame) -> pl.Expr:
    """Why a row of a `table` as in `Rows` is rejected; null where it is usable."""
    numbers = col("t", "x", "y")
    reasons = {
        "missing or extra fields": col.ragged,
        MISSING: pl.any_horizontal(numbers.is_null()),
        NO_ID: col.id.is_null() | (col.id < 0),
        "not finite": ~pl.all_horizontal(numbers.is_finite()),
        "time not in seconds since 1970": col.t.abs() > LAST_SECOND,
        "position not on Earth": pl.any_horizontal(col("x", "y").abs() > FARTHEST),
    }
    if "day" in table.collect_schema():
        reasons["no day"] = col.day.is_null()
    return pl.coalesce(
        pl.when(holds).then(pl.lit(name)) for name, holds in reasons.items()
    )


# --- people -------------------------------------------------------------------------------------------


class Motion(NamedTuple):
    """How people move in a table.

    Attributes
    ----------
    median_speed, high_speed : median and 90 % quantile of the speed of people [m/s].
    interval : median time between two samples of a person [s].
    """

    median_speed: float
    high_speed: float
    interval: float

    @property
    def fault(self) -> str:
        """Why people cannot move like this; empty where they can."""
        if self.median_speed > _FASTEST[0] or self.high_speed > _FASTEST[1]:
            return f"people move at {self.median_speed:.3g} m/s (median), {self.high_speed:.3g} m/s (90 %)"
        if self.high_speed < _WALKS:
            return (
                f"nobody walks: the median of their speed is {self.median_speed:.2g} m/s, the 90 % quantile "
                f"{self.high_speed:.2g} m/s"
            )
        return ""


def measure_motion(rows: np.ndarray) -> Motion | None:
    """How people move in `rows` t [s], id, x, y [m], shape (4, n); None where there are too few steps."""
    rows = rows[:, np.isfinite(rows).all(axis=0)]
    rows = rows[:, np.lexsort((rows[0], rows[1]))]
    step, person, *_ = np.diff(rows)
    same = person == 0
    # one row a second
    is_first = np.r_[True, ~same | (np.diff(np.floor(rows[0])) != 0)]
    duration, person, *moved = np.diff(rows[:, is_first])
    by_second = person == 0
    if by_second.sum() < _MIN_STEPS:
        return None
    speed = np.hypot(*moved)[by_second] / duration[by_second]
    median, fast = np.quantile(speed, [0.5, 0.9])
    return Motion(float(median), float(fast), float(np.median(step[same])))


def first_rows(rows: pl.DataFrame) -> np.ndarray:
    """The first of `rows` as t, number of the person, x, y, shape (4, n)."""
    person = pl.struct("^(day|id)$").rank("dense")  # floats do not tell large ids apart
    return rows.head(MAX_ROWS).select("t", person, "x", "y").to_numpy().astype(float).T


def check_people(rows: Rows, good: pl.DataFrame, given: Recipe) -> None:
    """Raise DataError where people cannot move like this, and would with another unit, or are too fast.

    Where the unit is certain, or the user has given it, nothing is raised.

    Parameters
    ----------
    rows : the file, and how it was read.
    good : its usable rows t [s], id, x, y [m].
    given : the recipe that the user gave.
    """
    recipe = rows.recipe
    is_certain = recipe.shape.is_sure or given.has_metres
    found = None if is_certain else measure_motion(first_rows(good))
    if not (found and found.fault):
        return
    advice = _find_unit(recipe, found.high_speed)
    if not advice and found.high_speed > _FASTEST[1]:
        scale = float(f"{_WALK / found.median_speed:.2g}")
        advice = (
            f"leave out vehicles; if they are pixels in which people walk at {_WALK:g} m/s, "
            f"{advise(scale=scale)}"
        )
    if advice:
        raise DataError(
            f"{rows.path}: {found.fault}; {advice}; if people do move like that, {advise(unit='m')}"
        )


def _find_unit(recipe: Recipe, speed: float) -> str:
    """Advice how to complete a `recipe` so that the high `speed` of people is that of walking."""
    for change in NAMES["changes"]:
        new = Recipe(**change)
        factor = new.metres / TIME_UNITS[new.time_unit or "s"] * (new.frame_rate or 1)
        is_known = change.keys() & recipe.as_json()
        if is_known or not _WALKS < factor * speed < _FASTEST[0]:
            continue
        if new.time_unit or new.unit:
            return f"people walk if it is read like this: {advise(**change)}"
        columns = {"frame" if k == "t" else k: v for k, v in recipe.columns.items()}
        return f"if its times are frames, this is only a guess: {advise(columns=columns, **change)}"
    return ""


def find_implausible(rows: pl.DataFrame) -> list[str]:
    """What people cannot do in `rows` day, id, t [s], x, y [m], sorted by day, id and t, as texts."""
    rows = rows.with_columns(id=pl.struct("day", "id").rle_id())
    motion = measure_motion(first_rows(rows))
    texts = [motion.fault] if motion and motion.fault else []
    person, step, x, y = (col(name).diff() for name in ("id", "t", "x", "y"))
    moved = (x**2 + y**2).sqrt()
    is_far = moved > _JUMP + _SPRINT * step
    speeds = rows.select((moved / step).filter(is_far, person == 0)).to_numpy()
    if len(speeds):
        texts.append(
            f"people jump {len(speeds):,} times, at up to {speeds.max():,.0f} m/s: positions or ids are wrong"
        )
    return texts
