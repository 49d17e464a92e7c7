"""Figures of tracks: where people walked, how fast, and how many rows each stage keeps."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from ...encounters.geometry import Area
from .palette import RED, SEQUENCE
from .style import add_legend_below, area_patch, get_axes, label_metres


def plot_map(
    tracks: pd.DataFrame, area: Area, *, cell: float = 0.25, ax: Axes | None = None
) -> Axes:
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
    >>> from szlib.workbook import figures
    >>> t = np.arange(50) / 10
    >>> tracks = pd.DataFrame({"day": "d", "id": 1, "t": t, "x": t - 13, "y": 0 * t, "vx": 1.0, "vy": 0.0})
    >>> ax = figures.plot_map(tracks, szlib.ATC_SQUARE)
    """
    ax = get_axes(ax, size=(9, 5))
    x, y = tracks["x"].to_numpy(), tracks["y"].to_numpy()
    while (
        max(np.ptp(x), np.ptp(y)) / cell > 2000
    ):  # cells along an axis; those of a larger site are larger
        cell *= 2
    edges = [
        np.arange(np.floor(v.min()), np.ceil(v.max()) + cell, cell) for v in (x, y)
    ]
    seconds = np.histogram2d(x, y, bins=edges)[0] / 10 / cell**2
    shown = np.ma.masked_less_equal(np.log10(np.maximum(seconds, 1e-9)), -0.5)
    image = ax.pcolormesh(edges[0], edges[1], shown.T, cmap=SEQUENCE, rasterized=True)
    ax.figure.colorbar(
        image, ax=ax, shrink=0.8, label="log10 of person-seconds per m$^2$"
    )
    ax.add_patch(
        area_patch(
            area, edgecolor=RED, linewidth=2, label=f"the area, {area.area:.0f} m$^2$"
        )
    )
    add_legend_below(ax)
    for axis, edge, ends in zip("xy", edges, (area.box.x, area.box.y), strict=True):
        low, high = min(edge[0], ends[0]), max(edge[-1], ends[1])
        margin = 0.02 * (high - low)
        ax.set(**{f"{axis}lim": (low - margin, high + margin)})
    return label_metres(ax, "Where people walked, and the area")
