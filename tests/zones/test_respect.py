"""The respect zone: known contours are recovered, whatever the number of samples; null data has no zone."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.optimize import approx_fprime

import szlib
from szlib.errors import ZoneError
from szlib.zones import respect
from szlib.zones.occupancy import OccupancyHistogram, pair_correlation
from szlib.zones.respect import RespectEstimator, fit_respect, respect_radius

R_MAX = 2.0
THETA = np.linspace(-np.pi, np.pi, 24, endpoint=False)
ZONE = szlib.Ellipse((0.1, 0.05), (1.1, 0.7), 0.3)


def scattered(seed: int, n: int) -> pd.DataFrame:
    """Samples of people who ignore others: uniform over a disc, more of them ahead."""
    rng = np.random.default_rng(seed)
    ahead = rng.normal(0, 1.2, n)
    angle = np.where(rng.random(n) < 0.5, ahead, rng.uniform(-np.pi, np.pi, n))
    table = pd.DataFrame({"encounter": np.arange(n), "shift": np.arange(n) % 10})
    table["los_angle"] = np.pi - np.mod(np.pi - angle, 2 * np.pi)
    table["distance"], table["speed"] = R_MAX * np.sqrt(rng.random(n)), rng.uniform(0.5, 1.5, n)
    return table


def null_of(samples: pd.DataFrame) -> szlib.NullEncounters:
    encounters = samples[["shift", "encounter"]].assign(nearest=samples["distance"])
    return szlib.NullEncounters(samples, encounters, 10, R_MAX)


def kept_out(
    samples: pd.DataFrame, zone: szlib.Ellipse, ignoring: float = 0.0, seed: int = 0
) -> pd.DataFrame:
    """Those outside of a zone, and a share of those inside of it."""
    angle, distance = samples["los_angle"], samples["distance"]
    points = distance.to_numpy()[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    cares = np.random.default_rng(seed).random(len(samples)) >= ignoring
    return samples[(zone.level(points) >= 1) | ~cares]


def softly_kept_out(samples: pd.DataFrame, radius: float, seed: int, softness: float = 0.1) -> pd.DataFrame:
    """The nearer, the fewer: half of them at the radius."""
    draw = np.random.default_rng(seed).random(len(samples))
    return samples[draw < 1 / (1 + np.exp(-(samples["distance"] - radius) / softness))]


def reach(zone: szlib.Ellipse, theta: np.ndarray) -> np.ndarray:
    """Distance to the zone's edge along each direction, by bisection [m]."""
    low, high = np.zeros(len(theta)), np.full(len(theta), 5.0)
    for _ in range(50):
        middle = (low + high) / 2
        inside = zone.level(middle[:, None] * np.column_stack([np.cos(theta), np.sin(theta)])) < 1
        low, high = np.where(inside, middle, low), np.where(inside, high, middle)
    return low


@pytest.fixture(scope="module")
def null() -> szlib.NullEncounters:
    return null_of(scattered(0, 200_000))


# --- truth -------------------------------------------------------------------------------------------


def test_a_known_ellipse_comes_back(null: szlib.NullEncounters) -> None:
    data = kept_out(scattered(1, 50_000), ZONE)
    assert fit_respect(data, null).radii(THETA) == pytest.approx(reach(ZONE, THETA), abs=0.05)


@pytest.mark.parametrize("radius", [0.4, 0.8, 1.2])
def test_a_known_circle_comes_back_from_all_bearings(null: szlib.NullEncounters, radius: float) -> None:
    data = kept_out(scattered(2, 5_000), szlib.Ellipse((0, 0), (radius, radius)))
    assert respect_radius(data, null) == pytest.approx(radius, abs=0.02)
    assert fit_respect(data, null).radii(THETA) == pytest.approx(radius, abs=0.04)


def test_radius_does_not_depend_on_the_number_of_samples(null: szlib.NullEncounters) -> None:
    """With an edge as soft as at real sites; what a hull finds shrinks by half a metre meanwhile."""
    nearest = []
    for n in (100, 1_000, 10_000, 100_000):
        data = [
            softly_kept_out(scattered(seed, n), 0.7, seed) for seed in range(10, 40 if n < 10_000 else 14)
        ]
        radii = [respect_radius(each, null) for each in data]
        error = np.std(radii) / np.sqrt(len(radii))
        assert np.mean(radii) == pytest.approx(0.7, abs=max(2.6 * error, 0.01)), n
        nearest.append(np.mean([each["distance"].min() for each in data]))
    assert nearest[0] - nearest[-1] > 0.3


@pytest.mark.parametrize("ignoring", [0.05, 0.2, 0.4])
def test_people_who_ignore_others_change_little(null: szlib.NullEncounters, ignoring: float) -> None:
    data = kept_out(scattered(3, 50_000), ZONE, ignoring)
    fit = fit_respect(data, null)
    assert fit.ignoring_share == pytest.approx(ignoring, abs=0.03)
    assert fit.radii(THETA) == pytest.approx(reach(ZONE, THETA), abs=0.06)


