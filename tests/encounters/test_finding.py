"""Encounters: the search agrees with plain loops, and frame, labels and order do not matter."""

import math
from itertools import pairwise

import numpy as np
import pandas as pd
import pytest
from helpers.encounter_tables import ROOM, assert_same_samples
from helpers.track_tables import DAY, make_crowd, make_tracks, make_walk
from plots import reference_frame

import szlib
from szlib.encounters import occupants
from szlib.encounters.finding import find_encounters
from szlib.encounters.geometry import AttentionalSpace, Square, wrap_angle
from szlib.encounters.occupants import SAMPLE_COLUMNS
from szlib.tracks import funnels

AHEAD, AROUND = AttentionalSpace(), AttentionalSpace(centred=True)
VARIANTS = {
    "ahead": {},
    "ahead, throughout": {"throughout": True},
    "centred": {"space": AROUND},
    "centred, throughout": {"space": AROUND, "throughout": True},
    "1 s": {"duration": 1.0},
    "one sample": {"duration": 0.1, "min_distance": 0.0},
    "5 s, narrow": {
        "duration": 5.0,
        "space": AttentionalSpace(3.0, 2.0),
        "min_speed": 0.2,
    },
    "far and fast": {"min_distance": 2.5, "min_speed": 0.9},
}


@pytest.fixture(scope="module")
def crowd():
    return make_crowd(77, people=160, seconds=200, square=ROOM)


@pytest.fixture(scope="module")
def known(crowd):
    return find_encounters(crowd, square=ROOM)


# --- the four conditions in plain loops --------------------------------------------------------------


def in_frame(person, point):
    """A point of the world seen by a person (x, y, vx, vy)."""
    heading = math.atan2(person[3], person[2])
    dx, dy = point[0] - person[0], point[1] - person[1]
    return (
        dx * math.cos(heading) + dy * math.sin(heading),
        dy * math.cos(heading) - dx * math.sin(heading),
    )


def search(
    tracks,
    *,
    square,
    space=AHEAD,
    duration=3.0,
    min_distance=1.0,
    min_speed=0.4,
    throughout=False,
):
    """Every sample of every encounter, straight from the four conditions."""
    near, far = (
        (-space.length / 2, space.length / 2) if space.centred else (0.0, space.length)
    )
    side = space.width / 2
    people = {}  # (day, id): ticks
    scene = {}  # by day and tick: the people and their places
    for row in tracks.itertuples():
        tick = round(row.t * 10)
        people.setdefault((str(row.day), row.id), []).append(tick)
        scene.setdefault((str(row.day), tick), {})[row.id] = (
            row.x,
            row.y,
            row.vx,
            row.vy,
        )

    def walks_within(person):
        if not math.hypot(person[2], person[3]) >= min_speed:
            return False
        heading = math.atan2(person[3], person[2])
        for ahead in (near, far):
            for left in (-side, side):
                x = person[0] + ahead * math.cos(heading) - left * math.sin(heading)
                y = person[1] + ahead * math.sin(heading) + left * math.cos(heading)
                if not (
                    square.x[0] <= x <= square.x[1] and square.y[0] <= y <= square.y[1]
                ):
                    return False
        return True

    def occupants(now, ref):
        seen = {other: in_frame(now[ref], now[other]) for other in now if other != ref}
        return {
            o
            for o, (ahead, left) in seen.items()
            if near <= ahead <= far and abs(left) <= side
        }

    def met_from(day, ref, window):
        now = scene[day, window[0]]
        if not walks_within(now[ref]) or len(met := occupants(now, ref)) != 1:
            return None
        (other,) = met
        if math.dist(now[ref][:2], now[other][:2]) < min_distance:
            return None
        for tick in window:
            now = scene.get((day, tick), {})
            if ref not in now or other not in now or not walks_within(now[ref]):
                return None
            inside = occupants(now, ref)
            if inside - met or (throughout and not inside):
                return None
        return other

    found, number = [], 0
    for day, ref in sorted(people):
        free = -math.inf
        for begin in sorted(people[day, ref]):
            window = range(begin, begin + round(duration * 10) + 1)
            other = met_from(day, ref, window) if begin >= free else None
            if other is None:
                continue
            for tick in window:
                person, met = scene[day, tick][ref], scene[day, tick][other]
                ahead, left = in_frame(person, met)
                distance, angle = (
                    math.dist(person[:2], met[:2]),
                    math.atan2(left, ahead),
                )
                speed, other_speed = (
                    math.hypot(each[2], each[3]) for each in (person, met)
                )
                other_angle = math.atan2(*in_frame(met, person)[::-1])
                sample = (tick / 10, angle, distance, speed, other_angle, other_speed)
                found.append((number, day, ref, other, *sample))
            free, number = window[-1] + 1, number + 1
    return pd.DataFrame(found, columns=SAMPLE_COLUMNS).astype(
        dict.fromkeys(SAMPLE_COLUMNS[4:], float)
    )


