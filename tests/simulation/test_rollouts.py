"""Rollouts: rows do not depend on the order, violations are reported, outcomes are classified."""

import importlib

import numpy as np
import pandas as pd
import pytest

import szlib
from szlib.simulation.closed_loop import LoopSettings, drive
from szlib.simulation.monte_carlo import RolloutSetup, rollouts
from szlib.simulation.scenario import ONE_PERSON, Worlds

ZONE = szlib.Ellipse((0.0, 0.0), (0.8, 0.8))
# the name of its function, too
MODULE = importlib.import_module("szlib.simulation.monte_carlo")
SETTINGS = szlib.MPCSettings()
TIMES = ["solve_time_median", "solve_time_p95", "solve_time_p99", "solve_time_max"]
SHORT = Worlds(duration=2.0)


def scenario(goal=(4.0, 0.0), people=(), walls=(), duration=15.0, velocity=(0.0, 0.0)):
    start = np.array([-2.0, 0.0, *velocity])
    walls = np.reshape(np.array(walls, float), (-1, 2, 2))
    return szlib.Scenario(
        "", start, np.array(goal), people=people, walls=walls, duration=duration
    )


def person(position, velocity=(0.0, 0.0), heading=0.0):
    return szlib.Person(position, velocity, heading, ZONE)


def whole(world):
    """A drive to the end of time with the controller's default zone."""
    return drive(
        world,
        szlib.MPCCBF(ZONE, walls=world.walls, settings=SETTINGS),
        LoopSettings(until_arrival=False),
    )


def test_driving_after_the_arrival_does_not_change_earlier_rows():
    world = scenario(people=(person((1.0, 0.3)),), walls=[[(-3, 2.5), (5, 2.5)]])
    log, longer = (
        szlib.simulate(world, szlib.MPCCBF(ZONE, walls=world.walls)),
        whole(world),
    )
    n = len(log.states)
    assert len(longer.states) == 151 > n
    assert np.array_equal(longer.states[:n], log.states)
    ours, theirs = longer.metrics(), log.metrics()
    same = [
        "success",
        "time_to_goal",
        "path_length",
        "time_stopped",
        "time_yielding",
        "passing_side",
        "jerk",
    ]
    assert {k: ours[k] for k in same} == {k: theirs[k] for k in same}
    assert set(ours) == set(theirs)


def test_parallel_and_interrupted_calls_give_the_same_rows(tmp_path, monkeypatch):
    monkeypatch.setattr(MODULE, "CHUNK_SIZE", 2)
    alone = rollouts(5, RolloutSetup(worlds=SHORT), n_jobs=1, progress=False)
    kept = rollouts(
        3, RolloutSetup(worlds=SHORT), n_jobs=1, progress=False, out=tmp_path
    )
    more = rollouts(
        5, RolloutSetup(worlds=SHORT), n_jobs=1, progress=False, out=tmp_path
    )
    pd.testing.assert_frame_equal(alone.drop(columns=TIMES), more.drop(columns=TIMES))
    # solve times too: the finished chunk was read
    pd.testing.assert_frame_equal(kept[:2], more[:2])
    assert {path.name for path in tmp_path.rglob(".szlib-*")} <= {".szlib-lock"}
    other = rollouts(
        2,
        RolloutSetup(worlds=SHORT),
        settings=szlib.MPCSettings(gamma=0.1),
        n_jobs=1,
        progress=False,
        out=tmp_path,
    )
    assert len(other) == 2
    assert sum(path.is_dir() for path in tmp_path.iterdir()) == 2


def test_rerun_world_gives_exactly_the_row_of_rollouts():
    # of one size: they share one
    alike = Worlds(people=(3, 3), walls=1.0, max_walls=1, duration=3.0)
    rows = rollouts(3, RolloutSetup(worlds=alike), seed=7, n_jobs=1, progress=False)
    again = pd.DataFrame(
        [RolloutSetup(worlds=alike).run(seed).metrics() for seed in rows["seed"]]
    )
    pd.testing.assert_frame_equal(
        rows.drop(columns=[*TIMES, "seed"]), again.drop(columns=TIMES), check_exact=True
    )


