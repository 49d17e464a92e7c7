"""The paper's claims on every data set, and what moves the zone most: the tables of notebook 16.

python tests/studies/claims.py claims        16_claims.csv        effect, interval, verdict: claim by data set
                                                                    (of delays: the range over scenarios)
python tests/studies/claims.py sensitivity   16_sensitivity.csv   the real day, each parameter varied alone

They go to notebooks/tables.  The real data is looked for in $SZLIB_DATA_DIR (atc-1hz/, gc/, magni/, eth/).
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

import szlib
from szlib.plaza.accuracy import true_kinds
from szlib.simulation import paper_claims as claims
from szlib.tracks import sites
from szlib.zones.outliers import is_outlier
from szlib.zones.sensitivity import FIT, sensitivity

TABLES = Path(__file__).parents[2] / "notebooks" / "tables"
DATA = Path(os.environ.get("SZLIB_DATA_DIR", "."))
RESAMPLES = 200
DELAYED_BY_SIZE = "a larger zone makes the robot later"
HOURS_A_DAY = 11.0
"""That ATC is recorded (09:20 to 20:27 on the first day)."""


def plaza() -> pd.DataFrame:
    with tempfile.TemporaryDirectory() as folder:
        return szlib.read_tracks(szlib.make_plaza(Path(folder) / "plaza.csv", seed=0))


SITES: dict[str, tuple[Callable[[], pd.DataFrame], szlib.Square]] = {
    "plaza": (plaza, szlib.ATC_SQUARE),
    "ATC day": (lambda: szlib.read_tracks(sorted((DATA / "atc-1hz").glob("*.csv"))), szlib.ATC_SQUARE),
    "Grand Central": (
        lambda: sites.read_grand_central(DATA / "gc" / "Annotation.zip"),
        szlib.Square(x=(10.0, 40.0), y=(10.0, 50.0)),
    ),
    "THOR-MAGNI": (
        lambda: sites.read_magni(DATA / "magni" / "A.csv"),
        szlib.Square(x=(-9.3, 9.3), y=(-4.0, 3.8)),
    ),
    "ETH": (
        lambda: szlib.read_tracks(DATA / "eth" / "seq_eth_obsmat.txt"),
        szlib.Square(x=(-5.0, 13.5), y=(0.0, 9.5)),
    ),
}
"""Tracks and the open square of each site (the squares of the last three: measured, where people walked)."""


def of_site(name: str) -> Iterator[pd.DataFrame]:
    """The findings of a site, method by method."""
    load, square = SITES[name]
    tracks = load()
    samples = szlib.find_encounters(tracks, square=square)
    plain = [claims.measure_passing_side(samples), lof(name, samples), as_many(name, samples, tracks)]
    yield claims.tabulate_findings(plain, data=name).assign(method="-")
    for method in ("hull", "quantile"):
        for group, people in (("everybody", samples), ("strangers", szlib.of_kind(samples, "strangers"))):
            found = list(of_zone(people, method))
            yield claims.tabulate_findings(found, data=name).assign(method=f"{method}, {group}")


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


def later(zone: szlib.SocialZone) -> claims.Finding:
    """What a larger zone costs the robot, with the zone of this site."""
    found = claims.measure_delay_by_size(zone.ellipses[1.1])
    return replace(found, claim=DELAYED_BY_SIZE, adequate=zone.adequate(1.1))


def of_zone(people: pd.DataFrame, method: str) -> Iterator[claims.Finding]:
    """The claims about a zone; undecided where there is no zone, or too few people on some side."""
    for claim, text, speeds in (
        (claims.measure_reach_ahead, claims.LARGER_AHEAD, (1.1,)),
        (claims.measure_growth_with_speed, claims.GROWS_WITH_SPEED, (0.7, 1.3)),
        (later, DELAYED_BY_SIZE, (1.1,)),
    ):
        try:
            zone = szlib.SocialZone.fit(people, method=method, speeds=speeds, n_resamples=RESAMPLES)
            yield claim(zone)
        except szlib.SzlibError as error:
            print(f"{method}: {error}", file=sys.stderr)
            yield claims.Finding(
                text, np.nan, np.nan, np.nan, "", people["encounter"].nunique(), adequate=False
            )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("study", choices=["claims", "sensitivity"])
    parser.add_argument("--sites", nargs="+", default=list(SITES))
    asked = parser.parse_args()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", szlib.DataWarning)  # the tables say what is not adequate
        if asked.study == "claims":
            table = pd.concat([part for name in asked.sites for part in of_site(name)])
        else:
            tracks, square = SITES["ATC day"][0](), szlib.ATC_SQUARE
            hull, quantile = (
                sensitivity(tracks, area=square, method=method, fit=fit).assign(method=method)
                for method, fit in (("hull", FIT), ("quantile", {"r_max": (1.5, 2.5), "q": (0.02, 0.1)}))
            )
            table = pd.concat([hull, quantile])
    table.to_csv(TABLES / f"16_{asked.study}.csv", index=False, float_format="%.4g")
    print(table.to_string())


if __name__ == "__main__":
    main()
