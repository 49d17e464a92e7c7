"""Figures of zones: outliers, the hull and its slices, ellipses by speed, respect, what moves a zone."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from itertools import cycle
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.patches import Circle
from mpl_toolkits.mplot3d import Axes3D
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from scipy.spatial import ConvexHull

from ...errors import DataWarning, ZoneError
from ...zones.ellipses import Ellipse
from ...zones.occupancy import PairCorrelation
from ...zones.social_zone import SocialZone
from .style import BLACK, BLUE, GREEN, GREY, ORANGE, RED, get_axes, label_metres, pick_colours

_LINES = ("-", "--", ":", "-.")
_DOTS = 4000
"""About so many samples are drawn around a hull."""


def plot_outliers(
    points: np.ndarray, outlier: np.ndarray, *, r_max: float = 2.0, ax: Axes | None = None
) -> Axes:
    """In- and outliers in the complementary plane; points (n, 2), outlier (n,) (paper, fig. 4a)."""
    ax = get_axes(ax, size=(6, 5))
    ax.plot(
        *points[~outlier].T,
        ".",
        color=GREY,
        markersize=2,
        rasterized=True,
        label=f"{(~outlier).sum():,} inliers",
    )
    ax.plot(*points[outlier].T, "x", color=RED, markersize=7, mew=1.8, label=f"{outlier.sum():,} outliers")
    ax.add_patch(Circle((0, 0), r_max, fill=False, linestyle=":", color=BLACK, label="contact, r = 0"))
    ax.set(xlim=(-1.05 * r_max, 1.05 * r_max), ylim=(-1.05 * r_max, 1.05 * r_max))
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.13), ncols=3, fontsize=8)
    label_metres(ax, "Turned inside out: the nearer, the farther out")
    ax.set(xlabel="x' = (r_max - r) cos LOS [m]", ylabel="y' = (r_max - r) sin LOS [m]")
    return ax


def plot_hull(
    zone: SocialZone,
    speeds: Sequence[float] = (0.7, 0.9, 1.1, 1.3),
    *,
    points: np.ndarray | None = None,
    ax: Any = None,
) -> Axes3D:
    """The hull over (x', y', speed) with its slices (paper, fig. 4b), and the samples, `points` (n, 3)."""
    if zone.vertices is None:
        raise ZoneError(f'a zone of method {zone.method!r} has no hull to draw; fit it with method="hull"')
    if ax is None:
        ax = plt.figure(figsize=(7, 6), layout="constrained").add_subplot(projection="3d")
    hull = ConvexHull(zone.vertices)
    faces = Poly3DCollection(
        zone.vertices[hull.simplices], facecolor=GREY, edgecolor=GREY, alpha=0.12, linewidth=0.3
    )
    ax.add_collection3d(faces)
    if points is not None:
        shown = points[:: max(1, len(points) // _DOTS)]
        ax.plot(*shown.T, ".", color=BLUE, markersize=1.5, alpha=0.35, label=f"{len(shown):,} of the samples")
    for speed, colour, line in zip(speeds, pick_colours(speeds), cycle(_LINES), strict=False):
        corners = zone.slice(speed).polygon
        closed = np.vstack([corners, corners[:1]])
        level = np.full(len(closed), speed)
        ax.plot(*closed.T, level, color=colour, linestyle=line, linewidth=2.5, label=f"{speed:g} m/s")
        right = closed[closed[:, 0].argmax()]
        ax.text(right[0] + 0.15, right[1], speed, f"{speed:g}", color=colour, fontsize=9, weight="bold")
    ax.auto_scale_xyz(*zone.vertices.T)
    ax.set(
        xlabel="x' [m]",
        ylabel="y' [m]",
        zlabel="speed [m/s]",
        title="The hull of the inliers, and its slices by speed",
    )
    ax.legend(loc="upper left", fontsize=8)
    ax.view_init(elev=18, azim=-60)
    return ax


def plot_zone(
    zone: SocialZone, speed: float, *, truth: Ellipse | None = None, ax: Axes | None = None
) -> Axes:
    """The zone's boundary at one speed, its ellipse (dashed: not adequate), and the ellipse's interval."""
    ax = get_axes(ax, size=(5, 4.5))
    ellipse, hull = _ellipse(zone, speed), zone.method == "hull"
    boundary = zone.boundary(speed)
    if hull:
        ax.fill(*boundary.T, facecolor=GREY, alpha=0.4, label="zone: r_max - R'")
    else:
        ax.plot(*boundary.T, color=GREY, linewidth=1.5, label=f"radius by direction ({zone.method})")
    name = "smallest enclosing ellipse" if hull else "fitted ellipse"
    ax.plot(*ellipse.curve().T, color=BLUE, linewidth=2, linestyle=_line(zone, speed), label=name)
    _band(zone, speed, ax, color=ORANGE, alpha=0.35, label="its 95 % interval")
    if ellipse.support is not None:
        ax.plot(*ellipse.support.T, "o", color=BLUE, label=f"its {len(ellipse.support)} support points")
    if truth is not None:
        ax.plot(*truth.curve().T, ":", color=RED, linewidth=2, label="truth")
    ax.plot(0, 0, marker=(3, 0, -90), color=BLACK, markersize=10)
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.15), fontsize=8, ncols=2)
    lacks = "" if zone.adequate(speed) else "\nnot adequate: too few people seen on some side"
    return label_metres(ax, f"Minimum social zone at {speed:g} m/s{lacks}", person=True)


def plot_zones(zones: SocialZone | Mapping[float, Ellipse], *, ax: Axes | None = None) -> Axes:
    """Ellipses by speed around a person who walks to the right (paper, fig. 5).

    Of a `SocialZone` also their intervals, and those that are not adequate are dashed.
    """
    ax = get_axes(ax, size=(6, 5))
    shown = sorted((zones.ellipses if isinstance(zones, SocialZone) else zones).items())
    for (speed, ellipse), colour, line in zip(shown, pick_colours(shown), cycle(_LINES), strict=False):
        label = f"{speed:g} m/s"
        if isinstance(zones, SocialZone):
            line = _line(zones, speed)
            label += "" if zones.adequate(speed) else " (not adequate)"
            _band(zones, speed, ax, color=colour, alpha=0.15)
        ax.plot(*ellipse.curve().T, color=colour, linestyle=line, linewidth=2, label=label)
    angles = np.linspace(np.pi / 6, 11 * np.pi / 6, len(shown))
    for (speed, ellipse), angle, colour in zip(shown, angles.tolist(), pick_colours(shown), strict=True):
        at = ellipse.curve()[round(angle / (2 * np.pi) * (len(ellipse.curve()) - 1))]
        white = {"facecolor": "white", "edgecolor": "none", "pad": 0.6}
        name = ax.annotate(f"{speed:g}", at, ha="center", va="center", bbox=white)
        name.set(color=colour, fontsize=7, weight="bold")
    ax.plot(0, 0, marker=(3, 0, -90), color=BLACK, markersize=10)
    ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=8)
    bands = " and their 95 % intervals" if getattr(zones, "uncertainty", None) else ""
    return label_metres(ax, f"Minimum social zones by speed{bands}", person=True)


def plot_pair_correlation(
    correlation: PairCorrelation, *, radius: float | None = None, ax: Axes | None = None
) -> Axes:
    """How often people were where, over how often the null model was; `radius` [m] of the respect zone."""
    ax = get_axes(ax, size=(6, 4.8))
    turn = np.r_[correlation.direction, correlation.direction[0] + 2 * np.pi]
    g = np.vstack([correlation.g, correlation.g[:1]])
    x, y = (correlation.distance * part(turn)[:, None] for part in (np.cos, np.sin))
    image = ax.pcolormesh(x, y, g, cmap="PuOr", vmin=0, vmax=2, shading="gouraud", rasterized=True)
    ax.figure.colorbar(image, ax=ax, label="g: as often as nobody minds = 1")
    ax.contour(x, y, np.nan_to_num(g, nan=1.0), levels=[0.5], colors=[BLACK], linewidths=1.5)
    ax.plot([], [], color=BLACK, linewidth=1.5, label="g = 1/2")
    if radius is not None:
        circle = Circle((0, 0), radius, fill=False, linestyle="--", color=BLUE, linewidth=2)
        ax.add_patch(circle)
        ax.plot([], [], "--", color=BLUE, label=f"all bearings: {radius:.2f} m")
    ax.plot(0, 0, marker=(3, 0, -90), color=RED, markersize=10)
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.13), ncols=2, fontsize=8)
    return label_metres(ax, person=True)


def plot_zone_sizes(table: pd.DataFrame, columns: Mapping[str, str], *, ax: Axes | None = None) -> Axes:
    """Sizes of zones by the number of encounters, with bands; `columns`: name in `table` -> label.

    `table` has encounters, and for each name its mean, <name>_low and <name>_high [m].
    """
    ax = get_axes(ax, size=(6, 4))
    styles = zip(("-", "--", ":", "-."), ("o", "s", "^", "D"), (RED, BLUE, GREY, GREEN), strict=True)
    for (name, label), (line, marker, colour) in zip(columns.items(), styles, strict=False):
        n = table["encounters"]
        ax.fill_between(n, table[f"{name}_low"], table[f"{name}_high"], color=colour, alpha=0.18, linewidth=0)
        ax.plot(n, table[name], line, marker=marker, color=colour, markersize=4, label=label)
    ax.set(xscale="log", xlabel="encounters", ylabel="size of the zone [m]", ylim=(0, None))
    ax.legend(fontsize=8)
    return ax


def plot_sensitivity(table: pd.DataFrame, *, ax: Axes | None = None) -> Axes:
    """How far each parameter moves the zone's area; `table` as from `zones.sensitivity.sensitivity`."""
    ax = get_axes(ax, size=(8, 4.5))
    usual = float(table["area"].iloc[0])
    varied = table.iloc[1:].dropna(subset=["area"])
    spans = varied.groupby("parameter", sort=False)["area"].agg(
        low=lambda v: min(v.min(), usual), high=lambda v: max(v.max(), usual)
    )
    spans = spans.loc[(spans["high"] - spans["low"]).sort_values().index]
    at = np.arange(len(spans))
    ax.barh(at, spans["high"] - spans["low"], left=spans["low"], color=BLUE, alpha=0.35, height=0.6)
    names = []
    for row, name in zip(at, spans.index, strict=True):
        values = varied[varied["parameter"] == name].sort_values("area")
        ax.plot(values["area"], np.full(len(values), row), "o", color=BLUE, markersize=5)
        names.append(f"{name}\n{'; '.join(map(str, values['value']))}")  # beside the axis: none overlap
    ax.axvline(usual, color=BLACK, linewidth=1.2, label=f"defaults: {usual:.2f} m$^2$")
    ax.set_yticks(at, names, fontsize=8)
    ax.set(xlabel="area of the zone [m$^2$]; values from left to right", ylim=(-0.6, len(spans) - 0.2))
    ax.use_sticky_edges = False
    ax.margins(x=0.1)
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.14), fontsize=8)
    return ax


