"""The notebooks, their parameters, and the folders of results: one for each data set and choice of these.

    results/DATA/               a run with the default parameters
    results/DATA-1234abcd/      a run with other parameters; its parameters.json lists them
    results/lab/DATA[-...]/     notebooks that are executed by hand; they never change the results of a run

Each folder is marked with its purpose. A second data set of the same name gets a folder whose name ends with
eight digits.
"""

from __future__ import annotations

import ast
import hashlib
import json
import os
import re
import shutil
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from ..core.errors import DataError, StorageError
from ..core.files import claim_folder, folder_purpose
from ..core.input_files import printable, read_small
from ..tracks import datasets

# The folder of the notebooks: in an installed package, or beside the package in the repository.
BUNDLED = Path(__file__).resolve().parent / "notebooks"
NOTEBOOKS = BUNDLED if BUNDLED.is_dir() else BUNDLED.parents[2] / "notebooks"
# parameters that are options of the command line
OPTIONS = {"data": "--data", "results": "--out"}
RESULTS = "../results"  # the default folder of all results, relative to the notebooks
RESULTS_OF = "results of "  # how the purpose of each folder of results begins
# the purpose that marks the folder of all results
PURPOSE = f"{RESULTS_OF}the workbook"
LAB = "lab"  # the folder, among all results, of notebooks that are executed by hand
REPORT = "report.html"  # file of a run: its report
PARAMETERS = "parameters.json"  # file of a run: its data and parameters
# What a copy of the notebooks leaves out: their executed copies.
_UNNEEDED = shutil.ignore_patterns("*.ipynb", "__pycache__", "real_day", "tools", ".*")
FIGURES_VARIABLE = "SZLIB_FIGURES"  # environment variable of a kernel: a second format of figures, as svg
RUN_VARIABLE = "SZLIB_RUN"  # environment variable of a kernel: the results folder of the kernel's run


def results_root(results: str | Path) -> Path:
    """Absolute path of the folder of all `results`.

    A relative path starts at the notebooks of the repository, or else at the current folder.
    """
    return ((Path() if NOTEBOOKS == BUNDLED else NOTEBOOKS) / results).resolve()


def default_results(notebooks: Path) -> Path:
    """The folder of all results of the `notebooks`: beside those of the repository, else `results` here."""
    in_repository = notebooks == NOTEBOOKS != BUNDLED
    return results_root(RESULTS) if in_repository else Path("results").resolve()


def find_notebooks(folder: str | Path | None = None) -> Path:
    """The notebooks in a `folder`, or in `notebooks` inside it.

    None: those of the repository; in an installed package those of the current folder, else its own.
    Raises DataError if there are none.
    """
    given = Path(folder or ".").resolve()
    places = [given, given / "notebooks"]
    if folder is None:
        places = [*places, BUNDLED] if NOTEBOOKS == BUNDLED else [NOTEBOOKS]
    found = next((place for place in places if list_notebooks(place)), None)
    if found is None:
        raise DataError(
            f"{printable(folder or NOTEBOOKS)}: there are no notebooks; expected a folder that "
            "`szlib notebooks` wrote"
        )
    return found


def list_notebooks(folder: Path | None = None) -> list[Path]:
    """The scripts of the notebooks in a `folder` (None: `NOTEBOOKS`): the chapters, and those in `deeper`."""
    parts = ("[0-9][0-9]*_*.py", "deeper/[0-9][0-9]*_*.py")
    return [
        script for part in parts for script in sorted((folder or NOTEBOOKS).glob(part))
    ]


def copy_notebooks(folder: str | Path) -> Path:
    """Copy the workbook, with its exercises, to `notebooks` in a `folder`, and return that path.

    With Jupytext each script gets a notebook beside it, not executed. Raises StorageError if there are files
    already, or the copy cannot be written.
    """
    place = Path(folder) / "notebooks"
    try:
        if place.exists() and any(place.iterdir()):
            raise StorageError(
                f"{printable(place)}: holds files; choose a new or empty folder"
            )
        shutil.copytree(NOTEBOOKS, place, ignore=_UNNEEDED, dirs_exist_ok=True)
        if find_spec("jupytext"):
            _pair_notebooks(place)
    except OSError as error:
        raise StorageError(
            f"{printable(place)}: cannot be made ({error.strerror or str(error)[:99]}); choose another folder"
        ) from error
    return place


