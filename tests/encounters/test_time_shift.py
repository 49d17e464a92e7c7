"""People moved in time: paths and density stay, companions stay together, the recorded hours stay."""

import numpy as np
import pandas as pd
import pytest
from helpers.track_tables import DAY, make_tracks, make_walk
from helpers.valid_tracks import check_tracks
from studies.noninteracting_crowd import noninteracting_crowd

import szlib
from szlib.core.errors import DataError
from szlib.tracks.clock import nearest_tick

MINUTES = (1.0, 5.0)


@pytest.fixture(scope="module")
def tracks():
    """300 people in 20 minutes, some of them cut off by the end of the recording."""
    return noninteracting_crowd(seed=3, people=300, minutes=20)


@pytest.fixture(scope="module")
def shifted(tracks):
    return szlib.time_shifted(tracks, seed=1, minutes=MINUTES)


def ticks(tracks):
    return nearest_tick(tracks["t"].to_numpy())


def all_day(day=DAY, person=999, minutes=20):
    """Somebody who is seen from the first to the last tick, and ends far from where they began."""
    return make_walk(
        (-18, -8), (0.01, 0.0), person=person, day=day, duration=60 * minutes
    )


# --- what stays --------------------------------------------------------------------------------------


def test_shifted_tracks_stay_within_the_recorded_hours(tracks, shifted):
    check_tracks(shifted)
    circle = np.floor(tracks["t"].min()), np.floor(tracks["t"].max()) + 2
    assert shifted["t"].between(*circle, inclusive="left").all()
    assert list(shifted.columns) == list(tracks.columns)


def test_paths_stay(tracks, shifted):
    before, after = (
        {k: sorted(zip(p["x"], p["y"], strict=True)) for k, p in each.groupby("id")}
        for each in (tracks, shifted)
    )
    assert before == after


def test_each_person_has_one_shift(tracks, shifted):
    both = tracks.merge(shifted, on=["id", "x", "y"])
    second = np.floor(tracks["t"])
    period = 10 * int(second.max() - second.min() + 2)
    moved = np.rint((both["t_y"] - both["t_x"]) * 10).astype(int) % period
    moved = moved.groupby(both["id"]).agg(["min", "max"])
    assert (moved["min"] == moved["max"]).all()
    size = np.minimum(moved["min"], period - moved["min"]) / 600
    assert size.between(*MINUTES).all()
    assert moved["min"].nunique() > 150, "each their own"


def test_velocities_stay_except_near_the_seam(tracks, shifted):
    both = tracks.merge(shifted, on=["id", "x", "y"])
    same = np.isclose(both["vx_x"], both["vx_y"]) & np.isclose(
        both["vy_x"], both["vy_y"]
    )
    across = shifted.groupby("id")["t"].agg(np.ptp) > 600
    assert same[~both["id"].isin(across.index[across])].all()


def test_density_at_the_ends_of_the_recording_stays():
    """Reflected shifts would leave the first and the last minutes half empty."""
    tracks = noninteracting_crowd(seed=0, people=2000, minutes=20)
    minute = ticks(tracks) // 600
    before = np.bincount(minute, minlength=20)[1:20]
    after = sum(
        np.bincount(
            ticks(szlib.time_shifted(tracks, seed=s, minutes=MINUTES)) // 600,
            minlength=20,
        )[1:20]
        for s in range(4)
    )
    assert after / 4 == pytest.approx(np.full(19, before.mean()), rel=0.15)


def test_gaps_and_the_seam_are_not_bridged():
    person = all_day()
    with_gap = person.drop(index=range(3000, 3010))
    tracks = make_tracks(with_gap, make_walk((-12, 0), (1, 0)))
    for seed in range(5):
        moved = szlib.time_shifted(tracks, seed=seed, minutes=MINUTES)
        check_tracks(moved)
        own = moved[moved["id"] == 999]
        step = np.hypot(own["x"].diff(), own["y"].diff())[
            own["t"].diff().round(3) == 0.1
        ]
        assert step.max() < 0.002, "the end of the path must not join its beginning"
        assert (own["t"].diff().round(3) > 0.1).sum() == 2, "the gap, and the seam"


def test_each_day_is_shifted_within_itself():
    days = ["2012-10-24", "2012-10-28"]
    walks = [
        make_walk((-12, 0), (1, 0), day=d, person=p, begin=b)
        for d in days
        for p, b in ((1, 0), (2, 600), (3, 1196))
    ]
    for walk in walks[3:]:
        walk["t"] += 345_600.0
    tracks = make_tracks(*walks)
    moved = szlib.time_shifted(tracks, minutes=MINUTES)
    for day in days:
        before, after = (each.loc[each["day"] == day, "t"] for each in (tracks, moved))
        assert after.between(np.floor(before.min()), before.max() + 2).all()


