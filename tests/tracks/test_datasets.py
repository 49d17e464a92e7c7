"""Named data: found, verified, downloaded, or refused with a reason."""

import hashlib
import threading
from dataclasses import replace
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import ClassVar

import pytest
from studies import quality

import szlib
from szlib.core.errors import DataError
from szlib.tracks import datasets


class QuietHandler(SimpleHTTPRequestHandler):
    def log_message(self, *args):
        """Say nothing."""


@pytest.fixture
def served(tmp_path, monkeypatch):
    """A day of one file on a local server, an empty cache, and no data folder."""
    home = tmp_path / "server"
    home.mkdir()
    (home / "a.csv").write_text("1351051200.0,1,0.0,0.0,0.0,0.0\n")
    server = ThreadingHTTPServer(
        ("127.0.0.1", 0), partial(QuietHandler, directory=str(home))
    )
    threading.Thread(target=server.serve_forever, args=(0.01,), daemon=True).start()
    monkeypatch.delenv(datasets.DATA_DIR_VARIABLE, raising=False)
    monkeypatch.setattr("pooch.os_cache", lambda name: tmp_path / "cache" / name)
    url = f"http://127.0.0.1:{server.server_port}/"
    change(monkeypatch, "atc-1hz", url=url, hashes={"a.csv": sha256(home / "a.csv")})
    yield home
    server.shutdown()
    server.server_close()


def change(monkeypatch, name, **changes):
    """Change the URL or the hashes of a data set."""
    monkeypatch.setitem(
        datasets.DATA_SETS, name, replace(datasets.DATA_SETS[name], **changes)
    )


def sha256(file: Path) -> str:
    return hashlib.sha256(file.read_bytes()).hexdigest()


def test_a_data_set_is_downloaded_once(served, tmp_path):
    (file,) = datasets.find("atc-1hz")
    assert file.read_text().startswith("1351051200.0")
    (served / "a.csv").unlink()
    assert datasets.find("atc-1hz") == [file]


@pytest.fixture
def served_days(served, monkeypatch):
    """Two of the ten days on the same server: one counts from the start of its day, one from 1970."""
    (served / "1024.csv").write_text(
        "".join(f"{36000 + t},7,{t - 20.0},{0.1 * t},1.0,0.0\n" for t in range(9))
    )
    (served / "1028.csv").write_text(
        "".join(f"{1351386000 + t},7,{-t},0.0,1.0,3.1\n" for t in range(9))
    )
    days = {name: sha256(served / name) for name in ("1024.csv", "1028.csv")}
    change(
        monkeypatch, "atc-10-days", url=datasets.DATA_SETS["atc-1hz"].url, hashes=days
    )
    return served


@pytest.mark.slow
def test_ten_days_are_downloaded_once_and_verified(served_days, tmp_path):
    files = datasets.find("atc-10-days")
    assert [file.name for file in files] == ["1024.csv", "1028.csv"]
    assert files[0].parent == tmp_path / "cache" / "szlib" / "atc-10-days"
    for name in ("1024.csv", "1028.csv"):
        (served_days / name).write_text("tampered")
    assert datasets.find("atc-10-days") == files, (
        "a cached file with the right hash needs no server"
    )
    files[1].write_text("damaged")
    with pytest.raises(
        DataError, match=r"atc-10-days could not be downloaded.*1028\.csv"
    ):
        datasets.find("atc-10-days")


def test_ten_days_are_read_from_a_data_folder(served_days, tmp_path, monkeypatch):
    folder = tmp_path / "data" / "atc-10-days"
    folder.mkdir(parents=True)
    for name in ("1024.csv", "1028.csv"):
        (folder / name).write_bytes((served_days / name).read_bytes())
    monkeypatch.setenv(datasets.DATA_DIR_VARIABLE, str(tmp_path / "data"))
    assert datasets.find("atc-10-days") == [folder / "1024.csv", folder / "1028.csv"]
    (folder / "1028.csv").write_text("damaged")
    with pytest.raises(DataError, match=r"1028\.csv needs to update"):
        datasets.find("atc-10-days")


def test_ten_days_are_dated_by_file_name_in_japan(served_days, tmp_path):
    tracks = szlib.read_tracks(datasets.find("atc-10-days"))
    assert tracks["day"].unique().tolist() == ["2012-10-24", "2012-10-28"]
    begin = tracks.groupby("day", observed=True)["t"].min()
    assert begin.tolist() == [1351040400.0, 1351386000.0], "10 o'clock of either day"
    here = szlib.read_tracks(datasets.find("atc-10-days"), tz="UTC")
    assert here["t"].tolist() == tracks["t"].tolist(), (
        "the start of a day in Japan does not depend on tz"
    )
    assert (
        quality.summarise_seconds(served_days / "1024.csv")["sensor_speed"].tolist()
        == [1.0] * 9
    )
    extracted = szlib.extract_days("atc-10-days", out=tmp_path / "days", progress=False)
    assert extracted.table["day"].tolist() == ["2012-10-24", "2012-10-28"]
    assert (extracted.table["status"] == "done").all()


