"""A blind benchmark of the zone of every pair: crowds whose truth is known, drawn without szlib's model.

    python tests/benchmarks/truth none groups --crowds 20 --out groups.csv
    python tests/benchmarks/truth zone .9 .7 --crowds 40 --out zone.csv
    python -m studies.blind groups.csv zone.csv              25_blind.csv

`tests/benchmarks/truth` judges one crowd a row. Here the rows of each kind of crowd are counted: how many have
p <= 0.05, how many are called "usable", and how many intervals hold the truth. The rows of one file are of one
size; its kinds of crowd are counted apart. Kinds of crowd that are in no file keep their rows of the table.
"""

from __future__ import annotations

import sys

import pandas as pd
from studies.committed import study, write_table

from szlib.workbook.record import read_table

HELD = ("a", "b", "area", "center_x")


@study("25_blind", notebook="25", has_probe=False)
def count_crowds(judged: pd.DataFrame) -> pd.DataFrame:
    """One row for each kind of crowd in the rows of one file: numbers of crowds, of those usable, of those held.

    Examples
    --------
    >>> import pandas as pd
    >>> from studies.blind import count_crowds
    >>> rows = {"crowd": "groups", "n": [300, 320], "p": [0.03, 0.6], "verdict": ["undecided", "no respect shown"]}
    >>> count_crowds(pd.DataFrame(rows).assign(date="2026-11-28"))[["crowds", "significant", "usable"]].values.tolist()
    [[2, 1, 0]]
    """
    table = judged.assign(significant=judged["p"] <= 0.05, usable=judged["verdict"] == "usable")
    for name in HELD:  # a crowd without a zone holds nothing
        table[f"held_{name}"] = table.get(f"holds_{name}", pd.Series(pd.NA, table.index))
    kinds = table.groupby("crowd", sort=False)
    counts = kinds[["significant", "usable"]].sum().astype(int)
    held = kinds[[f"held_{name}" for name in HELD]].sum(min_count=1)
    about = pd.DataFrame({"pairs": kinds["n"].median(), "crowds": kinds.size()})
    return about.join(counts).join(held).join(kinds["date"].last()).reset_index()


def main(files: list[str]) -> None:
    """Count the crowds in `files`, and write the table."""
    counted = pd.concat([count_crowds(pd.read_csv(file)) for file in files])
    before = read_table("25_blind")
    others = before[~before["crowd"].isin(counted["crowd"])]
    write_table(pd.concat([others, counted], ignore_index=True), "25_blind")


if __name__ == "__main__":
    main(sys.argv[1:])
