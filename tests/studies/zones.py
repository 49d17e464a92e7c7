"""Long studies of the estimators; each prints its table as CSV, kept in notebooks/tables.

    python tests/studies/zones.py coverage 200 quantile centred default > notebooks/tables/16_coverage.csv
    python tests/studies/zones.py coverage 200 hull centred > notebooks/tables/16_coverage_hull.csv  (plazas)
    python tests/studies/zones.py coverage 20 respect centred > notebooks/tables/16_coverage_respect.csv
    python tests/studies/zones.py levels 3 > notebooks/tables/16_levels.csv               (plazas a case)
    python tests/studies/zones.py errors 3 > notebooks/tables/16_estimators.csv           (plazas a case)
    python tests/studies/zones.py sizes 8 > notebooks/tables/16_sizes.csv                 (plazas pooled)
    python tests/studies/zones.py subsets 20 FILE... > notebooks/tables/16_subsets.csv    (subsets of a size)
    python tests/studies/zones.py two_sided 3 > notebooks/tables/16_two_sided.csv         (plazas a truth)

Coverage: share of the 95 % intervals, from 600 pairs, that hold the truth of the plaza, and the limit: what
the quantile gives for the people of all these plazas together (a hull has no limit: it shrinks; respect is
held against the truth alone, at one speed).  Files of subsets are a day of tracks, as `szlib.read_tracks`
reads them.
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
    "hull, as in the paper": {"method": "hull", "fraction": 0.002, "n_neighbours": 20},
}


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


def coverage(plazas: int, method: str, *truths: str) -> pd.DataFrame:
    """Share of plazas whose interval holds the truth, and the limit, by truth, quantity and speed."""
    tables = []
    for truth in truths:
        zones, everybody = [], []
        for seed in range(plazas):
            samples, tracks, known = people(seed, n_encounters=600, **TRUTHS[truth])
            everybody.append(samples)
            options: dict[str, Any] = {"speeds": SPEEDS, "method": method}
            if method == "respect":
                null = szlib.null_encounters(tracks, shifts=20, seed=seed, progress=False)
                options |= {"speeds": (1.1,), "n_resamples": 40, "null": null}
            zones.append(szlib.SocialZone.fit(samples, **options))
            print(truth, seed, file=sys.stderr, flush=True)
        intervals = pd.concat([zone.uncertainty.intervals for zone in zones])
        intervals["truth"] = _holds(intervals, {v: known.true_zone(v) for v in SPEEDS})
        intervals["limit"] = np.nan
        if method == "quantile":  # a hull has none: it shrinks
            everyone = szlib.SocialZone.fit(pooled(everybody), method=method, speeds=SPEEDS, n_resamples=0)
            intervals["limit"] = _holds(intervals, everyone.ellipses)
        intervals["half_width"] = (intervals["high"] - intervals["low"]) / 2
        table = intervals.groupby(["quantity", "speed"])[["truth", "limit", "half_width"]].mean()
        tables.append(table.reset_index().assign(plaza=truth, method=method, plazas=plazas))
    return pd.concat(tables)[
        ["plaza", "method", "quantity", "speed", "truth", "limit", "half_width", "plazas"]
    ]


def levels(plazas: int) -> pd.DataFrame:
    """How far the quantile's semi-axes lie outside of the truth [m], by how far people keep clear, and q."""
    rows = []
    for clearance in (0.05, 0.1, 0.2):
        settings = {"clearance": clearance, **TRUTHS["centred"]}
        samples, _, known = zip(*(people(seed, **settings) for seed in range(plazas)), strict=True)
        for q in (0.02, 0.03, 0.05):
            zone = szlib.SocialZone.fit(pooled(list(samples)), speeds=SPEEDS, q=q, n_resamples=0)
            outside = [
                np.subtract(zone.ellipses[v].semi_axes, known[0].true_zone(v).semi_axes) for v in SPEEDS
            ]
            rows.append((clearance, q, *np.mean(outside, axis=0), plazas))
            print(rows[-1], file=sys.stderr, flush=True)
    return pd.DataFrame(rows, columns=["clearance", "q", "a", "b", "plazas"])


def _holds(intervals: pd.DataFrame, ellipses: dict[float, Ellipse]) -> np.ndarray:
    """Which intervals hold the quantities of ellipses by speed."""
    known = {v: dict(zip(QUANTITIES, quantities(e), strict=True)) for v, e in ellipses.items()}
    value = [known[v][name] for v, name in zip(intervals["speed"], intervals["quantity"], strict=True)]
    return ((intervals["low"] <= value) & (value <= intervals["high"])).to_numpy()


def errors(plazas: int) -> pd.DataFrame:
    """Error of each method in each case, by seed."""
    rows = []
    for case, settings in CASES.items():
        for seed in range(plazas):
            samples, _, known = people(seed, **settings)
            for name, options in METHODS.items():
                zone = szlib.SocialZone.fit(samples, speeds=SPEEDS, n_resamples=0, **options)
                rows.append((case, name, seed, samples["encounter"].nunique(), error(zone, known)))
            print(case, seed, file=sys.stderr, flush=True)
    return pd.DataFrame(rows, columns=["case", "method", "seed", "encounters", "error_m"])


