"""Where the problem has no solution: `python -m studies.feasibility 20` writes 21_feasibility.csv.

Random worlds, the same ones for each gamma, N_h and a_max; the number of worlds is the argument.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable
from itertools import product

import numpy as np
import pandas as pd
from studies.committed import study, write_table

import szlib
from szlib.simulation.monte_carlo import RolloutSetup
from szlib.simulation.scenario import Worlds

CROWD = Worlds(people=(2, 4), size=8.0, travel=(4.0, 8.0), start_speed=0.0, min_h=0.3)
CELLS = tuple(product((0.05, 0.1, 0.2, 0.4, 0.8), (1, 2, 4, 8), (0.5, 1.0, 2.0)))
"""gamma, N_h, a_max [m/s2]."""
FIRST = 3
"""Worlds whose path is computed again in each run of notebook 21."""


def drive_cells(cells: Iterable[tuple[float, int, float]], worlds: int, **more: object) -> pd.DataFrame:
    """One row for each cell; `probe` is the path in the first worlds [m]; `more`: as of `szlib.rollouts`."""
    table = []
    for gamma, N_h, a_max in cells:
        settings = szlib.MPCSettings(gamma=gamma, N_h=N_h, a_max=a_max, time_limit=np.inf)
        rows = szlib.rollouts(worlds, RolloutSetup(worlds=CROWD), settings=settings, **more)
        row = {"gamma": gamma, "N_h": N_h, "a_max": a_max, "worlds": worlds}
        row |= {"infeasible_steps": rows["infeasible_steps"].mean(), "min_h": rows["min_h"].min()}
        row |= {"unflagged_violations": rows["unflagged_violations"].sum()}
        table.append(row | {"probe": rows["path_length"].iloc[:FIRST].sum()})
    return pd.DataFrame(table)


@study("21_feasibility", notebook="21")
def recompute(row: pd.Series) -> dict[str, float]:
    """The path in the first worlds of a cell, again."""
    again = drive_cells([(row["gamma"], int(row["N_h"]), row["a_max"])], FIRST, progress=False)
    return {"probe": again["probe"].iloc[0]}


if __name__ == "__main__":
    write_table(drive_cells(CELLS, int(sys.argv[1]), progress=False), "21_feasibility")
