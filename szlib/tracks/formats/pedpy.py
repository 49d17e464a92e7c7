"""Formats of other programs, read by PedPy: Juelich's archive, Viswalk, Vadere, JuPedSim.

PedPy comes with the extra `pedpy`; it gives frames, ids and metres.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar, Self

import pandas as pd
import polars as pl

from ...errors import DataError
from ..options import ReadOptions
from .base import TrackFormat, decode_line, scan_table
from .tidy import open_database

# Vadere records footsteps; PedPy brings them to as many frames a second as the clock has ticks.
_VADERE_RATE = 10.0


@dataclass(frozen=True)
class _PedPyFormat(TrackFormat):
    """A format that one of PedPy's loaders reads.

    Attributes
    ----------
    loader : name of the function in `pedpy`.
    begins : beginnings of the first line of a file.
    """

    has_known_columns = True
    loader: str = ""
    begins: tuple[bytes, ...] = ()

    def recognises(self, head: bytes) -> bool:
        """Whether `head`, the first line of a file, begins as in this format."""
        return head.removeprefix(b"\xef\xbb\xbf").startswith(self.begins)

    def in_metres(self, metres: float | None) -> Self:
        """The format itself for any `metres`: PedPy gives metres."""
        return self

    def loader_options(self, path: Path, options: ReadOptions) -> dict[str, Any]:
        """Arguments of the loader; raises DataError where `options` do not fit file `path`."""
        if options.frame_rate is not None or options.unit is not None:
            raise DataError(
                f"{path}: is {self.name}, which states its frame rate and is in metres; leave frame_rate and "
                "unit out"
            )
        return {}

    def open(
        self, plain: Path, path: Path, head: bytes, options: ReadOptions
    ) -> tuple[TrackFormat, pl.LazyFrame]:
        """As `TrackFormat.open`; raises DataError also where PedPy is missing or cannot read the file."""
        if options.columns:
            raise DataError(f"{path}: is {self.name}, whose columns are known; leave columns out")
        try:
            import pedpy
        except ImportError as error:
            raise DataError(
                f"{path}: is {self.name}, which PedPy reads: pip install 'szlib[pedpy]' ({error})"
            ) from error
        given = self.loader_options(path, options)
        try:
            loaded = getattr(pedpy, self.loader)(trajectory_file=plain, **given)
            data, rate = pd.DataFrame(loaded.data)[["frame", "id", "x", "y"]], float(loaded.frame_rate)
        except Exception as error:  # of any library that PedPy uses
            what = " ".join(str(error).replace(str(plain), path.name).split())
            raise DataError(
                f"{path}: PedPy cannot read it as {self.name} ({type(error).__name__}: {what}); if the file "
                "does not state them, pass frame_rate= and unit='m' or 'cm'; if it is another format, pass "
                "file_format="
            ) from error
        if not rate > 0:
            raise DataError(f"{path}: states {rate:g} frames/s; expected a positive number")
        rows = pl.from_pandas(data.rename(columns={"frame": "t"}), nan_to_null=False)
        return replace(self, seconds=1 / rate), scan_table(rows)


@dataclass(frozen=True)
class _JuPedSim(_PedPyFormat):
    """SQLite files of JuPedSim; others are tables of people's own."""

    def open(
        self, plain: Path, path: Path, head: bytes, options: ReadOptions
    ) -> tuple[TrackFormat, pl.LazyFrame]:
        """As `TrackFormat.open`, or as `tidy.open_database`."""
        own = None if options.file_format == self.name else open_database(plain, path, options)
        return own or super().open(plain, path, head, options)


@dataclass(frozen=True)
class _JuelichText(_PedPyFormat):
    """Text of Juelich's archive; its header may not state the frame rate and the unit."""

    units: ClassVar[dict[str | None, str]] = {"m": "METER", "cm": "CENTIMETER"}

    def loader_options(self, path: Path, options: ReadOptions) -> dict[str, Any]:
        """Frame rate and unit in `options`, for file `path` if its header does not state them."""
        from pedpy.io.helper import TrajectoryUnit

        if options.unit not in (None, *self.units):
            raise DataError(f"{path}: is {self.name}, which is in 'm' or 'cm'; got unit {options.unit!r}")
        unit = options.unit and TrajectoryUnit[self.units[options.unit]]
        return {"default_frame_rate": options.frame_rate, "default_unit": unit}


@dataclass(frozen=True)
class _Vadere(_PedPyFormat):
    """Footsteps of Vadere; files of old versions begin with their column names."""

    def recognises(self, head: bytes) -> bool:
        """Whether `head`, the first line of a file, names Vadere's columns."""
        text = decode_line(head)
        return super().recognises(head) or ("pedestrianId" in text and "simTime" in text)

    def loader_options(self, path: Path, options: ReadOptions) -> dict[str, Any]:
        """The frame rate of the footsteps; raises DataError where `options` for file `path` give another."""
        return super().loader_options(path, options) | {"frame_rate": _VADERE_RATE}


PEDPY_FORMATS: tuple[_PedPyFormat, ...] = (
    _JuPedSim("jupedsim", loader="load_trajectory_from_jupedsim_sqlite", begins=(b"SQLite format 3\0",)),
    _PedPyFormat("juelich-hdf5", loader="load_trajectory_from_ped_data_archive_hdf5", begins=(b"\x89HDF",)),
    _PedPyFormat("viswalk", loader="load_trajectory_from_viswalk", begins=(b"$VISION", b"$PEDESTRIAN")),
    _Vadere("vadere", loader="load_trajectory_from_vadere", begins=(b"#IDXCOL",)),
    _JuelichText("juelich-text", loader="load_trajectory_from_txt", begins=(b"#",)),
)
"""In the order of recognition."""
