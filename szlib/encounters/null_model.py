"""The null model: encounters, or pairs, of people who do not interact.

Where people are rarely near each other, is that respect, or is the place merely empty?  `time_shifted` moves
people in time.  Every path and speed stays, and so does the density of the crowd over the day.  Interaction
is removed: people meet by chance only.  `null_encounters` finds the encounters of many such days, to compare
with those of the data, and `null_pairs` the pairs.

A group keeps together for other reasons than respect, so nobody is moved alone.  For encounters, units are
moved: a person, or companions (`szlib.encounters.pairs`).  For pairs, whole streams are.

The recording is closed to a circle of whole seconds, a second or two longer than the recording: a person who
is moved past its end appears at its beginning.  So every moment remains equally likely.  (Reversing the sign
of such a shift instead would thin out the first and the last minutes.)  A person who walks across the seam
of the circle has two pieces of track from there on.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pandas as pd
from tqdm import tqdm

from ..core.checks import require
from ..core.errors import DataError
from ..tracks import funnels
from ..tracks.clock import TICKS_PER_SECOND, compute_velocities
from .finding import find_encounters, find_place
from .kinds import find_units, name_kinds, of_kind
from .occupants import TrackRows, firsts
from .pairs import CLOSE, COMPARED, SECTORS, Crowd
from .sensor import SensorCheck
from .settings import EncounterSettings

MINUTES = (1.0, 10.0)
"""Shortest and longest shift [min]: longer than a meeting, shorter than the day's ups and downs (assumed)."""
SHORTEST = 10.0
"""Least shift [s]: longer than two people see each other (assumed)."""

_STORED = 12_000  # pairs whose samples are stored, over all shifts; rounded up in each


def time_shifted(
    tracks: pd.DataFrame,
    *,
    seed: int | Sequence[int] = 0,
    minutes: tuple[float, float] = MINUTES,
) -> pd.DataFrame:
    """Move people in time, companions together: paths and density stay, interaction is removed.

    Parameters
    ----------
    tracks : a track table as from `szlib.read_tracks` (any row order, left untouched).
    seed : of the random shifts.
    minutes : shortest and longest shift [min], forward or backward; every second in between is equally
        likely.  In a recording shorter than their sum both are shorter in proportion.

    Returns
    -------
    A track table, sorted by day, id, t.  Each unit is moved around the circle of its day's recording
    (`szlib.encounters.null_model`).

    Raises
    ------
    DataError : as `szlib.find_encounters`; or `minutes` has no meaning, or a recording is too short for a
        shift of 10 s.

    Examples
    --------
    >>> import numpy as np, pandas as pd, szlib
    >>> t = np.arange(0, 600, 0.1).round(1)
    >>> walk = pd.DataFrame({"day": "a", "id": 1, "t": t, "x": 0.1 * t, "y": 0.0, "vx": 0.1, "vy": 0.0})
    >>> moved = szlib.time_shifted(walk, seed=1)
    >>> sorted(moved["x"]) == sorted(walk["x"])
    True
    """
    rows = TrackRows.from_tracks(tracks)
    leader, seconds = _find_leaders(rows)
    shift = _draw(seconds, minutes, np.random.default_rng(seed))
    return _move(tracks, rows, shift[leader], rows.recorded)


def _find_leaders(rows: TrackRows) -> tuple[np.ndarray, np.ndarray]:
    """Of each person: the first person of the unit, and the length of the day [s]."""
    unit = find_units(rows, np.flatnonzero(rows.tick % TICKS_PER_SECOND == 0))
    leader = np.unique(unit, return_index=True)[1][unit]
    return leader, rows.recorded[1][rows.day[firsts(rows.person)]]


def _draw(
    seconds: np.ndarray, minutes: tuple[float, float], rng: np.random.Generator
) -> np.ndarray:
    """Draw shifts [s] of `minutes` (shortest, longest) either way, in recordings of so many `seconds`."""
    low, high = (60 * float(each) for each in minutes)
    require(
        0 < low <= high < np.inf,
        "minutes",
        minutes,
        "(shortest, longest), both positive",
    )
    share = np.minimum(seconds / (low + high), 1)
    if low * share.min() < SHORTEST:
        raise DataError(
            f"a day was recorded for {seconds.min() / 60:.1f} min, too short for a null model, which "
            f"moves people by {SHORTEST:g} s and more; leave out recordings shorter than 2 min"
        )
    size = rng.uniform(low, high, len(share)) * share
    return np.asarray(np.rint(size * rng.choice([-1, 1], len(share))), np.int64)


