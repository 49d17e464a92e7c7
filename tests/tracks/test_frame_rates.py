"""The frame rate of EWAP files: estimated from velocities, given, or refused."""

from __future__ import annotations

import warnings
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from helpers.track_tables import real_data
from studies import quality

import szlib
from szlib.encounters.finding import select_near
from szlib.tracks import funnels, to_clock
from szlib.tracks.readers import load_files, merge_files

CONVENTIONS = {"to the next": (0, 1), "from the last": (-1, 0), "over both": (-1, 1)}


def ewap(
    folder: Path,
    *,
    rate: float,
    convention: str = "over both",
    every: int = 10,
    noise: float = 0.0,
    people: int = 6,
) -> Path:
    """A file of people who walk in bends, annotated at every so many frames."""
    rng = np.random.default_rng(0)
    lines = []
    for person in range(6):
        frames = every * (np.arange(30) + 7 * person)
        heading = rng.uniform(-np.pi, np.pi) + np.cumsum(rng.normal(0, 0.1, 30))
        steps = 1.2 * every / rate * np.column_stack([np.cos(heading), np.sin(heading)])
        path = np.cumsum(steps, axis=0) + rng.normal(0, noise, (30, 2))
        first, last = (
            np.clip(np.arange(30) + reach, 0, 29) for reach in CONVENTIONS[convention]
        )
        velocity = (
            (path[last] - path[first])
            / np.maximum(frames[last] - frames[first], 1)[:, None]
            * rate
        )
        lines += [
            f"{frame:.7e} {person:.7e} {x:.7e} 0.0 {y:.7e} {vx:.7e} 0.0 {vy:.7e}\n"
            for frame, (x, y), (vx, vy) in zip(frames, path, velocity, strict=True)
        ]
    file = folder / "sequence.txt"
    file.write_text("".join(lines))
    return file


def read_stage_name(tracks: pd.DataFrame) -> str:
    return str(funnels.get(tracks)[0]["stage"])


def median_speed(tracks: pd.DataFrame) -> float:
    return float(np.hypot(tracks["vx"], tracks["vy"]).median())


@pytest.mark.parametrize("convention", CONVENTIONS)
@pytest.mark.parametrize("rate", [15, 25])
def test_the_frame_rate_is_estimated_from_velocities(
    tmp_path: Path, rate: int, convention: str
) -> None:
    tracks = szlib.read_tracks(
        ewap(tmp_path, rate=rate, convention=convention, noise=0.05)
    )
    assert read_stage_name(tracks) == f"read sequence.txt at {rate} frames/s"
    assert median_speed(tracks) == pytest.approx(1.2, rel=0.06)
    assert tracks["t"].max() == pytest.approx(10 * 64 / rate, abs=0.1)


@pytest.mark.parametrize("rate", [12.5, 30])
def test_an_unusual_frame_rate_has_to_be_given(tmp_path: Path, rate: float) -> None:
    file = ewap(tmp_path, rate=rate)
    with pytest.raises(szlib.DataError, match="counts frames; pass frame_rate="):
        szlib.read_tracks(file)
    tracks = szlib.read_tracks(file, frame_rate=rate)
    assert median_speed(tracks) == pytest.approx(1.2, rel=0.05)
    assert read_stage_name(tracks) == f"read sequence.txt at {rate:g} frames/s"


def test_a_given_frame_rate_is_used(
    tmp_path: Path,
) -> None:
    file = ewap(tmp_path, rate=25)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        pd.testing.assert_frame_equal(
            szlib.read_tracks(file, frame_rate=25), szlib.read_tracks(file)
        )


def spoiled(file: Path, velocity: float | None) -> Path:
    """Velocities all the same, or of no meaning."""
    rng = np.random.default_rng(1)
    rows = [line.split() for line in file.read_text().splitlines()]
    for row in rows:
        row[5], row[7] = (
            f"{v:.3f}"
            for v in (rng.normal(0, 1, 2) if velocity is None else [velocity] * 2)
        )
    file.write_text("".join(" ".join(row) + "\n" for row in rows))
    return file


@pytest.mark.parametrize(
    "velocity", [0.0, 1.0, None], ids=["none", "all the same", "noise"]
)
def test_useless_velocities_require_a_given_frame_rate(
    tmp_path: Path, velocity: float | None
) -> None:
    file = spoiled(ewap(tmp_path, rate=25), velocity)
    with pytest.raises(
        szlib.DataError,
        match="counts frames; pass frame_rate=",
    ):
        szlib.read_tracks(file)
    assert median_speed(szlib.read_tracks(file, frame_rate=25)) == pytest.approx(
        1.2, rel=0.05
    )


def test_a_frame_rate_is_refused_where_times_are_in_seconds(tmp_path: Path) -> None:
    (tmp_path / "tidy.csv").write_text("t,id,x,y\n0,1,0,0\n0.1,1,1,0\n")
    with pytest.raises(
        szlib.DataError,
        match="its times are in seconds; leave frame_rate out",
    ):
        szlib.read_tracks(tmp_path / "tidy.csv", frame_rate=25)
    for wrong in (0, -15, float("nan"), 1e10):
        with pytest.raises(
            szlib.DataError,
            match=r"frame_rate must be frames a second from 1 to 1e\+09; got",
        ):
            szlib.read_tracks(ewap(tmp_path, rate=25), frame_rate=wrong)


def test_quality_and_encounters_use_the_estimated_frame_rate(tmp_path: Path) -> None:
    file = ewap(tmp_path, rate=25)
    assert np.median(quality.measure_frame_intervals(file)) == pytest.approx(0.4)
    assert quality.summarise_people(file).eval(
        "last_seen - first_seen"
    ).to_numpy() == pytest.approx(29 * 0.4)
    square = szlib.Square(x=(-50, 50), y=(-50, 50))
    settings = szlib.EncounterSettings(area=square, min_distance=0.0)
    whole = szlib.find_encounters(szlib.read_tracks(file), settings=settings)
    for options in (szlib.Recipe(), szlib.Recipe(frame_rate=25)):
        rows = merge_files(
            load_files(file, options), select=partial(select_near, settings)
        )
        tracks = to_clock(rows, max_gap=options.max_gap)
        found = szlib.find_encounters(tracks, settings=settings)
        pd.testing.assert_frame_equal(found, whole)


def test_the_eth_sequence_has_15_frames_a_second() -> None:
    tracks = szlib.read_tracks(real_data("eth") / "seq_eth_obsmat.txt")
    assert read_stage_name(tracks) == "read seq_eth_obsmat.txt at 15 frames/s"
    assert median_speed(tracks) == pytest.approx(1.4, abs=0.2)
