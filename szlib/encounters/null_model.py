"""The null model: encounters, or pairs, of people who do not interact.

Where people are rarely near each other, is that respect, or is the place merely empty?  `null_encounters`
finds the encounters of many `time_shifted` days, to compare with those of the data. `null_pairs` does so for
every pair of people; there streams are moved as a whole.

`time_shifted` moves each person in time by an amount of their own.  Every path and speed stays, and so does
the density of the crowd over the day.  Interaction is removed: people meet by chance only.

The recording is closed to a circle: a person who is moved past its end appears at its beginning.  So nobody
leaves the recorded hours, and every moment remains equally likely.  (Reversing the sign of such a shift
instead would thin out the first and the last minutes.)  One empty tick is the seam of the circle: a person
who walks across it loses that tick, and has two pieces of track from there on.

*Companions are separated*: two people who were within 2 m of each other for 5 s or more, counted in whole
seconds, get shifts that differ by 10 s or more, some 10 m of walking.  (By chance 2 % of them would not.)
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import joblib
import numpy as np
import pandas as pd
from tqdm import tqdm

from ..core.checks import require
from ..core.errors import DataError
from ..core.parallel import run_tasks
from ..tracks import funnels
from ..tracks.clock import TICKS_PER_SECOND, VELOCITY_SPAN, compute_velocities
from .finding import find_encounters, find_place
from .geometry import Area
from .kinds import KINDS, REACH, TOGETHER, find_near_pairs, of_kind
from .occupants import TrackRows
from .pairs import CLOSE, COMPARED, Crowd, name_kinds
from .samples import sample_rows
from .sensor import SensorCheck
from .settings import EncounterSettings

# Shortest and longest shift [min]: longer than a meeting, shorter than the day's ups and downs (assumed).  A
# recording shorter than their sum has both in proportion: 0.55 and 5.5 min in 6 min.
MINUTES = (1.0, 10.0)
# Smallest difference between the shifts of companions [s] (assumed: some 10 m of walking).
COMPANION_SEPARATION = 10.0

_MINUTE = 60 * TICKS_PER_SECOND
_TASK_SHIFTS = 5  # shifts of one task
_STORED = 12_000  # pairs whose samples are stored, over all shifts
_ATTEMPTS = 1000  # number of times that shifts of companions are drawn again where they are too similar


def time_shifted(
    tracks: pd.DataFrame,
    *,
    seed: int | Sequence[int] = 0,
    minutes: tuple[float, float] | None = None,
) -> pd.DataFrame:
    """Move each person in time by an amount of their own: paths and density stay, interaction is removed.

    Parameters
    ----------
    tracks : a track table as from `szlib.read_tracks` (any row order, left untouched).
    seed : of the random shifts.
    minutes : shortest and longest shift [min], forward or backward; every tick in between is equally likely.
        None takes 1 and 10 min, and in a recording shorter than 11 min both in proportion.

    Returns
    -------
    A track table, sorted by day, id, t.  Each person is moved around the circle of their day's recording
    (`szlib.encounters.null_model`).  The funnel counts the ticks that fall on the seam.

    Raises
    ------
    DataError : as `szlib.find_encounters`; or `minutes` has no meaning, is too long for a recording, or too
        narrow to separate companions; or a recording is shorter than 1.8 min and `minutes` is None.

    Examples
    --------
    >>> import numpy as np, pandas as pd, szlib
    >>> t = np.arange(0, 600, 0.1).round(1)
    >>> walk = pd.DataFrame({"day": "a", "id": 1, "t": t, "x": 0.1 * t, "y": 0.0, "vx": 0.1, "vy": 0.0})
    >>> moved = szlib.time_shifted(walk, seed=1)
    >>> len(walk) - len(moved) <= 1
    True
    """
    shiftable = ShiftableTracks.from_tracks(tracks)
    return shiftable.shift(shiftable.draw_shifts(seed, minutes))


@dataclass(frozen=True, eq=False)
class ShiftableTracks:
    """Tracks of people who can be moved in time.

    Attributes
    ----------
    table : track table, sorted by person and time.
    person, tick : number of the person and tick of the clock, of each row.
    day : number of each person's day.
    first, period : of each day: first tick, and ticks of the circle (those recorded, and the seam).
    companions : pairs of people to be separated, shape (n, 2).
    """

    table: pd.DataFrame
    person: np.ndarray
    tick: np.ndarray
    day: np.ndarray
    first: np.ndarray
    period: np.ndarray
    companions: np.ndarray

    @classmethod
    def from_tracks(cls, tracks: pd.DataFrame) -> ShiftableTracks:
        """Prepare the people of a track table `tracks`."""
        rows = TrackRows.from_tracks(tracks)
        day_starts = np.flatnonzero(np.diff(rows.day, prepend=-1))
        first = np.minimum.reduceat(rows.tick, day_starts)
        period = np.maximum.reduceat(rows.tick, day_starts) - first + 2
        table = tracks.iloc[rows.order].reset_index(drop=True)
        day = rows.day[np.diff(rows.person, prepend=-1) > 0]
        whole = rows.tick % TICKS_PER_SECOND == 0
        companions = find_near_pairs(rows, whole, TOGETHER)
        return cls(table, rows.person, rows.tick, day, first, period, companions)

    def near(self, area: Area, duration: float) -> ShiftableTracks:
        """The rows that encounters in the `area`, in windows of `duration` [s], can depend on."""
        x, y = self.table["x"].to_numpy(), self.table["y"].to_numpy()
        near = _is_near(x, y, self.person, area, duration)
        stage = funnels.stage(
            "near the area", len(near), near.sum(), {"elsewhere": (~near).sum()}
        )
        table = funnels.attach(self.table[near].reset_index(drop=True), [stage])
        return replace(
            self, table=table, person=self.person[near], tick=self.tick[near]
        )

    def minutes_by_day(self, minutes: tuple[float, float] | None) -> np.ndarray:
        """Shortest and longest shift of each day [min], (n, 2); `minutes` and errors as in `time_shifted`."""
        low, high = (float(m) for m in minutes or MINUTES)
        is_range = 1 / _MINUTE <= low <= high < np.inf
        require(is_range, "minutes", minutes, "(shortest, longest), both positive")
        recorded = (self.period - 1) / _MINUTE
        share, lasts = np.minimum(recorded / (low + high), 1), float(recorded.min())
        if minutes is not None and lasts < low + high:
            raise DataError(
                f"a day was recorded for {lasts:.1f} min, too short for shifts of up to {high:g} min: "
                f"around its circle they come back to less than {low:g} min; leave minutes out"
            )
        if minutes is None and low * share.min() < COMPANION_SEPARATION / 60:
            raise DataError(
                f"a day was recorded for {lasts:.1f} min, too short for a null model, which moves people by "
                f"{COMPANION_SEPARATION:g} s and more; leave out recordings shorter than 2 min"
            )
        return np.outer(share, (low, high))

    def draw_shifts(
        self, seed: int | Sequence[int], minutes: tuple[float, float] | None
    ) -> np.ndarray:
        """Draw a shift for each person [ticks]; companions are separated.

        `seed`, `minutes` and errors as in `time_shifted`.
        """
        by_day = self.minutes_by_day(minutes)
        low, high = minutes or MINUTES
        share = (by_day[:, 1] / high)[self.day]
        rng = np.random.default_rng(seed)

        def draw(people: np.ndarray) -> np.ndarray:
            """Shifts of `people`, earlier or later [ticks]."""
            ticks = rng.integers(
                round(low * _MINUTE), round(high * _MINUTE), len(people), endpoint=True
            )
            return np.asarray(
                np.rint(ticks * share[people]).astype(int)
                * rng.choice([-1, 1], len(people))
            )

        shift = draw(np.arange(len(self.day)))
        one, other = self.companions.T
        around = self.period[self.day[one]]
        for _ in range(_ATTEMPTS):
            difference = (shift[one] - shift[other]) % around
            similar = (
                np.minimum(difference, around - difference)
                < COMPANION_SEPARATION * TICKS_PER_SECOND
            )
            if not similar.any():
                return shift
            redrawn = np.unique(other[similar])
            shift[redrawn] = draw(redrawn)
        shortest, longest = by_day[:, 0].min(), by_day[:, 1].max()
        raise DataError(
            f"with shifts of {shortest:.2g} to {longest:.2g} min, {int(similar.sum())} pairs of companions "
            f"could not be separated by {COMPANION_SEPARATION:g} s; "
            + (
                "use a longer recording"
                if minutes is None
                else "leave minutes out, for a wider range"
            )
        )

    def shift(self, shift: np.ndarray) -> pd.DataFrame:
        """The track table with each person moved by `shift` [ticks] around the circle."""
        first, period = (
            each[self.day[self.person]] for each in (self.first, self.period)
        )
        turns, since = np.divmod(self.tick - first + shift[self.person], period)
        rows = np.flatnonzero(since < period - 1)
        order = rows[np.lexsort((since[rows], self.person[rows]))]
        table = self.table.iloc[order].reset_index(drop=True)
        table["t"] = (first + since)[order] / TICKS_PER_SECOND
        across = (self.person[1:] == self.person[:-1]) & (turns[1:] != turns[:-1])
        cut = np.isin(self.person[order], self.person[1:][across])
        if cut.any():  # within half a second of the seam the velocity is that of the end of a piece
            table.loc[cut, ["vx", "vy"]] = compute_velocities(table[cut])
        rejected = {"on the seam of the day": len(since) - len(rows)}
        stage = funnels.stage("time shifted: ticks", len(since), len(rows), rejected)
        return funnels.attach(table, [*funnels.get(self.table), stage])


def _is_near(
    x: np.ndarray, y: np.ndarray, person: np.ndarray, area: Area, duration: float
) -> np.ndarray:
    """Whether encounters in the `area` can depend on each row at `x`, `y` [m]; shape (n,).

    Rows are sorted by `person` (numbered from 0) and time.  Of each person who is in the area at all, these
    are the rows in the area grown by `REACH` (for kinds of encounter), half a second around them (for
    velocities), and the `duration` [s] after them (both people must be tracked).
    """
    visits = np.zeros(person.max(initial=-1) + 1, bool)
    visits[person[area.contains(x, y)]] = True
    inside = area.grown(REACH).contains(x, y) & visits[person]
    count, row = np.r_[0, np.cumsum(inside)], np.arange(len(inside))
    after = row + round(VELOCITY_SPAN * TICKS_PER_SECOND)
    before = row - round(max(duration, VELOCITY_SPAN) * TICKS_PER_SECOND)
    return np.asarray(
        count[np.minimum(after + 1, len(row))] > count[np.maximum(before, 0)]
    )


@dataclass(frozen=True, eq=False)
class NullEncounters:
    """Encounters of the null model, over many shifts; see `null_encounters` for an example.

    Attributes
    ----------
    samples : as from `szlib.find_encounters`, with a column shift (from 0); only those within `r_max`.  No
        two encounters of any two shifts share a number.  The funnel counts all shifts together.
    encounters : every encounter, one row each: shift, encounter, kind, nearest approach [m].
    shifts : number of null models.
    r_max : distance up to which samples are stored [m].
    parameters : parameters of `null_encounters` or `null_pairs` that made it (JSON values).
    sensor : what the ends of tracks say about the sensor; None: not looked at.

    Examples
    --------
    >>> import szlib
    >>> plaza = szlib.make_plaza("plaza.csv", settings=szlib.PlazaSettings(n_encounters=100))
    >>> tracks = szlib.read_tracks(plaza)
    >>> null = szlib.null_encounters(tracks, shifts=2, minutes=(0.2, 1), progress=False)
    >>> len(null.one(0)) + len(null.one(1)) == len(null.samples)
    True
    """

    samples: pd.DataFrame
    encounters: pd.DataFrame
    shifts: int
    r_max: float
    parameters: dict[str, Any] = field(default_factory=dict)
    sensor: SensorCheck | None = None

    def one(self, shift: int) -> pd.DataFrame:
        """The samples of one `shift` (its number), to be treated like those of the data."""
        require(
            0 <= shift < self.shifts, "shift", shift, f"from 0 to {self.shifts - 1}"
        )
        return self.samples[self.samples["shift"] == shift]

    def of_kind(self, kinds: str | Iterable[str] | None) -> NullEncounters:
        """The encounters of some `kinds`, as `szlib.of_kind`: treat data and null model alike."""
        kinds = kinds if kinds is None or isinstance(kinds, str) else list(kinds)
        return replace(
            self,
            samples=of_kind(self.samples, kinds),
            encounters=of_kind(self.encounters, kinds),
        )


def null_encounters(
    tracks: pd.DataFrame,
    *,
    shifts: int = 100,
    seed: int = 0,
    minutes: tuple[float, float] | None = None,
    r_max: float = CLOSE,
    settings: EncounterSettings | None = None,
    kinds: str | Iterable[str] | None = None,
    n_jobs: int = 1,
    progress: bool = True,
    **parameters: Any,
) -> NullEncounters:
    """Find the encounters of people who do not interact: those of many `time_shifted` days.

    Shift k has the encounters of ``find_encounters(time_shifted(tracks, seed=(seed, k)))``.  It is computed
    much faster, because only the rows near the area are moved.

    Parameters
    ----------
    tracks : a track table as from `szlib.read_tracks`.
    shifts : number of null models, each with a seed of its own.
    seed, minutes : as in `time_shifted`.
    r_max : samples farther away are counted, not stored [m].
    settings, kinds, parameters : as in `szlib.find_encounters`, and the same as for the data.
    n_jobs : number of processes; -1 takes all cores, or all workers of ``joblib.parallel_config("dask")``.
    progress : whether to show a bar over the shifts.

    Returns
    -------
    `NullEncounters`.

    Raises
    ------
    DataError : as `time_shifted` and `szlib.find_encounters`; or there is no shift, or no r_max.

    Examples
    --------
    >>> import szlib
    >>> plaza = szlib.make_plaza("plaza.csv", settings=szlib.PlazaSettings(n_encounters=100))
    >>> tracks = szlib.read_tracks(plaza)
    >>> null = szlib.null_encounters(tracks, shifts=2, minutes=(0.2, 1), progress=False)
    >>> list(null.encounters.columns)
    ['encounter', 'shift', 'kind', 'nearest']
    """
    require(shifts >= 1, "shifts", shifts, "at least 1")
    require(0 < r_max < np.inf, "r_max", r_max, "a positive distance in metres")
    settings = (settings or EncounterSettings()).with_parameters(parameters)
    tracks, area = find_place(tracks, settings)
    settings = replace(settings, area=area)
    kinds = kinds if kinds is None or isinstance(kinds, str) else list(kinds)
    sensor = Crowd.from_tracks(tracks, area).sensor
    everyone = ShiftableTracks.from_tracks(tracks)
    # an impossible shift raises its error here, not in a worker
    everyone.draw_shifts(seed, minutes)
    people = everyone.near(area, settings.duration)
    companions = len(everyone.companions)
    grouped = len(np.unique(everyone.companions)) / max(len(everyone.day), 1)
    del everyone  # from here on only the rows near the area are needed
    find = partial(_find_shifted, people, seed, minutes, r_max, settings, kinds)
    batches = [
        range(k, min(k + _TASK_SHIFTS, shifts)) for k in range(0, shifts, _TASK_SHIFTS)
    ]
    found: dict[int, tuple[pd.DataFrame, pd.DataFrame]] = {}
    with tqdm(total=shifts, unit="shift", disable=None if progress else True) as bar:
        for part in run_tasks(
            [joblib.delayed(find)(batch) for batch in batches], n_jobs=n_jobs
        ):
            found |= part
            bar.update(len(part))
    by_day = people.minutes_by_day(minutes)
    of_all = [float(by_day[:, 0].min()), float(by_day[:, 1].max())]
    made_by = {
        "shifts": shifts,
        "seed": seed,
        "minutes": of_all,
        "companions": companions,
        "grouped": grouped,
    }
    parameters = {**made_by, "kinds": kinds, **settings.as_json()}
    return NullEncounters(
        *_concatenate(found), shifts, float(r_max), parameters, sensor
    )


def null_pairs(
    tracks: pd.DataFrame,
    *,
    area: object = None,
    shifts: int = 99,
    seed: int = 0,
    minutes: tuple[float, float] = MINUTES,
    r_max: float = CLOSE,
    progress: bool = True,
) -> NullEncounters:
    """Find the pairs of people who do not interact: the same streams, each moved in time, many times.

    Parameters
    ----------
    tracks, area, r_max : as in `find_pairs`, and the same as for the data.
    shifts : number of null models.
    seed : of the random shifts.
    minutes : shortest and longest shift of a stream [min], forward or backward around the recording of a day;
        in proportion in a recording shorter than their sum.
    progress : whether to show a bar over the shifts.

    Returns
    -------
    `szlib.NullEncounters` with the nearest approach of all pairs of the kinds compared, the samples of at
    most 12,000 of them, drawn evenly from the shifts, and what the data says about the sensor (`sensor`).

    Raises
    ------
    DataError : as `find_pairs`; or there is no shift, or a recording is too short.

    Examples
    --------
    >>> import szlib
    >>> plaza = szlib.make_plaza("plaza.csv", settings=szlib.PlazaSettings(n_encounters=100))
    >>> null = szlib.null_pairs(szlib.read_tracks(plaza), shifts=2, progress=False)
    >>> null.shifts, list(null.encounters.columns)
    (2, ['encounter', 'shift', 'kind', 'nearest'])
    """
    require(shifts >= 1, "shifts", shifts, "at least 1")
    require(0 < r_max < np.inf, "r_max", r_max, "a positive distance in metres")
    tracks, place = find_place(tracks, EncounterSettings(area=area))
    crowd = Crowd.from_tracks(tracks, place)
    rng, quota = np.random.default_rng(seed), -(-_STORED // shifts)
    found: dict[int, tuple[pd.DataFrame, pd.DataFrame]] = {}
    codes = [KINDS.index(kind) for kind in COMPARED]
    for shift in tqdm(range(shifts), unit="shift", disable=None if progress else True):
        met = crowd.meet(crowd.draw(rng, minutes), r_max, shifted=True)
        counted = np.flatnonzero(np.isin(met.kind, codes))
        stored = counted
        if len(counted) > quota:
            stored = np.sort(rng.choice(counted, quota, replace=False))
        one, other, pair = crowd.sample(met, stored, r_max)
        close = sample_rows(tracks, crowd.order[one], crowd.order[other])
        close.insert(0, "encounter", pair)
        kind = name_kinds(met.kind)
        table = {"encounter": counted, "shift": shift, "kind": kind[counted]}
        every = pd.DataFrame(table | {"nearest": met.nearest[counted]})
        found[shift] = close.assign(kind=kind[pair], shift=shift), every
    parameters: dict[str, Any] = {"moved": "streams", "shifts": shifts, "seed": seed}
    parameters |= {
        "minutes": list(minutes),
        "kinds": list(COMPARED),
        "area": str(place),
    }
    parameters |= {"streams": len(crowd.streams)}
    return NullEncounters(
        *_concatenate(found), shifts, float(r_max), parameters, crowd.sensor
    )


def _find_shifted(
    people: ShiftableTracks,
    seed: int,
    minutes: tuple[float, float] | None,
    r_max: float,
    settings: EncounterSettings,
    kinds: str | Iterable[str] | None,
    batch: Iterable[int],
) -> dict[int, tuple[pd.DataFrame, pd.DataFrame]]:
    """For each shift of the batch: the samples within `r_max`, and one row for each encounter."""
    found = {}
    for k in batch:
        shifted = people.shift(people.draw_shifts((seed, k), minutes))
        samples = find_encounters(shifted, settings=settings, kinds=kinds).assign(
            shift=k
        )
        groups = samples.groupby("encounter", sort=False)
        encounters = groups.agg(
            shift=("shift", "first"),
            kind=("kind", "first"),
            nearest=("distance", "min"),
        )
        is_near = samples["distance"] <= r_max
        close = funnels.select(
            samples, is_near, "samples: close", f"farther than {r_max} m"
        )
        found[k] = close, encounters.reset_index()
    return found


def _concatenate(
    found: dict[int, tuple[pd.DataFrame, pd.DataFrame]],
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Samples and encounters of all shifts, numbered consecutively; their funnels are added up."""
    first, samples, encounters = 0, [], []
    for _, (close, every) in sorted(found.items()):
        samples.append(close.assign(encounter=close["encounter"] + first))
        encounters.append(every.assign(encounter=every["encounter"] + first))
        first += 1 + every["encounter"].to_numpy().max(initial=-1)
    stages = funnels.add([funnels.get(part) for part in samples])
    table = funnels.attach(pd.concat(samples, ignore_index=True), stages)
    return table, pd.concat(encounters, ignore_index=True)
