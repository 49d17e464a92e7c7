"""The area of a run: given in any form or found from the tracks; errors where there is no encounter."""

from __future__ import annotations

import json
import re
from functools import partial

import jupytext
import pandas as pd
import pytest
import shapely
from helpers.track_tables import make_crowd, make_hall, make_tracks, make_walk

import szlib
from szlib.workbook import folders
from szlib.workbook.cli import main
from szlib.workbook.record import NotebookRecord
from szlib.zones.verdict import require_encounters

HALL = shapely.box(0, 0, 12, 8)


@pytest.fixture
def hall(tmp_path):
    file = tmp_path / "hall.csv"
    make_hall()[["t", "id", "x", "y"]].to_csv(file, index=False)
    return file


def record_of(tmp_path, file, **variables):
    given = {
        "data": [str(file)],
        "seed": 0,
        "results": str(tmp_path / "out"),
        **variables,
    }
    return NotebookRecord("99_test", given)


# --- given by options ---------------------------------------------------------------------------------------


def test_inspect_accepts_numbers_and_polygons_as_area(hall, tmp_path, capsys):
    (tmp_path / "hall.wkt").write_text(HALL.wkt)
    printed = []
    for options in (
        ["--square", "0", "12", "0", "8"],
        ["--polygon", str(tmp_path / "hall.wkt")],
    ):
        assert main(["inspect", *options, str(hall)]) == 0
        printed.append(capsys.readouterr().out.splitlines())
    assert printed[0] == printed[1]
    assert "area 0.0 12.0 0.0 8.0" in printed[0]
    assert main(["inspect", str(hall), "--square", "-5.5", "6", "-1", "8"]) == 0
    assert "\narea -5.5 6.0 -1.0 8.0\n" in capsys.readouterr().out


def test_area_of_other_data_is_the_walked_area(hall, capsys):
    for options in ([], ["--auto"]):
        assert main(["inspect", *options, str(hall)]) == 0
        found = szlib.as_area(
            re.search(r"^area (.*)", capsys.readouterr().out, flags=re.MULTILINE)[1]
        )
        assert found == szlib.walked_area(szlib.read_tracks(hall))


def test_commands_say_which_area_was_found_and_why(tmp_path, capsys):
    few, many = tmp_path / "few.csv", tmp_path / "many.csv"
    make_hall(people=40)[["t", "id", "x", "y"]].to_csv(few, index=False)
    make_hall()[["t", "id", "x", "y"]].to_csv(many, index=False)
    reason = "the outline of the place where people were seen"
    for file in (few, many):
        assert main(["inspect", str(file)]) == 0
        assert f"area found: {reason}\n" in capsys.readouterr().out
        assert main(["extract", str(file), "--out", str(tmp_path / file.stem)]) == 0
        assert reason in capsys.readouterr().out
        record = record_of(tmp_path, file)
        assert {record.cache.find_area().reason for _ in range(2)} == {reason}, (
            "found, then from the cache"
        )
        assert record.cache.encounters().attrs["area_reason"] == reason


def test_extract_records_the_area(hall, tmp_path, capsys):
    assert (
        main(
            [
                "extract",
                str(hall),
                "--out",
                str(tmp_path / "days"),
                "--square",
                "0",
                "12",
                "0",
                "8",
            ]
        )
        == 0
    )
    assert "area: 0.0 12.0 0.0 8.0" in capsys.readouterr().out
    record = json.loads((tmp_path / "days" / "hall.parquet.json").read_text())
    assert record["made_of"]["parameters"]["area"] == "0.0 12.0 0.0 8.0"


def test_two_areas_are_refused(hall, capsys):
    with pytest.raises(SystemExit):
        main(["inspect", str(hall), "--auto", "--square", "0", "12", "0", "8"])
    assert "not allowed with" in capsys.readouterr().err
    assert main(["inspect", str(hall), "--polygon", "no/such.wkt"]) == 2
    assert "no/such.wkt" in capsys.readouterr().err


