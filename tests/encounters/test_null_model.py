"""The null model: the encounters of time-shifted days equal those of a search of each whole day."""

import json

import numpy as np
import pandas as pd
import pytest
from benchmarks.truth import crowds
from helpers.track_tables import make_tracks, make_walk
from studies.noninteracting_crowd import noninteracting_crowd

import szlib
from szlib.core.errors import DataError
from szlib.tracks import funnels

ASKED = {"minutes": (1.0, 5.0), "min_distance": 0.5}


@pytest.fixture(scope="module")
def tracks():
    return noninteracting_crowd(seed=5, people=500, minutes=15)


@pytest.fixture(scope="module")
def null(tracks):
    return szlib.null_encounters(tracks, shifts=7, seed=4, progress=False, **ASKED)


@pytest.mark.slow
def test_each_shift_equals_encounters_of_the_shifted_day(tracks, null):
    for shift in (0, 3, 6):
        day = szlib.time_shifted(tracks, seed=(4, shift), minutes=ASKED["minutes"])
        whole = szlib.find_encounters(day, min_distance=0.5)
        own = null.encounters[null.encounters["shift"] == shift]
        nearest = whole.groupby("encounter")["distance"].min()
        np.testing.assert_array_equal(own["nearest"], nearest)
        np.testing.assert_array_equal(
            own["kind"], whole.groupby("encounter")["kind"].first()
        )
        expected = (
            whole[whole["distance"] <= null.r_max]
            .drop(columns="encounter")
            .reset_index(drop=True)
        )
        found = (
            null.samples[null.samples["shift"] == shift]
            .drop(columns=["encounter", "shift"])
            .reset_index(drop=True)
        )
        pd.testing.assert_frame_equal(found, expected)


def test_encounter_numbers_are_unique_and_the_funnel_adds_up(
    null,
):
    assert null.encounters["encounter"].is_unique
    assert (null.samples.groupby("encounter")["shift"].nunique() == 1).all()
    assert set(null.samples["encounter"]) <= set(null.encounters["encounter"])
    stages = funnels.get(null.samples)
    for before, after in zip(stages, stages[1:], strict=False):
        if "windows" not in before["stage"]:  # of a window, 31 samples
            assert before["kept"] == after["entered"]
    assert stages[-1]["kept"] == len(null.samples)
    json.dumps(null.parameters)


def test_first_shifts_do_not_depend_on_their_number(tracks, null):
    fewer = szlib.null_encounters(tracks, shifts=2, seed=4, progress=False, **ASKED)
    pd.testing.assert_frame_equal(
        fewer.encounters, null.encounters[null.encounters["shift"] < 2]
    )


def test_kinds_are_selected_as_in_the_data(null):
    some = null.of_kind(["opposite", "crossing"])
    assert (
        set(some.encounters["kind"])
        == set(some.samples["kind"])
        == {"opposite", "crossing"}
    )
    assert (
        len(some.encounters)
        == null.encounters["kind"].isin(["opposite", "crossing"]).sum()
    )
    assert null.of_kind(None).encounters is null.encounters
    with pytest.raises(DataError, match="unknown kinds"):
        null.of_kind("friends")


def test_null_model_without_encounters_is_empty():
    tracks = make_tracks(
        make_walk((-12, 0), (1, 0)), make_walk((-12, 0), (1, 0), person=2, begin=1800)
    )
    null = szlib.null_encounters(
        tracks, shifts=3, progress=False, square=szlib.ATC_SQUARE
    )
    assert len(null.samples) == len(null.encounters) == 0
    assert null.shifts == 3


def test_invalid_arguments_raise(tracks, null):
    with pytest.raises(DataError, match="shifts must be at least 1"):
        szlib.null_encounters(tracks, shifts=0)
    with pytest.raises(DataError, match=r"unknown parameter \['min_distanse'"):
        szlib.null_encounters(tracks, shifts=1, progress=False, min_distanse=1.0)


@pytest.mark.slow
def test_groups_do_not_look_like_respect():
    """Lone encounters of people of whom 70 % walk in groups abreast, and nobody reacts to anybody."""
    found = []
    for seed in range(2):
        rng = np.random.default_rng(seed)
        people = crowds.as_table(crowds.CROWDS["groups"](rng, 1500, 4500))
        place = {"area": crowds.AREA}
        tracks = crowds.read(people, rng)
        samples = szlib.of_kind(szlib.find_encounters(tracks, **place), "strangers")
        null = szlib.null_encounters(tracks, shifts=19, progress=False, **place)
        test = szlib.null_test(samples, null.of_kind("strangers"))
        assert test.n_encounters > 20
        found.append(test.p_value)
    assert min(found) > 0.05
