"""Figures of barriers and steps: a distance, the scene of a step, and its ways."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import contourpy
import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.patches import Circle
from numpy.typing import ArrayLike

from ...control.obstacles import (
    Obstacle,
    Wall,
    barrier,
    check_wall,
    ellipse_distance,
    segment_distance,
)
from ...control.step import Step
from ...core.checks import Array
from ...zones.ellipses import Ellipse
from .palette import BLACK, BLUE, GREEN, GREY, RED
from .style import add_legend_below, draw_person, get_axes, label_metres

# Points on each side of the grid on which the outline of an obstacle is found.
_GRID = 201
_CHORD_ERROR = 1e-3  # distance of a corner of this outline that may be left out [m]
ARROW: dict[str, Any] = {
    "angles": "xy",
    "scale_units": "xy",
    "scale": 1,
    "width": 0.008,
    "zorder": 3,
}


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
    >>> from szlib.workbook import figures
    >>> figures.plot_distance(szlib.Ellipse((0.1, 0.0), (1.0, 0.7))).get_title()
    'Distance to the zone [m], and h = 0'
    """
    ax = get_axes(ax, size=(5.5, 4.5))
    grid = _grid(extent, 241)
    name = "the zone" if isinstance(shape, Ellipse) else "the wall"
    distance = paper_distance(grid, shape)
    levels = [
        d
        for d in np.arange(-0.5, 1.6, 0.25).tolist()
        if abs(d) > 0.1 and abs(d - margin) > 0.1
    ]
    lines = ax.contour(
        *np.moveaxis(grid, -1, 0),
        distance,
        levels=levels,
        cmap="viridis",
        linewidths=0.8,
    )
    ray = np.linspace(0, extent, 500)[:, None] * (0.6, -0.8)
    along = paper_distance(ray, shape)
    crossed = [d for d in levels if max(0, along.min()) < d < along.max()]
    at = [tuple(ray[np.abs(along - d).argmin()].tolist()) for d in crossed]
    ax.clabel(lines, fmt="%.2f", fontsize=7, manual=at)
    h = barrier(distance, margin, 0.0)
    ax.contour(*np.moveaxis(grid, -1, 0), h, levels=[0.0], colors=[RED], linewidths=2)
    ax.plot(*outline_shape(shape).T, color=BLACK, linewidth=2, label=f"{name}, d = 0")
    ax.plot([], [], color=RED, linewidth=2, label=f"h = 0, d = {margin:g} m")
    add_legend_below(ax)
    return label_metres(ax, f"Distance to {name} [m], and h = 0")


def _grid(extent: float, n: int) -> Array:
    ticks = np.linspace(-extent, extent, n)
    return np.stack(np.meshgrid(ticks, ticks), axis=-1)


def paper_distance(points: Array, shape: Ellipse | ArrayLike) -> Array:
    if isinstance(shape, Ellipse):
        return ellipse_distance(points, shape)
    return segment_distance(points, *check_wall(shape))


def outline_shape(shape: Ellipse | ArrayLike) -> Array:
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
    >>> from szlib.workbook import figures
    >>> controller = szlib.MPCCBF(szlib.Ellipse((0.1, 0.0), (1.0, 0.7)))
    >>> ax = figures.plot_step(controller.step((0, 0, 0, 0), (6, 0), [szlib.Person((3.0, 0.5))]))
    """
    ax, scene = get_axes(ax, size=(5, 4.6)), step.scene
    x, y, vx, vy = scene.state
    ax.add_patch(
        Circle(
            (x, y), scene.settings.r_robot, color=BLUE, alpha=0.45, lw=0, label="robot"
        )
    )
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
            beside = np.clip(
                path.project(shapely.Point(x, y)), 0.6, max(0.6, path.length - 0.6)
            )
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


def draw_obstacle(ax: Axes, obstacle: Obstacle) -> list[Array]:
    """Draw the outline of an `obstacle` within the limits of `ax`, hatched inside, and return its lines."""
    limits = (*ax.get_xlim(), *ax.get_ylim())
    lines = outline_obstacle(obstacle, limits)
    for line in lines:
        ax.plot(
            *line.T,
            color=BLACK,
            linewidth=3,
            solid_capstyle="round",
            label=obstacle.kind,
        )
    if not isinstance(obstacle, Wall):
        x, y, gap = _measure_gap(obstacle, limits)
        inside = ax.contourf(
            x, y, gap, levels=[-np.inf, 0.0], colors="none", hatches=["///"]
        )
        inside.set(edgecolor=GREY, linewidth=0.0)
    return lines


def outline_obstacle(obstacle: Obstacle, limits: Sequence[float]) -> list[Array]:
    """The lines where the gap to an `obstacle` is 0, shape (n, 2) each.

    Parameters
    ----------
    obstacle : any kind; a wall is its segment.
    limits : x0, x1, y0, y1 of what is shown [m]; only lines within it are found, except of walls.
    """
    if isinstance(obstacle, Wall):
        return [np.reshape(obstacle.numbers, (2, 2))]
    generator = contourpy.contour_generator(
        *_measure_gap(obstacle, limits), line_type=contourpy.LineType.Separate
    )
    lines: Any = generator.lines(0.0)
    straight = [shapely.LineString(line).simplify(_CHORD_ERROR) for line in lines]
    return [np.array(line.coords) for line in straight]


def _measure_gap(
    obstacle: Obstacle, limits: Sequence[float]
) -> tuple[Array, Array, Array]:
    """A grid of points within the `limits`, and the gap to an `obstacle` at each, shape (n, n) [m]."""
    x0, x1, y0, y1 = limits
    x, y = np.meshgrid(np.linspace(x0, x1, _GRID), np.linspace(y0, y1, _GRID))
    return x, y, obstacle.gap(x, y, 0.0, *obstacle.numbers)
