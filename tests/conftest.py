"""Settings of all tests, the real data, and notebooks to run."""

import contextlib
import os
import sys
import warnings
from typing import Any
from unittest import mock

# before NumPy is loaded: threads of BLAS that wait take a core
os.environ.setdefault("OMP_NUM_THREADS", "1")

import hypothesis
import pytest
from helpers.track_tables import real_data

import szlib

hypothesis.settings.register_profile("szlib", deadline=None)  # tests are never timed
hypothesis.settings.load_profile("szlib")


@pytest.fixture(autouse=True)
def closed_figures():
    """Close every figure of a test: Matplotlib warns of the 21st open one."""
    yield
    if plt := sys.modules.get("matplotlib.pyplot"):
        plt.close("all")


@pytest.fixture(scope="module")
def sentences_held_by_notebook_10():
    """The claims that notebook 28 judges are here those of notebook 10."""
    from szlib.workbook import claims

    table = claims.load_sentences()
    table["held_by"] = [
        [name.replace("28: ", "10: ") for name in names] for names in table["held_by"]
    ]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(claims, "load_sentences", table.copy)
        yield


@pytest.fixture(scope="session")
def real_tracks():
    """The real day, 2012-10-24, on the common clock."""
    return szlib.read_tracks(sorted(real_data("atc-1hz").glob("*.csv")))


@pytest.fixture(scope="session")
def real_samples(real_tracks):
    """The encounters of the real day."""
    return szlib.find_encounters(real_tracks)


NOTEBOOK = """# %%
import pathlib

from szlib.workbook.record import NotebookRecord

# %% tags=["parameters"]
data = "synthetic"
seed = 0
results = "../results"

# %%
record = NotebookRecord("{name}", globals())
record.key["seed"] = seed
"""
"""What a notebook of a test begins with."""


@pytest.fixture
def notebooks(tmp_path, monkeypatch):
    """A workbook of its own: `notebooks(_01_name=code)` writes notebooks and returns their folder."""
    from szlib.workbook import folders

    folder = tmp_path / "notebooks"
    folder.mkdir()
    monkeypatch.setattr(folders, "NOTEBOOKS", folder)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.csv").write_text("t,id,x,y\n0,1,0,0\n1,1,1,0\n")

    def write(**codes):
        for name, code in codes.items():
            text = (
                NOTEBOOK.format(name=f"{name[1:]}")
                + code
                + "\n\n# %%\nrecord.close()\n"
            )
            (folder / f"{name[1:]}.py").write_text(text)
        return folder

    return write


@pytest.fixture
def without_kernels(monkeypatch):
    """Run the cells of notebooks in this process, to test what a run does around them."""
    import jupytext

    from szlib.workbook import execution

    def run_cells(script, given, folder, environment):
        notebook, variables = jupytext.read(script), dict[str, Any]()
        try:
            with (
                contextlib.chdir(script.parent),
                mock.patch.dict(os.environ, environment),
                warnings.catch_warnings(),
            ):
                warnings.simplefilter("default")
                for cell in notebook.cells:
                    exec(cell.source, variables)
                    if "parameters" in cell.metadata.get("tags", []):
                        variables |= given
        finally:
            jupytext.write(notebook, folder / f"{script.stem}.ipynb")

    monkeypatch.setattr(execution, "run_cells", run_cells)