@pytest.mark.parametrize("variant", VARIANTS)
def test_encounters_agree_with_plain_loops(variant):
    options = {"square": szlib.ATC_SQUARE, **VARIANTS[variant]}
    found = 0
    for seed in range(16):
        tracks = make_crowd(seed)
        samples = find_encounters(tracks, **options)
        assert_same_samples(samples, search(tracks, **options))
        found += samples["encounter"].nunique()
    assert found >= 5  # or nothing was compared


def test_encounters_agree_with_plain_loops_in_a_larger_room(crowd, known):
    assert known["encounter"].nunique() >= 20
    assert_same_samples(known, search(crowd, square=ROOM))


# --- invariances -------------------------------------------------------------------------------------


def test_mirror_reverses_the_sign_of_los_angle(crowd, known):
    mirrored = crowd.assign(y=-crowd["y"], vy=-crowd["vy"])
    angles = ["los_angle", "other_los_angle"]
    expected = known.assign(**{name: -known[name] for name in angles})
    assert_same_samples(find_encounters(mirrored, square=ROOM), expected)
    assert (known["los_angle"] < 0).any()


def test_row_order_does_not_matter_and_input_is_unchanged(crowd, known):
    shuffled = crowd.sample(frac=1, random_state=5)
    before = shuffled.copy(deep=True)
    pd.testing.assert_frame_equal(find_encounters(shuffled, square=ROOM), known)
    pd.testing.assert_frame_equal(shuffled, before)


def test_ids_and_day_names_do_not_matter(crowd, known):
    names = {person: f"p{person:04d}" for person in crowd["id"].unique()}
    renamed = find_encounters(crowd.assign(id=crowd["id"].map(names)), square=ROOM)
    expected = known.assign(
        ref_id=known["ref_id"].map(names), other_id=known["other_id"].map(names)
    )
    assert_same_samples(renamed, expected)
    backwards = find_encounters(crowd.assign(id=-crowd["id"]), square=ROOM)
    back = backwards.assign(
        ref_id=-backwards["ref_id"], other_id=-backwards["other_id"]
    )
    columns = [*SAMPLE_COLUMNS[1:], "kind"]
    pd.testing.assert_frame_equal(
        back.sort_values(["ref_id", "t"], ignore_index=True)[columns],
        known.sort_values(["ref_id", "t"], ignore_index=True)[columns],
    )


def test_days_separately_and_together_give_the_same():
    days = {f"2012-10-2{k}": make_crowd(k, people=20) for k in range(1, 6)}
    together = make_tracks(
        *(tracks.assign(day=day) for day, tracks in reversed(days.items()))
    )
    place = {"square": szlib.ATC_SQUARE}
    alone = [
        find_encounters(tracks.assign(day=day), **place) for day, tracks in days.items()
    ]
    assert sum(len(samples) for samples in alone) > 0
    expected = pd.concat(alone)
    expected["encounter"] = np.arange(len(expected)) // 31
    assert_same_samples(find_encounters(together, **place), expected)


def test_block_size_does_not_matter(crowd, known, monkeypatch):
    for pairs in (40, 3001):
        monkeypatch.setattr(occupants, "_AT_ONCE", pairs)
        pd.testing.assert_frame_equal(find_encounters(crowd, square=ROOM), known)


def test_every_encounter_meets_the_four_conditions(crowd, known):
    assert (known.groupby("encounter").size() == 31).all()
    assert known["encounter"].is_monotonic_increasing
    assert known.equals(known.sort_values(["day", "ref_id", "t"], ignore_index=True))
    for _, one in known.groupby("encounter"):
        assert one[["day", "ref_id", "other_id"]].drop_duplicates().shape[0] == 1
        np.testing.assert_array_equal(np.diff(np.rint(one["t"] * 10)), 1)
    first = known.groupby("encounter").first()
    assert (first["distance"] >= 1).all()
    assert (known["speed"] >= 0.4).all()
    assert (first["los_angle"].abs() <= np.pi / 2).all()
    for _, windows in known.groupby("ref_id"):
        begins = windows.groupby("encounter")["t"].first()
        assert all(later - earlier > 3.0 for earlier, later in pairwise(begins))


