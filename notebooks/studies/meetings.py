"""Eleven meetings, four controllers: the tables of notebook 26.

    python -m studies.meetings 12    26_meetings.csv, 26_meetings_paired.csv   (variations)

Everybody has the zone `REFERENCE`, that of the plaza rounded to a centimetre.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import pandas as pd
from studies.atlas import REFERENCE
from studies.committed import write_table

import szlib
from szlib.simulation.comparisons import CONTROLLERS, summarise
from szlib.simulation.monte_carlo import rollouts
from szlib.simulation.scenarios.meetings import Variations, VisiblePeople
from szlib.simulation.social_metrics import compute_social_metrics

METRICS = ["success", "time_to_goal", "path_efficiency", "heading_changes", "time_not_moving"]
METRICS += ["closest_person", "intimate", "personal", "social", "robot_on_person", "person_on_robot"]
METRICS += ["min_h", "min_clearance", "violations", "flagged_steps", "unflagged_violations"]
BY, RIVAL = ["meeting", "controller"], {"controller": "MPC-CBF"}
METHODS = {
    **{name: (name, szlib.MPCSettings()) for name in CONTROLLERS},
    "MPC-CBF, bolder": ("MPC-CBF", szlib.MPCSettings(gamma=0.2, N=24, N_h=24)),
    "MPC-CBF, N = 24 alone": ("MPC-CBF", szlib.MPCSettings(N=24)),
    "MPC-CBF, among people": ("MPC-CBF", szlib.MPCSettings.among_people()),
}
"""Controllers and their settings, by name: szlib's defaults, two changes of them, and those among people."""


def meet(
    method: str,
    zone: szlib.Ellipse,
    variations: int,
    *,
    meetings: Iterable[str] = tuple(szlib.MEETINGS),
    time_limit: float | None = None,
    **more: object,
) -> pd.DataFrame:
    """Drive one of `METHODS` through the variations of meetings; one row each. `more`: as of `rollouts`."""
    controller, settings = METHODS[method]
    tables = []
    for name in meetings:
        rows = rollouts(
            variations,
            settings=settings if time_limit is None else replace(settings, time_limit=time_limit),
            worlds=Variations(szlib.MEETINGS[name], zone),
            behaviour=VisiblePeople(),
            controller=CONTROLLERS[controller],
            measure=compute_social_metrics,
            **more,
        )
        tables.append(rows.assign(meeting=name, controller=method))
    return pd.concat(tables)


def recompute(row: pd.Series) -> dict[str, float]:
    """The first variation of a row, again, without a time limit: the same on every machine."""
    again = {"meetings": [row["meeting"]], "time_limit": np.inf, "progress": False}
    return {"first": meet(row["controller"], REFERENCE, 1, **again)[row["metric"]].iloc[0]}


def recompute_paired(row: pd.Series) -> dict[str, float]:
    """The first variation of a row less that of its rival, again."""
    own, rival = (recompute(each)["first"] for each in (row, pd.Series({**row, **RIVAL})))
    return {"first": float(own) - float(rival)}


if __name__ == "__main__":
    everything = pd.concat([meet(name, REFERENCE, int(sys.argv[1])) for name in METHODS])
    write_table(summarise(everything, BY, METRICS), "26_meetings")
    write_table(summarise(everything, BY, METRICS, against=RIVAL), "26_meetings_paired")
