"""The paper's chain of methods and ours, with each difference alone: the table of notebook 11."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
from studies.paper_claims import count_claims, drive

from szlib import SCENARIOS, Ellipse, MPCSettings

Chain = tuple[Ellipse, MPCSettings]
"""What decides a run of a scenario: the zone, and the settings of the controller."""
RESOLUTION = {"time_to_goal": 0.25, "min_h": 0.02, "min_speed": 0.05}
"""Changes of a run up to these count as none in `compare_chains` [s, m, m/s] (assumed)."""


def compare_chains(paper: Chain, ours: Chain, *, names: Iterable[str] = tuple(SCENARIOS)) -> pd.DataFrame:
    """Drive the paper's scenarios with the paper's chain, with each of our differences alone, and with ours.

    Parameters
    ----------
    paper : the zone of `SocialZone.fit(method="paper")`, and `MPCSettings.paper()`.
    ours : our zone and settings.
    names : names of the scenarios.

    Returns
    -------
    One row for each scenario and chain: "paper", "zone", "margin", "side rule" and "ours", with
    time_to_goal [s], min_h [m], min_speed [m/s], passing_side, claims_held, claims (how many hold, of how
    many), and changed: whether the run differs from the paper's by more than `RESOLUTION`, in its side, or in
    its claims.
    """
    (paper_zone, settings), (zone, own) = paper, ours
    chains = {
        "paper": paper,
        "zone": (zone, settings),
        "margin": (paper_zone, replace(settings, margin=own.margin)),
        "side rule": (paper_zone, replace(settings, head_on_share=own.head_on_share)),
        "ours": ours,
    }
    rows = []
    for name in names:
        runs = [
            {"scenario": name, "chain": chain, **drive_chain(name, *parts)} for chain, parts in chains.items()
        ]
        rows += [row | {"changed": differs(row, runs[0])} for row in runs]
    return pd.DataFrame(rows)


def drive_chain(name: str, zone: Ellipse, settings: MPCSettings) -> dict[str, Any]:
    """A run of a scenario in numbers, and how many of the paper's claims hold."""
    run = drive(SCENARIOS[name], zone, settings)
    metrics, (held, claims) = run.metrics(), count_claims(run)
    shown = {column: metrics[column] for column in (*RESOLUTION, "passing_side")}
    return {**shown, "claims_held": held, "claims": claims}


def differs(row: Mapping[str, Any], other: Mapping[str, Any]) -> bool:
    """Whether two runs of one scenario differ; runs that both do not arrive take equally long."""
    if any(row[name] != other[name] for name in ("passing_side", "claims_held")):
        return True
    a, b = (np.array([each[name] for name in RESOLUTION]) for each in (row, other))
    is_same = (np.abs(a - b) <= list(RESOLUTION.values())) | (np.isnan(a) & np.isnan(b))
    return not is_same.all()


def describe_change(found: pd.DataFrame, chain: str, name: str) -> str:
    """What a `chain` changes in the scenario `name`; `found`: `compare_chains`, indexed by chain and scenario.

    Numbers that change by more than `RESOLUTION`, the side, and the claims that hold; a dash for none.
    """
    old, new = found.loc[("paper", name)], found.loc[(chain, name)]
    if not new["changed"]:
        return "-"
    units = {"time_to_goal": "to goal {:.1f} to {:.1f} s", "min_h": "least h {:.2f} to {:.2f} m"}
    units["min_speed"] = "slowest {:.2f} to {:.2f} m/s"
    parts = [
        text.format(old[key], new[key])
        for key, text in units.items()
        if not abs(new[key] - old[key]) <= RESOLUTION[key]
    ]
    parts += [
        f"{label} {old[key]} to {new[key]}"
        for key, label in {"passing_side": "side", "claims_held": "claims that hold"}.items()
        if old[key] != new[key]
    ]
    return "; ".join(parts)
