"""Rows that encounters can depend on: the same encounters in fewer rows; the funnel counts the others."""

from __future__ import annotations

import pandas as pd
import pytest
from helpers.track_tables import make_crowd, make_tracks, make_walk

import szlib
from szlib.encounters.near_rows import select_near_rows
from szlib.tracks import funnels

SQUARE = szlib.Square(x=(0, 14), y=(0, 14))


@pytest.fixture(scope="module")
def crowd() -> pd.DataFrame:
    """People in the square and far from it, in any row order, on two days."""
    days = [
        make_crowd(seed, people=160, seconds=200, square=SQUARE) for seed in (77, 78)
    ]
    far = days[0].assign(id=days[0]["id"] + 1000, x=days[0]["x"] + 100)
    rows = pd.concat(
        [days[0], far, days[1].assign(day="2012-10-28")], ignore_index=True
    )
    return rows.astype({"day": "category"}).sample(frac=1, random_state=0)


@pytest.mark.parametrize(
    "asked", [{}, {"duration": 1.0}, {"kinds": "strangers"}, {"throughout": True}]
)
@pytest.mark.parametrize("narrower", [0.0, 1.0])
def test_near_rows_give_the_same_encounters(
    crowd: pd.DataFrame, asked: dict[str, object], narrower: float
) -> None:
    near = select_near_rows(crowd, SQUARE, 3.0)
    square = SQUARE.grown(-narrower)
    found, whole = (
        szlib.find_encounters(rows, square=square, **asked) for rows in (near, crowd)
    )
    assert len(whole) > 100
    assert (
        near["id"] >= 1000
    ).sum() <= 30 + 5  # nobody far away, but for who is next in the table
    pd.testing.assert_frame_equal(found, whole)


def test_people_elsewhere_and_later_rows_are_dropped(crowd: pd.DataFrame) -> None:
    # inside from 20 to 34 s, within 5 m from 15 to 39 s
    through = make_walk((-20, 4), (1, 0), duration=60)
    near = select_near_rows(
        make_tracks(through, make_walk((-3, 26), (1, 0), person=2)), SQUARE, 3.0
    )
    assert near["id"].unique().tolist() == [1]
    assert near["t"].min() == pytest.approx(15 - 0.5)
    assert near["t"].max() == pytest.approx(39 + 3)
    (stage,) = funnels.get(near)
    assert (stage["entered"], stage["kept"]) == (601 + 41, len(near))
    assert (
        len(select_near_rows(crowd, SQUARE.grown(-6), 3.0))
        < len(select_near_rows(crowd, SQUARE, 3.0)) / 2
    )
    with pytest.raises(szlib.DataError, match="the table is empty"):
        select_near_rows(crowd.iloc[:0], SQUARE, 3.0)