def _pair_notebooks(place: Path) -> None:
    """Write a notebook beside each script in a copy of the workbook."""
    import jupytext

    sheets = (*place.glob("exercises/*.py"), *place.glob("solutions/*.py"))
    for script in (*list_notebooks(place), *sheets):
        jupytext.write(jupytext.read(script), script.with_suffix(".ipynb"))


def has_name(notebook: Path, name: str) -> bool:
    """Whether `name` is the number ("1", which is not "11") or the name ("07_barriers") of `notebook`."""
    return f"{notebook.stem}_".startswith(f"{name}_")


def absolute_data(data: str | Path | Sequence[str | Path]) -> str | list[str]:
    """The same `data` with absolute paths and globs; the name of a data set stays as it is.

    Raises DataError for a path that is not readable text, since it cannot be passed to a notebook.
    """
    if isinstance(data, str) and data in datasets.NAMES:
        return data
    paths = [data] if isinstance(data, str | Path) else list(data)
    for path in paths:
        if printable(path) != str(path):
            raise DataError(
                f"{printable(path)}: the name is not readable text (UTF-8); rename the file"
            )
    return [os.path.abspath(path) for path in paths]  # noqa: PTH100 - links keep their names


def claim_results(
    results: str | Path,
    data: str | Path | Sequence[str | Path],
    parameters: Mapping[str, Any] | None = None,
) -> Path:
    """Make and mark the folder of results for one data set and one choice of parameters.

    Parameters
    ----------
    results : the folder of all results.
    data : the name of a data set, or paths of track files.
    parameters : the parameters that are not at their defaults.

    Returns
    -------
    The path of the folder.

    Raises
    ------
    DataError : there is no such file.
    StorageError : the folder cannot be made, or holds files of something else.
    """
    source = absolute_data(data)
    if source not in datasets.NAMES:
        datasets.find(source)
    purpose = f"{RESULTS_OF}{source if isinstance(source, str) else ', '.join(source)}"
    if parameters:
        purpose += f" with {json.dumps(parameters, sort_keys=True)}"
    folder = Path(results) / datasets.label(data)
    claim_folder(results, PURPOSE)
    if parameters or folder_purpose(folder) not in (None, purpose):
        folder = folder.with_name(
            f"{folder.name}-{hashlib.sha256(purpose.encode()).hexdigest()[:8]}"
        )
    return claim_folder(folder, purpose)


def remove_outputs(folder: Path, notebooks: Iterable[str]) -> None:
    """Remove from a results `folder` the outputs of these `notebooks`, before a run writes them again.

    Raises OSError if a file cannot be removed.
    """
    files = [folder / REPORT]
    for name in notebooks:
        files += [folder / f"{name}.ipynb", folder / "records" / f"{name}.json"]
        files += (folder / "figures").glob(f"{name}-*")
    for file in files:
        file.unlink(missing_ok=True)


def read_json_object(path: Path) -> dict[str, Any]:
    """The object in the small JSON file `path`; empty if the file is missing or damaged."""
    with suppress(OSError, ValueError, TypeError, RecursionError):
        return dict(json.loads(read_small(path)))
    return {}


def require_place(file: Path) -> Path:
    """The `file`, if it can be written to its folder: before hours of work, not after them."""
    if file.is_dir():
        raise StorageError(f"{printable(file)}: is a folder; name a file in it")
    if not file.parent.is_dir() or not os.access(file.parent, os.W_OK):
        raise StorageError(
            f"{printable(file.parent)}: is no folder that can be written; choose another one"
        )
    return file


def read_defaults(notebook: Path) -> dict[str, Any]:
    """Read the default parameters from the cell tagged "parameters" of a `notebook` (a percent script)."""
    cells = re.split(r"^# %%", notebook.read_text(encoding="utf-8"), flags=re.MULTILINE)
    return {
        node.targets[0].id: ast.literal_eval(node.value)
        for head, _, body in (cell.partition("\n") for cell in cells)
        if re.search(r'tags=\[[^]]*"parameters"', head)
        for node in ast.parse(body).body
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name)
    }
