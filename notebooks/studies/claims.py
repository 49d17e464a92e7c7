"""The paper's claims on every data set, and what moves the zone most: the tables of notebook 25.

python -m studies.claims claims        25_claims.csv        effect, interval, verdict: claim by data set
                                                                    (of delays: the range over scenarios)
python -m studies.claims sensitivity   25_sensitivity.csv   the real day, each parameter varied alone

A claim about the shape of the zone is a difference from the null model (`paper_claims.measure_shape`); the
quantile zone of the data, and that of the null model, are shown beside it as a contrast.
They go to notebooks/tables.  The real data is looked for in $SZLIB_DATA_DIR (atc-1hz/, gc/, magni/, eth/).
"""

from __future__ import annotations

import argparse
import os
import tempfile
import textwrap
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from scipy.stats import t as student_t
from studies import paper_claims as claims
from studies import quantile_zone, sites
from studies.committed import NULL_MODELS, read_arguments, study, write_table
from studies.plaza_truth import true_kinds
from studies.pooling import pool
from studies.respect import stored
from studies.sensitivity import FIT, sensitivity

import szlib
from szlib.workbook import figures
from szlib.zones.outliers import is_outlier

DATA = Path(os.environ.get("SZLIB_DATA_DIR", "."))
KIND = "strangers"
SPEED = 1.1
STORED = {"ATC day": "atc-1hz", "Grand Central": "grand-central"}
"""Null models that `studies.respect` stored."""
SHIFTS = 39
"""Shifts of the other null models."""
ONE_SITE = "a mean needs two sites"
RESAMPLES, FEW = 200, 2
"""Resamples for the intervals, and of those that are computed again in each run of notebook 25 (`probe`)."""
DELAYED_BY_SIZE = "a larger zone makes the robot later"
HOURS_A_DAY = 11.0
"""That ATC is recorded (09:20 to 20:27 on the first day)."""
LESS_CROWDED = "the area has fewer people per square metre than the other space walked on"
WALKED = 3
"""People who walked on each square metre that counts as space walked on."""


def plaza() -> pd.DataFrame:
    with tempfile.TemporaryDirectory() as folder:
        return szlib.read_tracks(szlib.make_plaza(Path(folder) / "plaza.csv", seed=0))


SITES: dict[str, tuple[Callable[[], pd.DataFrame], szlib.Area]] = {
    "plaza": (plaza, szlib.ATC_SQUARE),
    "ATC day": (lambda: szlib.read_tracks(sorted((DATA / "atc-1hz").glob("*.csv"))), szlib.ATC_SQUARE),
    "Grand Central": (
        lambda: sites.read_grand_central(DATA / "gc" / "Annotation.zip"),
        szlib.Square(x=(10.0, 40.0), y=(10.0, 50.0)),
    ),
    "THOR-MAGNI": (
        lambda: szlib.read_tracks(DATA / "magni" / "A.csv"),
        szlib.Square(x=(-9.3, 9.3), y=(-4.0, 3.8)),
    ),
    "ETH": (
        lambda: szlib.read_tracks(DATA / "eth" / "seq_eth_obsmat.txt"),
        szlib.Square(x=(-5.0, 13.5), y=(0.0, 9.5)),
    ),
}
"""Tracks and the open square of each site (the squares of the last three: measured, where people walked)."""


def of_site(name: str, asked: argparse.Namespace) -> Iterator[pd.DataFrame]:
    """The findings of a site, method by method; `probe` is what a run of notebook 25 computes again of `low`."""
    tracks = SITES[name][0]()
    samples, null = stored(asked, STORED.get(name, name), partial(find_both, name))
    plain = [claims.measure_passing_side(samples), lof(name, samples), as_many(name, samples, tracks)]
    plain.append(less_crowded(name, tracks))
    yield claims.tabulate_findings(plain, data=name).assign(method="-", probe=[each.low for each in plain])
    strangers, model = szlib.of_kind(samples, KIND), null.of_kind(KIND)
    shape = claims.measure_shape(strangers, model)
    yield claims.tabulate_findings(shape, data=name).assign(
        method=f"respect, {KIND}", probe=[each.low for each in shape]
    )
    delay, method = later(strangers, model)
    table = claims.tabulate_findings([delay], data=name)
    yield table.assign(method=f"{method}, {KIND}", probe=delay.low)
    for method, people in contrast(strangers, model).items():
        found, few = (of_quantile(people, resamples) for resamples in (RESAMPLES, FEW))
        table = claims.tabulate_findings(found.values(), data=name)
        yield table.assign(method=method, probe=[each.low for each in few.values()])


