"""The kind of each pair of people, as `kinds_of_pairs` decides it, for tables of pairs."""

from __future__ import annotations

import numpy as np
import pandas as pd

from szlib.encounters.areas import as_area
from szlib.encounters.kinds import REACH, kinds_of_pairs
from szlib.encounters.occupants import TrackRows


def encounter_kinds(
    tracks: pd.DataFrame, pairs: pd.DataFrame, *, area: object = None
) -> pd.Categorical:
    """The kind of each row of `pairs`, with columns day, ref_id, other_id; area None: the whole tracks."""
    rows = TrackRows.from_tracks(tracks)
    people = tracks.iloc[rows.order[np.flatnonzero(np.diff(rows.person, prepend=-1))]]
    known = pd.MultiIndex.from_arrays([people["day"].astype(str), people["id"]])
    ref, other = (
        known.get_indexer(
            pd.MultiIndex.from_arrays([pairs["day"].astype(str), pairs[column]])
        )
        for column in ("ref_id", "other_id")
    )
    if area is not None:
        rows = rows.select(rows.within(as_area(area).grown(REACH)))
    return kinds_of_pairs(np.stack([ref, other]), rows)
