"""Named data and paths: a real day of the ATC mall, ten days of its middle, or the user's own files.

The real day is the public 1 Hz version of 2012-10-24, pinned to a commit and to the SHA-256 of each
file (`datasets.toml`); of hour 12 it holds one file of two (10 % of the people).  The ten days (2012-10-24 to
2012-11-25) are those of LaCE-LHMP, ``MMDD.csv``, pinned to the git blob id of each file.  They cover x from
-25 to 0 m and y from -10 to 15 m, which holds the square; their times may count from the start of the day.
The ATC data are free for research; cite Brscic, Kanda, Ikeda, Miyashita, "Person tracking in large public
spaces using 3-D range sensors", IEEE Trans. Human-Machine Systems 43(6), 2013.
"""

from __future__ import annotations

import os
import re
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from ..core.errors import DataError
from ..core.input_files import explain_errors, printable
from .recipe import FILE_NAME

SYNTHETIC = "synthetic"
# A folder that holds `atc-1hz/` or `atc-10-days/`, to be used instead of the network.
DATA_DIR_VARIABLE = "SZLIB_DATA_DIR"

_LONGEST_LABEL = 60


@dataclass(frozen=True)
class DataSet:
    """Files on the network, an entry of `datasets.toml`.

    Attributes
    ----------
    url : folder of the files, pinned to a commit.
    hashes : SHA-256 of the content of each file, by its name; empty where it is not known.
    """

    url: str
    hashes: dict[str, str]


_ENTRIES = tomllib.loads(Path(__file__).with_suffix(".toml").read_text("utf-8"))
# Data sets by name.
DATA_SETS = {name: DataSet(**entry) for name, entry in _ENTRIES.items()}
NAMES = (SYNTHETIC, *DATA_SETS)
_NAMED = ", ".join(map(repr, DATA_SETS))


def find(data: str | Path | Sequence[str | Path]) -> list[Path]:
    """Find the files of a data set.

    Parameters
    ----------
    data : "atc-1hz" or "atc-10-days" (from $SZLIB_DATA_DIR, or downloaded once into the user's cache), or
        paths: files, folders of track files, or globs.

    Returns
    -------
    The files, those of a folder or a glob in the order of their names.

    Raises
    ------
    DataError : there is no such file, a download fails, or a hash does not match.

    Examples
    --------
    >>> from pathlib import Path
    >>> from szlib.tracks import datasets
    >>> for name in ("b.csv", "a.csv"):
    ...     _ = Path(name).write_text("t,id,x,y")
    >>> [file.name for file in datasets.find("*.csv")]
    ['a.csv', 'b.csv']
    """
    files = [
        file
        for name in ([data] if isinstance(data, str | Path) else list(data))
        for file in (_find_named if name in DATA_SETS else _expand)(name)
    ]
    if not files:
        raise DataError(
            f"no data was named; expected {_NAMED}, or paths of track files"
        )
    return files


def label(data: str | Path | Sequence[str | Path]) -> str:
    """A short name for `data`, fit for a folder: one of `NAMES`, or the name of the first file.

    Examples
    --------
    >>> from szlib.tracks import datasets
    >>> datasets.label(["data/hall.csv", "data/corridor.csv"])
    'hall-and-1-more'
    """
    if isinstance(data, str | Path):
        if data in NAMES:
            return str(data)
        name = Path(os.path.abspath(data)).name.split(".")[0]  # noqa: PTH100 - links keep their names
        name = re.sub(r"[^\w+-]+", "-", name).strip("-")
        return name[:_LONGEST_LABEL] or "files"
    return label(data[0]) + (f"-and-{len(data) - 1}-more" if len(data) > 1 else "")


def _find_named(name: str | Path) -> list[Path]:
    """The files of a named data set, each with the right hash."""
    import pooch  # a robot, and files of one's own, need none

    data = DATA_SETS[str(name)]
    folder = os.environ.get(DATA_DIR_VARIABLE)
    store = pooch.create(
        path=Path(folder or pooch.os_cache("szlib")) / name,
        base_url=data.url,
        registry={file: digest or None for file, digest in data.hashes.items()},
        retry_if_failed=2,
        allow_updates=not folder,
    )
    failed = f"{name} could not be downloaded from {data.url}"
    advice = f"go online, or put its files into a folder {name}/ and name its parent in ${DATA_DIR_VARIABLE}"
    with explain_errors(failed, advice):
        return [Path(store.fetch(file, progressbar=True)) for file in data.hashes]


def _expand(name: str | Path) -> list[Path]:
    """The regular files that a path stands for; reading a FIFO or a device would never end."""
    path = Path(name)
    shown = printable(name)
    expected = f"expected {_NAMED}, or a file, folder or glob of tracks ('synthetic' is for szlib run alone)"
    with explain_errors(f"{shown}: cannot be looked up", expected):
        root = Path(path.anchor)
        found = [path] if path.exists() else [*root.glob(str(path.relative_to(root)))]
        if path.is_dir():
            found = [file for file in path.glob("[!.]*") if file.name != FILE_NAME]
    files = sorted(filter(Path.is_file, found))
    if not files:
        fault = "is no regular file" if found else "no such file"
        raise DataError(
            f"{shown}: {'holds no file' if path.is_dir() else fault}; {expected}"
        )
    return files
