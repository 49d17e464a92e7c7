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
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pandas as pd
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

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
    TOGETHER,
    classify_motion,
    find_near_pairs,
    kinds_of_pairs,
    of_kind,
)
from .occupants import TrackRows, find_neighbours
from .samples import sample_rows
from .sensor import (
    BEFORE,
    NEAR_END,
    SensorCheck,
    count_ends,
    is_exchanged,
    measure_noise,
)
from .settings import EncounterSettings

CLOSE = 2.0  # people farther apart [m] do not belong to a zone (paper: r_max)

COMPARED = (OPPOSITE, CROSSING)
"""Kinds of pairs that a shift in time can tell about."""

_STANDING = KINDS.index(STANDING)
_SECTORS = 8  # streams by direction of travel
_OFFSETS = np.radians(np.arange(0, 45, 5))  # of the borders of the sectors
_MARGIN = 1.75  # way that two people close in half a second, at 3.5 m/s [m]
# Steps of the clock around each whole second at which two people are measured.
_AROUND = np.arange(-TICKS_PER_SECOND, TICKS_PER_SECOND + 1)
_BEYOND = (
    1.6  # people this far outside of the area may be in it at the next whole second [m]
)
_SHORTEST = 10.0  # shortest shift [s]: longer than two people see each other


def find_pairs(
    tracks: pd.DataFrame,
    *,
    area: object = None,
    r_max: float = CLOSE,
    kinds: str | Iterable[str] | None = COMPARED,
) -> pd.DataFrame:
    """Find every pair of people who come within `r_max` of each other in the area, each pair once.

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
    the number of other people within `r_max` of one of the two when they are nearest.

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
    met = crowd.meet(np.zeros(len(crowd.streams), np.int64), r_max)
    one, other, pair = crowd.sample(met, np.arange(len(met.pair)), r_max)
    samples = sample_rows(tracks, crowd.order[one], crowd.order[other])
    samples.insert(0, "encounter", pair)
    samples["kind"] = name_kinds(met.kind[pair])
    samples["third"] = met.third[pair]
    samples.attrs |= {"area": str(place), "area_reason": place.reason}
    stage = funnels.stage("pairs: samples", len(samples), len(samples), {})
    return of_kind(funnels.attach(samples, [*funnels.get(tracks), stage]), kinds)


def describe_pairs(tracks: pd.DataFrame, area: Area) -> str:
    """How many pairs of `tracks` in an `area` are compared with chance, and what they say of the sensor."""
    crowd = Crowd.from_tracks(tracks, area)
    n = int(np.isin(crowd.close.kind, [KINDS.index(kind) for kind in COMPARED]).sum())
    resolved = crowd.sensor.resolved
    loses = f"loses people who are nearer than {resolved:.1f} m to each other"
    return (
        f"pairs who come towards each other or cross, within {CLOSE:g} m: {n:,}\n"
        f"sensor: it {loses if resolved else 'resolves people at every distance'}: {crowd.sensor}"
    )


@dataclass(frozen=True, eq=False)
class Meetings:
    """Pairs of people who come near each other.

    Attributes
    ----------
    pair : of each pair the coarse rows of the two people where they are nearest, (n, 2).
    nearest : nearest approach [m], (n,).
    kind : number of the kind, (n,).
    third : other people near one of the two at that moment, (n,).
    first, second, of_pair : every pair of coarse rows that may be near, by pair, and the pair's number.
    """

    pair: np.ndarray
    nearest: np.ndarray
    kind: np.ndarray
    third: np.ndarray
    first: np.ndarray
    second: np.ndarray
    of_pair: np.ndarray


@dataclass(frozen=True, eq=False)
class Crowd:
    """The people in an area, prepared once: all that no shift in time changes.

    Attributes
    ----------
    rows : the rows of the tracks in the area and `REACH` around it, by person and time.
    order : position of each row in the track table.
    inside : whether each row is in the area.
    near : whether it is in the area, or may be within a second.
    """

    rows: TrackRows
    order: np.ndarray
    inside: np.ndarray
    near: np.ndarray

    @classmethod
    def from_tracks(cls, tracks: pd.DataFrame, area: Area) -> Crowd:
        """Prepare the people of a track table `tracks` in an `area`."""
        rows = TrackRows.from_tracks(tracks)
        around = area.grown(REACH).contains(rows.x, rows.y)
        rows = rows.select(around & np.isfinite(rows.speed))
        if len(rows) == 0:
            raise DataError(
                f"nobody was seen in the area {area}; check its coordinates"
            )
        inside = area.contains(rows.x, rows.y)
        near = area.grown(_BEYOND).contains(rows.x, rows.y)
        return cls(rows, rows.order, inside, near)

    @cached_property
    def coarse(self) -> np.ndarray:
        """One row a second of everybody near the area: pairs are sought among these."""
        return np.flatnonzero((self.rows.tick % TICKS_PER_SECOND == 0) & self.near)

    @cached_property
    def second(self) -> np.ndarray:
        """Whole second of each coarse row, from the beginning of its day."""
        second = self.rows.tick[self.coarse] // TICKS_PER_SECOND
        return np.asarray(second - self.days[0][self.rows.day[self.coarse]])

    @cached_property
    def days(self) -> tuple[np.ndarray, np.ndarray]:
        """First second of each day, and the seconds of the circle of its recording."""
        second, day = self.rows.tick // TICKS_PER_SECOND, self.rows.day
        first = np.full(day.max() + 1, np.iinfo(np.int64).max)
        last = np.zeros(day.max() + 1, np.int64)
        np.minimum.at(first, day, second)
        np.maximum.at(last, day, second)
        return first, last - first + 2

    @cached_property
    def unit(self) -> np.ndarray:
        """Number of the unit of each person: companions, and companions of companions."""
        n = self.rows.person[-1] + 1
        pairs = find_near_pairs(self.rows, self.coarse, TOGETHER - 1)
        everywhere = np.ones(len(self.rows), bool)
        kinds = kinds_of_pairs(pairs[:, 0], pairs[:, 1], self.rows, everywhere)
        a, b = pairs[np.asarray(kinds == COMPANIONS)].T
        graph = coo_array((np.ones(len(a)), (a, b)), shape=(n, n))
        return np.asarray(connected_components(graph, directed=False)[1])

    @cached_property
    def stream(self) -> np.ndarray:
        """Number of the stream of each person; each day has its own."""
        rows, unit = self.rows, self.unit[self.rows.person]
        moved = [
            np.bincount(unit, v, minlength=unit.max() + 1) for v in (rows.vx, rows.vy)
        ]
        heading = np.arctan2(moved[1], moved[0])
        width = 2 * np.pi / _SECTORS
        from_border = np.abs(((heading[:, None] - _OFFSETS) / width + 0.5) % 1 - 0.5)
        offset = _OFFSETS[np.argmin((from_border < 0.15).sum(axis=0))]
        sector = ((heading - offset) // width).astype(int) % _SECTORS
        day = np.zeros(self.rows.person[-1] + 1, np.int64)
        day[rows.person] = rows.day
        return np.asarray(day * _SECTORS + sector[self.unit])

    @cached_property
    def streams(self) -> np.ndarray:
        """Day of each stream."""
        return np.repeat(np.arange(len(self.days[0])), _SECTORS)

    @cached_property
    def close(self) -> Meetings:
        """The pairs of people within `CLOSE`, as they walked."""
        return self.meet(np.zeros(len(self.streams), np.int64), CLOSE)

    @cached_property
    def sensor(self) -> SensorCheck:
        """What the tracks say about the sensor."""
        met = self.close
        one, other, _ = self.sample(met, np.flatnonzero(met.kind > 0), CLOSE)
        found = count_ends(self.rows, self.inside, one, other)
        found |= measure_noise(self.rows, self.inside)
        exchanged = self._exchanges(
            met.pair[(met.kind > _STANDING) & (met.nearest < NEAR_END)]
        )
        return SensorCheck(
            **found, passes=len(exchanged), exchanged=int(exchanged.sum())
        )

    def _exchanges(self, pairs: np.ndarray) -> np.ndarray:
        """Whether the ids of people look exchanged who pass near the coarse rows `pairs` (n, 2)."""
        rows = self.rows
        one, other, known = self._along(
            self.coarse[pairs[:, 0]], self.coarse[pairs[:, 1]], _AROUND
        )
        apart = np.hypot(rows.x[one] - rows.x[other], rows.y[one] - rows.y[other])
        at = np.argmin(np.where(known, apart, np.inf), axis=1)[:, None]
        one, other = (
            np.take_along_axis(each, at, axis=1)[:, 0] for each in (one, other)
        )
        one, other, known = self._along(one, other, np.array([-BEFORE, BEFORE]))
        ends = np.stack([one, other], axis=2)[known.all(axis=1)]
        return is_exchanged(rows, ends[:, 0], ends[:, 1])

    def draw(
        self, rng: np.random.Generator, minutes: tuple[float, float]
    ) -> np.ndarray:
        """Draw a shift for each stream [s] with `rng`, of `minutes` (shortest, longest) either way."""
        low, high = (60 * float(m) for m in minutes)
        require(
            0 < low <= high < np.inf,
            "minutes",
            minutes,
            "(shortest, longest), both positive",
        )
        period = self.days[1][self.streams]
        share = np.minimum(period / (low + high), 1)
        if low * share.min() < _SHORTEST:
            raise DataError(
                f"a day was recorded for {period.min() / 60:.1f} min, too short for a null model, which "
                f"moves people by {_SHORTEST:g} s and more; leave out recordings shorter than 2 min"
            )
        size = rng.uniform(low, high, len(share)) * share
        return np.asarray(np.rint(size * rng.choice([-1, 1], len(share))), np.int64)

    def meet(
        self, shifts: np.ndarray, r_max: float, *, shifted: bool = False
    ) -> Meetings:
        """Find the pairs of people within `r_max` [m] if each stream is moved by its one of `shifts` [s].

        With `shifted`, pairs of one stream are left out.
        """
        coarse, rows = self.coarse, self.rows
        person, day = rows.person[coarse], rows.day[coarse]
        second = (self.second + shifts[self.stream[person]]) % self.days[1][day]
        stream = self.stream if shifted else np.arange(len(self.stream))
        one, other = self._near_rows(second, r_max + _MARGIN, stream)
        swap = person[one] > person[other]
        one, other = np.where(swap, other, one), np.where(swap, one, other)
        key = person[one] * np.int64(len(self.stream)) + person[other]
        order = np.argsort(key, kind="stable")
        one, other, key = one[order], other[order], key[order]
        first = np.flatnonzero(np.diff(key, prepend=-1))
        of_pair = np.repeat(np.arange(len(first)), np.diff(np.r_[first, len(key)]))
        nearest, at = self._approach(one, other, first, of_pair)
        kept = nearest < r_max
        number = np.cumsum(kept) - 1
        is_kept = kept[of_pair]
        kind = self._kinds(one, other, of_pair, len(first))[kept]
        third = self._third_people(one, other, at, r_max)[kept]
        return Meetings(
            np.column_stack([one[at], other[at]])[kept], nearest[kept], kind, third, one[is_kept],
            other[is_kept], number[of_pair[is_kept]],
        )  # fmt: skip

    def sample(
        self, met: Meetings, pairs: np.ndarray, r_max: float
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The rows (at 10 Hz) at which some `pairs` of `met` are within `r_max` [m], and their pair."""
        wanted = np.isin(met.of_pair, pairs)
        a, b = (self.coarse[each[wanted]] for each in (met.first, met.second))
        one, other, known = self._along(a, b, _AROUND)
        pair = np.broadcast_to(met.of_pair[wanted, None], known.shape)
        x, y = self.rows.x, self.rows.y
        near = known & (np.hypot(x[one] - x[other], y[one] - y[other]) < r_max)
        key = one[near] * np.int64(len(self.rows)) + other[near]
        once = np.unique(key, return_index=True)[1]
        once = once[np.lexsort((one[near][once], pair[near][once]))]
        return one[near][once], other[near][once], pair[near][once]

    def _near_rows(
        self, second: np.ndarray, reach: float, group: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Pairs of coarse rows of two people of different groups in one `second`, within `reach` [m]."""
        rows, own = self.rows.select(self.coarse), group[self.rows.person[self.coarse]]
        moment = rows.day * self.days[1].max() + second
        found = [(np.empty(0, np.intp), np.empty(0, np.intp))]
        for one, other in find_neighbours(rows.x, rows.y, moment, reach):
            differ = own[one] != own[other]
            found.append((one[differ], other[differ]))
        one, other = map(np.concatenate, zip(*found, strict=True))
        return one, other

    def _along(
        self, one: np.ndarray, other: np.ndarray, steps: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Rows of two people `steps` [ticks] after rows `one` and `other`, and whether both are there."""
        known = np.ones((len(one), len(steps)), bool)
        places = []
        for row in (one, other):
            at = np.clip(row[:, None] + steps, 0, len(self.rows) - 1)
            known &= self.rows.piece[at] == self.rows.piece[row][:, None]
            known &= (
                self.rows.tick[at] - self.rows.tick[row][:, None] == steps
            ) & self.inside[at]
            places.append(at)
        return places[0], places[1], known

    def _approach(
        self, one: np.ndarray, other: np.ndarray, first: np.ndarray, of_pair: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Nearest approach of each pair [m], and its nearest pair of coarse rows."""
        rows, a, b = self.rows, self.coarse[one], self.coarse[other]
        relative = [v[b] - v[a] for v in (rows.x, rows.y, rows.vx, rows.vy)]
        dx, dy, vx, vy = relative
        time = -(dx * vx + dy * vy) / np.maximum(vx**2 + vy**2, 1e-9)
        time = np.clip(time, -0.5, 0.5)
        likely = np.hypot(dx + time * vx, dy + time * vy)
        likely += np.where(self.inside[a] & self.inside[b], 0.0, 2 * REACH)
        at = np.lexsort((likely, of_pair))[first]
        one_row, other_row, known = self._along(a[at], b[at], _AROUND)
        distance = np.hypot(
            rows.x[one_row] - rows.x[other_row], rows.y[one_row] - rows.y[other_row]
        )
        return np.where(known, distance, np.inf).min(axis=1, initial=np.inf), at

    def _kinds(
        self, one: np.ndarray, other: np.ndarray, of_pair: np.ndarray, n: int
    ) -> np.ndarray:
        """Number of the kind of each pair, from its coarse rows."""
        rows, a, b = self.rows, self.coarse[one], self.coarse[other]
        codes = classify_motion(rows, a, b, of_pair, n)
        start = np.flatnonzero(np.diff(of_pair, prepend=-1))
        p, q = rows.person[a[start]], rows.person[b[start]]
        same_stream = (self.stream[p] == self.stream[q]) & (codes != _STANDING)
        rules = [self.unit[p] == self.unit[q], same_stream]
        names = [KINDS.index(kind) for kind in (COMPANIONS, SAME)]
        return np.select(rules, names, codes).astype(np.int8)

    def _third_people(
        self, one: np.ndarray, other: np.ndarray, at: np.ndarray, r_max: float
    ) -> np.ndarray:
        """Number of other people within `r_max` [m] of one of the two where they are nearest."""
        x, y = self.rows.x[self.coarse], self.rows.y[self.coarse]
        near = np.hypot(x[one] - x[other], y[one] - y[other]) < r_max
        around = np.bincount(np.r_[one[near], other[near]], minlength=len(self.coarse))
        most = np.maximum(around[one[at]], around[other[at]])
        return np.asarray(np.maximum(most - 1, 0))


def name_kinds(codes: np.ndarray) -> pd.Categorical:
    """The kinds with the numbers `codes`."""
    return pd.Categorical(np.array(KINDS)[codes], categories=list(KINDS))
