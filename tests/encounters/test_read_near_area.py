"""Streaming a raw day: the selected rows have exactly the encounters of the whole day."""

from __future__ import annotations

import gzip
import warnings
from pathlib import Path

import numpy as np
import pandas as pd
import polars as pl
import pytest
from helpers.raw_days import (
    SPACE,
    assert_streamed_as_whole,
    encounters,
    make_raw_day,
    read_near,
    write_raw_day,
)

import szlib
from szlib.encounters import near_rows
from szlib.encounters.near_rows import select_near
from szlib.plaza.generation import make_plaza
from szlib.plaza.settings import PlazaSettings
from szlib.tracks import funnels
from szlib.tracks.readers import read_raw

SETTINGS = [
    (szlib.ATC_SQUARE, 3.0, None),
    (szlib.Square(x=(-16, -10), y=(-8, 6)), 0.3, None),
    (szlib.Square(x=(-16, -4), y=(1, 13)), 1.0, 0.2),
    (szlib.ATC_SQUARE, 2.0, 3.0),
]


@pytest.fixture(scope="module")
def raw_days(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folder = tmp_path_factory.mktemp("raw")
    days = (make_raw_day(seed, wild=seed % 2 == 0) for seed in range(4))
    return [
        write_raw_day(folder / f"day{seed}.csv", day) for seed, day in enumerate(days)
    ]


@pytest.mark.parametrize(
    ("rows_at_once", "seeds"), [(97, (0, 1)), (1000, (2, 3)), (1 << 17, (0, 3))]
)
@pytest.mark.parametrize(("square", "duration", "max_gap"), SETTINGS)
def test_streamed_encounters_equal_those_of_the_whole_day(
    raw_days: list[Path],
    monkeypatch: pytest.MonkeyPatch,
    square: szlib.Area,
    duration: float,
    max_gap: float | None,
    rows_at_once: int,
    seeds: tuple[int, ...],
) -> None:
    monkeypatch.setattr(near_rows, "_BLOCK_ROWS", rows_at_once)
    found = 0
    for seed in seeds:
        found += assert_streamed_as_whole(
            raw_days[seed], square=square, duration=duration, max_gap=max_gap
        )
    assert found > 0


def test_order_of_rows_does_not_matter(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(near_rows, "_BLOCK_ROWS", 1000)
    rows = make_raw_day(1, wild=False)
    shuffled = write_raw_day(
        tmp_path / "shuffled.csv", rows.sample(frac=1, random_state=0)
    )
    path = write_raw_day(tmp_path / "a.csv", rows)
    in_order = read_near(path, szlib.ATC_SQUARE, 1.0)
    given = {"duration": 1.0, "space": SPACE}
    any_order = read_near(shuffled, szlib.ATC_SQUARE, 1.0)
    found = encounters(any_order, **given)
    assert len(found) > 0
    pd.testing.assert_frame_equal(encounters(in_order, **given), found)


def test_gzip_files_and_bad_rows_are_reported_as_by_read_tracks(tmp_path: Path) -> None:
    lines = (
        write_raw_day(tmp_path / "day.csv", make_raw_day(2)).read_text().splitlines()
    )
    for at, bad in (
        (5, "1,2"),
        (900, "no row at all"),
        (901, lines[900] + ",9"),
        (3000, lines[0]),
    ):
        lines.insert(at, bad)
    path = tmp_path / "day.csv.gz"
    path.write_bytes(gzip.compress("\n".join(lines).encode()))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        raw = read_near(path, szlib.ATC_SQUARE)
    with warnings.catch_warnings(record=True) as expected:
        warnings.simplefilter("always")
        whole = read_raw(path)
    assert "first at line 6: rejected rows" in str(caught[0].message)
    assert [str(each.message) for each in caught] == [
        str(each.message) for each in expected
    ]
    assert funnels.get(raw)[0] == funnels.get(whole)[0]
    assert sum(funnels.get(raw)[0]["rejected"].values()) == 3


GOOD = "1351038629.042,{id},-12040,1562,1665.970,945.190,-2.794,-2.906"
DAMAGED = {
    "too few": "1,2",
    "text": "no row at all",
    "blank": "",
    "one more": GOOD + ",9",
    "one more, a truth": GOOD + ",true",
    "an empty one more": GOOD + ",",
    "two more": GOOD + ",9,9",
    "the last is missing": GOOD.replace("-2.906", ""),
    "the last is a text": GOOD.replace("-2.906", "x"),
    "a place with decimals": GOOD.replace("1562", "1562.5"),
    "no place": GOOD.replace("1562", ""),
    "a place in words": GOOD.replace("1562", "nan"),
    "a place beyond integers": GOOD.replace("1562", "99999999999999999999"),
    "a place off Earth": GOOD.replace("1562", "99999999999"),
    "half a person": GOOD.replace("{id}", "{id}.5"),
    "no such time": GOOD.replace("1351038629.042", "1e11"),
    "quotes": GOOD.replace("1562", '"1562"'),
    "not UTF-8": GOOD.replace("1665.970", "\xff"),
}


@pytest.mark.parametrize("bad", DAMAGED.values(), ids=DAMAGED.keys())
def test_damaged_rows_are_rejected_as_by_read_raw(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, bad: str
) -> None:
    monkeypatch.setattr(near_rows, "_BLOCK_ROWS", 7)
    path = tmp_path / "day.csv"
    lines = [(bad if k == 30 else GOOD).format(id=k) for k in range(50)]
    path.write_bytes("\n".join(lines).encode("latin-1"))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        rows = read_near(path, szlib.ATC_SQUARE)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", szlib.DataWarning)
        whole = read_raw(path)
    is_rejected = bool(funnels.get(whole)[0]["rejected"])
    messages = [str(each.message) for each in caught]
    assert any("first at line 31" in each for each in messages) == is_rejected
    assert funnels.get(rows)[0] == funnels.get(whole)[0]
    np.testing.assert_array_equal(rows["id"], whole["id"])
    np.testing.assert_array_equal(rows["y"], whole["y"])


def test_area_without_people_gives_an_empty_table(tmp_path: Path) -> None:
    path = make_plaza(tmp_path / "plaza.csv", settings=PlazaSettings(n_encounters=30))
    assert assert_streamed_as_whole(path, square=szlib.ATC_SQUARE, duration=3.0) > 0
    elsewhere = read_near(path, szlib.Square(x=(500, 520), y=(500, 520)))
    assert len(elsewhere) == 0
    assert list(elsewhere.columns) == ["day", "id", "t", "x", "y"]
    read, near = funnels.get(elsewhere)
    assert near["rejected"] == {"never near the area": read["kept"]}


def test_unreadable_files_raise_as_in_read_tracks(tmp_path: Path) -> None:
    rows = make_raw_day(0)
    mostly_bad = tmp_path / "bad.csv"
    mostly_bad.write_text(
        write_raw_day(tmp_path / "a.csv", rows.head(3)).read_text()
        + "1,2,3,4,5,6,7\n" * 9,
        encoding="utf-8",
    )
    in_metres = write_raw_day(
        tmp_path / "metres.csv", rows.assign(x=rows["x"] / 1000, y=rows["y"] / 1000)
    )
    for path in (mostly_bad, in_metres, tmp_path / "missing.csv", tmp_path):
        with pytest.raises(szlib.DataError) as ours:
            read_near(path, szlib.ATC_SQUARE)
        with pytest.raises(szlib.DataError) as theirs:
            read_raw(path)
        assert str(ours.value) == str(theirs.value)


@pytest.mark.parametrize("duration", [0.2, 1.0, 3.0, 10.0])
@pytest.mark.parametrize("max_gap", [0.2, 0.5, 3.0])
def test_rows_half_a_second_before_and_a_window_after_are_selected(
    duration: float, max_gap: float
) -> None:
    """And one gap farther both ways, to interpolate; but few more.

    A person crosses the area within a gap, wherever this falls in the cells: no row is inside.
    """
    width, steps = max_gap + 0.1, np.arange(int(10 * (duration + 3 * max_gap + 3))) / 10
    for cells in 300 + np.linspace(0, 1, 11) + 1e-6:
        last, next_one = cells * width, cells * width + max_gap
        t = np.r_[last - steps[::-1], next_one + steps]
        rows = pl.DataFrame({"id": 7, "t": t, "x": np.where(t <= last, -40.0, 30.0)})
        rows = rows.with_columns(pl.col("id").cast(pl.Int64), y=pl.lit(0.0))
        blocks = rows.iter_slices(20)
        found = pl.concat(select_near(blocks, szlib.ATC_SQUARE, duration, max_gap))["t"]
        first, end = last - 0.5 - max_gap, next_one + max(duration, 0.5) + max_gap
        assert found.min() <= first + 1e-6 and found.max() >= end - 0.1 - 1e-6
        assert found.min() >= first - 3 * width and found.max() <= end + 3 * width
        chosen = (t >= found.min()) & (t <= found.max())
        np.testing.assert_array_equal(found, t[chosen])
