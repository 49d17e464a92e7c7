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
"""

from .control import (
    plot_distance,
    plot_step,
)
from .encounters import (
    plot_attentional_space,
)
from .palette import BLACK, BLUE, GREEN, GREY, ORANGE, RED, pick_colours
from .simulation import (
    animate,
    plot_barriers,
    plot_crowd,
    plot_robot_paths,
    plot_scenario,
)
from .style import add_legend_below, add_shared_legend, alt_text, get_axes, label_metres
from .tracks import plot_map
from .zones import (
    plot_zone,
    plot_zones,
)
