"""Kinds of encounter: who walks together, in line, towards each other, across, or past somebody who stands.

A kind belongs to two people, not to a window, and is the same for both of them.  It is decided on their
whole *common track*: every tick of the day at which both are seen within the square or `REACH` around it.
(Not on what they do elsewhere: a streamed day keeps no more, and so finds the very same kinds.)  By the
first rule that holds they are

1. companions       5 s or more together, at most 2 m apart for 80 % of that time, at equal velocity (their
                    relative velocity at most 0.4 m/s) for half of it;
2. standing         one of them is slower than 0.4 m/s for more than half of the time;
3. same direction   the mean angle between their directions of motion is at most 45 deg,
4. opposite         at least 135 deg,
5. crossing         in between.

Measured: of the people of THOR-MAGNI whose groups are known (198 pairs, 24 of them companions) 23 are found
and nobody else; of the ETH sequence's (2,044 pairs of 2 s or more, 177 in `groups.txt`) 121, and 33 others,
24 of whom keep within 2 m all the way; most of the 56 missed are the outer pairs of larger groups.  Seen once
in 0.8 s and 10 cm off (16 cm), as at Grand Central, 117 (95) are found, of THOR-MAGNI's still 23.  On the
real ATC day 69 of 210 pairs are companions; where each person is shifted in time by 1 to 10 min, and nobody
can be, 2.4 % are (44 of 1,803, eight shifts): strangers who happen to walk alike.  So about 7 % of the
day's companions are none.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pandas as pd

from ..checks import check_columns
from ..errors import DataError
from ..tracks import funnels
from ..tracks.clock import TICKS_PER_SECOND, clock_index
from .areas import as_area

COMPANIONS, STANDING, SAME, OPPOSITE, CROSSING = KINDS = (
    "companions", "standing", "same direction", "opposite", "crossing",
)  # fmt: skip
STRANGERS = "strangers"
"""Everybody but companions."""

REACH = 5.0
"""The common track goes so far beyond the square [m] (measured: finds all 62 pairs of the real day that the
rule finds on their whole tracks, and 7 more; 10 m gives one fewer, at twice the rows of a raw day)."""
TOGETHER, NEAR, NEAR_SHARE = 5.0, 2.0, 0.8
"""Companions: seconds together, at most so far apart [m], for so much of the time (measured, see above)."""
EQUAL_VELOCITY, EQUAL_SHARE = 0.4, 0.5
"""Companions: relative velocity at most this [m/s], for so much of the time (measured, see above)."""
WALKING = 0.4
"""Who is slower [m/s] than a reference pedestrian may be (paper: 0.4) is standing."""
ALONG = np.pi / 4
"""Directions at most this far apart [rad] are the same, from pi less this on opposite (assumed)."""


def encounter_kinds(tracks: pd.DataFrame, pairs: pd.DataFrame, *, square: object = None) -> pd.Categorical:
    """The kind of each pair of people, one of `KINDS`; missing where two people were never there at once.

    Parameters
    ----------
    tracks : a track table as from `szlib.read_tracks` (any row order).
    pairs : a table with columns day, ref_id, other_id (such as samples of encounters), any order.
    square : that of `szlib.find_encounters`; None takes the whole tracks.

    Raises
    ------
    DataError : a column is missing, or somebody is not in `tracks`.
    """
    check_columns(pairs, ["day", "ref_id", "other_id"])
    order, tick, _ = clock_index(tracks)
    x, y, vx, vy = (tracks[name].to_numpy(float)[order] for name in ("x", "y", "vx", "vy"))
    days, ids = tracks["day"].astype(str).to_numpy()[order], tracks["id"].to_numpy()[order]
    person, begins = number_people(days, ids)
    known = pd.MultiIndex.from_arrays([days[begins], ids[begins]])
    ref, other = (
        known.get_indexer(pd.MultiIndex.from_arrays([pairs["day"].astype(str), pairs[who]]))
        for who in ("ref_id", "other_id")
    )
    if (lost := (ref < 0) | (other < 0)).any():
        found = pairs[["day", "ref_id", "other_id"]].iloc[int(np.flatnonzero(lost)[0])].to_dict()
        raise DataError(f"{found}: not in these tracks; pass the tracks in which the pairs were found")
    there = np.ones(len(x), bool) if square is None else as_area(square).grown(REACH).contains(x, y)
    return kinds_of_pairs(ref, other, person, tick, (x, y), (vx, vy), there)


def of_kind(samples: pd.DataFrame, kinds: str | Iterable[str] | None) -> pd.DataFrame:
    """Samples of encounters of some kinds: one of `KINDS`, several, "strangers", or None for all.

    Encounters keep their numbers.  Raises DataError for an unknown kind, and for samples without kinds.
    """
    if kinds is None:
        return samples
    asked = [kinds] if isinstance(kinds, str) else list(kinds)
    wanted = {k for name in asked for k in (KINDS[1:] if name == STRANGERS else [name])}
    if not wanted or not wanted <= set(KINDS):
        raise DataError(f"unknown kinds {kinds!r}; expected some of {list(KINDS)}, or {STRANGERS!r}")
    if "kind" not in samples.columns:
        raise DataError(
            f"the samples have no column kind; found {list(samples.columns)}; find_encounters gives it"
        )
    kept = samples[samples["kind"].isin(wanted)].copy()
    counts = samples["kind"].value_counts()
    dropped = {kind: int(counts[kind]) for kind in KINDS if kind not in wanted}
    stage = funnels.stage(f"samples: {', '.join(asked)}", len(samples), len(kept), dropped)
    return funnels.attach(kept, [*funnels.get(samples), stage])


def number_people(days: np.ndarray, ids: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """For rows sorted by person: the number of each row's person, from 0, and each person's first row."""
    begins = np.flatnonzero(np.r_[True, (ids[1:] != ids[:-1]) | (days[1:] != days[:-1])][: len(ids)])
    return np.repeat(np.arange(len(begins)), np.diff(np.r_[begins, len(ids)])), begins


def kinds_of_pairs(
    first: np.ndarray,
    second: np.ndarray,
    person: np.ndarray,
    tick: np.ndarray,
    position: tuple[np.ndarray, np.ndarray],
    velocity: tuple[np.ndarray, np.ndarray],
    there: np.ndarray,
) -> pd.Categorical:
    """The kinds of pairs of people (numbers, each (n,)) from rows sorted by person and tick.

    `person`, `tick`, `there` (whether the row counts), and x and y of `position` [m] and `velocity` [m/s]
    have shape (rows,).
    """
    pairs, of = np.unique(np.sort(np.column_stack([first, second]), axis=1), axis=0, return_inverse=True)
    pair, a, b = _common_track(pairs, person, tick, there)
    apart = np.hypot(*(each[a] - each[b] for each in position))
    relative = np.hypot(*(each[a] - each[b] for each in velocity))
    slow = [np.hypot(*(each[rows] for each in velocity)) < WALKING for rows in (a, b)]
    (ax, ay), (bx, by) = ([np.nan_to_num(each[rows]) for each in velocity] for rows in (a, b))

    def over_time(values: np.ndarray) -> np.ndarray:
        """Sum of the values of each pair, over the ticks at which both are there."""
        return np.bincount(pair, weights=values, minlength=len(pairs))

    ticks = over_time(np.ones(len(pair)))
    together = ticks >= TOGETHER * TICKS_PER_SECOND
    together &= over_time(apart <= NEAR) >= NEAR_SHARE * ticks
    together &= over_time(relative <= EQUAL_VELOCITY) >= EQUAL_SHARE * ticks
    stands = np.maximum(*(over_time(each) for each in slow)) > ticks / 2
    angle = np.abs(np.arctan2(over_time(ax * by - ay * bx), over_time(ax * bx + ay * by)))
    rules = [ticks == 0, together, stands, angle <= ALONG, angle >= np.pi - ALONG]
    found = [-1, *map(KINDS.index, (COMPANIONS, STANDING, SAME, OPPOSITE))]
    codes = np.select(rules, found, KINDS.index(CROSSING)).astype(np.int8)
    return pd.Categorical(np.array([*KINDS, None])[codes[of.ravel()]], categories=list(KINDS))


def _common_track(
    pairs: np.ndarray, person: np.ndarray, tick: np.ndarray, there: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Every tick at which both people of a pair are `there`: the pair's number, and the row of either."""
    met = np.zeros(person[-1] + 1 if len(person) else 0, bool)
    met[pairs] = True
    rows = np.flatnonzero(there & met[person])
    if len(rows) == 0:
        return rows, rows, rows
    begin = np.searchsorted(person[rows], pairs[:, 0])
    count = np.searchsorted(person[rows], pairs[:, 0], side="right") - begin
    pair = np.repeat(np.arange(len(pairs)), count)
    a = np.repeat(begin - np.cumsum(count) + count, count) + np.arange(count.sum())
    first, span = tick[rows].min(), int(np.ptp(tick[rows])) + 1
    moment = person[rows] * span + tick[rows] - first  # sorted, as rows are
    sought = pairs[pair, 1] * span + tick[rows[a]] - first
    b = np.minimum(np.searchsorted(moment, sought), len(rows) - 1)
    both = moment[b] == sought
    return pair[both], rows[a[both]], rows[b[both]]
