"""Speed and memory of the data half at full size, as ratios within one run (see `make bench`).

The raw day is $SZLIB_RAW_DAY, a file in the raw ATC format, else one made of the plaza, repeated until it
is as large as a real one.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from statistics import median
from typing import NamedTuple

import polars as pl
from helpers.paper_samples import paper_samples
from sklearn.neighbors import LocalOutlierFactor

import szlib
from benchmarks import measuring
from szlib.plaza.generation import make_plaza
from szlib.zones import outliers

RAW_DAY_VARIABLE = "SZLIB_RAW_DAY"
ROWS = 15_000_000
"""Of a real day."""

BARE = """
import sys, polars as pl
# begin
pl.scan_csv(sys.argv[1], has_header=False).collect(engine="streaming")
"""
OURS = """
import sys, szlib, tempfile
szlib.extract_days
# begin
for day in sys.argv[1:]:
    with tempfile.TemporaryDirectory() as out:
        done = szlib.extract_days(day, out=out, progress=False)
        if len(done.failed):
            raise SystemExit(str(done))
"""
PANDAS = """
import sys, numpy as np, pandas as pd
# begin
rows = pd.read_csv(sys.argv[1], header=None, usecols=[0, 1, 2, 3], names=["t", "id", "x", "y"])
rows["tick"] = (rows["t"] * 10).round().astype(int)
ticks = rows.groupby(["id", "tick"], as_index=False)[["x", "y"]].mean()
ticks[["vx", "vy"]] = ticks.groupby("id")[["x", "y"]].diff(5)
near = ticks[ticks["x"].between(-18500, -7500) & ticks["y"].between(-10000, 8000)]
pairs = near.merge(near, on="tick")
"""
"""Reads, brings to the clock and pairs; no window is looked for."""
ZONE = """
import sys
sys.path.insert(0, sys.argv[1])
import szlib
from helpers.paper_samples import paper_samples
samples = paper_samples()
# begin
szlib.SocialZone.fit(samples)
"""
_TIMED = """
import time, resource
{imports}
begun = time.perf_counter(), time.process_time()
{program}
used = time.perf_counter() - begun[0], time.process_time() - begun[1]
print(*used, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3)
"""


class Run(NamedTuple):
    """What a program took: by the clock and of processors [s], without imports, and peak memory [MB]."""

    seconds: float
    processor: float
    memory: float


def run(program: str, *files: Path) -> Run:
    """A program in a process of its own."""
    imports, program = program.split("# begin")
    environment = os.environ | {"PYTHONPATH": str(Path(szlib.__file__).parents[1])}
    done = subprocess.run(
        [
            sys.executable,
            "-c",
            _TIMED.format(imports=imports, program=program),
            *map(str, files),
        ],
        capture_output=True,
        text=True,
        check=True,
        env=environment,
    )
    return Run(*map(float, done.stdout.split()[-3:]))


@contextmanager
def raw_day() -> Iterator[Path]:
    """A raw day of full size."""
    given = os.environ.get(RAW_DAY_VARIABLE)
    if given:
        yield Path(given)
        return
    with tempfile.TemporaryDirectory() as folder:
        names = [f"column_{k}" for k in range(1, 9)]
        plaza = pl.read_csv(
            make_plaza(Path(folder) / "plaza.csv", seed=0),
            has_header=False,
            new_columns=names,
        )
        copies = -(-ROWS // plaza.height)
        shift = (
            plaza["column_1"].max() - plaza["column_1"].min()
        ) / 20  # people of other copies come between
        day = Path(folder) / "day.csv"
        people = plaza["column_2"].max()
        pl.concat(
            [
                plaza.lazy().with_columns(
                    column_1=pl.col("column_1") + shift * copy / copies,
                    column_2=pl.col("column_2") + people * copy,
                    column_3=pl.col("column_3") + 37_000.0 * (copy - copies / 2),
                )
                for copy in range(copies)
            ]
        ).sort("column_1").sink_csv(day, include_header=False, float_precision=3)
        yield day


def bench_raw_day(repeats: int = 5) -> dict[str, float]:
    """A full raw day to encounters against a bare streaming scan; and direct pandas."""
    with raw_day() as day:
        run(BARE, day), run(OURS, day)
        laps = [(run(OURS, day), run(BARE, day)) for _ in range(repeats)]
        pandas = run(PANDAS, day)
    ours, bare = (median(runs[k].seconds for runs in laps) for k in range(2))
    busy = [median(runs[k].processor for runs in laps) for k in range(2)]
    return {
        "s": ours,
        "ours / bare scan": ours / bare,
        "least ratio": min(mine.seconds / scan.seconds for mine, scan in laps),
        "processor time / bare scan": busy[0] / busy[1],
        "peak MB": max(mine.memory for mine, _ in laps),
        "pandas s": pandas.seconds,
        "pandas / ours": pandas.seconds / ours,
        "pandas peak MB": pandas.memory,
    }


def bench_days(repeats: int = 3) -> dict[str, float]:
    """1, 2 and 4 days one after the other: time per day, and peak memory, against those of one day."""
    found = {}
    with raw_day() as day:
        rounds = [{n: run(OURS, *[day] * n) for n in (1, 2, 4)} for _ in range(repeats)]
    one, memory = (
        median(r[1].seconds for r in rounds),
        median(r[1].memory for r in rounds),
    )
    for n in (2, 4):
        found[f"{n} days / {n} x one"] = median(r[n].seconds for r in rounds) / (
            n * one
        )
        found[f"{n} days, memory / one"] = median(r[n].memory for r in rounds) / memory
    return found


def bench_lof() -> dict[str, float]:
    """LOF on as many samples as the paper's, against scikit-learn's own; and by whole encounters."""
    samples = paper_samples()
    points = outliers.complementary_points(samples)
    begun = time.perf_counter()
    sklearn_labels = (
        LocalOutlierFactor(contamination=outliers.FRACTION).fit_predict(points) == -1
    )
    between = time.perf_counter()
    ours = outliers.is_outlier(samples, fraction=outliers.FRACTION)
    ended = time.perf_counter()
    outliers.is_outlier(samples)
    return {
        "s": ended - between,
        "whole encounters s": time.perf_counter() - ended,
        "ours / scikit-learn": (ended - between) / (between - begun),
        "labels that differ": float((ours != sklearn_labels).sum()),
    }


def bench_zone() -> dict[str, float]:
    """From as many samples as the paper's to zones: outliers, hull, slices, ellipses."""
    zone = run(ZONE, Path(__file__).parents[1])
    return {"s": zone.seconds, "peak MB": zone.memory}


CASES: dict[str, Callable[[], dict[str, float]]] = {
    "raw day to encounters": bench_raw_day,
    "1, 2, 4 raw days": bench_days,
    "LOF, paper size": bench_lof,
    "zone, paper size": bench_zone,
}

BARS: dict[str, measuring.Bars] = {
    "raw day to encounters": {"ours / bare scan": ("<=", 1.7)}
}
"""Of a case: what its numbers are held against."""
