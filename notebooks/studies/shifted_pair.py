"""The first figure of notebook 06: two strangers as they walked, one of them delayed, and how near all pairs come."""

from __future__ import annotations

from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from studies.respect import draw_pair

import szlib
from szlib.workbook import figures

NEAR = 0.7
"""The distance for which the title counts pairs [m] (assumed)."""


def list_approaches(
    samples: pd.DataFrame, null: szlib.NullEncounters, r_max: float
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Kind and nearest approach [m] of each encounter within `r_max` [m], as people walked and shifted in time."""
    walked = samples.groupby("encounter").agg(kind=("kind", "first"), nearest=("distance", "min"))
    seen, chance = (each[each["nearest"] < r_max] for each in (walked, null.encounters))
    return seen, chance


def draw_shifted_pair(
    pair: tuple[np.ndarray, np.ndarray, np.ndarray, float],
    seen: pd.Series[float],
    chance: pd.Series[float],
    r_max: float,
) -> Figure:
    """Draw a pair as it walked, the pair with a delay, and the nearest approaches of all pairs.

    Parameters
    ----------
    pair : its paths, and the delay, as of `respect.shift_a_pair`.
    seen, chance : nearest approach of each pair, as they walked and shifted in time [m].
    r_max : the largest of these [m].
    """
    mine, theirs, delayed, delay = pair
    figure, panels = plt.subplots(1, 3, figsize=(12, 3.4), layout="constrained", width_ratios=(1, 1, 1.2))
    when = "later" if delay > 0 else "earlier"
    draw_pair(panels[0], mine, theirs, "As they walked")
    draw_pair(panels[1], mine, delayed, f"One {abs(delay):.1f} s {when}")
    both = np.vstack([mine, theirs, delayed])
    low = both.min(axis=0) - 0.3
    high = both.max(axis=0) + 0.3
    for ax in panels[:2]:
        ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    _draw_approaches(panels[2], seen, chance, np.arange(0, r_max + 0.05, 0.1).tolist())
    return figure


def _draw_approaches(ax: Axes, seen: pd.Series[float], chance: pd.Series[float], edges: list[float]) -> None:
    """Draw a histogram of nearest approaches, and that by chance, scaled to as many pairs."""
    weights = np.full(len(chance), len(seen) / len(chance))
    line: dict[str, Any] = {"histtype": "step", "color": figures.BLACK, "linestyle": "--", "linewidth": 1.5}
    ax.hist(seen, edges, color=figures.BLUE, alpha=0.7, label="as they walked")
    ax.hist(chance, edges, weights=weights, **line, label="shifted in time")
    ax.set(xlabel="nearest approach [m]", ylabel="encounters of strangers")
    shares = [100 * (pairs < NEAR).mean() for pairs in (seen, chance)]
    ax.set_title(f"Within {NEAR} m: {shares[0]:.0f} % of the pairs, shifted {shares[1]:.0f} %")
    ax.legend(loc="upper left", fontsize=8)
