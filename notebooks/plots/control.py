"""Figures of the error of a distance (notebook 22) and of the ways of a step (notebook 12)."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle
from numpy.typing import ArrayLike

from szlib.control.step import Step
from szlib.control.verification import (
    compute_distance_error,
    find_safe_boundary,
    required_margin,
)
from szlib.workbook.figures.control import ARROW, draw_obstacle, make_grid, outline_shape, paper_distance
from szlib.workbook.figures.palette import BLACK, BLUE, ORANGE, RED
from szlib.workbook.figures.style import add_legend_below, draw_person, get_axes, label_metres
from szlib.zones.ellipses import Ellipse

# Colours and lines of ways, the one that is taken first; a print in grey keeps them apart.
_WAYS: tuple[tuple[str, Any], ...] = (
    (BLUE, "-"),
    (ORANGE, (0, (5, 2))),
    (BLACK, (0, (1.5, 1.5))),
)


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
    >>> import plots
    >>> ax = plots.plot_distance_error([(-1.0, 0.0), (1.0, 0.0)], r_robot=0.5, eps=0.05)
    """
    ax = get_axes(ax, size=(5.5, 4.5))
    grid = make_grid(extent, 321)
    x, y = np.moveaxis(grid, -1, 0)
    error = compute_distance_error(grid, shape)
    true = paper_distance(grid, shape) - error
    # no error matters farther away
    shown = np.ma.masked_where((true < 0) | (true > 0.9), 100 * error)
    image = ax.pcolormesh(x, y, shown, cmap="RdBu_r", vmin=-25, vmax=25, rasterized=True)
    ax.figure.colorbar(image, ax=ax, shrink=0.85, label="d - Euclidean [cm]; red is dangerous")
    ax.plot(*outline_shape(shape).T, color=BLACK, linewidth=3)
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
    ax.contour(x, y, true, levels=[r_robot], colors=[BLACK], linestyles=[":"], linewidths=1.8)
    ax.plot([], [], ":", color=BLACK, label="the robot's disc touches")
    ax.set(xlim=(-extent, extent), ylim=(-extent, extent))
    add_legend_below(ax)
    return label_metres(ax, "Error of the approximate distance")


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
