"""Figures of encounters: the attentional space, paths, and where the other person was."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.patches import Polygon

from ...encounters.geometry import Area, AttentionalSpace
from .style import BLACK, BLUE, ORANGE, RED, SEQUENCE, axes, metres, outline


def plot_space(
    space: AttentionalSpace, area: Area, at: Sequence[float] = (), *, ax: Axes | None = None
) -> Axes:
    """The attentional space of a person at (x, y, heading), by default towards the middle of the area."""
    ax = axes(ax, size=(4.5, 5.5))
    (x0, x1), (y0, y1) = area.box.x, area.box.y
    x, y, heading = at or (0.75 * x0 + 0.25 * x1, 0.75 * y0 + 0.25 * y1, np.pi / 4)
    cos, sin = np.cos(heading), np.sin(heading)
    corners = space.corners @ np.array([[cos, sin], [-sin, cos]]) + (x, y)
    ax.add_patch(outline(area, edgecolor=BLACK, label="the area"))
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
    return metres(ax, "The space stays inside the area")


def plot_encounter_paths(paths: pd.DataFrame, *, count: int = 200, ax: Axes | None = None) -> Axes:
    """Paths of the other person in the reference pedestrian's frame at the opening (paper, fig. 2).

    `paths` as from `szlib.encounters.search.reference_frame`; `count` encounters, evenly spread, are drawn.
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
