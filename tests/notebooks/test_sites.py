"""Readers of other sites: synthetic files with known people, valid tracks, refusals, and the real files."""

import json
import zipfile

import numpy as np
import pandas as pd
import pytest
from helpers.track_tables import real_data
from helpers.valid_tracks import check_tracks
from studies import sites

import szlib
from szlib.tracks import funnels

# --- Grand Central -----------------------------------------------------------------------------------

TILTED = np.array([[0.04, -0.03, 70.0], [0.14, -0.003, 8.0], [1.2e-3, -5e-5, 1.0]])
"""From (row, column, 1) to the floor, in units of 0.8 m."""


def pixels(floor):
    """Column and row at which the camera sees points of the floor [m], shape (n, 2)."""
    row, column, one = (
        np.linalg.inv(TILTED) @ np.column_stack([floor / 0.8, np.ones(len(floor))]).T
    )
    return np.column_stack([column / one, row / one])


def grand_central(folder, people, *, first=0):
    """An archive of people (paths (n, 2) [m]) annotated every 20th frame, and its homography."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "H.json").write_text(json.dumps({"homog": TILTED.tolist()}))
    with zipfile.ZipFile(folder / "Annotation.zip", "w") as packed:
        for person, path in people.items():
            lines = [
                f"{column:.9f}\n{row:.9f}\n{first + 20 * at}\n"
                for at, (column, row) in enumerate(pixels(path))
            ]
            packed.writestr(f"Annotation/{person:06d}.txt", "".join(lines))
    return folder / "Annotation.zip"


def straight(start, velocity, count=12):
    return np.asarray(start) + 0.8 * np.arange(count)[:, None] * np.asarray(velocity)


def test_grand_central_is_projected_to_the_floor(tmp_path):
    archive = grand_central(
        tmp_path, {7: straight((10, 20), (1.0, 0.5)), 12: straight((30, 45), (0, -1.5))}
    )
    tracks = sites.read_grand_central(archive)
    check_tracks(tracks)
    assert tracks["id"].unique().tolist() == [7, 12]
    one = tracks[tracks["id"] == 7]
    np.testing.assert_allclose(one["t"], np.arange(89) / 10, atol=1e-9)
    np.testing.assert_allclose(one["x"], 10 + one["t"], atol=1e-5)
    np.testing.assert_allclose(one["vy"], 0.5, atol=1e-5)
    with zipfile.ZipFile(archive) as packed:
        packed.extractall(tmp_path / "unpacked")
    folder = tmp_path / "unpacked" / "Annotation"
    unpacked = sites.read_grand_central(folder, homography=tmp_path / "H.json")
    pd.testing.assert_frame_equal(unpacked, tracks)


def test_gaps_of_grand_central_are_not_interpolated(tmp_path):
    archive = grand_central(tmp_path, {1: straight((10, 20), (1, 0))})
    with zipfile.ZipFile(archive) as packed:
        rows = packed.read("Annotation/000001.txt").decode().split()
    with zipfile.ZipFile(archive, "w") as packed:
        packed.writestr("Annotation/000001.txt", " ".join(rows[:12] + rows[15:]))
    tracks = sites.read_grand_central(archive)
    assert not tracks["t"].between(2.45, 3.95).any()
    assert sites.read_grand_central(archive, max_gap=2.0)["t"].between(2.45, 3.95).any()


def test_damaged_grand_central_files_are_refused(tmp_path):
    archive = grand_central(tmp_path / "a", {1: straight((10, 20), (1, 0))})
    with pytest.raises(
        szlib.DataError, match=r"H\.json: no such file; expected the homography"
    ):
        sites.read_grand_central(archive, homography=tmp_path / "H.json")
    (tmp_path / "a" / "H.json").write_text('{"homog": [[1, 2], [3, 4]]}')
    with pytest.raises(szlib.DataError, match="expected 3 x 3"):
        sites.read_grand_central(archive)
    (tmp_path / "a" / "H.json").write_text("no json")
    with pytest.raises(szlib.DataError, match="cannot be read as a homography"):
        sites.read_grand_central(archive)
    archive = grand_central(tmp_path / "a", {1: straight((10, 20), (1, 0))})
    with zipfile.ZipFile(archive, "a") as packed:
        packed.writestr("Annotation/000002.txt", "1 2 3 4")
    with pytest.raises(
        szlib.DataError, match=r"000002\.txt: expected column, row, frame"
    ):
        sites.read_grand_central(archive)
    archive.write_bytes(archive.read_bytes()[:100])
    with pytest.raises(szlib.DataError, match=r"Annotation\.zip: cannot be read"):
        sites.read_grand_central(archive)
    (tmp_path / "a" / "empty").mkdir()
    with pytest.raises(szlib.DataError, match=r"holds no file \*\.txt"):
        sites.read_grand_central(tmp_path / "a" / "empty")


# --- THOR-MAGNI --------------------------------------------------------------------------------------


def write_magni(path, sessions):
    """Sessions of 20 s, 0.01 s apart; people of one label walk side by side, 6 m from the next pair."""
    rows, begin = [], 0.01
    for labels in sessions:
        times = begin + 0.4 * np.arange(50)
        for place, (helmet, label) in enumerate(labels.items()):
            member = place % int(label[-1]) if "Group" in label else 0
            for t in times:
                message = (
                    round(t, 2),
                    f"Helmet_{helmet}",
                    t - begin,
                    6 * (place - member) + member,
                )
                rows.append((*message, 0, 0, 0, 0, f"Visitors-{label}"))
        begin = times[-1] + 0.01
    names = [
        "Time",
        "ag_id",
        "x",
        "y",
        "speed",
        "x_speed",
        "y_speed",
        "theta_delta",
        "data_label",
    ]
    pd.DataFrame(rows, columns=names).sort_values("Time").to_csv(path, index=False)
    return path


SESSIONS = [
    {1: "Alone", 2: "Group 2", 10: "Group 2", 3: "Group 3", 4: "Group 3", 5: "Group 3"},
    {1: "Alone", 2: "Group 2", 3: "Group 2", 4: "Group 2", 5: "Group 2"},
]


def test_a_helmet_is_another_person_in_each_session(tmp_path):
    file = write_magni(tmp_path / "A.csv", SESSIONS)
    tracks = szlib.read_tracks(file)
    check_tracks(tracks)
    assert tracks["id"].unique().tolist() == [
        101,
        102,
        103,
        104,
        105,
        110,
        201,
        202,
        203,
        204,
        205,
    ]
    assert (
        tracks.groupby("id")["t"]
        .agg(lambda t: t.max() - t.min())
        .between(19.4, 19.7)
        .all()
    )
    np.testing.assert_allclose(tracks["vx"], 1.0, atol=1e-6)


def test_magni_groups_are_found(tmp_path):
    groups = sites.read_magni_groups(write_magni(tmp_path / "A.csv", SESSIONS))
    found = {frozenset(people) for people in groups.groupby("group")["id"].apply(set)}
    assert found == {
        frozenset(g) for g in ((102, 110), (103, 104, 105), (202, 203), (204, 205))
    }
    file = write_magni(tmp_path / "B.csv", [{1: "Alone", 2: "Group 2"}])
    with pytest.raises(
        szlib.DataError, match="1 people are labelled 'Visitors-Group 2' in session 0"
    ):
        sites.read_magni_groups(file)


def test_damaged_magni_files_are_refused(tmp_path):
    file = write_magni(tmp_path / "A.csv", SESSIONS)
    rows = pd.read_csv(file)
    rows.drop(columns="data_label").to_csv(file, index=False)
    with pytest.raises(szlib.DataError, match="data_label"):
        szlib.read_tracks(file, file_format="magni")
    rows.assign(ag_id="Helmet").to_csv(file, index=False)
    with pytest.raises(szlib.DataError, match="ag_id 'Helmet' ends in no number"):
        szlib.read_tracks(file)
    with pytest.raises(szlib.DataError, match="no such file"):
        szlib.read_tracks(tmp_path / "missing.csv")
    bad = rows.index % 100 == 3
    rows.assign(x=np.where(bad, np.nan, rows["x"])).to_csv(file, index=False)
    with pytest.warns(
        szlib.DataWarning, match=f"{bad.sum()} x missing or not a number"
    ):
        assert funnels.get(szlib.read_tracks(file))[0]["rejected"] == {
            "missing or not a number": bad.sum()
        }


# --- groups ------------------------------------------------------------------------------------------


def test_groups_of_the_eth_sequence_are_read():
    folder = real_data("eth")
    with pytest.warns(
        szlib.DataWarning, match="line 37, 38"
    ):  # 238 is in lines 36 and 37, 241 in 37 and 38
        groups = sites.read_groups(folder / "seq_eth_groups.txt")
    assert (
        groups.loc[groups["id"] == 241, "group"].item()
        == groups.loc[groups["id"] == 240, "group"].item()
    )
    people = set(szlib.read_tracks(folder / "seq_eth_obsmat.txt")["id"])
    assert groups.groupby("group").size().min() == 2
    assert groups["id"].is_unique
    assert set(groups["id"]) <= people


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("1 2\n3 x\n", "line 2: '3 x' is no group"),
        ("1 2\n\n3\n", "line 3: '3' is no group"),
        ("1 2\n3 3\n", "line 2: '3 3' is no group"),
        ("1 2\n3 4.5\n", "line 2"),
    ],
)
def test_invalid_groups_are_refused_with_their_line(tmp_path, text, message):
    (tmp_path / "groups.txt").write_text(text)
    with pytest.raises(szlib.DataError, match=message):
        sites.read_groups(tmp_path / "groups.txt")
    with pytest.raises(szlib.DataError, match="cannot be read as groups"):
        sites.read_groups(tmp_path)


def test_blank_lines_in_a_group_file_are_ignored(tmp_path):
    (tmp_path / "groups.txt").write_text(" 5 4\n\n 6 3 2 \n")
    groups = sites.read_groups(tmp_path / "groups.txt")
    assert groups.to_numpy().tolist() == [[0, 5], [0, 4], [1, 6], [1, 3], [1, 2]]


def test_group_lines_that_share_people_are_joined(tmp_path):
    (tmp_path / "groups.txt").write_text("1 2\n3 4\n5 6\n4 2 7\n")
    with pytest.warns(szlib.DataWarning, match="line 4"):
        groups = sites.read_groups(tmp_path / "groups.txt")
    assert groups.groupby("group")["id"].apply(set).tolist() == [
        {1, 2, 3, 4, 7},
        {5, 6},
    ]


# --- the real files ----------------------------------------------------------------------------------


@pytest.mark.slow
def test_the_real_grand_central_is_read():
    tracks = sites.read_grand_central(real_data("gc") / "Annotation.zip")
    check_tracks(tracks)
    assert tracks["id"].nunique() == 12_684
    assert funnels.get(tracks)[0]["entered"] == 456_410
    assert tracks["t"].max() == pytest.approx(80 * 60, abs=10)
    pace = np.hypot(tracks["vx"], tracks["vy"]).dropna()
    assert 1.0 < pace.median() < 1.3, "swapped, row and column would give absurd speeds"
    assert pace.quantile(0.99) < 2.5


def test_the_real_magni_is_read():
    file = real_data("magni") / "A.csv"
    tracks, groups = szlib.read_tracks(file), sites.read_magni_groups(file)
    check_tracks(tracks)
    assert tracks["id"].nunique() == 60
    assert groups.groupby("group").size().value_counts().to_dict() == {2: 12, 3: 4}
    assert set(groups["id"]) < set(tracks["id"])
