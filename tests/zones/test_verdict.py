"""The verdict: respect, nobody's respect and too little data are told apart, with reasons."""

import re
from dataclasses import replace
from functools import cache

import numpy as np
import pandas as pd
import pytest
from benchmarks.truth import crowds
from studies.imposed_zone import PairedSamples
from studies.noninteracting_crowd import noninteracting_crowd

import szlib
from szlib.zones.ellipses import EllipseZone
from szlib.zones.respect_test import collect_approaches, fit_radius
from szlib.zones.verdict import describe_missing_encounters

SHIFTS, SPEED = 39, 1.1


def walkers(seed, n, *, core=0.0, careless=0.0):
    """Straight paths past a person, as evenly near as chance has it; within `core` only the careless."""
    rng = np.random.default_rng(seed)
    tries = 4 * n
    nearest, heading = rng.uniform(0, 3, tries), rng.uniform(-np.pi, np.pi, tries)
    kept = np.flatnonzero((nearest > core) | (rng.random(tries) < careless))[:n]
    along, t = np.linspace(-2, 2, 31), np.arange(31) / 10
    path = (along + 1j * nearest[kept, None]) * np.exp(1j * heading[kept, None])
    table = pd.DataFrame({"encounter": np.repeat(np.arange(n), 31), "day": "a"})
    table["ref_id"], table["other_id"] = (
        2 * table["encounter"],
        2 * table["encounter"] + 1,
    )
    table["t"] = (np.arange(n)[:, None] * 20.0 + t).ravel().round(1)
    return table.assign(
        los_angle=np.angle(path).ravel(),
        distance=np.abs(path).ravel(),
        speed=np.repeat(rng.uniform(SPEED - 0.1, SPEED + 0.1, n), 31),
        kind="crossing",
    )


@cache
def null():
    samples = walkers(99, SHIFTS * 100)
    samples["shift"] = samples["encounter"] % SHIFTS
    first = samples.groupby("encounter")
    encounters = pd.DataFrame(
        {"shift": first["shift"].first(), "nearest": first["distance"].min()}
    )
    near = samples[samples["distance"] < 2]
    return szlib.NullEncounters(
        near, encounters.reset_index().assign(kind="crossing"), SHIFTS, 2.0
    )


@pytest.mark.filterwarnings("ignore:at 1.1 m/s fewer than 20")
def fit(samples, **options):
    return szlib.SocialZone.fit(
        samples, **{"speeds": [SPEED], "null": null(), "n_resamples": 60} | options
    )


@pytest.fixture(scope="module")
def careful():
    return fit(walkers(1, 1500, core=0.8))


# --- the three verdicts ------------------------------------------------------------------------------


def test_careful_people_in_number_are_usable(careful):
    verdict = careful.verdict(SPEED)
    assert verdict == "usable", verdict.sentence
    assert "people avoid each other (p = " in verdict.sentence
    assert careful.adequate(SPEED)


@pytest.mark.parametrize("method", ["paper", "hull"])
def test_people_who_ignore_each_other_show_no_respect(method):
    verdict = fit_quietly(walkers(2, 1500), method=method).verdict(SPEED)
    assert verdict == "no respect shown"
    assert "as near as people who ignore each other" in verdict.reasons[0]


def test_fewer_than_19_shifts_decide_nothing(careful):
    few, enough = (
        replace(
            careful.null_test,
            p_value=1 / (1 + n),
            null_statistics=careful.null_test.null_statistics[:n],
        )
        for n in (18, 19)
    )
    verdict = replace(careful, null_test=few).verdict(SPEED)
    assert verdict == "undecided"
    assert "too few shifts to tell (p = 0.053, 18 shifts" in verdict.reasons[0]
    assert "19 shifts, are needed" in verdict.reasons[0]
    assert replace(careful, null_test=enough).verdict(SPEED) == "usable"
    ignoring = replace(careful, null_test=replace(enough, p_value=0.1))
    assert ignoring.verdict(SPEED) == "no respect shown"


def fit_quietly(samples, **options):
    """As `fit`; a method may find no zone at all, which is as good an answer."""
    try:
        return fit(samples, **options)
    except szlib.ZoneError:
        return replace(fit(samples), method="paper")


