"""Figures of zones: outliers, the hull and its slices, ellipses by speed."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from itertools import cycle
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.patches import Circle
from mpl_toolkits.mplot3d import Axes3D
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from scipy.spatial import ConvexHull

from ...errors import DataWarning, ZoneError
from ...zones.ellipses import Ellipse
from ...zones.social_zone import SocialZone
from .style import BLACK, BLUE, GREY, ORANGE, RED, axes, colours, metres


def plot_outliers(
    points: np.ndarray, outlier: np.ndarray, *, r_max: float = 2.0, ax: Axes | None = None
) -> Axes:
    """In- and outliers in the complementary plane; points (n, 2), outlier (n,) (paper, fig. 4a)."""
    ax = axes(ax, size=(6, 5))
    ax.plot(
        *points[~outlier].T,
        ".",
        color=GREY,
        markersize=2,
        rasterized=True,
        label=f"{(~outlier).sum():,} inliers",
    )
    ax.plot(*points[outlier].T, "x", color=RED, markersize=7, mew=1.8, label=f"{outlier.sum():,} outliers")
    ax.add_patch(Circle((0, 0), r_max, fill=False, linestyle=":", color=BLACK, label="contact, r = 0"))
    ax.set(xlim=(-1.05 * r_max, 1.05 * r_max), ylim=(-1.05 * r_max, 1.05 * r_max))
    ax.legend(loc="upper right")
    metres(ax, "Turned inside out: the nearer, the farther out")
    ax.set(xlabel="x' = (r_max - r) cos LOS [m]", ylabel="y' = (r_max - r) sin LOS [m]")
    return ax


def plot_hull(zone: SocialZone, speeds: Sequence[float] = (0.7, 0.9, 1.1, 1.3), *, ax: Any = None) -> Axes3D:
    """The hull over (x', y', speed) with its slices (paper, fig. 4b)."""
    if zone.vertices is None:
        raise ZoneError(f'a zone of method {zone.method!r} has no hull to draw; fit it with method="hull"')
    if ax is None:
        ax = plt.figure(figsize=(7, 6), layout="constrained").add_subplot(projection="3d")
    hull = ConvexHull(zone.vertices)
    faces = Poly3DCollection(
        zone.vertices[hull.simplices], facecolor=GREY, edgecolor=GREY, alpha=0.12, linewidth=0.3
    )
    ax.add_collection3d(faces)
    for speed, colour in zip(speeds, colours(speeds), strict=True):
        corners = zone.slice(speed).polygon
        closed = np.vstack([corners, corners[:1]])
        ax.plot(*closed.T, np.full(len(closed), speed), color=colour, linewidth=2.5, label=f"{speed:g} m/s")
    ax.auto_scale_xyz(*zone.vertices.T)
    ax.set(
        xlabel="x' [m]",
        ylabel="y' [m]",
        zlabel="speed [m/s]",
        title="The hull of the inliers, and its slices by speed",
    )
    ax.legend(loc="upper left", fontsize=8)
    ax.view_init(elev=18, azim=-60)
    return ax


def plot_zone(
    zone: SocialZone, speed: float, *, truth: Ellipse | None = None, ax: Axes | None = None
) -> Axes:
    """The zone's boundary at one speed, its ellipse (dashed: not adequate), and the ellipse's interval."""
    ax = axes(ax, size=(5, 4.5))
    ellipse, hull = _ellipse(zone, speed), zone.method == "hull"
    boundary = zone.boundary(speed)
    if hull:
        ax.fill(*boundary.T, facecolor=GREY, alpha=0.4, label="zone: r_max - R'")
    else:
        ax.plot(*boundary.T, color=GREY, linewidth=1.5, label=f"radius by direction ({zone.method})")
    name = "smallest enclosing ellipse" if hull else "fitted ellipse"
    ax.plot(*ellipse.curve().T, color=BLUE, linewidth=2, linestyle=_line(zone, speed), label=name)
    _band(zone, speed, ax, color=ORANGE, alpha=0.35, label="its 95 % interval")
    if ellipse.support is not None:
        ax.plot(*ellipse.support.T, "o", color=BLUE, label=f"its {len(ellipse.support)} support points")
    if truth is not None:
        ax.plot(*truth.curve().T, ":", color=RED, linewidth=2, label="truth")
    ax.plot(0, 0, marker=(3, 0, -90), color=BLACK, markersize=10)
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.15), fontsize=8, ncols=2)
    lacks = "" if zone.adequate(speed) else "\nnot adequate: too few people seen on some side"
    return metres(ax, f"Minimum social zone at {speed:g} m/s{lacks}", person=True)


def plot_zones(zones: SocialZone | Mapping[float, Ellipse], *, ax: Axes | None = None) -> Axes:
    """Ellipses by speed around a person who walks to the right (paper, fig. 5).

    Of a `SocialZone` also their intervals, and those that are not adequate are dashed.
    """
    ax = axes(ax, size=(6, 5))
    shown = sorted((zones.ellipses if isinstance(zones, SocialZone) else zones).items())
    lines = cycle(("-", "--", ":", "-."))
    for (speed, ellipse), colour, line in zip(shown, colours(shown), lines, strict=False):
        label = f"{speed:g} m/s"
        if isinstance(zones, SocialZone):
            line = _line(zones, speed)
            label += "" if zones.adequate(speed) else " (not adequate)"
            _band(zones, speed, ax, color=colour, alpha=0.15)
        ax.plot(*ellipse.curve().T, color=colour, linestyle=line, linewidth=2, label=label)
    ax.plot(0, 0, marker=(3, 0, -90), color=BLACK, markersize=10)
    ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=8)
    bands = " and their 95 % intervals" if getattr(zones, "uncertainty", None) else ""
    return metres(ax, f"Minimum social zones by speed{bands}", person=True)


def _ellipse(zone: SocialZone, speed: float) -> Ellipse:
    """The zone's ellipse without the warning: the figure itself says what is not adequate."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DataWarning)
        return zone.ellipse(speed)


def _line(zone: SocialZone, speed: float) -> str:
    return "-" if zone.adequate(speed) else "--"


def _band(zone: SocialZone, speed: float, ax: Axes, **style: Any) -> None:
    """Between low and high of the ellipse's reach, where both are known."""
    bands = None if zone.uncertainty is None else zone.uncertainty.bands
    if bands is None or not (bands["speed"] == speed).any():
        return
    band = bands[bands["speed"] == speed]
    band = pd.concat([band, band.head(1)])
    unit = np.column_stack([np.cos(band["direction"]), np.sin(band["direction"])])
    low, high = (band[end].to_numpy()[:, None] * unit for end in ("low", "high"))
    known = np.isfinite(low).all(axis=1) & np.isfinite(high).all(axis=1)
    both = known[:-1] & known[1:]
    quads = np.stack([low[:-1], low[1:], high[1:], high[:-1]], axis=1)[both]
    label = style.pop("label", None)
    ax.add_collection(
        PolyCollection(list(quads), facecolor=style["color"], alpha=style["alpha"], linewidth=0)
    )
    if label:
        ax.fill([], [], facecolor=style["color"], alpha=style["alpha"], label=label)
