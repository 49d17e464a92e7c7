"""Long studies of the estimators: the tables of notebook 25.

    python -m studies.zones coverage quantile 200 centred default   25_coverage.csv    (plazas)
    python -m studies.zones coverage hull 200 centred               25_coverage_hull.csv
    python -m studies.zones levels 3                                25_levels.csv      (plazas a case)
    python -m studies.zones estimators 3                            25_estimators.csv  (plazas a case)
    python -m studies.zones sizes 8                                 25_sizes.csv       (plazas pooled)
    python -m studies.zones subsets 20                              25_subsets.csv     (subsets of a size)

They go to notebooks/tables.  Coverage: share of the 95 % intervals, from 600 pairs, that hold the truth of
the plaza, and the limit: what the quantile gives for the people of all these plazas together (a hull has no
limit: it shrinks).  Subsets are of the ATC day in
$SZLIB_DATA_DIR, and of a plaza.

Each function `recompute_...` computes a row again.  Where that would take long, it computes the column
`probe`: the same for one small plaza.
"""

from __future__ import annotations

import sys
import warnings
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pandas as pd
from studies import quantile_zone
from studies.claims import SITES
from studies.committed import study, write_table

import szlib
from szlib.plaza.settings import PlazaSettings
from szlib.zones.ellipses import Ellipse
from szlib.zones.uncertainty import QUANTITIES

SPEEDS = (0.7, 0.9, 1.1, 1.3)
TRUTHS: dict[str, dict[str, Any]] = {
    "centred": {
        "slow_zone": Ellipse((0.0, 0.0), (0.88, 0.68)),
        "fast_zone": Ellipse((0.0, 0.0), (1.0, 0.78)),
    },
    "default": {},
}
"""Truths: the default plaza's is 5 cm longer ahead than behind, which no one-sided fit can tell."""
CASES: dict[str, dict[str, Any]] = {
    "default": {},
    "2 % intruders": {"intruders": 0.02},
    "5 cm of noise": {"noise": 0.05},
    "2 % intruders, 5 cm of noise": {"intruders": 0.02, "noise": 0.05},
}
METHODS: dict[str, dict[str, Any]] = {
    "quantile": {"method": quantile_zone.NAME},
    "hull": {"method": "hull"},
    "paper": {"method": "paper"},
}
SMALL = 300
"""Pairs of people on the small plaza of a probe."""


def people(seed: int, **settings: Any) -> tuple[pd.DataFrame, pd.DataFrame, PlazaSettings]:
    """Samples, tracks and settings of one plaza."""
    known = PlazaSettings(**settings)
    with TemporaryDirectory() as folder:
        path = szlib.make_plaza(Path(folder) / "plaza.csv", seed=seed, settings=known)
        tracks = szlib.read_tracks(path)
    return szlib.find_encounters(tracks), tracks, known


def pooled(samples: list[pd.DataFrame]) -> pd.DataFrame:
    """Many plazas as many days."""
    return pd.concat([s.assign(day=str(k)) for k, s in enumerate(samples)], ignore_index=True)


def quantities(ellipse: Ellipse) -> list[float]:
    """`QUANTITIES` of an ellipse."""
    return [*ellipse.center, *ellipse.semi_axes, np.degrees(ellipse.angle), ellipse.area]


def error(zone: szlib.SocialZone, known: PlazaSettings) -> float:
    """Largest error of centre and semi-axes over `SPEEDS` [m]."""
    pairs = [(quantities(zone.ellipses[v])[:4], quantities(known.true_zone(v))[:4]) for v in SPEEDS]
    return max(float(np.abs(np.subtract(*pair)).max()) for pair in pairs)


def zone_with_intervals(
    seed: int, truth: str, method: str, pairs: int = 600, **options: Any
) -> tuple[szlib.SocialZone, pd.DataFrame, PlazaSettings]:
    """The zone of one plaza with its intervals; its samples and settings."""
    samples, _, known = people(seed, n_encounters=pairs, **TRUTHS[truth])
    return szlib.SocialZone.fit(samples, speeds=SPEEDS, method=method, **options), samples, known


def half_widths(intervals: pd.DataFrame) -> pd.Series:
    return (intervals["high"] - intervals["low"]) / 2


