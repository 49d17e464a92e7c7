"""Figures of encounters: the attentional space, paths, and where the other person is."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Polygon

from ...encounters.geometry import Area, AttentionalSpace
from .palette import BLACK, BLUE, RED
from .style import add_legend_below, area_patch, get_axes, label_metres


def plot_attentional_space(
    space: AttentionalSpace,
    area: Area,
    *,
    pose: Sequence[float] = (),
    ax: Axes | None = None,
) -> Axes:
    """Plot the attentional space of a person in an area.

    Parameters
    ----------
    space : attentional space.
    area : area around it.
    pose : (x, y, heading) of the person [m, rad]; by default in the first quarter of the area, to its middle.
    ax : axes to draw on; None makes new ones.

    Examples
    --------
    >>> import szlib
    >>> from szlib.workbook import figures
    >>> ax = figures.plot_attentional_space(szlib.AttentionalSpace(), szlib.ATC_SQUARE)
    """
    ax = get_axes(ax, size=(4.5, 5.5))
    (x0, x1), (y0, y1) = area.box.x, area.box.y
    x, y, heading = pose or (0.75 * x0 + 0.25 * x1, 0.75 * y0 + 0.25 * y1, np.pi / 4)
    cos, sin = np.cos(heading), np.sin(heading)
    corners = space.corners @ np.array([[cos, sin], [-sin, cos]]) + (x, y)
    label = f"attentional space {space.width:g} m x {space.length:g} m"
    ax.add_patch(area_patch(area, edgecolor=BLACK, label="the area"))
    ax.add_patch(Polygon(corners, facecolor=BLUE, alpha=0.3, label=label))
    ax.annotate(
        "",
        (x + cos, y + sin),
        (x, y),
        arrowprops={"arrowstyle": "->", "color": RED, "lw": 2},
    )
    ax.plot(x, y, "o", color=RED, label="reference pedestrian")
    ax.set(xlim=(x0 - 1, x1 + 1), ylim=(y0 - 1, y1 + 1))
    add_legend_below(ax, ncols=1)
    return label_metres(ax, "The space lies inside the area")
