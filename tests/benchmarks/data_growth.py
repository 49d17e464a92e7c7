"""How the data half grows with its rows, 1x to 8x, each with its exponent: 1 is linear (see `make bench`)."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping
from functools import partial
from multiprocessing import get_context
from pathlib import Path

import pandas as pd
from helpers.paper_samples import PAPER_SAMPLES, paper_samples

import szlib
from benchmarks import measuring
from szlib.plaza.generation import make_plaza
from szlib.plaza.settings import PlazaSettings
from szlib.tracks.clock import to_clock
from szlib.tracks.readers import read_raw
from szlib.zones import outliers

TIMES = (1, 2, 4, 8)
SPEEDS = (0.9, 1.1, 1.3)
LINEAR: measuring.Bars = {"exponent": ("<=", 1.15)}
"""As good as linear: a cache that overflows on the way costs a little."""


def raw_plaza(encounters: int | None = None) -> pd.DataFrame:
    """Rows of a plaza as they are in its file: 0.4 million by default."""
    with tempfile.TemporaryDirectory() as folder:
        settings = (
            PlazaSettings()
            if encounters is None
            else PlazaSettings(n_encounters=encounters)
        )
        return read_raw(
            make_plaza(Path(folder) / "plaza.csv", seed=0, settings=settings)
        )


def longer(tracks: pd.DataFrame, times: int) -> pd.DataFrame:
    """The same so many times one after the other, each time by other people: longer, not denser."""
    whole = 10.0 * (int(tracks["t"].max() - tracks["t"].min()) // 10 + 2)
    people = int(tracks["id"].max()) + 1
    copies = [
        tracks.assign(t=tracks["t"] + k * whole, id=tracks["id"] + k * people)
        for k in range(times)
    ]
    joined = pd.concat(copies, ignore_index=True)
    joined.attrs = {}
    return joined


def summarise(
    rows: Mapping[int, int], seconds: Mapping[float, float]
) -> dict[str, float]:
    """Rows and seconds of the smallest and the largest, and the exponent over all."""
    most = max(rows)
    return {
        "rows 1x": rows[1],
        "s 1x": seconds[1],
        f"s {most}x / s 1x": seconds[most] / seconds[1],
        "exponent": measuring.exponent(list(rows.values()), [seconds[n] for n in rows]),
    }


def over(
    tables: Mapping[int, pd.DataFrame], work: Callable[[pd.DataFrame], object]
) -> dict[str, float]:
    """How a function's time grows with its table."""
    seconds = measuring.grow(
        {n: lambda table=table: work(table) for n, table in tables.items()}
    )
    return summarise({n: len(table) for n, table in tables.items()}, seconds)


def bench_clock() -> dict[str, float]:
    raw = raw_plaza()
    return over(
        {n: longer(raw, 4 * n) for n in TIMES}, lambda rows: to_clock(rows, max_gap=0.5)
    )


def bench_encounters() -> dict[str, float]:
    tracks = to_clock(raw_plaza())
    return over({n: longer(tracks, n) for n in TIMES}, szlib.find_encounters)


def shifted(tracks: pd.DataFrame, shifts: int) -> szlib.NullEncounters:
    """A null model, found in this process; by minutes that a short plaza allows."""
    return szlib.null_encounters(
        tracks, shifts=shifts, minutes=(0.5, 2.0), progress=False
    )


def bench_null() -> dict[str, float]:
    """Two shifts of the null model, in this process."""
    tracks = to_clock(raw_plaza(100))
    return over(
        {n: longer(tracks, n) for n in TIMES},
        lambda rows: shifted(rows, 2),
    )


def bench_fit(method: str) -> dict[str, float]:
    """A zone without intervals, of samples from 1/64 to 1/8 of the paper's."""
    tables = {n: paper_samples(n * PAPER_SAMPLES // 64 // 31 * 31) for n in TIMES}
    return over(
        tables,
        lambda samples: szlib.SocialZone.fit(
            samples, method=method, speeds=SPEEDS, n_resamples=0
        ),
    )


def bench_respect() -> dict[str, float]:
    """A zone by respect without intervals, data and null model growing together."""
    tracks = to_clock(raw_plaza(100))
    of: dict[int, tuple[pd.DataFrame, szlib.NullEncounters]] = {}
    for n in TIMES:
        rows = longer(tracks, n)
        of[n] = szlib.find_encounters(rows), shifted(rows, 5)
    fit = partial(szlib.SocialZone.fit, method="respect", speeds=SPEEDS, n_resamples=0)
    seconds = measuring.grow(
        {n: lambda pair=pair: fit(pair[0], null=pair[1]) for n, pair in of.items()}
    )
    return summarise({n: len(samples) for n, (samples, _) in of.items()}, seconds)


def bench_lof() -> dict[str, float]:
    """LOF in the paper's way, up to the paper's size."""
    tables = {n: paper_samples(n * PAPER_SAMPLES // 8 // 31 * 31) for n in TIMES}
    return over(
        tables, lambda samples: outliers.is_outlier(samples, fraction=outliers.FRACTION)
    )


def alone(
    case: Callable[..., dict[str, float]], *arguments: str
) -> Callable[[], dict[str, float]]:
    """The case in a process of its own: what others left of memory makes small sizes fast, not large ones."""

    def run() -> dict[str, float]:
        """Its numbers."""
        with get_context("spawn").Pool(1) as pool:
            return pool.apply(case, arguments)

    return run


CASES: dict[str, Callable[[], dict[str, float]]] = {
    "growth: clock": alone(bench_clock),
    "growth: encounters": alone(bench_encounters),
    "growth: null shifts": alone(bench_null),
    "growth: hull": alone(bench_fit, "hull"),
    "growth: respect": alone(bench_respect),
    "growth: LOF": alone(bench_lof),
}
BARS: dict[str, measuring.Bars] = dict.fromkeys(CASES, LINEAR)
