"""Uncertainty: counts by side, resampling units, coverage of intervals."""

import numpy as np
import pandas as pd
import pytest
from helpers.passers import passers
from scipy.stats import norm
from studies.quantile_zone import QuantileEstimator

import szlib
from szlib.zones.estimators import Estimator
from szlib.zones.uncertainty import (
    _MAX_FAILED,
    MIN_DAYS,
    MIN_ENCOUNTERS,
    QUANTITIES,
    SIDES,
    count_by_side,
    describe_missing_sides,
    estimate_uncertainty,
    resampling_units,
)

SPEEDS = (1.1,)


def fit(samples, **options):
    return szlib.SocialZone.fit(
        samples, speeds=SPEEDS, **{"method": "quantile", **options}
    )


@pytest.fixture(scope="module")
def samples():
    return passers(300)


def test_each_side_counts_encounters_not_samples():
    rows = [
        (0, 0.0, 1.0, 1.0), (0, 0.1, 1.0, 1.0),  # one, ahead
        (1, np.pi, 1.0, 1.15), (2, -np.pi, 1.0, 0.85),  # two, behind
        (3, np.pi / 2, 1.0, 1.0), (3, -np.pi / 2, 1.0, 1.0),  # one that passes from left to right
        (4, np.pi / 4, 3.0, 1.0), (5, np.pi / 4, 1.0, 1.5),  # too far, too fast
    ]  # fmt: skip
    table = pd.DataFrame(rows, columns=["encounter", "los_angle", "distance", "speed"])
    seen = count_by_side(table, (1.0, 1.5), r_max=2.0)
    assert seen["encounters"].tolist() == [4, 1]
    one = {"ahead": 1, "behind": 2, "left": 1, "right": 1}
    assert seen.loc[0, list(SIDES)].to_dict() == {
        side: one.get(side, 0) for side in SIDES
    }
    assert seen.loc[1, list(SIDES)].sum() == seen.loc[1, "ahead left"] == 1


def test_missing_sides_are_named():
    seen = pd.DataFrame(
        [
            [1.0, 99, *[MIN_ENCOUNTERS] * 8],
            [1.2, 99, *[MIN_ENCOUNTERS] * 7, MIN_ENCOUNTERS - 1],
        ]
    )
    seen.columns = ["speed", "encounters", *SIDES]
    assert describe_missing_sides(seen, 1.0) == ""
    for speed in (1.1, 1.2):  # between, the poorer neighbour counts
        message = (
            f"at {speed:g} m/s fewer than 20 encounters were seen ahead right (19)"
        )
        assert describe_missing_sides(seen, speed) == message
    assert (
        describe_missing_sides(seen, 1.3)
        == "at 1.3 m/s no encounters were counted (only at 1 to 1.2 m/s)"
    )


