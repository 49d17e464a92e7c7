"""Tables, chosen columns, DataFrames and files of other programs: all give the same tracks."""

from __future__ import annotations

import gzip
import json
import re
import sqlite3
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from helpers.track_files import RATE, in_seconds, people, samples, write
from helpers.track_tables import make_crowd
from helpers.valid_tracks import check_tracks

import szlib
from szlib.tracks import funnels
from szlib.tracks.clock import to_clock
from szlib.tracks.readers import find_day, read_raw


def expected(rows: pd.DataFrame) -> pd.DataFrame:
    return to_clock(in_seconds(rows).assign(day="any"))


def assert_same_people(
    tracks: pd.DataFrame, rows: pd.DataFrame, *, within: float = 1e-9
) -> None:
    check_tracks(tracks)
    right = expected(rows)
    assert (
        tracks[["id", "t"]].to_numpy().tolist()
        == right[["id", "t"]].to_numpy().tolist()
    )
    np.testing.assert_allclose(tracks[["x", "y"]], right[["x", "y"]], atol=within)


# --- columns, units, frames --------------------------------------------------------------------------

COLUMN_NAMES = {"frame": "Frame", "id": "ped", "x": "X pos", "y": "Y pos"}


def renamed(rows: pd.DataFrame) -> pd.DataFrame:
    return rows.rename(columns=COLUMN_NAMES).assign(note="a")[
        ["note", "Y pos", "ped", "Frame", "X pos"]
    ]


@pytest.mark.parametrize(
    "form", ["frame", "csv", "semicolons", "tabs", "gz", "parquet"]
)
def test_columns_may_have_any_name_and_order(tmp_path: Path, form: str) -> None:
    table, file = renamed(people()), tmp_path / "hall.csv"
    separator = {"semicolons": ";", "tabs": "\t"}.get(form, ",")
    text = table.to_csv(index=False, sep=separator).encode()
    if form == "parquet":
        table.to_parquet(file)
    else:
        file.write_bytes(gzip.compress(text) if form == "gz" else text)
    source = table if form == "frame" else file
    assert_same_people(
        szlib.read_tracks(source, columns=COLUMN_NAMES, frame_rate=RATE), people()
    )


@pytest.mark.parametrize(("unit", "metres"), {"m": 1, "cm": 0.01, "mm": 0.001}.items())
@pytest.mark.parametrize("separator", [",", " ", ";"])
def test_columns_of_a_file_without_header_are_chosen_by_number(
    tmp_path: Path, unit: str, metres: float, separator: str
) -> None:
    table = people().assign(
        x=lambda t: t["x"] / metres, y=lambda t: t["y"] / metres, z=1.7
    )
    file = tmp_path / "hall.txt"
    table.to_csv(file, index=False, header=False, sep=separator)
    columns = {"id": 0, "frame": 1, "x": 2, "y": 3}
    tracks = szlib.read_tracks(file, columns=columns, frame_rate=RATE, unit=unit)
    assert_same_people(tracks, people())


def test_a_column_named_frame_is_found() -> None:
    assert_same_people(szlib.read_tracks(people(), frame_rate=RATE), people())
    assert (
        "at 12.5 frames/s"
        in funnels.get(szlib.read_tracks(people(), frame_rate=RATE))[0]["stage"]
    )


def test_a_dataframe_is_not_changed() -> None:
    table = in_seconds(people())
    table.attrs["mine"] = 1
    before = table.copy(deep=True)
    szlib.read_tracks(table.sample(frac=1, random_state=0))
    pd.testing.assert_frame_equal(table, before)
    assert_same_people(
        szlib.read_tracks(table.set_index(np.arange(len(table)) % 7)), people()
    )


