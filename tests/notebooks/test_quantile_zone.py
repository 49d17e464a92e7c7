"""The quantile zone: shares are exact, it moves with the frame, noise is smoothed, size is nothing."""

import numpy as np
import pandas as pd
import pytest
from helpers.passers import TRUTH, passers
from studies import quantile_zone
from studies.quantile_zone import Approaches, quantile_radii

import szlib
from szlib.zones.ellipses import DIRECTIONS, ellipse_reach
from szlib.zones.uncertainty import SPEED_BAND


def ellipse(samples, **options):
    zone = szlib.SocialZone.fit(
        samples, method=quantile_zone.NAME, speeds=(1.1,), n_resamples=0, **options
    )
    found = zone.ellipses[1.1]
    return np.array([*found.center, *found.semi_axes, found.angle])


@pytest.fixture(scope="module")
def samples():
    return passers(2500)


@pytest.mark.parametrize("seed", [0, 1])
def test_the_known_zone_is_recovered_whatever_the_number_of_people(seed):
    few, many = (ellipse(passers(n, seed=seed)) for n in (600, 6000))
    np.testing.assert_allclose(few[:4], TRUTH[:4], atol=0.03)
    np.testing.assert_allclose(many[:4], TRUTH[:4], atol=0.02)


def test_noise_does_not_shrink_the_zone():
    still, noisy = ellipse(passers(2500)), ellipse(passers(2500, noise=0.05))
    np.testing.assert_allclose(noisy[:4], still[:4], atol=0.02)


def test_few_intruders_change_little(samples):
    through = samples["encounter"] % 50 == 0  # 2 %
    intruders = samples.assign(
        distance=np.where(through, samples["distance"] / 3, samples["distance"])
    )
    np.testing.assert_allclose(ellipse(intruders)[:4], ellipse(samples)[:4], atol=0.03)


def test_at_most_a_share_q_of_encounters_is_nearer(samples):
    known = Approaches.from_samples(samples, r_max=2.0)
    encounters, nearest = known.nearest(1.1)
    assert (
        np.abs(samples.groupby("encounter")["speed"].mean()[encounters] - 1.1)
        <= SPEED_BAND
    ).all()
    for q in (0.01, 0.05, 0.3):
        radii = quantile_radii(known, 1.1, q)[0]
        seen = np.isfinite(nearest).sum(axis=0)
        assert ((nearest < radii).sum(axis=0) < q * seen).all()
        assert ((nearest <= radii).sum(axis=0) >= q * seen).all()


@pytest.mark.parametrize("turn", [np.pi / 2, np.radians(35), 1.0])
def test_rotated_samples_rotate_the_quantile_zone(samples, turn):
    """Exactly by multiples of 5 deg, which the directions are apart; else nearly."""
    m, n, a, b, angle = ellipse(samples)
    cos, sin = np.cos(turn), np.sin(turn)
    expected = [m * cos - n * sin, m * sin + n * cos, a, b]
    found = ellipse(samples.assign(los_angle=samples["los_angle"] + turn))
    np.testing.assert_allclose(found[:4], expected, atol=0.005 if turn == 1.0 else 1e-6)
    assert abs((found[4] - angle - turn + np.pi / 2) % np.pi - np.pi / 2) < (
        0.02 if turn == 1.0 else 1e-5
    )


def test_mirrored_people_mirror_the_zone_and_larger_people_enlarge_it(
    samples,
):
    m, n, a, b, angle = ellipse(samples)
    mirrored = ellipse(samples.assign(los_angle=-samples["los_angle"]))
    np.testing.assert_allclose(mirrored, [m, -n, a, b, -angle], atol=1e-6)
    twice = ellipse(samples.assign(distance=2 * samples["distance"]), r_max=4.0)
    np.testing.assert_allclose(twice, [2 * m, 2 * n, 2 * a, 2 * b, angle], atol=1e-6)


def test_neither_order_nor_numbers_of_encounters_matter(samples):
    before = samples.copy(deep=True)
    expected = ellipse(samples)
    pd.testing.assert_frame_equal(samples, before)
    shuffled = samples.sample(frac=1, random_state=0).assign(
        encounter=lambda d: 7 * d["encounter"] + 3
    )
    np.testing.assert_allclose(ellipse(shuffled), expected, atol=1e-9)
    days = samples.assign(day=np.where(samples["encounter"] < 1000, "a", "b"))
    days["encounter"] = np.where(
        days["day"] == "a", days["encounter"], days["encounter"] - 1000
    )
    np.testing.assert_allclose(ellipse(days), expected, atol=1e-9)


def test_weights_equal_copies(samples):
    known = Approaches.from_samples(samples, r_max=2.0)
    weights = (
        np.random.default_rng(0)
        .integers(0, 4, (3, len(known.encounters)))
        .astype(float)
    )
    lines = quantile_radii(known, 1.1, 0.05, weights)
    for weight, line in zip(weights, lines, strict=True):
        first = known.encounters["encounter"].to_numpy()
        copies = pd.concat(
            [
                samples[samples["encounter"].isin(first[weight > k])].assign(day=str(k))
                for k in range(int(weight.max()))
            ]
        )
        np.testing.assert_array_equal(
            quantile_radii(Approaches.from_samples(copies, r_max=2.0), 1.1, 0.05)[0],
            line,
        )
    empty = quantile_radii(known, 1.1, 0.05, np.zeros((1, len(known.encounters))))
    assert np.isnan(empty).all()


# --- what cannot be used -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        (
            {"speed": np.nan},
            szlib.DataError,
            "row 0: got .*nan.*; expected finite numbers",
        ),
        (
            {"distance": 5.0},
            szlib.DataError,
            "none of 77500 samples is within r_max = 2.0 m",
        ),
        (
            {"speed": 3.0},
            szlib.ZoneError,
            r"at 1\.1 m/s is undefined: no person was seen",
        ),
        (
            {"los_angle": 0.3},
            szlib.ZoneError,
            r"from 35 counter-clockwise to 360 deg|no speed has a zone",
        ),
    ],
)
def test_samples_without_a_quantile_zone_are_refused(samples, change, error, message):
    with pytest.raises(error, match=message):
        ellipse(samples.assign(**change))
    with pytest.raises(szlib.DataError, match=r"columns \['distance'\] are missing"):
        ellipse(samples.drop(columns="distance"))


def test_a_share_of_nobody_is_refused(samples):
    message = "q must be a share of encounters, 0 < q < 1; got 0"
    with pytest.raises(szlib.ZoneError, match=message):
        ellipse(samples, q=0.0)


def test_provenance_names_the_sector_in_degrees(samples):
    zone = szlib.SocialZone.fit(
        samples, method=quantile_zone.NAME, speeds=(1.1,), n_resamples=0
    )
    assert zone.provenance["parameters"]["sector_deg"] == 35


def test_radii_are_those_of_the_truth_within_a_sector():
    """Who touches a nearer part of the rim within 17.5 deg counts as well: so much too small they may be."""
    radii = quantile_radii(
        Approaches.from_samples(passers(4000, clearance=1e-6), r_max=2.0), 1.1, 0.02
    )[0]
    truth = ellipse_reach(TRUTH)
    around = np.min([np.roll(truth, turn) for turn in range(-4, 5)], axis=0)
    assert (around - 0.005 < radii).all()
    assert (radii < truth + 0.02).all()
    assert radii.shape == DIRECTIONS.shape
