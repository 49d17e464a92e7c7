"""Plazas with a known zone: how near the respect zone and the quantile come, and whether intervals hold the truth.

python -m studies.plazas      25_plazas.csv

The table goes to notebooks/tables.  People are seen for 20 s, so that a time-shifted crowd has encounters
enough; positions have 5 cm of noise, and intruders any speed.  Errors on the plaza of 150 pairs are computed
again in each run of notebook 25.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import warnings
from collections.abc import Iterator
from functools import partial
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd
from studies import quantile_zone
from studies.committed import NULL_MODELS, read_arguments, study, write_table
from studies.respect import stored

import szlib
from szlib.encounters.null_model import MINUTES
from szlib.plaza import ANY_SPEED_INTRUDERS

SPEED = 1.1
CLEARANCES, CENTRES = (0.1, 0.2, 0.4), (0.0, 0.1, 0.2)
SMALL = (150, 0.02, 0.1, 0.1)
CASES = [
    *product((600,), (0.02,), CLEARANCES, CENTRES),
    *product((600,), (0.0,), (0.1,), CENTRES),
    *product((2600,), (0.02,), CLEARANCES, (0.1,)),
    (2600, 0.0, 0.1, 0.1),
    (16_000, 0.02, 0.1, 0.1),
    SMALL,
]
"""Pairs of people, share of intruders, mean clearance [m], centre of the zone ahead of the person [m]."""
PLAZAS = {150: 1, 600: 2, 2600: 2, 16_000: 1}
SHIFTS = {150: 20, 600: 20, 2600: 5, 16_000: 2}
"""By pairs of people: plazas of a case, and shifts of the null model, two encounters for each of the data."""
FIRST_SEED = 3000
"""The model error of `szlib.zones.respect` was measured on plazas of the seeds from 2000 on."""


def main() -> None:
    asked = read_arguments(__doc__, cache=NULL_MODELS)
    table = pd.DataFrame(row for case in CASES for row in describe_case(case, asked))
    write_table(table, "25_plazas")
    print(table.to_string())


def describe_case(
    case: tuple[int, float, float, float], asked: argparse.Namespace | None = None
) -> Iterator[dict[str, object]]:
    """One row an estimator and a quantity: mean and largest error, width of the interval, share that holds."""
    pairs, intruders, clearance, centre = case
    plazas, found = PLAZAS[pairs], []
    for seed in range(FIRST_SEED, FIRST_SEED + plazas):
        find = partial(find_both, case, seed)
        samples, null = find() if asked is None else stored(asked, f"plaza-{case}-{seed}", find)
        found += compare(samples, null, build(case).true_zone(SPEED))
    names = {
        "pairs": pairs,
        "intruders": intruders,
        "clearance": clearance,
        "centre": centre,
        "plazas": plazas,
    }
    groups = pd.DataFrame(found).groupby(["method", "quantity"], sort=False)
    rows = groups.agg(
        bias=("error", "mean"),
        worst=("error", lambda e: e.abs().max()),
        width=("width", "mean"),
        held=("held", "mean"),
    ).reset_index()
    print(names, pd.DataFrame(found).round(4).to_string(), file=sys.stderr, flush=True)
    for row in rows.to_dict("records"):
        yield names | row


def build(case: tuple[int, float, float, float]) -> szlib.PlazaSettings:
    """The plaza of a case."""
    pairs, intruders, clearance, centre = case
    return szlib.PlazaSettings(
        n_encounters=pairs,
        tracked=20.0,
        noise=0.05,
        intruders=intruders,
        intruder_speeds=ANY_SPEED_INTRUDERS,
        clearance=clearance,
        slow_zone=szlib.Ellipse((centre, 0.0), (0.88, 0.68)),
        fast_zone=szlib.Ellipse((centre, 0.0), (1.0, 0.78)),
    )


def find_both(case: tuple[int, float, float, float], seed: int) -> tuple[pd.DataFrame, szlib.NullEncounters]:
    """Samples of a plaza and its null model."""
    with tempfile.TemporaryDirectory() as folder:
        plaza = szlib.make_plaza(Path(folder) / "plaza.csv", seed=seed, settings=build(case))
        tracks = szlib.read_tracks(plaza)
    minutes = (0.2, 3.0) if case[0] < 2000 else MINUTES
    options = {"shifts": SHIFTS[case[0]], "minutes": minutes, "seed": seed, "progress": False}
    return szlib.find_encounters(tracks), szlib.null_encounters(tracks, **options)


def compare(
    samples: pd.DataFrame, null: szlib.NullEncounters, truth: szlib.Ellipse, **more: object
) -> Iterator[dict[str, object]]:
    """Error, width of the interval, and whether it holds the truth, by estimator and quantity.

    `more`: as of `SocialZone.fit`; without resamples there is no interval.
    """
    true = dict(zip(("center_x", "a", "b"), (truth.center[0], *truth.semi_axes), strict=True))
    for method in ("respect", quantile_zone.NAME):
        options = {"null": null} if method == "respect" else {}
        with warnings.catch_warnings(action="ignore", category=szlib.DataWarning):
            zone = szlib.SocialZone.fit(samples, method=method, speeds=(SPEED,), **options, **more)
        row = zone.table().iloc[0]
        for name, value in true.items():
            low, high = (row.get(f"{name}_{end}", np.nan) for end in ("low", "high"))
            found = {"error": row[name] - value, "width": high - low, "held": float(low <= value <= high)}
            yield {"method": method, "quantity": name} | found


@study("25_plazas", notebook="25")
def recompute(row: pd.Series) -> dict[str, object]:
    """The error of a row of the smallest plaza, again, without its interval, which takes 10 s."""
    truth, asked = build(SMALL).true_zone(SPEED), (row["method"], row["quantity"])
    rows = compare(*find_both(SMALL, FIRST_SEED), truth, n_resamples=0)
    error = next(each["error"] for each in rows if (each["method"], each["quantity"]) == asked)
    return {"bias": error, "worst": abs(float(error))}


if __name__ == "__main__":
    main()
