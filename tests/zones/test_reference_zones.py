"""The zones that szlib ships are plausible, agree with each other, and say where they are from."""

import json

import numpy as np
import pytest

import szlib
from szlib.zones.reference_zones import FILE

ENTRIES = json.loads(FILE.read_text(encoding="utf-8"))


@pytest.mark.parametrize("name", ENTRIES)
def test_each_zone_can_be_kept_by_a_robot_and_says_what_it_rests_on(name):
    zone = szlib.reference_zone(name)
    a, b = zone.ellipse.semi_axes
    assert 0.2 < b <= a < 2.0
    assert zone.ellipse.level(np.zeros(2)) < 1, "it contains the person"
    values = {
        "a": a,
        "b": b,
        "center_x": zone.ellipse.center[0],
        "radius": np.sqrt(a * b),
    }
    for quantity, (low, high) in zone.intervals.items():
        assert low - 1e-3 <= values[quantity] <= high + 1e-3, quantity
    assert zone.verdict in ("usable", "undecided")
    assert zone.verdict.reasons
    assert zone.source
    assert zone.cite
    step = szlib.MPCCBF(zone.ellipse).step((0.0, 0.0, 0.0, 0.0), (5.0, 0.0), [])
    assert step.safe


def test_an_unknown_name_is_refused_with_those_that_exist():
    with pytest.raises(
        szlib.ZoneError, match=r"name must be one of atc-strangers, .*; got 'atc'"
    ):
        szlib.reference_zone("atc")


def test_the_file_is_small():
    assert FILE.stat().st_size < 8_000
