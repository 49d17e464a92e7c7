"""How near to the truth: whom a rule for outliers found, and how far a zone is off."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ..checks import check_columns
from ..errors import DataError
from ..zones.social_zone import SocialZone
from .generation import FIRST_ID, ID_STEP, stage_encounters
from .settings import PlazaSettings

SPEEDS = (0.7, 0.9, 1.1, 1.3)
"""Speeds at which a zone is compared with the truth [m/s]: well inside the plaza's range."""


def true_kinds(
    samples: pd.DataFrame, *, seed: int = 0, settings: PlazaSettings | None = None
) -> NDArray[np.str_]:
    """What kind of encounter (one of `szlib.plaza.generation.KINDS`) each sample of a plaza comes from, (n,).

    `samples` are those of `szlib.find_encounters` on the plaza of this seed and these settings.
    Raises DataError where two people are no pair of that plaza.
    """
    check_columns(samples, ["ref_id", "other_id"])
    kinds = stage_encounters(seed=seed, settings=settings)["kind"].to_numpy(str)
    people = (samples[["ref_id", "other_id"]].to_numpy() - FIRST_ID) // ID_STEP
    pair = people.min(axis=1) // 2
    met = (people.sum(axis=1) == 4 * pair + 1) & (pair >= 0) & (pair < len(kinds))
    if not met.all():
        row = int(np.flatnonzero(~met)[0])
        two = samples[["ref_id", "other_id"]].iloc[row].tolist()
        raise DataError(
            f"row {samples.index[row]}: {two} are no pair of a plaza of {len(kinds)} encounters; "
            "pass the settings that it was made with"
        )
    return np.asarray(kinds[pair])


def precision_and_recall(removed: NDArray[np.bool_], intruders: NDArray[np.bool_]) -> tuple[float, float]:
    """Share of intruders among what was removed, and share removed of the intruders; nan: of nothing.

    Both arguments are booleans of shape (n,), for samples or for encounters.
    Raises DataError where their shapes differ.
    """
    removed, intruders = np.asarray(removed, bool), np.asarray(intruders, bool)
    if removed.shape != intruders.shape:
        raise DataError(f"expected two arrays of one shape; got {removed.shape} and {intruders.shape}")
    found = int((removed & intruders).sum())
    precision, recall = (found / n if n else np.nan for n in (int(removed.sum()), int(intruders.sum())))
    return precision, recall


def largest_error(
    zone: SocialZone, settings: PlazaSettings | None = None, *, speeds: Iterable[float] = SPEEDS
) -> float:
    """Largest error of centre and both semi-axes over the speeds, against the plaza's true zone [m].

    Raises ZoneError where the zone is undefined at one of the speeds.
    """
    off = []
    for speed in speeds:
        found, true = zone.ellipse(speed), (settings or PlazaSettings()).true_zone(speed)
        off += [*np.subtract(found.center, true.center), *np.subtract(found.semi_axes, true.semi_axes)]
    return float(np.abs(off).max())
