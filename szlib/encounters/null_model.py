"""The null model: encounters, or pairs, of people who do not interact.

Where people are rarely near each other, is that respect, or is the place merely empty?  `null_encounters`
finds the encounters of many `time_shifted` days, to compare with those of the data. `null_pairs` does so for
every pair of people; there streams are moved as a whole.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import joblib
import numpy as np
import pandas as pd
from tqdm import tqdm

from ..core.checks import require
from ..core.parallel import run_tasks
from ..tracks import funnels
from .finding import find_encounters, find_place
from .kinds import KINDS, of_kind
from .pairs import CLOSE, COMPARED, Crowd, name_kinds
from .samples import sample_rows
from .sensors import SensorCheck
from .settings import EncounterSettings
from .time_shift import MINUTES, ShiftableTracks

_TASK_SHIFTS = 5  # shifts of one task
_STORED = 12_000  # pairs whose samples are stored, over all shifts


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
    first, samples, encounters = 0, [], []
    codes = [KINDS.index(kind) for kind in COMPARED]
    for shift in tqdm(range(shifts), unit="shift", disable=None if progress else True):
        met = crowd.meet(crowd.draw(rng, minutes), r_max, shifted=True)
        counted = np.flatnonzero(np.isin(met.kind, codes))
        stored = counted
        if len(counted) > quota:
            stored = np.sort(rng.choice(counted, quota, replace=False))
        one, other, pair = crowd.sample(met, stored, r_max)
        close = sample_rows(tracks, crowd.order[one], crowd.order[other])
        close.insert(0, "encounter", pair + first)
        kind = name_kinds(met.kind)
        samples.append(close.assign(kind=kind[pair], shift=shift))
        table = {"encounter": counted + first, "shift": shift, "kind": kind[counted]}
        encounters.append(pd.DataFrame(table | {"nearest": met.nearest[counted]}))
        first += len(met.pair)
    parameters: dict[str, Any] = {"moved": "streams", "shifts": shifts, "seed": seed}
    parameters |= {
        "minutes": list(minutes),
        "kinds": list(COMPARED),
        "area": str(place),
    }
    parameters |= {"units": crowd.unit_sizes, "streams": len(crowd.streams)}
    return NullEncounters(
        pd.concat(samples, ignore_index=True), pd.concat(encounters, ignore_index=True), shifts, float(r_max),
        parameters, crowd.sensor,
    )  # fmt: skip


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
