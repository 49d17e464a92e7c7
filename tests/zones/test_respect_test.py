"""Is it respect at all: valid p-values under the null, small ones with respect."""

import numpy as np
import pandas as pd
import pytest
from studies.noninteracting_crowd import noninteracting_crowd

import szlib
from szlib.core.errors import DataError, DataWarning, ZoneError
from szlib.zones import respect_test
from szlib.zones.respect_test import collect_approaches, fit_radius, null_test

KINDS = ("opposite", "crossing")
SHIFTS = 39


def encounters(seed, *shifts, n=40, away=0.0):
    """`n` single samples of each shift, their nearest approach even between `away` and 3 m."""
    draws = [
        np.random.default_rng([seed, k]).uniform([[-3], [away]], 3, (2, n))
        for k in shifts
    ]
    angle, distance = np.concatenate(draws, axis=1)
    shift = np.repeat(shifts, n)
    table = pd.DataFrame(
        {
            "encounter": 1000 * (shift + 1) + np.tile(np.arange(n), len(shifts)),
            "shift": shift,
        }
    )
    return table.assign(los_angle=angle, distance=distance, speed=1.0)


def null_of(seed, shifts=SHIFTS):
    rows = encounters(seed, *range(shifts))
    found = rows[["shift", "encounter"]].assign(nearest=rows["distance"])
    return szlib.NullEncounters(rows[rows["distance"] <= 2], found, shifts, 2.0)


def p_value(samples, null):
    """That of `null_test`, which also fits radii: most of its time."""
    return respect_test._compare(collect_approaches(samples, null), null.shifts)[0]


# --- under the null ------------------------------------------------------------------------------------


def test_p_values_are_uniform_under_the_null():
    p = np.array(
        [p_value(encounters(seed, SHIFTS), null_of(seed)) for seed in range(100)]
    )
    assert p[0] == null_test(encounters(0, SHIFTS), null_of(0)).p_value
    assert (p <= 0.05).mean() <= 0.05 + 2 * np.sqrt(0.05 * 0.95 / len(p))
    share = np.searchsorted(np.sort(p), [0.25, 0.5, 0.75], side="right") / len(p)
    assert share == pytest.approx([0.25, 0.5, 0.75], abs=0.1)


@pytest.mark.slow
def test_noninteracting_crowd_shows_no_respect():
    """notebooks/tables/06_nobody.csv has 100 seeds."""
    p = []
    for seed in range(6):
        tracks = noninteracting_crowd(seed=seed, people=600, minutes=40)
        null = szlib.null_encounters(tracks, shifts=19, seed=seed, progress=False)
        p.append(p_value(szlib.find_encounters(tracks), null))
    assert np.sum(np.array(p) <= 0.05) <= 1  # 2 and more of 6: 3 %
    assert np.median(p) > 0.15


def test_different_mix_of_kinds_is_no_respect():
    """In a bunch most walk the same way, and farther apart by condition 3; shifted, most of them cross."""

    def mixed(seed, shift, crossing):
        """Encounters of two kinds, a share of them crossing, which come nearer."""
        table = encounters(seed, shift)
        cross = (
            np.random.default_rng([seed, shift, 1]).uniform(size=len(table)) < crossing
        )
        table["kind"] = pd.Categorical(
            np.where(cross, "crossing", "same direction"),
            categories=["crossing", "same direction"],
        )
        return table.assign(
            distance=np.where(cross, table["distance"], 1 + table["distance"] / 2)
        )

    by_kind, in_one = [], []
    for seed in range(20):
        rows = pd.concat([mixed(seed, k, 0.8) for k in range(SHIFTS)])
        found = rows[["shift", "encounter", "kind"]].assign(nearest=rows["distance"])
        null = szlib.NullEncounters(rows[rows["distance"] <= 2], found, SHIFTS, 2.0)
        data = mixed(seed, SHIFTS, 0.2)
        by_kind.append(p_value(data, null))
        in_one.append(p_value(data.drop(columns="kind"), null))
    assert max(in_one) <= 0.05
    assert np.sum(np.array(by_kind) <= 0.05) <= 3  # 4 and more of 20: 2 %
    assert np.median(by_kind) > 0.3


