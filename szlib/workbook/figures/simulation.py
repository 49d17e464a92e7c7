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
from matplotlib.patheffects import Normal, Stroke
from PIL import Image

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
# the labels of times
_OF_ROBOT: Any = {
    "ha": "center",
    "va": "center",
    "fontsize": 8,
    "color": BLACK,
    "xytext": (0, 0),
    "textcoords": "offset points",
    "path_effects": [Stroke(linewidth=2, foreground="white"), Normal()],
}
_OF_PERSON = _OF_ROBOT | {"color": "#7A2E00", "xytext": (0, 8)}  # dark red
_LEGEND = ("o", BLUE, "robot"), ("-", RED, "zone"), ("^", RED, "person")
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
    labelled = np.full((1 + len(run.zones), 2), np.inf)  # of the robot, and of people
    for row in shown.tolist():
        depth = run.time[row] / max(run.time[-1], 1e-9)
        draw_moving(ax, run, row, robot=_ROBOT_COLOURS(depth), zone=ZONE_COLOURS(depth))
        places = np.vstack([run.states[row, :2], run.people[row, :, :2]])
        for i in np.flatnonzero(np.hypot(*(places - labelled).T) > _SAME_PLACE):
            labelled[i] = places[i]
            text = f"{run.time[row]:.3g}"
            ax.annotate(text, places[i], **(_OF_PERSON if i else _OF_ROBOT))
    for mark, colour, name in _LEGEND:
        ax.plot([], [], mark, color=colour, label=name)
    add_legend_below(ax, gap=0.14, ncols=6)
    return label_metres(ax, f"{run.scenario.title} (times in s; later is darker)")


def animate(run: Run, *, every: float = 0.4, width: float = 6.0) -> Movie:
    """Animate a run, at twice its speed; in a notebook it is a player with controls.

    Parameters
    ----------
    run : the run.
    every : time between two frames of the GIF [s], rounded to steps of the run.
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
    canvas = FigureCanvasAgg(figure)
    ax = figure.subplots()
    set_limits(ax, [(run, rows)])
    draw_scenery(ax, run.scenario)
    label_metres(ax, "t")
    figure.draw_without_rendering()
    figure.set_layout_engine("none")  # the layout is done

    def draw_frame(row: int) -> Image.Image:
        """The scene at a row of the run."""
        moving = [
            *ax.plot(*run.states[: row + 1, :2].T, color=BLUE, linewidth=1),
            *ax.plot(*run.predicted[row, :, :2].T, ".", color=GREEN, markersize=3),
            *draw_moving(ax, run, row, robot=BLUE, zone=RED),
        ]
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

    first, *more = map(draw_frame, rows.tolist())
    gif = io.BytesIO()
    time = 500 * step * run.settings.dt  # of a frame [ms]
    first.save(gif, "GIF", save_all=True, append_images=more, duration=time, loop=0)
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
    (line,) = ax.plot(*zone.curve().T, color=colour, linewidth=1.6)
    return line


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
    ends = first.scenario.walls.reshape(-1, 2)
    is_after = ends > drawn.min(axis=0) - _WALL_EXTENT
    is_before = ends < drawn.max(axis=0) + _WALL_EXTENT
    drawn = np.vstack([drawn, ends[(is_after & is_before).all(axis=1)]])
    low = drawn.min(axis=0) - _PADDING
    high = drawn.max(axis=0) + _PADDING
    ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