def find_both(name: str) -> tuple[pd.DataFrame, szlib.NullEncounters]:
    """Samples of a site and its null model."""
    load, square = SITES[name]
    tracks = load()
    samples = szlib.find_encounters(tracks, square=square)
    return samples, szlib.null_encounters(tracks, shifts=SHIFTS, square=square, progress=False)


def contrast(strangers: pd.DataFrame, null: szlib.NullEncounters) -> dict[str, pd.DataFrame]:
    """The people whose quantile zones are compared: the data, and as many encounters of the null model."""
    known = null.samples["encounter"].unique()
    size = min(strangers["encounter"].nunique(), len(known))
    drawn = null.samples["encounter"].isin(np.random.default_rng(0).choice(known, size, replace=False))
    return {f"quantile, {KIND}": strangers, "quantile, null model": null.samples[drawn]}


def pool_sites(table: pd.DataFrame) -> pd.DataFrame:
    """The mean over the real sites of each claim about the shape, where two or more give it."""
    is_shape = (table["method"] == f"respect, {KIND}") & table["claim"].isin(CLAIMS)
    shape = table[is_shape & (table["data"] != "plaza")]
    rows = []
    for claim, part in shape.groupby("claim", sort=False):
        known = part.dropna(subset=["effect"]).set_index("data")[["effect", "low", "high"]]
        found = claims.Finding(
            claim, np.nan, np.nan, np.nan, part["unit"].iloc[0], len(known), reason=ONE_SITE
        )
        if len(known) > 1:  # differences are pooled as they are, like centres
            pooled = pool(dict(zip(known.index, known.to_numpy(), strict=True)), quantity="center_x")
            found = replace(found, effect=pooled.mean, low=pooled.low, high=pooled.high, reason="")
        rows.append(found)
    return claims.tabulate_findings(rows, data="mean of sites").assign(
        method=f"respect, {KIND}", probe=np.nan
    )


@study("25_claims", notebook="25")
def recompute(row: pd.Series) -> dict[str, float]:
    """Effect, number and probe of a row of the plaza, again."""
    samples, null = find_both("plaza")
    strangers, model = szlib.of_kind(samples, KIND), null.of_kind(KIND)
    if row["method"] == "-":
        all_found = [claims.measure_passing_side(samples), lof("plaza", samples)]
    elif row["claim"] == DELAYED_BY_SIZE:
        all_found = [later(strangers, model)[0]]
    elif row["method"].startswith("respect"):
        all_found = claims.measure_shape(strangers, model)
    else:
        people = contrast(strangers, model)[row["method"]]
        all_found = of_quantile(people, FEW, (row["claim"],)).values()
    found = {each.claim: each for each in all_found}[row["claim"]]
    return {"effect": found.effect, "n": found.n, "probe": found.low}


def lof(name: str, samples: pd.DataFrame) -> claims.Finding:
    """Whether LOF removes intruders; undecided where intruders are not known."""
    if name != "plaza":
        return claims.measure_intruders_removed(0, 0)
    close = samples[samples["distance"] <= 2.0]
    removed = is_outlier(close, fraction=0.002, n_neighbours=20)
    intruder = true_kinds(close) == "intruder"
    return claims.measure_intruders_removed(int((removed & intruder).sum()), int(removed.sum()))


