"""szlib: social zones from pedestrian tracks, and a robot that keeps out of them."""

import lazy_loader as lazy

__version__ = "0.1.0"

__getattr__, __dir__, __all__ = lazy.attach(
    __name__,
    submodules=[
        "barriers",
        "commands",
        "datasets",
        "ellipses",
        "encounters",
        "errors",
        "extraction",
        "funnels",
        "hulls",
        "jobs",
        "loaders",
        "meetings",
        "mpc",
        "nearby",
        "outliers",
        "pages",
        "plaza",
        "plotting",
        "quality",
        "readers",
        "scenarios",
        "scenes",
        "settings",
        "simulation",
        "tracks",
        "truths",
        "workbook",
        "zones",
    ],
    submod_attrs={
        "barriers": ["ellipse_distance", "segment_distance"],
        "ellipses": ["Ellipse", "minimum_enclosing_ellipse"],
        "encounters": ["ATC_SQUARE", "AttentionalSpace", "Square", "find_encounters"],
        "errors": ["DataError", "DataWarning", "SolverError", "SzlibError", "ZoneError"],
        "extraction": ["Extraction", "extract_days"],
        "mpc": ["MPCCBF", "MPCSettings", "Person", "Step"],
        "outliers": ["remove_outliers"],
        "scenarios": ["SCENARIOS", "Scenario", "simulate"],
        "tracks": ["read_tracks"],
        "zones": ["SocialZone"],
    },
)
