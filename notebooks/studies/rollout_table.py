"""The table of random worlds, with intervals.

    python -m studies.rollout_table [--blocks 4] [--worlds 500]

Writes notebooks/tables/21_rollouts.csv: a row for each set of worlds and formulation, over blocks of seeds
far apart, each share with its 95 % Clopper-Pearson interval, and the counts of the single blocks. Finished
worlds are kept in results/rollouts, so that a run that was stopped goes on. Half an hour on one core.
"""

from dataclasses import replace
from typing import Any, get_args

import numpy as np
import pandas as pd
from studies.committed import WORLDS, read_arguments, study, write_table

import szlib
from szlib.control.settings import TOLERANCE
from szlib.simulation.metrics import Outcome
from szlib.simulation.monte_carlo import RolloutSetup, rollouts
from szlib.simulation.scenario import ONE_PERSON, Worlds
from szlib.workbook.claims import find_interval

TABLE = "21_rollouts"
APART = 1_000_000
"""Seeds between the first ones of two blocks; block 0 starts at this as well."""
PROBE = 3
"""The world of the first block that is driven again in each run of notebook 21: a barrier binds in every row."""
FORMULATIONS = {
    "paper": szlib.MPCSettings.paper(),
    "szlib": szlib.MPCSettings(),
    "margin = paper": szlib.MPCSettings(margin="paper"),
    "whole horizon": szlib.MPCSettings(N_h=szlib.MPCSettings.N),
    "rest": szlib.MPCSettings(terminal="rest"),
    "gamma = 0.2": szlib.MPCSettings(gamma=0.2),
    "gamma = 0.8": szlib.MPCSettings(gamma=0.8),
}
"""The paper's controller to the letter, szlib's defaults, and the defaults with one change."""
SETS: dict[str, tuple[Worlds, tuple[str, ...]]] = {
    "all": (Worlds(), ("paper", "szlib", "rest", "margin = paper")),
    "one person": (
        ONE_PERSON,
        ("paper", "szlib", "whole horizon", "rest", "gamma = 0.2", "gamma = 0.8"),
    ),
}
"""Worlds, and the formulations that drive in them."""
EVENTS = {"h < 0": "min_h", "overlap wall": "min_clearance_walls", "overlap person": "min_clearance_people"}
"""What may happen in a world, and the column that is negative then."""


def summarise_rollouts(rows: pd.DataFrame) -> dict[str, Any]:
    """Summarise `rows` of `szlib.rollouts`.

    Number of worlds and of steps by what they report, fractions of worlds with h < 0, with Euclidean overlaps
    and with each outcome, smallest h and clearance [m].
    """
    numbers: dict[str, Any] = {"worlds": len(rows)}
    numbers |= {
        name: int(rows[name].sum())
        for name in ("infeasible_steps", "flagged_steps", "unflagged_violations", "unflagged_overlaps")
    }
    numbers |= {
        "share h < 0": float((rows["min_h"] < -TOLERANCE).mean()),
        "min_h": float(rows["min_h"].min()),
        "share overlap wall": float((rows["min_clearance_walls"] < -TOLERANCE).mean()),
        "share overlap person": float((rows["min_clearance_people"] < -TOLERANCE).mean()),
        "min_clearance": float(rows["min_clearance"].min()),
    }
    numbers |= {outcome: float((rows["outcome"] == outcome).mean()) for outcome in get_args(Outcome)}
    return numbers


def row(blocks: list[pd.DataFrame]) -> dict[str, Any]:
    """All blocks in one line."""
    rows = pd.concat(blocks, ignore_index=True)
    line = summarise_rollouts(rows)
    line["worlds of blocks"] = " ".join(str(len(block)) for block in blocks)
    for event, column in EVENTS.items():
        happened = [int((block[column] < -TOLERANCE).sum()) for block in blocks]
        line[f"worlds {event}"] = sum(happened)
        line[f"low {event}"], line[f"high {event}"] = find_interval(sum(happened), len(rows))
        line[f"blocks {event}"] = " ".join(map(str, happened))
    line["largest solve_time [s]"] = float(rows["solve_time_max"].max())
    return line


def probe(worlds: Worlds, formulation: str) -> float:
    """Path and least h in the world `PROBE`, summed [m], without a time limit: the same on every machine."""
    settings = replace(FORMULATIONS[formulation], time_limit=np.inf)
    one = rollouts(
        1, RolloutSetup(worlds=worlds), seed=APART + PROBE, settings=settings, progress=False
    ).iloc[0]
    return float(one["path_length"] + one["min_h"])


@study("21_rollouts", notebook="21")
def recompute(row: pd.Series) -> dict[str, float]:
    return {"probe": probe(SETS[row["set"]][0], row["formulation"])}


def main() -> None:
    given = read_arguments(__doc__, blocks=4, worlds=500, jobs=-1, out=WORLDS)
    tables: dict[tuple[str, str], list[pd.DataFrame]] = {}
    for name, (worlds, formulations) in SETS.items():
        for block in range(given.blocks):
            for formulation in formulations:
                table = rollouts(
                    given.worlds,
                    RolloutSetup(worlds=worlds),
                    seed=(block + 1) * APART,
                    settings=FORMULATIONS[formulation],
                    out=given.out,
                    n_jobs=given.jobs,
                )
                tables.setdefault((name, formulation), []).append(table)
                lines = [
                    {"set": s, "formulation": f, **row(blocks), "probe": probe(SETS[s][0], f)}
                    for (s, f), blocks in tables.items()
                ]
                write_table(pd.DataFrame(lines), TABLE, seed=APART)


if __name__ == "__main__":
    main()
