"""Claims: effects whose intervals mean what they say, and verdicts that follow from them."""

import numpy as np
import pandas as pd
import pytest
from helpers.passing_pairs import null_of, passing_pairs, respecting
from studies import chains as chains_study
from studies import paper_claims as claims
from studies.claims import measure_density
from studies.sensitivity import sensitivity

import szlib


def finding(low, high):
    return claims.Finding("people keep apart", (low + high) / 2, low, high, "m", 12)


def test_the_verdict_follows_from_the_interval():
    assert finding(0.1, 0.2).verdict == "supported"
    assert finding(-0.2, -0.1).verdict == "not supported"
    assert finding(-0.1, 0.2).verdict == "not decidable with n = 12"
    table = claims.tabulate_findings([finding(0.1, 0.3)], data="here")
    assert table.loc[0, ["data", "n", "verdict"]].tolist() == ["here", 12, "supported"]
    assert (
        claims.format_finding(table.iloc[0])
        == "+0.20 m (95 % interval +0.10 to +0.30): supported"
    )


def meetings(on_the_left, on_the_right):
    """Encounters of people who walk towards each other; the other is nearest on that side."""
    n = on_the_left + on_the_right
    side = np.repeat([1.0, -1.0], [on_the_left, on_the_right])
    return pd.DataFrame(
        {
            "encounter": np.repeat(np.arange(n), 3), "day": "d", "ref_id": np.repeat(2 * np.arange(n), 3),
            "other_id": np.repeat(2 * np.arange(n) + 1, 3), "distance": np.tile([2.0, 0.8, 2.0], n),
            "los_angle": np.repeat(side, 3) * np.tile([0.1, 1.5, 3.0], n), "kind": "opposite",
        }
    )  # fmt: skip


def test_a_person_to_the_left_is_passed_on_the_right():
    assert claims.measure_passing_side(meetings(60, 20)).verdict == "supported"
    assert claims.measure_passing_side(meetings(20, 60)).verdict == "not supported"
    even = claims.measure_passing_side(meetings(10, 10))
    assert even.effect == 0 and even.low == pytest.approx(-even.high)
    assert claims.measure_passing_side(meetings(3, 3).assign(kind="crossing")).n == 0
    # the nearest approach a little to the side of straight ahead
    oblique = meetings(60, 20)
    oblique["los_angle"] = np.copysign(0.2, oblique["los_angle"])
    assert (
        claims.measure_passing_side(oblique).effect
        == claims.measure_passing_side(meetings(60, 20)).effect
    )


def test_a_pair_counts_once():
    once = meetings(30, 10)
    both = pd.concat([once, once.rename(columns={"ref_id": "other_id", "other_id": "ref_id"}).assign(
        encounter=once["encounter"] + 1000)])  # fmt: skip
    assert (
        claims.measure_passing_side(both).n == claims.measure_passing_side(once).n == 40
    )


@pytest.mark.parametrize(
    ("share", "verdict"),
    [(0.25, "supported"), (1.0, "not decidable"), (4.0, "not supported")],
)
def test_density_is_low_only_in_an_area_with_fewer_people_than_around_it(
    share, verdict
):
    rng, n = np.random.default_rng(0), 20_000
    area = szlib.Square((2.0, 6.0), (2.0, 8.0))
    x, y = rng.uniform(0, 10, (2, n))
    inside = area.contains(x, y)
    stays = rng.uniform(size=n) < np.where(inside, share, 1.0) / max(share, 1.0)
    rows = {
        "day": "d",
        "id": rng.integers(500, size=n),
        "t": rng.uniform(0, 5 * 3600, n),
        "x": x,
        "y": y,
    }
    found = measure_density(pd.DataFrame(rows)[stays], area)
    assert found.verdict.startswith(verdict)
    assert found.n == 5 and found.effect == pytest.approx(-np.log2(share), abs=0.1)


@pytest.mark.parametrize(
    ("count", "days", "verdict"),
    [(16_181, 92, "supported"), (252, 1, "supported"), (40, 1, "not supported"), (90, 1, "not decidable"),
     (40_000, 92, "not supported")],
)  # fmt: skip
def test_the_papers_own_rate_is_supported_and_a_fifth_of_it_is_not(
    count, days, verdict
):
    assert claims.measure_encounter_rate(count, days).verdict.startswith(verdict)


