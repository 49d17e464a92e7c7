"""Folders of results: one for each data set and choice of parameters, and locked while a run writes."""

import json
import os
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

import szlib
from szlib.core.files import claim_folder, store_cached
from szlib.workbook import folders, runner
from szlib.workbook.cli import main

ENVIRONMENT = os.environ | {"PYTHONPATH": str(Path(szlib.__file__).parents[1])}
PRODUCES = """
import pandas as pd
record.table(pd.DataFrame({"n": [1]}), "01_table")
record.animation(b"GIF89a", "movie")
"""
CHECK = 'record.key = {"gamma": gamma}\nrecord.check("ok", True)'


@pytest.fixture
def workbook(notebooks, without_kernels):
    """Two notebooks, one with a parameter of its own."""
    folder = notebooks(_01_one='record.check("ok", True)', _08_two=CHECK)
    script = folder / "08_two.py"
    script.write_text(
        script.read_text().replace("seed = 0\n", "seed = 0\ngamma = 0.05\n")
    )
    return folder


def run(*arguments):
    assert (
        main(["run", "--data", "mine.csv", "--out", "out", "--jobs", "1", *arguments])
        == 0
    )


def contents(folder):
    return {
        str(file.relative_to(folder)): file.read_bytes()
        for file in folder.rglob("*")
        if file.is_file() and folders.LAB not in file.parts
    }


def test_other_parameters_have_another_folder(workbook, tmp_path):
    run()
    before = contents(tmp_path / "out")
    run("--only", "08", "-p", "gamma=0.1")
    (other,) = (tmp_path / "out").glob("mine-*")
    assert json.loads((other / "parameters.json").read_text())["parameters"] == {
        "gamma": 0.1
    }
    assert json.loads((other / "summary.json").read_text())["notebooks"]["08_two"][
        "key_figures"
    ] == {"gamma": 0.1}
    after = contents(tmp_path / "out")
    assert {name: after[name] for name in before} == before
    run("--only", "08", "-p", "gamma=0.05")
    assert len(list((tmp_path / "out").glob("mine-*"))) == 1, (
        "a default is no other parameter"
    )


def test_summary_keeps_the_other_notebooks_of_the_same_data(workbook, tmp_path):
    run()
    folder = tmp_path / "out" / "mine"
    first = json.loads((folder / "summary.json").read_text())["notebooks"]
    run("--only", "08")
    second = json.loads((folder / "summary.json").read_text())["notebooks"]
    assert list(second) == ["01_one", "08_two"]
    assert second["01_one"] == first["01_one"]
    (tmp_path / "mine.csv").write_text(
        (tmp_path / "mine.csv").read_text() + "9,9,9,9\n"
    )
    run("--only", "08")
    assert list(json.loads((folder / "summary.json").read_text())["notebooks"]) == [
        "08_two"
    ], "other data"


def test_summary_has_not_passed_before_the_run_ends(workbook, tmp_path, monkeypatch):
    run()
    monkeypatch.setattr(
        runner, "execute_notebook", lambda *_: (_ for _ in ()).throw(KeyboardInterrupt)
    )
    assert main(["run", "--data", "mine.csv", "--out", "out", "--only", "08"]) == 130
    left = json.loads((tmp_path / "out" / "mine" / "summary.json").read_text())
    assert not left["passed"]
    states = {name: outcome["status"] for name, outcome in left["notebooks"].items()}
    assert states == {"01_one": "done", "08_two": "not started"}


@pytest.mark.parametrize("gamma", [0.05, 0.8])
def test_notebook_executed_by_hand_changes_no_run(
    workbook, tmp_path, monkeypatch, gamma
):
    run()
    before = contents(tmp_path / "out")
    script = workbook / "08_two.py"
    text = script.read_text()
    hand = text.replace('data = "synthetic"', f"data = {str(tmp_path / 'mine.csv')!r}")
    hand = hand.replace('results = "../results"', 'results = "../out"').replace(
        "gamma = 0.05", f"gamma = {gamma}"
    )
    (tmp_path / "hand.py").write_text(hand + "\nrecord.close()\n")
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    runpy.run_path(str(tmp_path / "hand.py"))
    assert contents(tmp_path / "out") == before
    (left,) = (tmp_path / "out" / folders.LAB).glob("mine*/records/08_two.json")
    assert json.loads(left.read_text())["key_figures"] == {"gamma": gamma}


