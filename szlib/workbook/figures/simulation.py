"""Figures of runs: the scene over time, speeds and barriers, paths, crowds, animations."""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import Any

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

from ...core.checks import Array
from ...simulation import Run, Scenario
from ...zones.ellipses import Ellipse
from .movies import Movie, place_zones
from .style import (
    BLACK,
    BLUE,
    GREEN,
    RED,
    add_legend_below,
    draw_obstacle,
    draw_person,
    get_axes,
    label_metres,
)

_ROBOT_COLOURS = LinearSegmentedColormap.from_list("robot", ["#D6E9F5", BLUE])
ZONE_COLOURS = LinearSegmentedColormap.from_list("person", ["#F8DCC8", RED])
_PADDING = 0.2  # margin around everything that is drawn [m]
_SAME_PLACE = 0.35  # positions nearer to the last label than this have none [m]
# a wall is drawn to its end if the end is at most this far from all else [m]
_WALL_EXTENT = 3.0


def plot_scenario(run: Run, *, every: float = 2.0, ax: Axes | None = None) -> Axes:
    """Plot robot, zones and walls at several times; later is darker (paper, fig. 6).

    The times [s] are written on the paths of the robot and of each person.  A person who stays in one place
    has one label, with the first time.

    Parameters
    ----------
    run : the run.
    every : time between two drawings [s].
    ax : axes to draw on; None makes new ones.

    Examples
    --------
    >>> import szlib
    >>> from szlib.workbook import figures
    >>> controller = szlib.MPCCBF(szlib.Ellipse((0.1, 0.0), (1.0, 0.7)))
    >>> log = szlib.simulate(szlib.SCENARIOS["passing"], controller, max_time=2.0)
    >>> ax = figures.plot_scenario(log, every=1.0)
    """
    ax = get_axes(ax, size=(9, 4.5))
    step = max(1, round(every / run.settings.dt))
    shown = np.arange(0, len(run.states), step)
    set_limits(ax, [(run, shown)])
    draw_scenery(ax, run.scenario)
    ax.plot(
        *run.states[:, :2].T,
        "o-",
        color=BLUE,
        markersize=1.5,
        linewidth=0.6,
        label="robot's path",
    )
    for row in shown.tolist():
        depth = run.time[row] / max(run.time[-1], 1e-9)
        draw_moving(ax, run, row, robot=_ROBOT_COLOURS(depth), zone=ZONE_COLOURS(depth))
    _write_times(ax, run.time[shown], run.states[shown, :2], colour=BLACK, above=0)
    for i in range(len(run.zones)):
        # dark red
        _write_times(
            ax, run.time[shown], run.people[shown, i, :2], colour="#7A2E00", above=8
        )
    ax.plot([], [], "o", color=BLUE, label="robot")
    ax.plot([], [], color=RED, label="zone")
    ax.plot([], [], marker=(3, 0, 0), color=RED, linestyle="", label="person")
    add_legend_below(ax, gap=0.14, ncols=6)
    return label_metres(ax, f"{run.scenario.title} (times in s; later is darker)")


def animate(run: Run, *, every: float = 0.4, width: float = 6.0) -> Movie:
    """Animate a run, at twice its speed; in a notebook it is a player with controls.

    Parameters
    ----------
    run : the run.
    every : time between two frames of the GIF [s].
    width : width of the GIF [inch].

    Examples
    --------
    >>> import szlib
    >>> from szlib.workbook import figures
    >>> controller = szlib.MPCCBF(szlib.Ellipse((0.1, 0.0), (1.0, 0.7)))
    >>> log = szlib.simulate(szlib.SCENARIOS["passing"], controller, max_time=1.0)
    >>> movie = figures.animate(log, width=3.0)
    """
    step = max(1, round(every / run.settings.dt))
    rows = np.unique(np.r_[np.arange(0, len(run.states), step), len(run.states) - 1])
    figure = Figure(figsize=(width, width * 0.55), layout="constrained", dpi=70)
    canvas, ax = FigureCanvasAgg(figure), figure.subplots()
    set_limits(ax, [(run, rows)])
    draw_scenery(ax, run.scenario)
    label_metres(ax, "t")
    figure.draw_without_rendering()
    figure.set_layout_engine("none")  # the layout is done

    def draw_frame(row: int) -> Image.Image:
        """The scene at a row of the run."""
        moving: list[Artist] = [
            *ax.plot(*run.states[: row + 1, :2].T, color=BLUE, linewidth=1)
        ]
        moving += ax.plot(*run.predicted[row, :, :2].T, ".", color=GREEN, markersize=3)
        moving += draw_moving(ax, run, row, robot=BLUE, zone=RED)
        ax.set_title(
            f"t = {run.time[row]:4.1f} s, robot at {run.speed[row]:.2f} m/s (shown twice as fast)"
        )
        canvas.draw()  # type: ignore[no-untyped-call]
        for artist in moving:
            artist.remove()
        pixels = np.asarray(canvas.buffer_rgba())  # type: ignore[no-untyped-call]
        picture = Image.fromarray(pixels).convert("RGB")
        # nine times as fast as the default
        return picture.quantize(method=Image.Quantize.FASTOCTREE)

    first, *more = [draw_frame(row) for row in rows.tolist()]
    gif = io.BytesIO()
    first.save(
        gif, "GIF", save_all=True, append_images=more, duration=500 * every, loop=0
    )
    return Movie(gif.getvalue(), run, (*ax.get_xlim(), *ax.get_ylim()))


