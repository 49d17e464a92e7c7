"""The respect zone: an imposed zone is found, whoever is the reference; null data has none."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from helpers.passing_pairs import R_MAX, exchanged, null_of, passing_pairs, respecting
from scipy.optimize import approx_fprime, minimize_scalar
from scipy.special import expit

import szlib
from szlib.encounters.kinds import WALKING
from szlib.zones import respect_likelihood
from szlib.zones.respect import RespectEstimator
from szlib.zones.respect_likelihood import PairPaths, chance_level
from szlib.zones.uncertainty import estimate_uncertainty

ZONE = szlib.Ellipse((0.1, 0.0), (0.95, 0.7))


def prepare(samples, null):
    return RespectEstimator.from_samples(samples, r_max=R_MAX, null=null)


def fitted(samples, null, speed=1.1):
    """Centre, semi-axes and angle."""
    return respect_likelihood.zone_ellipses(
        prepare(samples, null).middle[None], [speed]
    )[0, 0]


@pytest.fixture(scope="module")
def null():
    return null_of(passing_pairs(3500, 0))


@pytest.fixture(scope="module")
def large_null():
    return null_of(passing_pairs(8000, 0))


@pytest.fixture(scope="module")
def data():
    return respecting(passing_pairs(1500, 1), ZONE, careless=0.05)


@pytest.fixture(scope="module")
def estimator(data, null):
    return prepare(data, null)


def random_parameters(seed):
    return np.random.default_rng(seed).uniform(
        0.7 * respect_likelihood._LOW, 0.7 * respect_likelihood._HIGH
    )


# --- truth -------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_every_pair_on_the_plaza_gives_its_zone(tmp_path):
    """Nearly all of its people pass just outside of a zone, where chance has hardly anybody."""
    tracks = szlib.read_tracks(szlib.make_plaza(tmp_path / "plaza.csv", seed=3))
    against = szlib.null_pairs(tracks, shifts=19, progress=False)
    m, n, a, b, _ = fitted(szlib.find_pairs(tracks), against)
    true = szlib.PlazaSettings().true_zone(1.1)
    assert (m, n) == pytest.approx(true.center, abs=0.03)
    assert (a, b) == pytest.approx(true.semi_axes, abs=0.03)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("zone", "careless"),
    [
        (ZONE, 0.15),
        (szlib.Ellipse((-0.1, 0.0), (0.8, 0.6)), 0.05),
        (szlib.Ellipse((0, 0), (0.5, 0.5)), 0.05),
    ],
)
def test_an_imposed_zone_is_found(zone, careless, large_null):
    """How far it reaches ahead and behind is known less well: few straight paths touch it there."""
    m, n, a, b, _ = fitted(
        respecting(passing_pairs(4000, 5), zone, careless), large_null
    )
    assert (n, b) == pytest.approx((0.0, zone.semi_axes[1]), abs=0.05)
    assert (m, a) == pytest.approx((zone.center[0], zone.semi_axes[0]), abs=0.1)


@pytest.mark.slow
def test_the_zone_grows_with_speed_if_people_do_so(
    large_null,
):
    samples = passing_pairs(2500, 7)
    larger = 0.4 + 0.4 * samples[["speed", "other_speed"]].max(axis=1)
    of_all, of_fast = (
        samples["encounter"][samples["distance"] < r].unique() for r in (0.84, larger)
    )
    alike, grown = (
        prepare(samples[~samples["encounter"].isin(entered)], large_null).middle[[4, 6]]
        for entered in (of_all, of_fast)
    )
    assert (np.abs(alike) < 0.1).all()
    assert (grown > 0.15).all(), "0.48 for each m/s, less what the prior takes"


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_people_who_ignore_each_other_have_no_zone(seed, null):
    with pytest.raises(
        szlib.ZoneError, match=r"no respect zone: .* explain the data nearly as well"
    ):
        fitted(passing_pairs(300, 50 + seed), null)


# --- invariances -------------------------------------------------------------------------------------


def test_it_does_not_matter_who_is_the_reference(data, null, estimator):
    half = data["encounter"] % 2 == 0
    mixed = pd.concat([exchanged(data[half]), data[~half]])
    exchange = prepare(mixed, null)
    found, expected = exchange.likelihood, estimator.likelihood
    for seed in range(20):
        p = random_parameters(seed)
        assert found.cost(p)[0] == pytest.approx(expected.cost(p)[0], rel=1e-9)


@pytest.mark.slow
def test_a_mirror_image_has_the_mirrored_zone(data, null, estimator):
    def mirror(samples):
        return samples.assign(
            **{name: -samples[name] for name in ("los_angle", "other_los_angle")}
        )

    found = fitted(mirror(data), null_of(mirror(null.samples)))
    expected = respect_likelihood.zone_ellipses(estimator.middle[None], [1.1])[0, 0]
    assert found == pytest.approx(expected * [1, -1, 1, 1, -1], abs=0.02)


def test_the_order_of_rows_does_not_matter(data, null, estimator):
    found = prepare(data.sample(frac=1, random_state=0), null).likelihood
    for seed in range(20):
        p = random_parameters(seed)
        expected = estimator.likelihood.cost(p)[0]
        assert found.cost(p)[0] == pytest.approx(expected, rel=1e-9)


@pytest.mark.slow
def test_other_kinds_do_not_count(data, null, estimator):
    companions = respecting(
        passing_pairs(200, 9), szlib.Ellipse((0.0, 0.0), (1.5, 1.5))
    )
    companions = companions.assign(
        kind="same direction", encounter=companions["encounter"] + 10_000
    )
    assert prepare(pd.concat([data, companions]), null).middle == pytest.approx(
        estimator.middle, abs=1e-3
    )


# --- independent computations ------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(3))
def test_distances_are_those_of_a_loop_over_all_samples(seed):
    # without times, paths are not smoothed
    samples = passing_pairs(60, seed).drop(columns="t")
    p = random_parameters(seed)
    p[[0, 1, 2, 7]] /= 2
    p[3:7:2] = np.log([0.9, 0.6])
    a, b, shear = 0.9, 0.6, p[7]
    expected = []
    for _, of_one in samples.groupby("encounter"):
        found = []
        for sample in of_one.itertuples():
            for angle, own in (
                (sample.los_angle, sample.speed),
                (sample.other_los_angle, sample.other_speed),
            ):
                if own < WALKING:
                    continue
                v = own - 1.1
                at = sample.distance * np.array([np.cos(angle), np.sin(angle)]) - [
                    p[0] + p[1] * v,
                    p[2],
                ]
                axes = a * np.exp(p[4] * v), b * np.exp(p[6] * v)
                norm = np.hypot(at[0] / axes[0], (at[1] - shear * at[0]) / axes[1])
                found.append((norm, (norm - 1) * np.sqrt(axes[0] * axes[1])))
        expected.append(min(found)[1])
    distances = PairPaths.from_samples(samples).distances(p)
    assert np.mean(np.abs(distances - expected)) < 0.01, (
        "a sample left out may have been a little nearer"
    )


@pytest.mark.parametrize("seed", range(4))
def test_the_gradient_is_that_of_finite_differences(seed, estimator):
    likelihood = estimator.likelihood
    p = random_parameters(seed)
    expected = approx_fprime(p, lambda q: likelihood.cost(q)[0], 1e-7)
    assert likelihood.cost(p)[1] == pytest.approx(expected, abs=2e-2, rel=1e-3)


def log_odds_regression(g, g_null):
    """The best log likelihood of a logistic regression that tells data from null model by log g."""

    def cost(intercept):
        odds = intercept + np.log(g), -intercept - np.log(g_null)
        return float(sum(np.logaddexp(0, -each).sum() for each in odds))

    return -minimize_scalar(cost, bracket=(-9, 9), tol=1e-10).fun


def test_the_likelihood_is_that_of_a_logistic_regression(
    estimator,
):
    p = random_parameters(8)
    f, (w, excess, reach), total = expit(p[8]), np.exp(p[9:]), 0.0
    h, h_null = (each.distances(p) for each in (estimator.data, estimator.null))

    def g(h):
        near = 1 + excess * np.exp(-np.maximum(h, 0) / reach)
        return f + (1 - f) * near / (1 + np.exp(-h / w))

    for kind in ("opposite", "crossing"):
        both = (
            g(h[estimator.data.kind == kind]),
            g(h_null[estimator.null.kind == kind]),
        )
        total += log_odds_regression(*both)
        total -= log_odds_regression(*map(np.ones_like, both))
    assert estimator.likelihood.log_ratio(p, h, h_null) == pytest.approx(total)


@pytest.mark.parametrize("seed", range(5))
def test_the_mean_of_g_is_that_of_both_samples(seed):
    """Also where hardly anybody of the null model is near, and many of the data."""
    rng = np.random.default_rng(seed)
    g, g_null = np.exp(rng.normal(seed, 1, 500)), np.full(4000, 0.002)
    g_null[: 2 * seed] = 20.0
    mean, _ = chance_level(g, g_null)
    both = np.concatenate([g, g_null])
    assert (both / (both + 8 * mean)).sum() == pytest.approx(500)
    many = np.exp(rng.normal(0, 0.5, 400_000))
    level, ratio = chance_level(g[:20] / 20, many)
    assert level == pytest.approx(many.mean(), rel=1e-3)
    assert ratio == pytest.approx(np.log(g[:20] / 20 / level).sum(), rel=1e-2)
    assert chance_level(np.ones(20), np.ones(70)) == pytest.approx((1.0, 0.0))


@pytest.mark.slow
def test_the_posterior_has_the_curvature_of_its_density(
    estimator,
):
    """Of well determined parameters the standard deviation is that of the Gaussian with this curvature."""
    likelihood = estimator.likelihood
    names, step, draws = [3, 5], 0.02, estimator.draws.values

    def value(q):
        p = draws.mean(axis=0)
        p[names] += q
        return likelihood.log_posterior(p)

    grid = np.linspace(-4, 4, 17) * step
    density = np.array([[value(np.array([x, y])) for y in grid] for x in grid])
    weight = np.exp(density - density.max())
    of_b = np.sqrt((weight.sum(axis=0) * grid**2).sum() / weight.sum())
    drawn = draws[:, 5].std()
    assert 0.8 * of_b < drawn < 2.5 * of_b, "the other parameters widen it"


def test_intervals_are_those_of_the_posterior(estimator):
    ellipses = estimator.fit_shape([0.9, 1.1]).ellipses
    found = estimate_uncertainty(estimator, ellipses, n_resamples=300, seed=0)
    assert found.description.startswith(f"posterior: {found.n_resamples} draws, ")
    assert "R-hat 1.0" in found.description and found.has_converged
    at = found.intervals[found.intervals["speed"] == 1.1].set_index("quantity")
    for name, truth in {"a": 0.95, "b": 0.7, "center_x": 0.1, "center_y": 0.0}.items():
        low, high = at.loc[name, ["low", "high"]]
        assert abs(truth - (low + high) / 2) <= 0.75 * (high - low), (
            f"{name}: three standard deviations"
        )
    of_b = estimator.draws.values[:, 5]
    assert at.loc["b", "high"] == pytest.approx(
        np.exp(np.quantile(of_b, 0.975)), abs=0.03
    )


@pytest.mark.parametrize("across", [-0.02, 0.02])
def test_the_intervals_of_a_round_zone_are_not_those_of_its_longer_and_shorter_axis(
    estimator, across
):
    """Whichever axis is longer in a draw, the semi-axes of a circle are alike."""
    rng, best = np.random.default_rng(0), np.zeros(12)
    best[[3, 5]] = np.log(0.8), np.log(0.8) + across
    draws = np.tile(best, (4000, 1))
    draws[:, [3, 5]] = np.log(0.8) + rng.normal(0, 0.05, (4000, 2))
    round_one = replace(estimator)
    drawn = replace(estimator.draws, values=draws)
    round_one.__dict__.update(middle=best, draws=drawn)
    a, b, angle = round_one.posterior([1.1]).values[:, 0, 2:].T
    assert (a.mean(), b.mean()) == pytest.approx((0.8, 0.8), abs=0.005)
    assert (a < b).mean() == pytest.approx(0.5, abs=0.05)
    assert np.abs(np.sin(angle)) == pytest.approx(float(across > 0))


def test_the_posterior_is_never_surer_than_the_model_is_right(
    estimator,
):
    draws = estimator.draws
    angles = respect_likelihood.zone_ellipses(draws.values, [1.1])[:, 0, 4]
    draws = replace(draws, values=draws.values[np.abs(angles) < np.pi / 4])
    middle = draws.values.mean(axis=0)
    for scale in (0.01, 1.0):
        sure = replace(estimator)
        near = middle + scale * (draws.values - middle)
        sure.__dict__["draws"] = replace(draws, values=near)
        raw, found = (
            respect_likelihood.zone_ellipses(near, [1.1])[:, 0, :4],
            sure.posterior([1.1]).values,
        )
        assert found[:, 0, :4].mean(axis=0) == pytest.approx(raw.mean(axis=0))
        least = np.array([0.03, 0.01, 0.03, 0.018])
        assert found[:, 0, :4].std(axis=0) == pytest.approx(
            np.maximum(raw.std(axis=0), least)
        )


# --- the default, and what is refused ----------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:at 1.1 m/s fewer than 20")
def test_the_default_is_the_paper_s_where_the_null_model_is_small_or_shows_no_respect(
    data, null
):
    def method(samples, model):
        return szlib.SocialZone.fit(
            samples, null=model, speeds=(1.1,), n_resamples=0
        ).method

    assert method(data, None) == "paper"
    assert (
        method(data, null_of(null.samples[null.samples["encounter"] < 400])) == "paper"
    )
    assert method(passing_pairs(300, 60), null) == "paper"
    assert method(data.drop(columns="other_speed"), null) == "paper"
    assert method(data[data["encounter"] < 200], null) == "paper"


def test_a_zone_that_does_not_contain_its_person_is_no_default(data, null, monkeypatch):
    shifted = np.zeros(12)
    shifted[[0, 3, 5]] = 0.5, np.log(0.4), np.log(0.4)
    monkeypatch.setattr(RespectEstimator, "middle", shifted)
    with pytest.raises(szlib.ZoneError, match="does not contain its person"):
        szlib.SocialZone.fit(
            data, method="respect", null=null, speeds=(1.1,), n_resamples=0
        )
    assert (
        szlib.SocialZone.fit(data, null=null, speeds=(1.1,), n_resamples=0).method
        == "paper"
    )


def test_what_cannot_be_compared_is_refused(data, null):
    with pytest.raises(
        szlib.ZoneError, match=r"needs a null model; pass null=szlib\.null_encounters"
    ):
        RespectEstimator.from_samples(data, r_max=R_MAX)
    with pytest.raises(
        szlib.ZoneError, match=r"r_max is 1\.5 m, that of the null model 2\.0 m"
    ):
        RespectEstimator.from_samples(data, r_max=1.5, null=null)
    with pytest.raises(
        szlib.ZoneError, match=r"0 encounters of the data and \d+ of the null model"
    ):
        prepare(data.assign(distance=3.0), null)
    with pytest.raises(
        szlib.ZoneError,
        match="0 encounters of the data and 0 of the null model, of the kinds opposite",
    ):
        prepare(data.assign(kind="following"), null)
    with pytest.raises(szlib.DataError, match="other_speed"):
        prepare(data.drop(columns="other_speed"), null)
    with pytest.raises(szlib.DataError, match="finite"):
        prepare(
            data.assign(
                distance=np.where(np.arange(len(data)) == 5, np.nan, data["distance"])
            ),
            null,
        )


def test_a_person_who_stands_or_has_no_velocity_carries_no_ellipse(
    data,
):
    few = data[data["encounter"] < 200]
    unknown = few.assign(other_speed=np.nan, other_los_angle=np.nan)
    standing = PairPaths.from_samples(few.assign(other_speed=0.2))
    np.testing.assert_array_equal(PairPaths.from_samples(unknown).x, standing.x)
    assert len(standing.first) == few["encounter"].nunique()
