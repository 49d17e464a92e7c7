"""The controller among people under attack: whole runs in random worlds and in crowds, by other formulas.

A step that claims to be safe must not lead to h < 0 of a person who keeps their velocity, nor to an overlap,
also between samples: see `controller`.
"""

from collections import Counter

import numpy as np
from controller import attack_worlds

import szlib
from szlib.simulation.scenario import Worlds

WORLDS = {False: 4, True: 20_000}
CROWDS = {False: 1, True: 2_000}
FIRST_WORLD = 77_000_000
CROWDED = Worlds(
    people=(6, 10),
    standing=0.2,
    pace=(0.3, 1.2),
    walls=0.3,
    size=8.0,
    travel=(5.0, 8.0),
)


def attack(long: bool) -> Counter[str]:
    tally: Counter[str] = Counter()
    settings = szlib.MPCSettings.among_people(time_limit=np.inf)
    seeds = range(FIRST_WORLD, FIRST_WORLD + WORLDS[long])
    attack_worlds(seeds, tally, settings=settings)
    crowds: Counter[str] = Counter()
    attack_worlds(
        range(seeds.stop, seeds.stop + CROWDS[long]),
        crowds,
        settings=settings,
        worlds=CROWDED,
    )
    for what, count in crowds.items():
        tally[
            what if what.startswith("broken") else what.replace("worlds", "crowds")
        ] += count
    return tally
