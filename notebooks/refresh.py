"""Execute the committed copies of the notebooks anew, and renew the README's pictures: `make notebooks`."""

import re
import shutil
import sys
from pathlib import Path

import jupytext
import nbformat
from nbclient import NotebookClient

from szlib.workbook import folders

HERE = Path(__file__).parent
LAB = HERE.parent / "results" / "lab"
PICTURES = {
    "zone.png": "05_zones-zone.png",
    "los.png": "02_encounters-los.png",
    "hull.png": "04_hull-hull.png",
    "corridor.png": "08_corridor-scenario.png",
    "making_room.gif": "10_making_room-run.gif",
    "laboratory.png": "20_laboratory-strip.png",
}
"""The README's names of what the notebooks draw."""


REAL_DAY = ("01", "02", "03", "04", "05", "16")
"""Notebooks of which a copy on the real day is kept, in the folder `real_day`: `refresh.py real_day`."""


def on(source: Path, data: str) -> nbformat.NotebookNode:
    """A notebook with other data than its own, its links as from the folder `real_day`."""
    notebook = jupytext.read(source)
    for cell in notebook.cells:
        if "parameters" in cell.metadata.get("tags", []):
            cell.source = re.sub(r'^data = "\w+"', f'data = "{data}"', cell.source, flags=re.MULTILINE)
        elif cell.cell_type == "markdown":
            cell.source = re.sub(r"\]\((?!http|#)", "](../", cell.source)
    return notebook


def refresh(source: Path, data: str = "") -> None:
    """Execute one notebook and store it beside its script, without times, so that copies can be compared.

    With other data than its own the copy goes into `real_day`.
    """
    notebook = on(source, data) if data else jupytext.read(source)
    for number, cell in enumerate(notebook.cells):  # no other names each time
        cell.id = f"{source.stem[:2]}-{number}"
    target = (HERE / "real_day" if data else HERE) / f"{source.stem}.ipynb"
    target.parent.mkdir(exist_ok=True)
    NotebookClient(
        notebook,
        kernel_name="python3",
        record_timing=False,
        resources={"metadata": {"path": str(HERE)}},
        extra_arguments=["--log-level=CRITICAL"],
    ).execute()
    jupytext.write(notebook, target, fmt="ipynb")


def main(names: list[str]) -> None:
    if names == ["real_day"]:
        for source in folders.list_notebooks():
            if any(folders.has_name(source, name) for name in REAL_DAY):
                print(source.stem, flush=True)
                refresh(source, "atc-1hz")
        shutil.copyfile(LAB / "atc-1hz" / "figures" / "01_tracks-map.png", HERE / "figures" / "mall.png")
        return
    for source in folders.list_notebooks():
        if not names or any(folders.has_name(source, name) for name in names):
            print(source.stem, flush=True)
            refresh(source)
    (HERE / "figures").mkdir(exist_ok=True)
    for name, figure in PICTURES.items():
        shutil.copyfile(LAB / "synthetic" / "figures" / figure, HERE / "figures" / name)


if __name__ == "__main__":
    main(sys.argv[1:])
