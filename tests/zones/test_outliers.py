"""Outliers: the plane inside out, whole encounters by default, and the paper's quota of samples."""

import math
import warnings

import numpy as np
import pandas as pd
import pytest
from scipy.optimize import brentq
from sklearn.neighbors import LocalOutlierFactor

import szlib
from szlib.tracks import funnels
from szlib.zones.outliers import (
    FRACTION,
    JITTER,
    N_NEIGHBOURS,
    NEIGHBOUR_SHARE,
    OUTLIER_FACTOR,
    complementary_points,
    encounter_numbers,
    is_outlier,
    local_outlier_factors,
    nearest_approaches,
    remove_outliers,
)


def make_samples(n=1000, *, seed=0, nearest=0.9, farthest=2.5):
    """People all around, none nearer than `nearest`."""
    rng = np.random.default_rng(seed)
    return pd.DataFrame(
        {
            "los_angle": rng.uniform(-np.pi, np.pi, n),
            "distance": rng.uniform(nearest, farthest, n),
            "speed": rng.uniform(0.4, 1.6, n),
        }
    )


def close(samples):
    return samples[samples["distance"] <= 2]


def with_intruders(samples, count=5):
    """Add a few people who come far too close."""
    rng = np.random.default_rng(9)
    intruders = pd.DataFrame(
        {
            "los_angle": np.linspace(-3, 2.5, count),
            "distance": rng.uniform(0.05, 0.2, count),
            "speed": 1.0,
        }
    )
    return pd.concat([samples, intruders], ignore_index=True)


def make_encounters(
    n=600,
    *,
    seed=0,
    edge=0.9,
    intruders=0,
    pace=1.5,
):
    """Straight walks past a person, 31 samples each, none nearer than `edge` but for the first few.

    The intruders come as near as 0.2 to 0.4 m, from all sides.
    """
    rng = np.random.default_rng(seed)
    intrudes = np.arange(n) < intruders
    nearest = np.where(
        intrudes, rng.uniform(0.2, 0.4, n), edge + rng.exponential(0.15, n)
    )
    bearing = np.where(
        intrudes,
        2 * np.pi * np.arange(n) / max(intruders, 1),
        rng.uniform(0, 2 * np.pi, n),
    )
    along = np.where(intrudes, pace, 1.0)[:, None] * np.arange(-1.5, 1.55, 0.1)
    speed = rng.uniform(0.4, 1.6, n)
    return pd.DataFrame(
        {
            "encounter": np.repeat(np.arange(n), 31),
            "los_angle": (
                bearing[:, None] + np.arctan2(along, nearest[:, None])
            ).ravel(),
            "distance": np.hypot(along, nearest[:, None]).ravel(),
            "speed": np.repeat(speed, 31),
        }
    )


# --- complementary coordinates -----------------------------------------------------------------------


@pytest.mark.parametrize("r_max", [2.0, 3.5])
def test_complementary_plane_is_the_plane_inside_out(r_max):
    samples = close(make_samples())
    points = complementary_points(samples, r_max=r_max)
    np.testing.assert_allclose(
        np.hypot(*points.T), r_max - samples["distance"], atol=1e-12
    )
    np.testing.assert_allclose(
        np.arctan2(*points.T[::-1])[samples["distance"] < 2],
        samples["los_angle"],
        atol=1e-9,
    )


def test_r_max_maps_to_the_origin_and_contact_to_the_rim():
    samples = pd.DataFrame(
        {"los_angle": [1.0, np.pi / 2, np.pi], "distance": [2.0, 0.0, 0.5]}
    )
    points = complementary_points(samples)
    np.testing.assert_allclose(points, [[0, 0], [0, 2], [-1.5, 0]], atol=1e-12)


@pytest.mark.parametrize(
    "change",
    [
        {"distance": 2.1},
        {"distance": -0.1},
        {"distance": np.nan},
        {"los_angle": np.nan},
        {"los_angle": np.inf},
    ],
)
def test_samples_without_a_complement_are_refused(change):
    samples = close(make_samples()).assign()
    row = samples.index[7]
    for name, value in change.items():
        samples.loc[row, name] = value
    with pytest.raises(
        szlib.DataError,
        match=rf"row {row}: got .*; expected 0 <= distance <= r_max = 2.0 m",
    ):
        complementary_points(samples)


# --- whole encounters -------------------------------------------------------------------------------


def removed_encounters(samples, **options):
    """Those that lost a sample within 2 m: all of them, or the test fails."""
    near = close(samples)
    outlier = is_outlier(near, **options)
    lost = near.loc[outlier, "encounter"]
    assert near["encounter"].isin(lost)[~outlier].sum() == 0
    return set(lost)


