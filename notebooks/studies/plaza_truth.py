"""The truth of the plaza: the kind of each sample, and the error of a zone."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from szlib.core.checks import check_columns, check_rows
from szlib.plaza import PlazaSettings, stage_encounters
from szlib.plaza.generation import FIRST_ID, ID_STEP
from szlib.zones.social_zone import SocialZone

SPEEDS = (0.7, 0.9, 1.1, 1.3)
"""Speeds at which a zone is compared with the true zone [m/s], well inside the plaza's range."""


def true_kinds(
    samples: pd.DataFrame, *, seed: int = 0, settings: PlazaSettings | None = None
) -> NDArray[np.str_]:
    """Find the true kind of encounter of each sample of a plaza.

    Parameters
    ----------
    samples : as from `szlib.find_encounters` on the plaza.
    seed, settings : of the plaza.

    Returns
    -------
    One of `szlib.plaza.generation.KINDS` for each sample, shape (n,).

    Raises
    ------
    DataError : two people are not a pair of the plaza.

    Examples
    --------
    >>> import szlib
    >>> from studies.plaza_truth import true_kinds
    >>> settings = szlib.PlazaSettings(n_encounters=40)
    >>> samples = szlib.find_encounters(szlib.read_tracks(szlib.make_plaza("plaza.csv", settings=settings)))
    >>> len(true_kinds(samples, settings=settings)) == len(samples)
    True
    """
    check_columns(samples, ["ref_id", "other_id"])
    kinds = stage_encounters(seed=seed, settings=settings)["kind"].to_numpy(str)
    people = (samples[["ref_id", "other_id"]].to_numpy() - FIRST_ID) // ID_STEP
    pair = people.min(axis=1) // 2
    is_pair = (people.sum(axis=1) == 4 * pair + 1) & (pair >= 0) & (pair < len(kinds))
    expected = f"they are no pair of a plaza of {len(kinds)} encounters; pass the settings of the plaza"
    check_rows(samples, is_pair, ["ref_id", "other_id"], expected)
    return np.asarray(kinds[pair])


def largest_error(
    zone: SocialZone,
    settings: PlazaSettings | None = None,
    *,
    speeds: Iterable[float] = SPEEDS,
) -> float:
    """Compute the largest error of centre and semi-axes over some speeds [m].

    Parameters
    ----------
    zone : the zone to judge.
    settings : of the plaza; None: the defaults.
    speeds : at which the zone is compared with the true zone [m/s].

    Raises
    ------
    ZoneError : the zone is undefined at one of the speeds.

    Examples
    --------
    >>> import szlib
    >>> from studies.plaza_truth import largest_error
    >>> path = szlib.make_plaza("plaza.csv", settings=szlib.PlazaSettings(n_encounters=300))
    >>> samples = szlib.find_encounters(szlib.read_tracks(path))
    >>> zone = szlib.SocialZone.fit(samples, speeds=[1.1], n_resamples=0)
    >>> largest_error(zone, speeds=[1.1]) < 0.2
    True
    """
    errors = []
    for speed in speeds:
        fitted = zone.ellipse(speed)
        true = (settings or PlazaSettings()).true_zone(speed)
        errors += [
            *np.subtract(fitted.center, true.center),
            *np.subtract(fitted.semi_axes, true.semi_axes),
        ]
    return float(np.abs(errors).max())
