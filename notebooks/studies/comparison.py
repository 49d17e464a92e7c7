"""Zones, formulations and surprises in the same worlds: the tables of notebook 23.

    python -m studies.comparison 50    23_comparison.csv, 23_paired.csv   (worlds)

Everybody has the zone `REFERENCE`, that of the plaza rounded to a centimetre.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
from studies import summaries
from studies.atlas import REFERENCE
from studies.committed import study, write_table
from studies.literature_zones import compare

from szlib.simulation.monte_carlo import BEHAVIOURS, FORMULATIONS, WORLDS

RIVAL = {"zone": "equal circle"}
"""The method against which zones are compared world by world."""
OF_ZONE = replace(WORLDS, zone=REFERENCE)
PROBE = 3
"""The world that is driven again in each run of notebook 23: barriers bind there, and the zones differ."""


@study("23_comparison", notebook="23")
def recompute(row: pd.Series) -> dict[str, float]:
    """The world `PROBE` of a row, again, without a time limit: the same on every machine."""
    settings = replace(FORMULATIONS[row["formulation"]], time_limit=np.inf)
    method = {"zones": [row["zone"]], "behaviours": [row["behaviour"]]}
    rows = compare(
        1, seed=PROBE, **method, formulations={row["formulation"]: settings}, worlds=OF_ZONE, progress=False
    )
    return {"probe": rows[row["metric"]].iloc[0]}


@study("23_paired", notebook="23")
def recompute_paired(row: pd.Series) -> dict[str, float]:
    """The world `PROBE` of a row less that of its rival, again."""
    own, rival = (recompute(each)["probe"] for each in (row, pd.Series({**row, **RIVAL})))
    return {"probe": float(own) - float(rival)}


def summarise(rows: pd.DataFrame, **options: Any) -> pd.DataFrame:
    """Means over worlds, and the world `PROBE`; options as of `summaries.summarise`."""
    probe = summaries.summarise(rows[rows["seed"] == PROBE], **options)["mean"]
    return summaries.summarise(rows, **options).drop(columns="first").assign(probe=probe)


if __name__ == "__main__":
    worlds = int(sys.argv[1])
    rows = compare(worlds, worlds=OF_ZONE)
    surprises = [name for name in BEHAVIOURS if name != "as expected"]
    wrong = compare(worlds, zones=["fitted"], behaviours=surprises, worlds=OF_ZONE)
    write_table(summarise(pd.concat([rows, wrong])), "23_comparison")
    write_table(summarise(rows, against=RIVAL), "23_paired")
