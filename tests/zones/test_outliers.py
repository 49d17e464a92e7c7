"""Outliers: the complementary plane turns distances inside out, and LOF keeps to its quota."""

from __future__ import annotations

import math
import warnings

import numpy as np
import pandas as pd
import pytest
from sklearn.neighbors import LocalOutlierFactor

import szlib
from szlib.tracks import funnels
from szlib.zones.outliers import JITTER, complementary_points, is_outlier, remove_outliers


def make_samples(
    n: int = 1000, *, seed: int = 0, nearest: float = 0.9, farthest: float = 2.5
) -> pd.DataFrame:
    """People all around, none nearer than `nearest`."""
    rng = np.random.default_rng(seed)
    return pd.DataFrame(
        {
            "los_angle": rng.uniform(-np.pi, np.pi, n),
            "distance": rng.uniform(nearest, farthest, n),
            "speed": rng.uniform(0.4, 1.6, n),
        }
    )


def close(samples: pd.DataFrame) -> pd.DataFrame:
    return samples[samples["distance"] <= 2]


def with_intruders(samples: pd.DataFrame, count: int = 5) -> pd.DataFrame:
    """A few who come far too close."""
    rng = np.random.default_rng(9)
    intruders = pd.DataFrame(
        {"los_angle": np.linspace(-3, 2.5, count), "distance": rng.uniform(0.05, 0.2, count), "speed": 1.0}
    )
    return pd.concat([samples, intruders], ignore_index=True)


# --- complementary coordinates -----------------------------------------------------------------------


@pytest.mark.parametrize("r_max", [2.0, 3.5])
def test_the_complementary_plane_is_the_plane_inside_out(r_max: float) -> None:
    samples = close(make_samples())
    points = complementary_points(samples, r_max=r_max)
    np.testing.assert_allclose(np.hypot(*points.T), r_max - samples["distance"], atol=1e-12)
    np.testing.assert_allclose(
        np.arctan2(*points.T[::-1])[samples["distance"] < 2], samples["los_angle"], atol=1e-9
    )


def test_who_is_at_r_max_is_at_the_origin_and_who_touches_is_on_the_rim() -> None:
    samples = pd.DataFrame({"los_angle": [1.0, np.pi / 2, np.pi], "distance": [2.0, 0.0, 0.5]})
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
def test_samples_that_have_no_complement(change: dict[str, float]) -> None:
    samples = close(make_samples()).assign()
    row = samples.index[7]
    for name, value in change.items():
        samples.loc[row, name] = value
    with pytest.raises(szlib.DataError, match=rf"row {row}: expected 0 <= distance <= r_max = 2.0 m"):
        complementary_points(samples)


# --- LOF ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("speed_scale", [None, 0.5])
@pytest.mark.parametrize("neighbours", [5, 20])
@pytest.mark.parametrize("fraction", [0.002, 0.05])
def test_it_is_the_local_outlier_factor(fraction: float, neighbours: int, speed_scale: float | None) -> None:
    samples = close(make_samples())
    radius, angle = 2 - samples["distance"], samples["los_angle"]
    features = [radius * np.cos(angle), radius * np.sin(angle)]
    if speed_scale:
        features.append(speed_scale * samples["speed"])
    lof = LocalOutlierFactor(n_neighbors=neighbours, contamination=fraction)
    expected = lof.fit_predict(np.column_stack(features)) == -1
    found = is_outlier(samples, fraction=fraction, neighbours=neighbours, speed_scale=speed_scale)
    np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize("fraction", [0.0, 0.002, 0.01, 0.1, 0.5])
def test_the_quota_is_kept(fraction: float) -> None:
    samples = make_samples()
    n = len(close(samples))
    kept = remove_outliers(samples, fraction)
    assert n - len(kept) == math.ceil(fraction * (n - 1))
    assert (len(kept) == n) == (fraction == 0)


@pytest.mark.parametrize("seed", range(4))
def test_planted_intruders_are_found(seed: int) -> None:
    people = close(make_samples(2500, seed=seed))
    samples = with_intruders(people)
    found = is_outlier(samples, fraction=5 / len(samples))
    assert np.flatnonzero(found).tolist() == list(range(len(people), len(samples)))