def as_many(name: str, samples: pd.DataFrame, tracks: pd.DataFrame) -> claims.Finding:
    """Whether there are as many encounters a day as in the paper; undecided anywhere but in its mall."""
    if name != "ATC day":
        return claims.Finding(claims.ENCOUNTER_RATE, np.nan, np.nan, np.nan, "doublings", 0)
    days = (tracks["t"].max() - tracks["t"].min()) / 3600 / HOURS_A_DAY
    return claims.measure_encounter_rate(samples["encounter"].nunique(), days)


def less_crowded(name: str, tracks: pd.DataFrame) -> claims.Finding:
    """Whether the area has a low density; undecided anywhere but in the paper's mall."""
    if name != "ATC day":
        return claims.Finding(LESS_CROWDED, np.nan, np.nan, np.nan, "doublings", 0)
    return measure_density(tracks, SITES[name][1])


def measure_density(tracks: pd.DataFrame, area: szlib.Area) -> claims.Finding:
    """Doublings from the density of people in the `area` to that in the other space walked on.

    Both are people per square metre, counted on cells of 1 m.  The effect is the mean over the hours of the
    recording, the interval that of Student's t.
    """
    cells = np.floor(tracks[["x", "y"]]).rename(columns={"x": "i", "y": "j"})
    cells["person"] = tracks.groupby(["day", "id"], observed=True).ngroup()
    walked = cells.groupby(["i", "j"])["person"].nunique() >= WALKED
    i, j = (walked[walked].index.get_level_values(name).to_numpy() for name in "ij")
    inside = pd.Series(area.contains(i + 0.5, j + 0.5), index=walked[walked].index, name="inside")
    place = cells.join(inside, on=["i", "j"], how="inner")["inside"]
    hour = tracks.loc[place.index, ["day"]].assign(hour=tracks["t"] // 3600)
    seen = place.groupby([hour["day"], hour["hour"]], observed=True).agg(["sum", "size"])
    density = seen["sum"] / inside.sum(), (seen["size"] - seen["sum"]) / (~inside).sum()
    doublings = np.log2(density[1] / density[0])
    half = doublings.sem() * student_t.ppf((1 + claims.LEVEL) / 2, len(doublings) - 1)
    mean = doublings.mean()
    return claims.Finding(LESS_CROWDED, mean, mean - half, mean + half, "doublings", len(doublings))


def later(strangers: pd.DataFrame, null: szlib.NullEncounters) -> tuple[claims.Finding, str]:
    """What a larger zone costs the robot, with the zone of this site, and the method of that zone."""
    try:
        options = {"null": null, "speeds": (SPEED,), "n_resamples": 0}
        zone = szlib.SocialZone.fit(strangers, **options)
        if zone.method != "respect":
            zone = szlib.SocialZone.fit(strangers, method=quantile_zone.NAME, **options)
    except szlib.SzlibError as error:
        return undecided(DELAYED_BY_SIZE, strangers, error), quantile_zone.NAME
    found = claims.measure_delay_by_size(zone.ellipses[SPEED])
    return replace(found, claim=DELAYED_BY_SIZE, adequate=zone.adequate(SPEED)), zone.method


def undecided(claim: str, people: pd.DataFrame, error: szlib.SzlibError) -> claims.Finding:
    """A claim about a zone that there is not, because of an `error`."""
    n = people["encounter"].nunique()
    return claims.Finding(claim, np.nan, np.nan, np.nan, "", n, False, reason=str(error))


CLAIMS: dict[str, tuple[Callable[[szlib.SocialZone], claims.Finding], tuple[float, ...]]] = {
    claims.LARGER_AHEAD: (claims.measure_reach_ahead, (SPEED,)),
    claims.GROWS_WITH_SPEED: (claims.measure_growth_with_speed, (0.7, 1.3)),
}
"""Each claim about the shape of a zone: how it is measured, and the speeds of the zone [m/s]."""


def of_quantile(
    people: pd.DataFrame, resamples: int, asked: Iterable[str] = tuple(CLAIMS)
) -> dict[str, claims.Finding]:
    """The claims about the quantile zone; undecided where there is none, or too few people on some side."""
    found = {}
    for claim in asked:
        measure, speeds = CLAIMS[claim]
        try:
            zone = szlib.SocialZone.fit(
                people, method=quantile_zone.NAME, speeds=speeds, n_resamples=resamples
            )
            found[claim] = measure(zone)
        except szlib.SzlibError as error:
            found[claim] = undecided(claim, people, error)
    return found


VARIED: dict[str, Mapping[str, Sequence[float]]] = {
    "paper": FIT,
    quantile_zone.NAME: {"r_max": (1.5, 2.5), "q": (0.02, 0.1)},
}
"""Options of each method that are varied, and their values besides the defaults."""


@study("25_sensitivity", notebook="25", has_probe=False)
def move_zone(name: str, methods: Iterable[str] = tuple(VARIED)) -> Iterator[pd.DataFrame]:
    """What moves the zone of a site, method by method."""
    load, square = SITES[name]
    tracks = load()
    for method in methods:
        table = sensitivity(tracks, area=square, method=method, fit=VARIED[method])
        yield table.assign(method=method, data=name)


VERDICTS = {
    "supported": (figures.GREEN, "o", "full"),
    "not supported": (figures.RED, "X", "full"),
    "not decidable": ("#666666", "s", "none"),
}
"""Colour, marker and its fill for each verdict."""


def select_answers(table: pd.DataFrame) -> pd.DataFrame:
    """The rows of 25_claims.csv that decide a claim: of the shape those of the respect zone; no means."""
    decides = ~table["claim"].isin(CLAIMS) | table["method"].str.startswith("respect")
    return table[decides & (table["data"] != "mean of sites")]


def draw_verdicts(answers: pd.DataFrame) -> Figure:
    """Draw the verdict and the effect for each claim and each data set of `answers`, as of `select_answers`."""
    names, places = list(dict.fromkeys(answers["claim"])), list(dict.fromkeys(answers["data"]))
    figure, ax = plt.subplots(figsize=(11, 4.2), layout="constrained")
    for row in answers.to_dict("records"):
        x, y = places.index(row["data"]), names.index(row["claim"])
        text = f"too few: {row['n']}" if row["n"] else "not asked here"
        if np.isfinite(row["effect"]):
            text = f"{row['effect']:+.2f} {row['unit']}".replace("m2", "m²")
            colour, marker, fill = VERDICTS[row["verdict"].partition(" with")[0]]
            ax.plot(x - 0.4, y, marker, color=colour, markersize=10, fillstyle=fill)
        ax.text(x - 0.3, y, text, va="center", color="black" if np.isfinite(row["effect"]) else "#777777")
    for name, (colour, marker, fill) in VERDICTS.items():
        ax.plot([], [], marker, color=colour, markersize=10, fillstyle=fill, label=name)
    ax.set_xticks(range(len(places)), places)
    ax.set_yticks(range(len(names)), [textwrap.fill(name, 42) for name in names], fontsize=9)
    ax.set(xlim=(-0.55, len(places) - 0.45), ylim=(len(names) - 0.5, -0.5))
    ax.xaxis.tick_top()
    ax.tick_params(length=0)
    ax.set_yticks(np.arange(1, len(names)) - 0.5, minor=True)
    ax.grid(axis="y", which="minor", color=figures.GREY, alpha=0.4)
    figures.add_shared_legend([ax])
    return figure


def main() -> None:
    asked = read_arguments(
        __doc__, study=("claims", "sensitivity"), sites=list(SITES), jobs=1, cache=NULL_MODELS
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", szlib.DataWarning)  # the tables say what is not adequate
        if asked.study == "claims":
            table = pd.concat([part for name in asked.sites for part in of_site(name, asked)])
            table = pd.concat([table, pool_sites(table)])
        else:
            table = pd.concat([part for name in ("ATC day", "plaza") for part in move_zone(name)])
    write_table(table, f"25_{asked.study}")
    print(table.to_string())


if __name__ == "__main__":
    main()
