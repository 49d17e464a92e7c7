"""Figures of the error of a distance (notebook 22) and of the ways of a step (notebook 12)."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle

from szlib.control.step import Step
from szlib.workbook.figures.control import ARROW, draw_obstacle
from szlib.workbook.figures.palette import BLACK, BLUE, ORANGE, RED
from szlib.workbook.figures.style import draw_person, get_axes, label_metres

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