@pytest.mark.usefixtures("without_kernels")
def test_every_form_of_an_area_gives_the_same_run(notebooks, tmp_path, capsys):
    folder = notebooks(_01_a='record.key["area"] = record.cache.area')
    script = folder / "01_a.py"
    script.write_text(script.read_text().replace("seed = 0\n", 'seed = 0\narea = ""\n'))
    (tmp_path / "hall.json").write_text(
        json.dumps({"type": "Polygon", "coordinates": [[*HALL.exterior.coords]]})
    )
    forms = [
        ["--square", "0", "12", "0", "8"],
        ["--polygon", "hall.json"],
        ["-p", "area=0 12 0 8"],
    ]
    for options in forms:
        assert (
            main(["run", "--data", "mine.csv", "--out", "out", "--jobs", "1", *options])
            == 0
        )
    (home,) = (path for path in (tmp_path / "out").glob("mine-*"))
    assert (
        json.loads((home / "parameters.json").read_text())["parameters"]["area"]
        == "0.0 12.0 0.0 8.0"
    )
    assert "area 0.0 12.0 0.0 8.0" in capsys.readouterr().out
    assert main(["run", "--data", "mine.csv", "--out", "out", "-p", "area=1 2"]) == 2


# --- in a notebook -----------------------------------------------------------------------------------


def test_plaza_has_the_square_of_the_mall(tmp_path, monkeypatch):
    small = szlib.PlazaSettings(n_encounters=3)
    make = partial(szlib.make_plaza, settings=small)
    monkeypatch.setattr("szlib.workbook.record.data_cache.make_plaza", make)
    assert (
        record_of(tmp_path, "", data="synthetic").cache.find_area() == szlib.ATC_SQUARE
    )


def test_area_that_is_found_is_that_of_the_encounters(hall, tmp_path):
    record = record_of(tmp_path, hall)
    found = record.cache.find_area()
    assert found == record.cache.find_area(record.cache.tracks()) and found.reason
    assert record.cache.encounters().attrs["area"] == str(found)


def test_given_area_is_used(hall, tmp_path):
    assert record_of(tmp_path, hall, area="0 6 0 8").cache.find_area() == szlib.Square(
        x=(0, 6), y=(0, 8)
    )
    assert record_of(
        tmp_path, hall, area=HALL.buffer(1).wkt
    ).cache.find_area() == szlib.as_area(HALL.buffer(1))


def test_data_quality_is_of_the_area_and_the_clock_of_the_run(tmp_path, monkeypatch):
    """Notebook 24 counts the funnel in the area of the run, and hours by the clock of the file."""
    file, notebook = (
        tmp_path / "few.csv",
        folders.NOTEBOOKS / "deeper" / "24_data_quality.py",
    )
    rows = make_hall(people=20)[["t", "id", "x", "y"]]
    rows.assign(t=rows["t"] + pd.Timestamp("2024-05-07 13:00").timestamp()).to_csv(
        file, index=False
    )
    variables = {}
    needed = (
        "import szlib",
        "seed =",
        "NotebookRecord(",
        "files =",
        "count_visits",
        "extract_days",
    )
    monkeypatch.chdir(notebook.parent)
    for cell in jupytext.read(notebook).cells:
        if cell.cell_type == "code" and any(word in cell.source for word in needed):
            exec(cell.source, variables)
        if "parameters" in cell.metadata.get("tags", []):
            variables |= {
                "data": [str(file)],
                "area": "0 11 0 7",
                "results": str(tmp_path / "out"),
            }
    assert str(variables["extraction"].settings.area) == "0.0 11.0 0.0 7.0"
    assert len(variables["extraction"].failed) == 0
    assert variables["hours"]["hour"].tolist() == [13]


# --- where nobody met --------------------------------------------------------------------------------

