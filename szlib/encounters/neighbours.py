"""Rows of people who are near each other at one moment."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

_AT_ONCE = 2_000_000  # pairs of rows held in memory at a time


def find_neighbours(
    x: np.ndarray, y: np.ndarray, moment: np.ndarray, reach: float
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield blocks of pairs of rows at one moment that are at most `reach` [m] apart, each pair once.

    Only rows in the same or neighbouring cells of this width are compared.

    Parameters
    ----------
    x, y : positions, shape (n,) [m].
    moment : number of the moment of each row, at least 0, shape (n,).
    reach : largest distance [m].
    """
    if len(x) == 0:
        return
    ix, iy = (((v - v.min()) // reach).astype(np.int64) for v in (x, y))
    ny, nx = int(iy.max()) + 3, int(ix.max()) + 2
    key = (moment * np.int64(nx) + ix) * ny + iy
    order = np.argsort(key)
    key, x, y, row = key[order], x[order], y[order], np.arange(len(key))
    first, end = (key, key + ny - 1), (key + 1, key + ny + 1)
    for low_key, high_key in zip(first, end, strict=True):
        low = np.maximum(np.searchsorted(key, low_key), row + 1)
        high = np.searchsorted(key, high_key, side="right")
        count = np.maximum(high - low, 0)
        ends = np.cumsum(count)
        cuts = np.searchsorted(ends, np.arange(_AT_ONCE, ends[-1], _AT_ONCE))
        for start, end in zip(np.r_[0, cuts], np.r_[cuts, len(key)], strict=True):
            n = count[start:end]
            one = np.repeat(row[start:end], n)
            other = np.arange(n.sum()) - np.repeat(np.cumsum(n) - n, n) + low[one]
            near = np.hypot(x[one] - x[other], y[one] - y[other]) <= reach
            yield order[one[near]], order[other[near]]
