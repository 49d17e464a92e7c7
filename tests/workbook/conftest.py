"""A workbook of one's own, for what runs notebooks."""

import pytest

from szlib.workbook import runner

HEADER = """# %%
import pathlib

from szlib.workbook.record import NotebookRecord

# %% tags=["parameters"]
data = "synthetic"
seed = 0
results = "../results"

# %%
record = NotebookRecord("{name}", data=data, results=results, seed=seed)
record.key["seed"] = seed
"""


@pytest.fixture
def notebooks(tmp_path, monkeypatch):
    """A workbook of one's own: `notebooks(name=code)` writes them; its data is a file of two rows."""
    folder = tmp_path / "notebooks"
    folder.mkdir()
    monkeypatch.setattr(runner, "NOTEBOOKS", folder)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.csv").write_text("t,id,x,y\n0,1,0,0\n1,1,1,0\n")

    def write(**codes):
        for name, code in codes.items():
            text = HEADER.format(name=f"{name[1:]}") + code + "\n\n# %%\nrecord.close()\n"
            (folder / f"{name[1:]}.py").write_text(text)

    return write
