"""Kinds of encounter: constructed walks, invariances, and people whose companions are known."""

import numpy as np
import pandas as pd
import pytest
from helpers.pair_kinds import encounter_kinds
from helpers.track_tables import DAY, make_crowd, make_tracks, make_walk, real_data
from studies import sites

import szlib
from szlib.encounters.finding import find_encounters
from szlib.encounters.kinds import COMPANIONS, KINDS, REACH, of_kind
from szlib.tracks import funnels

ROOM = szlib.Square(x=(-20, 20), y=(-20, 20))


@pytest.fixture(scope="module")
def crowd():
    """Several days of people who wander about."""
    days = [
        make_crowd(day, people=60, seconds=60, square=ROOM).assign(
            day=f"2012-10-2{day}"
        )
        for day in range(6)
    ]
    return make_tracks(*days)


PAIR = pd.DataFrame({"day": [DAY], "ref_id": [1], "other_id": [2]})


def two(*walks, duration=12.0):
    return make_tracks(
        *(
            make_walk(start, velocity, person=1 + at, duration=duration)
            for at, (start, velocity) in enumerate(walks)
        )
    )


WALKS = {
    "side by side": (two(((0, 0), (1.2, 0)), ((0.3, 1.2), (1.2, 0))), "companions"),
    "a little faster": (
        two(((0, 0), (1.2, 0)), ((-1.0, 1.0), (1.35, 0))),
        "companions",
    ),
    "stand together": (two(((0, 0), (0.05, 0)), ((1, 0), (0.05, 0))), "companions"),
    "in line": (two(((0, 0), (1.2, 0)), ((3.0, 0), (1.2, 0))), "same direction"),
    "overtaking": (two(((-6, 1), (1.6, 0)), ((0, 0), (0.8, 0))), "same direction"),
    "almost along": (two(((0, 0), (1.2, 0)), ((3, 0), (0.9, 0.8))), "same direction"),
    "towards each other": (two(((-8, 0.5), (1.2, 0)), ((8, 0), (-1.2, 0))), "opposite"),
    "almost opposite": (two(((-8, 0), (1.2, 0)), ((5, -5), (-0.9, 0.8))), "opposite"),
    "across": (two(((-8, 0), (1.2, 0)), ((0, -8), (0, 1.2))), "crossing"),
    "past somebody who stands": (
        two(((-8, 1), (1.2, 0)), ((0, 0), (0.02, 0.01))),
        "standing",
    ),
    "a short while side by side": (
        two(((0, 0), (1.2, 0)), ((0.3, 1.2), (1.2, 0)), duration=4.0),
        "same direction",
    ),
}


@pytest.mark.parametrize("name", WALKS)
def test_constructed_walks_have_their_kind(name):
    tracks, kind = WALKS[name]
    assert list(encounter_kinds(tracks, PAIR)) == [kind]


def turned(tracks):
    turn = np.array([[0.6, -0.8], [0.8, 0.6]])
    moved = tracks.copy()
    moved[["x", "y"]] = tracks[["x", "y"]].to_numpy() @ turn.T + [40.0, -7.0]
    moved[["vx", "vy"]] = tracks[["vx", "vy"]].to_numpy() @ turn.T
    return moved


SAME_WORLD = {
    "turned and moved": turned,
    "mirrored": lambda tracks: tracks.assign(y=-tracks["y"], vy=-tracks["vy"]),
    "rows in any order": lambda tracks: tracks.sample(frac=1, random_state=3),
    "later": lambda tracks: tracks.assign(t=(tracks["t"] * 10 + 12_345).round() / 10),
    "backwards in time": lambda tracks: tracks.assign(
        t=100 - tracks["t"], vx=-tracks["vx"], vy=-tracks["vy"]
    ),
    "with others around": lambda tracks: make_tracks(
        tracks, make_crowd(1), make_walk((0, 0), (1, 0), person=3)
    ),
}


@pytest.mark.parametrize("change", SAME_WORLD)
@pytest.mark.parametrize("name", WALKS)
def test_kind_is_invariant(name, change):
    tracks, kind = WALKS[name]
    tracks = SAME_WORLD[change](tracks)
    both = pd.concat(
        [PAIR, PAIR.rename(columns={"ref_id": "other_id", "other_id": "ref_id"})]
    )
    assert list(encounter_kinds(tracks, both)) == [kind, kind], (
        "and it is the same for both people"
    )


