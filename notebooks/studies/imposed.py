"""Zones imposed on recorded paths: how near estimates come, and how often their intervals hold the truth.

python -m studies.imposed 6      25_imposed.csv

Takes the number of draws of each case.  The table goes to notebooks/tables.  The real data is looked for in
$SZLIB_DATA_DIR (atc-1hz/ and gc/).  The people of a time-shifted crowd get a known zone
(`studies.imposed_zone`); the other shifts are the null model.  Of a row of the site "plaza", `probe`, the error in
the first draw, is computed again in each run of notebook 25.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import warnings
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd
from studies import quantile_zone
from studies.committed import NULL_MODELS, read_arguments, study, write_table
from studies.imposed_zone import PairedSamples
from studies.respect import data_and_null

import szlib

SPEED = 1.1
TRUTHS = {
    "centred": (szlib.Ellipse((0.0, 0.0), (0.8, 0.6)), 0.05),
    "0.10 m ahead": (szlib.Ellipse((0.1, 0.0), (1.0, 0.7)), 0.03),
    "0.20 m ahead": (szlib.Ellipse((0.2, 0.0), (0.95, 0.7)), 0.08),
}
"""The zone, and the share of careless pairs."""
SIZES = {"grand-central": (150, 300, 600, 2400), "atc-1hz": (150, 300), "plaza": (150,)}
"""Numbers of encounters; the zone 0.20 m ahead has 600 alone."""
SHIFTS_DRAWN = {"grand-central": 1, "atc-1hz": 12, "plaza": 4}
"""Shifts that make one crowd."""


def main() -> None:
    asked = read_arguments(__doc__, draws=int, sites=list(SIZES), jobs=1, cache=NULL_MODELS)
    table = pd.DataFrame(coverage(asked))
    write_table(table, "25_imposed")
    print(table.to_string())


def coverage(asked: argparse.Namespace) -> Iterator[dict[str, object]]:
    """One row a site, a truth, a number of encounters, an estimator and a quantity."""
    for site in asked.sites:
        null = plaza_null() if site == "plaza" else data_and_null(site, asked)[1].of_kind("strangers")
        draws = 2 if site == "plaza" else asked.draws
        for truth, n in product(TRUTHS, SIZES[site]):
            if truth != "0.20 m ahead" or n == 600:
                rows = describe_case(null, site, truth, n, draws)
                if site == "plaza":
                    rows = [row | {"probe": probe(truth, n, row["method"])[row["quantity"]]} for row in rows]
                print(pd.DataFrame(rows).to_string(), file=sys.stderr, flush=True)
                yield from rows


@cache
def plaza_null() -> szlib.NullEncounters:
    """The null model of a small plaza whose people are seen for long."""
    with tempfile.TemporaryDirectory() as folder:
        settings = szlib.PlazaSettings(n_encounters=300, tracked=20.0)
        tracks = szlib.read_tracks(szlib.make_plaza(Path(folder) / "plaza.csv", settings=settings))
    return szlib.null_encounters(tracks, shifts=12, minutes=(0.2, 3.0), progress=False).of_kind("strangers")


def describe_case(
    null: szlib.NullEncounters, site: str, truth: str, n: int, draws: int
) -> list[dict[str, object]]:
    """Bias, scatter, width of the interval and share of draws in which it holds the truth."""
    ellipse, careless = TRUTHS[truth]
    true, found = measure(ellipse), []
    for draw in range(draws):
        samples, model = draw_case(null, SHIFTS_DRAWN[site], ellipse, careless, n, draw)
        for method in ("respect", quantile_zone.NAME):
            with warnings.catch_warnings(action="ignore", category=szlib.DataWarning):
                zone = szlib.SocialZone.fit(
                    samples, method=method, null=model, speeds=(SPEED,), n_resamples=300
                )
            row = zone.table().iloc[0]
            row["radius"] = np.sqrt(row["a"] * row["b"])
            for end in ("low", "high"):
                row[f"radius_{end}"] = np.sqrt(max(row[f"area_{end}"], 0.0) / np.pi)
            found += [
                {
                    "method": method,
                    "quantity": name,
                    "error": row[name] - value,
                    "width": row[f"{name}_high"] - row[f"{name}_low"],
                    "held": float(row[f"{name}_low"] <= value <= row[f"{name}_high"]),
                }
                for name, value in true.items()
            ]
    case = {"site": site, "truth": truth, "careless": careless, "encounters": n, "draws": draws}
    groups = pd.DataFrame(found).groupby(["method", "quantity"], sort=False)
    summary = groups.agg(
        bias=("error", "mean"), scatter=("error", "std"), width=("width", "mean"), held=("held", "mean")
    )
    return [case | row for row in summary.reset_index().to_dict("records")]


def measure(zone: szlib.Ellipse) -> dict[str, float]:
    """The quantities of a `zone` [m]."""
    a, b = zone.semi_axes
    return {"center_x": zone.center[0], "a": a, "b": b, "radius": float(np.sqrt(a * b))}


@cache
def probe(truth: str, n: int, method: str) -> dict[str, float]:
    """The errors of an estimator in the first draw on the plaza, without intervals [m]."""
    ellipse, careless = TRUTHS[truth]
    samples, model = draw_case(plaza_null(), SHIFTS_DRAWN["plaza"], ellipse, careless, n, 0)
    with warnings.catch_warnings(action="ignore", category=szlib.DataWarning):
        zone = szlib.SocialZone.fit(samples, method=method, null=model, speeds=(SPEED,), n_resamples=0)
        found = measure(zone.ellipse(SPEED))
    true = measure(ellipse)
    return {name: value - true[name] for name, value in found.items()}


def draw_case(
    null: szlib.NullEncounters, shifts: int, ellipse: szlib.Ellipse, careless: float, n: int, draw: int
) -> tuple[pd.DataFrame, szlib.NullEncounters]:
    """`n` encounters of a crowd that respects the zone, and the null model of the other shifts."""
    own = (draw * shifts + np.arange(shifts)) % null.shifts
    is_own = null.samples["shift"].isin(own)
    crowd = PairedSamples.from_samples(null.samples[is_own]).impose(ellipse, careless=careless, seed=draw)
    numbers = crowd["encounter"].unique()
    drawn = np.random.default_rng((draw, n)).choice(numbers, min(n, len(numbers)), replace=False)
    rest = null.encounters[~null.encounters["shift"].isin(own)]
    kept = replace(null, samples=null.samples[~is_own], encounters=rest)
    return crowd[crowd["encounter"].isin(drawn)], kept


@study("25_imposed", notebook="25")
def recompute(row: pd.Series) -> dict[str, object]:
    """The first draw of a row of the plaza, again."""
    return {"probe": probe(row["truth"], int(row["encounters"]), row["method"])[row["quantity"]]}


if __name__ == "__main__":
    main()