@pytest.mark.parametrize("variant", VARIANTS)
def test_the_funnel_adds_up(crowd, variant):
    samples = find_encounters(crowd, square=ROOM, **VARIANTS[variant])
    ticks, windows = funnels.get(samples)
    assert ticks["entered"] == len(crowd)
    assert ticks["kept"] == windows["entered"]
    assert windows["kept"] == samples["encounter"].nunique()
    for stage in (ticks, windows):
        assert stage["entered"] == stage["kept"] + sum(stage["rejected"].values())


# --- scenes made by hand -----------------------------------------------------------------------------


def reasons(samples):
    return {
        reason: count
        for stage in funnels.get(samples)
        for reason, count in stage["rejected"].items()
    }


def test_two_people_who_meet_are_two_encounters():
    """Both keep to their right, so each has the other on the left, and behind in the end."""
    east = make_walk((-2.0, -0.5), (1.2, 0.0), person=1, duration=3.0)
    west = make_walk((2.0, 0.5), (-1.2, 0.0), person=2, duration=3.0)
    samples = find_encounters(make_tracks(east, west), square=ROOM)
    assert samples.groupby("encounter")[
        ["ref_id", "other_id"]
    ].first().to_numpy().tolist() == [
        [1, 2],
        [2, 1],
    ]
    ahead = 4.0 - 2.4 * np.arange(31) / 10
    for _, one in samples.groupby("encounter"):
        np.testing.assert_allclose(one["los_angle"], np.arctan2(1.0, ahead), atol=1e-12)
        np.testing.assert_allclose(one["distance"], np.hypot(1.0, ahead), atol=1e-12)
        np.testing.assert_allclose(one["speed"], 1.2, atol=1e-12)
        np.testing.assert_allclose(one["t"], np.arange(31) / 10, atol=0)
    assert samples["los_angle"].max() > np.pi / 2


def test_throughout_excludes_people_who_pass():
    east = make_walk((-2.0, -0.5), (1.2, 0.0), person=1, duration=3.0)
    west = make_walk((2.0, 0.5), (-1.2, 0.0), person=2, duration=3.0)
    samples = find_encounters(make_tracks(east, west), square=ROOM, throughout=True)
    assert len(samples) == 0
    assert reasons(samples)["the other person leaves the space"] == 2


FOLLOWED = make_walk((3.0, 0.2), (1.0, 0.0), person=2, duration=3.0)
FOLLOWER = make_walk((0.0, 0.0), (1.0, 0.0), person=1, duration=3.0)


def test_only_the_follower_has_an_encounter():
    samples = find_encounters(make_tracks(FOLLOWER, FOLLOWED), square=ROOM)
    assert set(samples["ref_id"]) == {1}
    np.testing.assert_allclose(samples["los_angle"], math.atan2(0.2, 3.0))
    around = find_encounters(
        make_tracks(FOLLOWER, FOLLOWED),
        square=ROOM,
        space=AttentionalSpace(7.0, 4.0, centred=True),
    )
    assert around.groupby("encounter")["ref_id"].first().tolist() == [1, 2]
    behind = around.loc[around["ref_id"] == 2, "los_angle"]
    np.testing.assert_allclose(behind, wrap_angle(np.array(math.atan2(-0.2, -3.0))))


def test_los_angle_straight_behind_is_plus_pi():
    behind = make_walk((-1.5, 0.0), (1.0, 0.0), person=2, duration=3.0)
    samples = find_encounters(make_tracks(FOLLOWER, behind), square=ROOM, space=AROUND)
    np.testing.assert_array_equal(
        samples.loc[samples["ref_id"] == 1, "los_angle"], np.pi
    )


