"""People moved in time: paths and density stay, companions are separated, the recorded hours stay."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from helpers.track_tables import DAY, make_tracks, make_walk
from studies.noninteracting_crowd import noninteracting_crowd

import szlib
from szlib.core.errors import DataError
from szlib.encounters.null_model import COMPANION_SEPARATION, ShiftableTracks
from szlib.tracks import funnels
from szlib.tracks.clock import check_tracks, nearest_tick

MINUTES = (1.0, 5.0)


@pytest.fixture(scope="module")
def tracks() -> pd.DataFrame:
    """300 people in 20 minutes, some of them cut off by the end of the recording."""
    return noninteracting_crowd(seed=3, people=300, minutes=20)


@pytest.fixture(scope="module")
def shifted(tracks: pd.DataFrame) -> pd.DataFrame:
    return szlib.time_shifted(tracks, seed=1, minutes=MINUTES)


def ticks(tracks: pd.DataFrame) -> np.ndarray:
    return nearest_tick(tracks["t"].to_numpy())


def all_day(day: str = DAY, person: int = 999, minutes: float = 20) -> pd.DataFrame:
    """Somebody who is seen from the first to the last tick, and ends far from where they began."""
    return make_walk(
        (-18, -8), (0.01, 0.0), person=person, day=day, duration=60 * minutes
    )


# --- what stays --------------------------------------------------------------------------------------


def test_shifted_tracks_stay_within_the_recorded_hours(
    tracks: pd.DataFrame, shifted: pd.DataFrame
) -> None:
    check_tracks(shifted)
    assert shifted["t"].between(tracks["t"].min(), tracks["t"].max()).all()
    assert list(shifted.columns) == list(tracks.columns)


def test_paths_stay_except_for_a_tick_on_the_seam(
    tracks: pd.DataFrame, shifted: pd.DataFrame
) -> None:
    before = {k: set(zip(p["x"], p["y"], strict=True)) for k, p in tracks.groupby("id")}
    after = {k: set(zip(p["x"], p["y"], strict=True)) for k, p in shifted.groupby("id")}
    assert before.keys() == after.keys()
    lost = [len(before[k]) - len(after[k]) for k in before]
    assert all(after[k] <= before[k] for k in before)
    assert set(lost) == {0, 1}
    stage = funnels.get(shifted)[-1]
    assert stage["rejected"] == {"on the seam of the day": sum(lost)}


def test_each_person_has_one_shift(tracks: pd.DataFrame, shifted: pd.DataFrame) -> None:
    both = tracks.merge(shifted, on=["id", "x", "y"])
    period = np.ptp(ticks(tracks)) + 2
    moved = np.rint((both["t_y"] - both["t_x"]) * 10).astype(int) % period
    moved = moved.groupby(both["id"]).agg(["min", "max"])
    assert (moved["min"] == moved["max"]).all()
    size = np.minimum(moved["min"], period - moved["min"]) / 600
    assert size.between(*MINUTES).all()
    assert moved["min"].nunique() > 250, "each their own"


def test_velocities_stay_except_near_the_seam(
    tracks: pd.DataFrame, shifted: pd.DataFrame
) -> None:
    both = tracks.merge(shifted, on=["id", "x", "y"])
    same = np.isclose(both["vx_x"], both["vx_y"]) & np.isclose(
        both["vy_x"], both["vy_y"]
    )
    across = shifted.groupby("id")["t"].agg(np.ptp) > 600
    assert same[~both["id"].isin(across.index[across])].all()


def test_density_at_the_ends_of_the_recording_stays() -> None:
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


def test_gaps_and_the_seam_are_not_bridged() -> None:
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


def test_each_day_is_shifted_within_itself() -> None:
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
        assert after.between(before.min(), before.max()).all()


def test_result_depends_on_the_seed_and_not_on_row_order(
    tracks: pd.DataFrame, shifted: pd.DataFrame
) -> None:
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


def test_encounters_of_the_data_do_not_recur(tracks: pd.DataFrame) -> None:
    def met(samples: pd.DataFrame) -> set[tuple[int, int]]:
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


def test_companions_are_separated() -> None:
    """Groups of three: by chance alone, some of so many shifts would agree within 10 s."""
    walks = [
        make_walk(
            (-18, -4 + 0.7 * k), (1, 0), person=10 * g + k, begin=40 * g, duration=10
        )
        for g in range(29)
        for k in range(3)
    ]
    crowd = ShiftableTracks.from_tracks(make_tracks(*walks))
    assert len(crowd.companions) == 29 * 3
    one, other = crowd.companions.T
    period = int(crowd.period[0])
    for seed in range(20):
        apart = (
            np.diff(crowd.draw_shifts(seed, MINUTES)[crowd.companions], axis=1).ravel()
            % period
        )
        assert np.minimum(apart, period - apart).min() >= 10 * COMPANION_SEPARATION
    alone = ShiftableTracks(**{**crowd.__dict__, "companions": crowd.companions[:0]})
    gaps = np.abs(
        np.concatenate(
            [
                np.subtract(*alone.draw_shifts(s, MINUTES)[[one, other]])
                for s in range(20)
            ]
        )
    )
    assert (gaps < 10 * COMPANION_SEPARATION).sum() > 10


def test_passing_people_are_no_companions() -> None:
    walks = [
        make_walk((-18, 0), (1, 0), person=1),
        make_walk((-14, 0.5), (-1, 0), person=2),
    ]
    assert len(ShiftableTracks.from_tracks(make_tracks(*walks)).companions) == 0


# --- errors ------------------------------------------------------------------------------------------


def test_advice_of_the_error_about_a_short_recording_works(
    tracks: pd.DataFrame,
) -> None:
    for lasts, given in ((20, (1, 25)), (6, (1.0, 10.0)), (2, (0.5, 1.9))):
        short = tracks[tracks["t"] < tracks["t"].min() + 60 * lasts]
        with pytest.raises(
            DataError, match=r"too short for shifts of up to .*; leave minutes out"
        ):
            szlib.time_shifted(short, minutes=given)
        check_tracks(szlib.time_shifted(short))
    too_short = tracks[tracks["t"] < tracks["t"].min() + 90]
    with pytest.raises(
        DataError,
        match=r"recorded for 1.5 min.*leave out recordings shorter than 2 min",
    ):
        szlib.time_shifted(pd.concat([tracks, too_short.assign(day="another")]))


@pytest.mark.parametrize("lasts", [2.0, 6.0, 10.9, 11.1, 15.0])
def test_shifts_are_in_proportion_in_recordings_shorter_than_eleven_minutes(
    lasts: float,
) -> None:
    """A long day beside a short one keeps its shifts, those of the default range."""
    long, short = (
        noninteracting_crowd(seed=k, people=200, minutes=m).assign(day=name)
        for k, (name, m) in enumerate({"long": 20, "short": 20}.items())
    )
    short = short[short["t"] < short["t"].min() + 60 * lasts]
    crowd = ShiftableTracks.from_tracks(make_tracks(long, short))
    crowd = ShiftableTracks(**{**crowd.__dict__, "companions": crowd.companions[:0]})
    minutes = np.abs(crowd.draw_shifts(3, None)) / 600
    share = min(1.0, lasts / 11)
    for day, part in ((0, 1.0), (1, share)):
        drawn = minutes[crowd.day == day]
        assert part - 0.02 <= drawn.min() < 3 * part
        assert 8 * part < drawn.max() <= 10 * part
    if lasts > 11:
        np.testing.assert_array_equal(
            crowd.draw_shifts(3, None), crowd.draw_shifts(3, (1, 10))
        )


def test_null_model_of_six_minutes_needs_no_minutes(tracks: pd.DataFrame) -> None:
    short = tracks[tracks["t"] < tracks["t"].min() + 360]
    null = szlib.null_encounters(short, shifts=2, progress=False)
    assert null.parameters["minutes"] == pytest.approx([6 / 11, 60 / 11], abs=0.01)
    assert set(null.encounters["shift"]) == {0, 1}


@pytest.mark.parametrize(
    "minutes", [(0, 5), (5, 1), (-5, -1), (1, np.inf), (np.nan, 5)]
)
def test_invalid_minutes_raise(
    tracks: pd.DataFrame, minutes: tuple[float, float]
) -> None:
    with pytest.raises(DataError, match="shortest, longest"):
        szlib.time_shifted(tracks, minutes=minutes)


def test_range_too_narrow_to_separate_companions_raises() -> None:
    three = [make_walk((-18, 0.7 * k), (1, 0), person=k, duration=10) for k in range(3)]
    tracks = make_tracks(*three, all_day())
    with pytest.raises(DataError, match="leave minutes out, for a wider range"):
        szlib.time_shifted(tracks, minutes=(2, 2))
    check_tracks(szlib.time_shifted(tracks))


def test_the_real_day_keeps_its_hours(real_tracks: pd.DataFrame) -> None:
    moved = szlib.time_shifted(real_tracks)
    hours = [
        np.bincount((each["t"] // 3600 % 24).astype(int), minlength=24)
        for each in (real_tracks, moved)
    ]
    assert np.corrcoef(*hours)[0, 1] > 0.99
    assert len(real_tracks) - len(moved) < 20
