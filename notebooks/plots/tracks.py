"""Figures of tracks: where people walked (notebook 01), speeds, and how many rows each stage keeps (24)."""

from __future__ import annotations

from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from matplotlib.path import Path

from szlib.encounters.geometry import Area
from szlib.workbook.figures.style import (
    BLUE,
    GREY,
    RED,
    SEQUENCE,
    add_legend_below,
    get_axes,
    label_metres,
)


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


def plot_map(tracks: pd.DataFrame, area: Area, *, cell: float = 0.25, ax: Axes | None = None) -> Axes:
    """Plot where people walked: person-seconds per square metre on a log scale (paper, fig. 1).

    Parameters
    ----------
    tracks : table as from `szlib.read_tracks`.
    area : area in which encounters are counted.
    cell : side of a cell of the map [m].
    ax : axes to draw on; None makes new ones.

    Examples
    --------
    >>> import numpy as np, pandas as pd, szlib
    >>> import plots
    >>> t = np.arange(50) / 10
    >>> tracks = pd.DataFrame({"day": "d", "id": 1, "t": t, "x": t - 13, "y": 0 * t, "vx": 1.0, "vy": 0.0})
    >>> ax = plots.plot_map(tracks, szlib.ATC_SQUARE)
    """
    ax = get_axes(ax, size=(9, 5))
    x, y = tracks["x"].to_numpy(), tracks["y"].to_numpy()
    while max(np.ptp(x), np.ptp(y)) / cell > 2000:  # cells along an axis; those of a larger site are larger
        cell *= 2
    edges = [np.arange(np.floor(v.min()), np.ceil(v.max()) + cell, cell) for v in (x, y)]
    seconds = np.histogram2d(x, y, bins=edges)[0] / 10 / cell**2
    shown = np.ma.masked_less_equal(np.log10(np.maximum(seconds, 1e-9)), -0.5)
    image = ax.pcolormesh(edges[0], edges[1], shown.T, cmap=SEQUENCE, rasterized=True)
    ax.figure.colorbar(image, ax=ax, shrink=0.8, label="log10 of person-seconds per m$^2$")
    ax.add_patch(_outline_area(area, edgecolor=RED, linewidth=2, label=f"the area, {area.area:.0f} m$^2$"))
    add_legend_below(ax)
    for axis, edge, ends in zip("xy", edges, (area.x, area.y), strict=True):
        low, high = min(edge[0], ends[0]), max(edge[-1], ends[1])
        margin = 0.02 * (high - low)
        ax.set(**{f"{axis}lim": (low - margin, high + margin)})
    return label_metres(ax, "Where people walked, and the area")


def draw_map_and_speeds(tracks: pd.DataFrame, area: Area, *, share: float, median: float) -> Figure:
    """Draw where people walked, beside how fast they were.

    Parameters
    ----------
    tracks : table as from `szlib.read_tracks`.
    area : area in which encounters are counted.
    share : share of the time that people are in the area.
    median : speed of people who walk [m/s].

    Examples
    --------
    >>> import numpy as np, pandas as pd, szlib
    >>> import plots
    >>> t = np.arange(50) / 10
    >>> tracks = pd.DataFrame({"day": "d", "id": 1, "t": t, "x": t - 13, "y": 0 * t, "vx": 1.0, "vy": 0.0})
    >>> figure = plots.draw_map_and_speeds(tracks, szlib.ATC_SQUARE, share=0.5, median=1.0)
    >>> [ax.get_title() for ax in figure.axes[:2]]
    ['50% of their time people are in the frame', 'People who walk: 1.00 m/s (median)']
    """
    figure, (left, right) = plt.subplots(
        1, 2, figsize=(10.5, 3.1), layout="constrained", width_ratios=(1.6, 1)
    )
    plot_map(tracks, area, ax=left)
    left.set_title(f"{share:.0%} of their time people are in the frame")
    left.get_legend().remove()
    speed = np.hypot(tracks["vx"], tracks["vy"])
    hours = np.full(len(speed), 1 / 36_000)  # a sample is 0.1 s
    right.hist(speed, bins=np.arange(0, 2.55, 0.1).tolist(), weights=hours, color=BLUE)
    right.axvline(median, color=RED, linestyle="--")
    right.set(xlabel="speed [m/s]", ylabel="person-hours")
    right.set_title(f"People who walk: {median:.2f} m/s (median)")
    return figure


def _outline_area(area: Area, **style: Any) -> PathPatch:
    """Return the borders of `area`, with its holes, as one patch; `style` as for matplotlib's PathPatch."""
    rings = [Path(ring, closed=True) for ring in area.outlines]
    return PathPatch(Path.make_compound_path(*rings), fill=False, **style)
