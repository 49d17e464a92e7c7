"""Misuse of the commands: foreign folders, stale results, bad parameters, full disks, signals."""

import io
import itertools
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pandas as pd
import psutil
import pytest
from helpers.faulty_disk import FaultyDisk

import szlib
from szlib.core.errors import DataError, StorageError
from szlib.encounters import days
from szlib.plaza.generation import make_plaza
from szlib.plaza.settings import PlazaSettings
from szlib.tracks import datasets
from szlib.workbook import folders, runner
from szlib.workbook.cli import main
from szlib.workbook.record import DataCache, NotebookRecord, data_cache
from szlib.workbook.record.parameters import check_parameters

HERE = os.environ | {"PYTHONPATH": str(Path(szlib.__file__).parents[1])}


def interrupt(*_):
    raise KeyboardInterrupt


def refused(arguments, capsys, message):
    """The command exits with 2, and one line contains `message`."""
    assert main(arguments) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert message in line


def test_extract_never_writes_into_a_folder_of_tracks(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "tracks").mkdir()
    day = make_plaza(tmp_path / "day.csv", settings=PlazaSettings(n_encounters=5))
    szlib.read_tracks(day).to_parquet(tmp_path / "tracks" / "day.parquet")
    before = (tmp_path / "tracks" / "day.parquet").read_bytes()
    refused(
        ["extract", "tracks", "--out", "tracks"],
        capsys,
        "holds files that szlib did not write",
    )
    refused(
        ["extract", "day.csv", "--out", "tracks"],
        capsys,
        "holds files that szlib did not write",
    )
    assert (tmp_path / "tracks" / "day.parquet").read_bytes() == before


def test_run_refuses_a_folder_with_other_files(notebooks, tmp_path, capsys):
    notebooks(_01_one="")
    refused(
        ["run", "--data", "mine.csv", "--out", "."],
        capsys,
        "holds files that szlib did not write",
    )


@pytest.mark.usefixtures("without_kernels")
def test_folder_name_of_links_globs_and_folders(notebooks, tmp_path):
    notebooks(
        _01_one='record.table(__import__("pandas").DataFrame({"a": [1]}), "table")'
    )
    (tmp_path / "dir").mkdir()
    (tmp_path / "dir" / "b.csv").write_bytes((tmp_path / "mine.csv").read_bytes())
    (tmp_path / "today.csv").symlink_to("mine.csv")
    for data, name in (
        ("dir/.", "dir"),
        ("di*/*.csv", "files"),
        ("today.csv", "today"),
    ):
        assert main(["run", "--data", data, "--out", "out", "--jobs", "1"]) == 0, data
        left = {path.name for path in (tmp_path / "out" / name).iterdir()}
        assert {"summary.json", "01_one.ipynb", "table.csv", "records"} <= left, data
    assert {path.name for path in (tmp_path / "out").iterdir() if path.is_dir()} == {
        "dir",
        "files",
        "today",
    }