def test_most_people_ignoring_others_leave_no_zone(null: szlib.NullEncounters) -> None:
    data = kept_out(scattered(4, 50_000), ZONE, 0.7)
    assert respect_radius(data, null) == 0
    assert (fit_respect(data, null).radii(THETA) == 0).all()


def test_null_data_has_no_zone(null: szlib.NullEncounters) -> None:
    radii = [respect_radius(scattered(seed, 1_000), null) for seed in range(5, 25)]
    assert np.median(radii) < 0.05
    assert max(radii) < 0.3


def test_the_contour_is_where_counts_are_half(null: szlib.NullEncounters) -> None:
    """An independent reading: bins of the ratio, with a soft edge."""
    data = softly_kept_out(scattered(6, 400_000), 0.9, 0)
    edges = np.arange(0, R_MAX + 0.01, 0.02)
    ratio = np.histogram(data["distance"], edges)[0] / np.histogram(null.samples["distance"], edges)[0]
    half = np.interp(0.5, ratio[20:60] / ratio[80:].mean(), edges[20:60] + 0.01)
    assert respect_radius(data, null) == pytest.approx(half, abs=0.02)
    assert fit_respect(data, null).softness == pytest.approx(0.1, abs=0.01)


def test_radius_follows_the_speed(null: szlib.NullEncounters) -> None:
    data = scattered(7, 60_000)
    data = data[data["distance"] > 0.4 + 0.4 * data["speed"]]
    for speed in (0.7, 1.0, 1.3):
        found = fit_respect(data, null, speed=speed, speed_width=0.1).radii(THETA)
        assert found == pytest.approx(0.4 + 0.4 * speed, abs=0.06)


# --- invariances -------------------------------------------------------------------------------------


def test_mix_of_directions_does_not_matter(null: szlib.NullEncounters) -> None:
    data = kept_out(scattered(8, 40_000), ZONE)
    ahead = np.abs(data["los_angle"]) < np.pi / 2
    fewer = pd.concat([data[ahead], data[~ahead].iloc[::4]])
    assert fit_respect(fewer, null).radii(THETA) == pytest.approx(
        fit_respect(data, null).radii(THETA), abs=0.04
    )


def test_mirrored_samples_mirror_the_respect_zone(null: szlib.NullEncounters) -> None:
    data = kept_out(scattered(9, 20_000), ZONE)
    other = null_of(null.samples.assign(los_angle=-null.samples["los_angle"]))
    found = fit_respect(data.assign(los_angle=-data["los_angle"]), other).radii(-THETA)
    assert found == pytest.approx(fit_respect(data, null).radii(THETA), abs=1e-3)


def test_weights_equal_copies(null: szlib.NullEncounters) -> None:
    data = kept_out(scattered(10, 2_000), ZONE)
    weights = np.random.default_rng(0).integers(0, 4, len(data))
    weighed = OccupancyHistogram.from_samples(data, r_max=R_MAX, weights=weights)
    copies = OccupancyHistogram.from_samples(data.loc[data.index.repeat(weights)], r_max=R_MAX)
    np.testing.assert_array_equal(weighed.counts, copies.counts)
    against = OccupancyHistogram.from_samples(null.samples, r_max=R_MAX)
    assert respect_radius(weighed, against) == respect_radius(data.loc[data.index.repeat(weights)], null)


def test_far_samples_do_not_matter(null: szlib.NullEncounters) -> None:
    data = kept_out(scattered(11, 2_000), ZONE)
    far = data.assign(distance=data["distance"] + 2.0)
    found = fit_respect(pd.concat([data, far]), null).radii(THETA)
    np.testing.assert_array_equal(found, fit_respect(data, null).radii(THETA))


def test_shifts_of_the_null_are_resampled(null: szlib.NullEncounters) -> None:
    few = szlib.NullEncounters(
        null.samples[:2000], null.encounters[:2000], 11, R_MAX
    )  # no sample in the last
    data = kept_out(scattered(1, 2000), szlib.Ellipse((0, 0), (0.9, 0.7)))
    zones = RespectEstimator.from_samples(data, r_max=R_MAX, null=few)
    alike = np.ones((5, len(zones.encounters)))
    same = zones.refit(alike, [1.0])
    assert np.ptp(same, axis=0).max() == 0
    drawn = zones.refit(alike, [1.0], np.random.default_rng(0))
    assert np.ptp(drawn[:, 0, 2]) > 0.005
    np.testing.assert_allclose(zones.counts_by_shift.sum(axis=0), zones.null.counts)


def test_radii_have_the_shape_of_theta(null: szlib.NullEncounters) -> None:
    fit = fit_respect(kept_out(scattered(12, 2_000), ZONE), null)
    assert fit.radii(0.0).shape == ()
    assert fit.radii(np.zeros((2, 3))).shape == (2, 3)
    assert fit.radii(np.pi) == pytest.approx(fit.radii(-np.pi))


