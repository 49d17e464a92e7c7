"""Figures of the notebooks; those that szlib itself draws are in `szlib.workbook.figures`.

comparisons  many runs or fits: sweeps, strategies, intervals, claims, sites (notebooks 06, 21, 23, 25, 27, 29)
control      a distance, a plan, a step, and its ways (notebooks 07, 08, 12, the laboratory)
encounters   paths, and where the other person is (notebook 02)
simulation   paths of several runs, crowds (notebooks 09, 12, 26, 29)
tracks       where people walked, speeds, and the rows that each stage keeps (notebooks 01, 24)
zones        outliers, the hull, the reach by direction (notebooks 03, 04, 05)
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
from .control import draw_limit, draw_moment, draw_plans, plot_distance, plot_step, plot_ways
from .encounters import (
    draw_space_and_paths,
    plot_distance_by_direction,
    plot_encounter_paths,
    plot_relative_positions,
    reference_frame,
)
from .simulation import draw_crowds, plot_crowd, plot_robot_paths
from .tracks import draw_map_and_speeds, plot_funnel, plot_map, plot_speed_histogram
from .zones import draw_hull_and_zones, draw_outliers, draw_zone_and_reach, plot_hull
