"""Visits and standing people by the hour: `python -m studies.hours` writes 24_hours.csv.

The real ATC day, from $SZLIB_DATA_DIR, and one hour of a small plaza, which notebook 24 computes again.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterable
from pathlib import Path

import pandas as pd
from studies import quality
from studies.committed import study, write_table

import szlib

SMALL = szlib.PlazaSettings(n_encounters=150)


def count_visits(files: Iterable[Path]) -> pd.DataFrame:
    """Visits and the mean number of people who stand, by the hour, of one day in these files."""
    seconds = pd.concat([quality.summarise_seconds(file) for file in files])
    return quality.count_visits_by_hour(seconds, tz="Asia/Tokyo")[["hour", "visits", "standing"]]


def of_plaza() -> pd.DataFrame:
    with tempfile.TemporaryDirectory() as folder:
        return count_visits([szlib.make_plaza(Path(folder) / "plaza.csv", seed=0, settings=SMALL)])


@study("24_hours", notebook="24")
def recompute(row: pd.Series) -> dict[str, float]:
    """A row of the plaza, again."""
    return of_plaza().set_index("hour").loc[row["hour"]].to_dict()


if __name__ == "__main__":
    mall = sorted((Path(os.environ["SZLIB_DATA_DIR"]) / "atc-1hz").glob("*.csv"))
    write_table(
        pd.concat([count_visits(mall).assign(site="ATC day"), of_plaza().assign(site="plaza")]), "24_hours"
    )
