"""Shapes that have a name: each is read, or refused with a command that reads it, and saved as a recipe."""

from __future__ import annotations

import json
import re
import shlex
import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from helpers.file_shapes import BEGIN, PIXEL, RATE, hall

import szlib
from szlib.core.errors import MemoryLimitError
from szlib.core.input_files import environment
from szlib.tracks.columns import metres_in_degree
from szlib.tracks.readers import read_raw
from szlib.tracks.recipe import COMMAND_VARIABLE, FILE_NAME
from szlib.workbook.cli import main

ORIGIN = (139.7, 35.6)
AREA = ["--area", "0", "12", "0", "8"]


def columns(**names: object) -> pd.DataFrame:
    """The people of the hall, with columns of these values."""
    return pd.DataFrame(names)


def csv_of(table: pd.DataFrame, path: Path, **options: object) -> Path:
    table.to_csv(path, index=False, **options)
    return path


def boxes(path: Path, separator: str, row: Callable[..., list[object]]) -> Path:
    lines = (
        separator.join(map(str, row(r, r.x / PIXEL, r.y / PIXEL)))
        for r in hall().itertuples()
    )
    path.write_text("\n".join(lines) + "\n")
    return path


def nuscenes(folder: Path) -> Path:
    """Annotations, and what they refer to; a car among them."""
    rows, content = hall(), dict[str, list[dict[str, object]]]()
    content["sample"] = [
        {
            "token": f"s{k}",
            "timestamp": int(1e6 * (BEGIN + k / RATE)),
            "scene_token": "scene",
        }
        for k in rows["frame"].unique()
    ]
    kinds = ("human.pedestrian.adult", "vehicle.car")
    content["category"] = [{"token": name, "name": name} for name in kinds]
    content["instance"] = [
        {"token": f"i{p}", "category_token": kinds[0]} for p in rows["id"].unique()
    ]
    content["instance"].append({"token": "car", "category_token": kinds[1]})
    content["sample_annotation"] = [
        {
            "token": f"a{k}",
            "sample_token": f"s{r.frame}",
            "instance_token": f"i{r.id}",
            "translation": [r.x, r.y, 0],
        }
        for k, r in enumerate(rows.itertuples())
    ]
    car = {
        "sample_token": f"s{rows['frame'].iloc[0]}",
        "instance_token": "car",
        "translation": [0, 0, 0],
    }
    content["sample_annotation"].append({"token": "c", **car})
    for name, table in content.items():
        (folder / f"{name}.json").write_text(json.dumps(table))
    return folder / "sample_annotation.json"


def wide(path: Path) -> Path:
    table = hall().pivot(index="t", columns="id", values=["x", "y"])
    return csv_of(
        table.set_axis([f"{c}{k}" for c, k in table.columns], axis=1).reset_index(),
        path,
    )


def inD(folder: Path) -> Path:
    """With a car, the rate and the kinds beside it."""
    h = hall()
    rows = columns(
        recordingId=7, trackId=h["id"], frame=h["frame"], xCenter=h["x"], yCenter=h["y"]
    )
    car = rows[rows["trackId"] == 1].assign(
        trackId=99, xCenter=lambda r: 9 * r["xCenter"]
    )
    ids = pd.Series([*h["id"].unique(), 99])
    csv_of(
        columns(trackId=ids, **{"class": np.where(ids == 99, "car", "pedestrian")}),
        folder / "07_tracksMeta.csv",
    )
    csv_of(columns(recordingId=[7], frameRate=[RATE]), folder / "07_recordingMeta.csv")
    return csv_of(pd.concat([rows, car]), folder / "07_tracks.csv")


def degrees(folder: Path) -> pd.DataFrame:
    east, north = metres_in_degree(ORIGIN[1])
    h = hall()
    return h.assign(
        longitude=ORIGIN[0] + h["x"] / east, latitude=ORIGIN[1] + h["y"] / north
    )


def geojson(folder: Path) -> Path:
    features = [
        {"type": "Feature", "properties": {"t": r.t, "id": r.id},
         "geometry": {"type": "Point", "coordinates": [r.longitude, r.latitude]}}
        for r in degrees(folder).itertuples()
    ]  # fmt: skip
    path = folder / "hall.geojson"
    path.write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    return path


def moments() -> pd.Series:
    return pd.to_datetime(BEGIN + hall()["t"], unit="s")


