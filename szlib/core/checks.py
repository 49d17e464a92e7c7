"""Checks of arguments: numbers and arrays of the right shape and range, tables with their columns."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import DataError, SolverError
from .input_files import require

if TYPE_CHECKING:
    import pandas as pd

Array = NDArray[np.float64]  # an array of floats
# Largest coordinate, speed or parameter that is accepted [m, m/s, ...]. Floats are spaced 1.5e-8 there,
# well below the tolerance of the controller. Every map projection of the Earth stays below it.
LARGEST = 1e8
_NUMBERS = {float, np.float64}  # types of single numbers that are checked fast


def check_columns(table: pd.DataFrame, needed: Sequence[str]) -> None:
    """Raise DataError if `table` has no row, or lacks one of the columns `needed`."""
    missing = [name for name in needed if name not in table.columns]
    if missing:
        raise DataError(
            f"columns {missing} are missing; found {list(map(str, table.columns))}, expected {list(needed)}"
        )
    if len(table) == 0:
        raise DataError(f"the table is empty; expected rows of {list(needed)}")


def check_rows(
    table: pd.DataFrame, is_valid: ArrayLike, columns: Sequence[str], expected: str
) -> None:
    """Raise DataError with the first row of a table that is not valid.

    Parameters
    ----------
    table : any table.
    is_valid : whether each row is valid, shape (n,).
    columns : columns of the row that the message shows.
    expected : the rest of the message: what was expected, and what to do.
    """
    invalid = np.flatnonzero(~np.asarray(is_valid, bool))
    if len(invalid):
        row = table[list(columns)].iloc[invalid[0]].to_dict()
        raise DataError(f"row {table.index[invalid[0]]}: got {row}; {expected}")


def check_array(name: str, value: ArrayLike, shape: tuple[Any, ...]) -> Array:
    """A copy of `value` as an array of floats.

    Parameters
    ----------
    name : of the argument, for the message.
    value : numbers.
    shape : the shape expected; a leading ... stands for any number of axes.

    Raises
    ------
    SolverError : another shape, not numbers, not finite, or beyond +-`LARGEST`.
    """
    # NumPy refuses rows of several lengths: then this text stays, which is refused as no number.
    array = np.array("rows of several lengths")
    with suppress(ValueError):
        array = np.asarray(value)
    of = f"shape {shape}".replace("Ellipsis", "...")
    require(array.dtype.kind in "iuf", name, value, f"numbers of {of}", SolverError)
    sizes = shape[1:] if ... in shape else shape
    n_free = array.ndim - len(sizes)
    if array.shape[n_free:] != sizes or (n_free and sizes == shape):
        raise SolverError(f"{name} must have {of}; got {array.shape}")
    array = array.astype(float)
    require(np.isfinite(array).all(), name, value, "finite", SolverError)
    if (np.abs(array) > LARGEST).any():
        raise SolverError(
            f"{name} must lie within +-{LARGEST:g}; got {array.tolist()!s:.200}; move the origin"
        )
    return array


def check_vector(name: str, value: ArrayLike, n: int) -> list[float]:
    """The `n` numbers of `value` as Python floats; checks and `name` as in `check_array`, but faster."""
    row: Any = value.tolist() if isinstance(value, np.ndarray) else value
    is_row = isinstance(row, tuple | list) and _NUMBERS.issuperset(map(type, row))
    if is_row and len(row) == n and sum(map(abs, row)) <= LARGEST:
        return list(map(float, row))
    return list(check_array(name, value, (n,)).tolist())


def check_point(name: str, value: ArrayLike) -> tuple[float, float]:
    """The two numbers of `value` as Python floats; checks and `name` as in `check_array`, but faster."""
    x, y = check_vector(name, value, 2)
    return x, y


def check_number(name: str, value: ArrayLike) -> float:
    """The number `value` as a Python float; checks and `name` as in `check_array`, but faster."""
    if type(value) is float and abs(value) <= LARGEST:
        return value
    return float(check_array(name, value, ()))
