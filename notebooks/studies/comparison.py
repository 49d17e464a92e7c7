"""Zones, formulations and surprises in the same worlds: the tables of notebook 13.

    python -m studies.comparison 50    13_comparison.csv, 13_paired.csv   (worlds)

Everybody has the zone `REFERENCE`, that of the plaza rounded to a centimetre.
"""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
import pandas as pd
from studies.committed import write_table

from szlib.simulation import comparisons
from szlib.simulation.atlas import REFERENCE
from szlib.simulation.comparisons import BEHAVIOURS, FORMULATIONS, WORLDS

RIVAL = {"zone": "equal circle"}
"""The method against which zones are compared world by world."""
OF_ZONE = replace(WORLDS, zone=REFERENCE)


def recompute(row: pd.Series) -> dict[str, float]:
    """The first world of a row, again, without a time limit: the same on every machine."""
    settings = replace(FORMULATIONS[row["formulation"]], time_limit=np.inf)
    method = {"zones": [row["zone"]], "behaviours": [row["behaviour"]]}
    rows = comparisons.compare(
        1, **method, formulations={row["formulation"]: settings}, worlds=OF_ZONE, progress=False
    )
    return {"first": rows[row["metric"]].iloc[0]}


def recompute_paired(row: pd.Series) -> dict[str, float]:
    """The first world of a row less that of its rival, again."""
    own, rival = (recompute(each)["first"] for each in (row, pd.Series({**row, **RIVAL})))
    return {"first": float(own) - float(rival)}


if __name__ == "__main__":
    worlds = int(sys.argv[1])
    rows = comparisons.compare(worlds, worlds=OF_ZONE)
    surprises = [name for name in BEHAVIOURS if name != "as expected"]
    wrong = comparisons.compare(worlds, zones=["fitted"], behaviours=surprises, worlds=OF_ZONE)
    write_table(comparisons.summarise(pd.concat([rows, wrong])), "13_comparison")
    write_table(comparisons.summarise(rows, against=RIVAL), "13_paired")