def brute_force_factors(points, k):
    """The local outlier factor as Breunig et al. define it, pair by pair."""
    distance = np.linalg.norm(points[:, None] - points, axis=-1)
    np.fill_diagonal(distance, np.inf)
    nearest = np.argsort(distance, axis=1)[:, :k]
    reach = np.sort(distance, axis=1)[:, k - 1]
    reachability = np.maximum(
        np.take_along_axis(distance, nearest, axis=1), reach[nearest]
    )
    density = 1 / reachability.mean(axis=1)
    return density[nearest].mean(axis=1) / density


@pytest.mark.parametrize("k", [5, 20, 60])
def test_factor_equals_its_definition(k):
    points = complementary_points(
        nearest_approaches(close(make_encounters(300, intruders=5)))
    )
    np.testing.assert_allclose(
        local_outlier_factors(points, k), brute_force_factors(points, k), rtol=1e-6
    )


def test_nearest_approach_is_the_nearest_sample_of_an_encounter():
    samples = close(make_encounters()).sample(frac=1, random_state=0)
    nearest = nearest_approaches(samples)
    expected = samples.loc[samples.groupby("encounter")["distance"].idxmin()]
    pd.testing.assert_frame_equal(nearest.sort_index(), expected.sort_index())


@pytest.mark.parametrize("pace", [0.2, 3.0])
@pytest.mark.parametrize("intruders", [0, 1, 6, 12, 30])
@pytest.mark.parametrize("seed", range(3))
def test_intruders_are_found_whatever_their_number_and_pace(seed, intruders, pace):
    """Up to 5 % of the encounters; no other encounter is removed."""
    samples = make_encounters(seed=seed, intruders=intruders, pace=pace)
    assert removed_encounters(samples) == set(range(intruders))


def test_fixed_share_misses_slow_intruders():
    samples = make_encounters(intruders=6, pace=0.2)
    near = close(samples)
    # the very number, were they known
    by_quota = is_outlier(near, fraction=6 * 31 / len(near))
    assert by_quota[near["encounter"] < 6].mean() < 0.5
    assert is_outlier(near)[near["encounter"] < 6].all()


def test_middle_of_a_crowd_is_found_in_a_later_round():
    """A hundred who rest upon each other in two places, of 2,000: one round alone sees their fringe."""
    samples = make_encounters(2000, intruders=100)
    samples.loc[samples["encounter"] < 100, "los_angle"] *= 0.25
    nearest = nearest_approaches(close(samples))
    once = (
        local_outlier_factors(complementary_points(nearest), 40)[:100] > OUTLIER_FACTOR
    )
    assert not once.all()
    assert set(range(100)) <= removed_encounters(samples)


def test_distant_encounters_are_no_outliers():
    ring = make_samples(300, nearest=0.9, farthest=1.1)
    two = pd.DataFrame({"los_angle": [1.0, 1.0], "distance": [0.2, 1.95], "speed": 1.0})
    samples = pd.concat([ring, two], ignore_index=True).assign(encounter=range(302))
    factors = local_outlier_factors(complementary_points(samples), N_NEIGHBOURS)
    assert (factors[-2:] > OUTLIER_FACTOR).all()
    assert removed_encounters(samples) == {300}


@pytest.mark.parametrize(("factor", "is_removed"), [(1.9, False), (2.1, True)])
def test_an_encounter_is_an_outlier_above_a_factor_of_two(factor, is_removed):
    ring = make_samples(300, nearest=0.9, farthest=1.1)

    def with_one_at(distance):
        one = pd.DataFrame({"los_angle": [1.0], "distance": [distance], "speed": 1.0})
        return pd.concat([ring, one], ignore_index=True).assign(encounter=range(301))

    def factor_at(distance):
        return local_outlier_factors(
            complementary_points(with_one_at(distance)), N_NEIGHBOURS
        )[-1]

    distance = brentq(lambda d: factor_at(d) - factor, 0.5, 0.9, xtol=1e-4)
    assert removed_encounters(with_one_at(distance)) == ({300} if is_removed else set())


def test_number_of_neighbours_is_a_share_of_the_encounters():
    samples = make_encounters(2000, intruders=40)
    expected = math.ceil(NEIGHBOUR_SHARE * samples["encounter"].nunique())
    assert expected > N_NEIGHBOURS
    assert removed_encounters(samples) == removed_encounters(
        samples, n_neighbours=expected
    )
    few = make_encounters(300, intruders=5)
    assert removed_encounters(few) == removed_encounters(few, n_neighbours=N_NEIGHBOURS)