def test_data_sets_of_one_name_do_not_share_results(tmp_path):
    for name in ("a/day.csv", "b/day.csv", "synthetic.csv"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    homes = {
        folders.claim_results(tmp_path / "out", str(tmp_path / name / "day.csv"))
        for name in "ab"
    }
    assert len(homes) == 2
    again = folders.claim_results(tmp_path / "out", str(tmp_path / "a" / "day.csv"))
    assert again == tmp_path / "out" / "day" and again in homes
    assert (
        folders.claim_results(tmp_path / "out", str(tmp_path / "synthetic.csv")).name
        == "synthetic"
    )
    assert folders.claim_results(tmp_path / "out", "synthetic").name.startswith(
        "synthetic-"
    )
    assert datasets.label("a/dir/.") == "dir"


def test_cache_is_not_used_for_other_data_of_the_same_name_and_size(
    tmp_path, monkeypatch
):
    file = tmp_path / "day.csv"
    make_plaza(file, settings=PlazaSettings(n_encounters=60))
    samples = NotebookRecord(
        "02", {"data": str(file), "results": tmp_path / "out"}
    ).cache.encounters()
    size, content = file.stat().st_size, file.read_text().splitlines(keepends=True)
    file.write_text("".join(content[len(content) // 2 :]))
    with file.open("a") as stream:  # a row that cannot be used, to make up the size
        stream.write("9" * (size - file.stat().st_size - 1) + "\n")
    later = NotebookRecord("02", {"data": str(file), "results": tmp_path / "out"})
    with pytest.warns(szlib.DataWarning):
        assert len(later.cache.encounters()) < len(samples)
    artefact = later.out / "encounters.parquet"
    artefact.write_bytes(artefact.read_bytes()[:-100])
    with pytest.warns(szlib.DataWarning):
        assert len(later.cache.encounters()) > 0, "what is damaged is healed"
    assert len(pd.read_parquet(artefact)) > 0


def test_report_describes_the_encounters_of_its_own_data(
    notebooks, without_kernels, tmp_path
):
    notebooks(_01_one="", _02_two="record.cache.encounters()")
    file = make_plaza(tmp_path / "a.csv", settings=PlazaSettings(n_encounters=30))

    def run_only(*names):
        return runner.run(str(file), out=tmp_path / "out", only=names)

    def read_stages():
        return json.loads((tmp_path / "out" / "a" / "summary.json").read_text())

    run_only("02")
    rows = len(file.read_text().splitlines())
    assert read_stages()["stages"][0]["rows"] == rows
    file.write_text("".join(file.read_text().splitlines(keepends=True)[:3000]))
    run_only("01")
    assert "stages" not in read_stages(), "the encounters are those of other data"
    run_only("02")
    assert read_stages()["stages"][0]["rows"] == 3000
    (tmp_path / "out" / "a" / "encounters.parquet").write_bytes(b"PAR1")
    run_only("01")
    assert "stages" not in read_stages(), "they are damaged"


def test_foreign_file_with_the_name_of_the_plaza_is_replaced(tmp_path, monkeypatch):
    (tmp_path / "plaza-0.csv").write_text("1,2,3,4,5,6,7,8\n")
    small = PlazaSettings(n_encounters=3)
    monkeypatch.setattr(
        data_cache,
        "make_plaza",
        lambda file, seed: make_plaza(file, seed=seed, settings=small),
    )
    cache = DataCache(tmp_path, "synthetic")
    (file,) = cache.files()
    assert len(file.read_text().splitlines()) > 100
    monkeypatch.setattr(data_cache, "make_plaza", None)
    assert cache.files() == [file], "ours is not made again"


def test_extraction_refuses_samples_that_another_one_replaced(tmp_path):
    day = make_plaza(tmp_path / "day.csv", settings=PlazaSettings(n_encounters=30))
    first = szlib.extract_days(day, out=tmp_path / "out", progress=False)
    assert len(first.samples()) > 0
    szlib.extract_days(day, out=tmp_path / "out", progress=False, min_speed=1.2)
    with pytest.raises(DataError, match="is not the result of this extraction"):
        first.samples()


def test_failed_day_does_not_stop_the_others(tmp_path, monkeypatch):
    names = ("day.csv", os.fsdecode(b"latin\xe4.csv"), "unforeseen.csv")
    for k, name in enumerate(names, 1):
        make_plaza(
            tmp_path / name,
            settings=PlazaSettings(n_encounters=5, date=f"2000-01-0{k}"),
        )
    (tmp_path / "rubbish.csv").write_text("rubbish\n")
    read = days.load_files

    def read_or_fail(files, *arguments):
        if files[0].name == "unforeseen.csv":
            raise KeyError("foreign")
        return read(files, *arguments)

    monkeypatch.setattr(days, "load_files", read_or_fail)
    table = szlib.extract_days(
        tmp_path, out=tmp_path / "out", progress=False
    ).table.set_index("day")
    assert table["status"].to_dict() == {
        "2000-01-01": "done", "latin\\udce4": "failed", "2000-01-03": "failed", "rubbish": "failed",
    }  # fmt: skip
    assert "rename the file" in table["why"]["latin\\udce4"]
    assert table["why"]["2000-01-03"] == "KeyError('foreign')"
    assert "'rubbish' has no column" in table["why"]["rubbish"]


@pytest.mark.usefixtures("without_kernels")
def test_interrupted_run_leaves_no_summary_that_passed(
    notebooks, tmp_path, monkeypatch
):
    notebooks(_01_one='record.check("ok", True)')
    arguments = ["run", "--data", "mine.csv", "--out", "out", "--jobs", "1"]
    assert main(arguments) == 0
    monkeypatch.setattr(runner, "execute_notebook", interrupt)
    assert main(arguments) == 130
    left = json.loads((tmp_path / "out" / "mine" / "summary.json").read_text())
    assert not left["passed"]
    assert not list((tmp_path / "out" / "mine" / "records").iterdir())


@pytest.mark.parametrize("garbage", ["summary.json", "records"])
def test_entry_that_blocks_results_is_named(notebooks, tmp_path, capsys, garbage):
    notebooks(_01_one="")
    home = folders.claim_results(tmp_path / "out", str(tmp_path / "mine.csv"))
    (home / garbage).write_text("") if garbage == "records" else (
        home / garbage
    ).mkdir()
    refused(["run", "--data", "mine.csv", "--out", "out"], capsys, garbage)


@pytest.mark.usefixtures("without_kernels")
def test_notebook_without_disk_space_is_refused_with_exit_code_2(
    notebooks, tmp_path, capsys
):
    full = 'from szlib.core.errors import StorageError\nraise StorageError("no room")'
    notebooks(_00_fine='record.check("ok", True)', _01_full=full, _06_later="")
    assert main(["run", "--data", "mine.csv", "--out", "out", "--jobs", "1"]) == 2
    printed = capsys.readouterr()
    assert (
        "01_full: could not be run: StorageError: no room; finished results stay"
        in printed.err
    )
    left = json.loads((tmp_path / "out" / "mine" / "summary.json").read_text())
    assert {n: r["status"] for n, r in left["notebooks"].items()} == {
        "00_fine": "done", "01_full": "refused", "06_later": "not started",
    }  # fmt: skip


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"seed": -1}, "seed: expected 0 to"),
        ({"seed": float("inf")}, "seed: expected int"),
        ({"seed": None}, "seed: expected int"),
        ({"has_walls": "True"}, "expected bool, such as false; got 'True'"),
        ({"gamma": 2.0}, r"gamma must be in \(0, 1\]"),
        ({"gamma": 0}, r"gamma must be in \(0, 1\]"),
        ({"gamma": float("nan")}, "gamma: expected"),
        ({"gamma": float("inf")}, "gamma: expected"),
        ({"gamma": "__import__('os')"}, "gamma: expected float"),
        ({"gammas": [0.1, 3.0]}, "gamma must be in"),
        ({"gammas": []}, "gammas: expected values such as"),
        ({"gammas": [0.1, "x"]}, "gammas: expected float"),
        ({"horizons": [0]}, "N_h must be a whole number >= 1"),
        ({"speeds": [-1.0]}, "speeds: expected 0.01 to 10"),
        ({"fraction": 0.9}, "fraction: expected 1e-06 to 0.5"),
        ({"results": "x"}, "use the option --out"),
        ({"reading": "mm"}, "reading: expected options of szlib.Recipe"),
        (
            {"reading": {"units": "mm"}},
            "reading: expected options of szlib.Recipe",
        ),
        ({"reading": {"unit": "inch"}}, "unit must be one of"),
    ],
)
def test_parameters_are_checked_before_any_notebook_starts(given, message):
    with pytest.raises(DataError, match=message):
        check_parameters(given, folders.list_notebooks())


