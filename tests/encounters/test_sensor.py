"""The sensor: its noise, and the ids that it exchanges, are those with which a crowd was made."""

import numpy as np
import pytest
from benchmarks.truth import crowds

from szlib.encounters.pairs import Crowd
from szlib.workbook.cli import describe_pairs


def crowd_of(seed, tracker="", **sensor):
    rng = np.random.default_rng(seed)
    rows = crowds.as_table(crowds.singles(rng, 400, 600))
    seen = crowds.TRACKERS[tracker](rows, rng) if tracker else rows
    return crowds.read(seen, rng, **sensor)


def check(tracks):
    return Crowd.from_tracks(tracks, crowds.AREA).sensor


@pytest.mark.parametrize("rate", [10.0, 2.5])
@pytest.mark.parametrize("noise", [0.01, 0.1])
def test_noise_is_found_at_the_rate_of_the_sensor(rate, noise):
    found = check(crowd_of(0, rate=rate, noise=noise))
    assert found.noise == pytest.approx(noise, rel=0.05)
    assert found.noise_low < found.noise < found.noise_high
    assert found.noise_high - found.noise_low < 0.1 * noise


def test_straight_paths_without_noise_have_none():
    found = check(crowd_of(0))
    assert found.noise == found.noise_high == 0
    assert "no error of positions was found" in str(found)


def test_exchanged_ids_are_seen_and_passes_alone_are_not():
    sound, exchanged = check(crowd_of(1)), check(crowd_of(1, "id switches"))
    assert sound.passes > 30 and sound.exchanged == 0
    # Half of the pairs within 0.5 m are exchanged. Passes are counted up to 0.6 m, and two people who walk in
    # nearly the same direction look alike.
    assert 0.2 < exchanged.exchanged / exchanged.passes < 0.5
    assert f"{exchanged.exchanged} of {exchanged.passes} pairs who pass" in str(
        exchanged
    )


@pytest.mark.parametrize("seed", [3, 4])
@pytest.mark.parametrize(
    ("reach", "early"), [(0.45, 0.0), (0.45, 1.0), (0.6, 0.5), (0.6, 1.5), (1.5, 0.0)]
)
def test_people_who_are_lost_are_noticed_however_early_and_far(seed, reach, early):
    rng = np.random.default_rng(seed)
    rows = crowds.as_table(crowds.singles(rng, 500, 900))
    sound = check(crowds.read(rows, rng))
    assert not sound.loses_people, str(sound)
    lost = check(crowds.read(crowds.merging(rows, rng, reach, early), rng))
    # opposite people come nearer by up to 3.2 m/s
    assert reach <= lost.resolved <= reach + 3.2 * (early + 0.7), str(lost)


def test_tracks_that_break_anywhere_are_no_lost_people():
    for seed in range(5):
        broken = check(crowd_of(seed, "broken"))
        assert broken.ends > 100 and not broken.loses_people, str(broken)


def test_lost_people_are_noticed_where_tracks_break_everywhere():
    """Then tracks end beside others less than twice as often as elsewhere."""
    for seed, every in enumerate((0.8, 1.6, 4.0)):
        rng = np.random.default_rng(seed)
        rows = crowds.as_table(crowds.singles(rng, 1400, 1800))
        broken = crowds.broken(rows, rng, every)
        sound = check(crowds.read(broken, rng))
        assert not sound.loses_people, f"every {every} s: {sound}"
        lost = check(crowds.read(crowds.merging(broken, rng, 0.7), rng))
        assert lost.loses_people, f"every {every} s: {lost}"


def test_the_description_says_how_many_pairs_and_what_is_lost():
    sound = describe_pairs(crowd_of(2), crowds.AREA).splitlines()
    assert sound[0].startswith(
        "pairs who come towards each other or cross, within 2 m: "
    )
    assert sound[1].startswith("sensor: it resolves people at every distance: ")
    merging = describe_pairs(crowd_of(2, "merging"), crowds.AREA)
    assert "sensor: it loses people who are nearer than 0." in merging
