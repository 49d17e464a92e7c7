"""The style that all figures share: colours, sizes, labels in metres."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from matplotlib.path import Path

from ...encounters.geometry import Area

BLUE, ORANGE, GREEN, RED, GREY, BLACK = "#0072B2", "#E69F00", "#009E73", "#D55E00", "#999999", "#000000"

SEQUENCE = "viridis"


def get_axes(ax: Axes | None, *, size: tuple[float, float] = (6.0, 4.5)) -> Axes:
    """The axes given, or those of a new figure of that size [inch]."""
    return plt.subplots(figsize=size, layout="constrained")[1] if ax is None else ax


def label_metres(ax: Axes, title: str = "", *, person: bool = False) -> Axes:
    """Label both axes in metres with equal aspect; of the world, or of a person who walks to the right."""
    ax.set(xlabel="x, ahead [m]" if person else "x [m]", ylabel="y, to the left [m]" if person else "y [m]")
    if title:
        ax.set_title(title)
    ax.set_aspect("equal")
    return ax


def area_patch(area: Area, **style: Any) -> PathPatch:
    """The borders of an area, pillars included, as one patch."""
    rings = [Path(ring, closed=True) for ring in area.outlines]
    return PathPatch(Path.make_compound_path(*rings), fill=False, **style)


def pick_colours(values: Sequence[Any]) -> list[Any]:
    """One colour of the sequence for each value, dark to light, leaving out the palest."""
    return list(plt.get_cmap(SEQUENCE)(np.linspace(0, 0.85, len(values))))


def alt_text(figure: Figure) -> str:
    """What a figure shows, for who cannot see it: titles, what is over what, and the names in legends."""
    told = []
    for ax in figure.axes:
        across, up, legend = ax.get_xlabel(), ax.get_ylabel(), ax.get_legend()
        names = [text.get_text() for text in legend.get_texts()] if legend else []
        axes = f"{up} over {across}" if up and across else up or across
        parts = [ax.get_title(), axes, f"with {', '.join(names)}" if names else ""]
        told.append(": ".join(part for part in parts[:2] if part) + (f", {parts[2]}" if parts[2] else ""))
    title = figure.get_suptitle()
    return " ".join("; ".join(([title] if title else []) + [part for part in told if part]).split())