def test_an_interval_of_a_rate_covers_it():
    rng, inside = np.random.default_rng(0), 0
    truth = claims.measure_encounter_rate(300, 2.0).effect
    for count in rng.poisson(300, 400):
        found = claims.measure_encounter_rate(int(count), 2.0)
        inside += found.low <= truth <= found.high
    assert 0.92 <= inside / 400 <= 0.99


def test_wilsons_interval_contains_zero_for_equal_shares():
    rng = np.random.default_rng(1)
    undecided = [
        claims.measure_intruders_removed(int(k), 80) for k in rng.binomial(80, 0.5, 400)
    ]
    assert 0.92 <= np.mean([f.low <= 0 <= f.high for f in undecided]) <= 0.98


def test_what_lof_removes_may_be_people():
    assert claims.measure_intruders_removed(60, 80).verdict == "supported"
    assert claims.measure_intruders_removed(20, 80).verdict == "not supported"
    assert claims.measure_intruders_removed(0, 0).verdict.startswith("not decidable")


def zone_of(people, **options):
    return szlib.SocialZone.fit(
        people, method="quantile", speeds=(0.7, 1.1, 1.3), **options
    )


def test_the_plaza_is_larger_ahead_and_grows_as_it_was_made_to(
    plaza,
):
    zone = zone_of(plaza, n_resamples=60)
    ahead, growth = (
        claims.measure_reach_ahead(zone),
        claims.measure_growth_with_speed(zone),
    )
    assert ahead.verdict == growth.verdict == "supported"
    true = szlib.PlazaSettings().true_zone
    assert growth.low <= true(1.3).area - true(0.7).area <= growth.high
    assert 0 < ahead.effect < 2 * true(1.1).center[0] + 0.05
    row = zone.table().set_index("speed").loc[0.7]
    assert growth.high - growth.low >= row["area_high"] - row["area_low"]
    with pytest.raises(
        szlib.ZoneError, match=r"no interval at 1\.2 m/s; fit with this speed"
    ):
        claims.measure_reach_ahead(zone, speed=1.2)


@pytest.fixture(scope="module")
def plaza(tmp_path_factory):
    """Encounters of the plaza, whose zone reaches farther ahead and grows with speed."""
    path = tmp_path_factory.mktemp("plaza") / "plaza.csv"
    return szlib.find_encounters(szlib.read_tracks(szlib.make_plaza(path, seed=3)))


def test_the_reach_ahead_is_the_difference_of_both_reaches(plaza):
    zone = zone_of(plaza, n_resamples=20)
    outline = zone.ellipses[1.1].curve(2000)
    found, row = (
        claims.measure_reach_ahead(zone),
        zone.table().set_index("speed").loc[1.1],
    )
    assert found.effect == pytest.approx(
        outline[:, 0].max() + outline[:, 0].min(), abs=1e-5
    )
    assert (found.low, found.high) == pytest.approx(
        (2 * row["center_x_low"], 2 * row["center_x_high"])
    )
    assert found.n == row["encounters"]


def test_zones_that_reach_farther_behind_or_shrink_contradict_the_paper(
    plaza,
):
    zone = zone_of(plaza.assign(los_angle=np.pi - plaza["los_angle"]), n_resamples=60)
    assert claims.measure_reach_ahead(zone).verdict == "not supported"
    assert (
        claims.measure_growth_with_speed(zone, slow=1.3, fast=0.7).verdict
        == "not supported"
    )


def test_zones_without_people_on_some_side_decide_nothing(plaza):
    ahead = plaza[np.cos(plaza["los_angle"]) > 0.2]
    with pytest.warns(szlib.DataWarning):
        zone = zone_of(ahead, n_resamples=20)
    assert not zone.adequate(1.1)
    for found in (
        claims.measure_reach_ahead(zone),
        claims.measure_growth_with_speed(zone),
    ):
        assert found.verdict.startswith("not decidable")


@pytest.mark.slow
def test_a_shape_is_a_difference_from_the_null_model():
    crowd, null = passing_pairs(1000, 1), null_of(passing_pairs(2000, 0))
    people = respecting(crowd, szlib.Ellipse((0.0, 0.0), (0.9, 0.7)), careless=0.05)
    ahead, growth = claims.measure_shape(people, null)
    assert (ahead.claim, growth.claim) == (claims.LARGER_AHEAD, claims.GROWS_WITH_SPEED)
    assert (
        ahead.low < 0 < ahead.high
        and ahead.low <= ahead.effect <= ahead.high
        and ahead.n > 600
    )
    assert (
        growth.low <= growth.effect <= growth.high
        and growth.effect < 0.2
        and growth.reason == ""
    )
    larger = 0.4 + 0.4 * crowd[["speed", "other_speed"]].max(axis=1)
    entered = crowd["encounter"][crowd["distance"] < larger].unique()
    _, grown = claims.measure_shape(crowd[~crowd["encounter"].isin(entered)], null)
    assert grown.verdict == "supported" and grown.effect > 0.2


