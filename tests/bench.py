"""Speed, as ratios of two things run in turn in this one process: `make bench`.

Prints a table and writes it to results/bench.json.  Bare seconds depend on the machine; ratios hardly.
"""

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median

import numpy as np
import pandas as pd

import szlib
from szlib import datasets, mpc
from szlib.plaza import make_plaza


def seconds(call: Callable[[], object]) -> float:
    begun = time.perf_counter()
    call()
    return time.perf_counter() - begun


def in_turn(first: Callable[[], object], second: Callable[[], object], repeats: int) -> tuple[float, float]:
    """Medians of both, run alternately after one warm-up each."""
    first(), second()
    pairs = [(seconds(first), seconds(second)) for _ in range(repeats)]
    return median(p[0] for p in pairs), median(p[1] for p in pairs)


def bench_step() -> dict[str, float]:
    """One control step, one person, no wall: the problem built once against built anew."""
    zone = szlib.Ellipse((0.1, 0.0), (1.0, 0.7))
    scenario = szlib.SCENARIOS["passing"]
    states = szlib.simulate(scenario, szlib.MPCCBF(zone)).table[["x", "y", "vx", "vy"]].to_numpy()
    once, rebuilt = szlib.MPCCBF(zone), szlib.MPCCBF(zone)
    times = []
    for state in states:
        kept = seconds(lambda: once.step(state, scenario.goal, scenario.people))  # noqa: B023 - called at once
        mpc.Ipopt.build.cache_clear()
        mpc.build_problem.cache_clear()
        anew = seconds(lambda: rebuilt.step(state, scenario.goal, scenario.people))  # noqa: B023
        times.append((kept, anew))
    kept, anew = np.array(times[5:]).T
    return {
        "ms": 1e3 * median(kept),
        "p95 ms": 1e3 * float(np.quantile(kept, 0.95)),
        "rebuilt / built once": median(anew) / median(kept),
    }


def bench_day() -> dict[str, float]:
    """The real 1 Hz day, files to zone, against reading the same files with pandas alone."""
    files = datasets.find("atc-1hz", cache=tempfile.gettempdir())
    ours, pandas = in_turn(
        lambda: szlib.SocialZone.fit(szlib.find_encounters(szlib.read_tracks(files))),
        lambda: pd.concat([pd.read_csv(file, header=None) for file in files]),
        repeats=3,
    )
    return {"s": ours, "ours / pandas read_csv": ours / pandas}


def bench_plaza() -> dict[str, float]:
    """The synthetic plaza: made, written; and read back to its zone."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "plaza.csv"
        made = seconds(lambda: make_plaza(file, seed=0))
        fitted = seconds(lambda: szlib.SocialZone.fit(szlib.find_encounters(szlib.read_tracks(file))))
        return {"made and written s": made, "MB": file.stat().st_size / 1e6, "read to zone s": fitted}


def bench_import() -> dict[str, float]:
    """`import szlib` against an interpreter that imports nothing, as whole processes."""
    ours, bare = in_turn(
        lambda: subprocess.run([sys.executable, "-c", "import szlib"], check=True),
        lambda: subprocess.run([sys.executable, "-c", "pass"], check=True),
        repeats=5,
    )
    return {"s more than bare Python": ours - bare, "ratio": ours / bare}


def main() -> None:
    cases = {"control step": bench_step, "import szlib": bench_import, "plaza": bench_plaza}
    if os.environ.get(datasets.DATA_DIR_VARIABLE):
        cases["1 Hz day, files to zone"] = bench_day
    found = {}
    for name, bench in cases.items():
        found[name] = {key: round(value, 4) for key, value in bench().items()}
        print(
            f"{name:<24}", ", ".join(f"{key}: {value:.3g}" for key, value in found[name].items()), flush=True
        )
    Path("results").mkdir(exist_ok=True)
    Path("results/bench.json").write_text(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
