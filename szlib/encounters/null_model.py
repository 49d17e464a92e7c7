"""The null model: who meets whom where nobody minds anybody.

Where people are rarely near each other, is that respect, or is the place merely empty?  `null_encounters`
finds the encounters of many `time_shifted` days, to hold those of the data against.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass, field, is_dataclass, replace
from typing import Any

import joblib
import numpy as np
import pandas as pd
from tqdm import tqdm

from ..errors import DataError
from ..parallel import run_tasks
from ..tracks import funnels
from .areas import area_for
from .finding import find_encounters
from .geometry import ATC_SQUARE
from .kinds import of_kind
from .time_shift import MINUTES, Crowd

CLOSE = 2.0
"""Samples farther than that [m] bear on no zone (paper: r_max)."""

_AT_ONCE = 5  # shifts of one task


@dataclass(frozen=True, eq=False)
class NullEncounters:
    """Encounters of the null model, over many shifts.

    Parameters
    ----------
    samples : as from `szlib.find_encounters`, with a column shift (from 0); only those within `r_max`.  No
        two encounters of any two shifts share a number.  The funnel counts all shifts together.
    encounters : every encounter, one row each: shift, encounter, kind, nearest approach [m].
    shifts : number of null models.
    r_max : distance up to which samples were kept [m].
    parameters : that made it (JSON values).
    """

    samples: pd.DataFrame
    encounters: pd.DataFrame
    shifts: int
    r_max: float
    parameters: dict[str, Any] = field(default_factory=dict)

    def one(self, shift: int) -> pd.DataFrame:
        """The samples of one shift, to be treated like those of the data."""
        if not 0 <= shift < self.shifts:
            raise DataError(f"expected a shift from 0 to {self.shifts - 1}; got {shift}")
        return self.samples[self.samples["shift"] == shift]

    def of_kind(self, kinds: str | Iterable[str] | None) -> NullEncounters:
        """The encounters of some kinds, as `szlib.of_kind`: treat data and null alike."""
        kinds = kinds if kinds is None or isinstance(kinds, str) else list(kinds)
        return replace(self, samples=of_kind(self.samples, kinds), encounters=of_kind(self.encounters, kinds))


def null_encounters(
    tracks: pd.DataFrame,
    *,
    shifts: int = 100,
    seed: int = 0,
    minutes: tuple[float, float] = MINUTES,
    r_max: float = CLOSE,
    square: object = ATC_SQUARE,
    duration: float = 3.0,
    n_jobs: int = 1,
    progress: bool = True,
    **parameters: Any,
) -> NullEncounters:
    """Who meets whom where nobody minds anybody: encounters of many `time_shifted` days.

    Shift k has the encounters of ``find_encounters(time_shifted(tracks, seed=(seed, k)))``, and far sooner:
    only what is near the square is moved.

    Parameters
    ----------
    tracks : a track table as from `szlib.read_tracks`.
    shifts : how many null models, each of its own seed.
    seed, minutes : as in `time_shifted`.
    r_max : samples farther than that are counted, not kept [m].
    square, duration, parameters : those of `szlib.find_encounters`, and the same as for the data.
    n_jobs : number of processes; -1: one for each core. See `szlib.parallel.run_tasks`.
    progress : whether to show a bar over the shifts.

    Raises
    ------
    DataError : as `time_shifted` and `szlib.find_encounters`; or there is no shift, or no r_max.
    """
    if not (shifts >= 1 and 0 < r_max < np.inf):
        raise DataError(f"expected shifts >= 1 and r_max > 0 m; got {shifts} shifts, {r_max} m")
    crowd = Crowd.of(tracks)
    crowd.shifts(seed, minutes)  # what cannot be shifted is told here, not by a worker
    area = area_for(tracks, square)
    near, companions = crowd.near(area, duration), len(crowd.companions)
    del crowd  # of a whole day only what is near the square is needed from here on
    asked = {"square": area, "duration": duration, **parameters}
    batches = [range(k, min(k + _AT_ONCE, shifts)) for k in range(0, shifts, _AT_ONCE)]
    tasks = [joblib.delayed(_shift_and_find)(near, seed, batch, minutes, r_max, asked) for batch in batches]
    found: dict[int, tuple[pd.DataFrame, pd.DataFrame]] = {}
    with tqdm(total=shifts, unit="shift", disable=not progress) as bar:
        for part in run_tasks(tasks, n_jobs=n_jobs):
            found |= part
            bar.update(len(part))
    made = {"shifts": shifts, "seed": seed, "minutes": list(minutes), "companions": companions}
    made |= {name: asdict(v) if is_dataclass(v) else v for name, v in asked.items()}  # type: ignore[arg-type]
    return NullEncounters(*_in_one(found), shifts, float(r_max), made)


def _shift_and_find(
    crowd: Crowd,
    seed: int,
    batch: Iterable[int],
    minutes: tuple[float, float],
    r_max: float,
    asked: dict[str, Any],
) -> dict[int, tuple[pd.DataFrame, pd.DataFrame]]:
    """By shift: samples within r_max, and one row for each encounter."""
    found = {}
    for k in batch:
        samples = find_encounters(crowd.moved(crowd.shifts((seed, k), minutes)), **asked).assign(shift=k)
        by = samples.groupby("encounter", sort=False)
        encounters = by.agg(shift=("shift", "first"), kind=("kind", "first"), nearest=("distance", "min"))
        close = samples[samples["distance"] <= r_max].copy()
        far = {f"farther than {r_max} m": len(samples) - len(close)}
        stage = funnels.stage("samples: close", len(samples), len(close), far)
        found[k] = funnels.attach(close, [*funnels.get(samples), stage]), encounters.reset_index()
    return found


def _in_one(found: dict[int, tuple[pd.DataFrame, pd.DataFrame]]) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Samples and encounters of all shifts, numbered one after the other; their funnels are added up."""
    parts = [found[k] for k in sorted(found)]
    first = np.cumsum(
        [0, *(1 + encounters["encounter"].to_numpy().max(initial=-1) for _, encounters in parts)]
    )
    tables = [
        pd.concat([t.assign(encounter=t["encounter"] + n) for t, n in zip(side, first, strict=False)])
        for side in zip(*parts, strict=True)
    ]
    samples, encounters = (table.reset_index(drop=True) for table in tables)
    return funnels.attach(samples, funnels.add([funnels.get(part) for part, _ in parts])), encounters
