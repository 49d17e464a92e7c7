"""How people move in a table: their speeds, the sampling interval, the width of the site."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import permutations
from typing import NamedTuple

import numpy as np

MAX_SITE = 1000.0  # a wider site [m] means that millimetres were read as metres
# greatest median and greatest 90 % quantile of the speed of people [m/s]
FASTEST = (3.0, 6.0)
# greatest 90 % quantile of the speed where people certainly walk [m/s]
_FAST_WALK = 4.0
_SLOWEST = 0.6  # smallest 90 % quantile of the speed of people [m/s]; less is usual only where they stand
_LONGEST_STEP = 5.0  # longest time between two samples of a person [s]
_ROUGH = 1.0  # greatest roughness of ways; people who are mixed up have 1.4 and more
_MIN_STEPS = 20  # number of steps that allows a judgement
REGULAR = 0.5  # greatest interquartile range of the sampling interval, over its median, of a regular clock


class Motion(NamedTuple):
    """How people move in a table.

    Attributes
    ----------
    median_speed, high_speed : median and 90 % quantile of the speed of people [m/s].
    interval : median time between two samples of a person [s].
    irregularity : interquartile range of that time, over its median.
    width : width of the site [m].
    roughness : median change of the velocity from one second to the next, over the median speed.
    has_whole_ids : whether all ids are whole numbers.
    doubled : fraction of rows at whose time the person has another row.
    """

    median_speed: float
    high_speed: float
    interval: float
    irregularity: float
    width: float
    roughness: float
    has_whole_ids: bool
    doubled: float

    @property
    def fault(self) -> str:
        """Why people cannot move like this; empty where they can."""
        if self.median_speed > FASTEST[0] or self.high_speed > FASTEST[1]:
            return f"people move at {self.median_speed:.3g} m/s (median), expected 0 to {FASTEST[0]:g}"
        if self.high_speed < _SLOWEST:
            quantiles = f"the median of their speed is {self.median_speed:.2g} m/s, the 90 % quantile"
            return f"nobody walks: {quantiles} {self.high_speed:.2g} m/s"
        return ""

    @property
    def is_walking(self) -> bool:
        """Whether people certainly walk, and are sampled regularly."""
        return (
            self.median_speed <= FASTEST[0]
            and _SLOWEST <= self.high_speed <= _FAST_WALK
            and self.irregularity <= REGULAR
            and 0.005 <= self.interval <= _LONGEST_STEP
            and 1 <= self.width <= MAX_SITE
            and self.roughness < _ROUGH
            and self.has_whole_ids
            and self.doubled < 0.01
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
    steps_by_second = np.diff([x[first], y[first]], axis=1) / np.where(
        by_second, np.diff(t[first]), np.nan
    )
    moved = np.hypot(np.diff(x[first]), np.diff(y[first]))[by_second]
    change = np.hypot(*np.diff(steps_by_second, axis=1))
    change = change[np.isfinite(change)]
    median, fast = np.quantile(moved / np.diff(t[first])[by_second], [0.5, 0.9])
    low, step, high = np.quantile(steps, [0.25, 0.5, 0.75])
    return Motion(
        median_speed=float(median),
        high_speed=float(fast),
        interval=float(step),
        irregularity=float((high - low) / step) if step > 0 else np.inf,
        width=float(np.ptp(np.quantile([x, y], [0.01, 0.99], axis=1), axis=0).max()),
        roughness=float(np.median(change) / median) if len(change) and median else 0.0,
        has_whole_ids=bool((person % 1 == 0).all()),
        doubled=float((steps <= 0).mean()),
    )


def find_walking(
    columns: np.ndarray,
    known: Mapping[int, int] | None = None,
    rate: float = 1.0,
    metres: float = 1.0,
) -> tuple[int, ...] | None:
    """The columns in which people walk, as t, id, x, y; None where there are none.

    Parameters
    ----------
    columns : numbers, shape (m, n).
    known : number of the column of t (0), id (1), x (2) and y (3), as far as they are known.
    rate : of t [1/s]; with another than 1 s, t must be whole numbers.
    metres : metres in a unit of x and y.

    Returns
    -------
    Four numbers of columns.  Of several orders, ways are smoothest, t has the most regular clock, and most
    columns are in place.
    """
    known, found = known or {}, []
    free = [k for k in range(len(columns)) if k not in known.values()]
    missing = [place for place in range(4) if place not in known]
    for choice in permutations(free, len(missing)):
        chosen = {**known, **dict(zip(missing, choice, strict=True))}
        order = tuple(chosen[place] for place in range(4))
        rows = columns[list(order)]
        if rate != 1 and (rows[0][np.isfinite(rows[0])] % 1 != 0).any():
            continue
        motion = measure_motion(rows * [[1 / rate], [1.0], [metres], [metres]])
        if motion is not None and motion.is_walking:
            n_moved = sum(k != place for place, k in enumerate(order))
            found.append(
                (
                    round(motion.roughness, 1),
                    round(motion.irregularity, 3),
                    n_moved,
                    order,
                )
            )
    return min(found)[-1] if found else None
