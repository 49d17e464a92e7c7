"""Respect or emptiness: the tables of notebook 06.

python -m studies.respect nobody      06_nobody.csv     the test without interaction, 100 seeds
python -m studies.respect sites       06_sites.csv      radii, intervals and p-values on the real data
python -m studies.respect n-curve     06_n_curve.csv    hull and respect zone by number of encounters
python -m studies.respect changes     06_changes.csv    the radius at Grand Central, one thing changed

They go to notebooks/tables.  The real data is looked for in $SZLIB_DATA_DIR (atc-1hz/ and gc/).  Rows of the
site "plaza", a small one, are computed again in each run of notebook 06.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterator
from functools import cache, partial
from pathlib import Path

import joblib
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from studies.committed import NULL_MODELS, claim_new_folder, read_arguments, study, write_table
from studies.noninteracting_crowd import noninteracting_crowd
from studies.sites import GRAND_CENTRAL_RATE, read_grand_central

import szlib
from szlib.core.parallel import run_tasks
from szlib.tracks.clock import to_clock
from szlib.workbook import figures
from szlib.zones.respect_test import collect_approaches, fit_radius

Encounters = tuple[pd.DataFrame, szlib.NullEncounters]
"""Samples of a site and its null model."""
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
"""Speed of the zones [m/s]."""
PLAZA_KINDS = ("all", "strangers")
"""Those of a small plaza: it has few others."""
DIRECTIONS = {"ahead": 0.0, "left": 90.0, "behind": -180.0, "right": -90.0}
"""Directions in which the reach of the respect zone is given [deg]."""
POSTERIOR_DRAWS, DRAWS = 400, 30
FAR = (0.5, 0.9)
"""Nearest approaches from which on the test is made again [m]: beyond bodies, and beyond what a tracker of 2012 merges."""
HULLS = 100_000
"""Samples of the null model whose hulls are found, at most: LOF is slow."""
SIZES = (36, 72, 150, 300, 600, 1200, 2400, 4800)


def main() -> None:
    studies = {"nobody": nobody, "sites": sites, "n-curve": n_curve, "changes": changes}
    places = ["atc-1hz", "grand-central", "plaza"]
    asked = read_arguments(__doc__, study=tuple(studies), seeds=100, sites=places, jobs=2, cache=NULL_MODELS)
    table = pd.DataFrame(studies[asked.study](asked))
    write_table(table, f"06_{asked.study.replace('-', '_')}")
    print(table.to_string())


# --- a crowd without interaction ---------------------------------------------------------------------


def nobody(asked: argparse.Namespace) -> list[dict[str, object]]:
    """One row a seed, a size of bunches, a set of kinds."""
    tasks = [joblib.delayed(one_crowd)(seed, bunch) for seed in range(asked.seeds) for bunch in (1, 10)]
    rows = [row for part in run_tasks(tasks, n_jobs=asked.jobs) for row in part]
    return sorted(rows, key=lambda row: (row["bunch"], row["kinds"], row["seed"]))


def one_crowd(seed: int, bunch: int) -> list[dict[str, object]]:
    tracks = noninteracting_crowd(seed=seed, people=500, minutes=30, bunch=bunch)
    place = {"area": szlib.ATC_SQUARE}
    samples = szlib.find_encounters(tracks, **place)
    null = szlib.null_encounters(tracks, shifts=19, seed=seed, progress=False, **place)
    rows = []
    for name in ("all", "opposite, crossing"):
        data, against = szlib.of_kind(samples, SETS[name]), null.of_kind(SETS[name])
        test = szlib.null_test(data, against)
        result = {"p_value": test.p_value, "encounters": test.n_encounters}
        result |= {"radius": test.respect.radius, "radius_low": test.respect.low}
        rows.append({"bunch": bunch, "kinds": name, "seed": seed, "shifts": null.shifts} | result)
    return rows


@study("06_nobody", notebook="06")
def recompute_nobody(row: pd.Series) -> dict[str, object]:
    """A row, again."""
    return {each["kinds"]: each for each in one_crowd(int(row["seed"]), int(row["bunch"]))}[row["kinds"]]


# --- real sites --------------------------------------------------------------------------------------


@cache
def load(site: str) -> tuple[pd.DataFrame, szlib.Area, int]:
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


def make_busy_plaza(seed: int) -> pd.DataFrame:
    """Tracks of a plaza whose people are watched for 20 s: shifted in time, they meet often enough."""
    settings = szlib.PlazaSettings(n_encounters=700, tracked=20.0, intruders=0.02)
    with tempfile.TemporaryDirectory() as folder:
        return szlib.read_tracks(szlib.make_plaza(Path(folder) / "plaza.csv", seed=seed, settings=settings))


CANDIDATES = 12
"""Pairs of a typical distance, of which the one that comes nearest with a delay is shown."""


def shift_a_pair(
    tracks: pd.DataFrame, strangers: pd.DataFrame, around: float = 1.5
) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """Find two strangers who cross, and the delay of one of them at which they come nearest.

    Parameters
    ----------
    tracks : of everybody, as from `szlib.read_tracks`.
    strangers : samples of their encounters, as from `szlib.find_encounters`.
    around : time before and after the encounter [s].

    Returns
    -------
    Paths of both every 0.1 s, that of the second with the delay, shape (n, 2) [m]; and the delay [s].
    """
    near = strangers[strangers["distance"] < 2.0]
    crossing = near[near["kind"] == "crossing"]
    nearest = (crossing if len(crossing) else near).groupby("encounter")["distance"].min()
    typical = (nearest - nearest.median()).abs().sort_values().index[:CANDIDATES]
    samples = strangers[strangers["encounter"].isin(typical)]
    people = tracks[tracks["id"].isin(np.unique(samples[["ref_id", "other_id"]]))]
    delays = np.arange(-40, 41) / 10
    found = []
    for _, one in samples.groupby("encounter"):
        t = np.arange(one["t"].min() - around, one["t"].max() + around + 0.05, 0.1)
        me, other = (people[people["id"] == one[who].iloc[0]] for who in ("ref_id", "other_id"))
        mine = _walk(me, t)
        gaps = [np.hypot(*(mine - _walk(other, t - delay)).T).min() for delay in delays]
        delay = float(delays[int(np.argmin(gaps))])
        found.append((min(gaps), mine, _walk(other, t), _walk(other, t - delay), delay))
    return min(found, key=lambda pair: pair[0])[1:]


def _walk(person: pd.DataFrame, t: np.ndarray) -> np.ndarray:
    """Positions of a person at the times `t` (n,) [s], shape (n, 2) [m]."""
    seen = person[person["t"].between(t[0] - 1, t[-1] + 1)]
    seen = seen if len(seen) else person
    return np.column_stack([np.interp(t, seen["t"], seen[axis]) for axis in "xy"])


def draw_pair(ax: Axes, mine: np.ndarray, other: np.ndarray, name: str) -> None:
    """Draw two paths (n, 2) [m], a dot every 0.5 s, and the line between the two when they are nearest."""
    gap = np.hypot(*(mine - other).T)
    for path, colour in ((mine, figures.BLUE), (other, figures.ORANGE)):
        ax.plot(*path.T, color=colour, linewidth=1)
        ax.plot(*path[::5].T, "o", color=colour, markersize=3)
        ax.annotate("", path[-1], path[-3], arrowprops={"arrowstyle": "-|>", "color": colour})
    ax.plot(*np.transpose([mine[gap.argmin()], other[gap.argmin()]]), "k-", linewidth=2)
    figures.label_metres(ax, f"{name}: {gap.min():.2f} m apart")


def stored(asked: argparse.Namespace, name: str, find: Callable[[], Encounters]) -> Encounters:
    """Samples of a site and its null model, stored between studies."""
    file = asked.cache / f"{name}.joblib"
    if not file.exists():
        claim_new_folder(file.parent, "null models of studies")
        joblib.dump(find(), file)
    return joblib.load(file)


def data_and_null(site: str, asked: argparse.Namespace) -> Encounters:
    """Samples of a site and its null model, stored between studies."""
    return stored(asked, site, partial(find_both, site))


@cache
def find_both(site: str) -> Encounters:
    """Samples of a site and its null model."""
    tracks, square, shifts = load(site)
    samples = szlib.find_encounters(tracks, square=square)
    null = szlib.null_encounters(tracks, shifts=shifts, square=square, progress=False)
    return samples, null


def sites(asked: argparse.Namespace) -> Iterator[dict[str, object]]:
    """One row a site, a set of kinds."""
    for site in asked.sites:
        samples, null = data_and_null(site, asked)
        for name in PLAZA_KINDS if site == "plaza" else SETS:
            data, against = szlib.of_kind(samples, SETS[name]), null.of_kind(SETS[name])
            row = {"site": site, "min_distance": szlib.EncounterSettings().min_distance, "kinds": name}
            row |= describe_site(data, against) | describe_reach(data, against)
            print(row, file=sys.stderr, flush=True)
            yield row


def describe_site(data: pd.DataFrame, null: szlib.NullEncounters) -> dict[str, float]:
    """Numbers of encounters, radii, p-values and sizes of hulls of one set of kinds."""
    test = szlib.null_test(data, null)
    beyond = {far: szlib.null_test(data, null, excluded_below=far) for far in FAR}
    few = max(1, min(null.shifts, HULLS * null.shifts // max(len(null.samples), 1)))
    by_shift = null.samples[null.samples["shift"] < few].groupby("shift")
    hulls = [hull_a(samples) for _, samples in by_shift]
    return {
        "encounters": data["encounter"].nunique(),
        "within_2m": test.n_encounters,
        "null_encounters": len(null.encounters) / null.shifts,
        "shifts": null.shifts,
        **describe_radius(test, "radius"),
        "careless": test.respect.careless,
        "careless_high": test.respect.careless_high,
        "null_radius_high": np.nanpercentile(null_radii(data, null), 97.5),
        "p_value": test.p_value,
        **{f"p_value_beyond_{far}m": found.p_value for far, found in beyond.items()},
        "hull_a": hull_a(data),
        "null_hull_a": np.nanmedian(hulls) if np.isfinite(hulls).any() else np.nan,
    }


def describe_radius(test: szlib.NullTest, name: str) -> dict[str, float]:
    """The radius of the respect zone and its interval [m]."""
    found = test.respect
    return {name: found.radius, f"{name}_low": found.low, f"{name}_high": found.high}


def describe_reach(data: pd.DataFrame, null: szlib.NullEncounters) -> dict[str, float]:
    """Reach of the respect zone in four directions, with its interval [m]; NaN if there is no zone."""
    row = {f"{where}{end}": np.nan for where in DIRECTIONS for end in ("", "_low", "_high")}
    options = {"r_max": null.r_max, "speeds": (SPEED,), "n_resamples": POSTERIOR_DRAWS}
    try:
        zone = fit_quietly(data, method="respect", null=null, **options)
    except szlib.ZoneError:
        return row
    bands = zone.uncertainty.bands
    for where, degrees in DIRECTIONS.items():
        theta = np.radians(degrees)
        band = bands.iloc[(bands["direction"] - theta).abs().argmin()]
        row[where] = float(np.hypot(*zone.shape.boundary(SPEED, theta)))
        row |= {f"{where}_low": band["low"], f"{where}_high": band["high"]}
    return row


def fit_quietly(samples: pd.DataFrame, **options: object) -> szlib.SocialZone:
    """Fit a zone without the warning about sides that lack encounters."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", szlib.DataWarning)
        return szlib.SocialZone.fit(samples, **options)


