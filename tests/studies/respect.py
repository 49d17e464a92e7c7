"""Respect or emptiness: the tables of notebook 15.

python tests/studies/respect.py nobody      15_nobody.csv     the test without interaction, 100 seeds
python tests/studies/respect.py sites       15_sites.csv      radii, intervals and p-values on the real data
python tests/studies/respect.py n-curve     15_n_curve.csv    hull and respect zone by number of encounters
python tests/studies/respect.py changes     15_changes.csv    the radius at Grand Central, one thing changed

Set PYTHONPATH=tests. They go to notebooks/tables.
The real data is looked for in $SZLIB_DATA_DIR (atc-1hz/ and gc/).
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Iterator
from pathlib import Path

import joblib
import numpy as np
import pandas as pd
from helpers.noninteracting_crowd import noninteracting_crowd

import szlib
from szlib.parallel import run_tasks
from szlib.tracks.clock import to_clock
from szlib.tracks.sites import GRAND_CENTRAL_RATE, read_grand_central
from szlib.zones.enclosing_ellipse import minimum_enclosing_ellipse_of_curve
from szlib.zones.hulls import hull_vertices, slice_hull
from szlib.zones.outliers import complementary_points

TABLES = Path(__file__).parents[2] / "notebooks" / "tables"
GRAND_CENTRAL = szlib.Square(x=(10.0, 40.0), y=(10.0, 50.0))
"""The hall without its walls (measured)."""
SETS = {
    "all": None,
    "strangers": "strangers",
    "opposite, crossing": ("opposite", "crossing"),
    "opposite": "opposite",
    "crossing": "crossing",
    "same direction": "same direction",
}
SPEED = 1.1
"""Speed of the hull's zone [m/s]."""
RESAMPLES, DRAWS = 100, 30
HULLS = 100_000
"""Samples of the null model whose hulls are found, at most: LOF is slow."""
SIZES = (36, 72, 150, 300, 600, 1200, 2400, 4800)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("study", choices=["nobody", "sites", "n-curve", "changes"])
    parser.add_argument("--seeds", type=int, default=100)
    parser.add_argument("--sites", nargs="+", default=["atc-1hz", "grand-central"])
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--cache", type=Path, default=Path("results/null"), help="where null models are kept")
    asked = parser.parse_args()
    study = {"nobody": nobody, "sites": sites, "n-curve": n_curve, "changes": changes}[asked.study]
    table = pd.DataFrame(study(asked))
    TABLES.mkdir(exist_ok=True)
    table.to_csv(TABLES / f"15_{asked.study.replace('-', '_')}.csv", index=False, float_format="%.4g")
    print(table.to_string())


# --- a crowd without interaction ---------------------------------------------------------------------


def nobody(asked: argparse.Namespace) -> list[dict[str, object]]:
    """One row a seed, a size of bunches, a set of kinds."""
    tasks = [joblib.delayed(one_crowd)(seed, bunch) for seed in range(asked.seeds) for bunch in (1, 10)]
    rows = [row for part in run_tasks(tasks, n_jobs=asked.jobs) for row in part]
    return sorted(rows, key=lambda row: (row["bunch"], row["kinds"], row["seed"]))


def one_crowd(seed: int, bunch: int) -> list[dict[str, object]]:
    tracks = noninteracting_crowd(seed=seed, people=500, minutes=30, bunch=bunch)
    samples = szlib.find_encounters(tracks)
    null = szlib.null_encounters(tracks, shifts=19, seed=seed, progress=False)
    rows = []
    for name in ("all", "opposite, crossing"):
        data, against = szlib.of_kind(samples, SETS[name]), null.of_kind(SETS[name])
        test = szlib.null_test(data, against)
        result = {"p_value": test.p_value, "encounters": test.n_encounters, "radius": test.radius}
        rows.append({"bunch": bunch, "kinds": name, "seed": seed, "shifts": null.shifts} | result)
    return rows


# --- real sites --------------------------------------------------------------------------------------


