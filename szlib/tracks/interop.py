"""Other people's data: what a data set must give, who walks together, and the way to PedPy and back.

The loader contract.  A loader for a new data set is a function that returns a **track table**; everything
after it (`find_encounters`, `SocialZone.fit`, every plot) takes the table and asks no more.  It needs

    day  str or category   recording: a calendar day "YYYY-MM-DD" in local time, or any other name
    id   integer           person, unique within the day
    t    float [s]         on the clock: multiples of 0.1 s, seconds since 1970 or since any moment
    x y  float [m]         position in the world, finite, right-handed (y is to the left of x)
    vx vy  float [m/s]     displacement over +-0.5 s within a gap-free piece; NaN in a piece of one tick

sorted by day, id, t, without duplicates, with its funnel in ``.attrs["funnel"]``, each stage of which adds
up and takes what the one before has kept.  Nobody is carried across a gap: where a person was lost, ticks are
missing.

The short way there: collect day, id, t [s], x, y [m] in any order and at any rate, count what you set aside
with `funnels.stage`, and let `clock.to_clock` do the rest.  `check_tracks` holds any loader to the contract;
put it into your test.
"""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from ..errors import DataError, DataWarning
from . import funnels
from .clock import COLUMNS, TICKS_PER_SECOND, clock_index, nearest_tick, to_clock

if TYPE_CHECKING:
    from pedpy import TrajectoryData

_EXACT = 1e-6
"""Velocities agree with positions up to this [m/s]."""


def check_tracks(tracks: pd.DataFrame) -> None:
    """Hold a track table to the contract; raises DataError that says where it does not keep it."""
    order, tick, piece = clock_index(tracks)
    if (order != np.arange(len(order))).any():
        at = int(np.flatnonzero(order != np.arange(len(order)))[0])
        raise DataError(f"row {tracks.index[at]} is out of order; expected rows sorted by day, id, t")
    if list(tracks.columns[: len(COLUMNS)]) != COLUMNS:
        raise DataError(f"columns are {list(tracks.columns)}; expected {COLUMNS} first, in this order")
    if not pd.api.types.is_integer_dtype(tracks["id"]):
        raise DataError(f"id is {tracks['id'].dtype}; expected whole numbers")
    _check_velocities(tracks, tick, piece)
    stages = funnels.get(tracks)
    if not stages:
        raise DataError('the table has no funnel; expected its stages in .attrs["funnel"]')
    for stage in stages:
        funnels.stage(stage["stage"], stage["entered"], stage["kept"], stage["rejected"])


def _check_velocities(tracks: pd.DataFrame, tick: np.ndarray, piece: np.ndarray) -> None:
    """Raise DataError where velocity is not displacement over +-0.5 s within its piece."""
    raw = tracks[["day", "id", "t", "x", "y"]].copy()
    raw.attrs.clear()
    expected = to_clock(raw, max_gap=1.5 / TICKS_PER_SECOND)[["vx", "vy"]].to_numpy()
    wrong = ~np.isclose(tracks[["vx", "vy"]].to_numpy(float), expected, rtol=0, atol=_EXACT, equal_nan=True)
    if wrong.any():
        at = int(np.flatnonzero(wrong.any(axis=1))[0])
        found = tracks[["day", "id", "t", "vx", "vy"]].iloc[at].to_dict()
        raise DataError(
            f"row {tracks.index[at]}: {found}, expected vx, vy = {expected[at].tolist()} from positions over "
            "+-0.5 s; let szlib.tracks.clock.to_clock compute them, and never bridge a gap"
        )


def read_groups(path: str | Path) -> pd.DataFrame:
    """Who walks together, from an EWAP ``groups.txt``: the ids of one group a line, parted by blanks.

    Returns a table with columns group (numbered from 0) and id, in the order of the file.  Whoever is in
    no line walks alone.  Lines that share a person make one group, with a DataWarning: the ETH sequence
    has such lines.  Raises DataError, with the line, for what is no id and for a group of one.
    """
    path = Path(path)
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise DataError(
            f"{path}: cannot be read as groups ({error}); expected ids, a group a line"
        ) from error
    groups: list[dict[int, None]] = []
    joined = []
    for number, line in enumerate(lines, start=1):
        fields = line.split()
        if not fields:
            continue
        if not all(field.isdecimal() for field in fields) or len(set(fields)) < 2:
            raise DataError(f"{path}, line {number}: {line[:80]!r} is no group; expected two ids or more")
        group = dict.fromkeys(map(int, fields))
        shared = [known for known in groups if not known.keys().isdisjoint(group)]
        if shared:
            joined.append(number)
            for other in shared[1:]:
                shared[0] |= other
                groups.remove(other)
            shared[0] |= group
        else:
            groups.append(group)
    if joined:
        where = ", ".join(map(str, joined))
        warnings.warn(
            f"{path.name}: joined to earlier groups that share people: line {where}",
            DataWarning,
            stacklevel=2,
        )
    rows = [(number, person) for number, group in enumerate(groups) for person in group]
    return pd.DataFrame(rows, columns=["group", "id"]).astype("int64")


def to_pedpy(tracks: pd.DataFrame) -> TrajectoryData:
    """A track table of one day as PedPy's TrajectoryData, at 10 frames/s; frame is t in ticks of 0.1 s.

    Needs the extra `pedpy`.  Raises DataError for tables of several days, for PedPy has ids only.
    """
    from pedpy import TrajectoryData

    clock_index(tracks)
    days = tracks["day"].unique()
    if len(days) > 1:
        raise DataError(
            f"PedPy has no days, and the table has {len(days)}: {list(days)[:5]}; pass one of them"
        )
    frame = nearest_tick(tracks["t"].to_numpy(float))
    data = pd.DataFrame({"id": tracks["id"].to_numpy(), "frame": frame})
    data[["x", "y"]] = tracks[["x", "y"]].to_numpy()
    return TrajectoryData(data=data, frame_rate=float(TICKS_PER_SECOND))
