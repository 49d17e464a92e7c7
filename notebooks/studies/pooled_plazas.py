"""Outliers of pooled plazas, for notebook 03: `python -m studies.pooled_plazas` (about half an hour).

Writes notebooks/tables/03_outliers.csv: one row for each share and pace of intruders, family of seeds,
number of plazas pooled, and rule; with what the rule removed, its precision and recall for samples of
intruders, and the largest error of centre and axes over four speeds.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
import pandas as pd
from studies import plaza_truth
from studies.committed import study, write_table
from tqdm import tqdm

import szlib
from szlib.core.errors import ZoneError
from szlib.plaza import precision_and_recall
from szlib.plaza.settings import RUSHING_INTRUDERS, SLOW_INTRUDERS

TABLE = "03_outliers"
RULES: dict[str, dict[str, float | None]] = {
    "encounters": {"fraction": None, "n_neighbours": None},
    "0.2 %, 20 neighbours": {"fraction": 0.002, "n_neighbours": 20},
    "0.2 %, 200 neighbours": {"fraction": 0.002, "n_neighbours": 200},
    "1 %, 200 neighbours": {"fraction": 0.01, "n_neighbours": 200},
}
INTRUDERS = [
    (0.0, "rushing"),
    (0.0025, "rushing"),
    (0.01, "rushing"),
    (0.01, "slow"),
    (0.02, "rushing"),
    (0.02, "slow"),
]
PACES = {"rushing": RUSHING_INTRUDERS, "slow": SLOW_INTRUDERS}
FAMILIES = (0, 100)
POOLED = (1, 3, 5, 6, 8)
HULL = {"method": "hull", "fraction": 0.0, "speeds": plaza_truth.SPEEDS, "n_resamples": 0}
COSTLY = {
    (share, pace, 0, plazas)
    for share, pace in (INTRUDERS[1], INTRUDERS[3], INTRUDERS[5])
    for plazas in (1, 6)
}
"""Where 200 neighbours, two minutes at the paper's size, are tried as well."""


def plaza_samples(seed: int, settings: szlib.PlazaSettings) -> pd.DataFrame:
    """The samples of a plaza, and, in a column `kind`, what each comes from."""
    with tempfile.TemporaryDirectory() as folder:
        file = szlib.make_plaza(Path(folder) / "plaza.csv", seed=seed, settings=settings)
        samples = szlib.find_encounters(szlib.read_tracks(file))
    return samples.assign(kind=plaza_truth.true_kinds(samples, seed=seed, settings=settings))


def pooled(tables: list[pd.DataFrame]) -> pd.DataFrame:
    """The samples of several plazas in one table, their encounters kept apart."""
    count = np.cumsum([0, *(int(table["encounter"].max()) + 1 for table in tables)])
    parts = [table.assign(encounter=table["encounter"] + n) for table, n in zip(tables, count, strict=False)]
    return pd.concat(parts, ignore_index=True)


def judged(
    samples: pd.DataFrame, settings: szlib.PlazaSettings, rule: dict[str, float | None]
) -> dict[str, float]:
    """What a rule does to samples with a column `kind`: share removed, precision, recall, error [m]."""
    close = samples[samples["distance"] <= 2.0].reset_index(drop=True)
    kept = szlib.remove_outliers(close, **rule)
    removed = ~close.index.isin(kept.index)
    precision, recall = precision_and_recall(removed, close["kind"] == "intruder")
    try:
        error = plaza_truth.largest_error(szlib.SocialZone.fit(kept, **HULL), settings)
    except ZoneError:  # nothing is left of the zone
        error = np.nan
    return {"removed": removed.mean(), "precision": precision, "recall": recall, "error": error}


@study("03_outliers", notebook="03")
def recompute(row: pd.Series) -> dict[str, float]:
    """What a rule does to a single plaza, again."""
    settings = szlib.PlazaSettings(intruders=row["intruders"], intruder_speeds=PACES[row["pace"]])
    samples = plaza_samples(int(row["first_seed"]), settings)
    return judged(samples, settings, RULES[row["rule"]])


def main() -> None:
    rows = []
    cases = [(*intruders, family) for intruders in INTRUDERS for family in FAMILIES]
    for share, pace, family in tqdm(cases):
        settings = szlib.PlazaSettings(intruders=share, intruder_speeds=PACES[pace])
        tables = [plaza_samples(family + k, settings) for k in range(max(POOLED))]
        for plazas in POOLED:
            samples = pooled(tables[:plazas])
            case = {"intruders": share, "pace": pace, "first_seed": family, "plazas": plazas}
            case["encounters"] = samples["encounter"].nunique()
            for name, rule in RULES.items():
                if rule["n_neighbours"] != 200 or (share, pace, family, plazas) in COSTLY:
                    rows.append(case | {"rule": name} | judged(samples, settings, rule))
            write_table(pd.DataFrame(rows), TABLE)


if __name__ == "__main__":
    main()