ROOM = szlib.Square(x=(-20, 20), y=(-20, 20))
APART = make_tracks(make_walk((0, 0), (1, 0)), make_walk((0, 15), (1, 0), person=2))
CROWDED = make_tracks(
    *(make_walk((0.3 * k, 0.2 * k), (1, 0), person=k) for k in range(8))
)
EMPTIED = {
    "not in the area; give an area in which people walked": (
        APART,
        szlib.Square(x=(50, 60), y=(0, 9)),
    ),
    "corner of the space outside the area; the space ahead": (
        APART,
        szlib.Square(x=(-1, 20), y=(-1, 1)),
    ),
    "slower than 0.4 m/s; are unit": (APART.assign(vx=APART["vx"] / 10), ROOM),
    "nobody in the space; people were never": (APART, ROOM),
    "other person nearer than 1.0 m; people came": (
        make_tracks(make_walk((0, 0), (1, 0)), make_walk((0.5, 0), (1, 0), person=2)),
        ROOM,
    ),
    "a track ends within the window; tracks are short": (
        make_tracks(
            make_walk((0, 0), (1, 0), duration=2),
            make_walk((4, 0), (-1, 0), person=2, duration=2),
        ),
        ROOM,
    ),
}


@pytest.mark.parametrize("reason", EMPTIED)
def test_error_names_the_condition_that_rejected_the_last_rows(reason):
    tracks, square = EMPTIED[reason]
    samples = szlib.find_encounters(tracks, square=square)
    with pytest.raises(szlib.DataError) as error:
        require_encounters(samples)
    assert f"The last condition: {reason}" in str(error.value).replace(
        "a corner", "corner"
    )
    assert str(square) in str(error.value)


def test_space_reaches_beyond_an_outline_that_is_a_wall():
    """A person outside the area is no reference pedestrian."""
    walks = (
        make_walk((1, 1), (1.0, 0), duration=6),
        make_walk((9, 1), (-1.0, 0), person=2, duration=6),
    )
    outside = (
        make_walk((1, -5), (1.0, 0), person=3),
        make_walk((4, -5), (1.0, 0), person=4),
    )
    tracks = make_tracks(*walks, *outside)
    assert len(szlib.find_encounters(tracks, area="0 10 0 2")) == 0
    samples = szlib.find_encounters(tracks, area="0 10 0 2", has_walls=True)
    assert set(samples["ref_id"]) == {1, 2}


def test_samples_with_encounters_pass_unchanged():
    samples = szlib.find_encounters(
        make_crowd(77, people=160, seconds=200, square=ROOM), square=ROOM
    )
    assert require_encounters(samples) is samples


@pytest.mark.usefixtures("without_kernels")
def test_run_stops_when_no_encounters_are_left(notebooks, tmp_path, capsys):
    look = (
        "import szlib\nsamples = szlib.find_encounters(record.cache.tracks(), area=szlib.ATC_SQUARE)\n"
        "record.cache.store_encounters(samples)"
    )
    notebooks(
        _01_fine='record.check("ok", True)',
        _02_nobody=look,
        _03_never="1 / 0",
        _07_never="1 / 0",
    )
    straight = [
        (k / 2, person, 30 + k / 2, person) for person in (1, 9) for k in range(40)
    ]
    pd.DataFrame(straight, columns=["t", "id", "x", "y"]).to_csv(
        tmp_path / "mine.csv", index=False
    )
    assert main(["run", "--data", "mine.csv", "--out", "out", "--jobs", "1"]) == 2
    found = json.loads((tmp_path / "out" / "mine" / "summary.json").read_text())
    states = {name: notebook["status"] for name, notebook in found["notebooks"].items()}
    assert states == {
        "01_fine": "done",
        "02_nobody": "refused",
        "03_never": "not started",
        "07_never": "not started",
    }
    assert not found["passed"]
    printed = capsys.readouterr()
    assert "The last condition: not in the area" in printed.err
