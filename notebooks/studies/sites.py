"""Other sites than the ATC mall: Grand Central; and groups of people.

Each reader returns a track table, as does `szlib.read_tracks`, which reads EWAP (ETH, hotel, zara, students) and
THOR-MAGNI itself.  These data are not shipped: they have no licence, or one of their own.

    site            sampled every   max_gap   what else to know
    Grand Central   0.8 s           0.9 s     marked by hand, 7-16 cm off; its scale is uncertain
    THOR-MAGNI      0.4 s           0.9 s     a laboratory of 18 m by 7 m, where people were given goals
    EWAP            0.4 s           0.9 s     ETH at 15 frames/s, the others at 25
    ATC 1 Hz        1.0 s           1.6 s

Positions are not interpolated across a longer gap.  Interpolation within it cuts the corners of a path: the
error of 1 Hz data at 10 Hz is 3 to 6 cm RMS (95 % within 4 to 12 cm).
"""

from __future__ import annotations

import json
import re
import zipfile
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.cluster.hierarchy import DisjointSet

from szlib.core.errors import DataError, warn
from szlib.core.input_files import read_small, reading
from szlib.tracks import funnels
from szlib.tracks.clock import to_clock
from szlib.tracks.shapes import read_magni_rows

# frames a second of the video of Grand Central; every 20th is annotated
GRAND_CENTRAL_RATE = 25.0
GRAND_CENTRAL_SCALE = 0.8  # metres in one unit of its homography (OpenTraj)


def read_grand_central(
    path: str | Path, *, homography: str | Path | None = None, max_gap: float = 0.9
) -> pd.DataFrame:
    """Read Grand Central Station, New York (Zhou et al., CVPR 2011; annotated by Yi et al., CVPR 2015).

    Parameters
    ----------
    path : ``Annotation.zip``, or the folder of its files, one a person: column [px], row [px], frame, ...
    homography : ``H.json``, which maps (row, column, 1) to the floor; None looks beside `path`, then in it.
    max_gap : a longer silence ends a track [s]; people are annotated every 0.8 s.

    Returns
    -------
    A track table of the one recording "grand-central"; id is the number in the file's name, t counts from the
    beginning of the video, x points to the left and y towards the viewer of the image [m].

    Raises
    ------
    DataError : archive or homography is missing or damaged, or a file does not hold triples of numbers.

    Examples
    --------
    >>> from studies.sites import read_grand_central
    >>> tracks = read_grand_central("gc/Annotation.zip")  # doctest: +SKIP
    """
    path = Path(path)
    matrix = _homography(path, homography)
    ids, parts = [], []
    for name, text in _annotations(path).items():
        fields = text.split()
        try:
            rows = np.array(fields, float).reshape(-1, 3)
            person = int(name.split(".")[0])
        except ValueError as error:
            raise DataError(
                f"{path}, {name}: expected column, row, frame, ... in a file named by a number ({error})"
            ) from error
        ids.append(np.full(len(rows), person))
        parts.append(rows)
    column, row, frame = np.concatenate(parts).T
    floor = np.column_stack([row, column, np.ones(len(row))]) @ matrix.T
    raw = pd.DataFrame(
        {
            "day": "grand-central",
            "id": np.concatenate(ids),
            "t": frame / GRAND_CENTRAL_RATE,
        }
    )
    raw[["x", "y"]] = GRAND_CENTRAL_SCALE * floor[:, :2] / floor[:, 2:]
    return _finish(raw, path.name, max_gap)


def read_groups(path: str | Path) -> pd.DataFrame:
    """Read which people walk together, from an EWAP file ``groups.txt``.

    Parameters
    ----------
    path : a file of the ids of one group a line, separated by blanks.

    Returns
    -------
    Columns group (numbered from 0) and id, in the order of the file.  People in no line walk alone.
    Lines that share a person make one group, with a DataWarning: the ETH sequence has such lines.

    Raises
    ------
    DataError : a line holds something else than ids, or a single id.

    Examples
    --------
    >>> from pathlib import Path
    >>> from studies.sites import read_groups
    >>> _ = Path("groups.txt").write_text("1 2\\n5 3 4\\n")
    >>> read_groups("groups.txt").groupby("group")["id"].apply(list).tolist()
    [[1, 2], [5, 3, 4]]
    """
    path = Path(path)
    with reading(path, "as groups", "ids, a group a line"):
        lines = read_small(path).decode("utf-8").splitlines()
    groups: DisjointSet = DisjointSet()
    joined = []
    for number, line in enumerate(lines, start=1):
        fields = line.split()
        if not fields:
            continue
        if not all(field.isdecimal() for field in fields) or len(set(fields)) < 2:
            raise DataError(f"{path}, line {number}: {line[:80]!r} is no group; expected two or more ids")
        people = list(map(int, fields))
        if any(person in groups for person in people):
            joined.append(number)
        for person in people:
            groups.add(person)
            groups.merge(people[0], person)
    if joined:
        where = ", ".join(map(str, joined))
        warn(f"{path.name}: joined to earlier groups that share people: line {where}")
    ids = list(groups)
    table = pd.DataFrame(
        {
            "group": pd.factorize(np.array([groups[person] for person in ids]))[0],
            "id": ids,
        }
    )
    return table.astype("int64").sort_values("group", kind="stable", ignore_index=True)