def test_a_shape_that_cannot_be_given_has_a_reason():
    crowd, null = passing_pairs(400, 1), null_of(passing_pairs(1000, 0))
    few = crowd[crowd["encounter"].isin(crowd["encounter"].unique()[:100])]
    for people, model, reason in (
        (
            crowd,
            null,
            "no respect zone: people who ignore each other explain the data nearly as well",
        ),
        (
            few,
            null,
            "150 encounters of people who cross or come towards each other needed",
        ),
        (crowd, None, 'method="respect" needs a null model'),
    ):
        for found in claims.measure_shape(people, model):
            assert (
                np.isnan(found.effect)
                and not found.adequate
                and reason in found.verdict
            )
            assert (
                claims.format_finding(
                    claims.tabulate_findings([found], data="").iloc[0]
                )
                == found.verdict
            )


def test_delays_have_their_range_over_scenarios(
    monkeypatch,
):
    zone, times = (
        szlib.Ellipse((0.0, 0.0), (1.0, 0.7)),
        {"passing": 3.0, "corridor": 5.0, "waiting": 1.0},
    )

    def run_scenario(name, zone):
        return {"time_to_goal": 10 + times[name] * zone.semi_axes[0]}

    monkeypatch.setattr(claims, "run_scenario", run_scenario)
    found = claims.measure_delay_by_size(zone, scales=(1.0, 1.5, 2.0), names=times)
    assert (found.effect, found.low, found.high, found.n) == (3.0, 1.0, 5.0, 3)
    assert (found.claim, found.verdict) == (
        "a zone 2.0 times as large makes the robot later",
        "supported",
    )
    assert str(found) == "+3.00 s (range over scenarios +1.00 to +5.00): supported"
    table = claims.tabulate_findings([found, finding(0.1, 0.3)], data="here")
    assert table["interval"].tolist() == ["range over scenarios", "95 % interval"]
    times["waiting"] = -1.0
    mixed = claims.measure_delay_by_size(zone, scales=(1.0, 2.0), names=times)
    assert mixed.low == -1 and mixed.verdict == "not decidable with n = 3"
    earlier = claims.measure_delay_by_size(
        zone, scales=(2.0, 1.0), names=("passing", "corridor")
    )
    assert earlier.verdict == "not supported"


def test_a_larger_zone_makes_the_robot_later():
    zone = szlib.Ellipse((0.05, 0.0), (0.9, 0.7))
    found = claims.measure_delay_by_size(zone, names=("passing", "corridor"))
    assert found.low > 0 and found.n == 2
    assert zone.scaled(2.0) == szlib.Ellipse((0.1, 0.0), (1.8, 1.4))


@pytest.mark.slow
def test_sensitivity_varies_one_parameter_at_a_time(tmp_path):
    settings = szlib.PlazaSettings(n_encounters=250)
    tracks = szlib.read_tracks(
        szlib.make_plaza(tmp_path / "plaza.csv", seed=0, settings=settings)
    )
    table = sensitivity(tracks, area=szlib.ATC_SQUARE)
    assert table.loc[0, "parameter"] == "default" and np.isfinite(table.loc[0, "area"])
    assert {"min_distance", "duration", "kinds", "area", "r_max", "speed"} <= set(
        table["parameter"]
    )
    assert (
        table.loc[table["parameter"] == "r_max", "encounters"]
        == table.loc[0, "encounters"]
    ).all()
    assert table.loc[
        table["parameter"] == "min_distance", "encounters"
    ].is_monotonic_decreasing
    samples = szlib.find_encounters(tracks, area=szlib.ATC_SQUARE)
    zone = szlib.SocialZone.fit(samples, method="paper", speeds=[1.1], n_resamples=0)
    assert tuple(table.loc[0, ["a", "b"]]) == zone.ellipse(1.1).semi_axes, (
        "the paper's zone to the letter"
    )


