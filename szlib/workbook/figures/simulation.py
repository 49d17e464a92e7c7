"""Figures of runs: scenarios with colours deepening over time, and animations."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from math import isnan
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from matplotlib.patches import Ellipse as EllipsePatch
from matplotlib.patheffects import Normal, Stroke
from PIL import Image

from ...checks import Array
from ...simulation.log import SimulationLog
from ...simulation.scenario import Scenario
from ...zones.ellipses import Ellipse
from .movies import Movie
from .style import BLACK, BLUE, GREEN, GREY, ORANGE, RED, get_axes, label_metres

_ROBOT = LinearSegmentedColormap.from_list("robot", ["#D6E9F5", BLUE])
_PADDING = 0.2
"""Room left around what is drawn [m]."""
_STAYS = 0.35
"""Moves no longer than this share one time label [m]."""
_WHOLE = 3.0
"""A wall that leads no farther than this beyond all else is drawn to its end [m]."""
_DARK_RED = "#7A2E00"
"""Of letters, for `RED` is too pale for them."""
_PERSON = LinearSegmentedColormap.from_list("person", ["#F8DCC8", RED])


def plot_scenario(log: SimulationLog, *, every: float = 2.0, ax: Axes | None = None) -> Axes:
    """Robot, zones and walls, every so many seconds, colours deepening over time (paper, fig. 6).

    The times [s] are written on the robot's path and on everybody's, so that they can be matched; where
    somebody stays within `_STAYS`, from when to when.
    """
    ax = get_axes(ax, size=(9, 4.5))
    step = max(1, round(every / log.settings.dt))
    shown = np.arange(0, len(log.states), step)
    _stage(ax, log.scenario)
    ax.plot(*log.states[:, :2].T, "o-", color=BLUE, markersize=1.5, linewidth=0.6, label="robot's path")
    for row in shown.tolist():
        depth = log.time[row] / max(log.time[-1], 1e-9)
        _draw_moment(ax, log, row, robot=_ROBOT(depth), zone=_PERSON(depth))
    _write_times(ax, log.time[shown], log.states[shown, :2], colour=BLACK, above=0)
    for i in range(len(log.zones)):
        _write_times(ax, log.time[shown], log.people[shown, i, :2], colour=_DARK_RED, above=8)
    ax.plot([], [], "o", color=BLUE, label="robot")
    ax.plot([], [], color=RED, label="zone")
    ax.plot([], [], marker=(3, 0, 0), color=RED, linestyle="", label="person")
    _frame(ax, [(log, shown)])
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=6, fontsize=8)
    return label_metres(ax, f"{log.scenario.title} (times in s; later is darker)")


def plot_speed(log: SimulationLog, *, ax: Axes | None = None) -> Axes:
    """Speed of the robot over time, and its limit."""
    ax = get_axes(ax, size=(8, 2.5))
    ax.plot(log.time, log.speed, color=BLUE, label="robot")
    ax.axhline(log.settings.v_max, color=GREY, linestyle="--", label="limit")
    top = 1.15 * max(log.settings.v_max, float(log.speed.max()))
    ax.set(xlabel="time [s]", ylabel="speed [m/s]", ylim=(0, top))
    ax.legend(loc="upper left", bbox_to_anchor=(1.01, 1), fontsize=8)
    return ax


def plot_barriers(log: SimulationLog, *, ax: Axes | None = None) -> Axes:
    """h of every person, and of the nearest wall, over time: safe where >= 0; logarithmic above 0.5 m."""
    ax = get_axes(ax, size=(8, 2.5))
    n = len(log.scenario.people)
    for i, h in enumerate(log.h[:, :n].T):
        ax.plot(log.time, h, color=RED, label="person" if i == 0 else None)
    if log.h.shape[1] > n:
        walls = log.h[:, n:].min(axis=1)
        ax.plot(log.time, walls, color=BLACK, linestyle=":", label="nearest wall")
    ax.axhline(0, color=GREY, linewidth=1)
    ax.set_yscale("symlog", linthresh=0.5, linscale=1.5)
    ax.set_yticks([0, 0.25, 0.5, 1, 2, 5, 10], ["0", "0.25", "0.5", "1", "2", "5", "10"])
    low, high = log.h.min(initial=0.0), log.h.max(initial=0.5)
    ax.set(xlabel="time [s]", ylabel="h [m]", ylim=(1.2 * low - 0.05, 1.3 * high))
    ax.legend(loc="upper left", bbox_to_anchor=(1.01, 1), fontsize=8)
    return ax


def plot_robot_paths(logs: Mapping[str, SimulationLog], *, ax: Axes | None = None) -> Axes:
    """Paths of several runs of one scene, by name; zones as they were at the start."""
    ax = get_axes(ax, size=(9, 4))
    first = next(iter(logs.values()))
    _stage(ax, first.scenario)
    for zone in _zones(first, 0):
        _draw_zone(ax, zone, _PERSON(0.5))
    styles = zip((BLUE, ORANGE, GREEN, BLACK), ("-", "--", "-.", ":"), strict=True)
    for (name, log), (colour, line) in zip(logs.items(), styles, strict=False):
        ax.plot(*log.states[:, :2].T, color=colour, linestyle=line, linewidth=2, label=name)
    _frame(ax, [(log, np.zeros(1, int)) for log in logs.values()])
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.15), ncols=4, fontsize=8)
    return label_metres(ax, first.scenario.title)


def draw_run_grid(logs: Mapping[str, SimulationLog], *, every: float) -> Figure:
    """Pictures of several runs of one scene every so many seconds: a row for each run, by name."""
    longest = max(float(log.time[-1]) for log in logs.values())
    times = np.arange(0.0, longest + 1e-9, every)
    figure = plt.figure(figsize=(3.2 * len(times), 1.7 * len(logs) + 0.3), layout="constrained")
    grid = figure.subplots(len(logs), len(times), squeeze=False, sharex=True, sharey=True)
    for panels, (name, log) in zip(grid, logs.items(), strict=True):
        for ax, time in zip(panels, times.tolist(), strict=True):
            row = min(round(time / log.settings.dt), len(log.states) - 1)
            _stage(ax, log.scenario)
            ax.plot(*log.states[: row + 1, :2].T, color=BLUE, linewidth=1, label="robot's path")
            _draw_moment(ax, log, row, robot=BLUE, zone=RED)
            _frame(ax, [(each, np.arange(len(each.states))) for each in logs.values()])
            ax.set_title(
                f"{name}, {log.time[row]:g} s, h = {log.h[row].min(initial=np.inf):.2f} m", fontsize=9
            )
            label_metres(ax)
            ax.label_outer()
    return figure


def animate(log: SimulationLog, *, every: float = 0.4, width: float = 6.0) -> Movie:
    """The run as an animated GIF, a frame every so many seconds, twice as fast; a player in notebooks."""
    step = max(1, round(every / log.settings.dt))
    rows = np.unique(np.r_[np.arange(0, len(log.states), step), len(log.states) - 1])
    figure = Figure(figsize=(width, width * 0.55), layout="constrained", dpi=70)
    canvas, ax = FigureCanvasAgg(figure), figure.subplots()
    _stage(ax, log.scenario)
    _frame(ax, [(log, rows)])
    label_metres(ax, "t")
    figure.draw_without_rendering()
    figure.set_layout_engine("none")  # settled
    standing: list[Artist] = [*ax.lines, ax.title]
    for artist in standing:
        artist.set_animated(True)  # left out of what is drawn once: axes, and nothing in them
    canvas.draw()  # type: ignore[no-untyped-call]
    empty = canvas.copy_from_bbox(figure.bbox)  # type: ignore[no-untyped-call]

    def picture(row: int) -> Image.Image:
        """The scene at a row of the run."""
        moving: list[Artist] = [*ax.plot(*log.states[: row + 1, :2].T, color=BLUE, linewidth=1)]
        moving += ax.plot(*log.predicted[row, :, :2].T, ".", color=GREEN, markersize=3)
        moving += _draw_moment(ax, log, row, robot=BLUE, zone=RED)
        ax.set_title(f"t = {log.time[row]:4.1f} s, robot at {log.speed[row]:.2f} m/s (shown twice as fast)")
        canvas.restore_region(empty)  # type: ignore[no-untyped-call]
        for artist in sorted((*standing, *moving), key=Artist.get_zorder):
            ax.draw_artist(artist)
        for artist in moving:
            artist.remove()
        drawn = np.asarray(canvas.buffer_rgba())  # type: ignore[no-untyped-call]
        return Image.fromarray(drawn).convert("RGB")

    first, *others = [picture(row) for row in rows.tolist()]
    movie = io.BytesIO()
    first.save(movie, "GIF", save_all=True, append_images=others, duration=500 * every, loop=0)
    return Movie.of(movie.getvalue(), log, (*ax.get_xlim(), *ax.get_ylim()))


def _stage(ax: Axes, scenario: Scenario) -> None:
    for i, wall in enumerate(scenario.walls):
        ax.plot(*wall.T, color=BLACK, linewidth=3, solid_capstyle="round", label="wall" if i == 0 else None)
    ax.plot(*scenario.goal, "D", color=BLUE, markersize=8, markeredgecolor=BLACK, label="goal")


def _draw_zone(ax: Axes, zone: Ellipse, colour: Any) -> Artist:
    a, b = zone.semi_axes
    patch = EllipsePatch(
        zone.center, 2 * a, 2 * b, angle=np.degrees(zone.angle), fill=False, edgecolor=colour, lw=1.6
    )
    return ax.add_patch(patch)


def _draw_moment(ax: Axes, log: SimulationLog, row: int, *, robot: Any, zone: Any) -> list[Artist]:
    """Robot and zones at one time; a triangle for each person, its tip where they face."""
    x, y = log.states[row, :2].tolist()
    drawn = [_draw_zone(ax, ellipse, zone) for ellipse in _zones(log, row)]
    drawn.append(ax.add_patch(Circle((x, y), log.settings.r_robot, color=robot, alpha=0.6, lw=0)))
    for px, py, heading in log.people[row, :, :3].tolist():
        drawn += ax.plot(px, py, marker=(3, 0, np.degrees(heading) - 90), color=RED, markersize=6)
    return drawn


def _zones(log: SimulationLog, row: int) -> list[Ellipse]:
    """The zone in the world of everybody who is there at one time."""
    at = zip(log.zones, log.people[row, :, :3].tolist(), strict=True)
    return [zone.placed((x, y), heading) for zone, (x, y, heading) in at if not isnan(x)]


def _write_times(ax: Axes, time: Array, at: Array, *, colour: str, above: float) -> None:
    """Write along a path when somebody was there, shape (n,) [s] and (n, 2) [m]; NaN where they were not."""
    labels: list[tuple[Array, list[str]]] = []
    first = 0
    for row in range(1, len(time) + 1):
        if row < len(time) and np.hypot(*(at[row] - at[first])) < _STAYS:
            continue
        if not isnan(at[first, 0]):
            here, until = at[first:row].mean(axis=0), f"-{time[row - 1]:.3g}" if row - 1 > first else ""
            near = [told for place, told in labels if np.hypot(*(here - place)) < _STAYS]
            if not near:
                labels.append((here, []))
                near = [labels[-1][1]]
            near[0].append(f"{time[first]:.3g}{until}")
        first = row
    halo = [Stroke(linewidth=2, foreground="white"), Normal()]
    for here, told in labels:
        label = ax.annotate(", ".join(told), (here[0], here[1]), (0, above), textcoords="offset points")
        label.set(color=colour, ha="center", va="center", fontsize=8, path_effects=halo)


def _frame(ax: Axes, shown: Sequence[tuple[SimulationLog, Any]]) -> None:
    """Limits that hold all that is ever drawn of these runs: paths, goal, and zones in the rows shown.

    Walls that lead much farther (`_WHOLE`) are drawn as far as that.
    """
    first = shown[0][0]
    radius = first.settings.r_robot + 0.3
    points = [first.scenario.goal + radius, first.scenario.goal - radius]
    for log, rows in shown:
        points += [log.states[:, :2] + radius, log.states[:, :2] - radius]
        points += [zone.curve(25) for row in rows.tolist() for zone in _zones(log, row)]
    everything = np.vstack(points)
    low, high = everything.min(axis=0) - _PADDING, everything.max(axis=0) + _PADDING
    ends = first.scenario.walls.reshape(-1, 2)
    near = ((ends > low - _WHOLE) & (ends < high + _WHOLE)).all(axis=1)
    low = np.minimum(low, ends[near].min(axis=0, initial=np.inf) - _PADDING)
    high = np.maximum(high, ends[near].max(axis=0, initial=-np.inf) + _PADDING)
    ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
