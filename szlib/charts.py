"""Figures of the audits: errors of a distance, heat maps of a sweep, intervals of a comparison.

Like `plotting`: every `plot_*` draws into `ax` (or a new figure) and returns the Axes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from numpy.typing import ArrayLike

from .barriers import check_wall
from .distances import overestimate, required_margin, safe_edge
from .ellipses import Ellipse
from .plotting import BLACK, BLUE, GREEN, GREY, ORANGE, RED, axes, metres


def plot_overestimate(
    of: Ellipse | ArrayLike, *, r_robot: float, eps: float, extent: float = 2.0, ax: Axes | None = None
) -> Axes:
    """Approximate less Euclidean distance around a zone or a wall [cm], and h = 0 with two margins."""
    ax = axes(ax, size=(5.5, 4.5))
    ticks = np.linspace(-extent, extent, 321)
    x, y = np.meshgrid(ticks, ticks)
    grid = np.stack([x, y], axis=-1)
    inside = of.level(grid) < 1 if isinstance(of, Ellipse) else np.zeros(x.shape, bool)
    error = np.ma.masked_where(inside, 100 * overestimate(grid, of))
    image = ax.pcolormesh(x, y, error, cmap="RdBu_r", vmin=-25, vmax=25, rasterized=True)
    ax.figure.colorbar(image, ax=ax, shrink=0.85, label="d - Euclidean [cm], red is dangerous")
    outline = of.curve() if isinstance(of, Ellipse) else check_wall(of)
    ax.plot(*outline.T, color=BLACK, linewidth=3)
    needed = max(eps, required_margin(of, r_robot))
    for margin, line in ((eps, "-"), (needed, "--")):
        edge = safe_edge(of, r_robot + margin)
        label = f"h = 0, eps = {100 * margin:.0f} cm"
        ax.plot(*np.vstack([edge, edge[:1]]).T, line, color=GREEN, linewidth=1.8, label=label)
        if needed == eps:
            break
    ax.set(xlim=(-extent, extent), ylim=(-extent, extent))
    ax.legend(loc="upper right", fontsize=8)
    return metres(ax, "Where the distance is wrong")


def plot_sweep(table: pd.DataFrame, *, title: str, worst: float, ax: Axes | None = None) -> Axes:
    """A table as a heat map with its numbers: index down, columns across, pale at 0 and dark at `worst`."""
    ax = axes(ax, size=(5, 3.5))
    values = table.to_numpy(float)
    ax.imshow(np.clip(values / worst, 0, 1), cmap="Oranges", vmin=0, vmax=1.3, aspect="auto")
    for (row, column), value in np.ndenumerate(values):
        ax.text(column, row, f"{round(value, 3) + 0.0:.3g}", ha="center", va="center", fontsize=9)
    ax.set_xticks(range(table.shape[1]), [f"{name:g}" for name in table.columns])
    ax.set_yticks(range(table.shape[0]), [f"{name:g}" for name in table.index])
    ax.set(xlabel=str(table.columns.name), ylabel=str(table.index.name), title=title)
    return ax


def plot_intervals(
    table: pd.DataFrame, metric: str, *, rows: str, colour: str, label: str, ax: Axes | None = None
) -> Axes:
    """Means with intervals of one metric, as from `comparisons.summarise`: `rows` down, `colour` aside."""
    ax = axes(ax, size=(5.5, 3.5))
    shown = table[table["metric"] == metric]
    names, groups = list(dict.fromkeys(shown[rows])), list(dict.fromkeys(shown[colour]))
    styles = zip(groups, (BLUE, ORANGE, GREEN, RED, BLACK), ("o", "s", "^", "D", "v"), strict=False)
    for i, (group, shade, marker) in enumerate(styles):
        of = shown[shown[colour] == group].set_index(rows).reindex(names)
        at = np.arange(len(names)) + 0.16 * (i - (len(groups) - 1) / 2)
        ax.hlines(at, of["low"], of["high"], color=shade, linewidth=1.5)
        ax.plot(of["mean"], at, marker, color=shade, markersize=5, label=group)
    ax.set_yticks(range(len(names)), names)
    ax.set(xlabel=label, ylim=(len(names) - 0.5, -0.5))
    ax.grid(axis="x", color=GREY, alpha=0.3)
    return ax


def plot_grid(
    table: pd.DataFrame, metrics: Mapping[str, str], *, rows: str, colour: str, into: Sequence[Axes]
) -> None:
    """Several metrics side by side, each into its Axes, with one legend below; column -> label."""
    for ax, (metric, label) in zip(into, metrics.items(), strict=False):
        plot_intervals(table, metric, rows=rows, colour=colour, label=label, ax=ax)
    handles, names = into[0].get_legend_handles_labels()
    into[0].figure.legend(handles, names, loc="outside lower center", ncols=len(names))
