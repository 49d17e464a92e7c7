"""Every figure: `plot_*` draws on the axes it is given, or on new ones, and returns them.

style        colours, sizes, labels in metres
tracks       where people were, how fast, and what became of the rows
encounters   the attentional space and the other person
zones        outliers, the hull, zones by speed
control      distances and barriers, and what they leave to a step
players      runs with controls, in a browser
simulation   runs of the robot, and their animations
comparisons  many runs: sweeps, manners, intervals side by side
crowds       robots among other people's crowds
"""

from .comparisons import interval_grid, legend_below, plot_intervals, plot_manners, plot_sweep
from .control import plot_admissible, plot_distance, plot_overestimate, plot_step, step_panels
from .crowds import plot_crowd, plot_promises
from .encounters import plot_encounter_paths, plot_los, plot_los_distance, plot_space
from .players import Movie
from .simulation import animate, plot_barriers, plot_robot_paths, plot_scenario, plot_speed, run_grid
from .style import BLACK, BLUE, GREEN, GREY, ORANGE, RED, SEQUENCE, axes, colours, in_words, metres, outline
from .tracks import plot_funnel, plot_map, plot_speeds
from .zones import (
    plot_by_number,
    plot_findings,
    plot_hull,
    plot_outliers,
    plot_pair_correlation,
    plot_tornado,
    plot_zone,
    plot_zones,
)

__all__ = [
    "BLACK",
    "BLUE",
    "GREEN",
    "GREY",
    "ORANGE",
    "RED",
    "SEQUENCE",
    "Movie",
    "animate",
    "axes",
    "colours",
    "in_words",
    "interval_grid",
    "legend_below",
    "metres",
    "outline",
    "plot_admissible",
    "plot_barriers",
    "plot_by_number",
    "plot_crowd",
    "plot_distance",
    "plot_encounter_paths",
    "plot_findings",
    "plot_funnel",
    "plot_hull",
    "plot_intervals",
    "plot_los",
    "plot_los_distance",
    "plot_manners",
    "plot_map",
    "plot_outliers",
    "plot_overestimate",
    "plot_pair_correlation",
    "plot_promises",
    "plot_robot_paths",
    "plot_scenario",
    "plot_space",
    "plot_speed",
    "plot_speeds",
    "plot_step",
    "plot_sweep",
    "plot_tornado",
    "plot_zone",
    "plot_zones",
    "run_grid",
    "step_panels",
]
