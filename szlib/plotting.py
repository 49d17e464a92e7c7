"""Every figure of the data half: tracks, encounters, outliers, hulls, zones.

Each `plot_*` draws into `ax` (or a new figure) and returns the Axes.  Colours are Okabe and Ito's,
told apart by everybody and in grey; sequences are viridis.  Lengths are in metres with equal aspect.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import cycle
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.patches import Circle, Polygon, Rectangle
from mpl_toolkits.mplot3d import Axes3D
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from scipy.spatial import ConvexHull

from .ellipses import Ellipse
from .encounters import AttentionalSpace, Square
from .zones import SocialZone

BLUE, ORANGE, GREEN, RED, GREY, BLACK = "#0072B2", "#E69F00", "#009E73", "#D55E00", "#999999", "#000000"
SEQUENCE = "viridis"


def axes(ax: Axes | None, *, size: tuple[float, float] = (6.0, 4.5)) -> Axes:
    """The axes given, or those of a new figure of that size [inch]."""
    return plt.subplots(figsize=size, layout="constrained")[1] if ax is None else ax


def metres(ax: Axes, title: str, *, person: bool = False) -> Axes:
    """Label both axes in metres with equal aspect; of the world, or of a person who walks to the right."""
    ax.set(xlabel="x, ahead [m]" if person else "x [m]", ylabel="y, to the left [m]" if person else "y [m]")
    ax.set_title(title)
    ax.set_aspect("equal")
    return ax


def plot_map(tracks: pd.DataFrame, square: Square, *, cell: float = 0.25, ax: Axes | None = None) -> Axes:
    """Where people were: person-seconds per square metre on a log scale, and the square (paper, fig. 1)."""
    ax = axes(ax, size=(9, 5))
    x, y = tracks["x"].to_numpy(), tracks["y"].to_numpy()
    edges = [np.arange(np.floor(v.min()), np.ceil(v.max()) + cell, cell) for v in (x, y)]
    seconds = np.histogram2d(x, y, bins=edges)[0] / 10 / cell**2
    shown = np.ma.masked_less_equal(np.log10(np.maximum(seconds, 1e-9)), -0.5)
    image = ax.pcolormesh(edges[0], edges[1], shown.T, cmap=SEQUENCE, rasterized=True)
    ax.figure.colorbar(image, ax=ax, shrink=0.8, label="log10 of person-seconds per m$^2$")
    corner, size = (square.x[0], square.y[0]), (square.x[1] - square.x[0], square.y[1] - square.y[0])
    ax.add_patch(Rectangle(corner, *size, fill=False, edgecolor=RED, linewidth=2, label="the square"))
    ax.legend(loc="lower right")
    ax.margins(0.02)
    return metres(ax, "Where people were seen, and the open square")


def plot_speeds(by_column: np.ndarray, by_displacement: np.ndarray, *, ax: Axes | None = None) -> Axes:
    """Speed as recorded against speed from displacement [m/s], both shape (n,)."""
    ax = axes(ax)
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


def plot_space(
    space: AttentionalSpace, square: Square, at: Sequence[float], *, ax: Axes | None = None
) -> Axes:
    """The attentional space of a person at (x, y, heading) inside the square."""
    ax = axes(ax, size=(4.5, 5.5))
    x, y, heading = at
    cos, sin = np.cos(heading), np.sin(heading)
    corners = space.corners @ np.array([[cos, sin], [-sin, cos]]) + (x, y)
    size = (square.x[1] - square.x[0], square.y[1] - square.y[0])
    ax.add_patch(Rectangle((square.x[0], square.y[0]), *size, fill=False, edgecolor=BLACK, label="square"))
    ax.add_patch(
        Polygon(
            corners,
            facecolor=BLUE,
            alpha=0.3,
            label=f"attentional space {space.width:g} m x {space.length:g} m",
        )
    )
    ax.annotate("", (x + cos, y + sin), (x, y), arrowprops={"arrowstyle": "->", "color": RED, "lw": 2})
    ax.plot(x, y, "o", color=RED, label="reference pedestrian")
    ax.set(xlim=(square.x[0] - 1, square.x[1] + 1), ylim=(square.y[0] - 1, square.y[1] + 1))
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.12), fontsize=8)
    return metres(ax, "The space stays inside the square")


def plot_paths(paths: pd.DataFrame, *, count: int = 200, ax: Axes | None = None) -> Axes:
    """Paths of the other person in the reference pedestrian's frame at the opening (paper, fig. 2).

    `paths` as from `szlib.encounters.reference_frame`; `count` encounters, evenly spread, are drawn.
    """
    ax = axes(ax, size=(7, 5))
    every = [g for _, g in paths.groupby("encounter", sort=True)]
    shown = [every[i] for i in np.unique(np.linspace(0, len(every) - 1, count).round().astype(int))]
    for who, colour, name in (("other", BLUE, "other person"), ("ref", ORANGE, "reference pedestrian")):
        lines = [g[[f"{who}_x", f"{who}_y"]].to_numpy() for g in shown]
        ax.add_collection(LineCollection(lines, colors=colour, linewidths=0.7, alpha=0.6, label=name))
    starts = np.array([[g["other_x"].iloc[0], g["other_y"].iloc[0]] for g in shown])
    ax.plot(*starts.T, ".", color=BLUE, markersize=3, label="at the opening")
    ax.autoscale_view()
    ax.legend(loc="upper right", fontsize=8)
    return metres(ax, f"{len(shown)} encounters, in the frame of their opening", person=True)


def plot_los(samples: pd.DataFrame, *, r_max: float = 2.0, ax: Axes | None = None) -> Axes:
    """Where the other person was, around the reference pedestrian (paper, fig. 3a)."""
    ax = axes(ax, size=(5.5, 4.5))
    close = samples[samples["distance"] <= r_max]
    x, y = close["distance"] * np.cos(close["los_angle"]), close["distance"] * np.sin(close["los_angle"])
    dots = ax.scatter(x, y, c=close["speed"], s=3, cmap=SEQUENCE, rasterized=True)
    ax.figure.colorbar(dots, ax=ax, label="speed of the reference pedestrian [m/s]")
    ax.plot(0, 0, marker=(3, 0, -90), color=RED, markersize=12)
    return metres(ax, "Around a walking person there is a place for nobody", person=True)


def plot_los_distance(samples: pd.DataFrame, *, r_max: float = 2.0, ax: Axes | None = None) -> Axes:
    """Distance against line-of-sight angle (paper, fig. 3b)."""
    ax = axes(ax, size=(7, 4))
    close = samples[samples["distance"] <= r_max]
    dots = ax.scatter(
        np.degrees(close["los_angle"]),
        close["distance"],
        c=close["speed"],
        s=3,
        cmap=SEQUENCE,
        rasterized=True,
    )
    ax.figure.colorbar(dots, ax=ax, label="speed [m/s]")
    ax.set(xlabel="line-of-sight angle [deg] (left is positive)", ylabel="distance [m]", ylim=(0, r_max))
    ax.set(
        xlim=(-180, 180), xticks=range(-180, 181, 45), title="How close people come depends on where they are"
    )
    return ax


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
    """The zone's boundary at one speed, and the smallest ellipse around it with its support points."""
    ax = axes(ax, size=(5, 4.5))
    ellipse = zone.ellipse(speed)
    ax.fill(*zone.boundary(speed).T, facecolor=GREY, alpha=0.4, label="zone: r_max - R'")
    ax.plot(*ellipse.curve().T, color=BLUE, linewidth=2, label="smallest enclosing ellipse")
    if ellipse.support is not None:
        ax.plot(*ellipse.support.T, "o", color=BLUE, label=f"its {len(ellipse.support)} support points")
    if truth is not None:
        ax.plot(*truth.curve().T, "--", color=RED, linewidth=2, label="truth")
    ax.plot(0, 0, marker=(3, 0, -90), color=BLACK, markersize=10)
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.15), fontsize=8, ncols=2)
    return metres(ax, f"Minimum social zone at {speed:g} m/s", person=True)


