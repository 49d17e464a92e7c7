"""Where the results of a data set go: one folder each, whatever the data is called by.

A folder is marked with the data that it is for; another data set of the same name gets a folder of its own,
its name with eight digits behind it.  A link, a folder or a glob has the name it was asked for by.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable, Sequence
from contextlib import suppress
from pathlib import Path

from ..errors import DataError, StorageError
from ..files import own_folder, owner_of, printable
from ..tracks import datasets

ROOT = "results of the workbook"
"""What the folder of all results is marked as."""


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
    results: str | Path, data: str | Path | Sequence[str | Path], *, inputs: Iterable[Path] = ()
) -> Path:
    """The folder for this data among the results; made and marked where it is missing.

    Raises StorageError where it cannot be made, holds what szlib did not write, or any of `inputs`.
    """
    source = absolute(data)
    name = datasets.label(data)
    purpose = f"results of {source if isinstance(source, str) else ', '.join(source)}"
    digits = hashlib.sha256(purpose.encode()).hexdigest()[:8]
    own_folder(results, ROOT)
    folder = Path(results) / name
    if owner_of(folder) in (None, purpose):
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
    old = [folder / "summary.json"]
    for name in notebooks:
        old += [folder / f"{name}.ipynb", folder / "records" / f"{name}.json"]
        old += (folder / "figures").glob(f"{name}-*")
    for file in old:
        try:
            file.unlink(missing_ok=True)
        except OSError as error:
            raise _in_the_way(file, error) from error
    for name in ("encounters.parquet", "encounters.parquet.json", "zone.json"):
        if (folder / name).is_dir():
            raise _in_the_way(folder / name, IsADirectoryError("it is a folder"))


class _TakenError(StorageError):
    """Another data set was first."""


def _take(folder: Path, purpose: str, inputs: Iterable[Path]) -> Path:
    try:
        return own_folder(folder, purpose, inputs=inputs)
    except StorageError as error:
        if owner_of(folder) not in (None, purpose):
            raise _TakenError(str(error)) from error
        raise


def _in_the_way(path: Path, error: OSError) -> StorageError:
    return StorageError(f"{path}: is in the way ({error.strerror or error}); remove it")
