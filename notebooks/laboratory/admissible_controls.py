"""The accelerations that a step could have chosen, and their figure."""

from __future__ import annotations

from math import inf
from typing import Any, NamedTuple

import matplotlib.pyplot as plt
import numpy as np
import plots
import shapely
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from shapely.plotting import patch_from_polygon

import szlib
from szlib.control import Obstacles
from szlib.control.obstacles import Priority
from szlib.control.problem import list_conditions
from szlib.core.checks import Array
from szlib.workbook import figures

# Of the curves of limits: their reach, in half-widths of the box of accelerations, so that they cross it; the
# number of their points, between which they are straight to 1e-3 m/s2; and their precision [m/s2].
_REACH, _POINTS, _PRECISION = 3, 49, 5e-4
# Line styles of obstacles that stand still; after the last again from the first.
_LINES = ("--", ":", "-.", (0, (5, 1, 1, 1, 1, 1)))


class BarrierLimit(NamedTuple):
    """The edge of what one barrier row allows.

    Attributes
    ----------
    row : place of the obstacle in `Step.obstacles`.
    k : the row links steps k and k + 1 of the plan.
    curve : points with the allowed side on the left, shape (n, 2) [m/s2].
    priority : of the row. With a `decay_price` the plan may violate the decay, and pays its price.
    """

    row: int
    k: int
    curve: Array
    priority: Priority

    @property
    def forbidden(self) -> Any:
        """The side of the curve that is forbidden, as far as the curve is long: a Shapely polygon."""
        along_x, along_y = self.curve[-1] - self.curve[0]
        return shapely.Polygon(np.vstack([self.curve, self.curve[::-1] + np.array([along_y, -along_x])]))


class AdmissibleControls(NamedTuple):
    """All first accelerations that obey every row, with the rest of the plan unchanged [m/s2, world frame].

    Attributes
    ----------
    polygon : a Shapely polygon, which may be empty or have several parts.
    limits : the barrier rows that forbid something that the bounds and the speed limit allow.
    """

    polygon: Any
    limits: tuple[BarrierLimit, ...]


def find_admissible_controls(step: szlib.Step) -> AdmissibleControls:
    """Find the accelerations that a step could have chosen: bounds, speed limit, and every barrier row.

    Prices are ignored: every decay counts as hard, so a control that pays one lies outside. A terminal condition
    is ignored, because with the rest of the plan unchanged it allows only the chosen acceleration. If the plan is
    not feasible, the polygon is empty or does not contain the control.

    Parameters
    ----------
    step : of an `MPCCBF`.

    Examples
    --------
    >>> import shapely
    >>> import szlib
    >>> from laboratory import find_admissible_controls
    >>> controller = szlib.MPCCBF(szlib.Ellipse((0.1, 0.0), (1.0, 0.7)))
    >>> step = controller.step((-2.5, 0.0, 0.2, 0.0), (4.0, 0.0), [szlib.Person((0.0, 0.0))])
    >>> found = find_admissible_controls(step)
    >>> found.polygon.distance(shapely.Point(step.control)) < 1e-3
    True
    """
    s, u0, x = step.scene.settings, step.control, step.predicted
    free = shapely.box(-s.a_max, -s.a_max, s.a_max, s.a_max)
    corner = np.abs(u0 - x[1:, 2:] / s.dt) + s.a_max  # from the centre of the disc to the farthest one
    for velocity in x[1:, 2:][np.hypot(*corner.T) > s.v_max / s.dt]:
        disc = shapely.Point(u0 - velocity / s.dt).buffer(s.v_max / s.dt, quad_segs=256)
        free = free.intersection(disc)
    polygon, limits = free, []
    kinds = (g.kind for g in step.scene.barriers.groups for _ in g.offsets)
    for i, kind in enumerate(kinds):
        for condition in list_conditions(s, kind, has_floors=s.decay_price < inf):
            for k, (curve, inward) in enumerate(_find_edges(step, i, condition.keep)):
                outer = curve[::-1] + 2 * _REACH * s.a_max * inward
                allowed = shapely.Polygon(np.vstack([curve, outer]))
                if not allowed.covers(free):
                    limits.append(BarrierLimit(i, k, curve, condition.level))
                    polygon = polygon.intersection(allowed)
    return AdmissibleControls(polygon, tuple(limits))


def _find_edges(step: szlib.Step, i: int, keep: tuple[float, ...]) -> list[tuple[Array, Array]]:
    """The edge of each row of the obstacle `i`, and the direction to its allowed side."""
    s, u0, n = step.scene.settings, step.control, len(keep)
    only = Obstacles.of(step.scene.barriers.items[i : i + 1], s)
    reach = _REACH * s.a_max
    nudges = 1e-3 * s.a_max * np.array([(1, 0), (-1, 0), (0, 1), (0, -1)])
    at = np.broadcast_to(u0 + nudges, (n, 4, 2))
    right, left, up, down = np.moveaxis(_find_residuals(step, only, keep, at), -1, 0)
    inward = np.stack([right - left, up - down], axis=-1)
    steepest = np.hypot(inward[:, :1], inward[:, 1:])
    inward = np.where(steepest > 0, inward / np.where(steepest > 0, steepest, 1.0), (1.0, 0.0))
    across = np.stack([inward[:, 1], -inward[:, 0]], axis=-1)
    along = u0 + np.linspace(-reach, reach, _POINTS)[:, None] * across[:, None, :]
    low, high = np.full((n, _POINTS), -reach), np.full((n, _POINTS), reach)
    farthest = along - reach * inward[:, None, :]
    high = np.where(_find_residuals(step, only, keep, farthest) >= 0, low, high)  # far from the obstacle
    while (high - low).max() > _PRECISION:
        middle = (low + high) / 2
        edges = along + middle[..., None] * inward[:, None, :]
        obeys = _find_residuals(step, only, keep, edges) >= 0
        low, high = np.where(obeys, low, middle), np.where(obeys, middle, high)
    edges = along + high[..., None] * inward[:, None, :]
    return list(zip(edges, inward, strict=True))