def test_respect_without_samples_is_refused(null: szlib.NullEncounters) -> None:
    data = scattered(13, 100)
    with pytest.raises(ZoneError, match=r"0 samples of the data.*nothing to compare"):
        respect_radius(data.assign(distance=3.0), null)
    with pytest.raises(ZoneError, match="at about 50 m/s"):
        fit_respect(data, null, speed=50.0)
    with pytest.raises(ZoneError, match="same r_max"):
        respect_radius(OccupancyHistogram.from_samples(data, r_max=1.5), null)


def test_the_gradient_of_the_likelihood_is_that_of_its_value(
    null: szlib.NullEncounters, monkeypatch: pytest.MonkeyPatch
) -> None:
    rng, differences, real = np.random.default_rng(0), list[float](), respect.minimize

    def check(cost: object, start: np.ndarray, **options: object) -> object:
        for _ in range(3):
            p = start + rng.normal(0, 0.1, start.size)
            slope = approx_fprime(p, lambda q: cost(q)[0], 1e-6)
            differences.append(np.abs(cost(p)[1] - slope).max() / np.abs(slope).max())
        return real(cost, start, **options)

    monkeypatch.setattr(respect, "minimize", check)
    fit_respect(kept_out(scattered(1, 5_000), ZONE), null)
    assert len(differences) > 3 and max(differences) < 1e-3


def test_the_funnel_counts_far_samples(null: szlib.NullEncounters) -> None:
    far = scattered(1, 900).assign(distance=lambda t: t["distance"] + R_MAX)
    data = pd.concat([scattered(0, 300), far.assign(encounter=far["encounter"] + 300)])
    *_, close = RespectEstimator.from_samples(data, r_max=R_MAX, null=null).funnel
    assert (close["entered"], close["kept"], close["rejected"]) == (1200, 300, {"farther than 2.0 m": 900})


# --- the map -----------------------------------------------------------------------------------------


def test_pair_correlation_is_low_within_the_zone(null: szlib.NullEncounters) -> None:
    same = pair_correlation(null.samples, null)
    assert same.g == pytest.approx(1.0)
    data = kept_out(scattered(14, 100_000), szlib.Ellipse((0, 0), (1, 1)))
    g = pair_correlation(data, null).g
    assert g.shape == (len(same.direction), len(same.distance))
    assert g[:, same.distance < 0.7].max() < 0.05
    assert g[:, same.distance > 1.3].min() > 1.0, "people outside the zone are more frequent than in the null"


def test_cells_of_the_pair_correlation_are_those_of_the_samples(null: szlib.NullEncounters) -> None:
    """Twice as many people in one place than in the null model are seen there in the map."""
    samples = null.samples
    here = (samples["distance"].between(1.2, 1.5)) & (samples["los_angle"] % (2 * np.pi)).between(4.0, 5.0)
    twice = pd.concat([samples, samples[here].assign(encounter=lambda t: t["encounter"])])
    found = pair_correlation(twice, null)
    assert (found.direction[0], found.direction[-1]) == pytest.approx((np.pi / 36, 2 * np.pi * 35.5 / 36))
    assert (found.distance[0], found.distance[-1]) == pytest.approx((R_MAX / 160, R_MAX * 79.5 / 80))
    direction, distance = np.unravel_index(np.nanargmax(found.g), found.g.shape)
    assert 4.0 < found.direction[direction] < 5.0 and 1.2 < found.distance[distance] < 1.5


def test_pair_correlation_needs_a_null(null: szlib.NullEncounters) -> None:
    with pytest.raises(ZoneError, match="no encounter"):
        pair_correlation(scattered(0, 10), null_of(scattered(0, 0)))


# --- the plaza ---------------------------------------------------------------------------------------


def test_the_plaza_truth_comes_back(tmp_path: Path) -> None:
    """Staged encounters are no sample of an hour: far more pass close by than chance would bring."""
    settings = szlib.PlazaSettings(intruders=0.01)
    tracks = szlib.read_tracks(szlib.make_plaza(tmp_path / "plaza.csv", seed=0, settings=settings))
    samples = szlib.find_encounters(tracks)
    null = szlib.null_encounters(tracks, shifts=20, progress=False)
    for speed in (0.7, 1.1):
        found = fit_respect(samples, null, speed=speed).radii(THETA)
        assert found == pytest.approx(reach(settings.true_zone(speed), THETA), abs=0.08)
        assert found.mean() == pytest.approx(reach(settings.true_zone(speed), THETA).mean(), abs=0.03)
    assert szlib.null_test(samples, null).is_significant


@pytest.mark.parametrize("speed_width", [None, 0.3])
def test_zones_of_several_speeds_are_those_of_each(null: szlib.NullEncounters, speed_width: float) -> None:
    data, speeds = kept_out(scattered(8, 5_000), ZONE), (0.8, 1.0, 1.2)
    options = {} if speed_width is None else {"speed_width": speed_width}
    estimator = RespectEstimator.from_samples(data, r_max=R_MAX, null=null, **options)
    together = estimator.fit_shape(speeds)
    for speed in speeds:
        alone = estimator.fit_shape((speed,)).radii_at(speed)
        np.testing.assert_allclose(together.radii_at(speed), alone)
