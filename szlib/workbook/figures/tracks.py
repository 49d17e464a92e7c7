"""Figures of tracks: where people were, how fast, and what became of the rows."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from ...encounters.geometry import Area
from .style import BLUE, GREY, RED, SEQUENCE, area_patch, get_axes, label_metres

_MOST_CELLS = 2000
"""Of a map, along each axis: cells grow with the site."""
_MARGIN = 0.02
"""Left free around a map, as a share of it: an area may end where the data ends."""


def plot_map(tracks: pd.DataFrame, area: Area, *, cell: float = 0.25, ax: Axes | None = None) -> Axes:
    """Where people were: person-seconds per square metre on a log scale, and the area (paper, fig. 1)."""
    ax = get_axes(ax, size=(9, 5))
    x, y = tracks["x"].to_numpy(), tracks["y"].to_numpy()
    while max(np.ptp(x), np.ptp(y)) / cell > _MOST_CELLS:
        cell *= 2
    edges = [np.arange(np.floor(v.min()), np.ceil(v.max()) + cell, cell) for v in (x, y)]
    seconds = np.histogram2d(x, y, bins=edges)[0] / 10 / cell**2
    shown = np.ma.masked_less_equal(np.log10(np.maximum(seconds, 1e-9)), -0.5)
    image = ax.pcolormesh(edges[0], edges[1], shown.T, cmap=SEQUENCE, rasterized=True)
    ax.figure.colorbar(image, ax=ax, shrink=0.8, label="log10 of person-seconds per m$^2$")
    ax.add_patch(area_patch(area, edgecolor=RED, linewidth=2, label=f"the area, {area.area:.0f} m$^2$"))
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.12))
    for axis, edge, ends in zip("xy", edges, (area.box.x, area.box.y), strict=True):
        low, high = min(edge[0], ends[0]), max(edge[-1], ends[1])
        ax.set(**{f"{axis}lim": (low - _MARGIN * (high - low), high + _MARGIN * (high - low))})
    return label_metres(ax, "Where people were seen, and where they are watched")


def plot_speed_histogram(
    by_column: np.ndarray, by_displacement: np.ndarray, *, ax: Axes | None = None
) -> Axes:
    """Speed as recorded against speed from displacement [m/s], both shape (n,)."""
    ax = get_axes(ax)
    bins = np.linspace(0, 2.5, 101)
    for values, name, colour, line in (
        (by_displacement, "from displacement", BLUE, "-"),
        (by_column, "the file's column", RED, "--"),
    ):
        ax.hist(
            values,
            bins=bins.tolist(),
            histtype="step",
            color=colour,
            linestyle=line,
            linewidth=1.6,
            label=name,
        )
    ax.set(xlabel="speed [m/s]", ylabel="samples", title="The velocity column never stands still")
    ax.legend()
    return ax


def plot_funnel(funnel: pd.DataFrame, *, ax: Axes | None = None) -> Axes:
    """What each stage kept, as points on a log scale; `funnel` as from `szlib.tracks.funnels.table`.

    A bar would have no length there: a log scale has no zero.
    """
    kept = funnel[funnel["what"] == "kept"]
    ax = get_axes(ax, size=(8, 0.4 * len(kept) + 1))
    ax.plot(kept["rows"], kept["stage"], "o-", color=BLUE, markersize=7, linewidth=1)
    for at, rows in enumerate(kept["rows"]):
        ax.annotate(f"{rows:,}", (rows, at), (9, 0), textcoords="offset points", va="center", fontsize=8)
    ax.invert_yaxis()
    ax.grid(axis="x", color=GREY, alpha=0.3)
    ax.set(xscale="log", xlabel="rows kept (log scale)", title="From rows of tracks to a hull")
    ax.set_xlim(left=max(float(kept["rows"].min()), 1) / 4, right=float(kept["rows"].max()) * 8)
    return ax
