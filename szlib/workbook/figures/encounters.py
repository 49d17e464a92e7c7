"""Figures of encounters: the attentional space, paths, and where the other person was."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import LogNorm
from matplotlib.patches import Circle, Polygon

from ...encounters.geometry import Area, AttentionalSpace
from .style import BLACK, BLUE, GREY, ORANGE, RED, SEQUENCE, area_patch, get_axes, label_metres

_BINS = 40
"""Cells across r_max, or twice r_max: 5 or 10 cm in the paper's 2 m."""


def plot_attentional_space(
    space: AttentionalSpace, area: Area, at: Sequence[float] = (), *, ax: Axes | None = None
) -> Axes:
    """The attentional space of a person at (x, y, heading), by default towards the middle of the area."""
    ax = get_axes(ax, size=(4.5, 5.5))
    (x0, x1), (y0, y1) = area.box.x, area.box.y
    x, y, heading = at or (0.75 * x0 + 0.25 * x1, 0.75 * y0 + 0.25 * y1, np.pi / 4)
    cos, sin = np.cos(heading), np.sin(heading)
    corners = space.corners @ np.array([[cos, sin], [-sin, cos]]) + (x, y)
    ax.add_patch(area_patch(area, edgecolor=BLACK, label="the area"))
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
    ax.set(xlim=(x0 - 1, x1 + 1), ylim=(y0 - 1, y1 + 1))
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.12), fontsize=8)
    return label_metres(ax, "The space stays inside the area")


def plot_encounter_paths(paths: pd.DataFrame, *, count: int = 200, ax: Axes | None = None) -> Axes:
    """Paths of the other person in the reference pedestrian's frame at the opening (paper, fig. 2).

    `paths` as from `szlib.encounters.samples.reference_frame`; `count` encounters, evenly spread, are drawn,
    from a dot at the opening to an arrow's head, in the direction of the last half second, at the end.
    """
    ax = get_axes(ax, size=(7, 5.5))
    every = [g for _, g in paths.groupby("encounter", sort=True)]
    shown = [every[i] for i in np.unique(np.linspace(0, len(every) - 1, count).round().astype(int))]
    for who, colour, name in (("other", BLUE, "other person"), ("ref", ORANGE, "reference pedestrian")):
        lines = [g[[f"{who}_x", f"{who}_y"]].to_numpy() for g in shown]
        ax.add_collection(LineCollection(lines, colors=colour, linewidths=0.6, alpha=0.5, label=name))
        ends, before = (np.array([line[at] for line in lines]) for at in (-1, max(-6, -len(lines[0]))))
        for (x, y), heading in zip(ends, np.degrees(np.arctan2(*(ends - before).T[::-1])), strict=True):
            ax.plot(x, y, marker=(3, 0, heading - 90), color=colour, markersize=4, markeredgewidth=0)
    starts = np.array([[g["other_x"].iloc[0], g["other_y"].iloc[0]] for g in shown])
    ax.plot(*starts.T, ".", color=BLACK, markersize=3, label="other person at the opening")
    ax.autoscale_view()
    ax.plot([], [], marker=(3, 0, -90), color=GREY, linestyle="", label="where they go")
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.12), ncols=2, fontsize=8)
    return label_metres(ax, f"{len(shown)} encounters, in the frame of their opening", person=True)


def plot_relative_positions(samples: pd.DataFrame, *, r_max: float = 2.0, ax: Axes | None = None) -> Axes:
    """How often the other person was where, around the reference pedestrian (paper, fig. 3a).

    The dotted circle: nearer than that came one encounter in twenty.
    """
    ax = get_axes(ax, size=(6.2, 4.8))
    close = samples[samples["distance"] <= r_max]
    x, y = (close["distance"] * part(close["los_angle"]) for part in (np.cos, np.sin))
    edges = np.linspace(-r_max, r_max, _BINS + 1)
    _density(ax, x, y, (edges, edges))
    radius = float(close.groupby("encounter")["distance"].min().quantile(0.05))
    ax.add_patch(Circle((0, 0), radius, fill=False, linestyle=":", linewidth=2, color=RED))
    ax.plot(0, 0, marker=(3, 0, -90), color=RED, markersize=12)
    return label_metres(ax, f"One encounter in twenty comes nearer than {radius:.2f} m", person=True)


def plot_distance_by_direction(samples: pd.DataFrame, *, r_max: float = 2.0, ax: Axes | None = None) -> Axes:
    """How often the other person was how far away, by line-of-sight angle (paper, fig. 3b).

    The line: the nearest in each 15 deg, of at least five encounters, but for one in twenty.
    """
    ax = get_axes(ax, size=(7, 4))
    close = samples[samples["distance"] <= r_max]
    angle = np.degrees(close["los_angle"])
    _density(ax, angle, close["distance"], (np.linspace(-180, 180, 73), np.linspace(0, r_max, _BINS + 1)))
    sector = (np.floor(angle / 15) * 15 + 7.5).rename("sector")
    nearest = close.groupby([sector, "encounter"])["distance"].min().groupby("sector")
    edge = nearest.quantile(0.05).where(nearest.size() >= 5).reindex(np.arange(-172.5, 180, 15))
    ax.plot(edge.index, edge, "o-", color=RED, markersize=4, label="nearer: one encounter in twenty")
    ax.set(xlabel="line-of-sight angle [deg] (left is positive)", ylabel="distance [m]", ylim=(0, r_max))
    ax.set(xlim=(-180, 180), xticks=range(-180, 181, 45))
    ax.set_title("How close people come, by where they are seen")
    ax.legend(loc="lower right", fontsize=8)
    return ax


def _density(ax: Axes, x: pd.Series, y: pd.Series, edges: tuple[np.ndarray, np.ndarray]) -> None:
    """How many samples are in each cell, on a log scale: the darker, the more; empty cells stay white."""
    counts = np.histogram2d(x, y, bins=edges)[0].T
    shown = np.ma.masked_equal(counts, 0)
    top = max(float(counts.max(initial=0)), 2.0)
    image = ax.pcolormesh(*edges, shown, cmap=f"{SEQUENCE}_r", norm=LogNorm(1, top), rasterized=True)
    cell = " x ".join(f"{edge[1] - edge[0]:.2g}" for edge in edges)
    ax.figure.colorbar(image, ax=ax, shrink=0.9, label=f"samples in a cell of {cell} (log scale)")
