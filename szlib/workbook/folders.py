"""The folders of results: one for each data set and each choice of parameters.

    results/DATA/               a run with the default parameters
    results/DATA-1234abcd/      a run with other parameters; its parameters.json lists them
    results/lab/DATA[-...]/     notebooks that are executed by hand; they never change the results of a run

Each folder is marked with its purpose. A second data set of the same name gets a folder whose name ends with
eight digits.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from ..errors import DataError
from ..files import claim_folder, folder_purpose
from ..input_files import printable
from ..tracks import datasets

# The folder of the notebooks, beside the package in the repository.
NOTEBOOKS = Path(__file__).resolve().parents[2] / "notebooks"
RESULTS = "../results"  # the default folder of all results, relative to the notebooks
RESULTS_OF = "results of "  # how the purpose of each folder of results begins
PURPOSE = f"{RESULTS_OF}the workbook"  # the purpose that marks the folder of all results
LAB = "lab"  # the folder, among all results, of notebooks that are executed by hand
PARAMETERS = "parameters.json"  # file of a run: its data and parameters
RUN_VARIABLE = "SZLIB_RUN"  # environment variable of a kernel: the results folder of the kernel's run


def results_root(results: str | Path) -> Path:
    """Absolute path of the folder of all `results`; a relative path starts at the notebooks."""
    return ((NOTEBOOKS if NOTEBOOKS.is_dir() else Path()) / results).resolve()


def list_notebooks() -> list[Path]:
    """The scripts of the notebooks in reading order: 00, 01 ... 06, 06b, 07 ..."""
    return sorted(NOTEBOOKS.glob("[0-9][0-9]*_*.py"))


def has_name(notebook: Path, name: str) -> bool:
    """Whether `name` is the number ("06", which is not "06b") or the name ("06_barriers") of `notebook`."""
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
            raise DataError(f"{printable(path)}: the name is not readable text (UTF-8); rename the file")
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
    StorageError : the folder cannot be made, holds files of something else, or holds the data.
    """
    source = absolute_data(data)
    inputs = [] if source in datasets.NAMES else datasets.find(source)
    purpose = f"{RESULTS_OF}{source if isinstance(source, str) else ', '.join(source)}"
    if parameters:
        purpose += f" with {json.dumps(parameters, sort_keys=True)}"
    folder = Path(results) / datasets.label(data)
    claim_folder(results, PURPOSE)
    if parameters or folder_purpose(folder) not in (None, purpose):
        folder = folder.with_name(f"{folder.name}-{hashlib.sha256(purpose.encode()).hexdigest()[:8]}")
    return claim_folder(folder, purpose, inputs=inputs)


def remove_outputs(folder: Path, notebooks: Iterable[str]) -> None:
    """Remove from a results `folder` the outputs of these `notebooks`, before a run writes them again.

    Raises OSError if a file cannot be removed.
    """
    outputs = [folder / "report.html"]
    for name in notebooks:
        outputs += [folder / f"{name}.ipynb", folder / "records" / f"{name}.json"]
        outputs += (folder / "figures").glob(f"{name}-*")
    for file in outputs:
        file.unlink(missing_ok=True)