def test_unusable_rows_of_a_table_are_rejected_and_counted() -> None:
    table = in_seconds(people()).astype({"x": object})
    table.loc[[3, 40], "x"] = [None, "far"]
    table.loc[7, "t"] = np.inf
    with pytest.warns(
        szlib.DataWarning,
        match=r"table-1, first at line 4 .column 'x'.: rejected rows: 2 x missing",
    ):
        tracks = szlib.read_tracks(table)
    assert sum(funnels.get(tracks)[0]["rejected"].values()) == 3


@pytest.mark.parametrize("zone", [None, "UTC", "Europe/Berlin"])
def test_times_may_be_datetimes(zone: str | None) -> None:
    rows = in_seconds(people())
    moment = pd.Timestamp("2024-05-07 10:00", tz=zone or "Europe/Berlin")
    t = moment + pd.to_timedelta(rows["t"], unit="s")
    table = rows.assign(t=t if zone else t.dt.tz_localize(None))
    tracks = szlib.read_tracks(table, tz="Europe/Berlin")
    assert set(tracks["day"]) == {"2024-05-07"}
    shifted = tracks.assign(t=(tracks["t"] - moment.timestamp()).round(1))
    np.testing.assert_allclose(
        shifted[["t", "x", "y"]], expected(people())[["t", "x", "y"]], atol=1e-5
    )


def test_several_tables_are_different_recordings() -> None:
    tracks = szlib.read_tracks([in_seconds(people(0)), in_seconds(people(1))])
    assert tracks["day"].nunique() == 2
    assert len(tracks) == len(expected(people(0))) + len(expected(people(1)))


def test_trajectory_data_of_pedpy_is_read() -> None:
    pedpy = pytest.importorskip("pedpy")
    trajectory = pedpy.TrajectoryData(data=people(), frame_rate=RATE)
    assert_same_people(szlib.read_tracks(trajectory), people())


REFUSED = {
    "counts frames; pass frame_rate": ({"columns": {"frame": "frame"}}, people),
    "both t and frame": ({"columns": {"t": "a", "frame": "b"}}, people),
    "are unknown": ({"columns": {"time": "frame"}}, people),
    "has no column ped": ({"columns": {"id": "ped"}, "frame_rate": 10}, people),
    "no field 9": ({"columns": {"id": 9}, "frame_rate": 10}, people),
    "leave frame_rate out": ({"frame_rate": 25}, lambda: in_seconds(people())),
    "names x twice": ({"frame_rate": 25}, lambda: pd.concat([people(), people()[["x"]]], axis=1)),
    "unit must be": ({"unit": "ell"}, lambda: in_seconds(people())),
}  # fmt: skip


@pytest.mark.parametrize("message", REFUSED)
def test_wrong_options_for_a_table_are_refused(message: str) -> None:
    options, table = REFUSED[message]
    with pytest.raises(szlib.DataError, match=message):
        szlib.read_tracks(table(), **options)


def test_columns_that_a_format_has_not_are_refused(tmp_path: Path) -> None:
    file = write(tmp_path / "a.csv", in_seconds(people()).to_csv(index=False))
    with pytest.raises(szlib.DataError, match="has no column t; "):
        szlib.read_tracks(file, columns={"t": "t"}, file_format="atc-1hz")


def test_extract_days_takes_columns(tmp_path: Path) -> None:
    crowd = make_crowd(5, people=60, seconds=60)
    table = crowd.rename(columns={"t": "time", "id": "ped"})[["time", "ped", "x", "y"]]
    (tmp_path / "data").mkdir()
    table.to_csv(tmp_path / "data" / "hall.csv", index=False)
    columns = {"t": "time", "id": "ped"}
    found = szlib.extract_days(
        tmp_path / "data" / "hall.csv",
        out=tmp_path / "out",
        columns=columns,
        square=szlib.ATC_SQUARE,
        progress=False,
    )
    tracks = szlib.read_tracks(tmp_path / "data" / "hall.csv", columns=columns)
    known = szlib.find_encounters(tracks, square=szlib.ATC_SQUARE)
    assert len(found.samples()) == len(known) > 0
    assert found.settings.area == szlib.ATC_SQUARE