def test_columns_are_numbers_and_each_violation_is_flagged():
    table = rollouts(
        12,
        RolloutSetup(worlds=Worlds(people=(3, 5), walls=1.0)),
        n_jobs=1,
        progress=False,
    )
    assert table["seed"].tolist() == list(range(12))
    # walls and people in every world
    assert not table.drop(columns="time_to_goal").isna().any().any()
    assert table["time_to_goal"].isna().equals(~table["success"])
    assert (table["unflagged_violations"] == 0).all()
    assert (table.filter(like="steps_").sum(axis=1) == 150).all()
    assert (table["min_h"] == table[["min_h_people", "min_h_walls"]].min(axis=1)).all()


ROOM = [[(-9, y), (9, y)] for y in (-9, 9)] + [[(x, -9), (x, 9)] for x in (-9, 9)]
DEAD_END = [[(-2.6, -4), (-2.6, 4)], [(-4, 0.6), (4, 0.6)], [(-4, -0.6), (4, -0.6)]]
ENDINGS = {
    "arrived": scenario(),
    "out of time": scenario(goal=(20.0, 0.0)),
    "deadlock": scenario(walls=[[(0, -8), (0, 8)]]),
    "boxed in": scenario(walls=[*ROOM, [(0, -9), (0, 9)]]),
    "drove in": scenario(
        people=(person((-0.3, 0.0)),), velocity=(1.0, 0.0), goal=(8.0, 0.0)
    ),
    "hit wall": scenario(
        walls=[[(-1.4, -3), (-1.4, 3)]], velocity=(1.0, 0.0), goal=(8.0, 0.0)
    ),
    "run into": scenario(people=(person((1.0, 0.0), (-4.0, 0.0), np.pi),)),
    "squeezed": scenario(
        people=(person((1.0, 0.0), (-2.0, 0.0), np.pi),), walls=DEAD_END
    ),
}


@pytest.mark.parametrize("ending", ENDINGS)
def test_each_outcome_is_classified(ending):
    assert whole(ENDINGS[ending]).metrics()["outcome"] == ending


PILLARS = Worlds(
    walls=1.0, max_walls=4, wall_length=(0.1, 1.0), size=6.0, travel=(2.0, 5.0)
)


def test_the_required_margin_and_the_guard_each_avoid_short_walls():
    """The paper has neither, and its robot overlaps the ends of short walls."""
    careful, guarded, paper = (
        rollouts(
            4,
            RolloutSetup(worlds=PILLARS),
            seed=4,
            settings=szlib.MPCSettings(gamma=0.5, N_h=8, margin=margin, guard=guard),
            n_jobs=1,
            progress=False,
        )
        for margin, guard in (("required", False), ("paper", True), ("paper", False))
    )
    assert careful["min_clearance_walls"].min() >= -1e-6
    assert guarded["min_clearance_walls"].min() >= -1e-6
    is_allowed = paper["min_h_walls"] >= 0
    assert paper["min_clearance_walls"][is_allowed].min() < -0.05
    for rows in (careful, guarded, paper):
        assert (
            rows["unflagged_overlaps"].sum() == rows["unflagged_violations"].sum() == 0
        )
        gaps = rows[["min_clearance_people", "min_clearance_walls"]].min(axis=1)
        assert (rows["min_clearance"] == gaps).all()


def test_the_whole_barrier_horizon_is_safe_around_one_person():
    table = rollouts(
        10,
        RolloutSetup(worlds=ONE_PERSON),
        settings=szlib.MPCSettings(N_h=8),
        n_jobs=1,
        progress=False,
    )
    assert table["min_h"].min() >= -1e-6


def test_a_number_of_worlds_below_one_is_rejected():
    with pytest.raises(szlib.SolverError, match="n must be at least 1"):
        rollouts(0)


def test_a_failing_world_is_named_by_its_seed():
    with pytest.raises(
        szlib.SolverError,
        match="the controller failed in world 5: a zone must contain its person",
    ):
        RolloutSetup(worlds=Worlds(standing=1.0), zone_transform=huge).run(5)


def huge(zone):
    return szlib.Ellipse(zone.center, (1e9, 1e9))
