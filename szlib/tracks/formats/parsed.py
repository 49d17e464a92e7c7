"""Formats whose files are read as a whole, by a function each.

UCY's splines (.vsp), TrajNet++, Pathfinder and THOR-MAGNI are read here; Juelich's archive, Viswalk, Vadere
and JuPedSim by PedPy, which comes with the extra `pedpy` and gives frames, ids and metres.
"""

from __future__ import annotations

import codecs
import json
import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import polars as pl

from ...core.checks import check_columns
from ...core.errors import DataError, SzlibError
from ...core.input_files import reading
from ..options import ReadOptions, advise
from .base import Opened, TrackFormat, scan_table
from .tidy import open_database

UCY_RATE = 25.0  # frames a second of the videos of UCY
_USUAL_PIXEL = 0.02  # metres in a pixel that an error message shows as an example
# Samples of THOR-MAGNI closer than this [s] belong to two sessions (0.01 s between them, 0.4 within).
_SESSION = 0.2
_MAGNI_COLUMNS = ("Time", "ag_id", "x", "y", "data_label")
_JUELICH_UNITS = {
    None: None,
    "m": "METER",
    "cm": "CENTIMETER",
}  # units that a header may leave out


@dataclass(frozen=True, kw_only=True)
class _ParsedFormat(TrackFormat):
    """A format whose columns are known, and whose files are read as a whole.

    Attributes
    ----------
    begins : pattern of the beginning of a file.
    parse : gives the rows t, id, x, y of an unpacked file, given as a path and read with options; and the
        number of units of t in a second.
    reader, advice : what `parse` uses, and what to do where it fails, for the message.
    """

    begins: bytes
    parse: Callable[[Path, Path, ReadOptions], tuple[pd.DataFrame, float]]
    reader: str = "szlib"
    advice: str = "fetch it again"
    is_sequence: bool = True
    has_known_columns: bool = True

    def recognises(self, head: bytes) -> bool:
        """Whether `head`, the first line of a file, begins as in this format."""
        return re.match(self.begins, head.removeprefix(codecs.BOM_UTF8)) is not None

    def open(
        self, plain: Path, path: Path, head: bytes, options: ReadOptions
    ) -> Opened:
        """As `TrackFormat.open`."""
        if options.columns:
            raise DataError(
                f"{path}: is {self.name}, whose columns are known; leave columns out"
            )
        try:
            rows, rate = self.parse(plain, path, options)
            if not rate > 0:
                raise ValueError(
                    f"it states {rate:g} frames/s; expected a positive number"
                )
            table = pl.from_pandas(
                rows[["t", "id", "x", "y"]].reset_index(drop=True), nan_to_null=False
            )
        except SzlibError:
            raise
        except Exception as error:  # of any library that a reader uses
            fault = " ".join(
                f"{type(error).__name__}: {error}".replace(
                    str(plain), path.name
                ).split()
            )
            raise DataError(
                f"{path}: {self.reader} cannot read it as {self.name} ({fault}); {self.advice}"
            ) from error
        return replace(self, seconds=1 / rate), scan_table(table)


@dataclass(frozen=True, kw_only=True)
class _PedPyFormat(_ParsedFormat):
    """A format that one of PedPy's loaders reads."""

    reader: str = "PedPy"
    advice: str = (
        "if the file does not state them, pass frame_rate= and unit='m' or 'cm'; if it is another format, "
        "pass file_format="
    )
    is_sequence: bool = False
    is_in_metres: bool = True


@dataclass(frozen=True, kw_only=True)
class _JuPedSim(_PedPyFormat):
    """SQLite files of JuPedSim; others are tables of people's own."""

    def open(
        self, plain: Path, path: Path, head: bytes, options: ReadOptions
    ) -> Opened:
        """As `TrackFormat.open`, or as `tidy.open_database`."""
        own = (
            None
            if options.file_format == self.name
            else open_database(plain, path, options)
        )
        return own or super().open(plain, path, head, options)


def _parse_vsp(
    plain: Path, path: Path, options: ReadOptions
) -> tuple[pd.DataFrame, float]:
    """UCY's splines: each person's control points x, y [pixels from the middle], frame, direction."""
    if options.metres is None:
        raise DataError(
            f"{path}: is vsp, whose positions are in pixels; give the metres in a pixel of this picture, "
            f"from a distance that you know; if it were {_USUAL_PIXEL}: {advise(scale=_USUAL_PIXEL)}"
        )
    lines = iter(plain.read_text(encoding="utf-8").splitlines())
    rows: list[tuple[Any, ...]] = []
    for person in range(1, int(next(lines).split()[0]) + 1):
        for _ in range(int(next(lines).split()[0])):
            x, y, frame, *_ = next(lines).split()
            rows.append((float(frame), person, float(x), float(y)))
    return pd.DataFrame(
        rows, columns=["t", "id", "x", "y"]
    ), options.frame_rate or UCY_RATE


def _parse_trajnet(
    plain: Path, path: Path, options: ReadOptions
) -> tuple[pd.DataFrame, float]:
    """TrajNet++: a JSON object a line; a scene states the samples a second, a track is one of them."""
    lines = [
        json.loads(line)
        for line in plain.read_text(encoding="utf-8").splitlines()
        if line
    ]
    rates = {line["scene"].get("fps", 2.5) for line in lines if "scene" in line} or {
        2.5
    }
    rows = pd.DataFrame([line["track"] for line in lines if "track" in line])
    rows = rows.rename(columns={"f": "t", "p": "id"}).drop_duplicates(["t", "id"])
    step = (
        float(np.diff(np.unique(rows["t"])).min()) if rows["t"].nunique() > 1 else 1.0
    )
    return rows, options.frame_rate or step * float(min(rates))


