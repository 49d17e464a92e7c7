"""szlib: social zones from pedestrian tracks, and a robot that keeps out of them."""

import lazy_loader as lazy

__version__ = "0.1.0"

__getattr__, __dir__, __all__ = lazy.attach(
    __name__,
    submodules=[
        "control",
        "encounters",
        "errors",
        "files",
        "memory",
        "parallel",
        "plaza",
        "simulation",
        "tracks",
        "workbook",
        "zones",
    ],
    submod_attrs={
        "control.barriers": ["ellipse_distance", "segment_distance"],
        "control.mpc": ["MPCCBF", "Step"],
        "control.people.person": ["Person"],
        "control.people.tracker": ["Tracker"],
        "control.settings": ["MPCSettings"],
        "encounters.days": ["Extraction", "extract_days"],
        "encounters.areas": ["as_area", "walked_area"],
        "encounters.geometry": ["ATC_SQUARE", "AttentionalSpace", "Region", "Square"],
        "encounters.kinds": ["encounter_kinds", "of_kind"],
        "encounters.null": ["NullEncounters", "null_encounters"],
        "encounters.search": ["find_encounters"],
        "encounters.shifting": ["time_shifted"],
        "errors": ["DataError", "DataWarning", "SolverError", "SzlibError", "ZoneError"],
        "plaza.indifferent": ["indifferent_crowd"],
        "plaza.people": ["make_plaza"],
        "plaza.truth": ["PlazaSettings"],
        "simulation.closed_loop": ["simulate"],
        "simulation.log": ["SimulationLog"],
        "simulation.rollouts": ["rollouts"],
        "simulation.scenario": ["Scenario"],
        "simulation.scenarios.paper": ["SCENARIOS"],
        "tracks.clock": ["read_tracks"],
        "zones.ellipses": ["Ellipse", "minimum_enclosing_ellipse"],
        "zones.outliers": ["remove_outliers"],
        "zones.respect.boundary": ["Respect", "fit_respect", "respect_boundary", "respect_radius"],
        "zones.respect.presence": ["PairCorrelation", "Presence", "pair_correlation"],
        "zones.respect.significance": ["NullTest", "null_test"],
        "zones.social_zone": ["SocialZone"],
    },
)
