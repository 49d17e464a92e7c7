"""Figures that one or two notebooks use; the figures that all share are in `szlib.workbook.figures`.

comparisons  many runs or fits: sweeps, strategies, intervals, claims, sites (notebooks 06, 21, 23, 25, 27, 29)
control      the error of a distance, and the ways of a step (notebooks 22, 12)
encounters   paths, an encounter in motion, and where the other person is (notebook 02)
tracks       speeds, and the rows that each stage keeps (notebook 24)
zones        outliers, the hull (notebooks 03, 04)
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
from .control import plot_ways
from .encounters import (
    animate_encounter,
    plot_distance_by_direction,
    plot_encounter_paths,
    plot_relative_positions,
    reference_frame,
)
from .tracks import plot_funnel, plot_speed_histogram
from .zones import plot_hull, plot_outliers
