"""Figures of a distance and its limit (notebook 07), plans (08), a step (the laboratory), ways (12)."""

from __future__ import annotations

from collections.abc import Sequence
from textwrap import fill
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from numpy.typing import ArrayLike

from szlib.control.obstacles import barrier, check_wall, ellipse_distance, segment_distance
from szlib.control.settings import MPCSettings
from szlib.control.step import Step
from szlib.core.checks import Array
from szlib.simulation import Run
from szlib.workbook.figures.style import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    RED,
    add_legend_below,
    add_shared_legend,
    draw_obstacle,
    draw_person,
    get_axes,
    label_metres,
)
from szlib.zones.ellipses import Ellipse

ARROW: dict[str, Any] = {
    "angles": "xy",
    "scale_units": "xy",
    "scale": 1,
    "width": 0.008,
    "zorder": 3,
}
_LABEL = 40  # letters in a line of a legend under one of three figures
# Colours and lines of ways, the one that is taken first; a print in grey keeps them apart.
_WAYS: tuple[tuple[str, Any], ...] = (
    (BLUE, "-"),
    (ORANGE, (0, (5, 2))),
    (BLACK, (0, (1.5, 1.5))),
)


def plot_ways(step: Step, ax: Axes | None = None) -> Axes:
    """Plot the ways of a step: the one that is taken solid, the others dashed, each with its name and cost.

    The robot is at the first dot of a way after 1 s, at the next one after 2 s. An arrow leads to where its
    person is after 1 s.

    Parameters
    ----------
    step : result of a controller's `step`; without ways (`Step.ways`) only the scene is drawn.
    ax : axes to draw on; None makes new ones.

    Examples
    --------
    >>> import szlib
    >>> import plots
    >>> settings = szlib.MPCSettings.among_people()
    >>> controller = szlib.MPCCBF(szlib.Ellipse((0.1, 0.0), (1.0, 0.7)), settings=settings)
    >>> step = controller.step((0, 0, 0, 0), (8, 0), [szlib.Person((3.0, 0.0), heading=0.0)])
    >>> len(plots.plot_ways(step).get_legend().get_texts()) == len(step.ways)
    True
    """
    ax, scene = get_axes(ax, size=(6, 5.2)), step.scene
    at, goal, handles = (scene.state[0], scene.state[1]), scene.goal, list[Any]()
    for i, way in enumerate(step.ways):
        colour, line = _WAYS[i % len(_WAYS)]
        label = fill(f"{'not ' if i else ''}taken: {way.name}, cost {way.cost:.1f} s", _LABEL)
        style: Any = {"color": colour, "linestyle": line, "zorder": 3 - i / 10}
        handles += ax.plot(*way.points.T, linewidth=2 if i else 3, label=label, **style)
        seconds = way.at(np.arange(1.0, way.times[-1]))
        ax.plot(*seconds.T, "o", color=colour, markersize=4, zorder=3)
    curves = [np.array([at, goal]), *(way.points for way in step.ways)]
    pairs = zip(scene.people, scene.person_zones, strict=True)
    for i, (person, zone) in enumerate(pairs):
        (x, y), heading = person.position, person.heading or 0.0
        curves.append(zone.placed((x, y), heading).curve())
        ax.plot(*curves[-1].T, color=RED, linewidth=1)
        draw_person(ax, x, y, heading, color=RED, markersize=7)
        ax.quiver(x, y, *person.velocity, color=RED, **ARROW)
        ax.annotate(f"{i}", (x, y), (5, 5), textcoords="offset points", fontsize=9)
    (x0, y0), (x1, y1) = (each(np.vstack(curves), axis=0) for each in (np.min, np.max))
    ax.set(xlim=(x0 - 0.8, x1 + 0.8), ylim=(y0 - 0.8, y1 + 0.8))
    for obstacle in scene.fixed.items:
        draw_obstacle(ax, obstacle)
    ax.add_patch(Circle(at, scene.settings.r_robot, color=BLUE, alpha=0.45, lw=0))
    ax.plot(*goal, "D", color=BLUE, markersize=8, markeredgecolor=BLACK, zorder=4)
    if handles:
        place: Any = {"loc": "upper center", "bbox_to_anchor": (0.5, -0.16)}
        ax.legend(handles=handles, **place, fontsize=8)
    n = len(step.ways)
    title = f"{n} way{'s' * (n > 1)}" if n else "No way was looked for"
    return label_metres(ax, title)