def test_defaults_of_the_notebooks_are_in_range():
    from szlib.workbook.record.parameters import read_defaults

    for source in folders.list_notebooks():
        given = {
            n: v
            for n, v in read_defaults(source).items()
            if n not in ("data", "results")
        }
        check_parameters(given, [source])


@pytest.mark.slow
def test_kernel_gets_parameters_as_text_and_reports_errors(
    notebooks, tmp_path, monkeypatch
):
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    notebooks(_01_one='record.key["word"] = word', _02_crash="1 / 0")
    source = tmp_path / "notebooks" / "01_one.py"
    source.write_text(
        source.read_text().replace("seed = 0\n", 'seed = 0\nword = ""\n', 1)
    )
    code = "\"; __import__('pathlib').Path('executed').touch(); '\"\"\""
    summary = runner.run("mine.csv", out="out", parameters={"word": code})
    assert summary["notebooks"]["01_one"]["key_figures"]["word"] == code
    assert not list(tmp_path.rglob("executed"))
    assert not list(tmp_path.glob("temporary/*.json")), (
        "connection files of the kernels"
    )
    assert summary["notebooks"]["02_crash"]["status"] == "error"
    assert (
        summary["notebooks"]["02_crash"]["error"]
        == "ZeroDivisionError: division by zero"
    )
    assert "1 / 0" in Path(summary["report"]).with_name("02_crash.ipynb").read_text()


@pytest.mark.parametrize("value", ["9" * 5000, "[" * 100_000])
def test_unreadable_parameter_values_are_refused(value, capsys):
    refused(["run", "-p", f"seed={value}"], capsys, "seed")


def command(*arguments, **options):
    code = "import sys; from szlib.workbook.cli import main; sys.exit(main())"
    return subprocess.Popen(
        [sys.executable, "-c", code, *arguments], env=HERE | options.pop("env", {}), text=True,
        stderr=subprocess.PIPE, **options,
    )  # fmt: skip


def test_full_or_ascii_standard_output_gives_one_line(tmp_path, monkeypatch):
    make_plaza(tmp_path / "plätze.csv", settings=PlazaSettings(n_encounters=3))
    with Path("/dev/full").open("w") as full:
        done = command("inspect", str(tmp_path / "plätze.csv"), stdout=full)
        _, printed = done.communicate()
    assert done.returncode == 2
    assert printed.splitlines() == [
        "szlib: standard output cannot be written (No space left on device); make room, or name another file"
    ]
    printed = io.BytesIO()
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(printed, encoding="ascii"))
    assert main(["inspect", str(tmp_path / "plätze.csv")]) == 0
    assert rb"pl\xe4tze" in printed.getvalue()


