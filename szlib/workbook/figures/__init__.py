"""Every figure of the workbook.

`plot_*` draws on the axes it is given, or on new ones, and returns them.  `draw_*` makes a whole figure.

palette      colours
style        sizes, labels in metres, people, legends
tracks       where people walked, how fast, and how many rows each stage keeps
encounters   the attentional space, paths, and where the other person is
zones        outliers, the hull, zones by speed, the pair correlation
control      distances and barriers, the scene of a step, and its ways
simulation   runs of the robot, and their animations
movies       runs as players in a browser
comparisons  many runs or fits: sweeps, strategies, intervals, claims, sites
"""

from .comparisons import (
    draw_claims,
    draw_interval_grid,
    plot_forest,
    plot_safety_claims,
    plot_sensitivity,
    plot_strategies,
    plot_sweep,
    plot_zone_sizes,
)
from .control import (
    plot_distance,
    plot_distance_error,
    plot_step,
    plot_ways,
)
from .encounters import (
    animate_encounter,
    plot_attentional_space,
    plot_distance_by_direction,
    plot_encounter_paths,
    plot_relative_positions,
)
from .palette import BLACK, BLUE, GREEN, GREY, ORANGE, RED, pick_colours
from .simulation import (
    animate,
    plot_barriers,
    plot_crowd,
    plot_robot_paths,
    plot_scenario,
    plot_speed,
)
from .style import add_legend_below, add_shared_legend, alt_text, get_axes, label_metres
from .tracks import plot_funnel, plot_map, plot_speed_histogram
from .zones import (
    plot_hull,
    plot_outliers,
    plot_pair_correlation,
    plot_zone,
    plot_zones,
)