def read_magni_groups(path: str | Path) -> pd.DataFrame:
    """Read which people of THOR-MAGNI belong together.

    Parameters
    ----------
    path : CSV of THOR-MAGNI: Time [s], ag_id, x, y [m], data_label.

    Returns
    -------
    Columns group (from 0) and id, as from `read_groups`.  The label gives the size of a group
    ("Visitors-Group 3").  Where two groups of one size are in a session, people belong to those nearest to
    them (median distance; in the published file 0.7 to 1.3 m, and at least 5.9 m to the other group).  People
    in no row are alone.

    Raises
    ------
    DataError : the file cannot be read, or people do not make whole groups.

    Examples
    --------
    >>> import pandas as pd
    >>> from studies.sites import read_magni_groups
    >>> rows = pd.DataFrame({"Time": 0.4, "ag_id": ["Helmet_1", "Helmet_2"], "x": [0.0, 1.0], "y": 0.0})
    >>> rows.assign(data_label="Visitors-Group 2").to_csv("A.csv", index=False)
    >>> read_magni_groups("A.csv")["id"].tolist()
    [101, 102]
    """
    rows, n_groups = read_magni_rows(Path(path), Path(path)), 0
    members: list[tuple[int, int]] = []
    for (session, label), people in rows.groupby(["session", "label"]):
        match = re.search(r"Group (\d+)", str(label))
        if not match:
            continue
        size, left = int(match[1]), sorted(people["id"].unique())
        if len(left) % size:
            raise DataError(f"{path}: {len(left)} people are labelled {label!r} in session {session}")
        at = people.pivot_table(index="t", columns="id", values=["x", "y"])
        while left:
            one = left.pop(0)
            distance = {
                each: np.hypot(at["x"][one] - at["x"][each], at["y"][one] - at["y"][each]).median()
                for each in left
            }
            nearest = sorted(left, key=distance.__getitem__)[: size - 1]
            members += [(n_groups, int(each)) for each in (one, *nearest)]
            left = [each for each in left if each not in nearest]
            n_groups += 1
    return pd.DataFrame(members, columns=["group", "id"]).astype("int64")


def _homography(path: Path, homography: str | Path | None) -> np.ndarray:
    """The matrix of Grand Central, shape (3, 3)."""
    places = [Path(homography)] if homography else [path.parent / "H.json", path / "H.json"]
    file = next((place for place in places if place.is_file()), None)
    if file is None:
        looked = " or ".join(map(str, places))
        raise DataError(f"{looked}: no such file; expected the homography of Grand Central, pass homography=")
    with reading(file, "as a homography", "homog, 3 x 3"):
        matrix = np.array(json.loads(read_small(file))["homog"], float)
    if matrix.shape != (3, 3) or not np.isfinite(matrix).all():
        raise DataError(f"{file}: homog has shape {matrix.shape}; expected 3 x 3 finite numbers")
    return matrix


def _annotations(path: Path) -> dict[str, bytes]:
    """Content of each file of Grand Central, by name."""
    with reading(path, "as annotations", "Annotation.zip or its folder"):
        if path.is_dir():
            found = {file.name: file.read_bytes() for file in sorted(path.glob("*.txt"))}
        else:
            with zipfile.ZipFile(path) as packed:
                names = sorted(name for name in packed.namelist() if name.endswith(".txt"))
                found = {name.rsplit("/", 1)[-1]: packed.read(name) for name in names}
    if not found:
        raise DataError(f"{path}: holds no file *.txt; expected Annotation.zip or the folder of its files")
    return found


def _finish(raw: pd.DataFrame, name: str, max_gap: float) -> pd.DataFrame:
    """The track table of the rows that can be used."""
    finite = np.isfinite(raw[["t", "x", "y"]].to_numpy(float)).all(axis=1)
    doubled = raw.duplicated(["day", "id", "t"]).to_numpy() & finite
    usable = raw[finite & ~doubled].reset_index(drop=True)
    if len(usable) == 0:
        raise DataError(f"{name}: holds no row that can be used")
    reasons = {
        "not finite": int((~finite).sum()),
        "second position at a time": int(doubled.sum()),
    }
    stage = funnels.stage(f"read {name}", len(raw), len(usable), reasons)
    return to_clock(funnels.attach(usable, [stage]), max_gap=max_gap)
