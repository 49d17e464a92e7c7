"""Every pair of people who come near each other, and the same streams of people moved in time.

The paper's encounters are windows in which two people are alone: most recordings hold a handful. Here each
pair of people counts once, with its whole approach, and third people are a covariate, not a filter.

To know what chance gives, people are moved in time. A group or a train of people keeps together for other
reasons than respect, so nobody is moved alone:

unit      companions (`szlib.encounters.kinds`), and companions of companions
stream    units with the same direction of travel: one of eight sectors of 45 deg, whose borders lie where
          fewest people head. Each stream is moved as a whole. So groups, trains, turnstiles and queues stay.

Two people of one stream keep their distance in all shifts, so they tell nothing, and are "same direction".
Compared are pairs of different streams who come towards each other or cross.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import pandas as pd

from ..core.checks import require
from ..core.errors import DataError
from ..tracks import funnels
from ..tracks.clock import TICKS_PER_SECOND
from .finding import find_place
from .geometry import Area
from .kinds import (
    COMPANIONS,
    CROSSING,
    KINDS,
    OPPOSITE,
    REACH,
    SAME,
    STANDING,
    classify_motion,
    find_units,
    name_kinds,
    of_kind,
)
from .occupants import TrackRows, find_neighbours, firsts, sample_rows
from .sensor import (
    BEFORE,
    NEAR_END,
    SensorCheck,
    count_ends,
    count_exchanged,
    measure_noise,
)
from .settings import EncounterSettings

CLOSE = 2.0  # people farther apart [m] do not belong to a zone (paper: r_max)

COMPARED = (OPPOSITE, CROSSING)
"""Kinds of pairs that a shift in time can tell about."""

_STANDING = KINDS.index(STANDING)
SECTORS = 8  # streams of a day, by direction of travel
_OFFSETS = np.radians(np.arange(0, 45, 5))  # of the borders of the sectors
_MARGIN = 1.75  # way that two people close in half a second, at 3.5 m/s [m]
_TURN = 0.5  # by which two people who turn come nearer within a second [m]
# Steps of the clock around each whole second at which two people are measured.
_STEPS = np.arange(-TICKS_PER_SECOND, TICKS_PER_SECOND + 1)
# People this far outside of the area may be in it at the next whole second [m].
_BEYOND = 1.6


def find_pairs(
    tracks: pd.DataFrame,
    *,
    area: object = None,
    r_max: float = CLOSE,
    kinds: str | Iterable[str] | None = COMPARED,
) -> pd.DataFrame:
    """Find every pair of people who come within `r_max` of each other in the area, each pair once.

    Pairs are sought at whole seconds. A pair can be missed if its two people are not both seen at a whole
    second at most 0.5 s from a moment at which they are near: a track begins or ends beside the other person.
    In crowds that were made up 3 of 1,362 pairs were missed, and 12 of 1,478 where each track had a gap.

    Parameters
    ----------
    tracks : a track table as from `szlib.read_tracks` (any row order, left untouched).
    area : where both people must be: as in `szlib.find_encounters`.
    r_max : distance of a pair's nearest approach, at most [m].
    kinds : kinds of pairs: by default those who come towards each other or cross, which the null model can
        tell about; "strangers" for all but companions, None for all.

    Returns
    -------
    Samples as from `szlib.find_encounters`: one `encounter` is one pair, sampled at 10 Hz wherever it is
    within `r_max`. The reference pedestrian is the one with the smaller id. Further columns: kind, and third,
    the number of other people within `r_max` of the reference pedestrian or of the other person, whichever is
    larger, at the whole second next to their nearest approach. It is one too small if the two are farther
    apart than `r_max` at that second.

    Raises
    ------
    DataError : as `szlib.find_encounters`; or `r_max` is not positive.

    Examples
    --------
    >>> import szlib
    >>> plaza = szlib.make_plaza("plaza.csv", settings=szlib.PlazaSettings(n_encounters=100))
    >>> pairs = szlib.find_pairs(szlib.read_tracks(plaza))
    >>> set(pairs["kind"]) == {"opposite", "crossing"}
    True
    """
    require(0 < r_max < np.inf, "r_max", r_max, "a positive distance in metres")
    tracks, place = find_place(tracks, EncounterSettings(area=area))
    crowd = Crowd.from_tracks(tracks, place)
    met = crowd.meet(r_max)
    samples = crowd.sample(tracks, met, np.arange(len(met.kind)), r_max)
    samples.attrs |= {"area": str(place), "area_reason": place.reason}
    return of_kind(funnels.attach(samples, funnels.get(tracks)), kinds)


@dataclass(frozen=True, eq=False)
class Meetings:
    """Pairs of people who come near each other.

    Attributes
    ----------
    rows : of each pair the rows of the two people where they are nearest, (2, n).
    nearest : nearest approach [m], (n,).
    kind : number of the kind, (n,).
    third : other people near one of the two, as in `find_pairs`, (n,).
    near, of_pair : rows of `Crowd.coarse_rows` at every whole second at which two people may be near, (2, m),
        and their pair, (m,).
    """

    rows: np.ndarray
    nearest: np.ndarray
    kind: np.ndarray
    third: np.ndarray
    near: np.ndarray
    of_pair: np.ndarray


@dataclass(frozen=True, eq=False)
class Crowd:
    """The people in an area, prepared once: all that no shift in time changes.

    Attributes
    ----------
    rows : the rows of the tracks in the area and `REACH` around it, by person and time.
    inside : whether each row is in the area.
    whole_seconds : numbers of the rows at whole seconds of people in the area, or within a second of it.
    """

    rows: TrackRows
    inside: np.ndarray
    whole_seconds: np.ndarray

    @classmethod
    def from_tracks(cls, tracks: pd.DataFrame, area: Area) -> Crowd:
        """Prepare the people of a track table `tracks` in an `area`."""
        rows = TrackRows.from_tracks(tracks)
        around = rows.within(area.grown(REACH))
        rows = rows.select(around & np.isfinite(rows.velocity))
        if len(rows) == 0:
            raise DataError(
                f"nobody was seen in the area {area}; check its coordinates"
            )
        gaps = (np.diff(rows.piece) != 0) | (np.diff(rows.tick) != 1)
        day = np.unique(rows.day, return_inverse=True)[1]
        rows = replace(rows, day=day, piece=np.r_[0, np.cumsum(gaps)])
        near = rows.within(area.grown(_BEYOND))
        seconds = np.flatnonzero(near & (rows.tick % TICKS_PER_SECOND == 0))
        return cls(rows, rows.within(area), seconds)

    @cached_property
    def coarse_rows(self) -> TrackRows:
        """The rows at `whole_seconds`: pairs are sought among them."""
        return self.rows.select(self.whole_seconds)

    @cached_property
    def ways(self) -> np.ndarray:
        """Positions from 1 s before to 1 s after the `whole_seconds`, NaN out of the area, (n, 21)."""
        place = np.where(self.inside, self.rows.place, np.nan)
        return self.rows.around(place, self.whole_seconds, _STEPS)

    @cached_property
    def unit(self) -> np.ndarray:
        """Number of the unit of each person."""
        return find_units(self.rows, self.whole_seconds)

    @cached_property
    def stream(self) -> np.ndarray:
        """Number of the stream of each person; each day has its own."""
        rows = self.rows
        unit = self.unit[self.rows.person]
        # the sum of each unit's velocities
        heading = np.arctan2(
            np.bincount(unit, rows.velocity.imag), np.bincount(unit, rows.velocity.real)
        )
        width = 2 * np.pi / SECTORS
        from_border = np.abs(((heading[:, None] - _OFFSETS) / width + 0.5) % 1 - 0.5)
        offset = _OFFSETS[np.argmin((from_border < 0.15).sum(axis=0))]
        sector = ((heading - offset) // width).astype(int) % SECTORS
        day = np.zeros(len(self.unit), np.int64)
        day[rows.person] = rows.day
        return np.asarray(day * SECTORS + sector[self.unit])

    @cached_property
    def sensor(self) -> SensorCheck:
        """What the tracks say about the sensor."""
        rows = self.rows
        at = self.whole_seconds
        begin = firsts(rows.piece)
        ends = np.stack([begin, np.append(begin[1:], len(rows)) - 1])
        left = (ends[:, rows.piece[at]] - at) / TICKS_PER_SECOND
        coarse = self.coarse_rows
        first, period = rows.recorded
        second = coarse.tick // TICKS_PER_SECOND - first[coarse.day]
        inside = self.inside[at] & (second > 1) & (second < period[coarse.day] - 2)
        found = count_ends(coarse, inside, left, self.unit)
        found |= measure_noise(rows, self.inside)
        met = self.meet(CLOSE)
        passing = met.rows[:, (met.kind > _STANDING) & (met.nearest < NEAR_END)]
        velocity = np.where(self.inside, rows.velocity, np.nan)
        velocity = rows.around(velocity, passing, np.array([-BEFORE, BEFORE]))
        velocity = velocity[:, np.isfinite(velocity).all(axis=(0, 2))]
        return SensorCheck(
            **found,
            passes=velocity.shape[1],
            exchanged=count_exchanged(velocity[..., 0], velocity[..., 1]),
        )

    def meet(self, r_max: float, shifts: np.ndarray | None = None) -> Meetings:
        """Find the pairs of people within `r_max` [m].

        With `shifts` each stream is moved in time by its own shift [s], and pairs of one stream are left out.
        """
        rows = self.coarse_rows
        first, period = self.rows.recorded
        second = rows.tick // TICKS_PER_SECOND - first[rows.day]
        group = rows.person
        if shifts is not None:
            group = self.stream[rows.person]
            second = (second + shifts[group]) % period[rows.day]
        moment = rows.day * period.max() + second
        found = find_neighbours(rows.place, moment, r_max + _MARGIN)
        pairs = np.hstack(list(found))
        pairs = pairs[:, np.diff(group[pairs], axis=0)[0] != 0]
        # A person who has just come into the area may have been nearer almost a second ago.
        pairs = pairs[:, rows.approach(pairs, -1.0, 1.0) < r_max + _TURN]
        near = np.sort(pairs, axis=0)  # rows are in the order of people
        one, other = rows.person[near]
        key = one * len(self.unit) + other
        order = np.argsort(key * len(rows) + near[0])
        near = near[:, order]
        of_pair = np.cumsum(np.diff(key[order], prepend=-1) > 0) - 1
        pairs, nearest, at = self._approach(near, of_pair)
        third = self._third_people(near, at, r_max)
        kept = nearest < r_max
        is_kept = kept[of_pair]
        near = near[:, is_kept]
        of_pair = (np.cumsum(kept) - 1)[of_pair[is_kept]]
        kind = self._kinds(near, of_pair)
        return Meetings(pairs[:, kept], nearest[kept], kind, third[kept], near, of_pair)

    def sample(
        self, tracks: pd.DataFrame, met: Meetings, pairs: np.ndarray, r_max: float
    ) -> pd.DataFrame:
        """Sample some `pairs` of `met` at 10 Hz where they are within `r_max` [m], as `find_pairs` does.

        `tracks` is the track table of the crowd.
        """
        wanted = np.isin(met.of_pair, pairs)
        near = met.near[:, wanted]
        moment, step = np.nonzero(self._distances(near) < r_max)
        one, other = self.whole_seconds[near[:, moment]] + _STEPS[step]
        pair = met.of_pair[wanted][moment]
        # a moment between two whole seconds is found from each of them
        first = np.unique(pair * len(self.rows) + one, return_index=True)[1]
        pair = pair[first]
        samples = sample_rows(tracks, self.rows, pair, one[first], other[first])
        samples["kind"] = name_kinds(met.kind[pair])
        samples["third"] = met.third[pair]
        return samples

    def _distances(self, near: np.ndarray) -> np.ndarray:
        """Distances of two people around the `coarse_rows` `near` [m], NaN out of the area, (n, 21)."""
        return np.asarray(np.abs(np.subtract(*self.ways[near])))

    def _approach(
        self, near: np.ndarray, of_pair: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Of each pair: its rows where it is nearest (2, n), the distance [m], and the position in `near`."""
        likely = self.coarse_rows.approach(near, -0.5, 0.5)
        likely[~self.inside[self.whole_seconds[near]].all(axis=0)] += 2 * REACH
        least = np.minimum.reduceat(likely, firsts(of_pair))
        at = np.flatnonzero(likely == least[of_pair])
        at = at[firsts(of_pair[at])]
        distance = np.nan_to_num(self._distances(near[:, at]), nan=np.inf)
        step = distance.argmin(axis=1)
        return self.whole_seconds[near[:, at]] + _STEPS[step], distance.min(axis=1), at

    def _kinds(self, near: np.ndarray, of_pair: np.ndarray) -> np.ndarray:
        """Number of the kind of each pair, from its rows at whole seconds."""
        pairs = self.coarse_rows.person[near[:, firsts(of_pair)]]
        codes = classify_motion(self.coarse_rows, near, of_pair, pairs.shape[1])
        unit, own = self.unit[pairs]
        stream, other = self.stream[pairs]
        rules = [unit == own, (stream == other) & (codes != _STANDING)]
        names = [KINDS.index(kind) for kind in (COMPANIONS, SAME)]
        return np.select(rules, names, codes)

    def _third_people(
        self, near: np.ndarray, at: np.ndarray, r_max: float
    ) -> np.ndarray:
        """The column third of `find_pairs`, of two people each in the rows `at` of `near`.

        With shifts, people of the same stream do not count.
        """
        close = near[:, self.coarse_rows.distance(*near) < r_max]
        around = np.bincount(close.ravel(), minlength=len(self.coarse_rows))
        return np.asarray(np.maximum(around[near[:, at]].max(axis=0) - 1, 0))