def null_radii(data: pd.DataFrame, null: szlib.NullEncounters) -> list[float]:
    """Radius of the respect zone of each shift against all others [m]; NaN if there is nothing to compare."""
    found = collect_approaches(data, null, smooth=True)
    return [radius(found, null.r_max, shift) for shift in range(1, 1 + null.shifts)]


def radius(found: pd.DataFrame, r_max: float, shift: int, encounters: np.ndarray | None = None) -> float:
    """Radius of some `encounters` of a `shift`, 0 for the data, against all other shifts [m].

    `found` are the approaches of all (`collect_approaches`). NaN if there is nothing to compare.
    """
    drawn = found[found["shift"] == shift]
    if encounters is not None:
        drawn = drawn[drawn["encounter"].isin(encounters)]
    others = found[(found["shift"] > 0) & (found["shift"] != shift)]
    try:
        return fit_radius(pd.concat([drawn.assign(shift=0), others]), r_max).radius
    except szlib.ZoneError:
        return np.nan


@study("06_sites", notebook="06")
def recompute_sites(row: pd.Series) -> dict[str, float]:
    """A row of the plaza, again, without the reach in four directions."""
    samples, null = find_both("plaza")
    kinds = SETS[row["kinds"]]
    return describe_site(szlib.of_kind(samples, kinds), null.of_kind(kinds))