STRANGER = make_walk((4.0, 2.5), (0.0, -1.0), person=3, duration=3.0)
ALMOST_SLOW = FOLLOWER.assign(vx=FOLLOWER["vx"].where(FOLLOWER["t"] != 1.7, 0.3))
SPOILED = {
    "a stranger crosses": (
        [FOLLOWER, FOLLOWED, STRANGER],
        "somebody else enters the space",
    ),
    "three people": (
        [FOLLOWER, FOLLOWED, FOLLOWED.assign(id=3, y=-0.3)],
        "several people in the space",
    ),
    "too near": (
        [FOLLOWER, FOLLOWED.assign(x=FOLLOWED["x"] - 2.1)],
        "other person nearer than 1.0 m",
    ),
    "slow": (
        [make_walk((0, 0), (0.39, 0), duration=3.0), FOLLOWED],
        "slower than 0.4 m/s",
    ),
    "slow for a moment": ([ALMOST_SLOW, FOLLOWED], "too slow within the window"),
    "standing": (
        [make_walk((0, 0), (0, 0), duration=3.0), FOLLOWED],
        "slower than 0.4 m/s",
    ),
    "no velocity": ([FOLLOWER.assign(vx=np.nan), FOLLOWED], "velocity unknown"),
    "the reference ends": (
        [FOLLOWER.query("t < 2.95"), FOLLOWED],
        "a track ends within the window",
    ),
    "the other ends": (
        [FOLLOWER, FOLLOWED.query("t < 2.95")],
        "a track ends within the window",
    ),
    "the reference blinks": (
        [FOLLOWER.drop(index=20), FOLLOWED],
        "a track ends within the window",
    ),
    "the other blinks": (
        [FOLLOWER, FOLLOWED.drop(index=20)],
        "a track ends within the window",
    ),
    "beside": ([FOLLOWER, FOLLOWED.assign(y=2.01)], "nobody in the space"),
    "too far ahead": (
        [FOLLOWER, FOLLOWED.assign(x=FOLLOWED["x"] + 2.01)],
        "nobody in the space",
    ),
}


@pytest.mark.parametrize("scene", SPOILED)
def test_funnel_names_the_failed_condition(scene):
    people, reason = SPOILED[scene]
    samples = find_encounters(make_tracks(*people), square=ROOM)
    assert len(samples[samples["ref_id"] == 1]) == 0
    assert reason in reasons(samples)


@pytest.mark.parametrize(
    ("low", "high", "reason"),
    [
        (-1.0, 7.9, "a corner leaves the area within the window"),
        (-1.0, 4.9, "a corner of the space outside the area"),
        (3.05, 20.0, "not in the area"),
    ],
)
def test_funnel_names_a_space_that_leaves_the_area(low, high, reason):
    """The far corners of the follower's space go from 5 to 8 m."""
    tracks = make_tracks(FOLLOWER, FOLLOWED)
    assert len(find_encounters(tracks, square=Square(x=(-1, 8.1), y=(-2.1, 2.1)))) == 31
    samples = find_encounters(tracks, square=Square(x=(low, high), y=(-2.1, 2.1)))
    assert len(samples[samples["ref_id"] == 1]) == 0
    assert reason in reasons(samples)
    assert len(find_encounters(tracks, square=Square(x=(-1, 8.1), y=(-1.9, 2.1)))) == 0


def test_people_outside_the_area_are_not_in_the_space():
    """They cannot be: the space lies inside the square."""
    outside = make_walk((3.0, 2.2), (1.0, 0.0), person=3, duration=3.0)
    square = Square(x=(-1, 9), y=(-2.1, 2.1))
    assert_same_samples(
        find_encounters(make_tracks(FOLLOWER, FOLLOWED, outside), square=square),
        find_encounters(make_tracks(FOLLOWER, FOLLOWED), square=square),
    )


def test_windows_follow_each_other_without_overlap():
    """A long walk behind somebody: 31 samples each, the next begins at the tick after."""
    follower = make_walk((-18.0, 0.0), (1.0, 0.0), person=1, duration=12.35)
    followed = make_walk((-15.0, 0.0), (1.0, 0.0), person=2, duration=12.35)
    samples = find_encounters(make_tracks(follower, followed), square=ROOM)
    begins = samples.groupby("encounter")["t"].first().tolist()
    assert begins == [0.0, 3.1, 6.2, 9.3]
    assert reasons(samples)["overlaps an earlier window"] == len(follower) - 30 - 4