def ros(folder: Path) -> Path:
    h, whole = hall(), np.floor(BEGIN + hall()["t"]).astype("int64")
    rest = ((BEGIN + h["t"] - whole) * 1e9).round().astype("int64")
    names = {"header.stamp.sec": whole, "header.stamp.nanosec": rest}
    return csv_of(
        columns(**names, track_id=h["id"], x=h["x"], y=h["y"]), folder / "bag.csv"
    )


H = hall()
SHAPES: dict[str, Callable[[Path], Path]] = {
    "inD": inD,
    "highD": lambda f: csv_of(columns(frame=H["frame"], id=H["id"], x=H["x"] - 1, y=H["y"] - 1, width=2.0,
                                      height=2.0, laneId=1), f / "01_tracks.csv"),
    "SDD": lambda f: boxes(f / "annotations.txt", " ", lambda r, x, y: [
        r.id, round(x) - 5, round(y) - 9, round(x) + 5, round(y) + 9, r.frame * 30 // RATE,
        0, 0, 0, '"Pedestrian"']),
    "MOT": lambda f: boxes(f / "det.txt", ",", lambda r, x, y: [
        r.frame, r.id, x - 10, y - 40, 20, 40, 1, -1, -1, -1]),
    "NGSIM": lambda f: csv_of(columns(
        Vehicle_ID=H["id"], Frame_ID=H["frame"], Total_Frames=9,
        Global_Time=(1000 * (BEGIN + H["t"])).astype("int64"),
        Local_X=H["x"] / 0.3048, Local_Y=H["y"] / 0.3048, Global_X=6e6, Global_Y=2e6), f / "ngsim.csv"),
    "nuScenes": nuscenes,
    "ROS": ros,
    "PeTrack": lambda f: csv_of(columns(id=H["id"], frame=H["frame"], x=100 * H["x"], y=100 * H["y"], z=170).
                                sort_values(["id", "frame"]), f / "petrack.txt", sep=" ", header=False),
    "OpenTraj": lambda f: csv_of(columns(
        scene_id=1, agent_id=H["id"], frame_id=H["frame"], pos_x=H["x"], pos_y=H["y"]),
        f / "opentraj.csv"),
    "wide": lambda f: wide(f / "wide.csv"),
    "date and time": lambda f: csv_of(columns(
        date=moments().dt.strftime("%Y-%m-%d"), time=moments().dt.strftime("%H:%M:%S.%f"), id=H["id"],
        x=H["x"], y=H["y"]), f / "dates.csv"),
    "GeoJSON": geojson,
    "degrees": lambda f: csv_of(degrees(f)[["t", "id", "longitude", "latitude"]], f / "degrees.csv"),
    "JSON lines": lambda f: (H[["t", "id", "x", "y"]].to_json(f / "l.jsonl", orient="records", lines=True),
                             f / "l.jsonl")[1],
    "Excel's days": lambda f: csv_of(columns(
        t=25_569 + (BEGIN + H["t"]) / 86_400, id=H["id"], x=H["x"], y=H["y"]), f / "excel.csv"),
    "yards": lambda f: csv_of(columns(t=H["t"], id=H["id"], x_yd=H["x"] / 0.9144, y_yd=H["y"] / 0.9144),
                              f / "y.csv"),
    "UTF-16": lambda f: csv_of(H[["t", "id", "x", "y"]], f / "u.csv", encoding="utf-16"),
    "fixed width": lambda f: (H[["t", "id", "x", "y"]].to_string(f / "w.txt", index=False), f / "w.txt")[1],
    "a date in Tokyo": lambda f: csv_of(H[["t", "id", "x", "y"]].assign(v=1.2, a=0.1), f / "0312.csv",
                                        header=False),
    "boxes": lambda f: csv_of(columns(frame=H["frame"], id=H["id"], x1=H["x"] / PIXEL - 5,
                                      y1=H["y"] / PIXEL - 5,
                                      x2=H["x"] / PIXEL + 5, y2=H["y"] / PIXEL + 5), f / "boxes.csv"),
}  # fmt: skip


