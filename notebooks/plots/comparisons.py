"""Figures of many runs, fits or sites: sweeps, strategies, intervals, claims, safety claims, forest plots."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator
from studies.pooling import POSITIVE, UNITS, Pooled

from szlib.workbook.figures.style import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    RED,
    add_legend_below,
    add_shared_legend,
    get_axes,
)

# Colour and hatching of each kind of safety violation.
_BARS = {
    "appeared": (BLACK, ""),
    "turned": (RED, "///"),
    "slowed down": (GREEN, "..."),
    "sped up": (ORANGE, "xxx"),
    "faced elsewhere": (BLUE, "|||"),
}


# Fill of each strategy in a map: colour and hatching, so that they differ in grey as well.
_FILLS = (
    ("#F0F0F0", ""),
    ("#A9D5F0", ""),
    (BLUE, ""),
    (BLACK, ""),
    (ORANGE, "//"),
    (RED, "xxx"),
)


_VERDICTS = {"supported": (GREEN, "o"), "not supported": (RED, "X"), "not decidable": (GREY, "s")}


def plot_sweep(table: pd.DataFrame, *, worst: float, ax: Axes | None = None) -> Axes:
    """Plot a table as a heat map with its numbers.

    Parameters
    ----------
    table : numbers by two parameters, its index and its columns.
    worst : value with the darkest colour; 0 has the palest.
    ax : axes to draw on; None makes new ones.

    Examples
    --------
    >>> import pandas as pd
    >>> import plots
    >>> index, columns = pd.Index([0.05, 0.1], name="gamma"), pd.Index([1, 2], name="speed [m/s]")
    >>> ax = plots.plot_sweep(pd.DataFrame([[0, 0.1], [0.2, 0.4]], index, columns), worst=0.4)
    """
    values = table.to_numpy(float)
    ax = get_axes(ax, size=(5, 3.5))
    ax.imshow(np.clip(values / worst, 0, 1), cmap="Oranges", vmin=0, vmax=1.3, aspect="auto")
    for (row, column), value in np.ndenumerate(values):
        ax.text(
            column,
            row,
            f"{round(value, 3) + 0.0:.3g}",
            ha="center",
            va="center",
            fontsize=9,
        )
    return _label_cells(ax, table)


def plot_strategies(
    table: pd.DataFrame,
    *,
    names: Sequence[str],
    rows: str,
    columns: str,
    ax: Axes | None = None,
) -> Axes:
    """Plot which strategy a robot used for each pair of parameters, as the fill of a cell.

    Parameters
    ----------
    table : one row for each pair, with the column "strategy".
    names : all strategies, at most six; each has a fill and a name in the legend.
    rows : parameter of the rows.
    columns : parameter of the columns.
    ax : axes to draw on; None makes new ones.

    Examples
    --------
    >>> import pandas as pd
    >>> import plots
    >>> table = pd.DataFrame({"gamma": [0.1, 0.2], "width": [1.0, 1.0], "strategy": ["passes", "waits"]})
    >>> ax = plots.plot_strategies(table, names=["passes", "waits"], rows="gamma", columns="width")
    """
    found = table.pivot(index=rows, columns=columns, values="strategy").sort_index()
    ax = get_axes(ax, size=(5, 3.5))
    for name, (colour, hatch) in zip(names, _FILLS, strict=False):
        style: Any = {"facecolor": colour, "hatch": hatch, "edgecolor": "white"}
        row, column = np.nonzero((found == name).to_numpy())
        ax.bar(column, 1, bottom=row - 0.5, width=1, **style)
        ax.fill([], [], label=name, **style)  # for the legend
    ax.set(xlim=(-0.5, found.shape[1] - 0.5), ylim=(-0.5, found.shape[0] - 0.5))
    return _label_cells(ax, found)


def _label_cells(ax: Axes, table: pd.DataFrame) -> Axes:
    ax.set_xticks(range(table.shape[1]), [f"{value:g}" for value in table.columns])
    ax.set_yticks(range(table.shape[0]), [f"{value:g}" for value in table.index])
    ax.set(xlabel=str(table.columns.name), ylabel=str(table.index.name))
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
    """Draw the means of each metric with their intervals: a panel for each metric, and one legend.

    Parameters
    ----------
    table : one row for each mean, with metric, mean, low and high.
    labels : metric -> label of the axis, with its unit.
    rows : column of `table` with the names beside the axes.
    colour : column of `table` with the names of the colours.
    columns : number of panels side by side.
    title : title of the figure.

    Examples
    --------
    >>> import pandas as pd
    >>> import plots
    >>> row = {"crowd": "ETH", "robot": "MPC-CBF", "metric": "time", "mean": 9.0, "low": 8.0, "high": 10.0}
    >>> table = pd.DataFrame([row])
    >>> figure = plots.draw_interval_grid(table, {"time": "time [s]"}, rows="crowd", colour="robot")
    """
    n_rows = -(-len(labels) // columns)
    size = (4.4 * columns, n_rows * (0.36 * table[rows].nunique() + 1.3) + 0.6)
    figure, grid = plt.subplots(
        n_rows, columns, figsize=size, layout="constrained", sharey=True, squeeze=False
    )
    for ax, (metric, label) in zip(grid.flat, labels.items(), strict=False):
        _plot_intervals(ax, table[table["metric"] == metric], rows=rows, colour=colour)
        ax.set_xlabel(label)
    for ax in grid.flat[len(labels) :]:
        ax.axis("off")
    add_shared_legend(list(grid.flat))
    figure.suptitle(title)
    return figure


def _plot_intervals(ax: Axes, table: pd.DataFrame, *, rows: str, colour: str) -> None:
    """Plot the means of one metric with their intervals."""
    names, groups = list(dict.fromkeys(table[rows])), list(dict.fromkeys(table[colour]))
    styles = zip(
        groups,
        (BLUE, ORANGE, GREEN, RED, BLACK),
        ("o", "s", "^", "D", "v"),
        strict=False,
    )
    for i, (group, shade, marker) in enumerate(styles):
        part = table[table[colour] == group].set_index(rows).reindex(names)
        at = np.arange(len(names)) + 0.16 * (i - (len(groups) - 1) / 2)
        ax.hlines(at, part["low"], part["high"], color=shade, linewidth=1.5)
        ax.plot(part["mean"], at, marker, color=shade, markersize=5, label=group)
    ax.set_yticks(range(len(names)), names)
    ax.set_ylim(len(names) - 0.5, -0.5)
    ax.grid(axis="x", color=GREY, alpha=0.3)


def plot_zone_sizes(table: pd.DataFrame, columns: Mapping[str, str], *, ax: Axes | None = None) -> Axes:
    """Plot sizes of zones by the number of encounters, with their intervals.

    Parameters
    ----------
    table : one row for each number of encounters: `encounters`, and for each name its mean, <name>_low and
        <name>_high [m].
    columns : name in `table` -> label in the legend.
    ax : axes to draw on; None makes new ones.

    Examples
    --------
    >>> import pandas as pd
    >>> import plots
    >>> sizes = {"encounters": [10, 100], "a": [1.2, 1.0], "a_low": [1.0, 0.9], "a_high": [1.5, 1.1]}
    >>> ax = plots.plot_zone_sizes(pd.DataFrame(sizes), {"a": "hull"})
    """
    ax = get_axes(ax, size=(6, 4))
    styles = zip(("-o", "--s", ":^", "-.D"), (RED, BLUE, GREY, GREEN), strict=True)
    for (name, label), (style, colour) in zip(columns.items(), styles, strict=False):
        n = table["encounters"]
        ax.fill_between(
            n,
            table[f"{name}_low"],
            table[f"{name}_high"],
            color=colour,
            alpha=0.18,
            linewidth=0,
        )
        ax.plot(n, table[name], style, color=colour, markersize=4, label=label)
    ax.set(xscale="log", xlabel="encounters", ylabel="size of the zone [m]", ylim=(0, None))
    ax.legend(fontsize=8)
    return ax


def plot_sensitivity(table: pd.DataFrame, *, ax: Axes | None = None) -> Axes:
    """Plot how far each parameter moves the zone's area: a tornado chart, the largest range on top.

    Parameters
    ----------
    table : table as from `studies.sensitivity.sensitivity`: parameter, value, area [m2]; the first row
        holds the defaults.
    ax : axes to draw on; None makes new ones.

    Examples
    --------
    >>> import pandas as pd
    >>> import plots
    >>> table = {"parameter": ["default", "r_max", "r_max"], "value": ["", 1.5, 2.5], "area": [2.0, 1.8, 2.1]}
    >>> ax = plots.plot_sensitivity(pd.DataFrame(table))
    """
    ax = get_axes(ax, size=(8, 4.5))
    default = float(table["area"].iloc[0])
    varied = table.iloc[1:].dropna(subset=["area"])
    groups = varied.groupby("parameter", sort=False)["area"]
    low, high = groups.min().clip(upper=default), groups.max().clip(lower=default)
    width = (high - low).sort_values()
    ax.barh(
        range(len(width)),
        width,
        left=low[width.index],
        color=BLUE,
        alpha=0.35,
        height=0.6,
    )
    names = []
    for row, name in enumerate(width.index):
        values = varied[varied["parameter"] == name].sort_values("area")
        ax.plot(values["area"], np.full(len(values), row), "o", color=BLUE, markersize=5)
        # beside the axis: no overlap
        names.append(f"{name}\n{'; '.join(map(str, values['value']))}")
    ax.axvline(default, color=BLACK, linewidth=1.2, label=f"defaults: {default:.2f} m$^2$")
    ax.set_yticks(range(len(width)), names)
    ax.set(
        xlabel="area of the zone [m$^2$]; values from left to right",
        ylim=(-0.6, len(width) - 0.2),
    )
    ax.use_sticky_edges = False
    ax.margins(x=0.1)
    add_legend_below(ax, gap=0.14)
    return ax


def draw_claims(table: pd.DataFrame, *, title: str = "") -> Figure:
    """Draw the effect of each claim with its interval: a panel for each claim, in the unit of the claim.

    Parameters
    ----------
    table : one row for each claim, as from `studies.paper_claims.tabulate_findings`: claim, effect,
        low, high, unit and verdict. An effect above 0 is as the paper says.
    title : title of the figure.

    Examples
    --------
    >>> import pandas as pd
    >>> import plots
    >>> claim = {"claim": "zones grow with speed", "effect": 0.1, "low": 0.05, "high": 0.2, "unit": "m2"}
    >>> figure = plots.draw_claims(pd.DataFrame([claim | {"verdict": "supported"}]))
    """
    figure, grid = plt.subplots(n := len(table), figsize=(8, 1.1 * n), layout="constrained", squeeze=False)
    for ax, row in zip(grid.flat, table.to_dict("records"), strict=True):
        colour, marker = _VERDICTS[row["verdict"].partition(" with")[0]]
        ax.hlines(0, row["low"], row["high"], color=colour, linewidth=3)
        ax.plot(row["effect"], 0, marker, color=colour, markersize=9)
        ax.axvline(0, color=BLACK, linewidth=1)
        reach = 1.15 * max(abs(row["low"]), abs(row["high"])) or 1.0
        ax.set(
            yticks=[],
            xlabel=row["unit"],
            xlim=(-reach, reach) if np.isfinite(reach) else (-1, 1),
        )
        ax.set_title(row["claim"], loc="left", fontsize=10)
        ax.set_title(row["verdict"].partition(" with")[0], loc="right", fontsize=10, color=colour)
    figure.suptitle(title)
    return figure


def plot_forest(pooled: Pooled, *, ax: Axes | None = None) -> Axes:
    """Plot the value of each site with its interval, their mean, and what to expect at a new site.

    Parameters
    ----------
    pooled : result of `studies.pooling.pool`. The mean is a diamond as wide as its interval, and the prediction
        interval of a new site a line below it. With two sites both say nothing, and only the mean is drawn.
    ax : axes to draw on; None makes new ones.

    Examples
    --------
    >>> import plots
    >>> from studies.pooling import pool
    >>> ax = plots.plot_forest(pool({"hall": (0.9, 0.8, 1.0), "mall": (1.2, 1.0, 1.4)}))
    """
    n, sites = pooled.n_sites, pooled.table.set_index("site")[["value", "low", "high"]]
    labels = [f"{name}: {mid:.2f} ({low:.2f} to {high:.2f})" for name, mid, low, high in sites.itertuples()]
    labels.append(f"mean: {pooled.mean:.2f}")
    ax = get_axes(ax, size=(7.5, 0.35 * n + 1.9))
    if pooled.quantity in POSITIVE:
        ax.set_xscale("log")
        ax.xaxis.set(major_locator=LogLocator(subs=(1, 2, 5)), major_formatter="{x:g}")
        ax.minorticks_off()
    ax.hlines(range(n), sites["low"], sites["high"], color=BLACK, linewidth=1.5)
    ax.scatter(
        sites["value"],
        range(n),
        25 + 150 * pooled.table["weight"],
        color=BLACK,
        marker="s",
    )
    ax.axvline(pooled.mean, color=GREY, linestyle="--", linewidth=1)
    ax.margins(x=0.4)
    ax.set_xlim(ax.get_xlim())  # also where the next interval is wider
    if np.isfinite(pooled.new_high):
        ax.fill(
            [pooled.low, pooled.mean, pooled.high, pooled.mean],
            [n, n - 0.3, n, n + 0.3],
            color=BLUE,
        )
        labels[-1] += f" ({pooled.low:.2f} to {pooled.high:.2f})"
        ax.plot(
            [pooled.new_low, pooled.new_high],
            [n + 1, n + 1],
            "-|",
            color=ORANGE,
            linewidth=3,
            ms=12,
        )
        labels.append(f"a new site: {pooled.new_low:.2f} to {pooled.new_high:.2f}")
    ax.set_yticks(range(len(labels)), labels)
    text = f"{pooled.quantity} of the zone [{UNITS[pooled.quantity]}], with 95 % intervals"
    ax.set(xlabel=text, ylim=(len(labels) - 0.4, -0.6))
    return ax


def plot_safety_claims(table: pd.DataFrame, *, ax: Axes | None = None) -> Axes:
    """Plot how often h < 0 follows a step that was claimed safe, by what the people did.

    Parameters
    ----------
    table : one row for each crowd, its name in the index: `claimed_safe_steps`, and the number of violations
        after each kind of motion, one column each.
    ax : axes to draw on; None makes new ones.

    Examples
    --------
    >>> import pandas as pd
    >>> import plots
    >>> table = pd.DataFrame(1, index=["ETH"], columns=["appeared", "turned", "claimed_safe_steps"])
    >>> ax = plots.plot_safety_claims(table)
    """
    ax = get_axes(ax, size=(8, 3.5))
    left = np.zeros(len(table))
    for kind in table.columns.drop("claimed_safe_steps"):
        share = 1000 * table[kind].to_numpy(float) / table["claimed_safe_steps"].to_numpy(float)
        if kind in _BARS or share.any():
            colour, hatch = _BARS.get(kind, ("magenta", "ooo"))
            ax.barh(
                table.index,
                share,
                left=left,
                label=kind,
                color=colour,
                hatch=hatch,
                edgecolor="white",
            )
        left += share
    ax.set_xlim(0, 1.08 * max(float(left.max(initial=0)), 1e-9))
    ax.set(xlabel="steps that led to h < 0, per 1,000 steps claimed safe")
    ax.invert_yaxis()
    ax.legend(
        fontsize=8,
        title="what the people did",
        loc="center left",
        bbox_to_anchor=(1.01, 0.5),
    )
    return ax
