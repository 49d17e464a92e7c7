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
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from ..core.errors import DataError
from ..tracks import funnels
from ..tracks.clock import TICKS_PER_SECOND
from .occupants import TrackRows, find_neighbours, spans

COMPANIONS, STANDING, SAME, OPPOSITE, CROSSING = KINDS = (
    "companions",
    "standing",
    "same direction",
    "opposite",
    "crossing",
)
STRANGERS = "strangers"  # all kinds but companions

# The common track reaches this far beyond the area [m] (measured: it finds all 62 pairs of the real day that
# the rule finds on whole tracks, and 7 more; 10 m finds one fewer, with twice the rows of a raw day).
REACH = 5.0
# Companions (measured): the shortest time together [s], and the largest distance [m] and relative velocity
# [m/s], each for a share of that time.
TOGETHER = 5.0
NEAR = 2.0
NEAR_SHARE = 0.8
EQUAL_VELOCITY = 0.4
EQUAL_SHARE = 0.5
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
    rejected = {
        kind: int((samples["kind"] == kind).sum())
        for kind in KINDS
        if kind not in wanted
    }
    stage = funnels.stage(
        f"samples: {', '.join(names)}", len(samples), len(selected), rejected
    )
    return funnels.attach(selected, [*funnels.get(samples), stage])


def find_units(rows: TrackRows, whole: np.ndarray) -> np.ndarray:
    """Number of the unit of each person: companions, and companions of companions.

    `whole` are the numbers of the `rows` at whole seconds, among which companions are sought.
    """
    found = find_neighbours(rows.place[whole], rows.moment[whole], NEAR)
    pairs = np.sort(rows.person[whole][np.hstack(list(found))], axis=0)
    pairs, seconds = np.unique(pairs, axis=1, return_counts=True)
    pairs = pairs[:, seconds >= TOGETHER - 1]
    a, b = pairs[:, np.asarray(kinds_of_pairs(pairs, rows) == COMPANIONS)]
    n = rows.person[-1] + 1
    graph = coo_array((np.ones(len(a)), (a, b)), shape=(n, n))
    return np.asarray(connected_components(graph, directed=False)[1])


def kinds_of_pairs(pairs: np.ndarray, rows: TrackRows) -> pd.Categorical:
    """Decide the kinds of pairs of people from the `rows`.

    `pairs` are the numbers of the two people of each pair, (2, n).
    """
    pair, both = _common_track(pairs, rows)
    is_near = rows.distance(*both) <= NEAR
    is_equal = np.abs(np.diff(rows.velocity[both], axis=0)[0]) <= EQUAL_VELOCITY
    n = pairs.shape[1]
    ticks = np.bincount(pair, minlength=n)
    together = ticks >= TOGETHER * TICKS_PER_SECOND
    for condition, share in ((is_near, NEAR_SHARE), (is_equal, EQUAL_SHARE)):
        together &= np.bincount(pair, condition, n) >= share * ticks
    codes = classify_motion(rows, both, pair, n)
    codes = np.select([ticks == 0, together], [-1, KINDS.index(COMPANIONS)], codes)
    return name_kinds(codes)


def name_kinds(codes: NDArray[np.integer]) -> pd.Categorical:
    """The kinds with the numbers `codes`; none for -1."""
    return pd.Categorical(np.array([*KINDS, None])[codes], categories=list(KINDS))


def classify_motion(
    rows: TrackRows, both: np.ndarray, pair: np.ndarray, n: int
) -> np.ndarray:
    """Decide how the two people of each of `n` pairs move: numbers of `KINDS`, companions left aside.

    `both` are the `rows` of the two at every moment that counts, (2, m), and `pair` the number of their pair.
    """
    slow = [np.bincount(pair, rows.speed[each] < WALKING, n) for each in both]
    stands = np.maximum(*slow) > np.bincount(pair, minlength=n) / 2
    # The angle of this product is that between the directions of motion.
    turn = np.nan_to_num(rows.velocity[both[0]].conj() * rows.velocity[both[1]])
    along, across = (np.bincount(pair, part, n) for part in (turn.real, turn.imag))
    angle = np.abs(np.arctan2(across, along))
    # standing, same direction, opposite, else crossing
    return np.select([stands, angle <= ALONG, angle >= np.pi - ALONG], [1, 2, 3], 4)


def _common_track(pairs: np.ndarray, rows: TrackRows) -> tuple[np.ndarray, np.ndarray]:
    """Every tick at which both people of a pair have a row: the pair's number, and the two rows."""
    first, last = np.searchsorted(rows.person, [pairs[0], pairs[0] + 1])
    pair, one = spans(first, last)
    length = rows.moment.max(initial=0) + 1
    key = rows.person * length + rows.moment  # ascending: rows are by person and time
    sought = key[one] + (length * np.diff(pairs, axis=0)[0])[pair]
    other = np.searchsorted(key, sought)
    is_common = np.take(key, other, mode="clip") == sought
    return pair[is_common], np.stack([one, other])[:, is_common]
