"""Figures of runs: scenarios with colours deepening over time, animations, sweeps and comparisons."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.animation import FuncAnimation, PillowWriter
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from matplotlib.patches import Ellipse as EllipsePatch

from ...simulation.closed_loop import Scenario, SimulationLog
from ...zones.ellipses import Ellipse
from .style import BLACK, BLUE, GREEN, GREY, ORANGE, RED, axes, metres

_ROBOT = LinearSegmentedColormap.from_list("robot", ["#D6E9F5", BLUE])
_PERSON = LinearSegmentedColormap.from_list("person", ["#F8DCC8", RED])


def plot_scenario(log: SimulationLog, *, every: float = 2.0, ax: Axes | None = None) -> Axes:
    """Robot, zones and walls, every so many seconds, colours deepening over time (paper, fig. 7)."""
    ax = axes(ax, size=(9, 4.5))
    table = log.table
    last = float(table["t"].iloc[-1])
    step = max(1, round(every / log.controller.settings.dt))
    _stage(ax, log.scenario)
    ax.plot(table["x"], table["y"], "o-", color=BLUE, markersize=1.5, linewidth=0.6, label="robot's path")
    time = table["t"].to_numpy()
    for row in range(0, len(table), step):
        depth = time[row] / max(last, 1e-9)
        _draw_moment(ax, log, row, robot=_ROBOT(depth), zone=_PERSON(depth))
    ax.plot([], [], "o", color=BLUE, label="robot")
    ax.plot([], [], color=RED, label="zone")
    ax.plot([], [], marker=(3, 0, 0), color=RED, linestyle="", label="person")
    _frame(ax, log)
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=6, fontsize=8)
    return metres(ax, f"{log.scenario.title} (every {every:g} s, later is darker)")


def plot_run(log: SimulationLog, *, title: str, figure: Figure | None = None) -> Figure:
    """Speed, and h of every person and wall, over time: the two things that tell how a run went."""
    figure = figure or Figure(figsize=(8, 4.5), layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True)
    table, settings = log.table, log.controller.settings
    upper.plot(table["t"], table["speed"], color=BLUE)
    upper.axhline(settings.v_max, color=GREY, linestyle="--", label="limit")
    upper.set(ylabel="speed [m/s]", ylim=(0, 1.15 * settings.v_max), title=title)
    upper.legend(loc="upper left", bbox_to_anchor=(1.01, 1), fontsize=8)
    styles = {"person": (RED, "-"), "wall": (BLACK, ":")}
    told: set[str] = set()
    for column in table.columns[table.columns.str.startswith("h_")]:
        kind = column.split("_")[1]
        colour, line = styles[kind]
        lower.plot(
            table["t"], table[column], color=colour, linestyle=line, label=None if kind in told else f"{kind}"
        )
        told.add(kind)
    lower.axhline(0, color=GREY, linewidth=1)
    lower.set(xlabel="time [s]", ylabel="h [m] (up to 3)", ylim=(-0.2, 3.0))
    lower.legend(loc="upper left", bbox_to_anchor=(1.01, 1), fontsize=8)
    return figure


def plot_paths(logs: Sequence[tuple[str, SimulationLog]], *, title: str, ax: Axes | None = None) -> Axes:
    """Paths of several runs in one scene, named; zones as they were at the start."""
    ax = axes(ax, size=(9, 4))
    first = logs[0][1]
    _stage(ax, first.scenario)
    for zone in _zones(first, 0):
        _draw_zone(ax, zone, _PERSON(0.5))
    for (name, log), colour, line in zip(
        logs, (BLUE, ORANGE, GREEN, BLACK), ("-", "--", "-.", ":"), strict=False
    ):
        ax.plot(log.table["x"], log.table["y"], color=colour, linestyle=line, linewidth=2, label=name)
    _frame(ax, *(log for _, log in logs))
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.15), ncols=4, fontsize=8)
    return metres(ax, title)


def animate(log: SimulationLog, *, every: float = 0.4, width: float = 6.0) -> bytes:
    """The run as an animated GIF: a frame every so many seconds, shown at twice the speed of life."""
    step = max(1, round(every / log.controller.settings.dt))
    rows = np.unique(np.r_[np.arange(0, len(log.table), step), len(log.table) - 1])
    figure = Figure(figsize=(width, width * 0.55), layout="constrained")
    ax = figure.subplots()

    def draw(row: int) -> list[object]:
        ax.clear()
        now = log.table.iloc[row]
        _stage(ax, log.scenario)
        ax.plot(log.table["x"][: row + 1], log.table["y"][: row + 1], color=BLUE, linewidth=1)
        ax.plot(*log.predicted[row, :, :2].T, ".", color=GREEN, markersize=3)
        _draw_moment(ax, log, row, robot=BLUE, zone=RED)
        _frame(ax, log)
        metres(ax, f"t = {now['t']:4.1f} s, robot at {now['speed']:.2f} m/s (shown twice as fast)")
        return []

    movie = FuncAnimation(figure, draw, frames=rows.tolist())  # type: ignore[arg-type]
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "run.gif"
        movie.save(file, writer=PillowWriter(fps=round(2 / every)), dpi=70)
        return file.read_bytes()


def _stage(ax: Axes, scenario: Scenario) -> None:
    for i, wall in enumerate(scenario.walls):
        ax.plot(*wall.T, color=BLACK, linewidth=3, solid_capstyle="round", label="wall" if i == 0 else None)
    ax.plot(*scenario.goal, "D", color=BLUE, markersize=8, markeredgecolor=BLACK, label="goal")


def _draw_zone(ax: Axes, zone: Ellipse, colour: Any) -> None:
    a, b = zone.semi_axes
    patch = EllipsePatch(
        zone.center, 2 * a, 2 * b, angle=np.degrees(zone.angle), fill=False, edgecolor=colour, lw=1.6
    )
    ax.add_patch(patch)


def _draw_moment(ax: Axes, log: SimulationLog, row: int, *, robot: Any, zone: Any) -> None:
    """Robot and zones at one time; a triangle for each person, its tip where they face."""
    now = log.table.iloc[row]
    for ellipse in _zones(log, row):
        _draw_zone(ax, ellipse, zone)
    ax.add_patch(Circle((now["x"], now["y"]), log.controller.settings.r_robot, color=robot, alpha=0.6, lw=0))
    for i in range(len(log.scenario.people)):
        turn = np.degrees(now[f"person_{i}_heading"]) - 90
        ax.plot(now[f"person_{i}_x"], now[f"person_{i}_y"], marker=(3, 0, turn), color=RED, markersize=6)


def _zones(log: SimulationLog, row: int) -> list[Ellipse]:
    elapsed = float(log.table["t"].iloc[row])
    return log.controller.placed_zones([person.after(elapsed) for person in log.scenario.people])


def _frame(ax: Axes, *logs: SimulationLog) -> None:
    """The same limits for every picture of these runs: where the robot, its goal and the zones ever are."""
    scenario, radius = logs[0].scenario, logs[0].controller.settings.r_robot + 0.3
    path = np.vstack([*(log.table[["x", "y"]].to_numpy() for log in logs), scenario.goal])
    people = np.array([person.position for person in scenario.people]).reshape(-1, 2)
    low = np.vstack([path - radius, people - 1.2]).min(axis=0)
    high = np.vstack([path + radius, people + 1.2]).max(axis=0)
    if len(scenario.walls):
        y = scenario.walls[:, :, 1]
        low[1], high[1] = min(low[1], max(y.min() - 0.2, -3.5)), max(high[1], min(y.max() + 0.2, 3.5))
    ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))


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