def coverage(method: str, plazas: int, *truths: str) -> pd.DataFrame:
    """Share of plazas whose interval holds the truth, and the limit, by truth, quantity and speed."""
    tables = []
    for truth in truths:
        zones, everybody = [], []
        for seed in range(plazas):
            zone, samples, known = zone_with_intervals(seed, truth, method)
            zones.append(zone)
            everybody.append(samples)
            print(truth, seed, file=sys.stderr, flush=True)
        intervals = pd.concat([zone.uncertainty.intervals for zone in zones])
        intervals["truth"] = _holds(intervals, {v: known.true_zone(v) for v in SPEEDS})
        intervals["limit"] = np.nan
        if method == "quantile":  # a hull has none: it shrinks
            everyone = szlib.SocialZone.fit(pooled(everybody), method=method, speeds=SPEEDS, n_resamples=0)
            intervals["limit"] = _holds(intervals, everyone.ellipses)
        intervals["half_width"] = half_widths(intervals)
        table = intervals.groupby(["quantity", "speed"])[["truth", "limit", "half_width"]].mean()
        table["probe"] = probe_of_coverage(truth, method)
        tables.append(table.reset_index().assign(plaza=truth, method=method, plazas=plazas))
    columns = ["plaza", "method", "quantity", "speed", "truth", "limit", "half_width", "plazas", "probe"]
    return pd.concat(tables)[columns]


def probe_of_coverage(truth: str, method: str) -> pd.Series:
    """Half-widths by quantity and speed, of one small plaza and ten resamples."""
    zone, _, _ = zone_with_intervals(0, truth, method, SMALL, n_resamples=10)
    intervals = zone.uncertainty.intervals.set_index(["quantity", "speed"])
    return half_widths(intervals)


@study("25_coverage", "25_coverage_hull", notebook="25")
def recompute_coverage(row: pd.Series) -> dict[str, float]:
    return {"probe": probe_of_coverage(row["plaza"], row["method"])[row["quantity"], row["speed"]]}


def levels(plazas: int) -> pd.DataFrame:
    """How far the quantile's semi-axes lie outside of the truth [m], by how far people keep clear, and q."""
    rows = []
    for clearance in (0.05, 0.1, 0.2):
        for q in (0.02, 0.03, 0.05):
            probe = outside(clearance, q, 1, n_encounters=SMALL)[0]
            rows.append((clearance, q, *outside(clearance, q, plazas), plazas, probe))
            print(rows[-1], file=sys.stderr, flush=True)
    return pd.DataFrame(rows, columns=["clearance", "q", "a", "b", "plazas", "probe"])


def outside(clearance: float, q: float, plazas: int, **more: Any) -> np.ndarray:
    """How far the semi-axes of plazas pooled lie outside of the truth, mean over speeds (2,) [m]."""
    settings = {"clearance": clearance, **TRUTHS["centred"], **more}
    samples, _, known = zip(*(people(seed, **settings) for seed in range(plazas)), strict=True)
    zone = szlib.SocialZone.fit(
        pooled(list(samples)), method=quantile_zone.NAME, speeds=SPEEDS, q=q, n_resamples=0
    )
    off = [np.subtract(zone.ellipses[v].semi_axes, known[0].true_zone(v).semi_axes) for v in SPEEDS]
    return np.mean(off, axis=0)


@study("25_levels", notebook="25")
def recompute_levels(row: pd.Series) -> dict[str, float]:
    return {"probe": outside(row["clearance"], row["q"], 1, n_encounters=SMALL)[0]}


def _holds(intervals: pd.DataFrame, ellipses: dict[float, Ellipse]) -> np.ndarray:
    """Which intervals hold the quantities of ellipses by speed."""
    known = {v: dict(zip(QUANTITIES, quantities(e), strict=True)) for v, e in ellipses.items()}
    value = [known[v][name] for v, name in zip(intervals["speed"], intervals["quantity"], strict=True)]
    return ((intervals["low"] <= value) & (value <= intervals["high"])).to_numpy()


def estimators(plazas: int) -> pd.DataFrame:
    """Error of each method in each case, by seed."""
    rows = []
    for case in CASES:
        for seed in range(plazas):
            samples, _, known = people(seed, **CASES[case])
            for name in METHODS:
                rows.append({"case": case, "method": name, "seed": seed} | judge(samples, known, name))
            print(case, seed, file=sys.stderr, flush=True)
    return pd.DataFrame(rows)


