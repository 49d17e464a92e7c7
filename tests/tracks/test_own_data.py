"""Files in the shapes that people have are read, at most with the options that the error proposes."""

from __future__ import annotations

import re
import shlex
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa
import pytest
from helpers.file_shapes import BEGIN, SHAPES, TEXTS, hall, write_shape
from helpers.track_files import BEGIN as ATC_BEGIN
from helpers.track_files import write

import szlib
from szlib.tracks.readers import read_raw
from szlib.tracks.recipe import COMMAND_VARIABLE, arguments
from szlib.workbook import folders
from szlib.workbook.cli import main
from szlib.workbook.record import DataCache, ZoneMethod
from szlib.workbook.record.parameters import check_parameters

REFUSED = {"hall.xlsx": "save the sheet as CSV"}
AREA = ["--area", "0", "12", "0", "8"]


def proposed(text: str) -> list[str]:
    """The first command that an error proposes."""
    return shlex.split(re.search(r"try: szlib (.*?)(?:; |\n|$)", text)[1])


# what only the user knows: no error can propose it
UNKNOWN = ("headerless.txt", "unknown-names.csv")


@pytest.mark.parametrize("name", [name for name in SHAPES if name not in UNKNOWN])
def test_every_shape_is_read_with_the_options_that_errors_propose(
    name: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    command = ["inspect", str(write_shape(name, tmp_path)), *AREA]
    for _ in range(3):
        monkeypatch.setenv(COMMAND_VARIABLE, shlex.join(["szlib", *command]))
        if main(command) == 0:
            break
        message = capsys.readouterr().err
        if name in REFUSED:
            assert REFUSED[name] in message
            return
        command = proposed(message)
    printed = capsys.readouterr().out
    kept = re.search(
        r"^read .*?kept +([\d,]+)", printed, flags=re.DOTALL | re.MULTILINE
    )
    assert kept[1] == "1,040"
    assert "40 people" in printed and re.search(r"speed 1\.\d+ m/s \(median\)", printed)
    last = shlex.split(printed.splitlines()[-1])
    assert last == ["go", "on", "with:", "szlib", *command, "--save"]


SAME = [name for name in TEXTS if name not in ("magni.csv", "obsmat.txt")]
GIVEN: dict[str, dict] = {
    "iso-local.csv": {"tz": "Europe/Berlin"}, "frames.csv": {"frame_rate": 25},
    "pixels.csv": {"frame_rate": 25, "scale": 0.02}, "mm.csv": {"unit": "mm"}, "cm.csv": {"unit": "cm"},
    "feet.csv": {"unit": "ft"},
    "headerless.txt": {"columns": {"frame": 0, "id": 1, "x": 2, "y": 3}, "frame_rate": 25},
    "unknown-names.csv": {"columns": dict(zip(("t", "id", "x", "y"), "abcd", strict=True))},
}  # fmt: skip


@pytest.mark.filterwarnings("ignore::szlib.DataWarning")
@pytest.mark.parametrize("name", SAME)
def test_every_shape_holds_the_same_people(name: str, tmp_path: Path) -> None:
    options = szlib.Recipe(**GIVEN.get(name, {}))
    read = read_raw(write_shape(name, tmp_path), recipe=options)
    right = hall().sort_values(["id", "t"], ignore_index=True)
    if name == "text-ids.csv":
        order = read.groupby("id", sort=False)["t"].agg(["min", "max"])
        assert len(order) == right["id"].nunique()
        read = read.sort_values(["x", "y", "t"])
        right = right.sort_values(["x", "y", "t"])
    else:
        assert read["id"].tolist() == right["id"].tolist()
    since = ATC_BEGIN if name == "atc-1hz.csv" else BEGIN
    since = since if read["t"].min() > 1e8 else 0
    np.testing.assert_allclose(read["t"] - since, right["t"], atol=1e-6)
    np.testing.assert_allclose(read[["x", "y"]], right[["x", "y"]], atol=1e-3 + 2e-9)


def test_the_day_is_that_of_the_file_then_of_the_option_then_of_utc(
    tmp_path: Path,
) -> None:
    """The recording begins at 22:13 UTC, when it is the next day in Tokyo."""
    with_zone = write_shape("iso-zone.csv", tmp_path)
    assert set(read_raw(with_zone)["day"]) == {"2023-11-15"}
    assert set(read_raw(with_zone, recipe=szlib.Recipe(tz="UTC"))["day"]) == {
        "2023-11-14"
    }
    nanoseconds = write_shape("nanoseconds.csv", tmp_path)
    assert set(read_raw(nanoseconds)["day"]) == {"2023-11-14"}
    assert set(read_raw(nanoseconds, recipe=szlib.Recipe(tz="Asia/Tokyo"))["day"]) == {
        "2023-11-15"
    }
    moments = pd.to_datetime(hall()["t"] + BEGIN, unit="s", utc=True).dt.tz_convert(
        "Asia/Tokyo"
    )
    assert set(read_raw(hall().assign(t=moments).drop(columns="frame"))["day"]) == {
        "2023-11-15"
    }


def test_a_text_id_has_the_same_number_in_every_file(tmp_path: Path) -> None:
    both = pd.read_csv(write_shape("text-ids.csv", tmp_path)).sort_values("t")
    half = both["t"] < both["t"].median()
    for name, rows in {"a.csv": both[half], "b.csv": both[~half]}.items():
        rows.to_csv(tmp_path / name, index=False)
    parts = szlib.read_tracks([tmp_path / "a.csv", tmp_path / "b.csv"])
    whole = szlib.read_tracks(tmp_path / "text-ids.csv")
    assert set(parts["id"]) == set(whole["id"])


def test_a_unit_in_a_name_is_used_and_a_given_one_replaces_it(tmp_path: Path) -> None:
    rows = hall()[["t", "id", "x", "y"]].assign(
        x=lambda r: r["x"] * 1e3, y=lambda r: r["y"] * 1e3
    )
    table = rows.set_axis(["Time (s)", "Person ID", "X [mm]", "Y [mm]"], axis=1)
    assert read_raw(table)["x"].max() == hall()["x"].max()
    with pytest.warns(szlib.DataWarning, match="people move at"):
        assert (
            read_raw(table, recipe=szlib.Recipe(unit="cm"))["x"].max()
            == 10 * hall()["x"].max()
        )
    pixels = table.set_axis(["time", "id", "x_px", "y_px"], axis=1)
    with pytest.raises(szlib.DataError, match="positions are in pixels; pass scale="):
        read_raw(pixels)


def test_unknown_names_are_listed_and_the_unit_of_those_given_is_found() -> None:
    rows = hall()[["t", "id", "x", "y"]].assign(
        x=lambda r: r["x"] * 1e3, y=lambda r: r["y"] * 1e3
    )
    for names in (
        ["when", "who", "east (mm)", "north (mm)"],
        ["when", "who", "east", "north"],
    ):
        columns = dict(zip(("t", "id", "x", "y"), names, strict=True))
        table = rows.set_axis(names, axis=1)
        listed = ", ".join(map(repr, names))
        with pytest.raises(szlib.DataError, match=re.escape(f"it has {listed}; pass")):
            read_raw(table)
        recipe = szlib.Recipe(columns=columns)
        if "(mm)" not in names[-1]:
            with pytest.raises(szlib.DataError, match="pass unit='mm'"):
                read_raw(table, recipe=recipe)
            recipe = szlib.Recipe(columns=columns, unit="mm")
        assert read_raw(table, recipe=recipe)["x"].max() == hall()["x"].max()


UNCLEAR = {
    "time, timestamp can all be t; pass columns={'t': 'time'}": ["time", "id", "x", "y", "timestamp"],
    "names x twice; rename one": ["t", "id", "x", "y", "x"],
    "has no column y; it has 't', 'id', 'x', 'north', 'note'; pass columns={'t': 't', 'id': 'id', 'x': 'x', "
    "'y': '...'}": [
        "t", "id", "x", "north", "note",
    ],
}  # fmt: skip


@pytest.mark.parametrize("message", UNCLEAR)
def test_a_column_that_is_not_clear_is_not_guessed(message: str) -> None:
    rows = hall()[["t", "id", "x", "y"]].assign(more=0.0)
    with pytest.raises(szlib.DataError, match=re.escape(message)):
        read_raw(rows.set_axis(UNCLEAR[message], axis=1))


def test_an_exact_name_is_taken_before_a_usual_one() -> None:
    rows = hall()[["t", "id", "x", "y"]]
    more = rows.assign(time=-1.0, track=7, pos_x=0.0)
    pd.testing.assert_frame_equal(read_raw(more), read_raw(rows))


def test_a_value_that_is_no_number_is_named_with_its_column_and_line(
    tmp_path: Path,
) -> None:
    rows = ["Zeit;Person;X;Y", "0,0;1;0,0;1,0", "0,4;1;0,5;1,0", "0,8;1;k.A.;1,0"]
    rows += [f"{k},0;1;{k},0;1,0" for k in range(1, 19)]
    file = write(tmp_path / "hall.csv", "\n".join(rows))
    with pytest.warns(
        szlib.DataWarning,
        match=r"hall\.csv, first at line 4 \(column 'X' holds 'k\.A\.'\)",
    ):
        assert len(read_raw(file)) == 20
    with pytest.raises(
        szlib.DataError,
        match=r"line 2: missing or not a number \(column 'X' holds 'k\.A",
    ):
        read_raw(write(tmp_path / "hall.csv", "\n".join([rows[0], rows[3]])))


# --- tables of other libraries ------------------------------------------------------------------------


TABLES: dict[str, Callable[[pd.DataFrame], object]] = {
    "polars": pl.from_pandas, "arrow": pa.Table.from_pandas,
}  # fmt: skip


@pytest.mark.parametrize("library", TABLES)
def test_tables_of_other_libraries_are_read(library: str) -> None:
    rows = hall()[["t", "id", "x", "y"]]
    read, right = read_raw(TABLES[library](rows)), read_raw(rows)
    np.testing.assert_allclose(read["t"], right["t"], atol=1e-6)
    pd.testing.assert_frame_equal(read[["id", "x", "y"]], right[["id", "x", "y"]])


def test_tables_of_a_database_that_do_not_decide_are_refused(tmp_path: Path) -> None:
    import sqlite3

    file = tmp_path / "two.sqlite"
    with sqlite3.connect(file) as database:
        for name in ("monday", "tuesday"):
            hall().to_sql(name, database, index=False)
    database.close()
    with pytest.raises(
        szlib.DataError,
        match=r"several of the 2 tables can be tracks; .* sqlite3 -header -csv",
    ):
        read_raw(file)


# --- the same options everywhere ----------------------------------------------------------------------


def test_options_are_the_same_as_values_and_as_arguments() -> None:
    options = szlib.Recipe(
        columns={"t": "Zeit", "id": 1}, unit="mm", tz="Asia/Tokyo", max_gap=2.0
    )
    assert szlib.Recipe(**options.as_json()) == options
    assert (
        arguments(options.as_json())
        == "--columns t=Zeit,id=1 --unit mm --tz Asia/Tokyo --max-gap 2"
    )


@pytest.mark.parametrize("columns", ["Zeit", "t=", "when=Zeit", "t=Zeit,frame=Bild"])
def test_columns_that_say_nothing_are_refused(
    columns: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert (
        main(["inspect", str(write_shape("plain.csv", tmp_path)), "--columns", columns])
        == 2
    )
    assert "columns" in capsys.readouterr().err


def test_notebooks_read_with_the_options_of_their_parameter(tmp_path: Path) -> None:
    reading = {"columns": {"id": "track_id"}, "frame_rate": 25, "scale": 0.02}
    file = str(write_shape("pixels.csv", tmp_path))
    assert check_parameters({"reading": reading}, folders.list_notebooks()) == {
        "reading": reading
    }
    cache = DataCache(
        tmp_path / "results", file, "0 12 0 8", method=ZoneMethod(reading=reading)
    )
    tracks = szlib.read_tracks(file, **reading)
    pd.testing.assert_frame_equal(cache.tracks(), tracks)
    settings = cache.method.encounter_settings("0 12 0 8")
    found = cache.encounters()
    assert len(found) == len(szlib.find_encounters(tracks, settings=settings)) > 0
    other = DataCache(
        tmp_path / "results", file, "0 12 0 8", method=ZoneMethod(reading={})
    )
    with pytest.raises(szlib.DataError, match="counts frames"):
        other.encounters()  # not those that were stored with other options


def test_extract_reads_with_options(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "data").mkdir()
    file = write_shape("pixels.csv", tmp_path / "data")
    days = ["extract", str(file), "--out", str(tmp_path / "days"), *AREA]
    assert (
        main(
            [*days, "--frame-rate", "25", "--scale", "0.02", "--columns", "id=track_id"]
        )
        == 0
    )
    assert re.search(r"pixels +done +1 +1040 ", capsys.readouterr().out)
