"""Named data: found, verified, downloaded, or refused with a reason."""

import hashlib
import threading
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import ClassVar

import pytest

from szlib.errors import DataError
from szlib.tracks import datasets


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