# --- other programs ----------------------------------------------------------------------------------


def as_juelich(
    rows: pd.DataFrame,
    path: Path,
    *,
    header: str = "#framerate: 12.5\n#ID frame x/m y/m z/m\n",
    metres: float = 1.0,
) -> Path:
    lines = [
        f"{r.id} {r.frame} {r.x / metres:.6f} {r.y / metres:.6f} 1.7"
        for r in rows.itertuples()
    ]
    return write(path, header + "\n".join(lines) + "\n")


def as_hdf5(rows: pd.DataFrame, path: Path) -> Path:
    h5py = pytest.importorskip("h5py")
    kinds = [("id", "i8"), ("frame", "i8"), ("x", "f8"), ("y", "f8"), ("z", "f8")]
    with h5py.File(path, "w") as file:
        table = np.array(
            [(r.id, r.frame, r.x, r.y, 1.7) for r in rows.itertuples()], dtype=kinds
        )
        file.create_dataset("trajectory", data=table).attrs["fps"] = RATE
        file.attrs["wkt_geometry"] = "POLYGON ((0 0, 12 0, 12 8, 0 8, 0 0))"
    return path


def as_viswalk(rows: pd.DataFrame, path: Path) -> Path:
    head = "$VISION\n* File: hall.inpx\n* PTV Vissim: 2022\n$PEDESTRIAN:NO;SIMSEC;COORDCENTX;COORDCENTY\n"
    body = [f"{r.id};{r.frame / 10:.2f};{r.x:.6f};{r.y:.6f}" for r in rows.itertuples()]
    return write(path, head + "\n".join(body) + "\n")


def as_vadere(rows: pd.DataFrame, path: Path) -> Path:
    head = "pedestrianId simTime endTime-PID1 startX-PID1 startY-PID1 endX-PID1 endY-PID1\n"
    body = []
    for _, one in rows.groupby("id"):
        steps = one.iloc[::5]  # footsteps, each from one place to the next
        for now, after in zip(
            steps.itertuples(), list(steps.itertuples())[1:], strict=False
        ):
            body.append(
                (
                    now.id,
                    now.frame / 10,
                    after.frame / 10,
                    now.x,
                    now.y,
                    after.x,
                    after.y,
                )
            )
    body.sort(key=lambda row: (row[1], row[0]))
    return write(path, head + "\n".join(" ".join(map(str, row)) for row in body) + "\n")


def as_jupedsim(rows: pd.DataFrame, path: Path) -> Path:
    with sqlite3.connect(path) as file:
        file.execute(
            "CREATE TABLE metadata(key TEXT NOT NULL UNIQUE PRIMARY KEY, value TEXT NOT NULL)"
        )
        file.executemany(
            "INSERT INTO metadata VALUES(?, ?)", [("version", "2"), ("fps", str(RATE))]
        )
        file.execute(
            "CREATE TABLE trajectory_data(frame INTEGER NOT NULL, id INTEGER NOT NULL, "
            "pos_x REAL NOT NULL, pos_y REAL NOT NULL, ori_x REAL NOT NULL, ori_y REAL NOT NULL)"
        )
        table = [
            (int(r.frame), int(r.id), r.x, r.y, 1.0, 0.0) for r in rows.itertuples()
        ]
        file.executemany("INSERT INTO trajectory_data VALUES(?, ?, ?, ?, ?, ?)", table)
    file.close()
    return path


WRITERS_OF_PROGRAMS: dict[str, Callable[[pd.DataFrame, Path], Path]] = {
    "juelich-text": as_juelich, "juelich-hdf5": as_hdf5, "jupedsim": as_jupedsim,
}  # fmt: skip
pedpy_closes_late = pytest.mark.filterwarnings(
    "ignore::ResourceWarning", "ignore::pytest.PytestUnraisableExceptionWarning"
)


