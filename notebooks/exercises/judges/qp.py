"""A quadratic program, as the answers of sheets 5 and 6 and their judges solve it."""

from __future__ import annotations

from typing import Any

import daqp
import numpy as np
from numpy.typing import ArrayLike


class Infeasible(ValueError):
    """No z satisfies all rows and bounds."""


def solve_qp(H: ArrayLike, f: ArrayLike, rows: ArrayLike, least: ArrayLike, low: float, high: float) -> Any:
    """Find z with the smallest z'Hz / 2 + f'z, where rows @ z >= least and low <= z <= high.

    Parameters
    ----------
    H : symmetric, positive definite, shape (n, n).
    f : shape (n,).
    rows, least : shapes (m, n) and (m,); empty lists if there are no rows.
    low, high : bounds of each number of z.

    Returns
    -------
    z, shape (n,).

    Raises
    ------
    Infeasible : no z satisfies all rows and bounds.
    """
    H, f = np.ascontiguousarray(H, float), np.ascontiguousarray(f, float)
    n, least = len(f), np.asarray(least, float).ravel()
    rows = np.ascontiguousarray(np.asarray(rows, float).reshape(len(least), n))
    lower = np.concatenate([np.full(n, float(low)), least])
    upper = np.concatenate([np.full(n, float(high)), np.full(len(least), 1e30)])
    z, _, flag, _ = daqp.solve(H, f, rows, upper, lower, np.zeros(len(lower), np.int32))
    if flag < 1:
        raise Infeasible("the quadratic program has no solution")
    return z
