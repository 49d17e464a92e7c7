"""Figures of barriers: a distance, where it is wrong, and what the barriers leave to a step."""

from __future__ import annotations

from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle
from numpy.typing import ArrayLike
from shapely.plotting import patch_from_polygon

from ...checks import Array
from ...control.acceleration_polygon import Limit, admissible
from ...control.barriers import barrier, check_wall, ellipse_distance, segment_distance
from ...control.distances import (
    euclidean_to_ellipse,
    euclidean_to_segment,
    overestimate,
    required_margin,
    safe_edge,
)
from ...control.step import Step
from ...zones.ellipses import Ellipse
from .style import BLACK, BLUE, GREEN, GREY, RED, get_axes, label_metres

_DASHES = ("--", ":", "-.", (0, (5, 1, 1, 1, 1, 1)))
"""Of walls 0, 1, 2, 3, and so on again."""
_NEAR = 0.9
"""Farther away it does not matter where a distance is wrong [m]."""


def plot_distance(
    of: Ellipse | tuple[Array, Array], *, extent: float = 2.5, margin: float = 0.55, ax: Axes | None = None
) -> Axes:
    """Level lines of the paper's approximate distance to an ellipse, or to a segment given by its ends.

    `margin` [m] draws where h = 0 for a robot of that radius (margin included).
    """
    ax = get_axes(ax, size=(5.5, 4.5))
    x, y = np.meshgrid(np.linspace(-extent, extent, 241), np.linspace(-extent, extent, 241))
    grid = np.stack([x, y], axis=-1)
    if isinstance(of, Ellipse):
        distance, outline, name = ellipse_distance(grid, of), of.curve(), "the zone"
    else:
        distance, outline, name = segment_distance(grid, *of), np.array(of), "the wall"
    levels = [d for d in np.arange(-0.5, 3, 0.25).tolist() if abs(d) > 0.1 and abs(d - margin) > 0.1]
    lines = ax.contour(x, y, distance, levels=levels, cmap="viridis", linewidths=0.8)
    ray = np.linspace(0, extent, 500)[:, None] * (0.6, -0.8)
    along = ellipse_distance(ray, of) if isinstance(of, Ellipse) else segment_distance(ray, *of)
    crossed = [d for d in levels if max(0, along.min()) < d < along.max()]
    at = [tuple(ray[np.abs(along - d).argmin()].tolist()) for d in crossed]
    ax.clabel(lines, fmt="%.2f", fontsize=7, manual=at)
    ax.contour(x, y, barrier(distance, margin, 0.0), levels=[0.0], colors=[RED], linewidths=2)
    ax.plot(*outline.T, color=BLACK, linewidth=2, label=f"{name}, d = 0")
    ax.plot([], [], color=RED, linewidth=2, label=f"h = 0, d = {margin:g} m")
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.13), ncols=2, fontsize=8)
    return label_metres(ax, f"Distance to {name} [m], and h = 0")


def plot_distance_error(
    of: Ellipse | ArrayLike, *, r_robot: float, eps: float, extent: float = 2.0, ax: Axes | None = None
) -> Axes:
    """Approximate less Euclidean distance [cm] near a zone or a wall, and h = 0 with two margins.

    Dotted: where the robot's disc touches, in Euclidean distance.  An h = 0 inside of it is a collision.
    """
    ax = get_axes(ax, size=(5.5, 4.5))
    ticks = np.linspace(-extent, extent, 321)
    x, y = np.meshgrid(ticks, ticks)
    grid = np.stack([x, y], axis=-1)
    if isinstance(of, Ellipse):
        true = euclidean_to_ellipse(grid, of)
    else:
        true = euclidean_to_segment(grid, *check_wall(of))
    error = np.ma.masked_where((true < 0) | (true > _NEAR), 100 * overestimate(grid, of))
    image = ax.pcolormesh(x, y, error, cmap="RdBu_r", vmin=-25, vmax=25, rasterized=True)
    ax.figure.colorbar(image, ax=ax, shrink=0.85, label="d - Euclidean [cm], red is dangerous")
    outline = of.curve() if isinstance(of, Ellipse) else check_wall(of)
    ax.plot(*outline.T, color=BLACK, linewidth=3)
    needed = max(eps, required_margin(of, r_robot))
    for margin, line in ((eps, "-"), (needed, "--")):
        edge = safe_edge(of, r_robot + margin)
        label = f"h = 0, eps = {100 * margin:.0f} cm"
        ax.plot(*np.vstack([edge, edge[:1]]).T, line, color=BLACK, linewidth=1.8, label=label)
        if needed == eps:
            break
    ax.contour(x, y, true, levels=[r_robot], colors=[BLACK], linestyles=[":"], linewidths=1.8)
    ax.plot([], [], ":", color=BLACK, label="the robot's disc touches")
    ax.set(xlim=(-extent, extent), ylim=(-extent, extent))
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.13), fontsize=8, ncols=2)
    return label_metres(ax, "Where the distance is wrong")


