"""Long studies of the estimators: the tables of notebook 16.

    python -m studies.zones coverage quantile 200 centred default   16_coverage.csv    (plazas)
    python -m studies.zones coverage hull 200 centred               16_coverage_hull.csv
    python -m studies.zones coverage respect 20 centred             16_coverage_respect.csv
    python -m studies.zones levels 3                                16_levels.csv      (plazas a case)
    python -m studies.zones estimators 3                            16_estimators.csv  (plazas a case)
    python -m studies.zones sizes 8                                 16_sizes.csv       (plazas pooled)
    python -m studies.zones subsets 20                              16_subsets.csv     (subsets of a size)
    python -m studies.zones two_sided 3                             16_two_sided.csv   (plazas a truth)

They go to notebooks/tables.  Coverage: share of the 95 % intervals, from 600 pairs, that hold the truth of
the plaza, and the limit: what the quantile gives for the people of all these plazas together (a hull has no
limit: it shrinks; respect is held against the truth alone, at one speed).  Subsets are of the ATC day in
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
from scipy.optimize import least_squares
from studies.claims import SITES
from studies.committed import write_table

import szlib
from szlib.plaza.settings import PlazaSettings
from szlib.zones.ellipses import Ellipse
from szlib.zones.quantile import smooth_paths
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
    "quantile": {"method": "quantile"},
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
    samples, tracks, known = people(seed, n_encounters=pairs, **TRUTHS[truth])
    speeds = SPEEDS
    if method == "respect":
        null = szlib.null_encounters(tracks, shifts=20 if pairs > SMALL else 5, seed=seed, progress=False)
        speeds, options = (1.1,), {"n_resamples": 40, "null": null} | options
    return szlib.SocialZone.fit(samples, speeds=speeds, method=method, **options), samples, known


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
    zone = szlib.SocialZone.fit(pooled(list(samples)), speeds=SPEEDS, q=q, n_resamples=0)
    off = [np.subtract(zone.ellipses[v].semi_axes, known[0].true_zone(v).semi_axes) for v in SPEEDS]
    return np.mean(off, axis=0)


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
    zone = szlib.SocialZone.fit(pooled(days), method="quantile", speeds=SPEEDS, n_resamples=0)
    return {
        "encounters": sum(day["encounter"].nunique() for day in days),
        "error_m": error(zone, PlazaSettings()),
    }


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


def recompute_subsets(row: pd.Series) -> dict[str, float]:
    """A row of the plaza, again."""
    samples = people(0, n_encounters=SMALL)[0]
    return fit_subsets(samples, row["share"], int(row["draws"]), row["method"])


# --- both sides at once ------------------------------------------------------------------------------
#
# A pair is kept apart by both zones.  One zone for everybody, each turned with its person's own heading:
# ten numbers (centre and root of the form, linear in speed).  The gap of a pair is the smallest, over time
# and over both people, distance of the one to the other's zone.  The zone sought is the one into which, in
# every direction and speed band in which pairs are nearest to a zone at all, a share q of pairs enter.

SHIFTED = {0.1: (0.68, 0.78), 0.2: (0.74, 0.84), -0.1: (0.68, 0.78)}
"""Centre ahead [m], and the semi-axes across at 0.5 and 1.5 m/s [m] (+0.2 m: rounder, else not convex)."""
FITS = ("one-sided", "two-sided, from the middle", "two-sided, from the other side")
_Q, _SECTOR, _ROUNDS, _DAMPED = 0.05, np.radians(10), 40, 0.3
_BANDS, _AROUND = (0.6, 0.8, 1.0, 1.2, 1.4), np.radians(np.arange(-180, 180, 10))
_TOUCHED = 0.4  # of the pairs in the fullest sector: directions with fewer are not touched


def two_sided(plazas: int) -> pd.DataFrame:
    """What one- and two-sided fits make of a zone shifted ahead, from two starts."""
    rows = []
    for ahead in SHIFTED:
        for seed in range(plazas):
            for fit in FITS:
                row = {"ahead": ahead, "seed": seed, "fit": fit}
                rows.append(row | fit_shifted(ahead, seed, fit) | probe_of_shifted(ahead, seed, fit))
                print(rows[-1], file=sys.stderr, flush=True)
    return pd.DataFrame(rows)


def fit_shifted(ahead: float, seed: int, fit: str, rounds: int = _ROUNDS, **more: Any) -> dict[str, float]:
    """What a fit finds of a zone shifted ahead: where, errors of the axes [m], and the mean gap [m]."""
    slow, fast = SHIFTED[ahead]
    zones = {"slow_zone": Ellipse((ahead, 0), (0.88, slow)), "fast_zone": Ellipse((ahead, 0), (1.0, fast))}
    samples, tracks, known = people(seed, **zones, **more)
    if fit == "one-sided":
        zone = szlib.SocialZone.fit(samples, method="quantile", speeds=SPEEDS, n_resamples=0)
        ellipses, gap = zone.ellipses, np.nan
    else:
        start = -ahead if fit == "two-sided, from the other side" else 0.0
        ellipses, gap = _two_sided_fit(*_both_sides(samples, tracks), start, rounds)
    found = np.array([quantities(ellipses[v])[:4] for v in SPEEDS])
    away = found - [quantities(known.true_zone(v))[:4] for v in SPEEDS]
    return {
        "found_ahead": found[:, 0].mean(),
        "error_a": away[:, 2].mean(),
        "largest_error": np.abs(away).max(),
        "mean_gap": gap,
    }


def probe_of_shifted(ahead: float, seed: int, fit: str) -> dict[str, float]:
    """What one round finds of a small plaza: where the zone is [m]."""
    found = fit_shifted(ahead, seed, fit, rounds=1, n_encounters=2 * SMALL)
    return {"probe": found["found_ahead"]}


def recompute_two_sided(row: pd.Series) -> dict[str, float]:
    return probe_of_shifted(row["ahead"], int(row["seed"]), row["fit"])


def _both_sides(samples: pd.DataFrame, tracks: pd.DataFrame) -> tuple[np.ndarray, np.ndarray]:
    """Points (x, y, speed) (n, 3) in the frames of both people of each pair, and where pairs start (k,)."""
    where = tracks[["day", "id", "t", "x", "y", "vx", "vy"]]
    me = where.add_suffix("_me").rename(columns={"day_me": "day", "id_me": "ref_id", "t_me": "t"})
    you = where.add_suffix("_you").rename(columns={"day_you": "day", "id_you": "other_id", "t_you": "t"})
    both = samples.merge(me, on=["day", "ref_id", "t"]).merge(you, on=["day", "other_id", "t"])
    bearing = np.arctan2(both["y_me"] - both["y_you"], both["x_me"] - both["x_you"])
    mirrored = both.assign(
        los_angle=bearing - np.arctan2(both["vy_you"], both["vx_you"]),
        speed=np.hypot(both["vx_you"], both["vy_you"]),
    )
    pair = both.groupby(
        [both[["ref_id", "other_id"]].min(axis=1), both[["ref_id", "other_id"]].max(axis=1)]
    ).ngroup()
    sides = []
    for side in (both, mirrored):
        angle, distance = smooth_paths(side)
        use = (distance <= 2.0) & (side["speed"].to_numpy() >= 0.4)
        points = [distance * np.cos(angle), distance * np.sin(angle), side["speed"], pair]
        sides.append(np.column_stack(points)[use])
    rows = np.vstack(sides)
    rows = rows[np.argsort(rows[:, 3], kind="stable")]
    return rows[:, :3], np.flatnonzero(np.append(True, np.diff(rows[:, 3]) != 0))


def _gap(p: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Distances (n,) [m] of points (x, y, speed) to the ellipse of their speed, to first order."""
    m, n, a, b, c = (p[:5] + p[5:] * (points[:, 2:] - 1.0)).T
    dx, dy = points[:, 0] - m, points[:, 1] - n
    ux, uy = a * dx + b * dy, b * dx + c * dy
    level = np.hypot(ux, uy)
    steepness = np.hypot(a * ux + b * uy, b * ux + c * uy)
    return (level - 1) * level / np.maximum(steepness, 1e-12)


