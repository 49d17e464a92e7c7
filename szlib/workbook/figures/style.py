"""The style that all figures share: colours, sizes, labels in metres, people, obstacles, legends."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import contourpy
import matplotlib.pyplot as plt
import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.legend import Legend

from ...control.obstacles import Obstacle, Wall
from ...core.checks import Array

BLUE = "#0072B2"
ORANGE = "#E69F00"
GREEN = "#009E73"
RED = "#D55E00"
GREY = "#999999"
BLACK = "#000000"
SEQUENCE = "viridis"
# Points on each side of the grid on which the outline of an obstacle is found.
_GRID = 201
_CHORD_ERROR = 1e-3  # distance of a corner of this outline that may be left out [m]


def pick_colours(values: Sequence[Any]) -> list[Any]:
    """Return one colour for each of the `values`, from dark to light, without the palest.

    Examples
    --------
    >>> from szlib.workbook import figures
    >>> len(figures.pick_colours([0.7, 1.1, 1.5]))
    3
    """
    return list(plt.get_cmap(SEQUENCE)(np.linspace(0, 0.85, len(values))))


def get_axes(ax: Axes | None, *, size: tuple[float, float] = (6.0, 4.5)) -> Axes:
    """Return `ax`, or the axes of a new figure of this `size` [inch] if `ax` is None.

    Examples
    --------
    >>> from szlib.workbook import figures
    >>> ax = figures.get_axes(None, size=(4, 3))
    >>> figures.get_axes(ax) is ax
    True
    """
    return plt.subplots(figsize=size, layout="constrained")[1] if ax is None else ax


def label_metres(ax: Axes, title: str = "", *, person: bool = False) -> Axes:
    """Label both axes in metres, with equal aspect.

    Parameters
    ----------
    ax : axes to label.
    title : title of the axes; "" keeps the one they have.
    person : True for the frame of a person who walks to the right, False for the world.

    Returns
    -------
    The same axes.

    Examples
    --------
    >>> from szlib.workbook import figures
    >>> figures.label_metres(figures.get_axes(None), person=True).get_xlabel()
    'x, ahead [m]'
    """
    ax.set(
        xlabel="x, ahead [m]" if person else "x [m]",
        ylabel="y, to the left [m]" if person else "y [m]",
    )
    if title:
        ax.set_title(title)
    ax.set_aspect("equal")
    return ax


def add_legend_below(ax: Axes, *, gap: float = 0.13, ncols: int = 2) -> Legend:
    """Add a legend below `ax`, at a distance of `gap` times its height, with `ncols` columns; each name once.

    Examples
    --------
    >>> from szlib.workbook import figures
    >>> ax = figures.get_axes(None)
    >>> line = ax.plot([0, 1], [0, 1], label="robot")
    >>> legend = figures.add_legend_below(ax)
    """
    handles, names = ax.get_legend_handles_labels()
    known = dict(zip(names, handles, strict=True))
    place: Any = {"loc": "upper center", "bbox_to_anchor": (0.5, -gap)}
    return ax.legend(known.values(), known, **place, ncols=ncols, fontsize=8)


def add_shared_legend(panels: Sequence[Axes]) -> None:
    """Add one legend below all `panels` that show the same things: the legend of the first panel.

    Examples
    --------
    >>> import matplotlib.pyplot as plt
    >>> from szlib.workbook import figures
    >>> figure, panels = plt.subplots(1, 2, layout="constrained")
    >>> line = panels[0].plot([0, 1], [0, 1], label="robot")
    >>> figures.add_shared_legend(panels)
    """
    handles, names = panels[0].get_legend_handles_labels()
    known = dict(zip(names, handles, strict=True))
    panels[0].figure.legend(
        known.values(), known, loc="outside lower center", ncols=len(known)
    )


def draw_person(
    ax: Axes, x: float, y: float, heading: float, **style: Any
) -> list[Any]:
    """Draw a triangle on `ax` at the position (`x`, `y`) [m]; its tip points along `heading` [rad].

    The options of `style` are those of matplotlib's lines.  Returns the lines.
    """
    return ax.plot(x, y, marker=(3, 0, np.degrees(heading) - 90), linestyle="", **style)


def alt_text(figure: Figure) -> str:
    """Describe `figure` for readers who cannot see it: titles, axes, and names in legends.

    Examples
    --------
    >>> from szlib.workbook import figures
    >>> ax = figures.get_axes(None)
    >>> labels = ax.set(title="A run", xlabel="time [s]", ylabel="h [m]")
    >>> figures.alt_text(ax.figure)
    'A run: h [m] over time [s]'
    """
    parts = [figure.get_suptitle()]
    for ax in figure.axes:
        x = ax.get_xlabel()
        y = ax.get_ylabel()
        legend = ax.get_legend()
        axes = f"{y} over {x}" if x and y else x or y
        part = ": ".join(filter(None, (ax.get_title(), axes)))
        names = (
            ", ".join(text.get_text() for text in legend.get_texts()) if legend else ""
        )
        parts.append(f"{part}, with {names}" if names else part)
    return " ".join("; ".join(filter(None, parts)).split())


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
