"""Formats without a calendar: UCY's splines (.vsp), TrajNet++ (.ndjson), Pathfinder (.json), THOR-MAGNI."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Self

import numpy as np
import pandas as pd
import polars as pl

from ...checks import check_columns
from ...errors import DataError
from ...input_files import reading
from ..options import ReadOptions, advise
from .base import TrackFormat, decode_line, scan_table

UCY_RATE = 25.0  # frames a second of the videos of UCY
_USUAL_PIXEL = 0.02  # metres in a pixel that an error message shows as an example
# Samples of THOR-MAGNI closer than this [s] belong to two sessions (0.01 s between them, 0.4 within).
_SESSION = 0.2
_MAGNI_COLUMNS = ("Time", "ag_id", "x", "y", "data_label")


@dataclass(frozen=True)
class _Published(TrackFormat):
    """A recording without a calendar; `parse` reads a whole file."""

    is_sequence = True
    has_known_columns = True
    begins: str = ""

    def recognises(self, head: bytes) -> bool:
        """Whether `head`, the first line of a file, begins as in this format."""
        return re.match(self.begins, decode_line(head)) is not None

    def open(self, plain: Path, path: Path, head: bytes, options: ReadOptions) -> tuple[Self, pl.LazyFrame]:
        """As `TrackFormat.open`."""
        if options.columns:
            raise DataError(f"{path}: is {self.name}, whose columns are known; leave columns out")
        try:
            rows, rate = self.parse(plain, path, options)
        except (ValueError, KeyError, TypeError, AttributeError, StopIteration, RecursionError) as error:
            if isinstance(error, DataError):
                raise
            fault = f"{type(error).__name__}: {error}"
            raise DataError(f"{path}: cannot be read as {self.name} ({fault}); fetch it again") from error
        table = pl.from_pandas(rows[["t", "id", "x", "y"]].reset_index(drop=True), nan_to_null=False)
        return replace(self, seconds=1 / rate), scan_table(table)

    def parse(self, plain: Path, path: Path, options: ReadOptions) -> tuple[pd.DataFrame, float]:
        """The rows t, id, x, y of file `plain`, given as `path` and read with `options`, and t per second."""
        raise NotImplementedError


class _Vsp(_Published):
    """UCY's splines: each person's control points x, y [pixels from the middle], frame, direction."""

    def parse(self, plain: Path, path: Path, options: ReadOptions) -> tuple[pd.DataFrame, float]:
        """As `_Published.parse`; raises DataError without a scale."""
        if options.metres is None:
            raise DataError(
                f"{path}: is vsp, whose positions are in pixels; give the metres in a pixel of this "
                f"picture, from a distance that you know; if it were {_USUAL_PIXEL}: "
                f"{advise(scale=_USUAL_PIXEL)}"
            )
        lines = iter(plain.read_text(encoding="utf-8").splitlines())
        rows: list[tuple[Any, ...]] = []
        for person in range(1, int(next(lines).split()[0]) + 1):
            for _ in range(int(next(lines).split()[0])):
                x, y, frame, *_ = next(lines).split()
                rows.append((float(frame), person, float(x), float(y)))
        return pd.DataFrame(rows, columns=["t", "id", "x", "y"]), options.frame_rate or UCY_RATE


class _TrajNet(_Published):
    """TrajNet++: a JSON object a line; a scene states the samples a second, a track is one of them."""

    def parse(self, plain: Path, path: Path, options: ReadOptions) -> tuple[pd.DataFrame, float]:
        """As `_Published.parse`."""
        lines = [json.loads(line) for line in plain.read_text(encoding="utf-8").splitlines() if line]
        rates = {line["scene"].get("fps", 2.5) for line in lines if "scene" in line} or {2.5}
        rows = pd.DataFrame([line["track"] for line in lines if "track" in line])
        rows = rows.rename(columns={"f": "t", "p": "id"}).drop_duplicates(["t", "id"])
        step = float(np.diff(np.unique(rows["t"])).min()) if rows["t"].nunique() > 1 else 1.0
        return rows, options.frame_rate or step * float(min(rates))


class _Pathfinder(_Published):
    """JSON of Pathfinder: an object of people, each an object of times.

    PedPy reads it as well, but rounds the number of frames a second: 2.5 becomes 2, and people slow.
    """

    def parse(self, plain: Path, path: Path, options: ReadOptions) -> tuple[pd.DataFrame, float]:
        """As `_Published.parse`."""
        people = json.loads(plain.read_text(encoding="utf-8"))
        rows = [
            (float(t), int(person), float(at["position"]["x"]), float(at["position"]["y"]))
            for person, times in people.items()
            for t, at in times.items()
        ]
        return pd.DataFrame(rows, columns=["t", "id", "x", "y"]), 1.0


class _Magni(_Published):
    """THOR-MAGNI: a helmet is worn by different people one after the other."""

    def recognises(self, head: bytes) -> bool:
        """Whether `head`, the first line of a file, names its columns."""
        return set(_MAGNI_COLUMNS) <= set(self.split(decode_line(head)))

    def parse(self, plain: Path, path: Path, options: ReadOptions) -> tuple[pd.DataFrame, float]:
        """As `_Published.parse`."""
        return read_magni_rows(plain, path), 1.0


RECORDING_FORMATS: tuple[_Published, ...] = (
    _Vsp("vsp", begins=r"\d+ - the number of splines"),
    _TrajNet("trajnet", begins=r'\{"(scene|track)"'),
    _Pathfinder("pathfinder", begins=r'\{\s*("\d+"\s*:\s*\{|$)'),
    _Magni("magni", max_gap=0.9),
)
"""In the order of recognition."""


def read_magni_rows(plain: Path, path: Path) -> pd.DataFrame:
    """Rows of THOR-MAGNI as t, x, y, session, label, id, from file `plain`, given as `path`.

    id = 100 * session + helmet, both from 1.  Raises DataError where a column is missing, or a helmet has no
    number.
    """
    with reading(path, "as CSV", "a file of THOR-MAGNI"):
        rows = pd.read_csv(plain)
    check_columns(rows, _MAGNI_COLUMNS)
    times = np.unique(rows["Time"])
    session = np.searchsorted(times[1:][np.diff(times) < _SESSION], rows["Time"], side="right")
    helmet = rows["ag_id"].astype(str).str.extract(r"(\d+)$")[0]
    if helmet.isna().any():
        name = rows.loc[helmet.isna(), "ag_id"].iloc[0]
        raise DataError(f"{path}: ag_id {name!r} ends in no number; expected one like Helmet_4")
    people = pd.DataFrame({"t": rows["Time"], "session": session})
    people[["x", "y", "label"]] = rows[["x", "y", "data_label"]]
    return people.assign(id=100 * (session + 1) + helmet.astype(int))
