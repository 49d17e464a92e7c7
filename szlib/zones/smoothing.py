"""Smoothed paths: the nearest of several noisy positions is too near, by 8 cm for a noise of 5 cm."""

from __future__ import annotations

import numpy as np
import pandas as pd

from ..core.checks import Array
from .outliers import encounter_numbers

# Paths are smoothed over this time before and after [s] (measured: 0.5 s leaves an effect of 5 cm noise).
SMOOTHING = 0.7

_DEGREE = 2  # of the smoothing polynomial
_TICK = 0.1  # time between samples [s]


def smooth_paths(
    samples: pd.DataFrame, column: str = "los_angle"
) -> tuple[Array, Array]:
    """Line-of-sight angle [rad] and distance [m] of `samples` (n,) along smoothed paths, in the same order.

    The angle is that of a `column`: los_angle, or other_los_angle.

    Local polynomials of degree 2 over +-`SMOOTHING` (Savitzky & Golay, 1964) smooth each encounter, but not
    across a gap in time. Straight and evenly curved paths do not change. Without a column `t`, no path does.
    """
    angle, distance = samples[[column, "distance"]].to_numpy(float).T
    if "t" not in samples:
        return angle, distance
    number, t = encounter_numbers(samples)[0], samples["t"].to_numpy(float)
    order = np.lexsort([t, number])
    path = (distance * np.exp(1j * angle))[order]
    is_gap = np.abs(np.diff(t[order]) - _TICK) > _TICK / 2
    is_end = is_gap | (np.diff(number[order]) != 0)
    starts = np.flatnonzero(np.append(True, is_end))
    lengths = np.diff(np.append(starts, len(path)))
    for length in np.unique(lengths[lengths > _DEGREE + 1]):
        rows = starts[lengths == length][:, None] + np.arange(length)
        path[rows] = path[rows] @ _smoothing_matrix(length).T
    path = path[np.argsort(order)]
    return np.angle(path), np.abs(path)


def _smoothing_matrix(length: int) -> Array:
    """Matrix (length, length) that replaces each of evenly spaced samples by its local polynomial."""
    half = round(SMOOTHING / _TICK)
    matrix = np.zeros((length, length))
    for i in range(length):
        near = np.arange(max(0, i - half), min(length, i + half + 1))
        matrix[i, near] = np.linalg.pinv(
            np.vander((near - i) / half, _DEGREE + 1, increasing=True)
        )[0]
    return matrix