def plot_claims(table: pd.DataFrame, *, ax: Axes | None = None) -> Axes:
    """Effects with their intervals, one row a finding; `table` as from `paper_claims.findings_table`.

    Each is shown as a share of its own largest end, so that metres and shares stand side by side.
    """
    ax = get_axes(ax, size=(9, 0.45 * len(table) + 1.2))
    styles = {"supported": (GREEN, "o"), "contradicted": (RED, "X"), "not": (GREY, "s")}
    for at, (effect, low, high, verdict) in enumerate(
        table[["effect", "low", "high", "verdict"]].itertuples(index=False)
    ):
        scale = max(abs(low), abs(high), 1e-9)
        colour, marker = styles[verdict.split()[0]]
        ax.hlines(at, low / scale, high / scale, color=colour, linewidth=2)
        ax.plot(effect / scale, at, marker, color=colour)
    ax.axvline(0, color=BLACK, linewidth=1)
    names = table["claim"] + (" (" + table["method"] + ")" if "method" in table else "")
    ax.set_yticks(range(len(table)), list(names), fontsize=8)
    ax.invert_yaxis()
    for name, (colour, marker) in styles.items():
        ax.plot([], [], marker, color=colour, label="not decidable" if name == "not" else name)
    ax.set(xlabel="against the paper < 0 < as the paper says (each scaled to its interval)", xlim=(-1.1, 1.1))
    below = 0.6 / (0.45 * len(table) + 0.4)  # of the axes' height: 0.6 inch
    ax.legend(loc="upper center", bbox_to_anchor=(0.3, -below), ncols=3, fontsize=8)
    return ax