def plot_zones(ellipses: Mapping[float, Ellipse], *, ax: Axes | None = None) -> Axes:
    """Ellipses by speed around a person who walks to the right (paper, fig. 5)."""
    ax = axes(ax, size=(6, 5))
    shown = sorted(ellipses.items())
    for (speed, ellipse), colour, line in zip(
        shown, colours(shown), cycle(("-", "--", ":", "-.")), strict=False
    ):
        ax.plot(*ellipse.curve().T, color=colour, linestyle=line, linewidth=2, label=f"{speed:g} m/s")
    ax.plot(0, 0, marker=(3, 0, -90), color=BLACK, markersize=10)
    ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=8)
    return metres(ax, "Minimum social zones by speed", person=True)


def plot_funnel(funnel: pd.DataFrame, *, ax: Axes | None = None) -> Axes:
    """What each stage kept, on a log scale; `funnel` as from `szlib.funnels.table`."""
    kept = funnel[funnel["what"] == "kept"]
    ax = axes(ax, size=(8, 0.4 * len(kept) + 1))
    ax.barh(kept["stage"], kept["rows"], color=BLUE)
    for at, rows in enumerate(kept["rows"]):
        ax.annotate(f" {rows:,}", (rows, at), va="center", fontsize=8)
    ax.invert_yaxis()
    ax.set(xscale="log", xlabel="rows kept", title="From rows of tracks to a hull")
    ax.set_xlim(right=float(kept["rows"].max()) * 8)
    return ax


def colours(values: Sequence[Any]) -> list[Any]:
    """One colour of the sequence for each value, dark to light, leaving out the palest."""
    return list(plt.get_cmap(SEQUENCE)(np.linspace(0, 0.85, len(values))))