@pedpy_closes_late
@pytest.mark.parametrize("name", WRITERS_OF_PROGRAMS)
@pytest.mark.parametrize("packed", [False, True])
def test_files_of_other_programs_are_recognised(
    tmp_path: Path, name: str, packed: bool
) -> None:
    pytest.importorskip("pedpy")
    file = WRITERS_OF_PROGRAMS[name](people(), tmp_path / "recording")
    if packed:
        file = write(tmp_path / "packed.gz", gzip.compress(file.read_bytes()))
    assert_same_people(szlib.read_tracks(file), people(), within=1e-5)
    assert_same_people(szlib.read_tracks(file, file_format=name), people(), within=1e-5)


@pytest.mark.parametrize("name", ["viswalk", "vadere"])
def test_files_of_simulations_are_recognised(tmp_path: Path, name: str) -> None:
    pytest.importorskip("pedpy")
    rows = people()  # frames are tenths of a second here
    file = {"viswalk": as_viswalk, "vadere": as_vadere}[name](
        rows, tmp_path / "simulated.csv"
    )
    tracks = szlib.read_tracks(file)
    check_tracks(tracks)
    right = to_clock(
        rows.assign(day="any", t=rows["frame"] / 10)[["day", "id", "t", "x", "y"]]
    )
    both = tracks.assign(tick=tracks["t"].round(1)).merge(
        right.assign(tick=right["t"].round(1)),
        on=["id", "tick"],
        suffixes=("", "_right"),
    )
    assert len(both) == len(tracks) > 0.9 * len(right)
    np.testing.assert_allclose(
        both[["x", "y"]], both[["x_right", "y_right"]], atol=1e-3
    )


def test_juelich_text_uses_the_unit_of_its_header_or_the_given_one(
    tmp_path: Path,
) -> None:
    pytest.importorskip("pedpy")
    centimetres = as_juelich(
        people(),
        tmp_path / "a.txt",
        header="# framerate: 12.5 fps\n#id frame x/cm y/cm z/cm\n",
        metres=0.01,
    )
    assert_same_people(szlib.read_tracks(centimetres), people(), within=1e-5)
    silent = as_juelich(
        people(), tmp_path / "b.txt", header="# a corridor\n", metres=0.01
    )
    with pytest.raises(szlib.DataError, match="pass frame_rate= and unit="):
        szlib.read_tracks(silent)
    assert_same_people(
        szlib.read_tracks(silent, frame_rate=RATE, unit="cm"), people(), within=1e-5
    )
    bare = as_juelich(people(), tmp_path / "c.txt", header="")
    options = {"file_format": "juelich-text", "frame_rate": RATE, "unit": "m"}
    assert_same_people(szlib.read_tracks(bare, **options), people(), within=1e-5)
    with pytest.raises(szlib.DataError, match="in 'm' or 'cm'"):
        szlib.read_tracks(bare, **{**options, "unit": "mm"})


@pedpy_closes_late
@pytest.mark.parametrize(
    "content",
    [
        b"SQLite format 3\0" + bytes(100),
        b"\x89HDF\r\n\x1a\n" + bytes(50),
        b"$VISION\n",
        b"#framerate: 10\nx\n",
        b"pedestrianId simTime\n1 2\n",
    ],
)
def test_damaged_files_of_other_programs_are_refused(
    tmp_path: Path, content: bytes
) -> None:
    pytest.importorskip("pedpy")
    with pytest.raises(szlib.DataError, match=r"broken: cannot be read as"):
        szlib.read_tracks(write(tmp_path / "broken", content))


def test_a_csv_file_and_the_same_dataframe_give_the_same_tracks(tmp_path: Path) -> None:
    file = write(tmp_path / "a.csv", samples().to_csv(index=False))
    pd.testing.assert_frame_equal(
        szlib.read_tracks(file).drop(columns="day"),
        szlib.read_tracks(samples()).drop(columns="day"),
    )