def _two_sided_fit(
    points: np.ndarray, starts: np.ndarray, shift: float, rounds: int = _ROUNDS
) -> tuple[dict[float, Ellipse], float]:
    """Ellipses by speed, and the mean gap [m]: of two zones that as many enter, the truer leaves less."""
    p = np.array([shift, 0, 1 / 0.95, 0, 1 / 0.75, 0, 0, 0, 0, 0])
    pair = np.repeat(np.arange(len(starts)), np.diff(np.append(starts, len(points))))
    for _ in range(rounds):
        gap = _gap(p, points)
        least = np.minimum.reduceat(gap, starts)
        nearest = np.flatnonzero(gap == least[pair])
        nearest = nearest[np.unique(pair[nearest], return_index=True)[1]]
        bearing, speed = np.arctan2(points[nearest, 1], points[nearest, 0]), points[nearest, 2]
        near = np.abs((bearing - _AROUND[:, None] + np.pi) % (2 * np.pi) - np.pi) <= _SECTOR
        targets = []
        for v in _BANDS:
            here = near & (np.abs(speed - v) <= 0.2)
            count = here.sum(axis=1)
            for k in np.flatnonzero(count >= max(20, _TOUCHED * count.max())):
                unit = np.array([np.cos(_AROUND[k]), np.sin(_AROUND[k])])
                ray = np.column_stack([np.linspace(0, 2, 2001)[:, None] * unit, np.full(2001, v)])
                edge = np.interp(0, _gap(p, ray)[200:], np.linspace(0, 2, 2001)[200:])
                targets.append([*(edge + np.quantile(least[here[k]], _Q)) * unit, v])
        at = np.array(targets)
        p = p + _DAMPED * (least_squares(lambda z, at=at: _gap(z, at), p).x - p)
    gap = np.minimum.reduceat(_gap(p, points), starts).mean()
    return {v: _ellipse(p[:5] + p[5:] * (v - 1.0)) for v in SPEEDS}, float(gap)


def _ellipse(row: np.ndarray) -> Ellipse:
    values, vectors = np.linalg.eigh(row[[2, 3, 3, 4]].reshape(2, 2))
    axes = 1 / np.abs(values)
    major = vectors[:, int(np.argmax(axes))]
    return Ellipse(tuple(row[:2]), (axes.max(), axes.min()), np.arctan2(major[1], major[0]))


STUDIES = (coverage, levels, estimators, sizes, subsets, two_sided)

if __name__ == "__main__":
    warnings.simplefilter("ignore", szlib.DataWarning)
    study, *given = sys.argv[1:]
    table = {each.__name__: each for each in STUDIES}[study](*(int(x) if x.isdigit() else x for x in given))
    method = f"_{given[0]}" if study == "coverage" and given[0] != "quantile" else ""
    write_table(table, f"16_{study}{method}")