def test_few_strangers_are_undecided_and_told_the_hours():
    few = fit(walkers(3, 151, core=0.8))
    assert few.verdict(SPEED) == "undecided"
    hours = (151 - 1) * 20 / 3600
    more = f"{(600 / 151 - 1) * hours:.2g} more hours"
    assert (
        f"151 encounters were found, 600 are needed: {more}"
        in few.verdict(SPEED).reasons[0]
    )
    assert not few.adequate(SPEED)


def test_without_a_null_model_nothing_is_decided():
    zone = fit(walkers(1, 1500, core=0.8), null=None)
    assert zone.verdict(SPEED) == "undecided"
    assert any(
        "SocialZone.from_tracks(tracks)" in reason
        for reason in zone.verdict(SPEED).reasons
    )


# --- each condition alone ----------------------------------------------------------------------------


def test_careless_share_above_q_is_noticed():
    """The quantile collapses there."""
    zone = fit(walkers(4, 1500, core=1.0, careless=0.3))
    assert zone.null_test.is_significant
    assert zone.verdict(SPEED) == "undecided"
    assert any("careless people" in reason for reason in zone.verdict(SPEED).reasons)


def test_a_radius_that_may_be_that_of_bodies_is_noticed(careful):
    test = careful.null_test
    wide = replace(test.respect, low=0.0)
    verdict = replace(careful, null_test=replace(test, respect=wide)).verdict(SPEED)
    assert verdict == "undecided"
    assert any("two bodies that touch" in reason for reason in verdict.reasons)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"uncertainty": None}, "the interval of the semi-axis a cannot be given"),
        ({"side_counts": None}, "encounters were not counted by side"),
    ],
)
def test_every_condition_is_needed(careful, change, reason):
    verdict = replace(careful, **change).verdict(SPEED)
    assert verdict == "undecided"
    assert any(reason in each for each in verdict.reasons)


def test_a_speed_at_which_nobody_was_seen_is_undecided(careful):
    """The posterior of "respect" has an interval at every speed, also where it saw nobody."""
    shape = EllipseZone(careful.ellipses)
    zone = replace(careful, method="respect", shape=shape)
    nobody = replace(zone, side_counts=zone.side_counts.assign(encounters=0))
    seen = f"(only at {SPEED:g} to {SPEED:g} m/s)"
    assert not any("counted" in reason for reason in zone.verdict(SPEED).reasons)
    for judged, speed, end in (
        (zone, 3.0, f" {seen}"),
        (zone, 0.2, f" {seen}"),
        (nobody, SPEED, ""),
    ):
        verdict = judged.verdict(speed)
        assert verdict == "undecided"
        assert verdict.reasons[0] == (
            f"at {speed:g} m/s no encounters were counted{end}"
        )


def test_a_tracker_that_loses_people_is_undecided(careful):
    """Unless respect shows beyond the distance that it resolves, and the zone reaches farther than that."""
    sensor = szlib.encounters.SensorCheck(50, 9000, 0.6, 0.45, 0.73, 0.01, 0.6)
    for p_beyond, expected in ((0.4, "undecided"), (0.01, "usable")):
        test = replace(careful.null_test, sensor=sensor, p_beyond=p_beyond)
        assert replace(careful, null_test=test).verdict(SPEED) == expected
    test = replace(
        careful.null_test, sensor=replace(sensor, resolved=1.0), p_beyond=0.01
    )
    verdict = replace(careful, null_test=test).verdict(SPEED)
    assert "the tracker loses people who are nearer" in verdict.sentence


def test_a_zone_no_larger_than_that_of_people_who_ignore_each_other_is_undecided(
    careful,
):
    test = replace(careful.null_test, null_radius=1.5)
    verdict = replace(careful, null_test=test).verdict(SPEED)
    assert verdict == "undecided"
    assert "larger than 1.50 m: people who ignore each other" in verdict.sentence


@pytest.mark.parametrize(
    ("quantity", "low", "high", "reason"),
    [
        ("area", 0.3, 2.5, "two bodies that touch are so near"),
        ("a", 0.3, 1.6, "times the data would do|more hours of recording would do"),
    ],
)
def test_intervals_in_the_wrong_place_or_too_wide_are_undecided(
    careful, quantity, low, high, reason
):
    known = careful.uncertainty
    rows = known.intervals.copy()
    rows.loc[rows["quantity"] == quantity, ["low", "high"]] = low, high
    verdict = replace(careful, uncertainty=replace(known, intervals=rows)).verdict(
        SPEED
    )
    assert verdict == "undecided"
    assert re.search(reason, verdict.sentence)


