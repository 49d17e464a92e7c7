"""Execute the notebooks, store the copies, and copy the pictures of the README: `make notebooks`."""

import posixpath
import re
import sys
from itertools import chain
from pathlib import Path

import jupytext
import nbformat
import numpy as np
from nbclient import NotebookClient
from PIL import Image, ImageSequence

from szlib.workbook import folders, runner

HERE = Path(__file__).parents[1]
LAB = HERE.parent / "results" / "lab"
PICTURES = {
    "zone.png": "06_respect-robot.png",
    "los.png": "02_encounters-los.png",
    "hull.png": "04_hull-hull.png",
    "corridor.png": "10_corridor-scenario.png",
    "making_room.gif": "11_waiting-run.gif",
    "laboratory.png": "13_laboratory-still.png",
}
"""The pictures of the README, and the figures of the notebooks from which they are copied."""
WARNING = re.compile(r"^\S+\.py:\d+: (\w*Warning: .*\n)(  .*\n)?", re.MULTILINE)
"""A warning with the path of a file on this machine, and the line that caused it."""
REAL_DAY = ("01", "02", "03", "04", "05", "06", "09", "10", "11", "28")
"""Notebooks with a copy on the real day, in the folder `real_day`: `refresh.py real_day [NN ...]`."""


def replace_data(source: Path, data: str) -> nbformat.NotebookNode:
    """Read the notebook `source` with other `data`, and with links that start in the folder `real_day`."""
    notebook, folder = jupytext.read(source), source.parent.relative_to(HERE).as_posix()
    for cell in notebook.cells:
        if "parameters" in cell.metadata.get("tags", []):
            cell.source = re.sub(r'^data = "\w+"', f'data = "{data}"', cell.source, flags=re.MULTILINE)
        elif cell.cell_type == "markdown":
            cell.source = re.sub(
                r"\]\((?!http|#)([^)]*)",
                lambda link: "](" + posixpath.normpath(f"../{folder}/{link[1]}"),
                cell.source,
            )
    return notebook


def refresh(source: Path, data: str = "") -> None:
    """Execute the notebook `source`, and store the copy beside it, or with other `data` in `real_day`.

    The copy holds no times and no paths, so that two copies can be compared.
    """
    notebook = replace_data(source, data) if data else jupytext.read(source)
    for number, cell in enumerate(notebook.cells):  # the same identifiers at every execution
        cell.id = f"{source.stem.split('_')[0]}-{number}"
    target = (HERE / "real_day" if data else source.parent) / f"{source.stem}.ipynb"
    target.parent.mkdir(exist_ok=True)
    NotebookClient(
        notebook,
        kernel_name="python3",
        record_timing=False,
        resources={"metadata": {"path": str(source.parent)}},
        extra_arguments=["--log-level=CRITICAL"],
    ).execute()
    for output in (each for cell in notebook.cells for each in cell.get("outputs", ())):
        if output.get("name") == "stderr":
            output["text"] = WARNING.sub(r"\1", output["text"])
    jupytext.write(notebook, target, fmt="ipynb")


def copy_picture(figure: Path, name: str, colours: int = 128) -> None:
    """Copy a `figure` of the last run to the pictures of the README, with fewer colours, so that it is small."""
    target = HERE / "figures" / name
    target.parent.mkdir(exist_ok=True)
    film = Image.open(figure)
    frames = [frame.convert("RGB") for frame in ImageSequence.Iterator(film)]
    # one palette for all frames, so that what does not move is stored once
    together = Image.fromarray(np.vstack(frames[::5]))
    palette = together.quantize(colours, Image.Quantize.MAXCOVERAGE, kmeans=1)
    first, *more = (frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames)
    moving = {"append_images": more, "duration": film.info["duration"], "loop": 0} if more else {}
    first.save(target, optimize=True, save_all=bool(more), **moving)


def main(names: list[str]) -> None:
    if names[:1] == ["real_day"]:
        for source in folders.list_notebooks():
            if any(folders.has_name(source, name) for name in names[1:] or REAL_DAY):
                print(source.stem, flush=True)
                refresh(source, "atc-1hz")
                if source.stem == "01_tracks":
                    copy_picture(LAB / "atc-1hz" / "figures" / "01_tracks-map.png", "mall.png", colours=20)
        return
    for source in chain(*runner.split_batches(folders.list_notebooks())):
        if not names or any(folders.has_name(source, name) for name in names):
            print(source.stem, flush=True)
            refresh(source)
    for name, figure in PICTURES.items():
        if not names or any(folders.has_name(Path(figure.partition("-")[0]), number) for number in names):
            few = 20 if name.endswith(".gif") else 128
            copy_picture(LAB / "synthetic" / "figures" / figure, name, colours=few)


if __name__ == "__main__":
    main(sys.argv[1:])
