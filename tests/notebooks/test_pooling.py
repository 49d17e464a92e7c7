"""Pooling over sites: published numbers, closed forms, coverage of the truth, invariances, refusals."""

import numpy as np
import pandas as pd
import pytest
from scipy import stats
from studies import quantile_zone
from studies.pooling import pool

import szlib

Z = stats.norm.ppf(0.975)
# Thirteen trials of the BCG vaccine (Colditz et al., JAMA 271, 1994): cases and others, treated and controls.
BCG = """
4 119 11 128; 6 300 29 274; 3 228 11 209; 62 13536 248 12619; 33 5036 47 5761; 180 1361 372 1079;
8 2537 10 619; 505 87886 499 87892; 29 7470 45 7232; 17 1699 65 1600; 186 50448 141 27197; 5 2493 3 2338;
27 16886 29 17825"""
SITES = {
    "hall": (0.9, 0.8, 1.0),
    "mall": (1.2, 1.0, 1.4),
    "lab": (0.6, 0.5, 0.7),
    "yard": (1.0, 0.7, 1.4),
}


def triples(y, errors):
    pairs = zip(y, errors, strict=True)
    return {f"{i}": (v, v - Z * e, v + Z * e) for i, (v, e) in enumerate(pairs)}


def numbers(pooled):
    return [pooled.mean, pooled.low, pooled.high, pooled.new_low, pooled.new_high]


def test_bcg_trials_give_the_published_numbers():
    """tau^2 = 0.318 by Paule and Mandel; by restricted likelihood it is 0.313, with mean -0.7145."""
    a, b, c, d = np.array([row.split() for row in BCG.split(";")], float).T
    ratio, variance = (
        np.log(a / (a + b) / (c / (c + d))),
        1 / a - 1 / (a + b) + 1 / c - 1 / (c + d),
    )
    pooled = pool(triples(ratio, np.sqrt(variance)), quantity="center_x")
    assert pooled.tau**2 == pytest.approx(0.318, abs=5e-4)
    assert pooled.mean == pytest.approx(-0.715, abs=5e-4)
    standard = 1 / np.sqrt((1 / (variance + pooled.tau**2)).sum())
    assert pooled.high - pooled.mean == pytest.approx(stats.t.ppf(0.975, 12) * standard)
    likelihood = {
        tau2: restricted_likelihood(ratio, variance, tau2)
        for tau2 in np.arange(0.2, 0.5, 0.0001)
    }
    assert max(likelihood, key=lambda tau2: likelihood[tau2]) == pytest.approx(
        0.3132, abs=1e-4
    )


def restricted_likelihood(y, variance, tau2):
    weight = 1 / (variance + tau2)
    mean = (weight * y).sum() / weight.sum()
    return (
        float(
            np.log(weight).sum()
            - np.log(weight.sum())
            - (weight * (y - mean) ** 2).sum()
        )
        / 2
    )


def test_equal_errors_give_the_interval_of_the_ordinary_t_test():
    y = np.array([0.3, 0.9, 0.1, 0.5, 1.2])
    pooled = pool(triples(y, np.full(5, 0.2)), quantity="center_y")
    expected = stats.ttest_1samp(y, 0).confidence_interval(0.95)
    assert (pooled.low, pooled.high) == pytest.approx(tuple(expected))
    assert pooled.tau**2 == pytest.approx(y.var(ddof=1) - 0.2**2)
    reach = stats.t.ppf(0.975, 3) * np.sqrt(pooled.tau**2 + y.var(ddof=1) / 5)
    assert pooled.new_high - pooled.mean == pytest.approx(reach)
    assert pooled.table["weight"].tolist() == pytest.approx([0.2] * 5)


def test_sites_that_differ_less_than_by_chance_have_one_value():
    pooled = pool({"a": (1.0, 0.5, 1.5), "b": (1.01, 0.5, 1.5), "c": (0.99, 0.9, 1.1)})
    assert pooled.tau == 0
    assert pooled.table["weight"].iloc[2] > 0.8


@pytest.mark.parametrize(("k", "tau"), [(4, 0.3), (7, 0.2), (10, 0.4)])
def test_intervals_hold_mean_and_new_site(k, tau):
    rng, held, n = np.random.default_rng(k), np.zeros(2), 400
    for _ in range(n):
        errors = np.exp(rng.normal(np.log(0.1), 0.4, k))
        y = rng.normal(0, tau, k) + rng.normal(0, errors)
        pooled, new = (
            pool(triples(y, errors), quantity="center_x"),
            rng.normal(0, tau),
        )
        held += [pooled.low < 0 < pooled.high, pooled.new_low < new < pooled.new_high]
    assert (held / n >= 0.9).all() and (held / n <= 0.98).all(), held / n


# --- invariances -------------------------------------------------------------------------------------


def test_order_of_the_sites_changes_nothing():
    again = pool(dict(reversed(SITES.items())))
    assert numbers(again) == pytest.approx(numbers(pool(SITES)), rel=1e-9)