def test_numbers_order_and_direction_of_encounters_change_nothing():
    samples = make_encounters(intruders=9)
    kept = remove_outliers(samples)
    assert len(kept) < len(close(samples))
    shuffled = remove_outliers(samples.sample(frac=1, random_state=1))
    pd.testing.assert_frame_equal(shuffled.sort_index(), kept)
    others = np.random.default_rng(3).permutation(600)
    renumbered = samples.assign(encounter=others[samples["encounter"]])
    assert remove_outliers(renumbered).index.equals(kept.index)
    named = samples.assign(
        encounter=samples["encounter"].map("pair {:04}".format).astype("category")
    )
    assert remove_outliers(named).index.equals(kept.index)
    turned = remove_outliers(samples.assign(los_angle=samples["los_angle"] + 1.1))
    assert turned.index.equals(kept.index)
    mirrored = remove_outliers(samples.assign(los_angle=-samples["los_angle"]))
    assert mirrored.index.equals(kept.index)


def test_the_funnel_counts_the_samples_of_outlying_encounters():
    samples = make_encounters(intruders=4)
    kept = remove_outliers(samples)
    *_, inliers = funnels.get(kept)
    gone = close(samples)["encounter"].isin(removed_encounters(samples)).sum()
    assert inliers["rejected"] == {"of an outlying encounter (LOF)": gone}
    pd.testing.assert_frame_equal(kept, samples.loc[kept.index])


def test_few_encounters_warn_and_stay():
    few = make_encounters(N_NEIGHBOURS, intruders=1)
    with pytest.warns(
        szlib.DataWarning,
        match=r"20 encounters are too few to find outliers .* add data",
    ):
        kept = remove_outliers(few)
    assert len(kept) == len(close(few))
    remove_outliers(few, n_neighbours=5)  # asked for, so without a warning


def test_copies_of_an_encounter_count_once():
    """Or a denser place than any other would make outliers of all around it."""
    samples = make_encounters(intruders=5)
    copies = pd.concat(
        [
            samples.query("encounter == 77").assign(encounter=1000 + k)
            for k in range(200)
        ]
    )
    both = pd.concat([samples, copies], ignore_index=True)
    assert removed_encounters(both) == removed_encounters(samples) >= set(range(5))


def test_encounters_of_different_days_are_separate():
    """Otherwise, an intruder would remove the encounter with the same number on another day."""
    days = [
        make_encounters(seed=k, intruders=6 * k).assign(day=f"2012-11-0{k + 1}")
        for k in range(2)
    ]
    both = pd.concat(days, ignore_index=True)
    near = close(both)
    found = near[is_outlier(near)]
    assert set(found["day"]) == {"2012-11-02"}
    assert set(found["encounter"]) == set(range(6))


def test_samples_without_encounter_count_individually():
    samples = with_intruders(close(make_samples(2500)))
    found = is_outlier(samples)
    assert np.flatnonzero(found).tolist() == list(range(len(samples) - 5, len(samples)))
    np.testing.assert_array_equal(
        found, is_outlier(samples.assign(encounter=range(len(samples))))
    )


def test_too_many_neighbours_are_refused():
    with pytest.raises(
        szlib.DataError,
        match=r"smaller than the number of samples \(or encounters\) .* got 600 neigh",
    ):
        remove_outliers(make_encounters(), n_neighbours=600)


def test_real_day_has_no_outliers(real_samples):
    """169 encounters within 2 m say too little: even the nearest, at 0.48 m, has company."""
    assert len(remove_outliers(real_samples)) == (real_samples["distance"] <= 2).sum()


# --- the paper's quota of samples --------------------------------------------------------------------


@pytest.mark.parametrize("neighbours", [5, 20])
@pytest.mark.parametrize("fraction", [0.002, 0.05])
def test_outliers_equal_scikit_learn(fraction, neighbours):
    samples = close(make_samples())
    radius, angle = 2 - samples["distance"], samples["los_angle"]
    features = [radius * np.cos(angle), radius * np.sin(angle)]
    lof = LocalOutlierFactor(n_neighbors=neighbours, contamination=fraction)
    expected = lof.fit_predict(np.column_stack(features)) == -1
    found = is_outlier(samples, fraction=fraction, n_neighbours=neighbours)
    np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize("fraction", [0.0, 0.002, 0.01, 0.1, 0.5])
def test_fixed_share_is_removed(fraction):
    samples = make_samples()
    n = len(close(samples))
    kept = remove_outliers(samples, fraction=fraction)
    assert n - len(kept) == math.ceil(fraction * (n - 1))
    assert (len(kept) == n) == (fraction == 0)


@pytest.mark.parametrize("seed", range(4))
def test_planted_intruders_are_found(seed):
    people = close(make_samples(2500, seed=seed))
    samples = with_intruders(people)
    found = is_outlier(samples, fraction=5 / len(samples))
    assert np.flatnonzero(found).tolist() == list(range(len(people), len(samples)))


