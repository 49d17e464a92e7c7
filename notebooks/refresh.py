"""Execute the committed copies of the notebooks anew, and renew the README's pictures: `make notebooks`."""

import shutil
import sys
from pathlib import Path

import jupytext
from nbclient import NotebookClient

from szlib.workbook.record import places

HERE = Path(__file__).parent
FIGURES = HERE.parent / "results" / "lab" / "synthetic" / "figures"
PICTURES = {
    "zone.png": "05_zones-zone.png",
    "los.png": "02_encounters-los.png",
    "hull.png": "04_hull-hull.png",
    "corridor.png": "08_corridor-scenario.png",
    "making_room.gif": "10_making_room-run.gif",
}
"""The README's names of what the notebooks draw."""


def refresh(source: Path) -> None:
    """Execute one notebook and store it beside its script, without times, so that copies can be compared."""
    notebook = jupytext.read(source)
    NotebookClient(
        notebook,
        kernel_name="python3",
        record_timing=False,
        resources={"metadata": {"path": str(HERE)}},
        extra_arguments=["--log-level=CRITICAL"],
    ).execute()
    jupytext.write(notebook, source.with_suffix(".ipynb"))


def main(names: list[str]) -> None:
    for source in places.notebooks():
        if not names or any(places.is_called(source, name) for name in names):
            print(source.stem, flush=True)
            refresh(source)
    (HERE / "figures").mkdir(exist_ok=True)
    for name, figure in PICTURES.items():
        shutil.copyfile(FIGURES / figure, HERE / "figures" / name)


if __name__ == "__main__":
    main(sys.argv[1:])
