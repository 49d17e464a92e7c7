"""Figures of tracks: speeds, and how many rows each stage keeps (notebook 24)."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from szlib.workbook.figures.palette import BLUE, GREY, RED
from szlib.workbook.figures.style import add_legend_below, get_axes


def plot_speed_histogram(recorded: np.ndarray, displaced: np.ndarray, *, ax: Axes | None = None) -> Axes:
    """Plot the distribution of recorded speeds and of speeds from displacement.

    Parameters
    ----------
    recorded : speeds in the file's column, shape (n,) [m/s].
    displaced : speeds from displacement, shape (n,) [m/s].
    ax : axes to draw on; None makes new ones.

    Examples
    --------
    >>> import numpy as np
    >>> import plots
    >>> ax = plots.plot_speed_histogram(np.full(9, 1.0), np.linspace(0, 1.6, 9))
    """
    ax = get_axes(ax)
    style = {
        "bins": np.linspace(0, 2.5, 101).tolist(),
        "histtype": "step",
        "linewidth": 1.6,
    }
    ax.hist(displaced, color=BLUE, label="from displacement", **style)
    ax.hist(recorded, color=RED, linestyle="--", label="the file's column", **style)
    ax.set(
        xlabel="speed [m/s]",
        ylabel="samples",
        title="Recorded speed, and speed from displacement",
    )
    add_legend_below(ax)
    return ax


def plot_funnel(funnel: pd.DataFrame, *, ax: Axes | None = None) -> Axes:
    """Plot how many rows each stage keeps, as points on a log scale; a log scale has no zero for bars.

    Parameters
    ----------
    funnel : table as from `szlib.tracks.funnels.table`.
    ax : axes to draw on; None makes new ones.

    Examples
    --------
    >>> import pandas as pd
    >>> import plots
    >>> stages = pd.DataFrame({"stage": ["read", "in the area"], "what": "kept", "rows": [9000, 200]})
    >>> plots.plot_funnel(stages).get_title()
    '200 of 9,000 rows remain'
    """
    kept = funnel[funnel["what"] == "kept"]
    rows = kept["rows"]
    ax = get_axes(ax, size=(8, 0.4 * len(kept) + 1))
    ax.plot(rows, kept["stage"], "o-", color=BLUE, markersize=7, linewidth=1)
    for at, n in enumerate(rows):
        ax.annotate(
            f"{n:,}",
            (n, at),
            (9, 0),
            textcoords="offset points",
            va="center",
            fontsize=8,
        )
    ax.invert_yaxis()
    ax.grid(axis="x", color=GREY, alpha=0.3)
    ax.set(xscale="log", xlabel="rows kept (log scale)")
    ax.set_title(f"{rows.iloc[-1]:,} of {rows.iloc[0]:,} rows remain")
    ax.set_xlim(left=max(float(rows.min()), 1) / 4, right=float(rows.max()) * 8)
    return ax