def test_row_order_and_rotation_change_nothing():
    samples = with_intruders(make_samples())
    kept = remove_outliers(samples, fraction=0.01)
    shuffled = remove_outliers(samples.sample(frac=1, random_state=1), fraction=0.01)
    pd.testing.assert_frame_equal(shuffled.sort_index(), kept)
    turned = remove_outliers(
        samples.assign(los_angle=samples["los_angle"] + 1.1), fraction=0.01
    )
    assert turned.index.equals(kept.index)


def test_rows_and_input_do_not_change():
    samples = make_samples().assign(note="x")
    funnels.attach(samples, [funnels.stage("before", 1000, 1000, {})])
    before = samples.copy(deep=True)
    kept = remove_outliers(samples, fraction=FRACTION)
    pd.testing.assert_frame_equal(samples, before)
    pd.testing.assert_frame_equal(kept, samples.loc[kept.index])
    first, near, inliers = funnels.get(kept)
    assert first["stage"] == "before"
    assert (near["entered"], near["kept"]) == (1000, len(close(samples)))
    assert near["rejected"] == {"farther than 2.0 m": 1000 - near["kept"]}
    assert (inliers["entered"], inliers["kept"]) == (near["kept"], len(kept))
    assert len(funnels.get(samples)) == 1


def test_identical_samples_warn_and_are_separated():
    samples = pd.concat(
        [close(make_samples(600)), close(make_samples(30))]
        + [close(make_samples(30)).head(1)] * 40
    )
    with pytest.warns(
        szlib.DataWarning, match=r"up to 4\d samples coincide.*1 mm of noise"
    ):
        kept = remove_outliers(samples, fraction=0.05)
    assert not kept.empty
    # the noise is for LOF only
    assert set(kept["distance"]) <= set(samples["distance"])
    with pytest.warns(szlib.DataWarning):
        pd.testing.assert_frame_equal(remove_outliers(samples, fraction=0.05), kept)
    assert JITTER < 0.01


def test_a_few_identical_samples_need_no_noise():
    samples = close(make_samples())
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        remove_outliers(pd.concat([samples, samples]), fraction=FRACTION)


# --- nonsense ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            {"fraction": -0.1},
            r"fraction must be within \[0, 0.5\], or None .*; got -0.1",
        ),
        ({"fraction": 0.6}, "got 0.6"),
        ({"fraction": np.nan}, "got nan"),
        ({"r_max": 0}, "r_max must be a positive distance"),
        ({"r_max": np.nan}, "r_max must be a positive distance"),
        ({"r_max": np.inf}, "r_max must be a positive distance"),
        (
            {"r_max": 0.5},
            r"none of 1000 samples is within r_max = 0.5 m \(nearest: 0.90 m\)",
        ),
        ({"n_neighbours": 0}, "got 0 neighbours"),
        ({"n_neighbours": 2.5}, "got 2.5 neighbours"),
        (
            {"n_neighbours": 1000},
            r"got 1000 neighbours, \d+ samples; add data, or pass a smaller",
        ),
    ],
)
def test_invalid_parameters_are_refused(options, message):
    with pytest.raises(szlib.DataError, match=message):
        remove_outliers(make_samples(), **{"fraction": FRACTION, **options})


def test_invalid_samples_are_refused():
    samples = make_samples()
    with pytest.raises(szlib.DataError, match=r"columns \['distance'\] are missing"):
        remove_outliers(samples.drop(columns="distance"))
    with pytest.raises(szlib.DataError, match="the table is empty"):
        remove_outliers(samples.iloc[:0])
    with pytest.raises(
        szlib.DataError, match=r"row 4: got .*nan.*; expected a distance"
    ):
        remove_outliers(
            samples.assign(distance=samples["distance"].where(samples.index != 4))
        )


def test_fixed_share_is_removed_from_the_real_day(real_samples):
    kept = remove_outliers(real_samples, fraction=FRACTION)
    *_, near, inliers = funnels.get(kept)
    assert inliers["rejected"]["outlier (LOF)"] == math.ceil(0.002 * (near["kept"] - 1))


def test_encounters_are_numbered_in_order_of_appearance():
    table = pd.DataFrame({"encounter": [5, 5, 2, 5], "day": ["a", "a", "a", "b"]})
    number, first = encounter_numbers(table)
    assert number.tolist() == [0, 0, 1, 2]
    assert first.index.tolist() == [0, 2, 3]
    assert encounter_numbers(table.drop(columns="encounter"))[0].tolist() == [
        0,
        1,
        2,
        3,
    ]