@pytest.mark.parametrize("separator", [" ", ",", ";", "\t"])
@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_a_row_with_another_number_of_fields_is_rejected_never_shifted(
    tmp_path: Path, separator: str, end: str
) -> None:
    """A field in 40 is left out, or doubled: every row that is kept is a row of the truth."""
    rng, rows = np.random.default_rng(7), list[str]()
    for k in range(400):
        fields = [f"{k / 10:.1f}", str(k % 4), f"{k / 10:.2f}", f"{-k / 20:.2f}", "9"]
        if rng.random() < 1 / 40:
            i = int(rng.integers(5))
            fields[i : i + 1] = [] if rng.random() < 0.5 else 2 * [fields[i]]
        rows.append(separator.join(fields))
    head = separator.join(("t", "id", "x", "y", "z"))
    path = tmp_path / "odd.txt"
    path.write_bytes((end.join([head, *rows]) + end).encode())
    whole = [k for k, row in enumerate(rows) if row.count(separator) == 4]
    assert 380 < len(whole) < 400
    with pytest.warns(szlib.DataWarning, match="missing or extra fields"):
        found = szlib.read_tracks(path, recipe=szlib.Recipe(max_gap=1e3))
    (stage, *_) = found.attrs["funnel"]
    assert stage["rejected"] == {"missing or extra fields": 400 - len(whole)}
    at = found.set_index(["id", "t"])
    for k in whole:
        x, y = at.loc[(k % 4, k / 10), ["x", "y"]]
        assert (x, y) == pytest.approx((k / 10, -k / 20))


def test_a_database_is_not_changed_and_what_is_not_in_it_yet_is_said(
    tmp_path: Path,
) -> None:
    path = tmp_path / "hall.sqlite"
    file = sqlite3.connect(path)
    file.execute("PRAGMA journal_mode = WAL")
    file.execute("CREATE TABLE tracks(t REAL, id INTEGER, x REAL, y REAL)")
    rows = [(k / 10, i, k / 10, float(i)) for k in range(40) for i in (1, 2)]
    file.executemany("INSERT INTO tracks VALUES(?, ?, ?, ?)", rows)
    file.commit()
    with pytest.raises(szlib.DataError, match=r"hall\.sqlite-wal holds changes"):
        szlib.read_tracks(path)
    file.close()  # which writes them
    before = path.read_bytes()
    path.chmod(0o444)
    assert len(szlib.read_tracks(path)) >= 80
    assert path.read_bytes() == before and list(tmp_path.iterdir()) == [path]


def in_two_recordings(column: str, later: float) -> pd.DataFrame:
    """Six people on their ways, twice, under the same ids; the second time so many seconds later."""
    parts = []
    for k, name in enumerate(("A", "B")):
        rows = in_seconds(people(k, count=6))
        parts.append(rows.assign(t=rows["t"] + k * later, **{column: name}))
    return pd.concat(parts, ignore_index=True)


@pytest.mark.parametrize("form", ["csv", "parquet", "table", "sqlite"])
@pytest.mark.parametrize(
    ("column", "later"), [("scene", 0.0), ("scene", 500.0), ("anything", 0.0)]
)
def test_a_column_that_tells_recordings_apart_is_asked_about(
    tmp_path: Path, form: str, column: str, later: float
) -> None:
    table = in_two_recordings(column, later)
    source: Any = tmp_path / f"hall.{form}"
    if form == "csv":
        table.to_csv(source, index=False)
    elif form == "parquet":
        table.to_parquet(source)
    elif form == "table":
        source = table
    else:
        with sqlite3.connect(source) as file:
            table.to_sql("tracks", file, index=False)
        file.close()
    with pytest.raises(szlib.DataError, match=f"column '{column}' changes where"):
        szlib.read_tracks(source)
    found = szlib.read_tracks(source, columns={"day": column})
    assert found.groupby("day", observed=True)["id"].nunique().tolist() == [6, 6]


