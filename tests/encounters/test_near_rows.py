"""Rows near the area: they have exactly the encounters of the whole day."""

import numpy as np
import pandas as pd
import polars as pl
import pytest
from helpers.raw_days import (
    assert_selected_as_whole,
    make_raw_day,
    read_near,
    write_raw_day,
)

import szlib
from szlib.encounters.finding import select_near
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
def raw_days(tmp_path_factory):
    folder = tmp_path_factory.mktemp("raw")
    days = (make_raw_day(seed, wild=seed % 2 == 0) for seed in range(4))
    return [
        write_raw_day(folder / f"day{seed}.csv", day) for seed, day in enumerate(days)
    ]


@pytest.mark.parametrize(("square", "duration", "max_gap"), SETTINGS)
def test_encounters_of_selected_rows_equal_those_of_the_whole_day(
    raw_days, square, duration, max_gap
):
    options = {"square": square, "duration": duration, "max_gap": max_gap}
    assert sum(assert_selected_as_whole(day, **options) for day in raw_days) > 0


def test_few_rows_are_selected_and_the_others_counted(tmp_path):
    path = make_plaza(tmp_path / "plaza.csv", settings=PlazaSettings(n_encounters=30))
    assert assert_selected_as_whole(path, square=szlib.ATC_SQUARE, duration=3.0) > 0
    whole, corner = read_raw(path), szlib.Square(x=(-18.5, -17), y=(-10, -9))
    near = read_near(path, corner)
    assert 0 < len(near) < 0.6 * len(whole)
    rejected = {"never near the area": len(whole) - len(near)}
    assert funnels.get(near)[-1]["rejected"] == rejected


def test_where_nobody_comes_near_all_rows_are_kept(tmp_path):
    path = make_plaza(tmp_path / "plaza.csv", settings=PlazaSettings(n_encounters=30))
    elsewhere = read_near(path, szlib.Square(x=(500, 520), y=(500, 520)))
    pd.testing.assert_frame_equal(elsewhere, read_raw(path))


def test_of_doubled_rows_the_first_is_kept_in_every_run():
    n, rng = 100_000, np.random.default_rng(0)
    rows = pl.DataFrame({"id": np.arange(n) % 500, "t": np.arange(n) // 500 * 0.1})
    rows = rows.with_columns(day=pl.lit("any"), x=-12.0, y=rng.uniform(-9, 7, n))
    doubled = pl.concat([rows, rows.with_columns(y=pl.col("y") + 0.2)])
    for _ in range(12):  # a join in parallel may change the order of rows
        first = select(doubled).group_by("id", "t", maintain_order=True).first()
        assert first.join(rows, ["id", "t", "y"], "anti").height == 0


def select(rows, duration=3.0, max_gap=0.5):
    settings = szlib.EncounterSettings(area=szlib.ATC_SQUARE, duration=duration)
    return select_near(settings, rows, None, max_gap)


def test_people_and_days_are_kept_apart():
    """Somebody far away is not selected for the rows of another person, or of another day."""
    here = pl.DataFrame({"t": np.arange(0, 20, 0.1)})
    walks = [
        here.with_columns(
            x=pl.lit(-12.0 if person == 2 else 400.0),
            y=pl.lit(0.0),
            id=pl.lit(person),
            day=pl.lit(day),
        )
        for day in ("2012-10-24", "2012-10-28")
        for person in (1, 2, 3)
    ]
    near = select(pl.concat(walks))
    assert set(near["id"]) == {2} and near.height == 2 * here.height
    assert select(pl.concat(walks), max_gap=None).height == 6 * here.height


@pytest.mark.parametrize("duration", [0.2, 1.0, 3.0, 10.0])
@pytest.mark.parametrize("max_gap", [0.2, 0.5, 3.0])
def test_rows_half_a_second_before_and_a_window_after_are_selected(duration, max_gap):
    """And one gap farther both ways, to interpolate; but few more.

    A person crosses the area within a gap, wherever this falls in the cells: no row is inside.
    """
    width, steps = max_gap + 0.1, np.arange(int(10 * (duration + 3 * max_gap + 3))) / 10
    for cells in 300 + np.linspace(0, 1, 11) + 1e-6:
        last, next_one = cells * width, cells * width + max_gap
        t = np.r_[last - steps[::-1], next_one + steps]
        x = np.where(t <= last, -40.0, 30.0)
        rows = pl.DataFrame({"t": t, "x": x})
        rows = rows.with_columns(day=pl.lit("any"), id=pl.lit(7), y=pl.lit(0.0))
        found = select(rows, duration, max_gap)["t"]
        first, end = last - 0.5 - max_gap, next_one + max(duration, 0.5) + max_gap
        assert found.min() <= first + 1e-6 and found.max() >= end - 0.1 - 1e-6
        assert found.min() >= first - 3 * width and found.max() <= end + 3 * width
        chosen = (t >= found.min()) & (t <= found.max())
        np.testing.assert_array_equal(found, t[chosen])
