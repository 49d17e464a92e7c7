"""How often the verdict is wrong, and the intervals miss, on crowds whose truth is known.

    python tests/benchmarks/truth short                          a few crowds without respect
    python tests/benchmarks/truth none singles groups merging    crowds without respect, 20 of each
    python tests/benchmarks/truth none groups --lone             by the paper's lone encounters
    python tests/benchmarks/truth zone .8 .5                     crowds that swerve around such an ellipse
    python tests/benchmarks/truth zone .8 .8 --orca              crowds that keep a circle by ORCA
    python tests/benchmarks/truth plaza --crowds 40              default plazas of several seeds

`none` takes names of crowds and trackers. Each crowd is printed as it comes, then the counts. `--out FILE`
adds the crowds to a table.
"""

from __future__ import annotations

import argparse
import time
import warnings
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pandas as pd
from crowds import AREA, CROWDS, TRACKERS, as_table, orca, read, singles, swerving

import szlib

SPEED = 1.1  # of the zone [m/s]
SHIFTS = 99
SHORT = ("singles", "groups", "merging", "turnstiles")


def judge_crowds(
    names: list[str], asked: argparse.Namespace
) -> Iterator[dict[str, Any]]:
    """Judge crowds of these names, in which nobody reacts to anybody."""
    for name in names:
        for seed in range(asked.first, asked.first + asked.crowds):
            rng = np.random.default_rng([seed, *name.encode()])
            rows = as_table(CROWDS.get(name, singles)(rng, asked.people, asked.seconds))
            seen = TRACKERS[name](rows, rng) if name in TRACKERS else rows
            row = judge(
                read(seen, rng, rate=asked.rate, noise=asked.noise), lone=asked.lone
            )
            yield {"crowd": name, "seed": seed} | row


def judge_zones(
    names: list[str], asked: argparse.Namespace
) -> Iterator[dict[str, Any]]:
    """Judge crowds that keep an ellipse, and say which intervals hold it."""
    a, b = map(float, names)
    truth = {"a": max(a, b), "b": min(a, b), "area": np.pi * a * b, "center_x": 0.0}
    if a == b:
        truth["radius"] = a
    for seed in range(asked.first, asked.first + asked.crowds):
        rng = np.random.default_rng([seed, 0])
        walks = singles(rng, asked.people, asked.seconds)
        if asked.orca:
            orca(walks, a)
        else:
            swerving(walks, rng, (a, b))
        tracks = read(as_table(walks), rng, rate=asked.rate, noise=asked.noise)
        name = f"swerve around {a:g} m x {b:g} m"
        if asked.orca:
            name = f"ORCA, a circle of {a:g} m"
        row = {"crowd": name, "seed": seed} | judge(tracks, lone=asked.lone)
        yield row | says_truth(row, truth)


def judge_plazas(_: list[str], asked: argparse.Namespace) -> Iterator[dict[str, Any]]:
    """Judge default plazas, by the zone that `szlib fit` gives."""
    settings = szlib.PlazaSettings()
    zone = settings.true_zone(SPEED)
    a, b = zone.semi_axes
    truth = {"a": a, "b": b, "area": zone.area, "center_x": zone.center[0]}
    for seed in range(asked.first, asked.first + asked.crowds):
        with TemporaryDirectory() as folder:
            path = szlib.make_plaza(Path(folder) / "plaza.csv", seed=seed)
            tracks = szlib.read_tracks(path)
        row = {"crowd": "default plazas", "seed": seed}
        row |= judge(tracks, lone=asked.lone, area=szlib.ATC_SQUARE)
        yield row | says_truth(row, truth)


def says_truth(row: dict[str, Any], truth: dict[str, float]) -> dict[str, bool]:
    """Whether the interval of each quantity of a `row` holds its true value."""
    ends = {
        name: [row.get(f"{name}_{end}", np.nan) for end in ("low", "high")]
        for name in truth
    }
    return {
        f"holds_{name}": low <= truth[name] <= high
        for name, (low, high) in ends.items()
    }


