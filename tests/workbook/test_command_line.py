"""`szlib inspect` and `szlib extract`: their output and exit codes."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import szlib
from szlib import ATC_SQUARE
from szlib.core import parallel
from szlib.plaza.generation import make_plaza
from szlib.plaza.settings import PlazaSettings
from szlib.workbook.cli import main


@pytest.fixture(scope="module")
def day(tmp_path_factory):
    path = tmp_path_factory.mktemp("day") / "atc-20121024.csv"
    return make_plaza(path, settings=PlazaSettings(n_encounters=40))


def test_inspect_prints_a_funnel_that_adds_up(day, capsys):
    spoilt = day.with_name("spoilt.csv")
    spoilt.write_text(day.read_text() + "1,2\n")
    assert main(["inspect", str(spoilt)]) == 0
    described, printed = re.split(
        r"^(?=area )", capsys.readouterr().out, flags=re.MULTILINE
    )
    assert described.startswith("spoilt.csv is read as atc-raw")
    assert re.search(r"speed 1\.\d+ m/s \(median\)", described)
    area, *lines, pairs, sensor, command = (
        line.split() for line in printed.splitlines()
    )
    assert " ".join(command) == "go on with: the same command --save"
    assert area == ["area", *str(ATC_SQUARE).split()]
    assert (pairs[0], int(pairs[-1]) > 0, sensor[:2]) == (
        "pairs",
        True,
        ["sensor:", "it"],
    )
    counts = [int(line[-1].replace(",", "")) for line in lines]
    assert lines[0][:3] == ["read", "spoilt.csv", "entered"]
    assert counts[0] == len(spoilt.read_text().splitlines())
    assert lines[1][:-1] == ["-", "missing", "or", "extra", "fields"]
    assert counts[:3] == [counts[0], 1, counts[0] - 1]
    assert lines[-1][0] == "kept"


def test_file_may_be_called_like_a_number(
    day,
    tmp_path,
    monkeypatch,
    capsys,
):
    (tmp_path / "-1").write_bytes(day.read_bytes())
    monkeypatch.chdir(tmp_path)
    assert main(["inspect", "-1"]) == 0
    assert "read -1" in capsys.readouterr().out


def test_ctrl_c_while_the_command_is_imported_shows_no_traceback():
    program = """
import os, signal, sys
class Interrupt:
    def find_spec(self, name, *_):
        if name == "szlib.workbook.cli":
            os.kill(os.getpid(), signal.SIGINT)
from szlib.__main__ import main
sys.meta_path.insert(0, Interrupt())
main()"""
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True,
        env=os.environ | {"PYTHONPATH": str(Path(szlib.__file__).parents[1])},
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (-signal.SIGINT, b"")


@pytest.mark.slow
def test_extract_prints_the_table(day, tmp_path, capsys):
    assert main(["extract", str(day), "--out", str(tmp_path / "out")]) == 0
    assert "1 done" in capsys.readouterr().out
    (tmp_path / "bad.csv").write_text("rubbish\n")
    both = [str(day), str(tmp_path / "bad.csv")]
    assert main(["extract", *both, "--out", str(tmp_path / "out"), "--jobs", "2"]) == 1
    assert "1 failed, 1 kept" in capsys.readouterr().out


def test_error_is_one_line_and_a_traceback_if_asked_for(tmp_path, monkeypatch, capsys):
    monkeypatch.delenv("SZLIB_TRACEBACK", raising=False)
    assert main(["inspect", str(tmp_path / "missing.csv")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "no such file" in line
    monkeypatch.setenv("SZLIB_TRACEBACK", "1")
    assert main(["inspect", str(tmp_path / "missing.csv")]) == 2
    first, *_, last = capsys.readouterr().err.splitlines()
    assert (first, last) == ("Traceback (most recent call last):", line)


def test_memory_that_is_no_amount_is_refused(tmp_path, capsys):
    assert main(["inspect", str(tmp_path), "--memory", "much"]) == 2
    assert "memory 'much': expected an amount such as 4GB" in capsys.readouterr().err


def test_error_names_an_address_without_scheduler(
    monkeypatch,
):
    distributed = pytest.importorskip("distributed")

    def refuse(*_, **__):
        raise OSError("Timed out trying to connect")

    monkeypatch.setattr(distributed, "Client", refuse)
    message = r"no Dask scheduler with a worker answers at 'tcp://127\.0\.0\.1:9'"
    with (
        pytest.raises(szlib.SzlibError, match=message),
        parallel.cluster("tcp://127.0.0.1:9"),
    ):
        pass
    with parallel.cluster(None) as client:
        assert client is None


@pytest.mark.slow
def test_extract_waits_for_workers_that_come_late(day, tmp_path):
    """As in a queue: the scheduler is up, its workers start later; without `--wait` the error says so."""
    pytest.importorskip("distributed")
    scheduler_file = tmp_path / "scheduler.json"
    dask = [
        sys.executable,
        "-m",
        "distributed.cli.dask_scheduler",
        "--port",
        "0",
        "--no-dashboard",
    ]
    scheduler = subprocess.Popen(
        [*dask, "--scheduler-file", str(scheduler_file)], stderr=subprocess.DEVNULL
    )
    worker = None
    try:
        end = time.monotonic() + 60
        while not scheduler_file.exists() and time.monotonic() < end:
            time.sleep(0.1)
        address = json.loads(scheduler_file.read_text())["address"]
        with (
            pytest.raises(
                szlib.SzlibError, match=r"no Dask scheduler with a worker .* --wait 600"
            ),
            parallel.cluster(address, wait=0.5),
        ):
            pass
        extract = [
            sys.executable,
            "-m",
            "szlib",
            "extract",
            str(day),
            "--out",
            str(tmp_path / "out"),
        ]
        program = subprocess.Popen([*extract, "--scheduler", address, "--wait", "60"])
        time.sleep(3.0)
        dask = [
            sys.executable,
            "-m",
            "distributed.cli.dask_worker",
            address,
            "--nthreads",
            "1",
            "--no-dashboard",
        ]
        worker = subprocess.Popen(dask, stderr=subprocess.DEVNULL, cwd=tmp_path)
        assert program.wait(timeout=120) == 0
    finally:
        for process in (scheduler, worker):
            if process is not None:
                process.terminate()
                process.wait()
    assert len(list((tmp_path / "out").glob("*.parquet"))) == 1


def test_inspect_says_that_nobody_walks_where_it_finds_no_area(day, tmp_path, capsys):
    tracks = szlib.read_tracks(day)[["t", "id", "x", "y"]]
    tracks[["x", "y"]] *= 0.3
    tracks.to_csv(tmp_path / "slow.csv", index=False)
    assert main(["inspect", str(tmp_path / "slow.csv")]) == 2
    assert "nobody walks: the median" in capsys.readouterr().err