def test_result_depends_on_the_seed_and_not_on_row_order(tracks, shifted):
    untouched = tracks.copy()
    mixed = tracks.sample(frac=1, random_state=0)
    pd.testing.assert_frame_equal(
        szlib.time_shifted(mixed, seed=1, minutes=MINUTES), shifted
    )
    pd.testing.assert_frame_equal(tracks, untouched)
    assert not szlib.time_shifted(tracks, seed=2, minutes=MINUTES)["t"].equals(
        shifted["t"]
    )


# --- what is lost ------------------------------------------------------------------------------------


def test_encounters_of_the_data_do_not_recur(tracks):
    def met(samples):
        return set(zip(samples["ref_id"], samples["other_id"], strict=True))

    found = met(szlib.find_encounters(tracks, square=szlib.ATC_SQUARE))
    again = [
        len(
            found
            & met(
                szlib.find_encounters(
                    szlib.time_shifted(tracks, seed=s, minutes=MINUTES),
                    square=szlib.ATC_SQUARE,
                )
            )
        )
        for s in range(5)
    ]
    assert len(found) > 15
    assert sum(again) <= 1


def test_companions_stay_together_and_passing_people_do_not():
    walks = [
        make_walk(
            (-18, -4 + 0.7 * k), (1, 0), person=10 * g + k, begin=40 * g, duration=10
        )
        for g in range(29)
        for k in range(3)
    ]
    walks.append(make_walk((-8, -4), (-1, 0), person=999, duration=10))
    tracks = make_tracks(*walks)
    period = np.floor(tracks["t"].max()) - np.floor(tracks["t"].min()) + 2
    apart = []
    for seed in range(5):
        moved = szlib.time_shifted(tracks, seed=seed, minutes=MINUTES)
        both = tracks.merge(moved, on=["id", "x", "y"])
        shift = ((both["t_y"] - both["t_x"]) % period).groupby(both["id"]).median()
        of_group = shift.drop(999).groupby(shift.index[:-1] // 10)
        assert of_group.agg(np.ptp).max() < 0.01
        assert of_group.first().round().nunique() > 20
        apart.append(abs(shift[0] - shift[999]))
    assert np.median(apart) > 10, "they met once, and are no companions"


# --- errors ------------------------------------------------------------------------------------------


def test_too_short_a_recording_is_named(tracks):
    for lasts in (20, 6, 2):
        check_tracks(
            szlib.time_shifted(tracks[tracks["t"] < tracks["t"].min() + 60 * lasts])
        )
    too_short = tracks[tracks["t"] < tracks["t"].min() + 90]
    with pytest.raises(
        DataError,
        match=r"recorded for 1.5 min.*leave out recordings shorter than 2 min",
    ):
        szlib.time_shifted(pd.concat([tracks, too_short.assign(day="another")]))


@pytest.mark.parametrize("lasts", [2.0, 6.0, 10.9, 11.1, 15.0])
def test_shifts_are_in_proportion_in_recordings_shorter_than_eleven_minutes(
    lasts,
):
    """A long day beside a short one keeps its shifts, those of the default range."""
    long, short = (
        noninteracting_crowd(seed=k, people=200, minutes=20).assign(day=name)
        for k, name in enumerate(("long", "short"))
    )
    short = short[short["t"] < short["t"].min() + 60 * lasts]
    tracks = make_tracks(long, short)
    moved = szlib.time_shifted(tracks, seed=3)
    both = tracks.merge(moved, on=["day", "id", "x", "y"])
    for day, share in (("long", 1.0), ("short", min(1.0, lasts / 11))):
        t = tracks.loc[tracks["day"] == day, "t"]
        period = np.floor(t.max()) - np.floor(t.min()) + 2
        own = both[both["day"].astype(str) == day]
        shift = ((own["t_y"] - own["t_x"]) % period).groupby(own["id"]).median()
        minutes = np.minimum(shift, period - shift) / 60
        assert share - 0.02 <= minutes.min() < 3 * share
        assert minutes.max() <= 10 * share + 0.02


@pytest.mark.slow
def test_null_model_of_six_minutes_needs_no_minutes(tracks):
    short = tracks[tracks["t"] < tracks["t"].min() + 360]
    null = szlib.null_encounters(short, shifts=2, progress=False)
    assert set(null.encounters["shift"]) == {0, 1}


@pytest.mark.parametrize(
    "minutes", [(0, 5), (5, 1), (-5, -1), (1, np.inf), (np.nan, 5)]
)
def test_invalid_minutes_raise(tracks, minutes):
    with pytest.raises(DataError, match="shortest, longest"):
        szlib.time_shifted(tracks, minutes=minutes)


@pytest.mark.slow
def test_the_real_day_keeps_its_hours(real_tracks):
    moved = szlib.time_shifted(real_tracks)
    hours = [
        np.bincount((each["t"] // 3600 % 24).astype(int), minlength=24)
        for each in (real_tracks, moved)
    ]
    assert np.corrcoef(*hours)[0, 1] > 0.99
    assert len(real_tracks) == len(moved)