def judge(
    tracks: pd.DataFrame, *, lone: bool, area: szlib.Area = AREA
) -> dict[str, Any]:
    """Fit a zone to `tracks`, and describe its verdict and its intervals."""
    start = time.process_time()
    if lone:
        samples = szlib.find_encounters(tracks, area=area)
        null = szlib.null_encounters(tracks, area=area, shifts=SHIFTS, progress=False)
    else:
        samples = szlib.find_pairs(tracks, area=area)
        null = szlib.null_pairs(tracks, area=area, shifts=SHIFTS, progress=False)
    test = szlib.null_test(samples, null)
    sensor = (
        test.sensor is not None and test.sensor.loses_people and test.p_beyond > 0.05
    )
    row: dict[str, Any] = {"n": test.n_encounters, "p": test.p_value}
    row |= {"radius_low": test.respect.low, "radius_high": test.respect.high}
    # Intervals take longest; without respect they cannot make a zone usable.
    options = {"n_resamples": 0} if sensor or not test.is_significant else {}
    try:
        with warnings.catch_warnings(action="ignore", category=szlib.DataWarning):
            zone = szlib.SocialZone.fit(samples, null=null, speeds=[SPEED], **options)
    except szlib.SzlibError as error:
        return row | {"verdict": "no zone", "why": str(error)}
    verdict, table = zone.verdict(SPEED), zone.table().iloc[0]
    for name in ("a", "b", "area", "center_x"):
        row |= {
            each: float(table[each]) for each in (name, f"{name}_low", f"{name}_high")
        }
    row |= {"method": zone.method, "seconds": time.process_time() - start}
    return row | {"verdict": str(verdict), "why": "; ".join(verdict.reasons)}


def count(table: pd.DataFrame) -> pd.DataFrame:
    """One row a crowd: how many were judged, how many "usable", and how many intervals hold the truth."""
    groups = table.assign(usable=table["verdict"] == "usable").groupby("crowd")
    summed = [name for name in table if str(name).startswith("holds_")]
    counts = groups[["usable", *summed]].sum()
    return counts.assign(crowds=groups.size(), median_n=groups["n"].median())


def main() -> None:
    """Judge the crowds that the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=["none", "zone", "plaza", "short"])
    parser.add_argument("names", nargs="*")
    parser.add_argument("--crowds", type=int, default=20)
    parser.add_argument("--first", type=int, default=0, help="first seed")
    parser.add_argument("--people", type=int, default=1200)
    parser.add_argument("--seconds", type=float, default=1800.0, help="recorded")
    parser.add_argument("--rate", type=float, default=10.0)
    parser.add_argument("--noise", type=float, default=0.0)
    parser.add_argument("--lone", action="store_true", help="lone encounters")
    parser.add_argument("--orca", action="store_true", help="zones kept by ORCA")
    parser.add_argument("--out", type=Path)
    asked = parser.parse_args()
    if asked.what == "short":
        asked.names, asked.crowds = list(SHORT), 2
    judges = {"zone": judge_zones, "plaza": judge_plazas}.get(asked.what, judge_crowds)
    found = []
    sensor = f", {asked.rate:g} Hz" if asked.rate != 10 else ""
    sensor += f", {100 * asked.noise:g} cm of noise" if asked.noise else ""
    for row in judges(asked.names, asked):
        row["crowd"] += sensor
        found.append(row)
        print(
            {k: round(v, 3) if isinstance(v, float) else v for k, v in row.items()},
            flush=True,
        )
    table = pd.DataFrame(found).assign(date=datetime.now(UTC).date(), lone=asked.lone)
    if asked.out:
        table.to_csv(asked.out, mode="a", header=not asked.out.exists(), index=False)
    print(count(table).to_string())


if __name__ == "__main__":
    main()
