"""Scenes to drive through.

paper     the four scenarios of the paper: `SCENARIOS`
meetings  eleven meetings after Francis et al. (2025): `MEETINGS`
worlds    random worlds, each from its seed
"""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach(
    __name__,
    submodules=["paper", "meetings", "worlds"],
    submod_attrs={
        "paper": ["SCENARIOS"],
        "meetings": ["MEETINGS", "InSight", "Variations"],
        "worlds": ["ONE_PERSON", "Worlds", "random_zone", "world"],
    },
)