def test_other_person_can_change_between_windows_only():
    """One leaves the space to the side after 1 s, then another comes in."""
    walks = [
        make_walk((0, 0), (1, 0), person=1, duration=3.0),
        make_walk((3, 1.5), (1, 0.6), person=2, duration=3.0),
        make_walk((4, -2.9), (1, 0.6), person=3, duration=3.0),
    ]
    samples = find_encounters(make_tracks(*walks), square=ROOM)
    assert len(samples[samples["ref_id"] == 1]) == 0
    assert "somebody else enters the space" in reasons(samples)
    alone = find_encounters(make_tracks(*walks[:2]), square=ROOM)
    assert alone["ref_id"].tolist() == [1] * 31


def test_same_id_on_another_day_is_another_person():
    yesterday = FOLLOWED.assign(day="2012-10-23", id=3, y=0.0)
    for there in (yesterday, yesterday.head(1)):
        samples = find_encounters(make_tracks(there, FOLLOWER, FOLLOWED), square=ROOM)
        assert set(samples["day"]) == {DAY}
        assert len(samples) == 31


def test_a_person_whose_id_changes_is_two_people():
    """The tracker loses the follower and goes on with the next id, at the next tick."""
    relabelled = FOLLOWER.assign(id=FOLLOWER["id"].where(FOLLOWER["t"] < 1.55, 2))
    samples = find_encounters(
        make_tracks(relabelled, FOLLOWED.assign(id=5)), square=ROOM
    )
    assert len(samples) == 0
    assert reasons(samples)["a track ends within the window"] > 0


# --- nothing, and nonsense ---------------------------------------------------------------------------


def test_no_encounter_gives_an_empty_table_with_all_columns():
    full = find_encounters(make_tracks(FOLLOWER, FOLLOWED), square=ROOM)
    for tracks in (make_tracks(FOLLOWER), make_tracks(FOLLOWER.assign(x=99.0))):
        empty = find_encounters(tracks, square=ROOM)
        assert len(empty) == 0
        assert empty.dtypes.astype(str).to_dict() == full.dtypes.astype(str).to_dict()
        assert funnels.get(empty)[-1]["kept"] == 0
    with pytest.raises(szlib.DataError, match="the table is empty"):
        szlib.SocialZone.fit(empty)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"duration": 0}, "duration"),
        ({"duration": np.nan}, "duration"),
        ({"duration": np.inf}, "duration"),
        ({"duration": 0.25}, "multiple of 0.1 s"),
        ({"min_distance": -1}, "min_distance"),
        ({"min_speed": 0}, "min_speed"),
        ({"min_speed": np.nan}, "min_speed"),
    ],
)
def test_invalid_parameters_raise(options, message):
    with pytest.raises(szlib.DataError, match=message):
        find_encounters(make_tracks(FOLLOWER, FOLLOWED), square=ROOM, **options)


def test_invalid_tables_raise():
    tracks = make_tracks(FOLLOWER, FOLLOWED)
    for message, table in {
        r"columns \['vx'\] are missing": tracks.drop(columns="vx"),
        "the table is empty": tracks.iloc[:0],
        "row 3: got .*'x': nan": tracks.assign(x=tracks["x"].where(tracks.index != 3)),
        "is not a multiple of 0.1 s": tracks.assign(t=tracks["t"] + 0.05),
        "two rows at t": pd.concat([tracks, tracks.head(1)]),
    }.items():
        with pytest.raises(szlib.DataError, match=message):
            find_encounters(table, square=ROOM)


@pytest.mark.parametrize("x", [(1, 1), (2, 1), (0, np.nan), (-np.inf, 0)])
def test_squares_without_an_inside_raise(x):
    with pytest.raises(szlib.DataError, match="x and y of a square must be finite"):
        Square(x=x, y=(0, 1))
    with pytest.raises(szlib.DataError, match="x and y of a square must be finite"):
        Square(x=(0, 1), y=x)


@pytest.mark.parametrize("sides", [(0, 4), (5, -1), (np.nan, 4), (5, np.inf)])
def test_spaces_without_an_inside_raise(sides):
    with pytest.raises(
        szlib.DataError, match="of an attentional space must be positive"
    ):
        AttentionalSpace(*sides)


# --- shapes and angles -------------------------------------------------------------------------------