def assert_same(read: pd.DataFrame, *, within: float) -> None:
    """The people of the hall, under ids of their own."""
    assert len(read) == len(H) and read["id"].nunique() == H["id"].nunique()
    read = read.assign(t=read["t"] - read["t"].min()).sort_values(["t", "x", "y"])
    right = H.assign(t=H["t"] - H["t"].min()).sort_values(["t", "x", "y"])
    np.testing.assert_allclose(read["t"], right["t"], atol=1e-5)
    offset = read["x"].mean() - right["x"].mean()
    assert abs(offset) < 1e-2
    np.testing.assert_allclose(read[["x", "y"]], right[["x", "y"]], atol=within)


@pytest.mark.parametrize("name", SHAPES)
def test_a_shape_is_read_by_what_its_error_proposes_and_saved(
    name: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The second command at the latest reads it; every guess in it is called a guess, and right here."""
    path = SHAPES[name](tmp_path)
    named = ["--format", "petrack"] if name == "PeTrack" else []
    command = ["inspect", str(path), *AREA, *named, "--save"]
    for _ in range(2):
        monkeypatch.setenv(COMMAND_VARIABLE, shlex.join(["szlib", *command]))
        if main(command) == 0:
            break
        message = capsys.readouterr().err
        assert ("--frame-rate" in message or "--scale" in message) <= (
            "only a guess" in message or "only guesses" in message
        )
        command = shlex.split(re.search(r"try: szlib (.*?)(?:; |\n|$)", message)[1])
    assert (tmp_path / FILE_NAME).is_file()
    with says_recipe():
        assert_same(read_raw(path), within=0.011 if name == "SDD" else 1e-3)
    recipe = szlib.Recipe.load(tmp_path / FILE_NAME)
    assert szlib.as_area(recipe.area) == szlib.as_area("0 12 0 8")
    with says_recipe():
        assert szlib.read_tracks(path).attrs["area"] == recipe.area


def says_recipe() -> Any:
    """A warning that names the file which says how others are read."""
    return pytest.warns(
        szlib.DataWarning, match=rf"the settings in .*{FILE_NAME} are used: --"
    )


def test_a_recipe_is_taken_from_beside_the_data_unless_one_is_given(
    tmp_path: Path,
) -> None:
    path = csv_of(H[["t", "id", "x", "y"]], tmp_path / "hall.csv")
    right = read_raw(path)
    szlib.Recipe(tz="Asia/Tokyo", columns={"x": "y", "y": "x"}).save(
        tmp_path / FILE_NAME
    )
    with says_recipe():
        assert read_raw(path)["x"].tolist() == right["y"].tolist()
    assert read_raw(path, recipe=szlib.Recipe())["x"].tolist() == right["x"].tolist()
    with says_recipe():
        tracks = szlib.read_tracks(path, columns={"x": "x", "y": "y"})
    assert tracks.attrs["recipe"]["tz"] == "Asia/Tokyo"
    (tmp_path / FILE_NAME).write_text('{"units": "m"}')
    with pytest.raises(
        szlib.DataError, match=r"reading\.json: \['units'\] are unknown"
    ):
        read_raw(path)


def test_a_homography_maps_pixels_to_the_floor(tmp_path: Path) -> None:
    turned = H.assign(x=-H["y"] / PIXEL, y=H["x"] / PIXEL)[["t", "id", "x", "y"]]
    matrix = [[0, PIXEL, 0], [-PIXEL, 0, 0], [0, 0, 1]]
    read = read_raw(turned, recipe=szlib.Recipe(homography=matrix))
    assert_same(read, within=1e-9)


def test_seconds_without_a_clock_are_an_error_not_a_loss() -> None:
    """Times in hours: nearly all samples are within a step of the clock."""
    table = H.assign(t=H["t"] / 3600)[["t", "id", "x", "y"]]
    with pytest.raises(szlib.DataError, match="times seconds, and ids people"):
        szlib.read_tracks(table)


def test_a_time_is_never_proposed_as_a_recording() -> None:
    """Seconds without the nanoseconds, which have a name of their own."""
    rest = (H["t"] % 1 * 1e9).round().astype(int)
    table = H.assign(t=H["t"] // 1, rest_nanosec=rest)[
        ["t", "id", "x", "y", "rest_nanosec"]
    ]
    with pytest.raises(
        szlib.DataError, match=r"second place at|irregular times"
    ) as error:
        szlib.read_tracks(table)
    assert "rest_nanosec" not in str(error.value)


def test_predictions_of_trajnet_are_no_tracks(tmp_path: Path) -> None:
    lines: list[dict[str, object]] = [{"scene": {"id": 0, "fps": 2.5}}]
    for extra, shift in (({"prediction_number": 0}, 9.0), ({}, 0.0)):
        lines += [
            {"track": {"f": r.frame, "p": r.id, "x": r.x + shift, "y": r.y, **extra}}
            for r in H.itertuples()
        ]
    path = tmp_path / "crowd.ndjson"
    path.write_text("\n".join(map(json.dumps, lines)))
    assert_same(read_raw(path), within=1e-9)


def test_people_of_magni_are_the_same_at_any_rate(tmp_path: Path) -> None:
    t = np.arange(60) / 10
    parts = [
        columns(Time=t + begin, ag_id=f"Helmet_{k}", x=1.2 * t, y=float(k))
        for k in (1, 2)
        for begin in (0, 6)
    ]
    path = csv_of(
        pd.concat(parts).assign(data_label="Visitors-Alone"), tmp_path / "A.csv"
    )
    assert szlib.read_tracks(path)["id"].unique().tolist() == [101, 102]


@pytest.mark.slow
def test_memory_is_charged_by_decoded_bytes(tmp_path: Path) -> None:
    """A long id in a dictionary, and a blob that SQLite makes: small files, large columns."""
    rows = pd.concat([H[["t", "x", "y"]]] * 40).assign(id="p" * 20_000)
    rows.to_parquet(tmp_path / "a.parquet")
    with closing(sqlite3.connect(tmp_path / "a.sqlite")) as file:
        file.execute(
            "CREATE TABLE tracks(t REAL, x REAL, y REAL, id TEXT AS (hex(zeroblob(9000))) VIRTUAL)"
        )
        file.executemany(
            "INSERT INTO tracks VALUES(?, ?, ?)",
            H[["t", "x", "y"]].to_numpy().tolist() * 20,
        )
        file.commit()
    for name in ("a.parquet", "a.sqlite"):
        assert (tmp_path / name).stat().st_size < 2_000_000
        with (
            environment(SZLIB_MEMORY="50MB"),
            pytest.raises(MemoryLimitError, match="MB of a column"),
        ):
            read_raw(tmp_path / name)


# --- a raw day whose recipe says more than a scan of its rows can do ----------------------------------


def write_raw_day(folder: Path) -> Path:
    """Two people, who walk along x at y = 1 and 2 m, in the format of the ATC days."""
    rows = [
        f"{1351038000 + 0.04 * k:.3f},{7 + i},{-15000 + 40 * k},{1000 + 1000 * i},1200,1000,0.1,0.1"
        for k in range(100)
        for i in range(2)
    ]
    file = folder / "atc-20121024.csv"
    file.write_text("\n".join(rows) + "\n")
    return file


def test_a_condition_chooses_rows_of_a_raw_day_too(tmp_path):
    file = write_raw_day(tmp_path)
    both = szlib.read_tracks(file)
    one = szlib.read_tracks(file, recipe=szlib.Recipe(where="f1 = '8'"))
    assert set(both["id"]) == {7, 8}
    assert one["y"].unique() == pytest.approx([2.0]) and 2 * len(one) == len(both)


def test_a_homography_maps_a_raw_day_too(tmp_path):
    file = write_raw_day(tmp_path)
    swapped = [[0, 0.001, 0], [0.001, 0, 0], [0, 0, 1]]
    plain = szlib.read_tracks(file)
    mapped = szlib.read_tracks(file, recipe=szlib.Recipe(homography=swapped))
    assert mapped[["y", "x"]].to_numpy() == pytest.approx(plain[["x", "y"]].to_numpy())


def test_a_condition_that_is_no_text_is_refused():
    with pytest.raises(szlib.DataError, match="where must be a condition in SQL"):
        szlib.Recipe(where=("id", "8"))


def test_a_second_place_in_trajnet_is_counted(tmp_path: Path) -> None:
    """Two recordings in one file: nobody is dropped in silence."""
    lines = [
        json.dumps({"track": {"f": k, "p": 1, "x": x, "y": float(k)}})
        for x in (0.0, 9.0)
        for k in range(50)
    ]
    (tmp_path / "two.ndjson").write_text("\n".join(lines))
    with pytest.raises(szlib.DataError, match="50 of 100 rows give a person a second"):
        szlib.read_tracks(tmp_path / "two.ndjson")