def test_kind_belongs_to_the_pair_and_its_common_track(crowd):
    samples = find_encounters(crowd, square=ROOM)
    kinds = samples.groupby("encounter")[["day", "ref_id", "other_id", "kind"]].first()
    assert set(kinds["kind"]) >= {"same direction", "opposite", "crossing", "standing"}
    pairs = kinds.assign(
        pair=[
            (day, *sorted(pair))
            for day, *pair in kinds.iloc[:, :3].itertuples(index=False)
        ]
    )
    assert (pairs.groupby("pair")["kind"].nunique() == 1).all()
    asked = encounter_kinds(crowd, samples, area=ROOM)
    assert list(asked) == list(samples["kind"])
    renamed = find_encounters(crowd.assign(id=-crowd["id"]), square=ROOM)
    assert (
        renamed["kind"].value_counts().to_dict()
        == samples["kind"].value_counts().to_dict()
    )


def test_kinds_agree_with_plain_loops(crowd):
    samples = find_encounters(crowd, square=ROOM)
    room = szlib.Square(x=(-20 - REACH, 20 + REACH), y=(-20 - REACH, 20 + REACH))
    inside = crowd[room.contains(crowd["x"], crowd["y"])]
    for _, one in samples.groupby("encounter").first().iterrows():
        of_day = inside[inside["day"] == one["day"]]
        ref, other = (
            of_day[of_day["id"] == one[who]] for who in ("ref_id", "other_id")
        )
        track = ref.merge(other, on="t", suffixes=("", "_o"))
        apart = np.hypot(track["x"] - track["x_o"], track["y"] - track["y_o"])
        relative = np.hypot(track["vx"] - track["vx_o"], track["vy"] - track["vy_o"])
        paces = [
            np.hypot(track[f"vx{w}"], track[f"vy{w}"]).median() for w in ("", "_o")
        ]
        dot = (track["vx"] * track["vx_o"] + track["vy"] * track["vy_o"]).sum()
        cross = (track["vx"] * track["vy_o"] - track["vy"] * track["vx_o"]).sum()
        degrees = abs(np.degrees(np.arctan2(cross, dot)))
        if len(track) >= 50 and (apart <= 2).mean() >= 0.8 and relative.median() <= 0.4:
            expected = "companions"
        elif min(paces) < 0.4:
            expected = "standing"
        else:
            expected = (
                "same direction"
                if degrees <= 45
                else "opposite"
                if degrees >= 135
                else "crossing"
            )
        assert one["kind"] == expected


def test_rows_beyond_the_reach_do_not_count():
    tracks = two(((-17, 0), (1.2, 0)), ((-17, 1.2), (1.2, 0)))  # for 12 s, to x = -2.6
    assert list(
        encounter_kinds(tracks, PAIR, area=szlib.Square(x=(0, 20), y=(-5, 5)))
    ) == ["same direction"]
    assert list(
        encounter_kinds(tracks, PAIR, area=szlib.Square(x=(-4, 20), y=(-5, 5)))
    ) == [COMPANIONS]
    assert (
        encounter_kinds(tracks, PAIR, area=szlib.Square(x=(30, 40), y=(-5, 5)))
        .isna()
        .all()
    )


def test_people_without_a_common_track_have_no_kind():
    tracks = make_tracks(
        make_walk((0, 0), (1, 0)), make_walk((0, 0), (1, 0), person=2, begin=60.0)
    )
    assert encounter_kinds(tracks, PAIR).isna().all()


def test_of_kind_selects_kinds_and_counts_the_others(crowd):
    everybody = find_encounters(crowd, square=ROOM)
    strangers = find_encounters(crowd, square=ROOM, kinds="strangers")
    pd.testing.assert_frame_equal(strangers, everybody[everybody["kind"] != COMPANIONS])
    pd.testing.assert_frame_equal(strangers, of_kind(everybody, KINDS[1:]))
    pd.testing.assert_frame_equal(everybody, of_kind(everybody, None))
    parts = [of_kind(everybody, kind) for kind in KINDS]
    assert sum(map(len, parts)) == len(everybody)
    stage = funnels.get(parts[2])[-1]
    assert stage["stage"] == "samples: same direction"
    assert stage["rejected"] == {
        kind: int(n)
        for kind, n in everybody["kind"].value_counts().items()
        if n and kind != "same direction"
    }