def test_every_file_of_the_real_day_has_a_hash():
    hashes = datasets.DATA_SETS["atc-1hz"].hashes
    assert len(hashes) == 23
    assert all(len(digits) == 64 and int(digits, 16) for digits in hashes.values())
    assert len(datasets.DATA_SETS["atc-10-days"].hashes) == 10


def test_a_data_folder_is_used_and_verified(tmp_path, monkeypatch):
    folder = tmp_path / "atc-1hz"
    folder.mkdir()
    (folder / "a.csv").write_text("day")
    monkeypatch.setenv(datasets.DATA_DIR_VARIABLE, str(tmp_path))
    change(monkeypatch, "atc-1hz", hashes={"a.csv": sha256(folder / "a.csv")})
    assert datasets.find("atc-1hz") == [folder / "a.csv"]
    (folder / "a.csv").write_text("other")
    with pytest.raises(DataError, match=r"a\.csv needs to update"):
        datasets.find("atc-1hz")


def test_paths_folders_and_globs_are_found_in_order(tmp_path):
    for name in ("b.csv", "a.csv", ".hidden"):
        (tmp_path / name).write_text("x")
    both = [tmp_path / "a.csv", tmp_path / "b.csv"]
    assert datasets.find(str(tmp_path)) == both
    assert datasets.find(tmp_path / "*.csv") == both
    assert datasets.find([tmp_path / "b.csv", tmp_path / "a.csv"]) == both[::-1]
    with pytest.raises(
        DataError, match=r"expected 'atc-1hz'.*'synthetic' is for szlib run"
    ):
        datasets.find("synthetic")
    with pytest.raises(DataError, match="no data was named"):
        datasets.find([])


def test_labels_are_valid_folder_names():
    assert datasets.label("synthetic") == "synthetic"
    assert datasets.label("atc-10-days") == "atc-10-days"
    assert datasets.label("/data/atc-20121024.csv.gz") == "atc-20121024"
    assert datasets.label(["/data/a.csv", "/data/b.csv"]) == "a-and-1-more"
    assert datasets.label("/data/*.csv") == "files"


class UnreliableHandler(QuietHandler):
    """Shows one of `faults` for each request, then serves."""

    faults: ClassVar[list[str]] = []

    def do_GET(self) -> None:
        fault = self.faults.pop(0) if self.faults else ""
        content = (Path(self.directory) / "a.csv").read_bytes()
        if fault == "error 500":
            self.send_error(500)
            return
        self.send_response(200)
        self.send_header("Content-Length", str(len(content)))
        self.end_headers()
        if fault == "truncated":
            self.wfile.write(content[: len(content) // 2])
            self.close_connection = True
        elif fault == "slow":
            for byte in content:
                self.wfile.write(bytes([byte]))
                threading.Event().wait(0.01)  # pooch's sleep is replaced, this is not
        else:
            self.wfile.write(
                b"x" * len(content) if fault == "wrong content" else content
            )


@pytest.fixture
def server_faults(served, monkeypatch):
    """The faults that the same server shows; retries do not wait."""
    server = ThreadingHTTPServer(
        ("127.0.0.1", 0), partial(UnreliableHandler, directory=str(served))
    )
    threading.Thread(target=server.serve_forever, args=(0.01,), daemon=True).start()
    change(monkeypatch, "atc-1hz", url=f"http://127.0.0.1:{server.server_port}/")
    monkeypatch.setattr("pooch.core.time.sleep", lambda seconds: None)
    yield UnreliableHandler.faults
    UnreliableHandler.faults.clear()
    server.shutdown()
    server.server_close()


@pytest.mark.parametrize("fault", ["error 500", "truncated", "slow", "wrong content"])
def test_a_download_is_repeated_until_the_server_recovers(
    server_faults, served, tmp_path, fault
):
    server_faults += [fault] * 2
    (file,) = datasets.find("atc-1hz")
    assert file.read_bytes() == (served / "a.csv").read_bytes()
    assert [path.name for path in file.parent.iterdir()] == ["a.csv"]


# the connection to the server, which pooch leaves to the collector of garbage
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize("fault", ["error 500", "truncated", "wrong content"])
def test_a_failed_download_leaves_no_partial_file(server_faults, tmp_path, fault):
    server_faults += [fault] * 99
    with pytest.raises(DataError, match=r"could not be downloaded.*SZLIB_DATA_DIR"):
        datasets.find("atc-1hz")
    assert not [path for path in (tmp_path / "cache").rglob("*") if path.is_file()]
    server_faults.clear()
    assert datasets.find("atc-1hz"), "the next attempt downloads again"


def test_an_interrupted_download_leaves_no_partial_file(
    server_faults, tmp_path, monkeypatch
):
    def interrupt(*args, **kwargs):
        raise KeyboardInterrupt

    server_faults += ["slow"]
    with monkeypatch.context() as context:
        context.setattr("pooch.core.hash_matches", interrupt)
        with pytest.raises(KeyboardInterrupt):
            datasets.find("atc-1hz")
    assert not [path for path in (tmp_path / "cache").rglob("*") if path.is_file()]
    assert datasets.find("atc-1hz")
