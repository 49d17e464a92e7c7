"""Tracks on one clock: straight walks stay straight, and gaps are not interpolated."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from helpers.track_tables import DAY, make_crowd, make_tracks, make_walk
from hypothesis import given, settings
from hypothesis import strategies as st

import szlib
from szlib.tracks import funnels
from szlib.tracks.clock import COLUMNS, clock_index, to_clock

BEGIN = 1_351_040_400.0
ROUNDING = 1e-6
"""Of a time stamp near 1.35e9 s, times the speed of a person [m]."""


def make_raw(
    t: object, x: object = 0.0, y: object = 0.0, *, person: int = 1, day: str = DAY
) -> pd.DataFrame:
    """Samples as read_raw gives them, at irregular times."""
    rows = pd.DataFrame({"day": day, "id": person, "t": np.asarray(t, float)})
    rows["x"], rows["y"] = x, y
    return rows


def irregular(
    rng: np.random.Generator, seconds: float, begin: float = BEGIN
) -> np.ndarray:
    """Frames every 33 to 50 ms, in whole ms, as ATC has them."""
    return begin + np.cumsum(rng.integers(33, 51, round(seconds / 0.042))) / 1000


def walkers(seed: int) -> pd.DataFrame:
    """Several people on crooked paths, some with gaps."""
    rng = np.random.default_rng(seed)
    people = []
    for person in range(6):
        t = irregular(rng, 8, BEGIN + rng.integers(5000) / 1000)
        t = np.delete(t, slice(60, 60 + int(rng.integers(0, 40))))
        way = np.cumsum(rng.normal(0, 0.05, (len(t), 2)), axis=0)
        people.append(
            make_raw(t, *way.T, person=person, day=f"2012-10-2{4 + person % 2}")
        )
    return pd.concat(people, ignore_index=True)


def pieces_of(raw: pd.DataFrame, max_gap: float) -> list[pd.DataFrame]:
    """Gap-free pieces, found by a plain loop."""
    pieces = []
    for _, rows in raw.sort_values("t").groupby(["day", "id"], observed=True):
        begin = 0
        for k in range(1, len(rows) + 1):
            if k == len(rows) or rows["t"].iloc[k] - rows["t"].iloc[k - 1] > max_gap:
                pieces.append(rows.iloc[begin:k])
                begin = k
    return pieces


# --- positions ---------------------------------------------------------------------------------------


@given(
    start=st.tuples(*[st.floats(-40, 40)] * 2),
    velocity=st.tuples(*[st.floats(-2, 2)] * 2),
    seed=st.integers(0, 99),
)
@settings(max_examples=40, deadline=None, derandomize=True)
def test_a_straight_walk_stays_straight(
    start: tuple, velocity: tuple, seed: int
) -> None:
    t = irregular(np.random.default_rng(seed), 5)
    tracks = to_clock(
        make_raw(t, *(np.outer(velocity, t - BEGIN) + np.reshape(start, (2, 1))))
    )
    since = tracks["t"].to_numpy() - BEGIN
    for axis, component, begin, pace in zip(
        "xy", ("vx", "vy"), start, velocity, strict=True
    ):
        np.testing.assert_allclose(
            tracks[axis], begin + pace * since, rtol=0, atol=ROUNDING
        )
        np.testing.assert_allclose(tracks[component], pace, rtol=0, atol=10 * ROUNDING)
    assert list(tracks.columns) == COLUMNS


@pytest.mark.parametrize("seed", range(5))
def test_positions_equal_numpy_interpolation_within_each_piece(seed: int) -> None:
    raw = walkers(seed)
    tracks = to_clock(raw, max_gap=0.5)
    expected = []
    for piece in pieces_of(raw, 0.5):
        first, last = piece["t"].iloc[[0, -1]]
        ticks = (
            np.arange(np.ceil(first * 10 - 1e-4), np.floor(last * 10 + 1e-4) + 1) / 10
        )
        x, y = (np.interp(ticks, piece["t"], piece[axis]) for axis in "xy")
        expected.append(
            make_raw(ticks, x, y, person=piece["id"].iloc[0], day=piece["day"].iloc[0])
        )
    table = pd.concat(expected).sort_values(["day", "id", "t"], ignore_index=True)
    assert len(expected) > 6
    pd.testing.assert_frame_equal(
        tracks[["day", "id", "t", "x", "y"]],
        table,
        check_categorical=False,
        check_dtype=False,
        rtol=0,
        atol=ROUNDING,
    )


def test_samples_on_the_clock_are_unchanged() -> None:
    """Time stamps of whole ms near 1.35e9 s are not exact numbers, and still hit their ticks."""
    rng = np.random.default_rng(0)
    t = BEGIN + np.arange(4000) / 10
    raw = make_raw(
        np.array([float(f"{value:.3f}") for value in t]), *rng.normal(size=(2, 4000))
    )
    tracks = to_clock(raw)
    np.testing.assert_array_equal(
        tracks["t"], (round(BEGIN * 10) + np.arange(4000)) / 10
    )
    np.testing.assert_allclose(tracks[["x", "y"]], raw[["x", "y"]], rtol=0, atol=1e-5)


@pytest.mark.parametrize(
    "t",
    [
        0.1 * np.arange(600),
        np.cumsum(np.full(600, 0.1)),
        np.arange(600, 12_000, 6) * (1 / 15),
    ],
    ids=["products", "sums", "every sixth frame at 15 Hz"],
)
def test_rounded_times_still_give_their_ticks(t: np.ndarray) -> None:
    ticks = np.rint(t * 10).astype(int)
    tracks = to_clock(make_raw(t))
    np.testing.assert_array_equal(
        np.rint(tracks["t"] * 10), np.arange(ticks[0], ticks[-1] + 1)
    )
    pairs = make_raw(np.r_[t, t + 0.05]).assign(id=np.tile(np.arange(len(t)), 2))
    # each person is seen from just one tick to before the next
    assert len(to_clock(pairs)) == len(t)


@pytest.mark.parametrize("begin", [BEGIN, 0.0, -3.0])
def test_all_people_have_the_same_ticks(begin: float) -> None:
    rng = np.random.default_rng(1)
    people = [make_raw(irregular(rng, 5, begin), person=person) for person in (1, 2)]
    one, two = (to_clock(p)["t"] for p in people)
    shared = sorted({*one} & {*two})
    assert len(shared) >= len(one) - 3
    np.testing.assert_allclose(np.asarray(shared) * 10 % 1, 0, atol=1e-6)


# --- velocity ----------------------------------------------------------------------------------------


def test_velocity_is_displacement_over_half_a_second_each_way() -> None:
    t = np.arange(40) / 10
    x = t**3
    tracks = to_clock(make_raw(t, x))
    k = np.arange(40)
    before, after = np.maximum(k - 5, 0), np.minimum(k + 5, 39)
    np.testing.assert_allclose(
        tracks["vx"], (x[after] - x[before]) / (t[after] - t[before]), atol=1e-9
    )
    np.testing.assert_array_equal(tracks["vy"], 0)


def test_velocity_does_not_use_positions_across_a_gap() -> None:
    t = np.r_[np.arange(20), np.arange(40, 60)] / 10
    tracks = to_clock(make_raw(t, np.where(t < 3, t, 100 - t)), max_gap=0.5)
    np.testing.assert_allclose(tracks["vx"], np.where(tracks["t"] < 3, 1.0, -1.0))


def test_a_single_tick_has_no_velocity() -> None:
    raw = pd.concat(
        [make_raw([5.0], 7, 8, person=1), make_raw([5.0, 5.1], [1, 2], person=2)]
    )
    tracks = to_clock(raw)
    assert tracks.loc[tracks["id"] == 1, ["t", "x", "y"]].to_numpy().tolist() == [
        [5.0, 7.0, 8.0]
    ]
    assert tracks.loc[tracks["id"] == 1, ["vx", "vy"]].isna().to_numpy().all()
    np.testing.assert_allclose(tracks.loc[tracks["id"] == 2, "vx"], 10)


# --- gaps and funnel ---------------------------------------------------------------------------------


@pytest.mark.parametrize("begin", [0.0, BEGIN, BEGIN + 0.007, BEGIN + 0.013])
@pytest.mark.parametrize(("gap", "bridged"), [(0.5, True), (0.501, False)])
def test_a_gap_of_exactly_max_gap_is_interpolated(
    gap: float, bridged: bool, begin: float
) -> None:
    t = begin + np.array([0, 0.3, 0.6, 0.6 + gap, 0.9 + gap])
    tracks = to_clock(make_raw(t), max_gap=0.5)
    assert (np.diff(tracks["t"]) < 0.11).all() == bridged


def test_two_people_are_not_joined_where_one_begins_when_the_other_ends() -> None:
    raw = pd.concat(
        [make_raw([0, 0.1, 0.2], 0, person=1), make_raw([0.3, 0.4, 0.5], 9, person=2)]
    )
    tracks = to_clock(raw)
    assert sorted(tracks["x"].unique()) == [0, 9]
    assert len(tracks) == 6


def test_samples_without_a_tick_are_counted() -> None:
    alone = make_raw([7.03], person=3)
    pair = make_raw([8.01, 8.05], person=4)
    raw = pd.concat([make_raw(np.arange(10) / 10), alone, pair], ignore_index=True)
    stage = funnels.get(to_clock(raw))[-1]
    assert stage == {
        "stage": "clock: samples",
        "entered": 13,
        "kept": 10,
        "rejected": {"in a gap-free piece that covers no tick": 3},
        "recorded": pytest.approx({"squares": 105, "seconds": 0.94, "cubes": 0.009064}),
    }


def test_sums_of_several_days_add_up() -> None:
    """By them a verdict knows how often positions were recorded, of extracted days as well."""
    days = [funnels.get(to_clock(make_raw(np.arange(n) / 10))) for n in (10, 30)]
    (stage,) = funnels.add(days)
    assert stage["entered"] == stage["kept"] == 40
    expected = {"squares": 1000, "seconds": 3.8, "cubes": 0.038}
    assert stage["recorded"] == pytest.approx(expected)


@pytest.mark.parametrize("seed", range(3))
def test_row_order_and_ids_do_not_matter(seed: int) -> None:
    raw = walkers(seed)
    tracks = to_clock(raw)
    assert tracks.equals(tracks.sort_values(["day", "id", "t"], ignore_index=True))
    assert not tracks.duplicated(["day", "id", "t"]).any()
    before = raw.sample(frac=1, random_state=seed)
    shuffled = before.copy(deep=True)
    pd.testing.assert_frame_equal(to_clock(shuffled), tracks)
    pd.testing.assert_frame_equal(shuffled, before)
    renamed = to_clock(raw.assign(id=raw["id"].map(lambda i: 1000 - 7 * i)))
    back = renamed.assign(id=(1000 - renamed["id"]) // 7).sort_values(
        ["day", "id", "t"], ignore_index=True
    )
    pd.testing.assert_frame_equal(back, tracks)


def test_the_same_id_on_two_days_is_two_people() -> None:
    raw = pd.concat(
        [
            make_raw([0, 0.1], 0, day="2012-10-24"),
            make_raw([0.2, 0.3], 5, day="2012-10-28"),
        ]
    )
    tracks = to_clock(raw)
    assert tracks["x"].tolist() == [0, 0, 5, 5]
    assert not tracks[["vx", "vy"]].abs().gt(0).any(axis=None), "nobody moved"


# --- bad input ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("raw", "message"),
    [
        (
            make_raw([0, 0.1]).drop(columns="y"),
            r"columns \['y'\] are missing; found \['day', 'id', 't', 'x'\]",
        ),
        (make_raw([]), "the table is empty"),
        (make_raw([0, np.nan]), "row 1: got .*'t': nan"),
        (make_raw([0, 1e300]), "row 1: got .*1e.300"),
        (make_raw([0, 0.1], [0, np.inf]), "row 1: got .*'x': inf"),
        (make_raw([0, 0.1]).assign(day=[DAY, None]), "row 1: got .*expected a day"),
        (make_raw([0, 0.1]).assign(id=[np.nan, 1]), "row 0: got .*'id': nan"),
        (
            make_raw([0, 0.1, 0.1]),
            "row 2: got .*'id': 1.*'t': 0.1.*two rows at this time; keep one of them",
        ),
        (
            make_raw(np.arange(9) * 100.0),
            "100 s apart .*times without a type count as seconds",
        ),
        (make_raw([0, 1e9, 2e9]), "1e.09 s apart"),
    ],
)
def test_an_unusable_table_is_refused_with_the_reason(
    raw: pd.DataFrame, message: str
) -> None:
    with pytest.raises(szlib.DataError, match=message):
        to_clock(raw)


@pytest.mark.parametrize("max_gap", [0, 0.1, -1, np.nan])
def test_max_gap_below_one_tick_is_refused(max_gap: float) -> None:
    with pytest.raises(
        szlib.DataError, match=r"max_gap must be longer than the clock's 0.1 s"
    ):
        to_clock(make_raw([0, 0.1]), max_gap=max_gap)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            lambda d: d.assign(t=d["t"] + 0.03),
            "row 0: got {'t': 0.03}; t is not a multiple of 0.1 s; .*to_clock",
        ),
        (
            lambda d: pd.concat([d, d.tail(1)]),
            "got .*'id': 2.*'t': 4.0.*two rows at this time",
        ),
        (lambda d: d.assign(x=np.nan), "row 0: got .*finite x, y"),
        (lambda d: d.drop(columns="vx"), r"columns \['vx'\] are missing"),
    ],
)
def test_clock_index_refuses_an_invalid_table(change: object, message: str) -> None:
    tracks = make_tracks(make_walk((0, 0), (1, 0)), make_walk((0, 0), (1, 0), person=2))
    with pytest.raises(szlib.DataError, match=message):
        clock_index(change(tracks))


def test_clock_index_numbers_pieces_and_ticks() -> None:
    tracks = make_crowd(3)
    order, tick, piece = clock_index(tracks)
    sorted_rows = tracks.iloc[order]
    np.testing.assert_array_equal(tick, np.rint(sorted_rows["t"] * 10))
    expected, last = [], None
    for row in sorted_rows.itertuples():
        here = (row.day, row.id, round(row.t * 10))
        joined = last is not None and here == (*last[:2], last[2] + 1)
        expected.append(
            (expected[-1] if expected else 0) + (not joined and bool(expected))
        )
        last = here
    np.testing.assert_array_equal(piece, expected)


# --- the real day ------------------------------------------------------------------------------------


def test_the_real_day_is_brought_to_the_clock(real_tracks: pd.DataFrame) -> None:
    *_, merged, clock = funnels.get(real_tracks)
    assert merged["kept"] == clock["entered"] == 624_951
    assert clock["kept"] + sum(clock["rejected"].values()) == clock["entered"]
    assert set(real_tracks["day"]) == {"2012-10-24"}
    order, _, piece = clock_index(real_tracks)
    assert (np.diff(order) == 1).all()
    first = np.flatnonzero(np.diff(piece, prepend=-1))
    last = np.append(first[1:], len(piece)) - 1
    t = real_tracks["t"].to_numpy()
    np.testing.assert_array_equal(np.rint((t[last] - t[first]) * 10), last - first)
    speed = np.hypot(real_tracks["vx"], real_tracks["vy"])
    assert 0.5 < speed.median() < 1.5
