"""Figures of zones: outliers, the hull and its slices (notebooks 03, 04)."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import cycle
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle
from mpl_toolkits.mplot3d import Axes3D
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from scipy.spatial import ConvexHull

from szlib.core.errors import ZoneError
from szlib.workbook.figures.style import (
    BLACK,
    BLUE,
    GREY,
    RED,
    add_legend_below,
    get_axes,
    label_metres,
    pick_colours,
)
from szlib.zones.hulls import HullZone
from szlib.zones.social_zone import SocialZone


def plot_outliers(
    points: np.ndarray,
    outlier: np.ndarray,
    *,
    r_max: float = 2.0,
    ax: Axes | None = None,
) -> Axes:
    """Plot inliers and outliers in complementary coordinates (paper, fig. 4a).

    Parameters
    ----------
    points : complementary coordinates (x', y'), shape (n, 2) [m].
    outlier : True for each outlier, shape (n,).
    r_max : largest distance of a sample [m].
    ax : axes to draw on; None makes new ones.

    Examples
    --------
    >>> import numpy as np
    >>> import plots
    >>> points = np.random.default_rng(0).normal(0, 0.5, (50, 2))
    >>> ax = plots.plot_outliers(points, np.arange(50) < 2)
    """
    ax, inliers = get_axes(ax, size=(6, 5)), points[~outlier]
    ax.plot(
        *inliers.T,
        ".",
        color=GREY,
        markersize=2,
        rasterized=True,
        label=f"{len(inliers):,} inliers",
    )
    ax.plot(
        *points[outlier].T,
        "x",
        color=RED,
        markersize=7,
        mew=1.8,
        label=f"{outlier.sum():,} outliers",
    )
    ax.add_patch(
        Circle(
            (0, 0),
            r_max,
            fill=False,
            linestyle=":",
            color=BLACK,
            label="contact, r = 0",
        )
    )
    ax.set(xlim=(-1.05 * r_max, 1.05 * r_max), ylim=(-1.05 * r_max, 1.05 * r_max))
    add_legend_below(ax, ncols=3)
    label_metres(ax, "The nearer a person, the farther from the centre")
    ax.set(xlabel="x' = (r_max - r) cos LOS [m]", ylabel="y' = (r_max - r) sin LOS [m]")
    return ax


def plot_hull(
    zone: SocialZone,
    speeds: Sequence[float] = (0.7, 0.9, 1.1, 1.3),
    *,
    points: np.ndarray | None = None,
    ax: Any = None,
) -> Axes3D:
    """Plot the hull over (x', y', speed) with its slices (paper, fig. 4b).

    Parameters
    ----------
    zone : a zone of method "hull" or "paper".
    speeds : walking speeds of the slices [m/s].
    points : samples (x', y', speed) to draw as well, shape (n, 3) [m, m/s].
    ax : three-dimensional axes to draw on; None makes new ones.

    Raises
    ------
    ZoneError : the zone has no hull.

    Examples
    --------
    >>> import numpy as np, pandas as pd, szlib
    >>> import plots
    >>> n, rng = 2000, np.random.default_rng(0)
    >>> samples = pd.DataFrame({"encounter": np.arange(n), "los_angle": rng.uniform(-3.1, 3.1, n)})
    >>> samples["distance"], samples["speed"] = rng.uniform(0.9, 2.5, n), rng.uniform(0.4, 1.6, n)
    >>> zone = szlib.SocialZone.fit(samples, method="hull", speeds=(0.9, 1.1), n_resamples=0)
    >>> ax = plots.plot_hull(zone, (0.9, 1.1))
    """
    if not isinstance(zone.shape, HullZone):
        raise ZoneError(f'a zone of method {zone.method!r} has no hull to draw; fit it with method="hull"')
    if ax is None:
        ax = plt.figure(figsize=(7, 6), layout="constrained").add_subplot(projection="3d")
    faces = zone.shape.vertices[ConvexHull(zone.shape.vertices).simplices]
    ax.add_collection3d(Poly3DCollection(faces, facecolor=GREY, edgecolor=GREY, alpha=0.12, linewidth=0.3))
    if points is not None:
        shown = points[:: max(1, len(points) // 4000)]  # more dots hide the hull
        ax.plot(
            *shown.T,
            ".",
            color=BLUE,
            markersize=1.5,
            alpha=0.35,
            label=f"{len(shown):,} of the samples",
        )
    for speed, colour, line in zip(speeds, pick_colours(speeds), cycle(("-", "--", ":", "-.")), strict=False):
        corners = zone.shape.slice(speed).polygon
        closed = np.vstack([corners, corners[:1]])
        level = np.full(len(closed), speed)
        ax.plot(
            *closed.T,
            level,
            color=colour,
            linestyle=line,
            linewidth=2.5,
            label=f"{speed:g} m/s",
        )
        right = closed[closed[:, 0].argmax()]
        ax.text(
            right[0] + 0.15,
            right[1],
            speed,
            f"{speed:g}",
            color=colour,
            fontsize=9,
            weight="bold",
        )
    ax.auto_scale_xyz(*zone.shape.vertices.T)
    ax.set(xlabel="x' [m]", ylabel="y' [m]", zlabel="speed [m/s]")
    ax.set_title("The hull of the inliers, and its slices by speed")
    ax.legend(loc="upper left", fontsize=8)
    ax.view_init(elev=18, azim=-60)
    return ax
