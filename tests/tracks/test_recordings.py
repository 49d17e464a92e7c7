"""Different recordings are separated, pieces of one are joined; only regular files are read."""

from __future__ import annotations

import gzip
import os
import shutil
import signal
import tempfile
from pathlib import Path
from types import SimpleNamespace

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

import szlib
from szlib.core.errors import MemoryLimitError, StorageError
from szlib.core.input_files import environment
from szlib.tracks import datasets
from szlib.tracks.readers import read_raw
from szlib.tracks.sources import unpack

BEGIN = 1_351_040_400.0


def recording(
    x: float, *, begin: float = 0.0, people: range = range(1, 5), seconds: int = 30
) -> pd.DataFrame:
    """People who walk to the right from x, on parallel lines; two rows a second."""
    rows = [
        (begin + k / 2, p, x + k / 2, float(p))
        for p in people
        for k in range(2 * seconds)
    ]
    return pd.DataFrame(rows, columns=["t", "id", "x", "y"])


def write(path: Path, rows: pd.DataFrame) -> Path:
    path.parent.mkdir(exist_ok=True)
    rows.to_csv(path, index=False)
    return path


def fastest(tracks: pd.DataFrame) -> float:
    return float(tracks[["vx", "vy"]].abs().max().max())


def test_recordings_with_clocks_from_zero_are_separated(tmp_path: Path) -> None:
    files = [
        write(tmp_path / name / "rec.csv", recording(x))
        for name, x in (("a", 0.0), ("b", 50.0))
    ]
    tracks = szlib.read_tracks(files)
    assert set(tracks["day"]) == {"a-rec", "b-rec"}, "the same stem in two folders"
    assert fastest(tracks) < 1.5, "people do not jump"
    assert set(szlib.read_tracks(files[0])["day"]) == {"rec"}


def test_pieces_of_one_day_are_joined(tmp_path: Path) -> None:
    whole = recording(0.0, begin=BEGIN)
    early = whole["t"] < BEGIN + 12
    files = [
        write(tmp_path / "one.csv", whole[early]),
        write(tmp_path / "two.csv", whole[~early]),
    ]
    tracks = szlib.read_tracks(files)
    assert tracks["day"].nunique() == 1
    assert tracks.groupby("id").size().tolist() == [296] * 4
    with pytest.warns(szlib.DataWarning, match="96 x duplicate"):
        szlib.read_tracks([files[0], files[0]])
    undated = write(tmp_path / "undated.csv", recording(0.0))
    with pytest.raises(szlib.DataError, match="pass each file once"):
        szlib.read_tracks([undated, undated])


def test_people_in_two_places_at_once_are_refused(tmp_path: Path) -> None:
    one = write(tmp_path / "one.csv", recording(0.0, begin=BEGIN))
    other = write(tmp_path / "other.csv", recording(50.0, begin=BEGIN))
    with pytest.raises(szlib.DataError, match="person 1 is in two places at once"):
        szlib.read_tracks([one, other])
    mostly = pd.concat([recording(50.0, begin=BEGIN, people=range(1, 2)),
                        recording(30.0, begin=BEGIN + 30, people=range(2, 5))])  # fmt: skip
    with pytest.raises(szlib.DataError, match="person 1 is in two places at once"):
        szlib.read_tracks([one, write(tmp_path / "mostly.csv", mostly)])


@pytest.fixture
def alarm() -> None:
    signal.alarm(20)
    yield
    signal.alarm(0)


@pytest.mark.usefixtures("alarm")
def test_copies_of_a_recording_are_refused_whatever_their_names(tmp_path: Path) -> None:
    rows = recording(0.0)
    first = write(tmp_path / "monday.csv", rows)
    shuffled = write(tmp_path / "again.csv", rows.sample(frac=1, random_state=0))
    packed = tmp_path / "packed.csv.gz"
    packed.write_bytes(gzip.compress(first.read_bytes()))
    rounded = tmp_path / "rounded.csv"
    rows.assign(t=rows["t"] + 1e-9).to_csv(rounded, float_format="%.3f")
    single = tmp_path / "single.parquet"
    rows.astype({"t": "float32", "x": "float32"}).to_parquet(single)
    for copy in (shuffled, packed, rounded, single):
        with pytest.raises(
            szlib.DataError, match="monday and another recording hold the same"
        ):
            szlib.read_tracks([first, copy])
    with pytest.raises(szlib.DataError, match="hold the same rows"):
        szlib.read_tracks([rows, rows])
    others = write(tmp_path / "tuesday.csv", recording(0.1))
    assert szlib.read_tracks([first, others])["day"].nunique() == 2


