"""A zone imposed on a crowd: nobody stays within it but the careless, from wherever one looks."""

import numpy as np
import pandas as pd
import pytest
from helpers.track_tables import make_tracks, make_walk
from plots.encounters import match_rows
from studies.imposed_zone import PairedSamples, impose_zone
from studies.noninteracting_crowd import noninteracting_crowd

import szlib
from szlib.tracks import funnels

ZONE = szlib.Ellipse((0.15, 0.05), (0.9, 0.6), 0.3)
MINUTES, SETTINGS = (
    (1.0, 5.0),
    szlib.EncounterSettings(area=szlib.ATC_SQUARE, min_distance=0.3),
)


@pytest.fixture(scope="module")
def tracks():
    return noninteracting_crowd(seed=5, people=2500, minutes=40)


@pytest.fixture(scope="module")
def paired(tracks):
    shifted = szlib.time_shifted(tracks, seed=2, minutes=MINUTES)
    return PairedSamples.from_samples(szlib.find_encounters(shifted, settings=SETTINGS))


def pairs_of(samples):
    """The two people of each sample, the lower id first."""
    people = samples[["ref_id", "other_id"]]
    return people.min(axis=1) * 10_000 + people.max(axis=1)


def entering(tracks, samples):
    """Pairs in which one person is inside the placed ellipse of the other, one ellipse a sample."""
    rows = match_rows(tracks, samples)
    inside = np.zeros(len(samples), bool)
    for own, partner in (rows, rows[::-1]):
        for k, (me, you) in enumerate(
            zip(own.itertuples(), partner.itertuples(), strict=True)
        ):
            placed = ZONE.placed((me.x, me.y), np.arctan2(me.vy, me.vx))
            inside[k] |= (
                bool(placed.level((you.x, you.y)) < 1) and np.hypot(me.vx, me.vy) >= 0.4
            )
    return set(pairs_of(samples)[inside])


def test_nobody_within_the_zone_remains_and_everybody_else_does(
    tracks,
):
    shifted = szlib.time_shifted(tracks, seed=2, minutes=MINUTES)
    everybody = szlib.find_encounters(shifted, settings=SETTINGS, kinds="crossing")
    expected = entering(shifted, everybody)
    assert len(expected) > 20
    imposed = impose_zone(
        tracks, ZONE, seed=2, minutes=MINUTES, settings=SETTINGS, kinds="crossing"
    )
    pd.testing.assert_frame_equal(
        imposed, everybody[~pairs_of(everybody).isin(expected)]
    )
    stage = funnels.get(imposed)[-1]
    assert stage["entered"] == everybody["encounter"].nunique()
    assert stage["kept"] == imposed["encounter"].nunique()
    assert list(stage["rejected"]) == ["one person enters the other's zone"]


def test_the_zone_of_the_other_person_counts_as_well(paired):
    """A long zone ahead of the other person reaches people who have nobody in their own zone."""
    ahead = szlib.Ellipse((0.8, 0.0), (1.2, 0.4))
    nearest = ahead.level(paired.points).T
    own, other = (paired.pair[nearest[:, k] < 1] for k in (0, 1))
    assert set(own) - set(other)
    assert set(other) - set(own)
    assert set(np.flatnonzero(paired.pairs_inside(ahead))) == {*own, *other}


def test_careless_share_is_recovered_and_nested(paired):
    inside = set(np.flatnonzero(paired.pairs_inside(ZONE)))

    def careless_pairs(share, seed):
        kept = paired.impose(ZONE, careless=share, seed=seed)
        return inside & set(paired.pair[np.isin(paired.samples.index, kept.index)])

    shares = [len(careless_pairs(0.2, seed)) / len(inside) for seed in range(40)]
    assert np.mean(shares) == pytest.approx(
        0.2, abs=4 * np.sqrt(0.16 / 40 / len(inside))
    )
    assert careless_pairs(0.1, 3) < careless_pairs(0.3, 3)
    assert careless_pairs(0.3, 3) != careless_pairs(0.3, 4)
    assert careless_pairs(0.0, 3) == set()
    pd.testing.assert_frame_equal(paired.impose(ZONE, careless=1.0), paired.samples)