def _ellipse(zone: SocialZone, speed: float) -> Ellipse:
    """The zone's ellipse without the warning: the figure itself says what is not adequate."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DataWarning)
        return zone.ellipse(speed)


def _line(zone: SocialZone, speed: float) -> str:
    return "-" if zone.adequate(speed) else "--"


def _band(zone: SocialZone, speed: float, ax: Axes, **style: Any) -> None:
    """Between low and high of the ellipse's reach, where both are known."""
    bands = None if zone.uncertainty is None else zone.uncertainty.bands
    if bands is None or not (bands["speed"] == speed).any():
        return
    band = bands[bands["speed"] == speed]
    band = pd.concat([band, band.head(1)])
    unit = np.column_stack([np.cos(band["direction"]), np.sin(band["direction"])])
    low, high = (band[end].to_numpy()[:, None] * unit for end in ("low", "high"))
    known = np.isfinite(low).all(axis=1) & np.isfinite(high).all(axis=1)
    both = known[:-1] & known[1:]
    quads = np.stack([low[:-1], low[1:], high[1:], high[:-1]], axis=1)[both]
    label = style.pop("label", None)
    ax.add_collection(
        PolyCollection(list(quads), facecolor=style["color"], alpha=style["alpha"], linewidth=0)
    )
    if label:
        ax.fill([], [], facecolor=style["color"], alpha=style["alpha"], label=label)
