"""Measure how time grows with size, print numbers beside their bars, and save ratios (for `make bench`).

A case of the bench is a dictionary of numbers.  Those whose name holds " / " or "exponent" do not depend on
the machine: `save` appends them to ratios.csv, and `report` prints the last saved value beside each.
"""

from __future__ import annotations

import csv
import subprocess
import time
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from statistics import median

import numpy as np

RATIOS = Path(__file__).with_name("ratios.csv")
_COLUMNS = ("date", "commit", "case", "what", "ratio")
Bars = Mapping[str, tuple[str, float]]
"""Of a number's name: "<=" or ">=", and the bar."""


def exponent(sizes: Sequence[float], costs: Sequence[float]) -> float:
    """p of the least-squares fit costs ~ sizes**p: 1 is linear; costs are seconds or bytes."""
    return float(np.polyfit(np.log(sizes), np.log(costs), 1)[0])


def seconds(call: Callable[[], object]) -> float:
    """How long a call takes, by the clock [s]."""
    begun = time.perf_counter()
    call()
    return time.perf_counter() - begun


def grow(
    work: Mapping[float, Callable[[], object]], repeats: int = 3
) -> dict[float, float]:
    """Median seconds of each size's work: the sizes in turn, after one lap that does not count.

    Seconds of this process's processors: what else the machine does hardly matters.
    """
    laps: list[dict[float, float]] = []
    for _ in range(repeats + 1):
        lap = {}
        for size, call in work.items():
            begun = time.process_time()
            call()
            lap[size] = time.process_time() - begun
        laps.append(lap)
    return {size: median(lap[size] for lap in laps[1:]) for size in work}


def report(case: str, found: Mapping[str, float], bars: Bars | None = None) -> str:
    """A line for each number: its bar, met or not met, and its last saved value."""
    before, lines = _saved(), []
    for what, value in found.items():
        line = f"  {what:<44} {value:>10.4g}"
        if bars and what in bars:
            sign, bar = bars[what]
            met = value <= bar if sign == "<=" else value >= bar
            line += f"   bar {sign} {bar:g}: {'met' if met else 'not met'}"
        if (case, what) in before:
            line += "   ({ratio} at {commit})".format(**before[case, what])
        lines.append(line)
    return "\n".join([case, *lines])


def save(found: Mapping[str, Mapping[str, float]]) -> None:
    """Append the ratios and exponents of all cases to ratios.csv, with today's date and the commit."""
    commit = subprocess.run(
        ["git", "describe", "--always", "--dirty=+"],
        capture_output=True,
        text=True,
        check=True,
        cwd=RATIOS.parent,
    ).stdout.strip()
    today = datetime.now(UTC).strftime("%Y-%m-%d")
    new = not RATIOS.exists()
    with RATIOS.open("a", newline="", encoding="utf-8") as file:
        rows = csv.writer(file, lineterminator="\n")
        if new:
            rows.writerow(_COLUMNS)
        for case, numbers in found.items():
            for what, value in numbers.items():
                if " / " in what or "exponent" in what:
                    rows.writerow([today, commit, case, what, f"{value:.3g}"])


def _saved() -> dict[tuple[str, str], dict[str, str]]:
    """The last saved row of each ratio."""
    if not RATIOS.exists():
        return {}
    with RATIOS.open(newline="", encoding="utf-8") as file:
        return {(row["case"], row["what"]): row for row in csv.DictReader(file)}