def test_both_orders_of_a_pair_share_their_fate(paired):
    """Whoever is the reference, and in whichever window: the pair stays or goes as a whole."""
    people = pairs_of(paired.samples)
    both = people[people.map(paired.samples.groupby(people)["ref_id"].nunique()) == 2]
    for seed in range(10):
        kept = paired.impose(ZONE, careless=0.5, seed=seed).index
        removed = people.index.difference(kept)
        assert set(both.reindex(removed).dropna()), (
            "pairs in both orders are among the removed"
        )
        assert not set(people[kept]) & set(people[removed])


def test_an_ellipse_of_no_size_removes_nothing(paired):
    kept = paired.impose(szlib.Ellipse((0.0, 0.0), (1e-9, 1e-9)))
    pd.testing.assert_frame_equal(kept, paired.samples)
    assert funnels.get(kept)[-1]["rejected"] == {}


def test_a_turned_and_moved_world_changes_nothing(tracks, paired):
    turned = tracks.assign(
        x=30 - tracks["y"], y=tracks["x"] - 7, vx=-tracks["vy"], vy=tracks["vx"]
    )
    (x0, x1), (y0, y1) = szlib.ATC_SQUARE.x, szlib.ATC_SQUARE.y
    square = szlib.Square(x=(30 - y1, 30 - y0), y=(x0 - 7, x1 - 7))
    found = impose_zone(
        turned.sample(frac=1, random_state=0), ZONE, careless=0.2, seed=2, minutes=MINUTES, area=square,
        min_distance=0.3,
    )  # fmt: skip
    expected = paired.impose(ZONE, careless=0.2, seed=2)
    columns = ["encounter", "ref_id", "other_id", "t", "kind"]
    assert 0 < len(expected) < len(paired.samples)
    pd.testing.assert_frame_equal(found[columns], expected[columns])
    np.testing.assert_allclose(found["distance"], expected["distance"], atol=1e-9)


def test_a_standing_person_has_no_zone_but_is_kept_out_of_others():
    """The walker passes at 0.5 m on the left: within the round zone, and outside of the narrow one."""
    walk = make_walk((-17, 0), (1.2, 0), duration=8)
    stand = make_walk((-14.5, 0.5), (0, 0.1), person=2, duration=8).assign(y=0.5)
    tracks = make_tracks(walk, stand)
    samples = szlib.find_encounters(tracks, square=szlib.ATC_SQUARE)
    assert set(samples["other_id"]) == {2}
    paired = PairedSamples.from_samples(samples)
    assert np.isnan(paired.points[1]).all()
    assert len(paired.impose(szlib.Ellipse((0.0, 0.0), (0.8, 0.8)))) == 0
    assert len(paired.impose(szlib.Ellipse((0.0, 0.0), (0.8, 0.4)))) == len(samples)


def test_without_encounters_the_result_is_empty(tracks):
    far = szlib.EncounterSettings(area="100 120 100 120")
    imposed = impose_zone(tracks, ZONE, minutes=MINUTES, settings=far)
    assert len(imposed) == 0
    assert funnels.get(imposed)[-1]["entered"] == 0


def test_invalid_arguments_raise(tracks, paired):
    for share in (-0.1, 1.1, np.nan):
        with pytest.raises(
            szlib.DataError, match=r"careless must be a share of pairs, 0 to 1; got"
        ):
            paired.impose(ZONE, careless=share)
    with pytest.raises(
        szlib.ZoneError, match=r"ellipse must be an Ellipse; got \(0.9, 0.6\)"
    ):
        paired.impose((0.9, 0.6))  # type: ignore[arg-type]
    with pytest.raises(szlib.DataError, match="minutes must be"):
        impose_zone(tracks, ZONE, minutes=(5, 1))
