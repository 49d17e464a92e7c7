"""A sensitivity atlas: the paper's scenarios with other widths, paces, zones and gamma, and what comes of it.

One cell of the atlas is one run.  All that is changed stands in `AtlasCell`; the rest is as in `paper`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import joblib
import numpy as np
import pandas as pd

from ..control.mpc import MPCCBF
from ..control.settings import MPCSettings
from ..errors import SolverError
from ..parallel import run_tasks
from ..zones.ellipses import Ellipse
from .closed_loop import simulate
from .log import SimulationLog
from .scenario import Scenario
from .scenarios.paper import SCENARIOS
from .strategies import classify_strategy

SCENES = {"corridor": 4.6, "waiting": 2.0, "making_room": 2.0}
"""Scenarios with walls, by name, and the width that is theirs [m]."""
REFERENCE = Ellipse((0.03, 0.0), (0.97, 0.75))
"""The zone of the saved atlas: that of the synthetic plaza at 1.1 m/s, rounded to a centimetre."""


@dataclass(frozen=True)
class AtlasCell:
    """One cell: a scene of `SCENES`, with what is changed in it.

    Parameters
    ----------
    scene : "corridor", "waiting" or "making_room".
    gamma : as in `MPCSettings`.
    width : of the corridor or the pathway, between its walls [m].
    pace : the person's speed [m/s].
    size : the zone's centre and semi-axes are so many times as far and as long.

    Raises
    ------
    SolverError : the scene is none of these, or a width, pace or size is not positive.
    """

    scene: str
    gamma: float = 0.05
    width: float = 4.6
    pace: float = 0.5
    size: float = 1.0

    def __post_init__(self) -> None:
        if self.scene not in SCENES:
            raise SolverError(f"scene must be one of {', '.join(SCENES)}; got {self.scene!r}")
        for name in ("width", "pace", "size"):
            if not getattr(self, name) > 0:
                raise SolverError(f"{name} must be a positive number; got {getattr(self, name)!r}")

    def scenario(self) -> Scenario:
        """The scene with this width and pace; the side walls of a pathway end where they did."""
        scene, half = SCENARIOS[self.scene], SCENES[self.scene] / 2
        walls = scene.walls.copy()
        near = np.isclose(np.abs(walls[..., 1]), half)
        walls[..., 1] = np.where(near, np.sign(walls[..., 1]) * self.width / 2, walls[..., 1])
        people = tuple(replace(person, velocity=(-self.pace, 0.0)) for person in scene.people)
        return replace(scene, walls=walls, people=people)

    def controller(self, zone: Ellipse) -> MPCCBF:
        """The controller of this cell, for a zone of size 1."""
        # A time limit would make what happens depend on how busy the machine is.
        settings = MPCSettings(gamma=self.gamma, time_limit=np.inf)
        return MPCCBF(zone.scaled(self.size), walls=self.scenario().walls, settings=settings)

    def run(self, zone: Ellipse) -> SimulationLog:
        """The run of this cell, for a zone of size 1; SolverError where it starts in violation."""
        return simulate(self.scenario(), self.controller(zone))


NO_START = "cannot start"
"""The outcome of a cell that starts in violation: the place is too narrow for the robot alone."""


def run_atlas(cells: Sequence[AtlasCell], zone: Ellipse, *, n_jobs: int = 1) -> pd.DataFrame:
    """What the robot does in each cell: a row each, in their order.

    Columns: those of `AtlasCell`; strategy, as of `classify_strategy`, or `NO_START`; time_to_goal,
    time_yielding [s], min_h [m], min_speed [m/s], infeasible_steps.
    """
    tasks = [joblib.delayed(_row)(i, cell, zone) for i, cell in enumerate(cells)]
    rows = sorted(run_tasks(tasks, n_jobs=n_jobs), key=lambda row: row[0])
    return pd.DataFrame([row for _, row in rows])


def _row(i: int, cell: AtlasCell, zone: Ellipse) -> tuple[int, dict[str, Any]]:
    shown = ("time_to_goal", "time_yielding", "min_h", "min_speed", "infeasible_steps")
    scenario = cell.scenario()
    if cell.controller(zone).barriers(scenario.start[:2], scenario.people).min() < 0:
        return i, asdict(cell) | {"strategy": NO_START} | dict.fromkeys(shown, np.nan)
    log = cell.run(zone)
    found = log.metrics()
    return i, asdict(cell) | {"strategy": classify_strategy(log)} | {name: found[name] for name in shown}