def hull_a(samples: pd.DataFrame) -> float:
    """Semi-major axis of the paper's zone at 1.1 m/s [m]; NaN where it is undefined."""
    try:
        zone = fit_quietly(samples, method="paper", speeds=(SPEED,), n_resamples=0)
        return zone.ellipses[SPEED].semi_axes[0]
    except szlib.SzlibError:
        return np.nan


# --- by the number of encounters ---------------------------------------------------------------------


def n_curve(asked: argparse.Namespace) -> Iterator[dict[str, object]]:
    """One row a site, a number of encounters of strangers drawn without replacement."""
    for site in asked.sites:
        samples, null = data_and_null(site, asked)
        data, against = szlib.of_kind(samples, "strangers"), null.of_kind("strangers")
        total = data["encounter"].nunique()
        for n in sorted({*(size for size in SIZES if size < total), total}):
            times = 1 if n == total else 3 if site == "plaza" else DRAWS
            row = {"site": site, "kinds": "strangers", "encounters": n, "draws": times}
            row |= describe_draws(data, against, n, times)
            print(row, file=sys.stderr, flush=True)
            yield row


def describe_draws(data: pd.DataFrame, null: szlib.NullEncounters, n: int, times: int) -> dict[str, float]:
    """Mean and interval of what `draws` gives."""
    drawn = pd.DataFrame(draws(data, null, n, times))
    row: dict[str, float] = {}
    for column in drawn:
        row[column] = drawn[column].mean()
        row |= {f"{column}_low": drawn[column].quantile(0.025)}
        row |= {f"{column}_high": drawn[column].quantile(0.975)}
    return row


