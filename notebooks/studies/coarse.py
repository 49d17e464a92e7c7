"""How much nearer two people seem where positions are far apart in time: `python -m studies.coarse`.

Writes 06_coarse.csv.  A path is straight between two positions, so somebody who steps aside between them seems nearer to
the other.  Of each track one position every `every` seconds is kept, and the nearest approach of each pair is compared with that
of the whole track.  THOR-MAGNI, recorded every 0.4 s, is looked for in $SZLIB_DATA_DIR (magni/); the people of the plaza
turn more sharply.  THOR-MAGNI's paths are straight between positions that are 0.4 s apart, so its numbers are lower bounds.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import pandas as pd
from studies.committed import study, write_table

import szlib
from szlib.tracks.clock import to_clock

EVERY = (0.5, 0.8, 1.0)
"""Times between two positions that are left [s]."""
NEAR = 1.0
"""Pairs that come nearer are compared [m]."""
PLAZA = szlib.PlazaSettings(n_encounters=100, tracked=9.0)
"""Its people are seen for 9 s."""


def load(site: str) -> pd.DataFrame:
    """The tracks of a `site`."""
    if site == "magni":
        return szlib.read_tracks(sorted((Path(os.environ["SZLIB_DATA_DIR"]) / "magni").glob("*.csv")))
    with TemporaryDirectory() as folder:
        return szlib.read_tracks(szlib.make_plaza(f"{folder}/plaza.csv", seed=0, settings=PLAZA))


def thin(tracks: pd.DataFrame, every: float) -> pd.DataFrame:
    """The `tracks` as from one position each `every` seconds."""
    tick = (10 * tracks["t"]).round()
    since = tick - tick.groupby([tracks["day"], tracks["id"]], observed=True).transform("min")
    rows = tracks[since % round(10 * every) == 0]
    return to_clock(rows[["day", "id", "t", "x", "y"]], max_gap=1.5 * every)


def find_nearest(tracks: pd.DataFrame, area: object) -> pd.DataFrame:
    """Time and distance of the nearest approach of each encounter of two people."""
    pairs = szlib.find_pairs(tracks, area=area)
    return pairs.loc[
        pairs.groupby("encounter")["distance"].idxmin(), ["day", "ref_id", "other_id", "t", "distance"]
    ]


def compare(site: str, every: float) -> dict[str, object]:
    """A row of the table: by how much pairs seem nearer [m]; the mean, and that of one pair in 20."""
    tracks = load(site)
    area = szlib.ATC_SQUARE if site == "plaza" else szlib.walked_area(tracks)
    whole, thinned = (find_nearest(each, area) for each in (tracks, thin(tracks, every)))
    both = whole.merge(thinned, on=["day", "ref_id", "other_id"], suffixes=("", "_thinned"))
    both = both[((both["t"] - both["t_thinned"]).abs() < 1) & (both["distance"] < NEAR)]
    nearer = both["distance"] - both["distance_thinned"]
    return {
        "site": site,
        "every": every,
        "pairs": len(both),
        "nearer": nearer.mean(),
        "nearer_in_one_of_20": nearer.quantile(0.95),
    }


def list_rows() -> Iterator[dict[str, object]]:
    """All rows of the table."""
    for site in ("magni", "plaza"):
        for every in EVERY:
            yield compare(site, every)


@study("06_coarse", notebook="06")
def recompute(row: pd.Series) -> dict[str, object]:
    """A row of the plaza, again."""
    return compare("plaza", row["every"])


if __name__ == "__main__":
    table = pd.DataFrame(list_rows())
    write_table(table, "06_coarse")
    print(table.to_string())