def load(site: str) -> tuple[pd.DataFrame, szlib.Square, int]:
    """Tracks, square and number of shifts of a site."""
    root = Path(os.environ.get("SZLIB_DATA_DIR", "."))
    if site == "atc-1hz":
        return szlib.read_tracks(sorted((root / "atc-1hz").glob("*.csv"))), szlib.ATC_SQUARE, 100
    return read_grand_central(root / "gc" / "Annotation.zip"), GRAND_CENTRAL, 20


def data_and_null(
    site: str, min_distance: float, asked: argparse.Namespace
) -> tuple[pd.DataFrame, szlib.NullEncounters]:
    """Samples of a site and its null model, kept between studies."""
    kept = asked.cache / f"{site}-{min_distance:g}.joblib"
    if not kept.exists():
        tracks, square, shifts = load(site)
        found = {"square": square, "min_distance": min_distance}
        samples = szlib.find_encounters(tracks, **found)
        null = szlib.null_encounters(tracks, shifts=shifts, n_jobs=asked.jobs, **found)
        kept.parent.mkdir(parents=True, exist_ok=True)
        joblib.dump((samples, null), kept)
    return joblib.load(kept)


def sites(asked: argparse.Namespace) -> Iterator[dict[str, object]]:
    """One row a site, a min_distance, a set of kinds; intervals from resampled pairs of people."""
    theta = np.radians([0.0, 90.0, 180.0, 270.0])
    for site in asked.sites:
        for min_distance in (1.0, 0.0):
            samples, null = data_and_null(site, min_distance, asked)
            for name, kinds in SETS.items():
                data, against = szlib.of_kind(samples, kinds), null.of_kind(kinds)
                test = szlib.null_test(data, against)
                bodies = szlib.null_test(data, against, excluded_below=0.5)
                fit = szlib.fit_respect(data, against)
                radii = [np.r_[test.radius, fit.radii(theta)], *resampled(data, against, theta)]
                low, high = np.percentile(radii[1:], [2.5, 97.5], axis=0)
                row = {"site": site, "min_distance": min_distance, "kinds": name}
                row |= {"encounters": data["encounter"].nunique(), "within_2m": test.n_encounters}
                row |= {"null_encounters": len(against.encounters) / null.shifts, "shifts": null.shifts}
                for i, where in enumerate(("radius", "ahead", "left", "behind", "right")):
                    row |= {where: radii[0][i], f"{where}_low": low[i], f"{where}_high": high[i]}
                row |= {"null_radius_high": np.nanpercentile(null_radii(against), 97.5)}
                row |= {"softness": fit.softness, "careless": fit.careless}
                row |= {"p_value": test.p_value, "p_value_beyond_0.5m": bodies.p_value}
                row |= {"hull_a": hull_a(data)}
                few = max(1, min(null.shifts, HULLS * null.shifts // max(len(against.samples), 1)))
                hulls = [hull_a(against.one(k)) for k in range(few)]
                row |= {"null_hull_a": np.nanmedian(hulls) if np.isfinite(hulls).any() else np.nan}
                print(row, file=sys.stderr, flush=True)
                yield row


def null_radii(null: szlib.NullEncounters) -> list[float]:
    """Radius of the respect zone of each shift against all others [m]; NaN if there is nothing to compare."""
    total = szlib.OccupancyHistogram.from_samples(null.samples, r_max=null.r_max)
    radii = []
    for shift in range(null.shifts):
        own = szlib.OccupancyHistogram.from_samples(null.one(shift), r_max=null.r_max)
        rest = szlib.OccupancyHistogram(total.counts - own.counts, null.r_max)
        is_known = own.counts.any() and rest.counts.any()
        radii.append(szlib.respect_radius(own, rest) if is_known else np.nan)
    return radii


def resampled(samples: pd.DataFrame, null: szlib.NullEncounters, theta: np.ndarray) -> Iterator[np.ndarray]:
    """Radius of all bearings, and radii in directions theta, of resampled pairs of people."""
    pair = pairs(samples)
    against = szlib.OccupancyHistogram.from_samples(null.samples, r_max=null.r_max)
    rng = np.random.default_rng(0)
    for _ in range(RESAMPLES):
        drawn = np.bincount(rng.integers(pair.max() + 1, size=pair.max() + 1), minlength=pair.max() + 1)
        data = szlib.OccupancyHistogram.from_samples(samples, r_max=null.r_max, weights=drawn[pair])
        if data.counts.any():
            yield np.r_[szlib.respect_radius(data, against), szlib.fit_respect(data, against).radii(theta)]


def pairs(samples: pd.DataFrame) -> np.ndarray:
    """Number of the pair of people, whoever is the reference, of each sample."""
    people = samples[["ref_id", "other_id"]].to_numpy()
    keys = pd.DataFrame(np.sort(people, axis=1)).assign(day=samples["day"].astype(str).to_numpy())
    return keys.groupby([0, 1, "day"], sort=False).ngroup().to_numpy()


def hull_a(samples: pd.DataFrame) -> float:
    """Semi-major axis of the paper's zone at 1.1 m/s [m]; NaN where it is undefined."""
    try:
        kept = szlib.remove_outliers(samples, fraction=0.002, r_max=2.0, n_neighbours=20)
        points = np.column_stack([complementary_points(kept, r_max=2.0), kept["speed"]])
        section = slice_hull(hull_vertices(points), SPEED, r_max=2.0)
        return minimum_enclosing_ellipse_of_curve(section.boundary, section.corner_angles).semi_axes[0]
    except szlib.SzlibError:
        return np.nan


# --- by the number of encounters ---------------------------------------------------------------------


def n_curve(asked: argparse.Namespace) -> Iterator[dict[str, object]]:
    """One row a site, a set of kinds, a number of encounters drawn without replacement."""
    for site in asked.sites:
        samples, null = data_and_null(site, 1.0, asked)
        for name in ("all", "strangers", "opposite, crossing"):
            data, against = szlib.of_kind(samples, SETS[name]), null.of_kind(SETS[name])
            others = szlib.OccupancyHistogram.from_samples(against.samples, r_max=null.r_max)
            total = data["encounter"].nunique()
            for n in sorted({*(size for size in SIZES if size < total), total}):
                drawn = pd.DataFrame(draws(data, against, others, n, DRAWS if n < total else 1))
                row = {"site": site, "kinds": name, "encounters": n, "draws": len(drawn)}
                for column in drawn:
                    row[column] = drawn[column].mean()
                    row |= {f"{column}_low": drawn[column].quantile(0.025)}
                    row |= {f"{column}_high": drawn[column].quantile(0.975)}
                print(row, file=sys.stderr, flush=True)
                yield row


def draws(
    data: pd.DataFrame, null: szlib.NullEncounters, against: szlib.OccupancyHistogram, n: int, times: int
) -> Iterator[dict[str, float]]:
    """Hull and respect radius of n encounters of the data, and of n of one shift of the null model."""
    rng = np.random.default_rng(n)
    numbers = data["encounter"].unique()
    for k in range(times):
        part = data[data["encounter"].isin(rng.choice(numbers, n, replace=False))]
        shift = k % null.shifts
        own = null.encounters.loc[null.encounters["shift"] == shift, "encounter"].to_numpy()
        model = null.one(shift)
        chosen = model[model["encounter"].isin(rng.choice(own, min(n, len(own)), replace=False))]
        whole = szlib.OccupancyHistogram.from_samples(model, r_max=null.r_max)
        rest = szlib.OccupancyHistogram(against.counts - whole.counts, null.r_max)
        yield {
            "hull_a": hull_a(part),
            "respect": szlib.respect_radius(part, against),
            "null_respect": szlib.respect_radius(chosen, rest) if len(chosen) else np.nan,
        }


# --- what the radius at Grand Central depends on -----------------------------------------------------

KINDS_OF = {
    "all": None,
    "strangers": "strangers",
    "not in the same direction": ("opposite", "crossing", "standing"),
}
CHANGES: dict[str, dict[str, object]] = {
    "nothing": {},
    "shifts of 0.2 to 2 min": {"minutes": (0.2, 2.0)},
    "shifts of 2 to 20 min": {"minutes": (2.0, 20.0)},
    "area 3 m narrower on each side": {"square": GRAND_CENTRAL.grown(-3.0)},
    "area 3 m wider on each side": {"square": GRAND_CENTRAL.grown(3.0)},
    "everything 5 % larger": {"scale": 1.05},
    "24 frames a second, not 25": {"rate": 24.0},
}
FEW = 5
"""Shifts where something is changed."""


def changes(asked: argparse.Namespace) -> Iterator[dict[str, object]]:
    """One row a change, a set of kinds: the fitted radius, its interval, and where bins of g cross 1/2."""
    for change, how in CHANGES.items():
        found = changed(asked, **how) if how else data_and_null("grand-central", 1.0, asked)
        for name, kinds in KINDS_OF.items():
            data, null = szlib.of_kind(found[0], kinds), found[1].of_kind(kinds)
            data = data[data["distance"] < null.r_max]
            against = szlib.OccupancyHistogram.from_samples(null.samples, r_max=null.r_max)
            pair = pairs(data)
            rng, drawn = np.random.default_rng(0), [np.ones(len(data))]
            drawn += [
                rng.multinomial(pair.max() + 1, np.full(pair.max() + 1, 1 / (pair.max() + 1)))[pair]
                for _ in range(RESAMPLES)
            ]
            weighted = [
                szlib.OccupancyHistogram.from_samples(data, r_max=null.r_max, weights=weights)
                for weights in drawn
            ]
            row = {
                "change": change,
                "kinds": name,
                "shifts": null.shifts,
                "encounters": data["encounter"].nunique(),
            }
            for how_measured, radius in (("fitted", szlib.respect_radius), ("binned", half_in_bins)):
                found_radii = [radius(each, against) for each in weighted]
                row[how_measured] = found_radii[0]
                row[f"{how_measured}_low"], row[f"{how_measured}_high"] = np.percentile(
                    found_radii[1:], [2.5, 97.5]
                )
            print(row, file=sys.stderr, flush=True)
            yield row


def changed(
    asked: argparse.Namespace, *, scale: float = 1.0, rate: float = GRAND_CENTRAL_RATE, **how: object
) -> tuple[pd.DataFrame, szlib.NullEncounters]:
    """Samples and null model of Grand Central with one thing changed."""
    tracks, square, _ = load("grand-central")
    if scale != 1 or rate != GRAND_CENTRAL_RATE:
        (x0, x1), (y0, y1) = square.x, square.y
        square = szlib.Square(x=(scale * x0, scale * x1), y=(scale * y0, scale * y1))
        slower = GRAND_CENTRAL_RATE / rate
        rows = tracks[["day", "id", "t", "x", "y"]]
        rows = rows.assign(t=slower * rows["t"], x=scale * rows["x"], y=scale * rows["y"])
        rows.attrs.clear()
        tracks = to_clock(rows, max_gap=0.15)
    square = how.pop("square", square)
    samples = szlib.find_encounters(tracks, square=square)
    return samples, szlib.null_encounters(
        tracks, shifts=FEW, square=square, n_jobs=asked.jobs, progress=False, **how
    )


def half_in_bins(data: szlib.OccupancyHistogram, null: szlib.OccupancyHistogram) -> float:
    """Where g in bins of 0.1 m, all bearings, is 1/2 of that beyond 1.2 m, seen from there [m]; plain."""
    real, model = (each.counts.sum(axis=(0, 1)).reshape(20, -1).sum(axis=1) for each in (data, null))
    middle = (np.arange(20) + 0.5) * data.r_max / 20
    far = middle > 1.2
    g = real / model * model[far].sum() / real[far].sum()
    inside = np.flatnonzero(g < 0.5)
    if not len(inside):
        return 0.0
    k = int(inside[inside < np.argmax(far)][-1])
    return float(np.interp(0.5, g[k : k + 2], middle[k : k + 2]))


if __name__ == "__main__":
    main()