@study("06_n_curve", notebook="06")
def recompute_n_curve(row: pd.Series) -> dict[str, float]:
    """A row of the plaza, again."""
    samples, null = find_both("plaza")
    strangers, others = szlib.of_kind(samples, row["kinds"]), null.of_kind(row["kinds"])
    return describe_draws(strangers, others, int(row["encounters"]), int(row["draws"]))


def draws(data: pd.DataFrame, null: szlib.NullEncounters, n: int, times: int) -> Iterator[dict[str, float]]:
    """Hull and respect radius of n encounters of the data, and of n of one shift of the null model."""
    rng = np.random.default_rng(n)
    numbers = data["encounter"].unique()
    found = collect_approaches(data, null, smooth=True)
    for k in range(times):
        drawn = rng.choice(numbers, n, replace=False)
        shift = k % null.shifts
        own = null.encounters.loc[null.encounters["shift"] == shift, "encounter"].to_numpy()
        others = rng.choice(own, min(n, len(own)), replace=False)
        yield {
            "hull_a": hull_a(data[data["encounter"].isin(drawn)]),
            "respect": radius(found, null.r_max, 0, drawn),
            "null_respect": radius(found, null.r_max, 1 + shift, others),
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
    """One row a change, a set of kinds: the radius and its interval."""
    cases = [("grand-central", change) for change in CHANGES] + [("plaza", "nothing")]
    for site, change in cases:
        if change == "nothing":
            samples, null = data_and_null(site, asked)
        else:
            find = partial(changed, **CHANGES[change])
            samples, null = stored(asked, f"{site}, {change}", find)
        for name in PLAZA_KINDS if site == "plaza" else KINDS_OF:
            row = {"site": site, "change": change, "kinds": name, "shifts": null.shifts}
            kinds = KINDS_OF[name]
            row |= describe_change(szlib.of_kind(samples, kinds), null.of_kind(kinds))
            print(row, file=sys.stderr, flush=True)
            yield row


def describe_change(data: pd.DataFrame, null: szlib.NullEncounters) -> dict[str, float]:
    """Number of encounters within 2 m, radius and interval of one set of kinds."""
    test = szlib.null_test(data, null)
    return {"encounters": test.n_encounters, **describe_radius(test, "radius")}


@study("06_changes", notebook="06")
def recompute_changes(row: pd.Series) -> dict[str, float]:
    """A row of the plaza, again."""
    samples, null = find_both("plaza")
    kinds = KINDS_OF[row["kinds"]]
    return describe_change(szlib.of_kind(samples, kinds), null.of_kind(kinds))


def changed(*, scale: float = 1.0, rate: float = GRAND_CENTRAL_RATE, **how: object) -> Encounters:
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
    return samples, szlib.null_encounters(tracks, shifts=FEW, square=square, progress=False, **how)


if __name__ == "__main__":
    main()
