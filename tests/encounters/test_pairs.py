"""Every pair once, groups and streams moved as one, and what the ends of tracks say about the sensor."""

import numpy as np
import pandas as pd
import pytest
from benchmarks.truth import crowds
from helpers.track_tables import make_tracks, make_walk

import szlib
from szlib.core.errors import DataError
from szlib.encounters.pairs import COMPARED, Crowd

PLACE = "-15 15 -15 15"


def crowd(
    kind,
    *,
    seed=0,
    people=300,
    seconds=900,
    tracker="",
):
    rng = np.random.default_rng(seed)
    rows = crowds.as_table(crowds.CROWDS[kind](rng, people, seconds))
    return crowds.read(crowds.TRACKERS[tracker](rows, rng) if tracker else rows, rng)


@pytest.fixture(scope="module")
def tracks():
    return crowd("groups")


def nearest_by_loop(tracks, r_max=2.0):
    """Nearest approach of all pairs in the area, by a search of each moment."""
    inside = tracks[
        crowds.AREA.contains(tracks["x"].to_numpy(), tracks["y"].to_numpy())
    ]
    found = {}
    for _, now in inside.groupby(inside["t"].round(1)):
        ids, place = now["id"].to_numpy(), now[["x", "y"]].to_numpy()
        apart = np.hypot(*(place[:, None] - place).T)
        for i, j in zip(*np.nonzero(np.triu(apart < r_max, 1)), strict=True):
            pair = (min(ids[i], ids[j]), max(ids[i], ids[j]))
            found[pair] = min(apart[i, j], found.get(pair, np.inf))
    return found


@pytest.mark.slow
def test_pairs_are_those_of_a_search_of_each_moment(tracks):
    pairs = szlib.find_pairs(tracks, area=crowds.AREA, kinds=None)
    nearest = pairs.groupby(["ref_id", "other_id"])["distance"].min().to_dict()
    expected = nearest_by_loop(tracks)
    assert len(expected) > 100
    missing = [pair for pair in expected if pair not in nearest]
    assert len(missing) <= 0.01 * len(expected), (
        "but for some seen for less than a second"
    )
    assert all(abs(nearest[pair] - expected[pair]) < 1e-9 for pair in nearest)
    assert (
        pairs.groupby("encounter")[["ref_id", "other_id"]].nunique().to_numpy().max()
        == 1
    )
    assert (pairs["ref_id"] < pairs["other_id"]).all(), (
        "no pair twice with exchanged roles"
    )


def test_samples_are_what_both_people_see():
    left, right = (
        make_walk((-5, 0), (1, 0), person=1, duration=10),
        make_walk((5, 0.8), (-1, 0), person=2, duration=10),
    )
    pairs = szlib.find_pairs(make_tracks(left, right), area=PLACE)
    assert pairs["kind"].unique().tolist() == ["opposite"]
    nearest = pairs.loc[pairs["distance"].idxmin()]
    assert nearest["distance"] == pytest.approx(0.8)
    assert nearest["los_angle"] == pytest.approx(np.pi / 2)
    assert nearest["other_los_angle"] == pytest.approx(np.pi / 2)
    assert (pairs["third"] == 0).all()


def test_people_seen_between_two_whole_seconds_only_are_no_pair():
    walks = [
        make_walk((0, 0.5 * k), (1, 0), person=k, begin=0.1, duration=0.8)
        for k in range(2)
    ]
    tracks = make_tracks(*walks)
    tracks.attrs["area"] = PLACE
    assert szlib.find_pairs(tracks, kinds=None).empty
    for find in (szlib.time_shifted, szlib.null_pairs, szlib.null_encounters):
        with pytest.raises(DataError, match="too short for a null model"):
            find(tracks)


def test_third_people_are_counted_and_filter_nobody():
    walks = [make_walk((-5, 0), (1, 0), person=1, duration=10)]
    walks += [
        make_walk((5, 0.8 + 0.6 * k), (-1, 0), person=2 + k, duration=10)
        for k in range(2)
    ]
    pairs = szlib.find_pairs(make_tracks(*walks), area=PLACE)
    assert pairs["encounter"].nunique() == 2
    assert (pairs["third"] == 1).all()


def test_the_order_of_rows_and_the_frame_do_not_matter(tracks):
    pairs = szlib.find_pairs(tracks, area=crowds.AREA)
    mixed = szlib.find_pairs(tracks.sample(frac=1, random_state=0), area=crowds.AREA)
    pd.testing.assert_frame_equal(
        mixed.drop(columns="encounter"), pairs.drop(columns="encounter")
    )


def test_groups_are_units_and_never_separated(tracks):
    group = Crowd.from_tracks(tracks, crowds.AREA)
    sizes = np.bincount(np.bincount(group.unit[np.unique(group.rows.person)]))
    assert len(sizes) == 1 + 4, "no chain of strangers"
    assert sizes[2] > 20 and sizes[3] > 5
    of_units = pd.DataFrame({"unit": group.unit, "stream": group.stream})
    assert (of_units.groupby("unit")["stream"].nunique() == 1).all()


def test_a_null_holds_the_kinds_compared_and_depends_on_its_seed(
    tracks,
):
    null, again, other = (
        szlib.null_pairs(tracks, area=crowds.AREA, shifts=3, seed=seed, progress=False)
        for seed in (1, 1, 2)
    )
    pd.testing.assert_frame_equal(null.encounters, again.encounters)
    assert not null.encounters["nearest"].equals(other.encounters["nearest"])
    assert set(null.encounters["kind"]) == set(null.samples["kind"]) == set(COMPARED)
    assert null.encounters["encounter"].is_unique
    by_sample = null.samples.groupby("encounter")["distance"].min()
    listed = null.encounters.set_index("encounter")["nearest"]
    np.testing.assert_allclose(by_sample, listed[by_sample.index])


def test_a_null_has_as_many_pairs_as_a_crowd_that_ignores_each_other():
    tracks = crowd("singles", people=600, seconds=1200)
    pairs = szlib.find_pairs(tracks, area=crowds.AREA)["encounter"].nunique()
    null = szlib.null_pairs(tracks, area=crowds.AREA, shifts=10, progress=False)
    assert len(null.encounters) / 10 == pytest.approx(pairs, rel=0.2)


def test_a_merging_tracker_is_noticed_and_a_sound_one_is_not():
    for tracker, loses in (("", False), ("broken", False), ("merging", True)):
        null = szlib.null_pairs(
            crowd("singles", people=600, seconds=1200, tracker=tracker),
            area=crowds.AREA,
            shifts=1,
            progress=False,
        )
        assert null.sensor is not None
        assert null.sensor.loses_people == loses, f"{tracker}: {null.sensor}"
    assert 0.45 <= null.sensor.resolved <= 0.8
    assert null.sensor.ends_low > 10 * null.sensor.samples_near


def test_what_has_no_meaning_is_refused(tracks):
    with pytest.raises(DataError, match="r_max must be a positive distance"):
        szlib.find_pairs(tracks, area=crowds.AREA, r_max=0)
    with pytest.raises(DataError, match="shifts must be at least 1"):
        szlib.null_pairs(tracks, area=crowds.AREA, shifts=0)
    with pytest.raises(DataError, match="nobody was seen in the area"):
        szlib.find_pairs(tracks, area="500 510 500 510")
    short = tracks[tracks["t"] < tracks["t"].min() + 60]
    with pytest.raises(
        DataError, match=r"recorded for 1\.0 min, too short for a null model"
    ):
        szlib.null_pairs(short, area=crowds.AREA, shifts=1, progress=False)
