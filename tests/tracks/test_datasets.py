"""Named data: found, verified, downloaded, or refused with a reason."""

import hashlib
import threading
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import ClassVar

import pytest

import szlib
from szlib.errors import DataError
from szlib.tracks import datasets, quality


class Quiet(SimpleHTTPRequestHandler):
    def log_message(self, *args):
        """Say nothing."""


@pytest.fixture
def served(tmp_path, monkeypatch):
    """A day of one file on a local server, an empty cache, and no data folder."""
    home = tmp_path / "server"
    home.mkdir()
    (home / "a.csv").write_text("1351051200.0,1,0.0,0.0,0.0,0.0\n")
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=str(home)))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    monkeypatch.delenv(datasets.DATA_DIR_VARIABLE, raising=False)
    monkeypatch.setattr(datasets.pooch, "os_cache", lambda name: tmp_path / "cache" / name)
    monkeypatch.setattr(datasets, "ATC_1HZ_URL", f"http://127.0.0.1:{server.server_port}/")
    monkeypatch.setattr(datasets, "ATC_1HZ_FILES", {"a.csv": sha256(home / "a.csv")})
    yield home
    server.shutdown()
    server.server_close()


def sha256(file: Path) -> str:
    return hashlib.sha256(file.read_bytes()).hexdigest()


def test_downloads_once_and_then_needs_no_server(served, tmp_path):
    (file,) = datasets.find("atc-1hz")
    assert file.read_text().startswith("1351051200.0")
    (served / "a.csv").unlink()
    assert datasets.find("atc-1hz") == [file]


def test_a_wrong_hash_is_refused_and_nothing_stays(served, tmp_path):
    (served / "a.csv").write_text("tampered")
    with pytest.raises(DataError, match="hash"):
        datasets.find("atc-1hz")
    assert not list((tmp_path / "cache").rglob("a.csv"))


@pytest.fixture
def served_days(served, monkeypatch):
    """Two of the ten days on the same server: one counts from the start of its day, one from 1970."""
    (served / "1024.csv").write_text(
        "".join(f"{36000 + t},7,{t - 20.0},{0.1 * t},1.0,0.0\n" for t in range(9))
    )
    (served / "1028.csv").write_text("".join(f"{1351386000 + t},7,{-t},0.0,1.0,3.1\n" for t in range(9)))
    monkeypatch.setattr(datasets, "ATC_10_DAYS_URL", datasets.ATC_1HZ_URL)
    days = {name: datasets.git_blob_id(served / name) for name in ("1024.csv", "1028.csv")}
    monkeypatch.setattr(datasets, "ATC_10_DAYS_FILES", days)
    return served


def test_a_blob_is_called_as_by_git(tmp_path):
    (tmp_path / "a").write_bytes(b"hello world\n")
    assert datasets.git_blob_id(tmp_path / "a") == "3b18e512dba79e4c8300dd08aeb37f8e728b8dad"
    (tmp_path / "a").write_bytes(b"")
    assert datasets.git_blob_id(tmp_path / "a") == "e69de29bb2d1d6434b8b29ae775ad8c2e48c5391"


def test_ten_days_are_downloaded_once_and_verified_by_their_blobs(served_days, tmp_path):
    files = datasets.find("atc-10-days")
    assert [file.name for file in files] == ["1024.csv", "1028.csv"]
    assert files[0].parent == tmp_path / "cache" / "szlib" / "atc-10-days"
    for name in ("1024.csv", "1028.csv"):
        (served_days / name).write_text("tampered")
    assert datasets.find("atc-10-days") == files, "what is right in the cache needs no server"
    files[1].write_text("damaged")
    with pytest.raises(DataError, match=r"atc-10-days could not be downloaded.*1028\.csv: its hash is"):
        datasets.find("atc-10-days")
    assert files[0].exists() and not files[1].exists(), "nothing wrong stays"


def test_ten_days_from_a_folder(served_days, tmp_path, monkeypatch):
    folder = tmp_path / "data" / "atc-10-days"
    folder.mkdir(parents=True)
    for name in ("1024.csv", "1028.csv"):
        (folder / name).write_bytes((served_days / name).read_bytes())
    monkeypatch.setenv(datasets.DATA_DIR_VARIABLE, str(tmp_path / "data"))
    assert datasets.find("atc-10-days") == [folder / "1024.csv", folder / "1028.csv"]
    (folder / "1028.csv").write_text("damaged")
    with pytest.raises(DataError, match=r"1028\.csv: git blob id is .* expected"):
        datasets.find("atc-10-days")


def test_days_are_those_of_the_files_names_in_japan(served_days, tmp_path):
    tracks = szlib.read_tracks(datasets.find("atc-10-days"))
    assert tracks["day"].unique().tolist() == ["2012-10-24", "2012-10-28"]
    begin = tracks.groupby("day", observed=True)["t"].min()
    assert begin.tolist() == [1351040400.0, 1351386000.0], "10 o'clock of either day"
    here = szlib.read_tracks(datasets.find("atc-10-days"), tz="UTC")
    assert here["t"].tolist() == tracks["t"].tolist(), "the mall is in Japan, wherever we are"
    assert quality.seconds(served_days / "1024.csv")["sensor_speed"].tolist() == [1.0] * 9
    extracted = szlib.extract_days("atc-10-days", out=tmp_path / "days", progress=False)
    assert extracted.table["day"].tolist() == ["2012-10-24", "2012-10-28"]
    assert (extracted.table["status"] == "done").all()


