"""A run made by hand, whose metrics and claims are known."""

from __future__ import annotations

import numpy as np

import szlib
from szlib.simulation.log import SimulationLog

CIRCLE = szlib.Ellipse((0.0, 0.0), (0.7, 0.7))


def make_log(
    scenario: szlib.Scenario,
    states: np.ndarray,
    people: np.ndarray,
    *,
    zone: szlib.Ellipse = CIRCLE,
    residual: float | np.ndarray = 1.0,
    **given: object,
) -> SimulationLog:
    """The log of these states (n, 4) among people (n, P, 5), each with the `zone`; dt is 0.1 s.

    Every step is safe and takes no time, and no condition binds, unless an array is `given`.
    """
    n = len(states)
    rows = people.shape[1] + len(scenario.walls)
    steps = {
        "controls": np.zeros((n, 2)),
        "predicted": np.zeros((n, 0, 4)),
        "residual": np.full((n, rows, 2), residual),
        "status": np.full(n, "optimal"),
        "safe": np.ones(n, bool),
        "slack": np.zeros(n),
        "solve_time": np.zeros(n),
        "stuck": np.zeros(n),
        "arrival": None,
    }
    zones = (zone,) * people.shape[1]
    settings = szlib.MPCSettings()
    return SimulationLog(
        scenario, settings, zones, states, people=people, **steps | given
    )