def test_a_part_of_another_recording_is_refused(tmp_path: Path) -> None:
    """People in both would count twice: half as many would seem enough for a zone."""
    rows = recording(0.0)
    whole = write(tmp_path / "whole.csv", rows)
    part = write(tmp_path / "part.csv", rows.iloc[len(rows) // 2 :])
    holes = write(tmp_path / "holes.csv", rows[rows.index % 50 > 0])
    for other in (part, holes):
        with pytest.raises(
            szlib.DataError, match="and another recording hold the same rows"
        ):
            szlib.read_tracks([whole, other])


def test_only_regular_files_are_read(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "fifo.csv")
    for path in (tmp_path / "fifo.csv", Path("/dev/zero")):
        for read in (read_raw, datasets.find):
            with pytest.raises(szlib.DataError, match="is no regular file"):
                read(path)
    good = write(tmp_path / "good.csv", recording(0.0))
    (tmp_path / "folder.csv").mkdir()
    assert datasets.find(str(tmp_path / "*.csv")) == [good]


@pytest.mark.parametrize("glob", ["a**b", "x" * 300, "nowhere/*.csv"])
def test_globs_without_a_file_are_refused(glob: str) -> None:
    with pytest.raises(szlib.DataError, match=r"cannot be looked up|no such file"):
        datasets.find(glob)


def test_a_doubled_column_is_refused_by_name(tmp_path: Path) -> None:
    columns = [pa.array([0.0, 1.0])] * 5
    pq.write_table(
        pa.Table.from_arrays(columns, names=["t", "id", "x", "y", "x"]),
        tmp_path / "a.parquet",
    )
    with pytest.raises(szlib.DataError, match="names x twice; rename one of them"):
        read_raw(tmp_path / "a.parquet")


def test_a_full_temporary_folder_is_not_reported_as_damage(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    packed = tmp_path / "a.csv.gz"
    packed.write_bytes(gzip.compress(recording(0.0).to_csv(index=False).encode()))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "no such folder"))
    with pytest.raises(StorageError, match=r"no temporary folder .*TMPDIR"):
        read_raw(packed)
    full = tmp_path / "full"
    full.mkdir()
    (full / "unpacked").symlink_to("/dev/full")
    with pytest.raises(StorageError, match=r"no room to unpack it .*No space left"):
        unpack(packed, full / "unpacked")
    monkeypatch.setattr(
        shutil, "disk_usage", lambda _: SimpleNamespace(free=1, total=99)
    )
    with pytest.raises(StorageError, match="the disk is nearly full"):
        unpack(packed, tmp_path / "unpacked")
    monkeypatch.undo()
    with pytest.raises(szlib.DataError, match=r"damaged \.gz"):
        (tmp_path / "cut.gz").write_bytes(packed.read_bytes()[:-30])
        cut = tmp_path / "cut.gz"
        unpack(cut, tmp_path / "unpacked")


def test_files_too_large_for_memory_are_refused_before_reading(tmp_path: Path) -> None:
    file = write(tmp_path / "a.csv", recording(0.0))
    for name in ("a.csv.gz", "a.csv"):
        (tmp_path / "a.csv.gz").write_bytes(gzip.compress(file.read_bytes()))
        with (
            environment(SZLIB_MEMORY="10000"),
            pytest.raises(MemoryLimitError, match="of text takes about"),
        ):
            read_raw(tmp_path / name)
    recording(0.0).to_parquet(tmp_path / "a.parquet")
    with (
        environment(SZLIB_MEMORY="10000"),
        pytest.raises(MemoryLimitError, match="of a column takes about"),
    ):
        read_raw(tmp_path / "a.parquet")
    raw = read_raw(file)
    with (
        environment(SZLIB_MEMORY="10000"),
        pytest.raises(MemoryLimitError, match=r"the clock: 1,180 ticks of 240 rows"),
    ):
        szlib.tracks.clock.to_clock(raw)


def test_files_are_named_with_dots_but_without_their_endings(tmp_path: Path) -> None:
    files = [
        write(tmp_path / name, recording(x))
        for name, x in (("2024.01.15.csv", 0.0), ("2024.01.16.csv", 9.0))
    ]
    packed = tmp_path / "hall.csv.gz"
    packed.write_bytes(gzip.compress(recording(20.0).to_csv(index=False).encode()))
    days = set(szlib.read_tracks([*files, packed])["day"])
    assert days == {"2024.01.15", "2024.01.16", "hall"}


def test_durations_are_seconds_and_counts_of_microseconds_no_calendar() -> None:
    rows = recording(0.0)
    spans = rows.assign(t=pd.to_timedelta(rows["t"], unit="s"))
    tracks, expected = szlib.read_tracks(spans), szlib.read_tracks(rows)
    pd.testing.assert_frame_equal(tracks, expected)
    counts = recording(0.0, seconds=300).assign(t=lambda table: 1e6 * table["t"])
    with pytest.warns(szlib.DataWarning, match="nobody walks"):
        assert set(read_raw(counts)["day"]) == {"table-1"}


@pytest.mark.parametrize("path", [".", "/"])
def test_a_folder_without_a_name_is_refused_as_a_folder(path: str) -> None:
    with pytest.raises(szlib.DataError, match="is a folder; pass the files in it"):
        szlib.read_tracks(path)