def test_intervals_finer_than_positions_far_apart_can_tell_are_undecided(careful):
    """People who step aside between two positions seem nearer than they were."""
    stage = {"stage": "clock: samples", "entered": 1, "kept": 1, "rejected": {}}
    for interval, expected in ((0.1, "usable"), (0.5, "usable"), (1.5, "undecided")):
        sums = {"squares": 30, "seconds": interval, "cubes": interval**3}
        funnel = [stage | {"recorded": sums}]
        zone = replace(careful, provenance=careful.provenance | {"funnel": funnel})
        assert zone.verdict(SPEED) == expected
    assert "positions are 1.5 s apart" in zone.verdict(SPEED).sentence
    assert "record one every 0.7 s" in zone.verdict(SPEED).sentence


def test_tracks_of_few_positions_are_undecided(careful):
    sums = {"squares": 70, "seconds": 1.0, "cubes": 0.09}
    stage = {"stage": "clock: samples", "entered": 10, "recorded": sums}
    zone = replace(careful, provenance=careful.provenance | {"funnel": [stage]})
    assert zone.verdict(SPEED).reasons[0].startswith("a track has 7 positions")


def test_chains_that_do_not_agree_are_undecided(careful):
    apart = replace(careful.uncertainty, has_converged=False)
    verdict = replace(careful, uncertainty=apart).verdict(SPEED)
    assert "the draws of the posterior do not agree" in verdict.sentence


@pytest.mark.parametrize(("ahead", "expected"), [(0.2, "usable"), (-0.35, "undecided")])
def test_a_zone_that_is_far_ahead_or_behind_is_undecided(careful, ahead, expected):
    moved = {
        speed: replace(ellipse, center=(ahead, 0.0))
        for speed, ellipse in careful.ellipses.items()
    }
    verdict = replace(careful, ellipses=moved).verdict(SPEED)
    assert verdict == expected
    assert ("centre is -0.35 m ahead" in verdict.sentence) == (expected == "undecided")


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::szlib.DataWarning")
@pytest.mark.parametrize("fault", ["noise", "wrong places"])
def test_positions_that_err_move_the_zone_and_it_is_undecided(tmp_path, fault):
    """The true zone is 0.95 m long; it would be called 0.65 to 0.7 m, far ahead or behind."""
    tracks = szlib.read_tracks(szlib.make_plaza(tmp_path / "plaza.csv"))
    rng = np.random.default_rng(0)
    places = tracks[["x", "y"]].to_numpy()
    if fault == "noise":
        places = places + rng.normal(0, 0.1, places.shape)
    else:
        places[rng.random(len(places)) < 0.002] = 0.0
    rows = tracks[["t", "id"]].assign(x=places[:, 0], y=places[:, 1])
    again = szlib.read_tracks(rows)
    zone = szlib.SocialZone.from_tracks(again, area="auto", speeds=[SPEED])
    assert zone.verdict(SPEED) == "undecided"
    assert "as where positions err" in zone.verdict(SPEED).sentence


def test_implausible_data_are_undecided(careful):
    text = "people move at 4.18 m/s: feet?"
    funnel = [{"stage": f"warning: {text}", "entered": 1, "kept": 1, "rejected": {}}]
    implausible = replace(careful, provenance=careful.provenance | {"funnel": funnel})
    assert implausible.verdict(SPEED) == "undecided"
    assert text in implausible.verdict(SPEED).reasons


def test_speed_without_data_is_undecided(careful):
    assert careful.verdict(1.6) == "undecided"
    assert "at 1.6 m/s no encounters were counted" in careful.verdict(1.6).sentence


def test_missing_encounters_need_no_times():
    assert describe_missing_encounters({"encounters": 300, "hours": None}).endswith(
        "600 are needed"
    )
    assert describe_missing_encounters({"encounters": 600, "hours": 1.0}) == ""


def test_null_model_must_reach_as_far_as_the_zone():
    with pytest.raises(
        szlib.ZoneError,
        match=r"r_max must be at most the null model's 2\.0 m; got 2\.5",
    ):
        fit(walkers(1, 50), r_max=2.5)


