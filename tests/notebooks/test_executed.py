"""Notebooks that a run executed have the figures of their committed copies: after `make run`, as CI does."""

import nbformat
import pytest

from szlib.workbook import folders

ROOT = folders.NOTEBOOKS.parent
COPIES = {"synthetic": folders.NOTEBOOKS, "atc-1hz": folders.NOTEBOOKS / "real_day"}
"""The folder of the committed copies, by data set."""
EXECUTED = [
    (file, COPIES[data] / file.name)
    for data in COPIES
    for file in sorted((ROOT / "results" / data).glob("[0-9][0-9]*_*.ipynb"))
    if (COPIES[data] / file.name).exists()
    and file.stat().st_mtime
    > (COPIES[data] / file.name).stat().st_mtime  # executed after the copy was made
]


def count_images(notebook):
    cells = nbformat.read(notebook, as_version=4).cells
    outputs = [output for cell in cells for output in cell.get("outputs", ())]
    return sum("image/png" in output.get("data", {}) for output in outputs)


@pytest.mark.skipif(
    not EXECUTED, reason="no notebook was executed after the copies: make run"
)
@pytest.mark.parametrize(
    ("executed", "committed"), EXECUTED, ids=lambda file: file.stem
)
def test_executed_notebook_has_as_many_figures_as_its_copy(executed, committed):
    assert count_images(executed) == count_images(committed)
