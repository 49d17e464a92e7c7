"""Implausible tracks are refused with the probable reason: unit, time, columns, degrees."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from helpers.track_files import RATE, in_seconds, people
from helpers.track_tables import make_tracks, make_walk, real_data

import szlib
from szlib.plaza.generation import make_plaza
from szlib.plaza.settings import PlazaSettings
from szlib.tracks import funnels
from szlib.tracks.readers import read_raw
from szlib.workbook.cli import main
from szlib.workbook.report import format_summary


def table() -> pd.DataFrame:
    """Forty people, t in steps of 0.08 s."""
    return in_seconds(people(3, count=40))


def walkers(speed: float) -> pd.DataFrame:
    """Ten people who walk at about this speed [units of x a second]."""
    walks = [
        make_walk((0, k), (speed * (0.9 + k / 50), 0), person=k, duration=20)
        for k in range(10)
    ]
    return make_tracks(*walks)[["t", "id", "x", "y"]]


def frames() -> pd.DataFrame:
    rows = people(3, count=40)
    return pd.DataFrame(
        {"t": rows["frame"], "id": rows["id"], "x": rows["x"], "y": rows["y"]}
    )


SPOILED = {
    "pass unit='mm'": lambda: table().assign(
        x=lambda t: t["x"] * 1e3, y=lambda t: t["y"] * 1e3
    ),
    "pass unit='cm'": lambda: table().assign(
        x=lambda t: t["x"] * 1e2, y=lambda t: t["y"] * 1e2
    ),
    "pass unit='ft'": lambda: walkers(1.0 / 0.3048),
    "pass time_unit='ms'": lambda: table().assign(t=lambda t: t["t"] * 1e3),
    "only a guess: pass columns={'frame': 't', 'id': 'id', 'x': 'x', 'y': 'y'} and frame_rate=25": frames,
}


@pytest.mark.parametrize("message", SPOILED)
def test_the_error_suggests_what_was_misread(message: str) -> None:
    with pytest.raises(szlib.DataError, match=re.escape(message)):
        read_raw(SPOILED[message]())


@pytest.mark.parametrize(
    "message", ["pass unit='mm'", "pass unit='cm'", "pass time_unit='ms'"]
)
def test_the_suggested_options_give_the_right_table(message: str) -> None:
    with pytest.raises(szlib.DataError) as error:
        read_raw(SPOILED[message]())
    advice = re.search(r"pass (unit|time_unit)='(\w+)'", str(error.value))
    read = read_raw(SPOILED[message](), recipe=szlib.Recipe(**{advice[1]: advice[2]}))
    pd.testing.assert_frame_equal(read, read_raw(table()))


def test_the_suggestion_for_frames_gives_the_right_table() -> None:
    read = szlib.read_tracks(frames(), columns={"frame": "t"}, frame_rate=RATE)
    right = szlib.read_tracks(table())
    pd.testing.assert_frame_equal(read, right)


def test_implausible_files_are_refused_like_tables(tmp_path: Path) -> None:
    spoiled = SPOILED["pass unit='cm'"]()
    spoiled.to_csv(tmp_path / "hall.csv", index=False)
    with pytest.raises(
        szlib.DataError, match=r"hall\.csv: people move at .* m/s .* pass unit='cm'"
    ):
        read_raw(tmp_path / "hall.csv")
    without = tmp_path / "public.csv"
    spoiled.assign(v=1.0, a=0.1).to_csv(without, index=False, header=False)
    guess = r"this is only a guess: pass columns=\{'t': 0, 'id': 1, 'x': 2, 'y': 3\}$"
    with pytest.raises(szlib.DataError, match=guess):
        read_raw(without)
    columns = {"t": 0, "id": 1, "x": 2, "y": 3}
    with pytest.raises(szlib.DataError, match="pass unit='cm'"):
        read_raw(without, recipe=szlib.Recipe(columns=columns))


def test_only_formats_that_leave_doubt_get_a_suggestion(tmp_path: Path) -> None:
    """Times in milliseconds since 1970: every row is rejected. Eight numbers in a row are atc-raw."""
    spoiled = table().assign(t=lambda t: (t["t"] + 1.7e9) * 1e3, v=1.0, a=0.1)
    spoiled.to_csv(tmp_path / "public.csv", index=False, header=False)
    with pytest.raises(
        szlib.DataError, match=r"pass columns=\{'t': 0, 'id': 1, 'x': 2, 'y': 3\}$"
    ):
        read_raw(tmp_path / "public.csv")
    raw = spoiled.assign(x=1e3 * spoiled["x"], y=1e3 * spoiled["y"], b=0.0, c=0.0)
    raw.to_csv(tmp_path / "raw.csv", index=False, header=False)
    with pytest.raises(szlib.DataError, match="as atc-raw; expected a table"):
        read_raw(tmp_path / "raw.csv")


def test_ids_and_times_that_are_exchanged_are_refused(tmp_path: Path) -> None:
    wrong = table().assign(v=1.0, a=0.1)[["id", "t", "x", "y", "v", "a"]]
    wrong.to_csv(tmp_path / "a.csv", index=False, header=False)
    guess = szlib.Recipe(columns={"t": 0, "id": 1, "x": 2, "y": 3})
    with pytest.raises(szlib.DataError, match="id not a whole number"):
        read_raw(tmp_path / "a.csv", recipe=guess)
    right = szlib.Recipe(columns={"t": 1, "id": 0, "x": 2, "y": 3})
    read = read_raw(tmp_path / "a.csv", recipe=right)
    pd.testing.assert_frame_equal(
        read.drop(columns="day"), read_raw(table()).drop(columns="day")
    )


def test_an_implausible_given_unit_warns() -> None:
    spoiled = SPOILED["pass unit='cm'"]()
    with pytest.warns(szlib.DataWarning, match="people move at"):
        assert len(read_raw(spoiled, recipe=szlib.Recipe(unit="m"))) == len(spoiled)


def test_pixels_get_no_advice_that_makes_people_slow() -> None:
    with pytest.raises(
        szlib.DataError,
        match=r"people move at 3\d.* m/s .*; if they are pixels .*, pass scale=0\.032",
    ):
        read_raw(walkers(38.0))
    with pytest.warns(
        szlib.DataWarning, match=r"the median of their speed is 0\.3\d m/s"
    ):
        read_raw(walkers(38.0), recipe=szlib.Recipe(unit="cm"))


@pytest.mark.parametrize(
    ("spoil", "text"),
    [
        (
            lambda rows: rows.assign(x=rows["x"].where(rows.index % 149 > 0, 1e5)),
            "people jump ",
        ),
        (lambda rows: rows.assign(x=rows["x"] * 0.2), "nobody walks"),
    ],
)
def test_what_is_implausible_is_shown_by_every_command(
    tmp_path, capsys, spoil, text
) -> None:
    spoil(walkers(1.3)).to_csv(tmp_path / "hall.csv", index=False)
    area = ["--area", "0", "26", "-1", "10"]
    assert main(["inspect", str(tmp_path / "hall.csv"), *area]) == 0
    assert f"warning: {text}" in capsys.readouterr().out
    for _ in ("done", "kept"):
        assert (
            main(
                [
                    "extract",
                    str(tmp_path / "hall.csv"),
                    "--out",
                    str(tmp_path / "days"),
                    *area,
                ]
            )
            == 0
        )
        assert text in capsys.readouterr().out
    with pytest.warns(szlib.DataWarning, match=text):
        stages = funnels.get(read_raw(tmp_path / "hall.csv"))
    assert [warning for warning in funnels.warnings(stages) if text in warning]
    summary = {"notebooks": {}, "passed": True, "warnings": funnels.warnings(stages)}
    assert f"data: {text}" in format_summary(summary)


def test_a_table_of_standing_people_warns() -> None:
    crowd = make_tracks(
        *(make_walk((k, 0), (0.01, 0), person=k, duration=30) for k in range(9))
    )
    with pytest.warns(szlib.DataWarning, match="nobody walks"):
        read_raw(crowd[["t", "id", "x", "y"]])


@pytest.mark.parametrize("seed", range(3))
def test_plausible_tables_give_no_warning(tmp_path: Path, seed: int) -> None:
    read_raw(in_seconds(people(seed, count=30)))
    plaza = pd.read_csv(
        make_plaza(
            tmp_path / "plaza.csv", seed=seed, settings=PlazaSettings(n_encounters=60)
        ),
        header=None,
    )
    read_raw(
        pd.DataFrame(
            {"t": plaza[0], "id": plaza[1], "x": plaza[2] / 1e3, "y": plaza[3] / 1e3}
        )
    )
    standing = pd.DataFrame({"t": np.arange(9.0), "id": 1, "x": 0.0, "y": 0.0})
    read_raw(standing)


def test_real_data_gives_no_warning() -> None:
    for file in sorted(real_data("atc-1hz").glob("*_test.csv")):
        read_raw(file)
