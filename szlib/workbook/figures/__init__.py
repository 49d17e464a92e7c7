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

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach(
    __name__,
    submodules=[
        "style",
        "tracks",
        "encounters",
        "zones",
        "control",
        "players",
        "simulation",
        "comparisons",
        "crowds",
    ],
    submod_attrs={
        "tracks": ["plot_map", "plot_speeds", "plot_funnel"],
        "encounters": ["plot_space", "plot_encounter_paths", "plot_los", "plot_los_distance"],
        "zones": [
            "plot_outliers",
            "plot_hull",
            "plot_zone",
            "plot_zones",
            "plot_pair_correlation",
            "plot_by_number",
            "plot_tornado",
            "plot_findings",
        ],
        "control": ["plot_distance", "plot_overestimate", "plot_admissible", "plot_step", "step_panels"],
        "players": ["Movie"],
        "simulation": [
            "plot_scenario",
            "plot_speed",
            "plot_barriers",
            "plot_robot_paths",
            "run_grid",
            "animate",
        ],
        "comparisons": ["plot_sweep", "plot_manners", "plot_intervals", "interval_grid", "legend_below"],
        "crowds": ["plot_crowd", "plot_promises"],
        "style": [
            "BLUE",
            "ORANGE",
            "GREEN",
            "RED",
            "GREY",
            "BLACK",
            "SEQUENCE",
            "axes",
            "metres",
            "outline",
            "colours",
            "in_words",
        ],
    },
)
