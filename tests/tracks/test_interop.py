"""What a track table must be, for every format; tables of PedPy."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from helpers.track_files import WRITERS, samples
from helpers.track_tables import make_crowd
from helpers.valid_tracks import check_tracks

import szlib
from szlib.tracks import funnels
from szlib.tracks.clock import COLUMNS, to_clock


@pytest.mark.parametrize("name", WRITERS)
def test_every_format_gives_valid_tracks(tmp_path: Path, name: str) -> None:
    (tmp_path / "recording.csv").write_text(WRITERS[name](samples()))
    check_tracks(szlib.read_tracks(tmp_path / "recording.csv"))


def good_tracks() -> pd.DataFrame:
    raw = make_crowd(1)[["day", "id", "t", "x", "y"]].reset_index(drop=True)
    raw.attrs[funnels.KEY] = [funnels.stage("read by hand", len(raw), len(raw), {})]
    return to_clock(raw)


def test_check_tracks_does_not_change_a_valid_table() -> None:
    tracks = good_tracks()
    before = tracks.copy(deep=True)
    check_tracks(tracks)
    pd.testing.assert_frame_equal(tracks, before)


BROKEN = {
    "missing": lambda t: t.drop(columns="vx"),
    "out of order": lambda t: t.iloc[::-1],
    "multiple of 0.1 s": lambda t: t.assign(t=t["t"] + 0.03),
    "two rows at": lambda t: pd.concat([t, t.tail(1)]),
    "whole numbers": lambda t: t.assign(id=t["id"].astype(str)),
    "expected a day": lambda t: t.assign(x=np.where(t.index == 7, np.nan, t["x"])),
    "from positions": lambda t: t.assign(vx=t["vx"] + 0.1),
    "never bridge a gap": lambda t: t.drop(index=t.index[15]),
    "in this order": lambda t: t[COLUMNS[::-1]],
}


@pytest.mark.parametrize(("message", "spoil"), BROKEN.items(), ids=BROKEN)
def test_check_tracks_names_what_is_wrong(message: str, spoil: object) -> None:
    tracks = good_tracks()
    with pytest.raises(szlib.DataError, match=message):
        check_tracks(spoil(tracks))  # type: ignore[operator]


def test_check_tracks_requires_a_funnel_that_adds_up() -> None:
    tracks = good_tracks()
    tracks.attrs.clear()
    with pytest.raises(szlib.DataError, match="no funnel"):
        check_tracks(tracks)
    tracks.attrs[funnels.KEY] = [
        {"stage": "read", "entered": 9, "kept": 7, "rejected": {"bad": 1}}
    ]
    with pytest.raises(szlib.SzlibError, match="does not add up"):
        check_tracks(tracks)


def test_pedpy_tracks_at_25_hz_are_brought_to_the_clock() -> None:
    pedpy = pytest.importorskip("pedpy")
    frames = np.arange(50)
    data = pd.DataFrame({"id": 3, "frame": frames, "x": 1.2 * frames / 25, "y": 0.5})
    tracks = szlib.read_tracks(pedpy.TrajectoryData(data=data, frame_rate=25.0))
    check_tracks(tracks)
    np.testing.assert_allclose(tracks["x"], 1.2 * tracks["t"])
    np.testing.assert_allclose(tracks["vx"], 1.2)
