"""Scenes to drive through.

paper     the four scenarios of the paper: `SCENARIOS`
meetings  eleven meetings after Francis et al. (2025): `MEETINGS`
worlds    random worlds, each from its seed
atlas     the paper's scenarios stretched, and what the robot does in them: `chart`
"""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach(
    __name__,
    submodules=["paper", "meetings", "worlds", "atlas"],
    submod_attrs={
        "atlas": ["Cell", "chart"],
        "paper": ["SCENARIOS"],
        "meetings": ["MEETINGS", "InSight", "Variations"],
        "worlds": ["ONE_PERSON", "Worlds", "random_zone", "world"],
    },
)
