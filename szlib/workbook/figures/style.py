"""The style that all figures share: colours, sizes, labels in metres."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import PathPatch
from matplotlib.path import Path

from ...encounters.geometry import Area

BLUE, ORANGE, GREEN, RED, GREY, BLACK = "#0072B2", "#E69F00", "#009E73", "#D55E00", "#999999", "#000000"

SEQUENCE = "viridis"


def axes(ax: Axes | None, *, size: tuple[float, float] = (6.0, 4.5)) -> Axes:
    """The axes given, or those of a new figure of that size [inch]."""
    return plt.subplots(figsize=size, layout="constrained")[1] if ax is None else ax


def metres(ax: Axes, title: str = "", *, person: bool = False) -> Axes:
    """Label both axes in metres with equal aspect; of the world, or of a person who walks to the right."""
    ax.set(xlabel="x, ahead [m]" if person else "x [m]", ylabel="y, to the left [m]" if person else "y [m]")
    if title:
        ax.set_title(title)
    ax.set_aspect("equal")
    return ax


def outline(area: Area, **style: Any) -> PathPatch:
    """The borders of an area, pillars included, as one patch."""
    rings = [Path(ring, closed=True) for ring in area.outlines]
    return PathPatch(Path.make_compound_path(*rings), fill=False, **style)


def colours(values: Sequence[Any]) -> list[Any]:
    """One colour of the sequence for each value, dark to light, leaving out the palest."""
    return list(plt.get_cmap(SEQUENCE)(np.linspace(0, 0.85, len(values))))
