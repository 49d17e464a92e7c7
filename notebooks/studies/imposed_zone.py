"""A known zone on recorded paths: people who keep out of each other's zone, where nobody did.

The paths are those of a `time_shifted` crowd, in which people meet by chance. Each person carries the same
ellipse, turned with their motion. The pairs in which one person enters the other's ellipse are removed, but
for a share of careless pairs. So the paths, speeds and density are those of the site, and the zone is known:
an estimator must find it.

A person slower than `WALKING` has no direction of motion, and so no zone at that moment. The other person's
zone applies all the same.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from szlib.core.checks import Array, check_columns, require
from szlib.core.errors import ZoneError
from szlib.encounters.finding import find_encounters
from szlib.encounters.kinds import WALKING
from szlib.encounters.null_model import MINUTES, time_shifted
from szlib.encounters.occupants import SAMPLE_COLUMNS
from szlib.encounters.settings import EncounterSettings
from szlib.tracks import funnels
from szlib.zones.ellipses import Ellipse
from szlib.zones.outliers import pair_numbers


def impose_zone(
    tracks: pd.DataFrame,
    ellipse: Ellipse,
    *,
    careless: float = 0.0,
    seed: int | Sequence[int] = 0,
    minutes: tuple[float, float] = MINUTES,
    settings: EncounterSettings | None = None,
    kinds: str | Iterable[str] | None = None,
    **parameters: Any,
) -> pd.DataFrame:
    """Find the encounters of a time-shifted crowd in which people keep out of each other's zone.

    Parameters
    ----------
    tracks : a track table as from `szlib.read_tracks` (left untouched).
    ellipse : the zone of each person, in the person's frame: x along the motion, y to the left [m].
    careless : share of the pairs of people who ignore the zone, 0 to 1.
    seed : of the time shifts and of the careless pairs.
    minutes : as in `szlib.time_shifted`.
    settings, kinds, parameters : as in `szlib.find_encounters`.

    Returns
    -------
    Samples as from `szlib.find_encounters`. All encounters of a pair are removed if, at any sample of one of
    them, one person is inside the other's ellipse and the pair is not careless. The others keep their
    numbers. The funnel counts the encounters that are removed.

    Raises
    ------
    DataError : as `szlib.time_shifted` and `szlib.find_encounters`; or `careless` is no share.
    ZoneError : `ellipse` is not an `Ellipse`.

    Examples
    --------
    >>> import szlib
    >>> from studies.imposed_zone import impose_zone
    >>> plaza = szlib.make_plaza("plaza.csv", settings=szlib.PlazaSettings(n_encounters=200))
    >>> tracks, zone = szlib.read_tracks(plaza), szlib.Ellipse((0.1, 0.0), (1.0, 0.7))
    >>> samples = impose_zone(tracks, zone, minutes=(1, 3), min_distance=0.5)
    >>> bool(samples["distance"].min() > 0.6)
    True
    """
    shifted = time_shifted(tracks, seed=seed, minutes=minutes)
    samples = find_encounters(shifted, settings=settings, kinds=kinds, **parameters)
    return PairedSamples.from_samples(samples).impose(ellipse, careless=careless, seed=seed)


@dataclass(frozen=True, eq=False)
class PairedSamples:
    """Samples of encounters in the frames of both people: many zones can be imposed on them quickly.

    Attributes
    ----------
    samples : as from `szlib.find_encounters`, n rows.
    pair : number of the pair of people of each sample, shape (n,), the same whoever is the reference.
    points : position of the other person in the frame of the reference pedestrian, and of the reference
        pedestrian in the frame of the other, shape (2, n, 2) [m]; NaN where a person stands.
    """

    samples: pd.DataFrame
    pair: NDArray[np.intp]
    points: Array

    @classmethod
    def from_samples(cls, samples: pd.DataFrame) -> PairedSamples:
        """Prepare `samples` as from `szlib.find_encounters`; raises DataError if a column is missing."""
        if len(samples):
            check_columns(samples, SAMPLE_COLUMNS)
        views = [
            samples["distance"] * np.exp(1j * samples[angle].where(samples[speed] >= WALKING))
            for angle, speed in (
                ("los_angle", "speed"),
                ("other_los_angle", "other_speed"),
            )
        ]
        points = np.array([np.column_stack([np.real(view), np.imag(view)]) for view in views])
        return cls(samples, pair_numbers(samples), points)

    def pairs_inside(self, ellipse: Ellipse) -> NDArray[np.bool_]:
        """Whether, at any sample of each pair, one person is inside the other's `ellipse`; (pairs,)."""
        require(isinstance(ellipse, Ellipse), "ellipse", ellipse, "an Ellipse", ZoneError)
        inside = np.zeros(int(self.pair.max(initial=-1)) + 1, bool)
        inside[self.pair[(ellipse.level(self.points) < 1).any(axis=0)]] = True
        return inside

    def impose(
        self, ellipse: Ellipse, *, careless: float = 0.0, seed: int | Sequence[int] = 0
    ) -> pd.DataFrame:
        """The samples without the pairs that enter the zone; result and errors as in `impose_zone`.

        `careless` is the share of pairs that ignore the `ellipse`, drawn with `seed`: those of a smaller
        share are among those of a larger one.
        """
        require(0 <= careless <= 1, "careless", careless, "a share of pairs, 0 to 1")
        inside = self.pairs_inside(ellipse)
        # not the numbers of the time shifts
        rng = np.random.default_rng([*np.atleast_1d(seed), 1])
        removed = inside & (rng.random(len(inside)) >= careless)
        kept = self.samples[~removed[self.pair]].copy()
        before, after = (table["encounter"].nunique() for table in (self.samples, kept))
        reasons = {"one person enters the other's zone": before - after}
        stage = funnels.stage("encounters: zone imposed", before, after, reasons)
        return funnels.attach(kept, [*funnels.get(self.samples), stage])