def test_a_column_that_tells_no_recordings_apart_is_not_asked_about(
    tmp_path: Path,
) -> None:
    table = in_two_recordings("kind", 0.0).iloc[: len(in_seconds(people(0, count=6)))]
    table["scene"], table["speed"] = "A", np.linspace(0, 1, len(table))
    assert szlib.read_tracks(table)["id"].nunique() == 6
    table["scene"] = np.where(table["id"] % 2, "left", "right")
    assert szlib.read_tracks(table)["id"].nunique() == 6


def test_most_people_in_two_places_at_once_are_an_error_not_a_warning(
    tmp_path: Path,
) -> None:
    """A clock of whole seconds, beside one of nanoseconds that is not read."""
    table = in_seconds(people(0, count=6))
    rest = (table["t"] % 1 * 1e9).round().astype(int)
    seconds = table.assign(t=table["t"] // 1, nanosec=rest)
    with pytest.raises(szlib.DataError, match="second place at one time"):
        szlib.read_tracks(seconds)
    twice = pd.concat([table, table])
    with pytest.warns(szlib.DataWarning, match="duplicate"):
        assert szlib.read_tracks(twice)["id"].nunique() == 6


def test_ids_that_are_one_number_in_two_writings_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "ids.csv"
    for one, other in (("01", "1"), ("1e3", "1000")):
        rows = [
            f"{k / 10},{i},{k / 10},{i[-1]}" for k in range(30) for i in (one, other)
        ]
        path.write_text("\n".join(["t,id,x,y", *rows]))
        with pytest.raises(szlib.DataError, match="are the same number"):
            szlib.read_tracks(path)


def test_a_quotation_mark_that_is_not_closed_loses_no_rows(tmp_path: Path) -> None:
    """Up to the next mark, hundreds of lines would be one text."""
    rows = [f'{k / 10},1,{k / 10},0.0,"a"' for k in range(200)]
    rows[50] = rows[50].replace('"a"', '"a')
    path = tmp_path / "hall.csv"
    path.write_text("\n".join(['t,id,x,y,"note"', *rows]) + "\n")
    with pytest.warns(szlib.DataWarning, match="line 52: rejected rows: 1 x missing"):
        assert len(read_raw(path)) == 199


@pytest.mark.parametrize(
    "schema",
    [
        "CREATE TABLE hall(t, id, x, y, PRIMARY KEY(id, t))",
        "CREATE TABLE hall(t, id, x, y, PRIMARY KEY(id, t)) WITHOUT ROWID",
        "CREATE TABLE hall(t, id, x, y); CREATE INDEX people ON hall(id)",
    ],
)
def test_an_index_of_a_database_mixes_no_rows(tmp_path: Path, schema: str) -> None:
    """With an index, SQLite gives the values of a single column in another order."""
    rows = in_seconds(people())[["t", "id", "x", "y"]].sample(frac=1, random_state=1)
    with sqlite3.connect(tmp_path / "hall.sqlite") as file:
        file.executescript(schema)
        file.executemany(
            "INSERT INTO hall VALUES(?, ?, ?, ?)", rows.to_numpy().tolist()
        )
    file.close()
    with sqlite3.connect(tmp_path / "hall.sqlite") as file:
        file.execute("ALTER TABLE hall ADD COLUMN note")
        file.execute("UPDATE hall SET note = CAST(x'ff41' AS TEXT)")
    file.close()
    rows.to_csv(tmp_path / "hall.csv", index=False)
    found, wanted = (read_raw(tmp_path / f"hall.{end}") for end in ("sqlite", "csv"))
    pd.testing.assert_frame_equal(found, wanted)


@pytest.mark.parametrize("zone", ["+09", "+0900", "+09:00"])
def test_the_zone_of_a_time_may_be_hours_alone(tmp_path: Path, zone: str) -> None:
    times = [f"2012-10-24 08:00:{second:02d}.5{zone}" for second in range(20)]
    table = pd.DataFrame({"t": times, "id": 1, "x": np.arange(20.0), "y": 0.0})
    table.to_csv(tmp_path / "hall.csv", index=False)
    raw = read_raw(tmp_path / "hall.csv")
    assert raw["day"].unique().tolist() == ["2012-10-24"]
    assert raw["t"].iloc[0] == pd.Timestamp("2012-10-23T23:00:00.5Z").timestamp()


@pytest.mark.parametrize(
    "condition",
    [
        "kind = 'Ped' AND score > 50.5",
        "score > 50.5",
        "50.5 < score AND kind = 'Ped'",
        "kind = 'Ped' AND score BETWEEN 50 AND 500",
    ],
)
def test_a_condition_compares_texts_with_quotes_and_numbers_without(
    tmp_path: Path, condition: str
) -> None:
    """As text, 9 is more than 50.5, and 100 is less."""
    n = 40
    table = pd.DataFrame({"t": np.arange(n), "id": 1, "x": np.arange(n), "y": 0.0})
    table = table.assign(kind="Ped", score=np.tile([9, 10, 85, 100], n // 4))
    table.to_csv(tmp_path / "hall.csv", index=False)
    found = read_raw(tmp_path / "hall.csv", recipe=szlib.Recipe(where=condition))
    assert len(found) == n // 2 and (found["t"] % 4 >= 2).all()


def test_a_condition_that_no_row_meets_is_named(tmp_path: Path) -> None:
    in_seconds(people()).assign(kind="Ped").to_csv(tmp_path / "hall.csv", index=False)
    with pytest.raises(szlib.DataError, match="holds no row where kind = 'ped'"):
        szlib.read_tracks(tmp_path / "hall.csv", where="kind = 'ped'")


@pytest.mark.parametrize("form", ["list", "lines", "GeoJSON"])
def test_the_day_of_a_long_json_file_is_found(tmp_path: Path, form: str) -> None:
    """Only lines can be cut after some bytes."""
    n = 2000
    table = pd.DataFrame({"t": 1.35e9 + np.arange(n), "id": 1, "x": 0.0, "y": 0.0})
    objects = table.to_dict("records")
    features = [
        {"properties": {"t": each["t"], "id": 1}, "geometry": {"coordinates": [0, 0]}}
        for each in objects
    ]
    texts = {
        "list": json.dumps(objects),
        "lines": "\n".join(map(json.dumps, objects)),
        "GeoJSON": json.dumps({"type": "FeatureCollection", "features": features}),
    }
    path = tmp_path / "hall.json"
    path.write_text(texts[form])
    recipe = szlib.Recipe(origin=(0.0, 0.0)) if form == "GeoJSON" else szlib.Recipe()
    assert find_day(path, recipe) == "2012-10-12"


@pytest.mark.parametrize("name", ["person", "Agent", "person_nr", "personne", "人物"])
def test_a_box_belongs_to_one_person_whatever_the_id_is_called(
    tmp_path: Path, name: str
) -> None:
    rows = in_seconds(people())
    boxes = pd.DataFrame({"t": rows["t"], name: rows["id"]})
    for corner, side in ((1, -0.5), (2, 0.5)):
        boxes[f"x{corner}"] = rows["x"] + side
        boxes[f"y{corner}"] = rows["y"] + side
    boxes.to_csv(tmp_path / "hall.csv", index=False)
    found = read_raw(tmp_path / "hall.csv", recipe=szlib.Recipe(scale=1.0))
    assert len(found) == len(rows) and found["id"].nunique() == rows["id"].nunique()


def test_a_row_of_a_wide_table_with_another_number_of_fields_is_rejected(
    tmp_path: Path,
) -> None:
    """One that is too long is; in one that is too short the last people are absent."""
    lines = ["t,x1,y1,x2,y2", *(f"{k},{k},0,{k},5" for k in range(40))]
    lines[21], lines[31] = "20,20,5,0,20,5", "30,30,0"
    (tmp_path / "hall.csv").write_text("\n".join(lines))
    with pytest.warns(szlib.DataWarning, match="missing or extra fields"):
        found = read_raw(tmp_path / "hall.csv")
    assert 20.0 not in set(found["t"]) and len(found) == 77
    assert found.loc[found["t"] == 30.0, "id"].tolist() == [1]


def test_texts_with_other_ends_and_separators_are_read(tmp_path: Path) -> None:
    """A header after #, tabs at the ends of the first line, and decimal commas between semicolons."""
    rows = in_seconds(people())
    columns = rows["t"], rows["id"], rows["x"], rows["y"]
    lines = [
        f"{t:.3f} {person} {x:.3f} {y:.3f}"
        for t, person, x, y in zip(*columns, strict=True)
    ]
    commas = [line.replace(" ", ";").replace(".", ",") for line in lines]
    texts = {
        "numpy": ["# t id x y", *lines],
        "tab": ["\tt id x y\t", *lines],
        "sheet": ["t;id;x;y", *commas],
        "unnamed": commas,
    }
    for name, text in texts.items():
        path = tmp_path / f"{name}.txt"
        path.write_text("\n".join(text))
        at = {"t": 0, "id": 1, "x": 2, "y": 3} if name == "unnamed" else {}
        recipe = szlib.Recipe(file_format="tidy", columns=at)
        assert len(rows) - len(read_raw(path, recipe=recipe)) == (name == "unnamed")


@pytest.mark.parametrize(
    "changes", [{"unit": "px"}, {"unit": "deg"}, {"columns": {"x": "f2 + 100"}}]
)
def test_a_long_table_of_numbers_is_read_as_its_recipe_says(
    tmp_path: Path, changes: dict[str, Any]
) -> None:
    """A file of eight numbers a row is scanned only if its recipe is simple."""
    rows = in_seconds(people())
    table = np.column_stack([rows[["t", "id", "x", "y"]], np.zeros((len(rows), 4))])
    np.savetxt(tmp_path / "hall.csv", table, delimiter=",", fmt="%.6g")
    if "unit" in changes:
        with pytest.raises(szlib.DataError, match=r"pass (scale|origin)="):
            read_raw(tmp_path / "hall.csv", recipe=szlib.Recipe(**changes))
    else:
        given = {"t": 0, "id": 1, "y": 3, **changes["columns"]}
        recipe = szlib.Recipe(columns=given, scale=1.0)
        found = read_raw(tmp_path / "hall.csv", recipe=recipe)
        assert found["x"].mean() == pytest.approx(rows["x"].mean() + 100, abs=1e-3)


@pytest.mark.parametrize("n_bad", [29, 50, 57, 58])
def test_the_advised_share_of_rejected_rows_is_enough(
    tmp_path: Path, n_bad: int
) -> None:
    lines = ["t,id,x,y", *(f"{k},1,{k},0" for k in range(100))]
    lines[1 : 1 + n_bad] = n_bad * ["0,1,?,0"]
    path = tmp_path / "hall.csv"
    path.write_text("\n".join(lines))
    with pytest.raises(szlib.DataError) as refused:
        read_raw(path)
    share = re.search(r"max_rejected=([\d.]+)", str(refused.value))
    assert share
    with pytest.warns(szlib.DataWarning, match=f"{n_bad} x missing"):
        raw = read_raw(path, recipe=szlib.Recipe(max_rejected=float(share[1])))
    assert len(raw) == 100 - n_bad


@pytest.mark.parametrize(
    "ways",
    [
        {"unit": "mm", "homography": np.eye(3)},
        {"scale": 0.8, "homography": np.eye(3)},
        {"unit": "cm", "origin": (0.0, 0.0)},
        {"unit": "m", "scale": 2.0},
    ],
)
def test_two_ways_to_metres_are_refused(ways: dict[str, Any]) -> None:
    with pytest.raises(szlib.DataError, match="several of unit, scale, homography"):
        szlib.Recipe(**ways)