def judge(samples: pd.DataFrame, known: PlazaSettings, method: str) -> dict[str, float]:
    """Number of encounters, and error of a method [m]."""
    zone = szlib.SocialZone.fit(samples, speeds=SPEEDS, n_resamples=0, **METHODS[method])
    return {"encounters": samples["encounter"].nunique(), "error_m": error(zone, known)}


@study("25_estimators", notebook="25")
def recompute_estimators(row: pd.Series) -> dict[str, float]:
    samples, _, known = people(int(row["seed"]), **CASES[row["case"]])
    return judge(samples, known, row["method"])


def sizes(plazas: int) -> pd.DataFrame:
    """Error of the quantile on 1, 2, 4, ... plazas pooled."""
    days = [people(seed)[0].assign(day=str(seed)) for seed in range(plazas)]
    rows = []
    for count in (n for n in (1, 2, 4, 8, 16) if n <= plazas):
        rows.append({"plazas": count} | judge_pooled(days[:count]))
        print(rows[-1], file=sys.stderr, flush=True)
    return pd.DataFrame(rows)


def judge_pooled(days: list[pd.DataFrame]) -> dict[str, float]:
    """Number of encounters, and error of the quantile [m], of plazas pooled."""
    zone = szlib.SocialZone.fit(pooled(days), method=quantile_zone.NAME, speeds=SPEEDS, n_resamples=0)
    return {
        "encounters": sum(day["encounter"].nunique() for day in days),
        "error_m": error(zone, PlazaSettings()),
    }


@study("25_sizes", notebook="25")
def recompute_sizes(row: pd.Series) -> dict[str, float]:
    return judge_pooled([people(seed)[0] for seed in range(int(row["plazas"]))])


def subsets(draws: int) -> pd.DataFrame:
    """Zones at 1.1 m/s of random subsets of encounters, median and quartiles of a and b [m]."""
    load, square = SITES["ATC day"]
    sites = {
        "ATC day": (szlib.find_encounters(load(), area=square), draws),
        "plaza": (people(0, n_encounters=SMALL)[0], 3),
    }
    rows = []
    for site, (samples, times) in sites.items():
        for share in (0.1, 0.25, 0.5, 0.75, 1.0):
            for name in ("quantile", "hull", "paper"):
                drawn = times if share < 1 else 1
                row = {"site": site, "method": name, "share": share, "draws": drawn}
                rows.append(row | fit_subsets(samples, share, drawn, name))
                print(rows[-1], file=sys.stderr, flush=True)
    return pd.DataFrame(rows)


def fit_subsets(samples: pd.DataFrame, share: float, draws: int, method: str) -> dict[str, float]:
    """How many of the subsets have a zone, and quartiles of their semi-axes [m]."""
    every = samples["encounter"].unique()
    rng = np.random.default_rng(0)
    found = []
    for _ in range(draws):
        some = samples[samples["encounter"].isin(rng.permutation(every)[: round(share * len(every))])]
        with suppress(szlib.SzlibError):  # counted: zones, of so many draws
            zone = szlib.SocialZone.fit(some, speeds=(1.1,), n_resamples=0, **METHODS[method])
            found.append(zone.ellipses[1.1].semi_axes)
    quartiles = np.quantile(found, [0.25, 0.5, 0.75], axis=0) if found else np.full((3, 2), np.nan)
    ends = [f"{axis}_{end}" for axis in "ab" for end in ("lower", "median", "upper")]
    return {"zones": len(found), **dict(zip(ends, quartiles.T.ravel(), strict=True))}


@study("25_subsets", notebook="25")
def recompute_subsets(row: pd.Series) -> dict[str, float]:
    """A row of the plaza, again."""
    samples = people(0, n_encounters=SMALL)[0]
    return fit_subsets(samples, row["share"], int(row["draws"]), row["method"])


STUDIES = (coverage, levels, estimators, sizes, subsets)

if __name__ == "__main__":
    warnings.simplefilter("ignore", szlib.DataWarning)
    asked, *given = sys.argv[1:]
    table = {each.__name__: each for each in STUDIES}[asked](*(int(x) if x.isdigit() else x for x in given))
    method = f"_{given[0]}" if asked == "coverage" and given[0] != "quantile" else ""
    write_table(table, f"25_{asked}{method}")
