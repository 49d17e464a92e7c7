"""Named data: found, verified, downloaded, or refused with a reason."""

import hashlib
import threading
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest

from szlib import datasets
from szlib.errors import DataError


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
    (file,) = datasets.find("atc-1hz", cache=tmp_path)
    assert file.read_text().startswith("1351051200.0")
    (served / "a.csv").unlink()
    assert datasets.find("atc-1hz", cache=tmp_path) == [file]


def test_a_wrong_hash_is_refused_and_nothing_stays(served, tmp_path):
    (served / "a.csv").write_text("tampered")
    with pytest.raises(DataError, match="hash"):
        datasets.find("atc-1hz", cache=tmp_path)
    assert not list((tmp_path / "cache").rglob("a.csv"))


def test_offline_says_what_to_do(served, tmp_path, monkeypatch):
    monkeypatch.setattr(datasets, "ATC_1HZ_URL", "http://127.0.0.1:9/")
    with pytest.raises(DataError, match=r"could not be downloaded.*SZLIB_DATA_DIR"):
        datasets.find("atc-1hz", cache=tmp_path)


def test_a_data_folder_is_used_and_verified(tmp_path, monkeypatch):
    folder = tmp_path / "atc-1hz"
    folder.mkdir()
    (folder / "a.csv").write_text("day")
    monkeypatch.setenv(datasets.DATA_DIR_VARIABLE, str(tmp_path))
    monkeypatch.setattr(datasets, "ATC_1HZ_FILES", {"a.csv": sha256(folder / "a.csv")})
    assert datasets.find("atc-1hz", cache=tmp_path) == [folder / "a.csv"]
    (folder / "a.csv").write_text("other")
    with pytest.raises(DataError, match=r"a\.csv: SHA-256 is .* expected"):
        datasets.find("atc-1hz", cache=tmp_path)
    (folder / "a.csv").unlink()
    with pytest.raises(DataError, match=r"a\.csv: no such file; \$SZLIB_DATA_DIR"):
        datasets.find("atc-1hz", cache=tmp_path)


def test_paths_folders_and_globs(tmp_path):
    for name in ("b.csv", "a.csv", ".hidden"):
        (tmp_path / name).write_text("x")
    both = [tmp_path / "a.csv", tmp_path / "b.csv"]
    assert datasets.find(str(tmp_path), cache=tmp_path) == both
    assert datasets.find(tmp_path / "*.csv", cache=tmp_path) == both
    assert datasets.find([tmp_path / "b.csv", tmp_path / "a.csv"], cache=tmp_path) == both[::-1]
    with pytest.raises(DataError, match="expected 'synthetic', 'atc-1hz'"):
        datasets.find("sinthetic", cache=tmp_path)
    with pytest.raises(DataError, match="no data was named"):
        datasets.find([], cache=tmp_path)


def test_labels_are_fit_for_folders():
    assert datasets.label("synthetic") == "synthetic"
    assert datasets.label("/data/atc-20121024.csv.gz") == "atc-20121024"
    assert datasets.label(["/data/a.csv", "/data/b.csv"]) == "a-and-1-more"
    assert datasets.label("/data/*.csv") == "files"
