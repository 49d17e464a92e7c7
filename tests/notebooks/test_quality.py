"""Measures of the quality of a file, on files whose quality is known."""

import numpy as np
import pandas as pd
import pytest
from helpers.thinning import measure_thinning_error
from helpers.track_files import as_1hz, as_tidy
from helpers.track_tables import make_tracks, make_walk, real_data
from studies import quality

import szlib

BEGIN = 1351040400.0  # 10:00 in Japan
LINE = "{:.3f},{},{},{},1650.0,{},0.1,0.1\n"


@pytest.fixture
def day(tmp_path):
    """Person 1 walks at 1 m/s for 10 s, person 2 stands for 10 s an hour later, seen again after 3 s."""
    walk = [(BEGIN + k / 25, 1, round(40 * k), 0, 1000) for k in range(250)]
    stand = [(BEGIN + 3600 + k / 25, 2, 0, 0, 570) for k in range(250)]
    back = [(BEGIN + 3613 + k / 25, 2, 0, 0, 570) for k in range(25)]
    path = tmp_path / "atc-20121024.csv"
    path.write_text(
        "".join(LINE.format(*row) for row in [*walk, *stand, *back]) + "rubbish\n"
    )
    return path


def test_seconds_have_sensor_speed_and_displacement(day):
    rows = quality.summarise_seconds(day)
    walker, stander = rows[rows["id"] == 1], rows[rows["id"] == 2]
    np.testing.assert_allclose(walker["moved"].dropna(), 1.0)
    np.testing.assert_allclose(walker["sensor_speed"], 1.0)
    np.testing.assert_allclose(stander["moved"].dropna(), 0.0)
    np.testing.assert_allclose(stander["sensor_speed"], 0.57)
    assert list(walker["moved"].isna()) == [False] * 9 + [True]
    assert stander["moved"].isna().sum() == 2, "people are not followed across a gap"
    assert rows["rows"].sum() == 525


def test_visits_and_standing_people_are_counted_by_hour(day):
    table = quality.count_visits_by_hour(
        quality.summarise_seconds(day), tz="Asia/Tokyo"
    )
    assert table[["day", "hour", "visits"]].to_numpy().tolist() == [
        ["2012-10-24", 10, 1],
        ["2012-10-24", 11, 1],
    ]
    np.testing.assert_allclose(table["standing"], [0.0, 9 / 11])


def test_frame_intervals_and_longest_gaps(day):
    intervals = quality.measure_frame_intervals(day)
    assert np.isclose(np.median(intervals), 0.04, atol=1e-6)
    assert len(intervals) == 524
    found = quality.summarise_people(day)
    assert found["id"].tolist() == [1, 2]
    np.testing.assert_allclose(found["longest_gap"], [0.04, 3.04], atol=1e-5)
    np.testing.assert_allclose(
        found["last_seen"] - found["first_seen"], [9.96, 13.96], atol=1e-5
    )
    assert found["rows"].tolist() == [250, 275]


def test_formats_without_a_speed_give_nan(tmp_path):
    rows = pd.DataFrame(
        {"t": BEGIN + np.arange(5.0), "id": 1, "x": np.arange(5.0), "y": 0.0}
    )
    (tmp_path / "a.csv").write_text(as_tidy(rows))
    (tmp_path / "b.csv").write_text(as_1hz(rows))
    tidy, hourly = (
        quality.summarise_seconds(tmp_path / "a.csv"),
        quality.summarise_seconds(tmp_path / "b.csv"),
    )
    assert tidy["sensor_speed"].isna().all()
    np.testing.assert_allclose(hourly["sensor_speed"], 1.2)
    np.testing.assert_allclose(tidy["moved"], hourly["moved"])


def test_thinning_error_of_a_bend_is_its_sagitta():
    turn = 2.0 * np.arange(0, 12.01, 0.1) / 5.0  # 2 m/s on a circle of 5 m
    walk = make_walk((0, 0), (1, 0), duration=12.0)
    walk[["x", "y"]] = 5 * np.column_stack([np.cos(turn), np.sin(turn)])
    # between samples 1 s apart the chord is so far from the bend
    sagitta = 5 * (1 - np.cos(0.2))
    rms, high = measure_thinning_error(make_tracks(walk))
    assert rms == pytest.approx(sagitta * np.sqrt(8 / 15), rel=0.05), (
        "the RMS of a parabola over its chord"
    )
    assert sagitta * 0.9 < high < sagitta * 1.01
    straight = make_tracks(make_walk((0, 0), (1, 0.5), duration=12.0))
    assert measure_thinning_error(straight)[0] < 1e-9
    rough = measure_thinning_error(make_tracks(walk), every=2.0)[0]
    assert rough == pytest.approx(4 * rms, rel=0.05), "an error of second order"


def test_thinning_error_of_the_eth_sequence():
    rms, high = measure_thinning_error(
        szlib.read_tracks(real_data("eth") / "seq_eth_obsmat.txt")
    )
    assert 0.04 < rms < 0.06
    assert high < 0.13
