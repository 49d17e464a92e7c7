"""The workbook without a checkout: what a wheel holds, `szlib notebooks`, and `szlib run` on such a copy."""

import json
import subprocess
import sys
import zipfile
from pathlib import Path

import nbformat
import pytest

from szlib.core.errors import DataError
from szlib.workbook import folders
from szlib.workbook.cli import main

ROOT = Path(__file__).resolve().parents[2]
pytestmark = pytest.mark.filterwarnings("ignore:.*IPython.*:DeprecationWarning")


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """The wheel that a build front end makes of this tree."""
    out = tmp_path_factory.mktemp("wheel")
    code = f"import dist; print(dist.build_wheel({str(out)!r}))"
    subprocess.run(
        [sys.executable, "-c", code],
        cwd=ROOT,
        env={"PYTHONPATH": str(ROOT / ".ci")},
        check=True,
    )
    (file,) = out.glob("*.whl")
    return zipfile.ZipFile(file)


def test_the_wheel_holds_the_workbook_and_stays_small(wheel):
    inside = {
        name.removeprefix("szlib/workbook/notebooks/") for name in wheel.namelist()
    }
    notebooks = ROOT / "notebooks"
    rooms = (
        "laboratory",
        "studies",
        "exercises",
        "exercises/judges",
        "solutions",
        "examples",
    )
    texts = ("laboratory/*.js", "exercises/judges/*.toml", "tables/*.csv")
    parts = ("[0-9]*.py", *texts, *(f"{room}/*.py" for room in rooms))
    expected = {
        file.relative_to(notebooks).as_posix()
        for part in parts
        for file in notebooks.glob(part)
    }
    assert len(expected) > 70 and expected <= inside
    assert {name for name in inside if name.startswith("figures/")} == {
        "figures/mall.png", "figures/making_room.gif",
    }  # fmt: skip
    assert not [
        name for name in inside if name.endswith(".ipynb") or "__pycache__" in name
    ]
    size = sum(
        each.compress_size
        for each in wheel.infolist()
        if "/notebooks/" in each.filename
    )
    assert size < 650_000, f"{size} bytes"


def test_the_build_leaves_the_tree_as_it_was(wheel):
    assert wheel.testzip() is None
    assert not (ROOT / "szlib" / "workbook" / "notebooks").exists()


@pytest.fixture
def installed(notebooks, tmp_path, monkeypatch):
    """A workbook that an installed package holds; the current folder is another one."""

    def write(**codes):
        folder = notebooks(**codes)
        (folder / "exercises").mkdir(exist_ok=True)
        (folder / "exercises" / "sheet1_tracks.py").write_text(
            "# %% [markdown]\n# # Sheet\n"
        )
        monkeypatch.setattr(folders, "BUNDLED", folder)
        (tmp_path / "home").mkdir(exist_ok=True)
        monkeypatch.chdir(tmp_path / "home")
        (Path("mine.csv")).write_text("t,id,x,y\n0,1,0,0\n1,1,1,0\n")
        return folder

    return write


@pytest.mark.usefixtures("without_kernels")
def test_an_installed_package_copies_its_notebooks_and_runs_the_copy(
    installed, tmp_path, capsys
):
    source = installed(_01_one='record.check("ok", True)')
    assert main(["notebooks", "course"]) == 0
    assert "szlib run" in capsys.readouterr().out
    copy = Path("course") / "notebooks"
    assert (copy / "01_one.py").read_text() == (source / "01_one.py").read_text()
    assert len(nbformat.read(copy / "01_one.ipynb", 4).cells) == 4
    assert (
        nbformat.read(copy / "exercises" / "sheet1_tracks.ipynb", 4).cells[0].source
        == "# Sheet"
    )
    mine = (copy / "01_one.py").read_text().replace('"ok"', '"mine"')
    (copy / "01_one.py").write_text(mine)
    assert main(["run", "--data", "mine.csv", "--notebooks", "course", "-j", "1"]) == 0
    names = json.loads(Path("results/mine/summary.json").read_text())["notebooks"][
        "01_one"
    ]["checks"]
    assert [check["name"] for check in names] == ["mine"]
    assert (
        not (tmp_path / "results").exists()
        and not (Path("course") / "results").exists()
    )


@pytest.mark.usefixtures("without_kernels")
def test_run_takes_the_notebooks_of_the_current_folder_else_those_of_the_package(
    installed, capsys
):
    installed(_01_one="")
    assert main(["run", "--data", "mine.csv", "-j", "1"]) == 0
    assert list(
        json.loads(Path("results/mine/summary.json").read_text())["notebooks"]
    ) == ["01_one"]
    assert main(["notebooks", "."]) == 0
    mine = Path("notebooks", "01_one.py").read_text().replace("01_one", "02_two")
    Path("notebooks", "02_two.py").write_text(mine)
    assert main(["run", "--data", "mine.csv", "--only", "02", "-j", "1"]) == 0
    capsys.readouterr()


def test_a_copy_never_replaces_a_file(installed, capsys):
    installed(_01_one="")
    Path("course/notebooks").mkdir(parents=True)
    Path("course/notebooks/my work.txt").write_text("mine")
    Path("taken").write_text("a file")
    for place, message in [
        ("course", "holds files"),
        ("taken", "cannot be made"),
        ("taken/in", "cannot"),
    ]:
        assert main(["notebooks", place]) == 2
        assert message in capsys.readouterr().err
    assert [file.name for file in Path("course/notebooks").iterdir()] == ["my work.txt"]


def test_a_folder_without_notebooks_and_a_misspelt_verb_are_refused(installed, capsys):
    installed(_01_one="")
    with pytest.raises(
        DataError, match="nowhere: there are no notebooks; expected a folder"
    ):
        folders.find_notebooks("nowhere")
    with pytest.raises(SystemExit) as stop:
        main(["notebook", "course"])
    assert stop.value.code == 2
    assert "invalid choice: 'notebook'" in capsys.readouterr().err
