"""Meetings with several controllers: the tables of notebook 26.

    python -m studies.meetings 12    26_meetings.csv, 26_meetings_paired.csv   (variations)

Everybody has the zone `REFERENCE`, that of the plaza rounded to a centimetre.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable
from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from studies.atlas import REFERENCE
from studies.committed import study, write_table
from studies.social_metrics import compute_social_metrics
from studies.summaries import summarise

import szlib
from szlib.simulation.baseline_controllers import CONTROLLERS
from szlib.simulation.crowds import VisiblePeople
from szlib.simulation.monte_carlo import RolloutSetup, rollouts
from szlib.simulation.scenario import Variations
from szlib.workbook import figures

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
            RolloutSetup(
                worlds=Variations(szlib.MEETINGS[name], zone),
                behaviour=VisiblePeople(),
                controller=CONTROLLERS[controller],
                measure=compute_social_metrics,
            ),
            settings=settings if time_limit is None else replace(settings, time_limit=time_limit),
            **more,
        )
        tables.append(rows.assign(meeting=name, controller=method))
    return pd.concat(tables)


@study("26_meetings", notebook="26")
def recompute(row: pd.Series) -> dict[str, float]:
    """The first variation of a row, again, without a time limit: the same on every machine."""
    again = {"meetings": [row["meeting"]], "time_limit": np.inf, "progress": False}
    return {"first": meet(row["controller"], REFERENCE, 1, **again)[row["metric"]].iloc[0]}


@study("26_meetings_paired", notebook="26")
def recompute_paired(row: pd.Series) -> dict[str, float]:
    """The first variation of a row less that of its rival, again."""
    own, rival = (recompute(each)["first"] for each in (row, pd.Series({**row, **RIVAL})))
    return {"first": float(own) - float(rival)}


OUTCOMES = {
    "arrives, enters no zone": (figures.GREEN, "o", "full"),
    "enters a zone (h < 0)": (figures.ORANGE, "^", "full"),
    "does not always arrive": (figures.BLACK, "s", "none"),
    "body touches body": (figures.RED, "X", "full"),
}
"""What happens in the variations of a meeting, the worst last: colour, marker and its fill."""


def find_outcomes(table: pd.DataFrame) -> pd.DataFrame:
    """The worst outcome of a `table` as of 26_meetings.csv, and the time to the goal [s]; one row for each pair."""
    means = table.pivot_table("mean", ["meeting", "controller"], "metric", sort=False, dropna=False)
    has_contact = means["robot_on_person"] + means["person_on_robot"] > 0
    worst = [has_contact, means["success"] < 1, means["violations"] > 0]
    names = list(OUTCOMES)
    outcome = np.select(worst, names[:0:-1], names[0])
    return means[["success", "time_to_goal"]].assign(outcome=outcome).dropna(subset="success").reset_index()


def draw_outcomes(outcomes: pd.DataFrame) -> Figure:
    """Draw one symbol and the time to the goal for each meeting and controller of `find_outcomes`."""
    meetings, controllers = (list(dict.fromkeys(outcomes[name])) for name in BY)
    figure, ax = plt.subplots(figsize=(10, 4.2), layout="constrained")
    for row in outcomes.to_dict("records"):
        at = controllers.index(row["controller"]), meetings.index(row["meeting"])
        colour, marker, fill = OUTCOMES[row["outcome"]]
        ax.plot(at[0] - 0.25, at[1], marker, color=colour, markersize=8, fillstyle=fill)
        arrives = f"arrives in {row['success']:.0%}" if row["success"] < 1 else f"{row['time_to_goal']:.0f} s"
        ax.text(at[0] - 0.13, at[1], arrives, va="center", fontsize=9)
    for name, (colour, marker, fill) in OUTCOMES.items():
        ax.plot([], [], marker, color=colour, markersize=8, fillstyle=fill, label=name)
    ax.set_xticks(range(len(controllers)), controllers)
    ax.set_yticks(range(len(meetings)), meetings)
    ax.set(xlim=(-0.5, len(controllers) - 0.4), ylim=(len(meetings) - 0.5, -0.5))
    ax.xaxis.tick_top()
    ax.tick_params(length=0)
    figures.add_shared_legend([ax])
    return figure


if __name__ == "__main__":
    everything = pd.concat([meet(name, REFERENCE, int(sys.argv[1])) for name in METHODS])
    write_table(summarise(everything, BY, METRICS).round(9), "26_meetings")
    paired = summarise(everything, BY, METRICS, against=RIVAL)
    write_table(paired.round(9), "26_meetings_paired")