def plot_admissible_controls(step: Step, *, ax: Axes | None = None) -> Axes:
    """All accelerations that obey every row of a step, the rest of its plan kept, with the one it chose.

    What is coloured is allowed; each line is the edge of what one person or wall allows, hatched where it
    forbids: that of the row which takes most.
    """
    ax, a_max = get_axes(ax, size=(5, 4.6)), step.scene.settings.a_max
    found, reach = admissible(step), 1.25 * step.scene.settings.a_max
    if not found.polygon.is_empty:
        ax.add_patch(patch_from_polygon(found.polygon, facecolor=GREEN, alpha=0.45, label="allowed"))
    box = Rectangle((-a_max, -a_max), 2 * a_max, 2 * a_max, fill=False, edgecolor=GREY, lw=1)
    ax.add_patch(box).set_label("bound of the acceleration")
    for limit in _tightest(found.limits, reach):
        colour, line = (RED, "-") if limit.kind == "person" else (BLACK, _DASHES[limit.which % len(_DASHES)])
        name = f"{limit.kind} {limit.which}, step {limit.k} to {limit.k + 1}"
        ax.plot(*limit.curve.T, linestyle=line, color=colour, linewidth=1.8, label=name)
        side = _forbidden(limit, reach).intersection(shapely.box(-reach, -reach, reach, reach))
        if not side.is_empty:
            patch = patch_from_polygon(side, fill=False, hatch="///", edgecolor=colour, lw=0, alpha=0.35)
            ax.add_patch(patch)
    ax.axhline(0, color=GREY, linewidth=0.6)
    ax.axvline(0, color=GREY, linewidth=0.6)
    ax.plot(*step.control, "*", color=BLUE, markersize=15, markeredgecolor=BLACK, label="chosen")
    ax.set(xlabel="a_x [m/s²]", ylabel="a_y [m/s²]", xlim=(-reach, reach), ylim=(-reach, reach))
    ax.set_aspect("equal")
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=2, fontsize=8)
    return ax


def _forbidden(limit: Limit, reach: float) -> shapely.Polygon:
    """What lies on the right of a limit, as far as is drawn."""
    (x0, y0), (x1, y1) = limit.curve[0], limit.curve[-1]
    right = np.array([y1 - y0, x0 - x1]) / np.hypot(x1 - x0, y1 - y0)
    return shapely.Polygon(np.vstack([limit.curve, limit.curve[::-1] + 4 * reach * right]))


def _tightest(limits: tuple[Limit, ...], reach: float) -> list[Limit]:
    """Of each person and wall the limit that forbids most of what is drawn."""
    box, tightest = shapely.box(-reach, -reach, reach, reach), dict[tuple[str, int], tuple[float, Limit]]()
    for limit in limits:
        taken, of = float(_forbidden(limit, reach).intersection(box).area), (limit.kind, limit.which)
        if taken > tightest.get(of, (-1.0,))[0]:
            tightest[of] = taken, limit
    return [limit for _, limit in tightest.values()]


def draw_step(step: Step) -> Figure:
    """What a step was asked, beside the accelerations among which it could choose."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 5), layout="constrained")
    plot_step(step, ax=left)
    plot_admissible_controls(step, ax=right)
    return figure


def plot_step(step: Step, *, ax: Axes | None = None) -> Axes:
    """What a step was asked, and its plan: the robot, zones, walls near by, velocities."""
    ax, scene = get_axes(ax, size=(5, 4.6)), step.scene
    x, y, vx, vy = scene.state
    ax.add_patch(Circle((x, y), scene.settings.r_robot, color=BLUE, alpha=0.45, lw=0, label="robot"))
    zones = []
    arrow: dict[str, Any] = {"angles": "xy", "scale_units": "xy", "scale": 1, "width": 0.008, "zorder": 3}
    ax.quiver(x, y, vx, vy, color=BLUE, **arrow)
    ax.plot(*step.predicted[:, :2].T, ".-", color=GREEN, markersize=4, linewidth=1, label="plan")
    for person, zone in zip(scene.people, scene.kept, strict=True):
        (px, py), heading = person.position, person.heading or 0.0
        curve = zone.placed((px, py), heading).curve()
        zones += ax.plot(*curve.T, color=RED, linewidth=1.8, label="zone")
        ax.plot(px, py, marker=(3, 0, np.degrees(heading) - 90), color=RED, markersize=7)
        ax.quiver(px, py, *person.velocity, color=RED, **arrow)
    for j, (xa, ya, xb, yb) in enumerate(scene.walls):
        ax.plot((xa, xb), (ya, yb), color=BLACK, linewidth=3, solid_capstyle="round", label="wall")
        wall = shapely.LineString([(xa, ya), (xb, yb)])
        beside = np.clip(wall.project(shapely.Point(x, y)), 0.6, max(0.6, wall.length - 0.6))
        near = wall.interpolate(beside)
        ax.text(near.x, near.y, f" wall {j}", fontsize=8, va="bottom", clip_on=True)
    seen = [np.add((x, y), [(-1.5, -1.5), (1.5, 1.5)]), *(line.get_xydata() for line in zones)]
    low, high = np.min(np.vstack(seen), axis=0) - 0.2, np.max(np.vstack(seen), axis=0) + 0.2
    ax.plot(*zip((x, y), step.target, strict=True), ":", color=BLUE, label="way to where it is drawn")
    ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    handles, names = ax.get_legend_handles_labels()
    first = {name: handle for handle, name in reversed(list(zip(handles, names, strict=True)))}
    ax.legend(
        first.values(), first.keys(), loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=3, fontsize=8
    )
    return label_metres(ax, f"least h = {step.h.min(initial=np.inf):.2f} m, speed {np.hypot(vx, vy):.2f} m/s")