def _find_residuals(step: szlib.Step, only: Obstacles, keep: tuple[float, ...], first: Array) -> Array:
    """Residuals of n rows of the one obstacle in `only` for other first controls, (n, m, 2) to (n, m)."""
    s, n = step.scene.settings, len(keep)
    times = np.array(s.times[: n + 1])[:, None]
    moved, found = s.dt * np.maximum(times - s.dt / 2, 0)[..., None], list[Array]()
    for rows in (slice(n), slice(1, n + 1)):
        at = step.predicted[rows, None, :2] + moved[rows] * (first - step.control)
        found.append(only.h(at[..., 0], at[..., 1], times[rows])[0])
    return np.asarray(found[1] - np.array(keep)[:, None] * found[0])


def plot_admissible_controls(step: szlib.Step, *, ax: Axes | None = None) -> Axes:
    """Plot all first accelerations that obey every constraint of a step, and the chosen one.

    The rest of the plan stays as it is. Each line is the limit from one obstacle, hatched where it
    forbids; of several limits the one that forbids most is drawn.

    Parameters
    ----------
    step : result of a controller's `step`.
    ax : axes to draw on; None makes new ones.

    Examples
    --------
    >>> import szlib
    >>> from laboratory import plot_admissible_controls
    >>> controller = szlib.MPCCBF(szlib.Ellipse((0.1, 0.0), (1.0, 0.7)))
    >>> step = controller.step((0, 0, 0.5, 0), (6, 0), [szlib.Person((3.0, 0.5), (-1.0, 0.0))])
    >>> plot_admissible_controls(step).get_xlabel()
    'a_x [m/s²]'
    """
    ax, a_max = figures.get_axes(ax, size=(5, 4.6)), step.scene.settings.a_max
    found, reach = find_admissible_controls(step), 1.25 * a_max
    if not found.polygon.is_empty:
        green = {"facecolor": figures.GREEN, "alpha": 0.45, "label": "allowed"}
        ax.add_patch(patch_from_polygon(found.polygon, **green))
    bounds = Rectangle((-a_max, -a_max), 2 * a_max, 2 * a_max, fill=False, edgecolor=figures.GREY, lw=1)
    ax.add_patch(bounds).set_label("bound of the acceleration")
    for limit, forbidden in _strictest_limits(found.limits, reach):
        number = limit.row - len(step.scene.people)
        colour, line = (figures.RED, "-") if number < 0 else (figures.BLACK, _LINES[number % len(_LINES)])
        name = f"{step.scene.name(limit.row).partition(' (')[0]}, step {limit.k} to {limit.k + 1}"
        ax.plot(*limit.curve.T, linestyle=line, color=colour, linewidth=1.8, label=name)
        if not forbidden.is_empty:
            style = {"fill": False, "hatch": "///", "edgecolor": colour, "lw": 0, "alpha": 0.35}
            ax.add_patch(patch_from_polygon(forbidden, **style))
    cross = (-reach, reach, np.nan, 0, 0), (0, 0, np.nan, -reach, reach)
    ax.plot(*cross, color=figures.GREY, linewidth=0.6)
    star: Any = {"markersize": 15, "markeredgecolor": figures.BLACK, "label": "chosen"}
    ax.plot(*step.control, "*", color=figures.BLUE, **star)
    ax.set(xlabel="a_x [m/s²]", ylabel="a_y [m/s²]", xlim=(-reach, reach), ylim=(-reach, reach))
    allowed = "No acceleration is allowed" if found.polygon.is_empty else "Green: the accelerations allowed"
    ax.set(aspect="equal", title=allowed)
    figures.add_legend_below(ax, gap=0.16)
    return ax


def _strictest_limits(limits: tuple[BarrierLimit, ...], reach: float) -> list[tuple[BarrierLimit, Any]]:
    """The limit of each obstacle that forbids most of the figure, and the part that it forbids."""
    box = shapely.box(-reach, -reach, reach, reach)
    strictest: dict[int, tuple[BarrierLimit, Any]] = {}
    for limit in limits:
        forbidden, source = limit.forbidden.intersection(box), limit.row
        if source not in strictest or forbidden.area > strictest[source][1].area:
            strictest[source] = limit, forbidden
    return list(strictest.values())


def draw_step(step: szlib.Step) -> Figure:
    """Draw the scene of a `step` beside the accelerations that it allows, in two squares of one size.

    Examples
    --------
    >>> import szlib
    >>> from laboratory import draw_step
    >>> controller = szlib.MPCCBF(szlib.Ellipse((0.1, 0.0), (1.0, 0.7)))
    >>> step = controller.step((0, 0, 0.5, 0), (6, 0), [szlib.Person((3.0, 0.5), (-1.0, 0.0))])
    >>> len(draw_step(step).axes)
    2
    """
    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 5), layout="constrained")
    plots.plot_step(step, ax=left)
    plot_admissible_controls(step, ax=right)
    return figure
