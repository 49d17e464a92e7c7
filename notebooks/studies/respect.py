"""Respect or emptiness: the tables of notebook 15.

python -m studies.respect nobody      15_nobody.csv     the test without interaction, 100 seeds
python -m studies.respect sites       15_sites.csv      radii, intervals and p-values on the real data
python -m studies.respect n-curve     15_n_curve.csv    hull and respect zone by number of encounters
python -m studies.respect changes     15_changes.csv    the radius at Grand Central, one thing changed

They go to notebooks/tables.  The real data is looked for in $SZLIB_DATA_DIR (atc-1hz/ and gc/).  Rows of the
site "plaza", a small one, are computed again in each run of notebook 15.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from collections.abc import Iterator
from itertools import product
from pathlib import Path

import joblib
import numpy as np
import pandas as pd
from studies.committed import write_table
from studies.noninteracting_crowd import noninteracting_crowd

import szlib
from szlib.parallel import run_tasks
from szlib.tracks.clock import to_clock
from szlib.tracks.sites import GRAND_CENTRAL_RATE, read_grand_central

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
PLAZA_KINDS = ("all", "strangers")
"""Those of a small plaza: it has few others."""
RESAMPLES, DRAWS = 100, 30
HULLS = 100_000
"""Samples of the null model whose hulls are found, at most: LOF is slow."""
SIZES = (36, 72, 150, 300, 600, 1200, 2400, 4800)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("study", choices=["nobody", "sites", "n-curve", "changes"])
    parser.add_argument("--seeds", type=int, default=100)
    parser.add_argument("--sites", nargs="+", default=["atc-1hz", "grand-central", "plaza"])
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument(
        "--cache", type=Path, default=Path("../results/null"), help="where null models are kept"
    )
    asked = parser.parse_args()
    study = {"nobody": nobody, "sites": sites, "n-curve": n_curve, "changes": changes}[asked.study]
    table = pd.DataFrame(study(asked))
    write_table(table, f"15_{asked.study.replace('-', '_')}")
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
        result = {
            "p_value": test.p_value,
            "encounters": test.n_encounters,
            "radius": szlib.respect_radius(data, against),
        }
        rows.append({"bunch": bunch, "kinds": name, "seed": seed, "shifts": null.shifts} | result)
    return rows


def recompute_nobody(row: pd.Series) -> dict[str, object]:
    """A row, again."""
    return {each["kinds"]: each for each in one_crowd(int(row["seed"]), int(row["bunch"]))}[row["kinds"]]


# --- real sites --------------------------------------------------------------------------------------


def load(site: str) -> tuple[pd.DataFrame, szlib.Square, int]:
    """Tracks, square and number of shifts of a site."""
    if site == "plaza":
        with tempfile.TemporaryDirectory() as folder:
            settings = szlib.PlazaSettings(n_encounters=600)
            return (
                szlib.read_tracks(szlib.make_plaza(Path(folder) / "plaza.csv", settings=settings)),
                szlib.ATC_SQUARE,
                3,
            )
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
        kept.parent.mkdir(parents=True, exist_ok=True)
        joblib.dump(find_both(site, min_distance, asked.jobs), kept)
    return joblib.load(kept)


def find_both(site: str, min_distance: float, n_jobs: int = 1) -> tuple[pd.DataFrame, szlib.NullEncounters]:
    """Samples of a site and its null model."""
    tracks, square, shifts = load(site)
    found = {"square": square, "min_distance": min_distance}
    samples = szlib.find_encounters(tracks, **found)
    return samples, szlib.null_encounters(tracks, shifts=shifts, n_jobs=n_jobs, progress=False, **found)


def sites(asked: argparse.Namespace) -> Iterator[dict[str, object]]:
    """One row a site, a min_distance, a set of kinds; intervals from resampled pairs of people."""
    for site, min_distance, (name, kinds) in product(asked.sites, (1.0, 0.0), SETS.items()):
        samples, null = data_and_null(site, min_distance, asked)
        data, against = szlib.of_kind(samples, kinds), null.of_kind(kinds)
        if site == "plaza" and name not in PLAZA_KINDS:
            continue
        row = {"site": site, "min_distance": min_distance, "kinds": name}
        row |= describe_site(data, against, 5 if site == "plaza" else RESAMPLES)
        print(row, file=sys.stderr, flush=True)
        yield row


def describe_site(data: pd.DataFrame, null: szlib.NullEncounters, resamples: int) -> dict[str, float]:
    """Numbers of encounters, radii with intervals, p-values and sizes of hulls of one set of kinds."""
    theta = np.radians([0.0, 90.0, 180.0, 270.0])
    test = szlib.null_test(data, null)
    bodies = szlib.null_test(data, null, excluded_below=0.5)
    fit = szlib.fit_respect(data, null)
    radii = [
        np.r_[szlib.respect_radius(data, null), fit.radii(theta)],
        *resampled(data, null, theta, resamples),
    ]
    low, high = np.percentile(radii[1:], [2.5, 97.5], axis=0)
    row = {"encounters": data["encounter"].nunique(), "within_2m": test.n_encounters}
    row |= {"null_encounters": len(null.encounters) / null.shifts, "shifts": null.shifts}
    for i, where in enumerate(("radius", "ahead", "left", "behind", "right")):
        row |= {where: radii[0][i], f"{where}_low": low[i], f"{where}_high": high[i]}
    row |= {"null_radius_high": np.nanpercentile(null_radii(null), 97.5)}
    row |= {"softness": fit.softness, "ignoring_share": fit.ignoring_share}
    row |= {"p_value": test.p_value, "p_value_beyond_0.5m": bodies.p_value}
    few = max(1, min(null.shifts, HULLS * null.shifts // max(len(null.samples), 1)))
    hulls = [hull_a(null.one(k)) for k in range(few)]
    return row | {
        "hull_a": hull_a(data),
        "null_hull_a": np.nanmedian(hulls) if np.isfinite(hulls).any() else np.nan,
    }


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


def recompute_sites(row: pd.Series) -> dict[str, float]:
    """A row of the plaza, again."""
    samples, null = find_both("plaza", row["min_distance"])
    kinds = SETS[row["kinds"]]
    return describe_site(szlib.of_kind(samples, kinds), null.of_kind(kinds), 5)


def resampled(
    samples: pd.DataFrame, null: szlib.NullEncounters, theta: np.ndarray, resamples: int
) -> Iterator[np.ndarray]:
    """Radius of all bearings, and radii in directions theta, of resampled pairs of people."""
    pair = pairs(samples)
    against = szlib.OccupancyHistogram.from_samples(null.samples, r_max=null.r_max)
    rng = np.random.default_rng(0)
    for _ in range(resamples):
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
        zone = szlib.SocialZone.fit(samples, method="paper", speeds=(SPEED,), n_resamples=0)
        return zone.ellipses[SPEED].semi_axes[0]
    except szlib.SzlibError:
        return np.nan


# --- by the number of encounters ---------------------------------------------------------------------


def n_curve(asked: argparse.Namespace) -> Iterator[dict[str, object]]:
    """One row a site, a set of kinds, a number of encounters drawn without replacement."""
    for site, name in product(asked.sites, ("all", "strangers", "opposite, crossing")):
        samples, null = data_and_null(site, 1.0, asked)
        data, against = szlib.of_kind(samples, SETS[name]), null.of_kind(SETS[name])
        total = data["encounter"].nunique()
        if site == "plaza" and name not in PLAZA_KINDS:
            continue
        for n in sorted({*(size for size in SIZES if size < total), total}):
            times = 1 if n == total else 3 if site == "plaza" else DRAWS
            row = {"site": site, "kinds": name, "encounters": n, "draws": times}
            row |= describe_draws(data, against, n, times)
            print(row, file=sys.stderr, flush=True)
            yield row


def describe_draws(data: pd.DataFrame, null: szlib.NullEncounters, n: int, times: int) -> dict[str, float]:
    """Mean and interval of what `draws` gives."""
    against = szlib.OccupancyHistogram.from_samples(null.samples, r_max=null.r_max)
    drawn = pd.DataFrame(draws(data, null, against, n, times))
    row: dict[str, float] = {}
    for column in drawn:
        row[column] = drawn[column].mean()
        row |= {f"{column}_low": drawn[column].quantile(0.025)}
        row |= {f"{column}_high": drawn[column].quantile(0.975)}
    return row


def recompute_n_curve(row: pd.Series) -> dict[str, float]:
    """A row of the plaza, again."""
    samples, null = find_both("plaza", 1.0)
    kinds = SETS[row["kinds"]]
    n, times = int(row["encounters"]), int(row["draws"])
    return describe_draws(szlib.of_kind(samples, kinds), null.of_kind(kinds), n, times)


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
    cases = [("grand-central", change) for change in CHANGES] + [("plaza", "nothing")]
    for site, change in cases:
        how = CHANGES[change]
        found = changed(asked, **how) if how else data_and_null(site, 1.0, asked)
        for name, kinds in KINDS_OF.items():
            data, null = szlib.of_kind(found[0], kinds), found[1].of_kind(kinds)
            if site == "plaza" and name not in PLAZA_KINDS:
                continue
            row = {"site": site, "change": change, "kinds": name, "shifts": null.shifts}
            row |= describe_radii(data, null, 5 if site == "plaza" else RESAMPLES)
            print(row, file=sys.stderr, flush=True)
            yield row


def describe_radii(data: pd.DataFrame, null: szlib.NullEncounters, resamples: int) -> dict[str, float]:
    """The radius fitted and in bins, with intervals, of one set of kinds."""
    data = data[data["distance"] < null.r_max]
    against = szlib.OccupancyHistogram.from_samples(null.samples, r_max=null.r_max)
    pair = pairs(data)
    rng, drawn = np.random.default_rng(0), [np.ones(len(data))]
    drawn += [
        rng.multinomial(pair.max() + 1, np.full(pair.max() + 1, 1 / (pair.max() + 1)))[pair]
        for _ in range(resamples)
    ]
    weighted = [
        szlib.OccupancyHistogram.from_samples(data, r_max=null.r_max, weights=weights) for weights in drawn
    ]
    row: dict[str, float] = {"encounters": data["encounter"].nunique()}
    for how_measured, radius in (("fitted", szlib.respect_radius), ("binned", half_in_bins)):
        radii = [radius(each, against) for each in weighted]
        low, high = np.percentile(radii[1:], [2.5, 97.5])
        row |= {how_measured: radii[0], f"{how_measured}_low": low, f"{how_measured}_high": high}
    return row


def recompute_changes(row: pd.Series) -> dict[str, float]:
    """A row of the plaza, again."""
    samples, null = find_both("plaza", 1.0)
    kinds = KINDS_OF[row["kinds"]]
    return describe_radii(szlib.of_kind(samples, kinds), null.of_kind(kinds), 5)


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