def plot_distance(
    shape: Ellipse | ArrayLike,
    *,
    extent: float = 2.5,
    margin: float = 0.55,
    ax: Axes | None = None,
) -> Axes:
    """Plot level lines of the paper's approximate distance to an ellipse or a wall, and h = 0.

    Parameters
    ----------
    shape : ellipse, or the two ends of a wall [m].
    extent : half the side of the figure [m].
    margin : distance with h = 0: the radius of the robot and its margin [m].
    ax : axes to draw on; None makes new ones.

    Examples
    --------
    >>> import szlib
    >>> import plots
    >>> plots.plot_distance(szlib.Ellipse((0.1, 0.0), (1.0, 0.7))).get_title()
    'Distance to the zone [m], and h = 0'
    """
    ax = get_axes(ax, size=(5.5, 4.5))
    grid = _grid(extent, 241)
    name = "the zone" if isinstance(shape, Ellipse) else "the wall"
    distance = _paper_distance(grid, shape)
    levels = [d for d in np.arange(-0.5, 1.6, 0.25).tolist() if abs(d) > 0.1 and abs(d - margin) > 0.1]
    lines = ax.contour(
        *np.moveaxis(grid, -1, 0),
        distance,
        levels=levels,
        cmap="viridis",
        linewidths=0.8,
    )
    ray = np.linspace(0, extent, 500)[:, None] * (0.6, -0.8)
    along = _paper_distance(ray, shape)
    crossed = [d for d in levels if max(0, along.min()) < d < along.max()]
    at = [tuple(ray[np.abs(along - d).argmin()].tolist()) for d in crossed]
    ax.clabel(lines, fmt="%.2f", fontsize=7, manual=at)
    h = barrier(distance, margin, 0.0)
    ax.contour(*np.moveaxis(grid, -1, 0), h, levels=[0.0], colors=[RED], linewidths=2)
    ax.plot(*_outline_shape(shape).T, color=BLACK, linewidth=2, label=f"{name}, d = 0")
    ax.plot([], [], color=RED, linewidth=2, label=f"h = 0, d = {margin:g} m")
    add_legend_below(ax)
    return label_metres(ax, f"Distance to {name} [m], and h = 0")


def _grid(extent: float, n: int) -> Array:
    ticks = np.linspace(-extent, extent, n)
    return np.stack(np.meshgrid(ticks, ticks), axis=-1)


def _paper_distance(points: Array, shape: Ellipse | ArrayLike) -> Array:
    if isinstance(shape, Ellipse):
        return ellipse_distance(points, shape)
    return segment_distance(points, *check_wall(shape))


def _outline_shape(shape: Ellipse | ArrayLike) -> Array:
    return shape.curve() if isinstance(shape, Ellipse) else check_wall(shape)


def plot_step(step: Step, *, ax: Axes | None = None) -> Axes:
    """Plot the scene of a step and its plan: the robot, zones, what stands still near by, velocities.

    Parameters
    ----------
    step : result of a controller's `step`.
    ax : axes to draw on; None makes new ones.

    Examples
    --------
    >>> import szlib
    >>> import plots
    >>> controller = szlib.MPCCBF(szlib.Ellipse((0.1, 0.0), (1.0, 0.7)))
    >>> ax = plots.plot_step(controller.step((0, 0, 0, 0), (6, 0), [szlib.Person((3.0, 0.5))]))
    """
    ax, scene = get_axes(ax, size=(5, 4.6)), step.scene
    x, y, vx, vy = scene.state
    ax.add_patch(Circle((x, y), scene.settings.r_robot, color=BLUE, alpha=0.45, lw=0, label="robot"))
    curves = [np.add((x, y), [(-1.5, -1.5), (1.5, 1.5)])]
    ax.quiver(x, y, vx, vy, color=BLUE, **ARROW)
    ax.plot(
        *step.predicted[:, :2].T,
        ".-",
        color=GREEN,
        markersize=4,
        linewidth=1,
        label="plan",
    )
    for person, zone in zip(scene.people, scene.person_zones, strict=True):
        (px, py), heading = person.position, person.heading or 0.0
        curves.append(zone.placed((px, py), heading).curve())
        ax.plot(*curves[-1].T, color=RED, linewidth=1.8, label="zone")
        draw_person(ax, px, py, heading, color=RED, markersize=7)
        ax.quiver(px, py, *person.velocity, color=RED, **ARROW)
    drawn = np.vstack(curves)
    (x0, y0), half = (
        (drawn.min(axis=0) + drawn.max(axis=0)) / 2,
        np.ptp(drawn, axis=0).max() / 2 + 0.2,
    )
    ax.set(xlim=(x0 - half, x0 + half), ylim=(y0 - half, y0 + half))
    for i, obstacle in enumerate(scene.fixed.items, start=len(scene.people)):
        name = scene.name(i).partition(" (")[0]
        for line in draw_obstacle(ax, obstacle):
            path = shapely.LineString(line)
            beside = np.clip(path.project(shapely.Point(x, y)), 0.6, max(0.6, path.length - 0.6))
            near = path.interpolate(beside)
            ax.text(near.x, near.y, f" {name}", fontsize=8, va="bottom", clip_on=True)
    ax.plot(
        *zip((x, y), step.target, strict=True),
        ":",
        color=BLUE,
        label="direction to the target",
    )
    add_legend_below(ax, gap=0.16, ncols=3)
    return label_metres(
        ax,
        f"least h = {step.h.min(initial=np.inf):.2f} m, speed {np.hypot(vx, vy):.2f} m/s",
    )