def test_corners_lie_on_the_border_of_the_space():
    for space in (AHEAD, AROUND, AttentionalSpace(2.0, 6.0)):
        corners = space.corners
        assert np.ptp(corners, axis=0).tolist() == [space.length, space.width]
        assert space.contains(*corners.T).all()
        assert not space.contains(
            *((corners - corners.mean(axis=0)) * 1.001 + corners.mean(axis=0)).T
        ).any()
    assert AHEAD.corners[:, 0].min() == 0.0
    np.testing.assert_array_equal(AROUND.corners.mean(axis=0), 0)


def test_wrap_angle_keeps_the_direction():
    angles = np.concatenate([np.linspace(-20, 20, 1001), np.pi * np.arange(-6, 7)])
    wrapped = wrap_angle(angles)
    np.testing.assert_allclose(np.exp(1j * wrapped), np.exp(1j * angles), atol=1e-12)
    assert ((wrapped > -np.pi) & (wrapped <= np.pi)).all()
    ends = np.array([np.pi, -np.pi, np.nextafter(np.pi, 4)])
    np.testing.assert_array_equal(wrap_angle(ends), np.pi)


# --- the reference frame -----------------------------------------------------------------------------


def test_paths_in_the_reference_frame(crowd, known):
    paths = reference_frame(crowd.sample(frac=1, random_state=1), known)
    assert paths[["encounter", "t"]].equals(known[["encounter", "t"]])
    opening = ~known["encounter"].duplicated()
    ref, oth = (paths[[f"{who}_x", f"{who}_y"]].to_numpy() for who in ("ref", "other"))
    np.testing.assert_array_equal(ref[opening], 0)
    apart = known.loc[opening, ["distance", "los_angle"]].to_numpy()
    polar = apart[:, :1] * np.column_stack([np.cos(apart[:, 1]), np.sin(apart[:, 1])])
    np.testing.assert_allclose(oth[opening], polar, atol=1e-9)
    np.testing.assert_allclose(np.hypot(*(oth - ref).T), known["distance"], atol=1e-9)
    following = known.index[opening] + 1
    assert (ref[following, 0] > 0).all()  # x points along the motion


@pytest.mark.parametrize("column", SAMPLE_COLUMNS[:5])
def test_paths_need_the_people_and_times_of_the_samples(crowd, known, column):
    with pytest.raises(szlib.DataError, match=rf"columns \['{column}'\] are missing"):
        reference_frame(crowd, known.drop(columns=column))


def test_paths_follow_the_order_of_the_samples(crowd, known):
    expected = reference_frame(crowd, known)
    shuffled = known.sample(frac=1, random_state=2)
    again = reference_frame(crowd, shuffled)
    pd.testing.assert_frame_equal(
        again, expected.iloc[shuffled.index].reset_index(drop=True)
    )


def test_samples_of_other_tracks_raise(crowd, known):
    with pytest.raises(
        szlib.DataError, match=r"row .*got .*; this sample is not in these tracks"
    ):
        reference_frame(crowd[crowd["id"] != known["ref_id"].iloc[40]], known)
    with pytest.raises(szlib.DataError, match="the table is empty"):
        reference_frame(crowd, known.iloc[:0])


# --- the real day ------------------------------------------------------------------------------------


def test_the_real_day_has_about_as_many_encounters_as_the_paper(
    real_samples,
):
    """The paper: 16,181 in 92 days, 176 a day."""
    assert 100 <= real_samples["encounter"].nunique() <= 400
    assert (real_samples["los_angle"].abs() > np.pi / 2).any()
    for earlier, later in pairwise(funnels.get(real_samples)[-3:]):
        assert (
            later["entered"] == earlier["kept"] or earlier["stage"] == "clock: samples"
        )


@pytest.mark.slow
def test_plain_loops_agree_on_the_real_day(real_tracks):
    here = real_tracks[
        szlib.ATC_SQUARE.contains(
            real_tracks["x"].to_numpy(), real_tracks["y"].to_numpy()
        )
    ]
    samples = find_encounters(here)
    assert samples["encounter"].nunique() >= 100
    assert_same_samples(samples, search(here, square=szlib.ATC_SQUARE))


def test_the_papers_conditions_are_the_defaults():
    """A space of 4 m x 5 m, 3 s, 1 m, 0.4 m/s (sec. 2)."""
    space = szlib.AttentionalSpace(length=5.0, width=4.0)
    papers = {"space": space, "duration": 3.0, "min_distance": 1.0, "min_speed": 0.4}
    assert szlib.EncounterSettings(**papers) == szlib.EncounterSettings()
