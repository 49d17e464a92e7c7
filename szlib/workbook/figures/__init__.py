"""Figures that szlib itself draws; those of notebooks are in the package `plots` beside them.

`plot_*` draws on the axes it is given, or on new ones, and returns them.

style        colours, sizes, labels in metres, people, obstacles, legends
zones        zones by speed, with their intervals
simulation   a run over time, and its animation
movies       runs as players in a browser
"""

from .simulation import animate, plot_scenario
from .style import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    RED,
    add_legend_below,
    add_shared_legend,
    alt_text,
    get_axes,
    label_metres,
    pick_colours,
)
from .zones import plot_zone, plot_zones

__all__ = [
    "BLACK",
    "BLUE",
    "GREEN",
    "GREY",
    "ORANGE",
    "RED",
    "add_legend_below",
    "add_shared_legend",
    "alt_text",
    "animate",
    "get_axes",
    "label_metres",
    "pick_colours",
    "plot_scenario",
    "plot_zone",
    "plot_zones",
]