def test_the_ten_days_are_those_of_the_readme():
    assert len(datasets.ATC_10_DAYS_FILES) == 10
    assert datasets.ATC_10_DAYS_FILES["1024.csv"] == "0c7f0c52acc32fc37123141de8ce0b0bbb38100d"
    assert all(len(blob) == 40 for blob in datasets.ATC_10_DAYS_FILES.values())


def test_offline_says_what_to_do(served, tmp_path, monkeypatch):
    monkeypatch.setattr(datasets, "ATC_1HZ_URL", "http://127.0.0.1:9/")
    with pytest.raises(DataError, match=r"could not be downloaded.*SZLIB_DATA_DIR"):
        datasets.find("atc-1hz")


def test_a_data_folder_is_used_and_verified(tmp_path, monkeypatch):
    folder = tmp_path / "atc-1hz"
    folder.mkdir()
    (folder / "a.csv").write_text("day")
    monkeypatch.setenv(datasets.DATA_DIR_VARIABLE, str(tmp_path))
    monkeypatch.setattr(datasets, "ATC_1HZ_FILES", {"a.csv": sha256(folder / "a.csv")})
    assert datasets.find("atc-1hz") == [folder / "a.csv"]
    (folder / "a.csv").write_text("other")
    with pytest.raises(DataError, match=r"a\.csv: SHA-256 is .* expected"):
        datasets.find("atc-1hz")
    (folder / "a.csv").unlink()
    with pytest.raises(DataError, match=r"a\.csv: no such file; \$SZLIB_DATA_DIR"):
        datasets.find("atc-1hz")


def test_paths_folders_and_globs(tmp_path):
    for name in ("b.csv", "a.csv", ".hidden"):
        (tmp_path / name).write_text("x")
    both = [tmp_path / "a.csv", tmp_path / "b.csv"]
    assert datasets.find(str(tmp_path)) == both
    assert datasets.find(tmp_path / "*.csv") == both
    assert datasets.find([tmp_path / "b.csv", tmp_path / "a.csv"]) == both[::-1]
    with pytest.raises(DataError, match="expected 'synthetic', 'atc-1hz'"):
        datasets.find("sinthetic")
    with pytest.raises(DataError, match="no data was named"):
        datasets.find([])


def test_labels_are_fit_for_folders():
    assert datasets.label("synthetic") == "synthetic"
    assert datasets.label("atc-10-days") == "atc-10-days"
    assert datasets.label("/data/atc-20121024.csv.gz") == "atc-20121024"
    assert datasets.label(["/data/a.csv", "/data/b.csv"]) == "a-and-1-more"
    assert datasets.label("/data/*.csv") == "files"


class Moody(Quiet):
    """Goes through `moods`, one a request, then serves."""

    moods: ClassVar[list[str]] = []

    def do_GET(self) -> None:
        mood = self.moods.pop(0) if self.moods else "well"
        content = (Path(self.directory) / "a.csv").read_bytes()
        if mood == "broken":
            self.send_error(500)
            return
        self.send_response(200)
        self.send_header("Content-Length", str(len(content)))
        self.end_headers()
        if mood == "truncating":
            self.wfile.write(content[: len(content) // 2])
            self.close_connection = True
        elif mood == "slow":
            for byte in content:
                self.wfile.write(bytes([byte]))
                threading.Event().wait(0.01)  # retries do not sleep here, this does
        else:
            self.wfile.write(b"x" * len(content) if mood == "lying" else content)


@pytest.fixture
def moody(served, monkeypatch):
    """The same server, in moods; retries do not wait."""
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(Moody, directory=str(served)))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    monkeypatch.setattr(datasets, "ATC_1HZ_URL", f"http://127.0.0.1:{server.server_port}/")
    monkeypatch.setattr("pooch.core.time.sleep", lambda seconds: None)
    yield Moody.moods
    Moody.moods.clear()
    server.shutdown()
    server.server_close()


@pytest.mark.parametrize("mood", ["broken", "truncating", "slow", "lying"])
def test_a_server_that_recovers_is_asked_again(moody, served, tmp_path, mood):
    moody += [mood] * 2
    (file,) = datasets.find("atc-1hz")
    assert file.read_bytes() == (served / "a.csv").read_bytes()
    assert [path.name for path in file.parent.iterdir()] == ["a.csv"]


@pytest.mark.parametrize("mood", ["broken", "truncating", "lying"])
def test_a_server_that_never_recovers_leaves_nothing_half_written(moody, tmp_path, mood):
    moody += [mood] * 99
    with pytest.raises(DataError, match=r"could not be downloaded.*SZLIB_DATA_DIR"):
        datasets.find("atc-1hz")
    assert not [path for path in (tmp_path / "cache").rglob("*") if path.is_file()]
    moody.clear()
    assert datasets.find("atc-1hz"), "and the next attempt begins anew"


def test_a_download_that_is_interrupted_leaves_nothing_half_written(moody, tmp_path, monkeypatch):
    def interrupt(*args, **kwargs):
        raise KeyboardInterrupt

    moody += ["slow"]
    with monkeypatch.context() as context:
        context.setattr("pooch.core.hash_matches", interrupt)
        with pytest.raises(KeyboardInterrupt):
            datasets.find("atc-1hz")
    assert not [path for path in (tmp_path / "cache").rglob("*") if path.is_file()]
    assert datasets.find("atc-1hz")