def test_row_order_and_turning_the_world_change_nothing() -> None:
    samples = with_intruders(make_samples())
    kept = remove_outliers(samples, 0.01)
    shuffled = remove_outliers(samples.sample(frac=1, random_state=1), 0.01)
    pd.testing.assert_frame_equal(shuffled.sort_index(), kept)
    turned = remove_outliers(samples.assign(los_angle=samples["los_angle"] + 1.1), 0.01)
    assert turned.index.equals(kept.index)


def test_rows_come_as_they_are_and_the_input_stays() -> None:
    samples = make_samples().assign(note="x")
    funnels.carry(samples, [funnels.stage("before", 1000, 1000, {})])
    before = samples.copy(deep=True)
    kept = remove_outliers(samples)
    pd.testing.assert_frame_equal(samples, before)
    pd.testing.assert_frame_equal(kept, samples.loc[kept.index])
    first, near, inliers = funnels.of(kept)
    assert first["stage"] == "before"
    assert (near["entered"], near["kept"]) == (1000, len(close(samples)))
    assert near["set_aside"] == {"farther than 2.0 m": 1000 - near["kept"]}
    assert (inliers["entered"], inliers["kept"]) == (near["kept"], len(kept))
    assert len(funnels.of(samples)) == 1


def test_identical_samples_are_told_and_parted() -> None:
    samples = pd.concat(
        [close(make_samples(600)), close(make_samples(30))] + [close(make_samples(30)).head(1)] * 40
    )
    with pytest.warns(szlib.DataWarning, match=r"up to 4\d samples coincide.*1 mm of noise"):
        kept = remove_outliers(samples, 0.05)
    assert not kept.empty
    assert set(kept["distance"]) <= set(samples["distance"])  # the noise is for LOF only
    with pytest.warns(szlib.DataWarning):
        pd.testing.assert_frame_equal(remove_outliers(samples, 0.05), kept)
    assert JITTER < 0.01


def test_a_few_identical_samples_need_no_noise() -> None:
    samples = close(make_samples())
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        remove_outliers(pd.concat([samples, samples]))


# --- nonsense ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"fraction": -0.1}, r"fraction must be within \[0, 0.5\]; got -0.1"),
        ({"fraction": 0.6}, "got 0.6"),
        ({"fraction": np.nan}, "got nan"),
        ({"r_max": 0}, "r_max must be a positive distance"),
        ({"r_max": np.nan}, "r_max must be a positive distance"),
        ({"r_max": np.inf}, "r_max must be a positive distance"),
        ({"r_max": 0.5}, r"none of 1000 samples is within r_max = 0.5 m \(nearest: 0.90 m\)"),
        ({"neighbours": 0}, "got 0 neighbours"),
        ({"neighbours": 2.5}, "got 2.5 neighbours"),
        ({"neighbours": 1000}, r"got 1000 neighbours, \d+ samples; add data, or pass fewer"),
        ({"speed_scale": 0}, "speed_scale must be a positive number"),
        ({"speed_scale": np.nan}, "speed_scale must be a positive number"),
    ],
)
def test_parameters_without_a_meaning(options: dict, told: str) -> None:
    with pytest.raises(szlib.DataError, match=told):
        remove_outliers(make_samples(), **options)


def test_samples_that_cannot_be_used() -> None:
    samples = make_samples()
    with pytest.raises(szlib.DataError, match=r"columns \['distance'\] are missing"):
        remove_outliers(samples.drop(columns="distance"))
    with pytest.raises(szlib.DataError, match="the table is empty"):
        remove_outliers(samples.iloc[:0])
    with pytest.raises(szlib.DataError, match="row 4: distance is NaN"):
        remove_outliers(samples.assign(distance=samples["distance"].where(samples.index != 4)))
    with pytest.raises(szlib.DataError, match=r"row \d+: speed is nan"):
        remove_outliers(samples.assign(speed=np.nan), speed_scale=1.0)
    with pytest.raises(szlib.DataError, match=r"columns \['speed'\] are missing"):
        remove_outliers(samples.drop(columns="speed"), speed_scale=1.0)


def test_the_real_day_keeps_its_quota(real_samples: pd.DataFrame) -> None:
    kept = remove_outliers(real_samples)
    *_, near, inliers = funnels.of(kept)
    assert inliers["set_aside"]["outlier (LOF)"] == math.ceil(0.002 * (near["kept"] - 1))
