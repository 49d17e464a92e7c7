"""szlib: social zones from pedestrian tracks, and a robot that keeps out of them."""

import lazy_loader as lazy

__version__ = "0.1.0"

__getattr__, __dir__, __all__ = lazy.attach(
    __name__,
    submodules=[
        "barriers",
        "comparisons",
        "datasets",
        "distances",
        "ellipses",
        "encounters",
        "errors",
        "funnels",
        "hulls",
        "montecarlo",
        "mpc",
        "outliers",
        "plaza",
        "plotting",
        "readers",
        "runs",
        "scenarios",
        "tracks",
        "workbook",
        "worlds",
        "zones",
    ],
    submod_attrs={
        "barriers": ["ellipse_distance", "segment_distance"],
        "ellipses": ["Ellipse", "minimum_enclosing_ellipse"],
        "encounters": ["ATC_SQUARE", "AttentionalSpace", "Square", "find_encounters"],
        "errors": ["DataError", "DataWarning", "SolverError", "SzlibError", "ZoneError"],
        "mpc": ["MPCCBF", "MPCSettings", "Person", "Step"],
        "montecarlo": ["rollouts"],
        "outliers": ["remove_outliers"],
        "scenarios": ["SCENARIOS", "Scenario", "simulate"],
        "tracks": ["read_tracks"],
        "zones": ["SocialZone"],
    },
)
