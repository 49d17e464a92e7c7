"""The zones of chapters 07 to 13: those of the data, or the plaza's where the scenes have no room for them."""

from __future__ import annotations

from functools import cache

import numpy as np

import szlib
from szlib.plaza.settings import PlazaSettings
from szlib.workbook.record import NotebookRecord

WIDEST, LONGEST = 1.15, 1.6
"""How far a zone may reach to a side, and ahead or behind: a corridor of 4.6 m leaves 5 cm beside it [m]."""


@cache
def choose_zone(record: NotebookRecord) -> szlib.Ellipse:
    """The zone that the robot of a chapter keeps out of."""
    return fit_to_scenes(record, record.cache.ellipse(), "The zone of this data")


@cache
def choose_paper_zone(record: NotebookRecord) -> szlib.Ellipse:
    """The zone by the paper's method, for the paper's chain."""
    speed, r_max = record.cache.method.zone_speed, record.cache.method.r_max
    options = {"method": "paper", "r_max": r_max, "speeds": [speed], "n_resamples": 0}
    zone = szlib.SocialZone.fit(record.cache.encounters(), **options)
    return fit_to_scenes(record, zone.ellipse(speed), "The paper's zone of this data")


def fit_to_scenes(record: NotebookRecord, zone: szlib.Ellipse, name: str) -> szlib.Ellipse:
    """The `zone`, or the plaza's true one and a sentence that says why."""
    ahead, aside = np.abs(zone.curve()).max(axis=0)
    if record.cache.is_synthetic or (ahead <= LONGEST and aside <= WIDEST):
        return zone
    print(
        f"{name} reaches {ahead:.2f} m ahead or behind and {aside:.2f} m to a side. The scenes of this chapter have room for "
        f"{LONGEST:g} m and {WIDEST:g} m: they take the plaza's zone."
    )
    return PlazaSettings().true_zone(record.cache.method.zone_speed)
