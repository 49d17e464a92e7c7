"""Scenes to drive through.

paper   the four scenarios of the paper: `SCENARIOS`
worlds  random worlds, each from its seed
"""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach(
    __name__,
    submodules=["paper", "worlds"],
    submod_attrs={"paper": ["SCENARIOS"], "worlds": ["ONE_PERSON", "Worlds", "random_zone", "world"]},
)
