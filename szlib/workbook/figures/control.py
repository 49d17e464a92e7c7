"""Figures of barriers and steps: a distance, its error, the scene of a step, and its ways."""

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
from ...control.verification import (
    compute_distance_error,
    find_safe_boundary,
    required_margin,
)
from ...core.checks import Array
from ...zones.ellipses import Ellipse
from .palette import BLACK, BLUE, GREEN, GREY, ORANGE, RED
from .style import add_legend_below, draw_person, get_axes, label_metres

# Points on each side of the grid on which the outline of an obstacle is found.
_GRID = 201
_CHORD_ERROR = 1e-3  # distance of a corner of this outline that may be left out [m]
# Colours and lines of ways, the one that is taken first; a print in grey keeps them apart.
_WAYS: tuple[tuple[str, Any], ...] = (
    (BLUE, "-"),
    (ORANGE, (0, (5, 2))),
    (BLACK, (0, (1.5, 1.5))),
)
_ARROW: dict[str, Any] = {
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
    distance = _distance(grid, shape)
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
    along = _distance(ray, shape)
    crossed = [d for d in levels if max(0, along.min()) < d < along.max()]
    at = [tuple(ray[np.abs(along - d).argmin()].tolist()) for d in crossed]
    ax.clabel(lines, fmt="%.2f", fontsize=7, manual=at)
    h = barrier(distance, margin, 0.0)
    ax.contour(*np.moveaxis(grid, -1, 0), h, levels=[0.0], colors=[RED], linewidths=2)
    ax.plot(*_outline(shape).T, color=BLACK, linewidth=2, label=f"{name}, d = 0")
    ax.plot([], [], color=RED, linewidth=2, label=f"h = 0, d = {margin:g} m")
    add_legend_below(ax)
    return label_metres(ax, f"Distance to {name} [m], and h = 0")


def plot_distance_error(
    shape: Ellipse | ArrayLike,
    *,
    r_robot: float,
    eps: float,
    extent: float = 2.0,
    ax: Axes | None = None,
) -> Axes:
    """Plot the approximate minus the Euclidean distance near a zone or a wall, and h = 0 with two margins.

    The robot's disc touches the zone or the wall on the dotted line.  A line h = 0 inside the dotted line
    allows a collision.

    Parameters
    ----------
    shape : ellipse, or the two ends of a wall [m].
    r_robot : radius of the robot [m].
    eps : margin [m]. The second margin is the least one without collisions.
    extent : half the side of the figure [m].
    ax : axes to draw on; None makes new ones.

    Examples
    --------
    >>> from szlib.workbook import figures
    >>> ax = figures.plot_distance_error([(-1.0, 0.0), (1.0, 0.0)], r_robot=0.5, eps=0.05)
    """
    ax = get_axes(ax, size=(5.5, 4.5))
    grid = _grid(extent, 321)
    x, y = np.moveaxis(grid, -1, 0)
    error = compute_distance_error(grid, shape)
    true = _distance(grid, shape) - error
    # no error matters farther away
    shown = np.ma.masked_where((true < 0) | (true > 0.9), 100 * error)
    image = ax.pcolormesh(
        x, y, shown, cmap="RdBu_r", vmin=-25, vmax=25, rasterized=True
    )
    ax.figure.colorbar(
        image, ax=ax, shrink=0.85, label="d - Euclidean [cm]; red is dangerous"
    )
    ax.plot(*_outline(shape).T, color=BLACK, linewidth=3)
    margins = dict.fromkeys((eps, max(eps, required_margin(shape, r_robot))))
    for margin, line in zip(margins, ("-", "--"), strict=False):
        edge = find_safe_boundary(shape, r_robot + margin)
        label = f"h = 0, eps = {100 * margin:.0f} cm"
        ax.plot(
            *np.vstack([edge, edge[:1]]).T,
            line,
            color=BLACK,
            linewidth=1.8,
            label=label,
        )
    ax.contour(
        x, y, true, levels=[r_robot], colors=[BLACK], linestyles=[":"], linewidths=1.8
    )
    ax.plot([], [], ":", color=BLACK, label="the robot's disc touches")
    ax.set(xlim=(-extent, extent), ylim=(-extent, extent))
    add_legend_below(ax)
    return label_metres(ax, "Error of the approximate distance")


def _grid(extent: float, n: int) -> Array:
    ticks = np.linspace(-extent, extent, n)
    return np.stack(np.meshgrid(ticks, ticks), axis=-1)


def _distance(points: Array, shape: Ellipse | ArrayLike) -> Array:
    if isinstance(shape, Ellipse):
        return ellipse_distance(points, shape)
    return segment_distance(points, *check_wall(shape))


def _outline(shape: Ellipse | ArrayLike) -> Array:
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
    ax.quiver(x, y, vx, vy, color=BLUE, **_ARROW)
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
        ax.quiver(px, py, *person.velocity, color=RED, **_ARROW)
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
    >>> from szlib.workbook import figures
    >>> settings = szlib.MPCSettings.among_people()
    >>> controller = szlib.MPCCBF(szlib.Ellipse((0.1, 0.0), (1.0, 0.7)), settings=settings)
    >>> step = controller.step((0, 0, 0, 0), (8, 0), [szlib.Person((3.0, 0.0), heading=0.0)])
    >>> len(figures.plot_ways(step).get_legend().get_texts()) == len(step.ways)
    True
    """
    ax, scene = get_axes(ax, size=(6, 5.2)), step.scene
    at, goal, handles = (scene.state[0], scene.state[1]), scene.goal, list[Any]()
    for i, way in enumerate(step.ways):
        colour, line = _WAYS[i % len(_WAYS)]
        label = f"{'not ' if i else ''}taken: {way.name}, cost {way.cost:.1f} s"
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
        ax.quiver(x, y, *person.velocity, color=RED, **_ARROW)
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