# --- where it is shown -------------------------------------------------------------------------------


def test_verdict_is_saved_and_made_again(careful, tmp_path):
    careful.save(tmp_path / "zone.json")
    loaded = szlib.SocialZone.load(tmp_path / "zone.json")
    assert loaded.verdict(SPEED).sentence == careful.verdict(SPEED).sentence
    assert '"usable"' in (tmp_path / "zone.json").read_text(encoding="utf-8")


def test_controller_warns_unless_usable(careful):
    szlib.MPCCBF(careful)
    with pytest.warns(
        szlib.DataWarning,
        match=r"at 1\.1 m/s should not be relied on: no respect shown",
    ):
        szlib.MPCCBF(fit(walkers(2, 1500)))


# --- the radius that it rests on ---------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("core", [0.5, 0.8, 1.0])
def test_core_is_found_and_held(core):
    radii = [
        fit_radius(
            collect_approaches(walkers(k, 400, core=core, careless=0.05), null())
        )
        for k in range(30)
    ]
    assert np.mean([each.radius for each in radii]) == pytest.approx(core, abs=0.03)
    held = np.mean([each.low <= core <= each.high for each in radii])
    assert held >= 0.83  # 90 % or more are expected; fewer than 25 of 30: 1 %


def walk_around(core, noise=0.0):
    """The test of people who swerve around circles, seen with a `noise` [m]."""
    rng = np.random.default_rng(0)
    walks = crowds.singles(rng, 800, 1200.0)
    crowds.swerving(walks, rng, (core, core))
    tracks = crowds.read(crowds.as_table(walks), rng, noise=noise)
    against = szlib.null_pairs(tracks, area=crowds.AREA, shifts=9, progress=False)
    return szlib.null_test(szlib.find_pairs(tracks, area=crowds.AREA), against)


@pytest.mark.slow
@pytest.mark.parametrize("core", [0.5, 1.0])
def test_people_who_step_aside_do_not_shrink_the_radius(core):
    """They are seen just outside of the circle around which they swerve."""
    found = walk_around(core).respect
    assert found.low <= core <= found.high
    assert found.high - found.low < 0.15


@pytest.mark.slow
def test_noise_hardly_shrinks_the_radius():
    """The nearest of many distances with an error of 7 cm is 9 cm too near."""
    assert walk_around(0.8, noise=0.05).respect.radius == pytest.approx(0.8, abs=0.05)


def test_radius_does_not_shrink_as_encounters_are_added():
    small = [
        fit_radius(
            collect_approaches(walkers(k, 150, core=0.8, careless=0.05), null())
        ).radius
        for k in range(20)
    ]
    many = fit_radius(
        collect_approaches(walkers(7, 8000, core=0.8, careless=0.05), null())
    ).radius
    assert np.mean(small) == pytest.approx(many, abs=0.04)


def test_mix_of_kinds_does_not_matter():
    """One kind comes nearer by chance, and is rarer in the data."""
    far = null().encounters.assign(
        kind="opposite", nearest=lambda d: 1.2 + d["nearest"] / 4
    )
    mixed = replace(null(), encounters=pd.concat([null().encounters, far]))
    crossing = walkers(8, 300)
    crossing = crossing.assign(encounter=crossing["encounter"] + 10_000)
    opposite = walkers(9, 900).assign(kind="opposite")
    opposite["distance"] = np.hypot(opposite["distance"], 1.2)
    crossing_only = fit_radius(collect_approaches(crossing, null()))
    both = fit_radius(collect_approaches(pd.concat([crossing, opposite]), mixed))
    assert crossing_only.low == 0
    assert both.low == 0


@pytest.mark.slow
def test_cores_in_simulated_crowds_are_found():
    tracks = noninteracting_crowd(seed=5, people=1500, minutes=30)
    samples = szlib.find_encounters(tracks)
    against = szlib.null_encounters(tracks, shifts=19, progress=False)
    paired = PairedSamples.from_samples(samples)
    kept = paired.impose(szlib.Ellipse((0, 0), (0.8, 0.8)), careless=0.05, seed=1)
    test = szlib.null_test(kept, against)
    assert test.is_significant
    assert test.respect.low <= 0.8 <= test.respect.high
    assert not szlib.null_test(samples, against).is_significant
