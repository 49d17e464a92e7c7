"""Figures of zones: outliers, the hull and its slices, the reach by direction (notebooks 03 to 05)."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import cycle
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from mpl_toolkits.mplot3d import Axes3D
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from scipy.spatial import ConvexHull

from szlib.core.errors import ZoneError
from szlib.workbook.figures.style import (
    BLACK,
    BLUE,
    GREY,
    ORANGE,
    RED,
    label_metres,
    pick_colours,
)
from szlib.zones.ellipses import Ellipse
from szlib.zones.hulls import HullZone
from szlib.zones.social_zone import SocialZone

# Lines of slices and of zones, by speed.
LINES = ("-", "--", ":", "-.")


def draw_outliers(plain: np.ndarray, points: np.ndarray, outlier: np.ndarray) -> Figure:
    """Draw samples and outliers around a person, beside the same in complementary coordinates (paper, fig. 4a).

    Parameters
    ----------
    plain : positions in the person's frame, shape (n, 2) [m].
    points : complementary coordinates (x', y'), shape (n, 2) [m].
    outlier : True for each outlier, shape (n,).

    Examples
    --------
    >>> import numpy as np
    >>> import plots
    >>> points = np.random.default_rng(0).normal(0, 0.5, (50, 2))
    >>> figure = plots.draw_outliers(points, points, np.arange(50) < 2)
    >>> figure.axes[1].get_title()
    'Turned inside out: the 2 most alone (x)'
    """
    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 3.5), layout="constrained")
    for ax, each in ((left, plain), (right, points)):
        ax.plot(*each[~outlier].T, ".", color=GREY, markersize=1.5, rasterized=True)
        ax.plot(*each[outlier].T, "x", color=RED, markersize=6, mew=1.4)
    label_metres(left, f"{len(plain):,} samples around a person", person=True)
    label_metres(right, f"Turned inside out: the {outlier.sum()} most alone (x)")
    right.set(xlabel="x' = (r_max - r) cos LOS [m]", ylabel="y' = (r_max - r) sin LOS [m]")
    return figure


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
    for speed, colour, line in zip(speeds, pick_colours(speeds), cycle(LINES), strict=False):
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


def draw_hull_and_zones(zone: SocialZone, points: np.ndarray) -> Figure:
    """Draw the hull with its slices, beside the zones that they leave free.

    Parameters
    ----------
    zone : a zone of method "hull" or "paper"; its slices are at the speeds of its ellipses.
    points : samples (x', y', speed), shape (n, 3) [m, m/s].
    """
    speeds = list(zone.ellipses)
    room = ConstrainedLayoutEngine(wspace=0.08)  # for the label of the speed
    figure = plt.figure(figsize=(11, 4.1), layout=room)
    left: Any = figure.add_subplot(1, 2, 1, projection="3d")
    right = figure.add_subplot(1, 2, 2)
    plot_hull(zone, speeds, points=points, ax=left)
    is_four = len(speeds) == 4
    left.set_title("One hull around all samples, cut at four speeds" if is_four else "Hull and slices")
    left.legend().remove()
    left.set_yticks((-1, 0, 1))
    left.set_box_aspect(None, zoom=1.25)
    for speed, colour, line in zip(speeds, pick_colours(speeds), cycle(LINES), strict=False):
        boundary = zone.boundary(speed)
        right.plot(*boundary.T, line, color=colour, linewidth=2, label=f"{speed:g} m/s")
    right.plot(0, 0, marker=(3, 0, -90), color=BLACK, markersize=10)
    right.legend(loc="center left", bbox_to_anchor=(1, 0.5))
    label_metres(right, "What each cut leaves free: the zone at that speed", person=True)
    return figure


def draw_zone_and_reach(zone: Ellipse, truth: Ellipse | None, bands: pd.DataFrame, speed: float) -> Figure:
    """Draw the quantile zone at a speed, beside its reach in each direction with the 95 % interval.

    Parameters
    ----------
    zone : the quantile zone.
    truth : the zone that people keep, if it is known.
    bands : direction [rad] and both ends of the interval, low and high [m], as of `SocialZone.uncertainty`.
    speed : walking speed [m/s].

    Examples
    --------
    >>> import numpy as np, pandas as pd, szlib
    >>> import plots
    >>> zone = szlib.Ellipse((0.1, 0.0), (1.0, 0.7))
    >>> bands = pd.DataFrame({"direction": np.linspace(-3, 3, 9), "low": 0.6, "high": 0.9})
    >>> figure = plots.draw_zone_and_reach(zone, None, bands, 1.1)
    >>> figure.axes[1].get_title()
    'The same, unrolled: the interval is 30 to 30 cm wide'
    """
    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 3.7), layout="constrained", width_ratios=(1, 1.5))
    degrees = np.degrees(bands["direction"].to_numpy())
    left.plot(*zone.curve().T, color=BLUE, linewidth=2, label="quantile zone")
    right.plot(degrees, _measure_reach(zone, degrees), color=BLUE, linewidth=2, label="quantile zone")
    if truth is not None:
        reach = _measure_reach(truth, degrees)
        name = "zone that people keep (truth)"
        left.plot(*truth.curve().T, ":", color=RED, linewidth=2)
        right.plot(degrees, reach, ":", color=RED, linewidth=2, label=name)
    name = "95 % interval of the quantile zone"
    right.fill_between(degrees, bands["low"], bands["high"], color=ORANGE, alpha=0.5, label=name)
    left.plot(0, 0, marker=(3, 0, -90), color=BLACK, markersize=10)
    label_metres(left, f"Where 5 % come nearer, at {speed:g} m/s", person=True)
    right.set(xlabel="direction [deg] (0 is ahead, 90 left)", ylabel="reach of the zone [m]")
    right.set_xticks(range(-180, 181, 90))
    widths = 100 * (bands["high"] - bands["low"])
    right.set_title(f"The same, unrolled: the interval is {widths.min():.0f} to {widths.max():.0f} cm wide")
    right.legend(loc="center left", bbox_to_anchor=(1, 0.5))
    return figure


def _measure_reach(zone: Ellipse, degrees: np.ndarray) -> np.ndarray:
    """Distance from the person to the outline of a `zone` in each direction [m]."""
    x, y = zone.curve(2000).T
    return np.asarray(np.interp(degrees, np.degrees(np.arctan2(y, x)), np.hypot(x, y), period=360))
