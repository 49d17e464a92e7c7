"""What 92 days cost: `SZLIB_RAW_DAYS=FOLDER python -m studies.many_days` writes 24_many_days.csv.

FOLDER holds raw days in the format of ATC, of about 1 GB and 15 million rows each.  Each row of the table is one task in
a process of its own.  The pooled samples are those of a day, repeated as other people with 2 cm of noise.
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path

import joblib
import numpy as np
import pandas as pd
from studies import quantile_zone
from studies.committed import study, write_table

import szlib
from szlib.encounters import Extraction

EXTRACTIONS = ("1 process", "4 processes", "4 Dask workers")
FITS = tuple(
    f"{method}, {n} samples" for n in (16_000, 81_000, 326_000) for method in (quantile_zone.NAME, "paper")
)


def extract(task: str, days: list[Path], out: Path) -> dict[str, float]:
    """Extract `days` with the workers that the `task` names."""
    with ExitStack() as stack:
        n_jobs = int(task[0])
        if "Dask" in task:
            from distributed import Client, LocalCluster

            cluster = stack.enter_context(LocalCluster(n_workers=n_jobs, threads_per_worker=1))
            stack.enter_context(Client(cluster))
            stack.enter_context(joblib.parallel_config("dask"))
            n_jobs = 1
        begin = time.perf_counter()
        found = szlib.extract_days(days, out=out, n_jobs=n_jobs, progress=False)
        seconds = time.perf_counter() - begin
    joblib.externals.loky.get_reusable_executor().shutdown()
    disk = sum(file.stat().st_size for file in out.iterdir()) / 1e6
    return {
        "days": len(days),
        "samples": int(found.table["samples"].sum()),
        "seconds": seconds,
        "disk_mb": disk,
    }


def fit(task: str, one_day: pd.DataFrame) -> dict[str, float]:
    """Fit a zone with the method and to as many samples as the `task` names."""
    method, count, _ = task.replace(",", "").split()
    rng, parts = np.random.default_rng(0), []
    for k in range(-(-int(count) // len(one_day))):
        part = one_day.assign(day=f"day {k}")
        part[["encounter", "ref_id", "other_id"]] += k * 10**8
        part[["los_angle", "distance", "speed"]] += rng.normal(0, 0.02, (len(part), 3))
        parts.append(part.assign(distance=part["distance"].abs(), speed=part["speed"].abs()))
    pooled = pd.concat(parts, ignore_index=True).iloc[: int(count)]
    begin = time.perf_counter()
    szlib.SocialZone.fit(pooled, method=method)
    return {"days": len(parts), "samples": len(pooled), "seconds": time.perf_counter() - begin}


def measure(task: str, days: list[Path], folder: Path) -> dict[str, float]:
    """Run one task; its peak memory is that of its largest process [MB]."""
    if task in EXTRACTIONS:
        found = extract(task, days[: int(task[0])], folder / task)
    else:
        found = fit(task, Extraction.load(folder / EXTRACTIONS[0]).samples())
    peak = max(resource.getrusage(of).ru_maxrss for of in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return found | {"memory_mb": peak / 1024}


@study("24_many_days", notebook="24", has_probe=False)
def measure_all(folder: str) -> pd.DataFrame:
    """Run every task in a process of its own."""
    rows = []
    for task in EXTRACTIONS + FITS:
        run = [sys.executable, "-W", "ignore", "-m", "studies.many_days", task, folder]
        rows.append(json.loads(subprocess.run(run, capture_output=True, text=True, check=True).stdout))
    return pd.DataFrame(rows)


if __name__ == "__main__":
    files = sorted(Path(os.environ["SZLIB_RAW_DAYS"]).glob("*.csv"))
    if sys.argv[1:]:
        task, folder = sys.argv[1:]
        print(json.dumps({"task": task} | measure(task, files, Path(folder))))
    else:
        with tempfile.TemporaryDirectory() as folder:
            write_table(measure_all(folder), "24_many_days")