def draw_limit(zone: Ellipse, settings: MPCSettings) -> Figure:
    """Draw h between a robot and a zone, beside the speed of approach that gamma allows at each h.

    Parameters
    ----------
    zone : zone of a person at the origin, who faces the robot.
    settings : settings of the robot: gamma, dt, v_max, r_robot, eps.

    Examples
    --------
    >>> import szlib
    >>> import plots
    >>> figure = plots.draw_limit(szlib.Ellipse((0.1, 0.0), (1.0, 0.7)), szlib.MPCSettings())
    >>> figure.axes[1].get_title()
    'The robot slows down when h < 2 m'
    """
    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 3.6), layout="constrained", width_ratios=(1.5, 1))
    reach = zone.curve()[:, 0].max()
    robot = (reach + settings.r_robot + settings.eps + 1, 0)
    left.fill(*zone.curve().T, color=RED, alpha=0.2, label="zone")
    left.plot(0, 0, marker=(3, 0, -90), color=RED, markersize=10, linestyle="", label="person")
    left.add_patch(Circle(robot, settings.r_robot, color=BLUE, label="robot"))
    left.annotate("", (reach, 0), (reach + 1 + settings.eps, 0), arrowprops={"arrowstyle": "<->"})
    left.text(reach + 0.5, 0.12, "h = 1 m", ha="center")
    left.set(xlim=(-1.3, 4.1), ylim=(-1.3, 1.3))
    label_metres(left, "h: the free distance from robot to zone")
    rate = settings.gamma / settings.dt
    h = np.linspace(0, 3, 61)
    right.plot(h, rate * h, color=BLUE)
    right.fill_between(h, rate * h, 2, color=GREY, alpha=0.4, label="forbidden")
    right.axhline(settings.v_max, color=BLACK, linestyle=":", label="top speed of the robot")
    right.plot(1, rate, "o", color=BLUE, label=f"h = 1 m: {rate:.2g} m/s")
    right.set(xlim=(0, 3), ylim=(0, 2), xlabel="h [m]", ylabel="speed of approach [m/s]")
    right.set_title(f"The robot slows down when h < {settings.v_max / rate:.2g} m")
    for ax in (left, right):
        ax.legend(loc="lower right", fontsize=8)
    return figure


def draw_plans(run: Run, rows: Sequence[int]) -> Figure:
    """Draw the plan of the robot at some `rows` of a `run` in a corridor, side by side."""
    figure, panels = plt.subplots(
        1, len(rows), figsize=(10.5, 3.1), layout="constrained", sharex=True, sharey=True
    )
    for ax, row in zip(panels, rows, strict=True):
        draw_moment(ax, run, row, run.states[row], run.predicted[row])
        ax.label_outer()
    add_shared_legend(panels)
    return figure


def draw_moment(ax: Axes, run: Run, row: int, state: Array, plan: Array) -> None:
    """Draw a robot in a `state` with its `plan` into `ax`, among walls and person of a `row` of a `run`."""
    scene, time = run.scenario, row * run.settings.dt
    person = scene.people[0].after(time)
    (x, y), heading = person.position, person.heading or 0.0
    for wall in scene.walls:
        ax.plot(*wall.T, color=BLACK, linewidth=3)
    radius = run.settings.r_robot
    ax.add_patch(Circle(state[:2].tolist(), radius, color=BLUE, alpha=0.4, lw=0, label="robot"))
    ax.plot(*plan[:, :2].T, ".-", color=GREEN, markersize=4, label=f"plan, {len(plan) - 1} steps")
    ax.plot(*run.zones[0].placed((x, y), heading).curve().T, color=RED, label="zone")
    draw_person(ax, x, y, heading, color=RED, label="person")
    ax.plot(*scene.goal, "D", color=BLUE, markeredgecolor=BLACK, linestyle="", label="goal")
    ax.set(xlim=(-5, 5), ylim=(-2.5, 2.5))
    label_metres(ax, f"{time:.0f} s: {np.hypot(*state[2:]):.2f} m/s")
