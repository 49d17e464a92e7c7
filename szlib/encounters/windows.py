"""Windows of ticks: those that meet a condition throughout, and do not overlap."""

from __future__ import annotations

import numpy as np


def always(condition: np.ndarray, first: np.ndarray, last: np.ndarray) -> np.ndarray:
    """Whether the condition holds at every row from first to last (inclusive)."""
    failures = np.r_[0, np.cumsum(~condition)]
    return np.asarray(failures[last + 1] == failures[np.minimum(first, last + 1)])


def without_overlap(openings: np.ndarray, whole: np.ndarray, steps: int) -> np.ndarray:
    """Earliest windows first: those of `whole` that begin after the end of the last one taken."""
    taken = np.zeros(len(openings), bool)
    candidates = np.flatnonzero(whole)
    following = np.searchsorted(openings[candidates], openings[candidates] + steps, side="right")
    at = 0
    while at < len(candidates):
        taken[candidates[at]] = True
        at = int(following[at])
    return taken


def sift(rows: np.ndarray, conditions: list[tuple[str, np.ndarray]]) -> tuple[np.ndarray, dict[str, int]]:
    """Rows that meet all conditions, and how many each condition turned away first."""
    reasons: dict[str, int] = {}
    for reason, condition in conditions:
        passing = rows[condition[rows]]
        reasons[reason] = len(rows) - len(passing)
        rows = passing
    return rows, reasons