def test_attraction_is_no_respect(tmp_path):
    """A plaza without clearance whose zones are tiny: everybody walks right at everybody.

    The radius is at most that of these zones.
    """
    tiny = szlib.Ellipse((0, 0), (0.15, 0.15))
    settings = szlib.PlazaSettings(
        n_encounters=250,
        clearance=0,
        slow_zone=tiny,
        fast_zone=tiny,
        intruders=0,
        together=0,
    )
    tracks = szlib.read_tracks(
        szlib.make_plaza(tmp_path / "plaza.csv", settings=settings)
    )
    null = szlib.null_encounters(tracks, shifts=39, minutes=(1, 6), progress=False)
    test = null_test(szlib.find_encounters(tracks), null)
    assert test.p_value > 0.5
    assert test.respect.radius <= 0.15
    assert not test.is_significant


# --- people mind -------------------------------------------------------------------------------------


def test_people_who_keep_away_show_respect():
    null = null_of(0)
    test = null_test(encounters(1, SHIFTS, away=0.5), null)
    assert test.p_value == 1 / (1 + SHIFTS)
    assert test.statistic > max(test.null_statistics)
    assert test.is_significant
    assert test.respect.radius == pytest.approx(0.5, abs=0.15)
    assert "people avoid each other (p = 0.025, 39 shifts" in str(test)


def test_the_radius_is_the_same_where_people_count_up_to_5_m():
    rng = np.random.default_rng(0)
    nearest = 5 * np.sqrt(rng.uniform(size=(10, 2000)))
    shift = np.arange(10).repeat(2000)
    approaches = pd.DataFrame({"nearest": nearest.ravel(), "shift": shift, "kind": 0})
    approaches = approaches[(approaches["nearest"] > 0.8) | (approaches["shift"] > 0)]
    near = approaches[approaches["nearest"] < 2]
    assert fit_radius(approaches, 5.0).radius == pytest.approx(
        fit_radius(near, 2.0).radius, abs=0.05
    )


def test_people_who_come_near_show_no_respect():
    near = encounters(1, SHIFTS)
    near["distance"] /= 3
    assert null_test(near, null_of(0)).p_value == 1


def test_excluded_encounters_do_not_count():
    """0.5 m that no two bodies can be within: no respect in that alone."""
    null = null_of(0)
    assert null_test(encounters(1, SHIFTS, n=200, away=0.5), null).is_significant
    assert not null_test(
        encounters(1, SHIFTS, n=200, away=0.5), null, excluded_below=0.55
    ).is_significant
    assert null_test(
        encounters(1, SHIFTS, n=200, away=1.0), null, excluded_below=0.55
    ).is_significant


@pytest.mark.slow
def test_real_day_shows_respect(real_tracks, real_samples):
    null = szlib.null_encounters(real_tracks, shifts=20, progress=False)
    for kinds in ("strangers", KINDS):
        data, model = szlib.of_kind(real_samples, kinds), null.of_kind(kinds)
        test = null_test(data, model, excluded_below=0.5)
        assert test.p_value == pytest.approx(1 / 21)
        assert 0.79 < test.respect.radius < 1.42  # 0.96 m (0.79-1.42) for strangers


# --- the object, and errors --------------------------------------------------------------------------


def test_kind_on_one_side_only_warns():
    null, data = null_of(0), encounters(1, SHIFTS, n=100)
    kind = np.where(np.arange(len(null.encounters)) % 2, "crossing", "opposite")
    null = szlib.NullEncounters(
        null.samples, null.encounters.assign(kind=kind), SHIFTS, 2.0
    )
    with pytest.warns(
        DataWarning, match="the data has no encounter of the kind 'opposite'"
    ):
        null_test(data.assign(kind="crossing"), null)
    mixed = np.where(
        data["encounter"] % 3 == 0, "standing", np.where(data["encounter"] % 2, *KINDS)
    )
    with pytest.warns(
        DataWarning, match="the null model has no encounter of the kind 'standing'"
    ):
        null_test(data.assign(kind=mixed), null)


def test_null_test_without_encounters_is_refused():
    data, null = encounters(1, SHIFTS), null_of(0)
    with pytest.raises(ZoneError, match="nothing to test"):
        null_test(data.assign(distance=2.5), null)
    with pytest.raises(ZoneError, match="nothing to test"):
        null_test(data, null, excluded_below=2.0)
    with pytest.raises(DataError, match="columns"):
        null_test(data[["distance"]], null)
