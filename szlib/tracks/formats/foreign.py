"""Formats of other programs, read by PedPy's own loaders: Juelich's archive, Viswalk, Vadere, JuPedSim.

PedPy comes with the extra `pedpy`; it gives frames, ids and metres.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from ...errors import DataError

VADERE_RATE = 10.0
"""Vadere records footsteps; PedPy brings them to frames, as many a second as the clock has ticks."""
LOADERS: Mapping[str, str] = {
    "juelich-text": "load_trajectory_from_txt",
    "juelich-hdf5": "load_trajectory_from_ped_data_archive_hdf5",
    "viswalk": "load_trajectory_from_viswalk",
    "vadere": "load_trajectory_from_vadere",
    "jupedsim": "load_trajectory_from_jupedsim_sqlite",
}
"""PedPy's loader of each format."""


def foreign_format(head: bytes) -> str | None:
    """The format of another program that a file's first line looks like, or None."""
    if head.startswith(b"SQLite format 3\0"):
        return "jupedsim"
    if head.startswith(b"\x89HDF"):
        return "juelich-hdf5"
    text = head.decode("utf-8", errors="replace").lstrip("\ufeff")
    if text.startswith(("$VISION", "$PEDESTRIAN")):
        return "viswalk"
    if text.startswith("#IDXCOL") or ("pedestrianId" in text and "simTime" in text):
        return "vadere"
    return "juelich-text" if text.startswith("#") else None


def load(
    name: str, plain: Path, path: Path, *, frame_rate: float | None, unit: str | None
) -> tuple[pd.DataFrame, float]:
    """A table id, frame, x, y [m] in the order of the file, and its frames a second.

    `frame_rate` and `unit` are for texts of Juelich's archive whose header does not tell them.  Raises
    DataError where PedPy is missing or cannot read the file.
    """
    try:
        import pedpy
        from pedpy.io.helper import TrajectoryUnit
    except ImportError as error:
        raise DataError(
            f"{path}: is {name}, which PedPy reads: pip install 'szlib[pedpy]' ({error})"
        ) from error
    options: dict[str, Any] = {}
    if name == "juelich-text":
        units = {None: None, "m": TrajectoryUnit.METER, "cm": TrajectoryUnit.CENTIMETER}
        if unit not in units:
            raise DataError(f"{path}: is {name}, which is in 'm' or 'cm'; got unit {unit!r}")
        options = {"default_frame_rate": frame_rate, "default_unit": units[unit]}
    elif frame_rate is not None or unit is not None:
        raise DataError(
            f"{path}: is {name}, which tells its frames, in metres; leave frame_rate and unit out"
        )
    elif name == "vadere":
        options = {"frame_rate": VADERE_RATE}
    try:
        found = getattr(pedpy, LOADERS[name])(trajectory_file=plain, **options)
        data, rate = pd.DataFrame(found.data)[["id", "frame", "x", "y"]], float(found.frame_rate)
    except Exception as error:  # of whatever library PedPy has read it with
        what = " ".join(str(error).replace(str(plain), path.name).split())
        raise DataError(
            f"{path}: PedPy cannot read it as {name} ({type(error).__name__}: {what}); if the file does not "
            "tell them, pass frame_rate= and unit='m' or 'cm'; if it is another format, pass file_format="
        ) from error
    if not rate > 0:
        raise DataError(f"{path}: tells {rate:g} frames/s; expected a positive number")
    return data, rate