def draw_scenery(ax: Axes, scenario: Scenario) -> None:
    """Draw what stands still in a `scenario`, within the limits of `ax`: walls, other obstacles, the goal."""
    for obstacle in scenario.fixed:
        draw_obstacle(ax, obstacle)
    ax.plot(
        *scenario.goal,
        "D",
        color=BLUE,
        markersize=8,
        markeredgecolor=BLACK,
        label="goal",
    )


def draw_zone(ax: Axes, zone: Ellipse, colour: Any) -> Artist:
    """Draw the outline of a `zone` on `ax` in a `colour`."""
    (a, b), angle = zone.semi_axes, np.degrees(zone.angle)
    patch = EllipsePatch(
        zone.center, 2 * a, 2 * b, angle=angle, fill=False, edgecolor=colour, lw=1.6
    )
    return ax.add_patch(patch)


def draw_moving(ax: Axes, run: Run, row: int, *, robot: Any, zone: Any) -> list[Artist]:
    """Draw people, zones and the robot on `ax` at a `row` of a `run`; `robot` and `zone` are colours."""
    drawn = [
        draw_zone(ax, ellipse, zone)
        for ellipse in place_zones(run.zones, run.people[row])
    ]
    position = run.states[row, :2].tolist()
    drawn.append(
        ax.add_patch(
            Circle(position, run.settings.r_robot, color=robot, alpha=0.6, lw=0)
        )
    )
    for x, y, heading in run.people[row, :, :3].tolist():
        drawn += draw_person(ax, x, y, heading, color=RED, markersize=6)
    return drawn


def _write_times(
    ax: Axes, time: Array, positions: Array, *, colour: str, above: float
) -> None:
    """Write the times, shape (n,) [s], beside the positions, shape (n, 2) [m]; NaN for an absent person.

    Whoever stays in one place has one label, with the first time.
    """
    halo = [Stroke(linewidth=2, foreground="white"), Normal()]
    last = np.full(2, np.inf)
    for seconds, here in zip(time, positions, strict=True):
        if not np.hypot(*(here - last)) > _SAME_PLACE:
            continue
        label = ax.annotate(
            f"{seconds:.3g}", here, (0, above), textcoords="offset points"
        )
        label.set(color=colour, ha="center", va="center", fontsize=8, path_effects=halo)
        last = here


def set_limits(ax: Axes, shown: Sequence[tuple[Run, Any]]) -> None:
    """Set limits of `ax` that hold the paths, the goal, and the zones in the rows `shown` of each run.

    Much longer walls (`_WALL_EXTENT`) are cut off.
    """
    first = shown[0][0]
    radius = first.settings.r_robot + 0.3
    points = [first.scenario.goal + radius, first.scenario.goal - radius]
    for run, rows in shown:
        points += [run.states[:, :2] + radius, run.states[:, :2] - radius]
        for people in run.people[rows]:
            points += [zone.curve(25) for zone in place_zones(run.zones, people)]
    drawn = np.vstack(points)
    low, high = drawn.min(axis=0) - _PADDING, drawn.max(axis=0) + _PADDING
    ends = first.scenario.walls.reshape(-1, 2)
    near = ((ends > low - _WALL_EXTENT) & (ends < high + _WALL_EXTENT)).all(axis=1)
    low = np.minimum(low, ends[near].min(axis=0, initial=np.inf) - _PADDING)
    high = np.maximum(high, ends[near].max(axis=0, initial=-np.inf) + _PADDING)
    ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
