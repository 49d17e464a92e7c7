"""Figures of many runs: sweeps of a setting, manners of runs, intervals side by side."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from .style import BLACK, BLUE, GREEN, GREY, ORANGE, RED, get_axes


def plot_sweep(table: pd.DataFrame, *, worst: float, ax: Axes | None = None) -> Axes:
    """A table as a heat map with its numbers: index down, columns across, pale at 0 and dark at `worst`."""
    ax = get_axes(ax, size=(5, 3.5))
    values = table.to_numpy(float)
    ax.imshow(np.clip(values / worst, 0, 1), cmap="Oranges", vmin=0, vmax=1.3, aspect="auto")
    for (row, column), value in np.ndenumerate(values):
        ax.text(column, row, f"{round(value, 3) + 0.0:.3g}", ha="center", va="center", fontsize=9)
    ax.set_xticks(range(table.shape[1]), [f"{name:g}" for name in table.columns])
    ax.set_yticks(range(table.shape[0]), [f"{name:g}" for name in table.index])
    ax.set(xlabel=str(table.columns.name), ylabel=str(table.index.name))
    return ax


def plot_strategies(
    table: pd.DataFrame, *, names: Sequence[str], rows: str, columns: str, ax: Axes | None = None
) -> Axes:
    """A map of what a robot did, as from `simulation.atlas`: one value of "strategy" a cell, as a letter.

    `names` are all that may occur, from pale to dark; the letter is the place in them: A, B, C, ...
    """
    ax = get_axes(ax, size=(4, 3.2))
    found = table.pivot(index=rows, columns=columns, values="strategy").sort_index(ascending=False)
    places = found.map(list(names).index).to_numpy()
    ax.imshow(places, cmap="YlOrBr", vmin=0, vmax=1.3 * len(names), aspect="auto")
    for (row, column), place in np.ndenumerate(places):
        ax.text(column, row, chr(ord("A") + place), ha="center", va="center", fontsize=9)
    ax.set_xticks(range(found.shape[1]), [f"{value:g}" for value in found.columns])
    ax.set_yticks(range(found.shape[0]), [f"{value:g}" for value in found.index])
    ax.set(xlabel=columns, ylabel=rows)
    return ax


def plot_intervals(
    table: pd.DataFrame, metric: str, *, rows: str, colour: str, label: str, ax: Axes | None = None
) -> Axes:
    """Means with intervals of one metric, as from `comparisons.summarise`: `rows` down, `colour` aside."""
    ax = get_axes(ax, size=(5.5, 3.5))
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


def draw_interval_grid(
    table: pd.DataFrame,
    labels: Mapping[str, str],
    *,
    rows: str,
    colour: str,
    columns: int = 3,
    title: str = "",
) -> Figure:
    """A panel of `plot_intervals` for each metric of `labels`, metric -> axis label, with one legend."""
    down = -(-len(labels) // columns)
    names = table[rows].nunique()
    size = (4.4 * columns, down * (0.36 * names + 1.3) + 0.6)
    figure, grid = plt.subplots(down, columns, figsize=size, layout="constrained", sharey=True, squeeze=False)
    for ax, (metric, label) in zip(grid.flat, labels.items(), strict=False):
        plot_intervals(table, metric, rows=rows, colour=colour, label=label, ax=ax)
    for ax in grid.flat[len(labels) :]:
        ax.axis("off")
    add_shared_legend(list(grid.flat))
    figure.suptitle(title)
    return figure


def add_shared_legend(panels: Sequence[Axes]) -> None:
    """One legend below several panels that show the same things: that of the first."""
    handles, names = panels[0].get_legend_handles_labels()
    panels[0].figure.legend(handles, names, loc="outside lower center", ncols=len(names))
