"""The sensitivity atlas: the paper's scenarios with other widths, paces, zones and gamma.

    python -m studies.atlas    27_atlas.csv

One cell of the atlas is one run.  `AtlasCell` names all that changes; the rest is as in the paper's scenario.  The table has a
row for each run with the zone `REFERENCE`; 1,384 runs, four minutes on one core.  Notebook 27 drives a part of it anew and
holds it against the table.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from itertools import product
from typing import Any

import joblib
import numpy as np
import pandas as pd
from studies.committed import study, write_table

from szlib.control.mpc import MPCCBF
from szlib.control.settings import MPCSettings
from szlib.core.checks import require
from szlib.core.errors import SolverError
from szlib.core.parallel import run_tasks
from szlib.simulation.catalogue import SCENARIOS
from szlib.simulation.closed_loop import simulate
from szlib.simulation.log import SimulationLog
from szlib.simulation.metrics import classify_strategy
from szlib.simulation.scenario import Scenario
from szlib.zones.ellipses import Ellipse

SCENES = {"corridor": 4.6, "waiting": 2.0, "making_room": 2.0}
"""Scenarios with walls, by name, and the width between the walls in the paper's scenario [m]."""
REFERENCE = Ellipse((0.03, 0.0), (0.97, 0.75))
"""Zone of the saved atlas: that of the synthetic plaza at 1.1 m/s, rounded to a centimetre."""
# Strategy of a cell whose start violates a barrier: the space is too narrow for the robot alone.
CANNOT_START = "cannot start"


@dataclass(frozen=True)
class AtlasCell:
    """One cell: a scenario of `SCENES` with these changes.

    Parameters
    ----------
    scene : "corridor", "waiting" or "making_room".
    gamma : as in `MPCSettings`.
    width : width of the corridor or the pathway, between its walls [m].
    pace : speed of the person [m/s].
    size : factor of the zone's centre and semi-axes.

    Raises
    ------
    SolverError : the scene is unknown, or a width, pace or size is not positive.
    """

    scene: str
    gamma: float = 0.05
    width: float = 4.6
    pace: float = 0.5
    size: float = 1.0

    def __post_init__(self) -> None:
        require(self.scene in SCENES, "scene", self.scene, f"one of {', '.join(SCENES)}", SolverError)
        for name in ("width", "pace", "size"):
            value = getattr(self, name)
            require(value > 0, name, value, "a positive number", SolverError)

    def scenario(self) -> Scenario:
        """The scenario with this width and pace; the side walls of a pathway keep their outer ends."""
        scene, half_width = SCENARIOS[self.scene], SCENES[self.scene] / 2
        walls = scene.walls.copy()
        is_inner = np.isclose(np.abs(walls[..., 1]), half_width)
        walls[..., 1] = np.where(is_inner, np.sign(walls[..., 1]) * self.width / 2, walls[..., 1])
        people = tuple(replace(person, velocity=(-self.pace, 0.0)) for person in scene.people)
        return replace(scene, walls=walls, people=people)

    def controller(self, zone: Ellipse) -> MPCCBF:
        """The controller of this cell; `zone` is the zone of size 1."""
        # With a time limit the result would depend on the load of the machine.
        settings = MPCSettings(gamma=self.gamma, time_limit=np.inf)
        return MPCCBF(zone.scaled(self.size), walls=self.scenario().walls, settings=settings)

    def run(self, zone: Ellipse) -> SimulationLog:
        """The run of this cell; `zone` is the zone of size 1.

        Raises
        ------
        SolverError : the start violates a barrier.
        """
        return simulate(self.scenario(), self.controller(zone))


@study("27_atlas", notebook="27", has_probe=False)
def run_atlas(cells: Sequence[AtlasCell], zone: Ellipse, *, n_jobs: int = 1) -> pd.DataFrame:
    """Run each cell of an atlas.

    Parameters
    ----------
    cells : the cells.
    zone : the zone of size 1.
    n_jobs : runs at a time; -1: one for each core.

    Returns
    -------
    One row for each cell, in their order: its parameters; strategy (see `classify_strategy`, or
    `CANNOT_START`); time_to_goal, time_yielding [s], min_h [m], min_speed [m/s], infeasible_steps.
    """
    tasks = [joblib.delayed(_run_cell)(i, cell, zone) for i, cell in enumerate(cells)]
    rows = dict(run_tasks(tasks, n_jobs=n_jobs))
    return pd.DataFrame([rows[i] for i in range(len(rows))])


def _run_cell(i: int, cell: AtlasCell, zone: Ellipse) -> tuple[int, dict[str, Any]]:
    shown = ("time_to_goal", "time_yielding", "min_h", "min_speed", "infeasible_steps")
    scenario = cell.scenario()
    if cell.controller(zone).barriers(scenario.start[:2], scenario.people).min() < 0:
        return i, asdict(cell) | {"strategy": CANNOT_START} | dict.fromkeys(shown, np.nan)
    log = cell.run(zone)
    metrics = log.metrics()
    return i, asdict(cell) | {"strategy": classify_strategy(log)} | {name: metrics[name] for name in shown}


PACES, SIZES = (0.3, 0.5, 0.8), (0.5, 0.75, 1.0, 1.25)
CELLS = [
    AtlasCell("corridor", *rest)
    for rest in product(
        (0.02, 0.03, 0.05, 0.07, 0.1, 0.15, 0.2), (3.0, 3.4, 3.8, 4.2, 4.6, 5.4, 6.4), (*PACES, 1.1), SIZES
    )
] + [
    AtlasCell(*rest)
    for rest in product(
        ("waiting", "making_room"),
        (0.03, 0.05, 0.07, 0.1, 0.2),
        (1.4, 1.7, 2.0, 2.5, 3.0),
        PACES,
        SIZES,
    )
]


if __name__ == "__main__":
    atlas = run_atlas(CELLS, REFERENCE, n_jobs=1)
    write_table(atlas.round({"min_h": 4, "min_speed": 4}), "27_atlas")