def sizes(plazas: int) -> pd.DataFrame:
    """Error of the quantile on 1, 2, 4, ... plazas pooled."""
    days = [people(seed)[0] for seed in range(plazas)]
    rows = []
    for count in (n for n in (1, 2, 4, 8, 16) if n <= plazas):
        samples = pooled(days[:count])
        zone = szlib.SocialZone.fit(samples, method="quantile", speeds=SPEEDS, n_resamples=0)
        rows.append(
            (count, samples.groupby("day")["encounter"].nunique().sum(), error(zone, PlazaSettings()))
        )
        print(rows[-1], file=sys.stderr, flush=True)
    return pd.DataFrame(rows, columns=["plazas", "encounters", "error_m"])


def subsets(draws: int, *files: str) -> pd.DataFrame:
    """Zones at 1.1 m/s of random subsets of a day's encounters, median and quartiles of a and b [m]."""
    samples = szlib.find_encounters(szlib.read_tracks(list(files)))
    every = samples["encounter"].unique()
    rng = np.random.default_rng(0)
    rows = []
    for share in (0.1, 0.25, 0.5, 0.75, 1.0):
        for name, options in {"quantile": METHODS["quantile"], "hull": METHODS["hull"]}.items():
            found = []
            for _ in range(draws if share < 1 else 1):
                some = samples[samples["encounter"].isin(rng.permutation(every)[: round(share * len(every))])]
                with suppress(szlib.SzlibError):  # counted: zones, of so many draws
                    zone = szlib.SocialZone.fit(some, speeds=(1.1,), n_resamples=0, **options)
                    found.append(zone.ellipses[1.1].semi_axes)
            quartiles = np.quantile(found, [0.25, 0.5, 0.75], axis=0) if found else np.full((3, 2), np.nan)
            rows.append((name, share, draws if share < 1 else 1, len(found), *quartiles.T.ravel()))
            print(rows[-1], file=sys.stderr, flush=True)
    ends = [f"{axis}_{end}" for axis in "ab" for end in ("lower", "median", "upper")]
    return pd.DataFrame(rows, columns=["method", "share", "draws", "zones", *ends])


# --- both sides at once ------------------------------------------------------------------------------
#
# A pair is kept apart by both zones.  One zone for everybody, each turned with its person's own heading:
# ten numbers (centre and root of the form, linear in speed).  The gap of a pair is the smallest, over time
# and over both people, distance of the one to the other's zone.  The zone sought is the one into which, in
# every direction and speed band in which pairs are nearest to a zone at all, a share q of pairs enter.

SHIFTED = {0.1: (0.68, 0.78), 0.2: (0.74, 0.84), -0.1: (0.68, 0.78)}
"""Centre ahead [m], and the semi-axes across at 0.5 and 1.5 m/s [m] (+0.2 m: rounder, else not convex)."""
_Q, _SECTOR, _ROUNDS, _DAMPED = 0.05, np.radians(10), 40, 0.3
_BANDS, _AROUND = (0.6, 0.8, 1.0, 1.2, 1.4), np.radians(np.arange(-180, 180, 10))
_TOUCHED = 0.4  # of the pairs in the fullest sector: directions with fewer are not touched


def two_sided(plazas: int) -> pd.DataFrame:
    """What one- and two-sided fits make of a zone shifted ahead, from two starts."""
    rows = []
    for ahead, (slow, fast) in SHIFTED.items():
        settings = {
            "slow_zone": Ellipse((ahead, 0), (0.88, slow)),
            "fast_zone": Ellipse((ahead, 0), (1.0, fast)),
        }
        for seed in range(plazas):
            samples, tracks, known = people(seed, **settings)
            pairs = _both_sides(samples, tracks)
            alone = szlib.SocialZone.fit(samples, method="quantile", speeds=SPEEDS, n_resamples=0)
            fits = {"one-sided": (alone.ellipses, np.nan)}
            for start, shift in (("middle", 0.0), ("other side", -ahead)):
                fits[f"two-sided, from the {start}"] = _two_sided_fit(*pairs, shift)
            for name, (ellipses, gap) in fits.items():
                found = np.array([quantities(ellipses[v])[:4] for v in SPEEDS])
                away = found - [quantities(known.true_zone(v))[:4] for v in SPEEDS]
                rows.append(
                    (ahead, seed, name, found[:, 0].mean(), away[:, 2].mean(), np.abs(away).max(), gap)
                )
                print(rows[-1], file=sys.stderr, flush=True)
    return pd.DataFrame(
        rows, columns=["ahead", "seed", "fit", "found_ahead", "error_a", "largest_error", "mean_gap"]
    )


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
    points: np.ndarray, starts: np.ndarray, shift: float
) -> tuple[dict[float, Ellipse], float]:
    """Ellipses by speed, and the mean gap [m]: of two zones that as many enter, the truer leaves less."""
    p = np.array([shift, 0, 1 / 0.95, 0, 1 / 0.75, 0, 0, 0, 0, 0])
    pair = np.repeat(np.arange(len(starts)), np.diff(np.append(starts, len(points))))
    for _ in range(_ROUNDS):
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


if __name__ == "__main__":
    warnings.simplefilter("ignore", szlib.DataWarning)
    studies = {f.__name__: f for f in (coverage, levels, errors, sizes, subsets, two_sided)}
    table = studies[sys.argv[1]](int(sys.argv[2]), *sys.argv[3:])
    sys.stdout.write(table.to_csv(index=False, float_format="%.4g", lineterminator="\n"))