@pytest.mark.parametrize("quantity", ["radius", "a", "b", "area"])
def test_positive_quantities_follow_their_unit(quantity):
    pooled, scale = pool(SITES, quantity=quantity), 100.0
    scaled = {name: tuple(scale * v for v in site) for name, site in SITES.items()}
    again = pool(scaled, quantity=quantity)
    assert numbers(again) == pytest.approx([scale * v for v in numbers(pooled)])
    assert again.tau == pytest.approx(pooled.tau)
    assert again.new_low > 0


def test_offsets_of_the_centre_move_with_their_origin():
    moved = {name: tuple(v - 1 for v in site) for name, site in SITES.items()}
    expected = [v - 1 for v in numbers(pool(SITES, quantity="center_x"))]
    assert numbers(pool(moved, quantity="center_x")) == pytest.approx(expected)


# --- zones -------------------------------------------------------------------------------------------


def zone(seed, n_resamples=30):
    rng, n = np.random.default_rng(seed), 600
    table = {
        "encounter": np.arange(n),
        "los_angle": rng.uniform(-np.pi, np.pi, n),
        "speed": rng.uniform(1.0, 1.2, n),
    }
    samples = pd.DataFrame(table).assign(distance=rng.uniform(0.9, 2.5, n))
    options = {"speeds": [1.1], "n_resamples": n_resamples}
    return szlib.SocialZone.fit(samples, method=quantile_zone.NAME, **options)


def test_zones_are_pooled_by_their_ellipse_and_its_interval():
    zones = {"first": zone(1), "second": zone(2), "third": zone(3)}
    for quantity, column in (
        ("radius", "area"),
        ("a", "a"),
        ("center_x", "center_x"),
        ("area", "area"),
    ):
        given = {}
        for name, each in zones.items():
            row = (
                each.table()
                .iloc[0][[column, f"{column}_low", f"{column}_high"]]
                .astype(float)
            )
            given[name] = tuple(np.sqrt(row / np.pi) if quantity == "radius" else row)
        expected = pool(given, quantity=quantity)
        assert numbers(pool(zones, quantity=quantity)) == numbers(expected)
    a, b = zones["first"].ellipse(1.1).semi_axes
    assert pool(zones).table["value"].iloc[0] == pytest.approx(np.sqrt(a * b))


def test_zones_without_an_interval_or_at_other_speeds_are_refused():
    zones = {"hall": zone(1), "bare": zone(2, n_resamples=0)}
    with pytest.raises(
        szlib.ZoneError,
        match=r"site 'bare': radius at 1.1 m/s: the zone has no interval",
    ):
        pool(zones)
    with pytest.raises(szlib.ZoneError, match=r"site 'hall': .* fitted at \[1.1\] m/s"):
        pool(zones, speed=0.9)


# --- few sites, wrong sites --------------------------------------------------------------------------


def test_two_sites_give_no_interval_of_a_new_one_and_say_why():
    pooled = pool({name: SITES[name] for name in ("hall", "mall")})
    assert np.isnan([pooled.new_low, pooled.new_high]).all()
    assert np.isfinite([pooled.mean, pooled.low, pooled.high]).all()
    assert "no interval of a new site, which needs 3 sites" in str(pooled)


def test_it_prints_one_line_with_units():
    text = str(pool(SITES))
    assert text.startswith("radius over 4 sites: mean 0.89 m (its 95 % interval ")
    assert "\n" not in text and "prediction interval" in text


@pytest.mark.parametrize(
    ("site", "said"),
    [
        ((1.0, -0.1, 2.0), "got 1, -0.1, 2"),
        ((1.0, 1.1, 2.0), "got 1, 1.1, 2"),
        ((1.0, 1.0, 1.0), "low < high"),
        ((1.0, float("nan"), 2.0), "got 1, nan, 2"),
        ((1.0, 0.5, float("inf")), "got 1, 0.5, inf"),
        ((1.0, 0.5), "expected a SocialZone, or value, low, high"),
        (1.0, "expected a SocialZone, or value, low, high"),
        (szlib.Ellipse(center=(0, 0), semi_axes=(1, 0.7)), "expected a SocialZone"),
    ],
)
def test_site_without_an_interval_around_its_value_is_named(site, said):
    with pytest.raises(szlib.ZoneError, match="site 'wrong'") as raised:
        pool({**SITES, "wrong": site})
    assert said in str(raised.value)


def test_one_site_and_an_unknown_quantity_are_refused():
    for sites in ({}, {"hall": SITES["hall"]}, [SITES["hall"]] * 2):
        with pytest.raises(szlib.ZoneError, match="two or more sites by name"):
            pool(sites)  # type: ignore[arg-type]
    with pytest.raises(
        szlib.ZoneError, match="'growth' cannot be pooled; expected one of radius"
    ):
        pool(SITES, quantity="growth")