def test_pairs_are_resampled_or_days_if_there_are_many():
    table = pd.DataFrame(
        {"day": ["a", "a", "a", "b"], "ref_id": [1, 2, 1, 1], "other_id": [2, 1, 3, 2]}
    )
    unit, member = resampling_units(table)
    assert unit == "pairs"
    assert member[0] == member[1]  # whoever looks at whom
    assert len(set(member)) == 3
    unit, member = resampling_units(table.drop(columns=["ref_id"]))
    assert (unit, member.tolist()) == ("encounters", [0, 1, 2, 3])
    days = pd.DataFrame(
        {"day": np.arange(2 * MIN_DAYS) // 2, "ref_id": 1, "other_id": 2}
    )
    unit, member = resampling_units(days)
    assert (unit, member.tolist()) == ("days", days["day"].tolist())


def test_intervals_are_the_same_for_the_same_seed_only(samples):
    one, same, other = (
        fit(samples, n_resamples=30, seed=seed).uncertainty for seed in (0, 0, 1)
    )
    pd.testing.assert_frame_equal(one.intervals, same.intervals)
    assert not one.intervals.equals(other.intervals)
    assert one.intervals["quantity"].tolist() == list(QUANTITIES)
    assert (one.intervals["low"] < one.intervals["high"]).all()
    assert (one.bands["low"] < one.bands["high"]).all()
    assert (one.unit, one.level, one.n_resamples) == ("pairs", 0.95, 30)


def test_more_people_make_narrower_intervals():
    few, many = (
        fit(passers(n), n_resamples=60).uncertainty.intervals for n in (150, 2400)
    )
    ratio = (many["high"] - many["low"]) / (few["high"] - few["low"])
    assert ratio.median() == pytest.approx(1 / 4, abs=0.12)


@pytest.mark.parametrize("method", ["quantile", "hull"])
def test_second_view_of_a_pair_does_not_narrow_the_interval(samples, method):
    """The other person's view of the same encounter makes the interval no narrower."""
    twice = pd.concat(
        [
            samples,
            samples.assign(
                encounter=samples["encounter"] + 1000, t=samples["t"] + 0.01
            ),
        ]
    )
    options = {"method": method, "n_resamples": 30}
    if method == "hull":
        options |= {"fraction": 0.0}
    one, two = (fit(table, **options).uncertainty for table in (samples, twice))
    assert f"of {samples['encounter'].nunique()} pairs" in one.description
    assert one.description == two.description
    np.testing.assert_allclose(
        one.intervals[["low", "high"]], two.intervals[["low", "high"]], atol=1e-9
    )


def test_hull_interval_lies_inside_the_hull():
    """People keep out of a zone that no sample shows whole: the interval reaches farther in than the hull."""
    samples = passers(300)
    zone = fit(samples, method="hull", fraction=0.0, n_resamples=60)
    area = zone.table().iloc[0]
    assert area["area_low"] < area["area_high"] < area["area"]
    assert "subsampling: 75 of 300 pairs" in zone.uncertainty.description
    truth = np.pi * 0.95 * 0.75
    assert area["area_low"] < truth < area["area"]


def test_intervals_contain_the_limit():
    """In short: 25 data sets of 200 pairs; 200 plazas are in notebooks/tables/25_coverage.csv."""
    limit = fit(passers(20_000, seed=99), n_resamples=0).table().iloc[0]
    held = []
    for seed in range(25):
        known = fit(
            passers(200, seed=seed), n_resamples=60
        ).uncertainty.intervals.set_index("quantity")
        held.append(
            [
                known.loc[q, "low"] <= limit[q] <= known.loc[q, "high"]
                for q in QUANTITIES
            ]
        )
    # 95 %, less four standard errors of 25 x 6 that are not independent
    assert np.mean(held) >= 0.85


def test_resamples_without_a_zone_leave_no_interval():
    """Three people seen around more than half of the circle: without one of them there is no zone."""
    three = passers(3, seed=4)
    with pytest.warns(szlib.DataWarning, match="fewer than 20"):
        zone = fit(three, n_resamples=40)
    assert zone.table().filter(regex="_low$|_high$").isna().all(axis=None)


@pytest.mark.parametrize("resamples", [1, -3, 2.5])
def test_invalid_n_resamples_is_refused(samples, resamples):
    with pytest.raises(szlib.DataError, match="resamples must be a whole number"):
        estimate_uncertainty(
            QuantileEstimator.from_samples(samples, r_max=2.0),
            known_ellipses(5.0),
            n_resamples=resamples,
            seed=0,
        )


def known_ellipses(ahead, angle=0.0):
    """Ellipses with a centre `ahead` [m], at all `SPEEDS`."""
    return {v: szlib.Ellipse((ahead, 0.0), (1.0, 0.7), angle) for v in SPEEDS}


class Known(Estimator):
    """An estimator whose ellipses are known: around 5 m ahead in the resamples."""

    def fit_shape(self, speeds):
        raise NotImplementedError

    def refit(self, weights, speeds):
        ellipses = np.tile([5.0, 0.0, 1.0, 0.7, 0.0], (len(weights), len(speeds), 1))
        ellipses[..., 0] += self.parameters["differences"][:, None]
        return ellipses


class KnownExtreme(Known):
    """As `Known`, of an extreme."""

    is_extreme = True


def interval(differences, kind=Known, n=30):
    """Low and high of the centre ahead, if it differs so in the resamples of `n` encounters."""
    encounters = pd.DataFrame({"encounter": range(n)})
    parameters = {"differences": np.random.default_rng(0).permuted(differences)}
    found = estimate_uncertainty(
        kind(encounters=encounters, parameters=parameters, funnel=[]),
        known_ellipses(5.0),
        n_resamples=len(differences),
        seed=0,
    ).intervals.set_index("quantity")
    return found.loc["center_x", ["low", "high"]].to_numpy(float)


def test_intervals_are_quantiles_of_the_differences():
    differences = np.linspace(-1, 3, 4001)
    factor = np.sqrt(1 / 2) / (1 - np.sqrt(1 / 2))  # one of two encounters, rate 1/2
    found = interval(differences, KnownExtreme, n=2)
    expected = (5 - 2.9 * factor, 5 + 0.9 * factor)
    assert found == pytest.approx(expected), "mirrored, times the factor"
    assert interval(differences - 1) == pytest.approx((5 - 1.9, 5 + 1.9)), "no bias"


def test_percentiles_are_corrected_for_bias():
    """A share of 60 % lies below: both levels are moved up by twice its normal quantile."""
    bias = 2 * norm.ppf((600 + 1 / 2) / 1001)
    levels = norm.cdf(bias + norm.ppf([0.025, 0.975]))
    found = interval(np.linspace(-0.6, 0.4, 1001))
    assert found == pytest.approx(5 - 0.6 + levels, abs=1e-9)


def test_an_interval_needs_a_zone_in_most_resamples():
    differences = np.linspace(-1, 1, 100)
    failed = int(_MAX_FAILED * 100)
    differences[:failed] = np.nan
    assert np.isfinite(interval(differences)).all()
    differences[: failed + 1] = np.nan
    assert np.isnan(interval(differences)).all()


class Turning(Estimator):
    """An estimator whose ellipse is at 91 degrees in every resample."""

    def fit_shape(self, speeds):
        raise NotImplementedError

    def refit(self, weights, speeds):
        ellipse = [0.0, 0.0, 1.0, 0.7, np.radians(-89)]
        return np.broadcast_to(ellipse, (len(weights), len(speeds), 5))


def test_an_axis_has_no_direction():
    encounters = pd.DataFrame({"encounter": range(30)})
    estimator = Turning(encounters=encounters, parameters={}, funnel=[])
    ellipses = known_ellipses(0.0, np.radians(89))
    found = estimate_uncertainty(estimator, ellipses, n_resamples=20, seed=0).intervals
    angle = found[found["quantity"] == "angle_deg"].iloc[0]
    assert (angle["low"], angle["high"]) == pytest.approx((91, 91))