def test_without_a_zone_a_claim_is_not_decidable():
    rng = np.random.default_rng(0)
    fast = pd.DataFrame(
        {
            "encounter": np.repeat(np.arange(200), 5),
            "speed": rng.normal(1.5, 0.05, 1000),
            "los_angle": rng.uniform(-np.pi, np.pi, 1000),
            "distance": rng.uniform(0.8, 2.5, 1000),
        }
    )
    with pytest.warns(szlib.DataWarning):
        zone = szlib.SocialZone.fit(
            fast, method="hull", speeds=(0.7, 1.5), n_resamples=5
        )
    found = claims.measure_growth_with_speed(zone, slow=0.7, fast=1.5)
    assert np.isnan(found.effect) and found.verdict.startswith("not decidable")


TILTED = szlib.Ellipse((0.03, 0.0), (0.96, 0.75), 0.02)


@pytest.fixture(scope="module")
def chains():
    letter = szlib.MPCSettings.paper()
    ours = szlib.MPCSettings(time_limit=np.inf)
    names, larger = ("passing", "waiting"), TILTED.scaled(1.2)
    table = chains_study.compare_chains((TILTED, letter), (larger, ours), names=names)
    return table.set_index(["scenario", "chain"])


def test_each_difference_is_switched_on_alone(chains):
    assert list(chains.loc["passing"].index) == [
        "paper",
        "zone",
        "margin",
        "side rule",
        "ours",
    ]
    passing, waiting = chains.loc["passing"], chains.loc["waiting"]
    assert not passing.loc["paper", "changed"] and not waiting.loc["paper", "changed"]
    assert not passing.loc["margin", "changed"], "the scenario has no walls"
    assert (
        passing.loc["zone", "changed"] and passing.loc["zone", "passing_side"] == "left"
    )
    assert passing.loc["zone", "time_to_goal"] > passing.loc["paper", "time_to_goal"]
    assert waiting.loc["side rule", "min_h"] == waiting.loc["paper", "min_h"]
    assert waiting.loc["margin", "min_h"] != waiting.loc["paper", "min_h"]


def test_the_side_is_due_to_the_rule_and_not_to_the_paper(chains):
    sides = chains.loc["passing", "passing_side"]
    assert sides[["side rule", "ours"]].tolist() == ["right", "right"]
    mirrored = szlib.Ellipse((0.03, 0.0), (0.96, 0.75), -0.02)
    settings = szlib.MPCSettings.paper()
    log = szlib.simulate(
        szlib.SCENARIOS["passing"], szlib.MPCCBF(mirrored, settings=settings)
    )
    assert (sides["paper"], log.metrics()["passing_side"]) == ("left", "right")


@pytest.mark.parametrize(
    ("change", "differs"),
    [
        ({}, False), ({"time_to_goal": 10.2}, False), ({"min_h": 0.115}, False), ({"min_speed": 0.46}, False),
        ({"time_to_goal": 10.3}, True), ({"min_h": 0.13}, True), ({"min_speed": 0.44}, True),
        ({"passing_side": "left"}, True), ({"claims_held": 1}, True), ({"claims_held": 3}, True),
        ({"time_to_goal": np.nan}, True),
    ],
)  # fmt: skip
def test_a_run_differs_in_a_number_a_side_or_a_claim(change, differs):
    row = {
        "time_to_goal": 10.0,
        "min_h": 0.1,
        "min_speed": 0.5,
        "passing_side": "right",
        "claims_held": 2,
    }
    assert chains_study.differs(row | change, row) == differs
    stuck = row | {"time_to_goal": np.nan}
    assert not chains_study.differs(stuck, stuck)


def test_the_interval_of_a_rate_is_exact():
    """Of 10 encounters seen, the mean is 4.795 to 18.39 (Garwood, Biometrika 28, 1936)."""
    days = 10 / claims.PAPER_RATE * 8  # an eighth of the paper's rate
    found = claims.measure_encounter_rate(10, days)
    assert found.effect == pytest.approx(1 - 3)
    assert found.low == pytest.approx(1 - 3 + np.log2(4.7954 / 10), abs=1e-4)
    assert found.high == pytest.approx(1 - 3 + np.log2(18.3904 / 10), abs=1e-4)
    none = claims.measure_encounter_rate(0, 1.0)
    assert none.high == pytest.approx(1 - np.log2(claims.PAPER_RATE / 3.6889), abs=1e-4)
    assert claims.measure_encounter_rate(round(claims.PAPER_RATE), 1.0).high == 1.0
