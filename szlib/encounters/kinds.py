"""Kinds of encounter: companions, standing, same direction, opposite, crossing.

A kind belongs to two people, not to a window, and is the same for both of them.  It is decided on their
whole *common track*: every tick of the day at which both are in the area or `REACH` around it.  (Rows
farther away are not used, because a streamed day does not hold them.)  By the first rule that holds they are

1. companions       5 s or more together, at most 2 m apart for 80 % of that time, at equal velocity (their
                    relative velocity at most 0.4 m/s) for half of it;
2. standing         one of them is slower than 0.4 m/s for more than half of the time;
3. same direction   the mean angle between their directions of motion is at most 45 deg,
4. opposite         at least 135 deg,
5. crossing         in between.

Measured.  The groups of THOR-MAGNI are known: of 24 pairs of companions among 198 pairs, 23 are found, and
no other pair.  In the ETH sequence (2,044 pairs of 2 s or more, 177 of them in `groups.txt`) 121 are found,
and 33 others, 24 of which keep within 2 m all the way.  Most of the 56 missed pairs are the outer pairs of
larger groups.  Sampled once in 0.8 s and with an error of 10 cm (16 cm), as at Grand Central, 117 (95) of
the ETH pairs are found, and still 23 of THOR-MAGNI's.  On the real ATC day 69 of 210 pairs are companions.
Where each person is shifted in time by 1 to 10 min, no pair can be, but 2.4 % are found (44 of 1,803, eight
shifts): strangers who happen to walk alike.  So about 7 % of the day's companions are strangers.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pandas as pd

from ..core.errors import DataError
from ..tracks import funnels
from ..tracks.clock import TICKS_PER_SECOND
from .occupants import TrackRows, find_neighbours

COMPANIONS, STANDING, SAME, OPPOSITE, CROSSING = KINDS = (
    "companions", "standing", "same direction", "opposite", "crossing",
)  # fmt: skip
STRANGERS = "strangers"  # all kinds but companions

# The common track reaches this far beyond the area [m] (measured: it finds all 62 pairs of the real day that
# the rule finds on whole tracks, and 7 more; 10 m finds one fewer, with twice the rows of a raw day).
REACH = 5.0
# Companions: shortest time together [s], largest distance [m], for this share of the time (measured).
TOGETHER, NEAR, NEAR_SHARE = 5.0, 2.0, 0.8
# Companions: largest relative velocity [m/s], for this share of the time (measured).
EQUAL_VELOCITY, EQUAL_SHARE = 0.4, 0.5
# a slower person [m/s] is standing (paper: 0.4 for a reference pedestrian)
WALKING = 0.4
# Directions at most this far apart [rad] are the same, from pi less this on opposite (assumed).
ALONG = np.pi / 4


def of_kind(samples: pd.DataFrame, kinds: str | Iterable[str] | None) -> pd.DataFrame:
    """Select the samples of some kinds of encounter.

    Parameters
    ----------
    samples : samples as from `szlib.find_encounters`; encounters keep their numbers.
    kinds : one of `KINDS`, several of them, "strangers" (all but companions), or None for all.

    Returns
    -------
    The selected samples; the funnel counts the others by kind.

    Raises
    ------
    DataError : a kind is unknown, or the samples have no column kind.

    Examples
    --------
    >>> import szlib
    >>> plaza = szlib.make_plaza("plaza.csv", settings=szlib.PlazaSettings(n_encounters=20))
    >>> samples = szlib.find_encounters(szlib.read_tracks(plaza))
    >>> len(szlib.of_kind(samples, "strangers")) <= len(samples)
    True
    """
    if kinds is None:
        return samples
    names = [kinds] if isinstance(kinds, str) else list(kinds)
    wanted = {k for name in names for k in (KINDS[1:] if name == STRANGERS else [name])}
    if not wanted or not wanted <= set(KINDS):
        raise DataError(
            f"unknown kinds {kinds!r}; expected some of {list(KINDS)}, or {STRANGERS!r}"
        )
    if "kind" not in samples.columns:
        raise DataError(
            f"the samples have no column kind; found {list(samples.columns)}; find_encounters gives it"
        )
    selected = samples[samples["kind"].isin(wanted)].copy()
    counts = samples["kind"].value_counts()
    rejected = {kind: int(counts[kind]) for kind in KINDS if kind not in wanted}
    stage = funnels.stage(
        f"samples: {', '.join(names)}", len(samples), len(selected), rejected
    )
    return funnels.attach(selected, [*funnels.get(samples), stage])


def find_near_pairs(rows: TrackRows, whole: np.ndarray, seconds: float) -> np.ndarray:
    """Pairs of people who are within `NEAR` [m] at so many `seconds`, or more; their numbers (n, 2).

    `whole` are those of the `rows` (indices, or a mask) that are at a whole second.
    """
    found = find_neighbours(rows.x[whole], rows.y[whole], rows.moment[whole], NEAR)
    near = np.concatenate([np.empty((2, 0), np.intp), *map(np.stack, found)], axis=1)
    pairs = np.sort(rows.person[whole][near.T], axis=1)
    pairs, counts = np.unique(pairs, axis=0, return_counts=True)
    return np.asarray(pairs[counts >= seconds])


def kinds_of_pairs(
    first: np.ndarray, second: np.ndarray, rows: TrackRows, counts: np.ndarray
) -> pd.Categorical:
    """Decide the kinds of pairs of people from the `rows` that count (`counts`, one for each row).

    `first` and `second` are the numbers of the two people of each pair, (n,).
    """
    pairs, index = np.unique(
        np.sort(np.column_stack([first, second]), axis=1), axis=0, return_inverse=True
    )
    pair, a, b = _common_track(pairs, rows.person, rows.tick, counts)
    apart = np.hypot(rows.x[a] - rows.x[b], rows.y[a] - rows.y[b])
    relative = np.hypot(rows.vx[a] - rows.vx[b], rows.vy[a] - rows.vy[b])
    ticks, near, equal = (
        np.bincount(pair, each, minlength=len(pairs))
        for each in (np.ones(len(pair)), apart <= NEAR, relative <= EQUAL_VELOCITY)
    )
    together = ticks >= TOGETHER * TICKS_PER_SECOND
    together &= (near >= NEAR_SHARE * ticks) & (equal >= EQUAL_SHARE * ticks)
    codes = classify_motion(rows, a, b, pair, len(pairs))
    codes = np.select([ticks == 0, together], [-1, KINDS.index(COMPANIONS)], codes)
    return pd.Categorical(
        np.array([*KINDS, None])[codes[index.ravel()]], categories=list(KINDS)
    )


def classify_motion(
    rows: TrackRows, a: np.ndarray, b: np.ndarray, pair: np.ndarray, n: int
) -> np.ndarray:
    """Decide how the two people of each of `n` pairs move: numbers of `KINDS`, companions left aside.

    `a` and `b` are the `rows` of the two at every moment that counts, and `pair` the number of their pair.
    """
    (ax, ay), (bx, by) = (
        np.nan_to_num([rows.vx[each], rows.vy[each]]) for each in (a, b)
    )

    def over_time(values: np.ndarray) -> np.ndarray:
        """Sum of the `values` of each pair."""
        return np.bincount(pair, weights=values, minlength=n)

    slow = np.maximum(*(over_time(rows.speed[each] < WALKING) for each in (a, b)))
    stands = slow > over_time(np.ones(len(pair))) / 2
    angle = np.abs(
        np.arctan2(over_time(ax * by - ay * bx), over_time(ax * bx + ay * by))
    )
    found = [KINDS.index(kind) for kind in (STANDING, SAME, OPPOSITE, CROSSING)]
    rules = [stands, angle <= ALONG, angle >= np.pi - ALONG]
    return np.select(rules, found[:3], found[3]).astype(np.int8)


def _common_track(
    pairs: np.ndarray, person: np.ndarray, tick: np.ndarray, counts: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Every tick at which the rows of both people of a pair count: the pair's number, and the two rows."""
    in_pair = np.zeros(person[-1] + 1, bool)
    in_pair[pairs] = True
    rows = np.flatnonzero(counts & in_pair[person])
    if len(rows) == 0:
        return rows, rows, rows
    start = np.searchsorted(person[rows], pairs[:, 0])
    count = np.searchsorted(person[rows], pairs[:, 0], side="right") - start
    pair = np.repeat(np.arange(len(pairs)), count)
    a = np.repeat(start - np.cumsum(count) + count, count) + np.arange(count.sum())
    first, span = tick[rows].min(), int(np.ptp(tick[rows])) + 1
    moment = person[rows] * span + tick[rows] - first  # sorted, as rows are
    sought = pairs[pair, 1] * span + tick[rows[a]] - first
    b = np.minimum(np.searchsorted(moment, sought), len(rows) - 1)
    both = moment[b] == sought
    return pair[both], rows[a[both]], rows[b[both]]
