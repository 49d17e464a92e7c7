"""The null model: encounters of people who do not interact.

Where people are rarely near each other, is that respect, or is the place merely empty?  `null_encounters`
finds the encounters of many `time_shifted` days, to compare with those of the data.
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
from .kinds import of_kind
from .sensors import SensorCheck
from .settings import EncounterSettings
from .time_shift import ShiftableTracks

CLOSE = 2.0  # samples farther away [m] do not belong to a zone (paper: r_max)

_TASK_SHIFTS = 5  # shifts of one task


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
    sensor : what the data says about the sensor; None: not looked at.

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
    return NullEncounters(*_concatenate(found), shifts, float(r_max), parameters)


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