def _parse_pathfinder(
    plain: Path, path: Path, options: ReadOptions
) -> tuple[pd.DataFrame, float]:
    """JSON of Pathfinder: an object of people, each an object of times.

    PedPy reads it as well, but rounds the number of frames a second: 2.5 becomes 2, and people slow.
    """
    people = json.loads(plain.read_text(encoding="utf-8"))
    rows = [
        (float(t), int(person), float(at["position"]["x"]), float(at["position"]["y"]))
        for person, times in people.items()
        for t, at in times.items()
    ]
    return pd.DataFrame(rows, columns=["t", "id", "x", "y"]), 1.0


def _parse_magni(
    plain: Path, path: Path, options: ReadOptions
) -> tuple[pd.DataFrame, float]:
    """THOR-MAGNI: a helmet is worn by different people one after the other."""
    return read_magni_rows(plain, path), 1.0


def read_magni_rows(plain: Path, path: Path) -> pd.DataFrame:
    """Rows of THOR-MAGNI as t, x, y, session, label, id, from file `plain`, given as `path`.

    id = 100 * session + helmet, both from 1.  Raises DataError where a column is missing, or a helmet has no
    number.
    """
    with reading(path, "as CSV", "a file of THOR-MAGNI"):
        rows = pd.read_csv(plain)
    check_columns(rows, _MAGNI_COLUMNS)
    times = np.unique(rows["Time"])
    session = np.searchsorted(
        times[1:][np.diff(times) < _SESSION], rows["Time"], side="right"
    )
    helmet = rows["ag_id"].astype(str).str.extract(r"(\d+)$")[0]
    if helmet.isna().any():
        name = rows.loc[helmet.isna(), "ag_id"].iloc[0]
        raise DataError(
            f"{path}: ag_id {name!r} ends in no number; expected one like Helmet_4"
        )
    people = pd.DataFrame({"t": rows["Time"], "session": session})
    people[["x", "y", "label"]] = rows[["x", "y", "data_label"]]
    return people.assign(id=100 * (session + 1) + helmet.astype(int))


def _load(
    loader: str, plain: Path, path: Path, options: ReadOptions, **given: Any
) -> tuple[pd.DataFrame, float]:
    """The rows that function `loader` of PedPy gives, and frames a second."""
    try:
        import pedpy
    except ImportError as error:
        raise DataError(
            f"{path}: is read by PedPy: pip install 'szlib[pedpy]' ({error})"
        ) from error
    if loader == "txt":
        if options.unit not in _JUELICH_UNITS or options.scale is not None:
            got = options.unit or options.scale
            raise DataError(
                f"{path}: is juelich-text, which is in 'm' or 'cm'; got unit {got!r}"
            )
        unit = _JUELICH_UNITS[options.unit]
        given = {
            "default_frame_rate": options.frame_rate,
            "default_unit": unit and pedpy.TrajectoryUnit[unit],
        }
    elif options.frame_rate is not None or options.metres is not None:
        known = "states its frame rate and is in metres"
        raise DataError(f"{path}: {known}; leave frame_rate, unit and scale out")
    loaded = getattr(pedpy, f"load_trajectory_from_{loader}")(
        trajectory_file=plain, **given
    )
    return pd.DataFrame(loaded.data).rename(columns={"frame": "t"}), float(
        loaded.frame_rate
    )


_MAGNI_HEADER = "".join(
    rf"(?=(.*,)?\s*\"?{name}\b)" for name in _MAGNI_COLUMNS
).encode()
# Vadere records footsteps; PedPy brings them to as many frames a second as the clock has ticks.  Files of old
# versions begin with their column names.
_VADERE_HEADER = rb"#IDXCOL|(?=.*pedestrianId)(?=.*simTime)"
_load_vadere = partial(_load, "vadere", frame_rate=10.0)
_load_hdf5, _load_text = (
    partial(_load, name) for name in ("ped_data_archive_hdf5", "txt")
)
PARSED_FORMATS = (
    _ParsedFormat("vsp", begins=rb"\s*\d+ - the number of splines", parse=_parse_vsp),
    _ParsedFormat("trajnet", begins=rb'\s*\{"(scene|track)"', parse=_parse_trajnet),
    _ParsedFormat(
        "pathfinder", begins=rb'\s*\{\s*("\d+"\s*:\s*\{|$)', parse=_parse_pathfinder
    ),
    _ParsedFormat("magni", max_gap=0.9, begins=_MAGNI_HEADER, parse=_parse_magni),
    _JuPedSim(
        "jupedsim",
        begins=rb"SQLite format 3\0",
        parse=partial(_load, "jupedsim_sqlite"),
    ),
    _PedPyFormat("juelich-hdf5", begins=rb"\x89HDF", parse=_load_hdf5),
    _PedPyFormat(
        "viswalk", begins=rb"\$(VISION|PEDESTRIAN)", parse=partial(_load, "viswalk")
    ),
    _PedPyFormat("vadere", begins=_VADERE_HEADER, parse=_load_vadere),
    _PedPyFormat("juelich-text", begins=rb"#", parse=_load_text),
)
"""In the order of recognition."""