def test_a_reader_that_ends_early_ends_the_command_in_silence(tmp_path):
    make_plaza(tmp_path / "p.csv", settings=PlazaSettings(n_encounters=3))
    there, here = os.pipe()
    os.close(there)
    done = command("inspect", str(tmp_path / "p.csv"), stdout=here)
    os.close(here)
    assert done.communicate()[1] == ""
    assert done.returncode == 128 + signal.SIGPIPE


@pytest.mark.slow
def test_sigterm_stops_extract_with_exit_code_143(tmp_path):
    days = [make_plaza(tmp_path / f"d{k}.csv", settings=PlazaSettings(n_encounters=300, date=f"2000-01-0{k}"))
            for k in range(1, 10)]  # fmt: skip
    done = command("extract", *map(str, days), "--out", str(tmp_path / "out"))
    while not list(tmp_path.glob("out/*.json")) and done.poll() is None:
        time.sleep(0.01)
    done.send_signal(signal.SIGTERM)
    _, printed = done.communicate()
    assert done.returncode == 143
    assert "szlib: stopped; finished results of this command stay" in printed
    assert not list(tmp_path.rglob(".szlib-part-*"))


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL])
def test_a_signal_stops_a_run_and_its_processes(notebooks, tmp_path, number):
    sleeper = """
import os, time
record.table(__import__("pandas").DataFrame({"pid": [os.getpid()]}), "kernel")
time.sleep(120)"""
    folder = notebooks(_01_sleeper=sleeper)
    program = tmp_path / "program.py"
    program.write_text(
        "import sys\nfrom pathlib import Path\nfrom szlib.workbook import folders\n"
        "from szlib.workbook.cli import main\nif __name__ == '__main__':\n"
        f"    folders.NOTEBOOKS = Path({str(folder)!r})\n    sys.exit(main())\n"
    )
    run = subprocess.Popen(
        [sys.executable, str(program), "run", "--data", "mine.csv", "--out", "out"],
        env=HERE | {"TMPDIR": str(tmp_path)}, text=True, stderr=subprocess.PIPE, stdout=subprocess.PIPE,
    )  # fmt: skip
    table = tmp_path / "out" / "mine" / "kernel.csv"
    while not table.exists() and run.poll() is None:
        time.sleep(0.05)
    kernel = int(table.read_text().split()[1])
    processes = psutil.Process(run.pid).children(recursive=True)
    assert kernel in {process.pid for process in processes}
    run.send_signal(number)
    _, printed = run.communicate()
    _, alive = psutil.wait_procs(processes, timeout=30)
    assert not [each for each in alive if each.status() != psutil.STATUS_ZOMBIE]
    if number == signal.SIGTERM:
        assert run.returncode == 143
        assert "szlib: stopped; finished results of this command stay" in printed
        assert not list(tmp_path.glob("*.json")), "the kernel's connection file"
    left = json.loads((tmp_path / "out" / "mine" / "summary.json").read_text())
    assert not left["passed"]
    assert not list(tmp_path.rglob("*.ipynb")), "an unfinished copy"


def test_run_recovers_from_a_full_disk_at_any_write(
    notebooks, tmp_path, monkeypatch, capsys
):
    notebooks(_01_one="", _06_two="")
    done = {
        "status": "done",
        "seconds": 0.0,
        "checks": [],
        "key_figures": {},
        "figures": [],
    }
    monkeypatch.setattr(runner, "execute_notebook", lambda *_: done)
    command = ["run", "--data", "mine.csv", "--out", "out"]
    for failing in itertools.count():
        shutil.rmtree(tmp_path / "out", ignore_errors=True)
        with FaultyDisk(failing) as disk:
            code = main(command)
        if code == 0:
            break
        *_, line = capsys.readouterr().err.splitlines()  # after the progress bar
        assert "No space left on device" in line
        assert not any(
            json.loads(file.read_text())["passed"]
            for file in tmp_path.rglob("summary.json")
        )
        assert main(command) == 0
        assert main([*command, "--only", "06"]) == 0
        capsys.readouterr()
    assert failing == disk.n_writes >= 4, "the two markers, the parameters, the summary"


def test_memory_option_refuses_larger_data(tmp_path, capsys):
    file = tmp_path / "day.csv"
    file.write_text("t,id,x,y\n" + "0,1,0,0\n" * 200_000)
    refused(
        ["inspect", str(file), "--memory", "1MB"],
        capsys,
        "to read 1.6 MB of text takes about 0.0096 GB of memory",
    )


def test_error_names_a_folder_that_cannot_be_made(tmp_path):
    with pytest.raises(StorageError, match="cannot be made or read"):
        folders.claim_results("/proc/nowhere", "synthetic")
