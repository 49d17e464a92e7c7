"""A run decides about its kernels, figures and module path, whatever environment and folder hold."""

import json
import os
import sys
import tempfile
from pathlib import Path

import nbformat
import pytest

from szlib.workbook import cli, folders, runner
from szlib.workbook.cli import main

STALE = {
    "argv": ["/nowhere/python", "{connection_file}"],
    "display_name": "stale",
    "language": "python",
}
DRAW = """
import matplotlib.pyplot as plt
fig, ax = plt.subplots()
ax.plot([1, 2])
record.figure(fig, "line")
plt.subplots()
plt.show()"""
LOOK = """
import os, sys, tempfile, IPython.paths
record.key |= {"python": sys.executable, "path": sys.path, "temporary": tempfile.mkdtemp()}
record.key["ipython"] = IPython.paths.get_ipython_dir()
from studies import evil"""


def images(notebook):
    return [
        o
        for cell in notebook.cells
        for o in cell.get("outputs", ())
        if "image/png" in o.get("data", {})
    ]


@pytest.fixture
def foreign(tmp_path, monkeypatch):
    """A backend that shows nothing, a stale kernel called python3, an IPython folder that cannot be made."""
    kernel = tmp_path / "jupyter" / "kernels" / "python3"
    kernel.mkdir(parents=True)
    (kernel / "kernel.json").write_text(json.dumps(STALE))
    monkeypatch.setenv("JUPYTER_PATH", str(tmp_path / "jupyter"))
    monkeypatch.setenv("MPLBACKEND", "Agg")
    monkeypatch.setenv("IPYTHONDIR", "/proc/nowhere")


@pytest.mark.slow
@pytest.mark.usefixtures("foreign")
def test_figures_and_kernel_are_the_runs_own(notebooks, tmp_path):
    notebooks(_01_draw=DRAW)
    assert runner.run("mine.csv", out=tmp_path / "out")["passed"]
    assert (
        len(images(nbformat.read(tmp_path / "out" / "mine" / "01_draw.ipynb", 4))) == 2
    )


@pytest.mark.slow
@pytest.mark.usefixtures("foreign")
def test_kernel_imports_nothing_from_its_folder_and_leaves_no_temporary_file(
    notebooks, tmp_path, monkeypatch
):
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    folder = notebooks(_01_look=LOOK.rpartition("\n")[0], _06_import=LOOK)
    (folder / "studies").mkdir()
    (folder / "studies" / "evil.py").write_text("")
    (folder / "random.py").write_text("raise SystemExit('imported from the folder')")
    summary = runner.run("mine.csv", out=tmp_path / "out")
    assert summary["passed"], summary
    found = {name: each["key_figures"] for name, each in summary["notebooks"].items()}
    assert not {"", ".", str(tmp_path)} & {*found["01_look"]["path"]}
    for each in found.values():
        assert each["path"][-1] == str(folder), "the packages beside the notebooks"
    assert found["01_look"]["python"] == sys.executable
    private = str(Path(found["01_look"]["temporary"]).parent)
    assert found["01_look"]["ipython"] == private
    assert not Path(found["01_look"]["temporary"]).exists()
    assert os.environ["MPLBACKEND"] == "Agg" and "PYTHONSAFEPATH" not in os.environ
    assert not list((tmp_path / "temporary").glob("*.json"))


@pytest.mark.parametrize(
    "error",
    [
        MemoryError(),
        ImportError("ft2font.so: failed to map segment from shared object"),
    ],
)
def test_memory_that_is_used_up_is_named(error, monkeypatch, capsys):
    def fail(_):
        raise error

    monkeypatch.setattr(cli, "_inspect", fail)
    assert main(["inspect", "day.csv"]) == 2
    assert "szlib: this process has no more memory" in capsys.readouterr().err


@pytest.mark.usefixtures("without_kernels")
def test_report_uses_no_template_of_the_current_folder(notebooks, tmp_path):
    notebooks(_01_one="")
    template = tmp_path / "lab" / "lab" / "index.html.j2"
    template.parent.mkdir(parents=True)
    template.write_text("{{ cycler.__init__.__globals__.os.mkdir('executed') }}")
    assert runner.run("mine.csv", out=tmp_path / "out")["passed"]
    assert "01_one" in (tmp_path / "out" / "mine" / folders.REPORT).read_text()
    assert not (tmp_path / "executed").exists()
