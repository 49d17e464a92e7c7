"""Where results go: one folder for each data set and each choice of parameters.

    results/DATA/               a run with the default parameters
    results/DATA-1234abcd/      a run with others; its parameters.json says which
    results/lab/DATA[-...]/     what is executed by hand, in JupyterLab: never a run's record

A folder is marked with what it is for; another data set of the same name gets a folder of its own, its name
with eight digits behind it.  A link, a folder or a glob has the name it was asked for by.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from ...errors import DataError, StorageError
from ...files import claim_folder, folder_purpose, printable
from ...tracks import datasets

NOTEBOOKS = Path(__file__).resolve().parents[3] / "notebooks"
"""The workbook's home: beside the package in the repository."""
RESULTS = "../results"
"""The folder of all results, from the notebooks."""
ROOT = "results of the workbook"
"""What the folder of all results is marked as."""
LAB = "lab"
"""In the folder of all results: what no run has made."""
RUN_VARIABLE = "SZLIB_RUN"
"""The folder of the run to which a kernel belongs, in its environment."""


def root(results: str | Path) -> Path:
    """The folder of all results: a relative path starts at the notebooks, wherever this is called."""
    start = NOTEBOOKS if NOTEBOOKS.is_dir() else Path()
    return (start / results).resolve()


def notebooks() -> list[Path]:
    """The notebooks' scripts in the order of the story: 00, 01 ... 06, 06b, 07 ..."""
    return sorted(NOTEBOOKS.glob("[0-9][0-9]*_*.py"))


def is_called(notebook: Path, name: str) -> bool:
    """Whether a notebook has this number ("06", which is not "06b") or this name ("06_barriers")."""
    return f"{notebook.stem}_".startswith(f"{name}_")


def absolute(data: str | Path | Sequence[str | Path]) -> str | list[str]:
    """The same data from wherever it is asked for: names as they are, paths and globs absolute.

    Raises DataError for a path that is no readable text: it could not be handed to a notebook.
    """
    if isinstance(data, str) and data in datasets.NAMES:
        return data
    paths = [data] if isinstance(data, str | Path) else list(data)
    for path in paths:
        if printable(path) != str(path):
            raise DataError(f"{printable(path)}: is no readable text (UTF-8); rename the file")
    return [os.path.abspath(path) for path in paths]  # noqa: PTH100 - links keep their names


def home(
    results: str | Path,
    data: str | Path | Sequence[str | Path],
    parameters: Mapping[str, Any] | None = None,
    *,
    inputs: Iterable[Path] = (),
) -> Path:
    """The folder for this data and these parameters, but for defaults; made and marked where it is missing.

    Raises StorageError where it cannot be made, holds what szlib did not write, or any of `inputs`.
    """
    source = absolute(data)
    name = datasets.label(data)
    purpose = f"results of {source if isinstance(source, str) else ', '.join(source)}"
    if parameters:
        purpose += f" with {json.dumps(parameters, sort_keys=True)}"
    digits = hashlib.sha256(purpose.encode()).hexdigest()[:8]
    claim_folder(results, ROOT)
    folder = Path(results) / name
    if not parameters and folder_purpose(folder) in (None, purpose):
        with suppress(_TakenError):
            return _take(folder, purpose, inputs)
    return _take(Path(results) / f"{name}-{digits}", purpose, inputs)


def withdraw(folder: Path, notebooks: Iterable[str]) -> None:
    """Take back what a run of these notebooks is to replace, so that nothing old is taken for new.

    Raises StorageError where something else stands in its place.
    """
    for name in ("records", "figures"):
        try:
            (folder / name).mkdir(exist_ok=True)
        except OSError as error:
            raise _in_the_way(folder / name, error) from error
    old = [folder / "report.html"]
    for name in notebooks:
        old += [folder / f"{name}.ipynb", folder / "records" / f"{name}.json"]
        old += (folder / "figures").glob(f"{name}-*")
    for file in old:
        try:
            file.unlink(missing_ok=True)
        except OSError as error:
            raise _in_the_way(file, error) from error
    kept = ("area.txt", "encounters.parquet", "zone.json")
    for name in (*kept, *(f"{name}.json" for name in kept)):
        if (folder / name).is_dir():
            raise _in_the_way(folder / name, IsADirectoryError("it is a folder"))


class _TakenError(StorageError):
    """Another data set was first."""


def _take(folder: Path, purpose: str, inputs: Iterable[Path]) -> Path:
    try:
        return claim_folder(folder, purpose, inputs=inputs)
    except StorageError as error:
        if folder_purpose(folder) not in (None, purpose):
            raise _TakenError(str(error)) from error
        raise


def _in_the_way(path: Path, error: OSError) -> StorageError:
    return StorageError(f"{path}: is in the way ({error.strerror or error}); remove it")