def test_relative_results_folder_is_beside_the_notebooks(
    workbook, tmp_path, monkeypatch
):
    monkeypatch.chdir("/")
    assert folders.results_root(folders.RESULTS) == tmp_path / "results"


def test_a_folder_is_locked_until_the_process_that_writes_there_ends(
    workbook, tmp_path, capsys
):
    run()
    program = f"""
from filelock import FileLock
with FileLock({str(tmp_path / "out" / "mine" / ".szlib-lock-run")!r}):
    print("locked", flush=True)
    input()
"""
    with subprocess.Popen(
        [sys.executable, "-c", program], stdin=-1, stdout=-1, env=ENVIRONMENT
    ) as holder:
        if holder.stdout is None or holder.stdout.readline() != b"locked\n":
            pytest.fail("the folder is not locked")
        before = contents(tmp_path / "out")
        capsys.readouterr()
        assert main(["run", "--data", "mine.csv", "--out", "out"]) == 2
        assert "another process is writing there" in capsys.readouterr().err
        assert contents(tmp_path / "out") == before
        run("-p", "seed=1")  # another folder
        holder.kill()
    run()


def test_clean_removes_what_a_run_wrote_and_nothing_else(workbook, tmp_path):
    script = runpy.run_path(str(Path(__file__).parents[2] / ".ci" / "clean.py"))
    (workbook / "01_one.py").write_text(
        (workbook / "01_one.py")
        .read_text()
        .replace('record.check("ok", True)', PRODUCES)
    )
    run()
    run("-p", "gamma=0.1")
    results = tmp_path / "out"
    for name in ("encounters.parquet", "zone.json", "plaza-0.csv"):
        store_cached(results / "mine" / name, b"", {})
    szlib.extract_days(tmp_path / "mine.csv", out=results / "days", progress=False)
    site = results / "site"
    site.mkdir()
    for name in ("index.html", "searchindex.js"):
        (site / name).write_text("of make docs")
    slides = claim_folder(results / "slides", "slides of the notebooks")
    (slides / "figures").mkdir()
    for name in ("01_one.html", "figures/01_one-map.png"):
        (slides / name).write_text("of make slides")
    own = [
        results / "thesis.txt",
        results / "mine" / "notes.csv",
        results / "mine" / "figures" / "mine.png",
    ]
    for file in own:
        file.write_text("mine")
    days = [file for file in (results / "days").iterdir() if file.name != ".szlib-lock"]
    script["clean"](results)
    left = {
        file
        for file in results.rglob("*")
        if file.is_file() and not file.name.startswith(".szlib")
    }
    assert left == {
        *own,
        *(file for file in days if not file.name.startswith(".szlib")),
    }
    assert (
        not list(results.glob("mine-*")) and not site.exists() and not slides.exists()
    )
    for file in own:
        file.unlink()
    for file in (results / "days").iterdir():
        file.unlink()
    (results / "days").rmdir()
    (results / "mine" / "figures").rmdir()
    script["clean"](results)
    assert not results.exists()


@pytest.mark.slow
@pytest.mark.parametrize(
    "command",
    [
        ("benchmarks", "import szlib"),
        ("hostile", "reading"),
        ("studies/mutants.py", "table", "--out", "results/mutants"),  # has no outcomes
    ],
)
def test_szlib_run_may_write_beside_a_tool(tmp_path, command):
    tool, *arguments = command
    file = Path(__file__).parents[1] / tool
    subprocess.run(
        [sys.executable, str(file), *arguments],
        cwd=tmp_path, env=ENVIRONMENT, capture_output=True, check=False,
    )  # fmt: skip
    assert any((tmp_path / "results").glob("[!.]*"))
    folders.claim_results(tmp_path / "results", "synthetic")
