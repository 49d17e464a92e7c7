"""Figures of zones: outliers, the hull and its slices, ellipses by speed, the pair correlation."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection

from ...zones.ellipses import Ellipse
from .style import (
    BLACK,
    BLUE,
    GREY,
    ORANGE,
    RED,
    add_legend_below,
    draw_person,
    get_axes,
    label_metres,
    pick_colours,
)

FittedZone = Any
"""A `szlib.SocialZone`; it imports this module for its method `plot`, so it cannot be imported here."""


def plot_zone(
    zone: FittedZone,
    speed: float,
    *,
    truth: Ellipse | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Plot a zone's boundary at one speed, its ellipse and the ellipse's interval.

    The title states the verdict on the zone. The ellipse is dashed unless it is usable.

    Parameters
    ----------
    zone : fitted zone.
    speed : walking speed of the person [m/s].
    truth : the true zone, if it is known.
    ax : axes to draw on; None makes new ones.

    Examples
    --------
    >>> import numpy as np, pandas as pd, szlib
    >>> from szlib.workbook import figures
    >>> n, rng = 2000, np.random.default_rng(0)
    >>> samples = pd.DataFrame({"encounter": np.arange(n), "los_angle": rng.uniform(-3.1, 3.1, n)})
    >>> samples["distance"], samples["speed"] = rng.uniform(0.9, 2.5, n), rng.uniform(0.4, 1.6, n)
    >>> zone = szlib.SocialZone.fit(samples, method="hull", speeds=(1.1,), n_resamples=0)
    >>> figures.plot_zone(zone, 1.1).get_title()
    'Minimum social zone at 1.1 m/s: undecided'
    """
    ax = get_axes(ax, size=(5, 4.5))
    verdict = zone.verdict(speed)
    ellipse = zone.ellipses.get(speed) or zone.shape.ellipse(speed)
    is_hull = zone.method in ("hull", "paper")
    if is_hull:
        boundary = zone.boundary(speed).T
        ax.fill(*boundary, facecolor=GREY, alpha=0.4, label="zone: r_max - R'")
    name = "smallest enclosing ellipse" if is_hull else "fitted ellipse"
    line = "-" if verdict == "usable" else "--"
    ax.plot(*ellipse.curve().T, line, color=BLUE, linewidth=2, label=name)
    _draw_interval(ax, zone, speed, color=ORANGE, alpha=0.35, label="its 95 % interval")
    if ellipse.support is not None:
        ax.plot(
            *ellipse.support.T,
            "o",
            color=BLUE,
            label=f"its {len(ellipse.support)} support points",
        )
    if truth is not None:
        ax.plot(*truth.curve().T, ":", color=RED, linewidth=2, label="truth")
    draw_person(ax, 0, 0, 0, color=BLACK, markersize=10)
    add_legend_below(ax, gap=0.15)
    return label_metres(
        ax, f"Minimum social zone at {speed:g} m/s: {verdict}", person=True
    )


def plot_zones(zone: FittedZone, *, ax: Axes | None = None) -> Axes:
    """Plot the ellipses of a fitted zone, and their intervals, by speed (paper, fig. 5).

    The person walks to the right. A dashed ellipse is not usable; the legend states the verdicts.

    Parameters
    ----------
    zone : fitted zone.
    ax : axes to draw on; None makes new ones.
    """
    ax = get_axes(ax, size=(6, 5))
    speeds = sorted(zone.ellipses)
    for speed, colour in zip(speeds, pick_colours(speeds), strict=True):
        verdict = zone.verdict(speed)
        style: Any = {"color": colour, "label": f"{speed:g} m/s ({verdict})"}
        line = "-" if verdict == "usable" else "--"
        ax.plot(*zone.ellipses[speed].curve().T, line, linewidth=2, **style)
        _draw_interval(ax, zone, speed, color=colour, alpha=0.15)
    draw_person(ax, 0, 0, 0, color=BLACK, markersize=10)
    ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=8)
    intervals = " and their 95 % intervals" if zone.uncertainty else ""
    return label_metres(ax, f"Minimum social zones by speed{intervals}", person=True)


def _draw_interval(ax: Axes, zone: FittedZone, speed: float, **style: Any) -> None:
    """Fill the interval of the ellipse's radius, in the directions where both ends are known."""
    bands = None if zone.uncertainty is None else zone.uncertainty.bands
    if bands is None or not (bands["speed"] == speed).any():
        return
    band = bands[bands["speed"] == speed]
    band = pd.concat([band, band.head(1)])
    unit = np.column_stack([np.cos(band["direction"]), np.sin(band["direction"])])
    low, high = (band[end].to_numpy()[:, None] * unit for end in ("low", "high"))
    known = np.isfinite(low + high).all(axis=1)
    quads = np.stack([low[:-1], low[1:], high[1:], high[:-1]], axis=1)[
        known[:-1] & known[1:]
    ]
    ax.add_collection(PolyCollection(list(quads), linewidth=0, **style))