def _move(
    tracks: pd.DataFrame,
    rows: TrackRows,
    shift: np.ndarray,
    recorded: tuple[np.ndarray, np.ndarray],
) -> pd.DataFrame:
    """The `rows` of `tracks`, each person moved by `shift` [s] around the circle of the day `recorded`."""
    first, period = (TICKS_PER_SECOND * each[rows.day] for each in recorded)
    moved = rows.tick - first + TICKS_PER_SECOND * shift[rows.person]
    tick = first + moved % period
    order = np.lexsort((tick, rows.person))
    table = tracks.iloc[rows.order[order]].reset_index(drop=True)
    table["t"] = tick[order] / TICKS_PER_SECOND
    # Somebody who walks across the seam has two pieces of track, with velocities of their own.
    table[["vx", "vy"]] = compute_velocities(table)
    never = {"of people who are never in the area": len(tracks) - len(table)}
    stage = funnels.stage("time shifted: ticks", len(tracks), len(table), never)
    return funnels.attach(table, [*funnels.get(tracks), stage])


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
    >>> sorted(null.encounters["shift"].unique().tolist())
    [0, 1]
    """

    samples: pd.DataFrame
    encounters: pd.DataFrame
    shifts: int
    r_max: float
    parameters: dict[str, Any] = field(default_factory=dict)
    sensor: SensorCheck | None = None

    def of_kind(self, kinds: str | Collection[str] | None) -> NullEncounters:
        """The encounters of some `kinds`, as `szlib.of_kind`: treat data and null model alike."""
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
    minutes: tuple[float, float] = MINUTES,
    r_max: float = CLOSE,
    settings: EncounterSettings | None = None,
    kinds: str | Collection[str] | None = None,
    progress: bool = True,
    **parameters: Any,
) -> NullEncounters:
    """Find the encounters of people who do not interact: those of many `time_shifted` days.

    Shift k has the encounters of ``find_encounters(time_shifted(tracks, seed=(seed, k)))``.

    Parameters
    ----------
    tracks : a track table as from `szlib.read_tracks`.
    shifts : number of null models, each with a seed of its own.
    seed, minutes : as in `time_shifted`.
    r_max : samples farther away are counted, not stored [m].
    settings, kinds, parameters : as in `szlib.find_encounters`, and the same as for the data.
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
    ['encounter', 'kind', 'nearest', 'shift']
    """
    settings = (settings or EncounterSettings()).with_parameters(parameters)
    tracks, area = find_place(tracks, settings)
    settings = replace(settings, area=area)
    rows = TrackRows.from_tracks(tracks)
    crowd = Crowd.from_tracks(tracks, area)
    leader, seconds = _find_leaders(rows)
    # Encounters depend on nobody who is never in the area.
    visitors = rows.select(np.isin(rows.person, rows.person[rows.within(area)]))

    def find(shift: int) -> tuple[pd.DataFrame, pd.DataFrame]:
        """Samples and encounters of a `shift`."""
        drawn = _draw(seconds, minutes, np.random.default_rng((seed, shift)))
        samples = find_encounters(
            _move(tracks, visitors, drawn[leader], rows.recorded), settings=settings
        )
        nearest = samples.groupby("encounter", sort=False).agg(
            kind=("kind", "first"), nearest=("distance", "min")
        )
        is_near = samples["distance"] <= r_max
        close = funnels.select(
            samples, is_near, "samples: close", f"farther than {r_max} m"
        )
        return close, nearest.reset_index()

    parameters = {"moved": "units", "seed": seed, "minutes": list(minutes)}
    parameters |= settings.as_json()
    return _search(find, shifts, r_max, parameters, crowd.sensor, progress).of_kind(
        kinds
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
    `szlib.NullEncounters` with the nearest approach of all pairs of the kinds compared, the samples of
    about 12,000 of them, drawn evenly from the shifts, and what the data says about the sensor (`sensor`).

    Raises
    ------
    DataError : as `find_pairs`; or there is no shift, or a recording is too short.

    Examples
    --------
    >>> import szlib
    >>> plaza = szlib.make_plaza("plaza.csv", settings=szlib.PlazaSettings(n_encounters=100))
    >>> null = szlib.null_pairs(szlib.read_tracks(plaza), shifts=2, progress=False)
    >>> null.shifts, list(null.encounters.columns)
    (2, ['encounter', 'kind', 'nearest', 'shift'])
    """
    tracks, place = find_place(tracks, EncounterSettings(area=area))
    crowd = Crowd.from_tracks(tracks, place)
    rng = np.random.default_rng(seed)
    seconds = np.repeat(crowd.rows.recorded[1], SECTORS)

    def find(shift: int) -> tuple[pd.DataFrame, pd.DataFrame]:
        """Samples and pairs of a `shift`."""
        met = crowd.meet(r_max, _draw(seconds, minutes, rng))
        kind = name_kinds(met.kind)
        counted = np.flatnonzero(kind.isin(COMPARED))
        size = min(len(counted), -(-_STORED // shifts))
        stored = rng.choice(counted, size, replace=False)
        every = pd.DataFrame({"encounter": counted, "kind": kind[counted]})
        every["nearest"] = met.nearest[counted]
        return crowd.sample(tracks, met, stored, r_max), every

    parameters = {
        "moved": "streams",
        "seed": seed,
        "minutes": list(minutes),
        "kinds": list(COMPARED),
        "area": str(place),
    }
    return _search(find, shifts, r_max, parameters, crowd.sensor, progress)


def _search(
    find: Callable[[int], tuple[pd.DataFrame, pd.DataFrame]],
    shifts: int,
    r_max: float,
    parameters: dict[str, Any],
    sensor: SensorCheck,
    progress: bool,
) -> NullEncounters:
    """The encounters of so many `shifts`, numbered consecutively; their funnels are added up.

    `find` gives the samples of a shift, and a row for each of its encounters.
    """
    require(shifts >= 1, "shifts", shifts, "at least 1")
    require(0 < r_max < np.inf, "r_max", r_max, "a positive distance in metres")
    offset = 0
    found = []
    for shift in tqdm(range(shifts), unit="shift", disable=not progress or None):
        samples, encounters = (
            each.assign(shift=shift, encounter=each["encounter"] + offset)
            for each in find(shift)
        )
        found.append((samples, encounters))
        offset = encounters["encounter"].to_numpy().max(initial=offset - 1) + 1
    all_samples, all_encounters = zip(*found, strict=True)
    return NullEncounters(
        funnels.attach(
            pd.concat(all_samples, ignore_index=True),
            funnels.add(map(funnels.get, all_samples)),
        ),
        pd.concat(all_encounters, ignore_index=True),
        shifts,
        float(r_max),
        {"shifts": shifts, **parameters},
        sensor,
    )