def test_invalid_kinds_and_pairs_raise():
    tracks, _ = WALKS["in line"]
    with pytest.raises(
        szlib.DataError, match="unknown kinds 'friends'; expected some of"
    ):
        find_encounters(tracks, square=ROOM, kinds="friends")
    with pytest.raises(szlib.DataError, match="unknown kinds"):
        of_kind(find_encounters(tracks, square=ROOM), [])
    with pytest.raises(szlib.DataError, match="no column kind"):
        of_kind(find_encounters(tracks, square=ROOM).drop(columns="kind"), "strangers")


# --- people whose companions are known ---------------------------------------------------------------


def confusion(tracks, groups):
    """Pairs that are there together for 2 s or more: (pairs, companions, found, found and companions)."""
    seen = tracks.groupby("id")["t"].agg(["min", "max"])
    begin, end = seen["min"].to_numpy(), seen["max"].to_numpy()
    together = np.minimum(end, end[:, None]) - np.maximum(begin, begin[:, None]) >= 2
    a, b = np.nonzero(np.triu(together, 1))
    pairs = pd.DataFrame(
        {
            "day": tracks["day"].iloc[0],
            "ref_id": seen.index[a],
            "other_id": seen.index[b],
        }
    )
    of = groups.set_index("id")["group"]
    true = (pairs["ref_id"].map(of) == pairs["other_id"].map(of)).to_numpy()
    found = encounter_kinds(tracks, pairs) == COMPANIONS
    return len(pairs), int(true.sum()), int(found.sum()), int((found & true).sum())


def test_groups_of_the_eth_sequence_are_found():
    folder = real_data("eth")
    with pytest.warns(szlib.DataWarning, match="share people"):
        groups = sites.read_groups(folder / "seq_eth_groups.txt")
    pairs, true, found, right = confusion(
        szlib.read_tracks(folder / "seq_eth_obsmat.txt"), groups
    )
    assert (pairs, true) == (2044, 177)
    assert right / found >= 0.75, (
        "precision; most of the others walk side by side, but are in no line"
    )
    assert right / true >= 0.65, (
        "recall; those missed are the outer pairs of large groups"
    )


def test_groups_of_thor_magni_are_found():
    file = real_data("magni") / "A.csv"
    pairs, true, found, right = confusion(
        szlib.read_tracks(file), sites.read_magni_groups(file)
    )
    assert (pairs, true) == (198, 24)
    assert (found, right) == (23, 23), "the one missed is of three who walk in a line"


def test_the_kinds_of_the_real_day(real_tracks, real_samples):
    kinds = real_samples.groupby("encounter")["kind"].first().value_counts()
    assert kinds.sum() == 252
    assert 170 <= kinds["companions"] + kinds["same direction"] <= 190
    assert kinds["companions"] > 80
    whole = encounter_kinds(real_tracks, real_samples) == COMPANIONS
    reached = (real_samples["kind"] == COMPANIONS).to_numpy()
    assert reached[whole].mean() > 0.95, (
        "whoever keeps together all the way does so around the square"
    )


@pytest.mark.slow
def test_few_shifted_pairs_are_companions(real_tracks):
    rng = np.random.default_rng(0)
    people, of = np.unique(real_tracks["id"], return_inverse=True)
    shift = rng.choice([-1, 1], len(people)) * rng.integers(600, 6000, len(people))
    alone = real_tracks.assign(t=np.rint(real_tracks["t"] * 10 + shift[of]) / 10)
    kinds = (
        find_encounters(alone)
        .groupby("encounter")[["ref_id", "other_id", "kind"]]
        .first()
    )
    assert len(kinds) > 150
    assert (kinds["kind"] == COMPANIONS).mean() < 0.06


def test_strangers_are_all_but_companions():
    samples = pd.DataFrame({"encounter": range(len(KINDS)), "kind": list(KINDS)})
    assert of_kind(samples, "strangers")["kind"].tolist() == [
        kind for kind in KINDS if kind != COMPANIONS
    ]
    assert of_kind(samples, COMPANIONS)["encounter"].tolist() == [
        KINDS.index(COMPANIONS)
    ]
