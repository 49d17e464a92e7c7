"""Checks of arguments: numbers of the right shape and range, tables with their columns."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import DataError, SolverError

if TYPE_CHECKING:
    import pandas as pd

Array = NDArray[np.float64]
"""An array of floats."""
LARGEST = 1e8
"""Greatest coordinate, speed or parameter that can be used [m, m/s, ...]: the double next to it is 1.5e-8
away, well below the tolerance of the controller. Any map projection on Earth stays below it."""
_DOUBLE = np.dtype(float)


def check_columns(frame: pd.DataFrame, needed: Sequence[str]) -> None:
    """Raise DataError where a table lacks a column, or has no row."""
    missing = [name for name in needed if name not in frame.columns]
    if missing:
        raise DataError(
            f"columns {missing} are missing; found {list(map(str, frame.columns))}, expected {list(needed)}"
        )
    if len(frame) == 0:
        raise DataError(f"the table is empty; expected rows of {list(needed)}")


def check_array(name: str, value: ArrayLike, shape: tuple[Any, ...]) -> Array:
    """A copy of `value` as floats of this shape (a leading ... for any) in +-`LARGEST`; else SolverError."""
    try:
        array = np.asarray(value)
    except ValueError as error:
        raise SolverError(f"{name} must have shape {shape}; got {value!r}") from error
    if array.dtype.kind not in "iuf":
        raise SolverError(f"{name} must be numbers of shape {shape}; got {value!r}")
    fits = array.shape[-1:] == shape[1:] if ... in shape else array.shape == shape
    if not fits:
        raise SolverError(f"{name} must have shape {shape}; got {array.shape}")
    array = array.astype(float)
    if not np.abs(array).max(initial=0.0) <= LARGEST:
        if not np.isfinite(array).all():
            raise SolverError(f"{name} must be finite; got {array.tolist()}")
        raise SolverError(f"{name} must lie within +-{LARGEST:g}; got {array.tolist()}; move the origin")
    return array


def check_vector(name: str, value: ArrayLike, n: int) -> list[float]:
    """As `check_array` of shape (n,), in a list: several times as fast for an array of floats."""
    if type(value) is np.ndarray and value.dtype is _DOUBLE and value.shape == (n,):
        numbers: list[float] = value.tolist()
        for each in numbers:  # all() takes three times as long
            if not -LARGEST <= each <= LARGEST:
                break
        else:
            return numbers
    return cast(list[float], check_array(name, value, (n,)).tolist())


def check_point(name: str, value: ArrayLike) -> tuple[float, float]:
    """As `check_array` of shape (2,), as Python floats."""
    if isinstance(value, tuple) and len(value) == 2:
        x, y = value
        if type(x) is float and type(y) is float and abs(x) <= LARGEST and abs(y) <= LARGEST:
            return x, y
    x, y = check_vector(name, value, 2)
    return x, y


def check_number(name: str, value: ArrayLike) -> float:
    """As `check_array` of shape (), as Python's own float."""
    if type(value) is float and abs(value) <= LARGEST:
        return value
    return float(check_array(name, value, ()))
