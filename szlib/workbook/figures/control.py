"""Figures of barriers: the level lines of a distance, and where it is wrong."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import ArrayLike

from ...control.barriers import Array, barrier, check_wall, ellipse_distance, segment_distance
from ...control.distances import (
    euclidean_to_ellipse,
    euclidean_to_segment,
    overestimate,
    required_margin,
    safe_edge,
)
from ...zones.ellipses import Ellipse
from .style import BLACK, RED, axes, metres

_NEAR = 0.9
"""Farther away it does not matter where a distance is wrong [m]."""


def plot_distance(
    of: Ellipse | tuple[Array, Array], *, extent: float = 2.5, margin: float = 0.55, ax: Axes | None = None
) -> Axes:
    """Level lines of the paper's approximate distance to an ellipse, or to a segment given by its ends.

    `margin` [m] draws where h = 0 for a robot of that radius (margin included).
    """
    ax = axes(ax, size=(5.5, 4.5))
    x, y = np.meshgrid(np.linspace(-extent, extent, 241), np.linspace(-extent, extent, 241))
    grid = np.stack([x, y], axis=-1)
    if isinstance(of, Ellipse):
        distance, outline, name = ellipse_distance(grid, of), of.curve(), "the zone"
    else:
        distance, outline, name = segment_distance(grid, *of), np.array(of), "the wall"
    levels = [d for d in np.arange(-0.5, 3, 0.25).tolist() if abs(d) > 0.1 and abs(d - margin) > 0.1]
    lines = ax.contour(x, y, distance, levels=levels, cmap="viridis", linewidths=0.8)
    ray = np.linspace(0, extent, 500)[:, None] * (0.6, -0.8)
    along = ellipse_distance(ray, of) if isinstance(of, Ellipse) else segment_distance(ray, *of)
    crossed = [d for d in levels if max(0, along.min()) < d < along.max()]
    at = [tuple(ray[np.abs(along - d).argmin()].tolist()) for d in crossed]
    ax.clabel(lines, fmt="%.2f", fontsize=7, manual=at)
    ax.contour(x, y, barrier(distance, margin, 0.0), levels=[0.0], colors=[RED], linewidths=2)
    ax.plot(*outline.T, color=BLACK, linewidth=2, label=f"{name}, d = 0")
    ax.plot([], [], color=RED, linewidth=2, label=f"h = 0, d = {margin:g} m")
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.13), ncols=2, fontsize=8)
    return metres(ax, f"Distance to {name} [m], and h = 0")


def plot_overestimate(
    of: Ellipse | ArrayLike, *, r_robot: float, eps: float, extent: float = 2.0, ax: Axes | None = None
) -> Axes:
    """Approximate less Euclidean distance [cm] near a zone or a wall, and h = 0 with two margins.

    Dotted: where the robot's disc touches, in Euclidean distance.  An h = 0 inside of it is a collision.
    """
    ax = axes(ax, size=(5.5, 4.5))
    ticks = np.linspace(-extent, extent, 321)
    x, y = np.meshgrid(ticks, ticks)
    grid = np.stack([x, y], axis=-1)
    if isinstance(of, Ellipse):
        true = euclidean_to_ellipse(grid, of)
    else:
        true = euclidean_to_segment(grid, *check_wall(of))
    error = np.ma.masked_where((true < 0) | (true > _NEAR), 100 * overestimate(grid, of))
    image = ax.pcolormesh(x, y, error, cmap="RdBu_r", vmin=-25, vmax=25, rasterized=True)
    ax.figure.colorbar(image, ax=ax, shrink=0.85, label="d - Euclidean [cm], red is dangerous")
    outline = of.curve() if isinstance(of, Ellipse) else check_wall(of)
    ax.plot(*outline.T, color=BLACK, linewidth=3)
    needed = max(eps, required_margin(of, r_robot))
    for margin, line in ((eps, "-"), (needed, "--")):
        edge = safe_edge(of, r_robot + margin)
        label = f"h = 0, eps = {100 * margin:.0f} cm"
        ax.plot(*np.vstack([edge, edge[:1]]).T, line, color=BLACK, linewidth=1.8, label=label)
        if needed == eps:
            break
    ax.contour(x, y, true, levels=[r_robot], colors=[BLACK], linestyles=[":"], linewidths=1.8)
    ax.plot([], [], ":", color=BLACK, label="the robot's disc touches")
    ax.set(xlim=(-extent, extent), ylim=(-extent, extent))
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.13), fontsize=8, ncols=2)
    return metres(ax, "Where the distance is wrong")
