"""The atlas: what a robot did gets one name, and a cell changes what it says and nothing else."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.made_runs import make_log
from studies.atlas import CANNOT_START, REFERENCE, SCENES, AtlasCell, run_atlas

import szlib
from szlib.simulation.metrics import (
    MIN_RETREAT,
    STRATEGIES,
    classify_strategy,
    compute_retreat,
)


def made(x, y=-1.6, *, held=False, **given):
    """A run along x, beside a person who stands at the origin, made by hand."""
    n, dt = len(x), szlib.MPCSettings().dt
    start, goal = np.array([x[0], y, 0.0, 0.0]), np.array([4.0, y])
    scene = replace(szlib.SCENARIOS["passing"], start=start, goal=goal)
    states = np.column_stack([x, np.full(n, y), np.gradient(x, dt), np.zeros(n)])
    people = np.tile([0.0, 0.0, np.pi, 0.0, 0.0], (n, 1, 1))
    options = {"zone": REFERENCE, "residual": 0.0 if held else 1.0, "arrival": n - 1}
    return make_log(scene, states, people, **options | given)


AHEAD = np.linspace(-4, 4, 81)
STANDS = np.concatenate(
    [np.linspace(-4, -1, 31), np.full(20, -1.0), np.linspace(-1, 4, 51)]
)
BACK = np.concatenate(
    [np.linspace(-4, -1, 31), np.linspace(-1, -1.9, 10), np.linspace(-1.9, 4, 60)]
)
RUNS = {
    "goes ahead": made(AHEAD),
    "waits": made(STANDS, held=True),
    "backs out": made(BACK, held=True),
    "passes on the other side": made(AHEAD, y=1.6),
    "deadlock": made(STANDS, arrival=None),
    "infeasible": made(AHEAD, slack=np.where(np.arange(81) == 5, 0.1, 0.0)),
    "h < 0": made(AHEAD, y=-0.5, arrival=None),
}


@pytest.mark.parametrize("name", RUNS)
def test_each_run_has_its_strategy(name):
    assert classify_strategy(RUNS[name]) == name


def test_every_strategy_has_a_run():
    assert set(RUNS) == set(STRATEGIES)


def test_the_worst_strategy_is_reported():
    both = replace(RUNS["infeasible"], arrival=None)
    assert classify_strategy(both) == "infeasible"
    assert classify_strategy(replace(RUNS["backs out"], arrival=None)) == "deadlock"


def test_standing_without_an_active_barrier_is_not_waiting():
    assert classify_strategy(made(STANDS, held=False)) == "goes ahead"


def test_retreat_is_measured_from_the_farthest_point_by_then():
    assert compute_retreat(RUNS["backs out"]) == pytest.approx(0.9)
    assert compute_retreat(RUNS["goes ahead"]) == 0.0 < MIN_RETREAT


# --- cells -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("scene", SCENES)
def test_a_cell_of_the_paper_is_the_scenario_of_the_paper(scene):
    same, own = AtlasCell(scene, width=SCENES[scene]).scenario(), szlib.SCENARIOS[scene]
    assert np.array_equal(same.walls, own.walls)
    assert same.people == own.people


def test_width_moves_the_walls_of_a_pathway_without_gaps():
    walls = AtlasCell("waiting", width=3.0).scenario().walls
    assert np.array_equal(np.unique(np.abs(walls[:2, :, 1])), [1.5])
    assert np.array_equal(np.sort(np.abs(walls[2:, :, 1]), axis=1), [[1.5, 4.0]] * 2)


def test_the_atlas_has_one_row_per_cell_in_order():
    cells = [
        AtlasCell("corridor", width=6.4, size=0.5),
        AtlasCell("corridor", width=1.0),
        AtlasCell("corridor", size=1.25),
    ]
    table = run_atlas(cells, REFERENCE)
    assert table["width"].tolist() == [6.4, 1.0, 4.6]
    assert table["strategy"].iloc[:2].tolist() == ["goes ahead", CANNOT_START]
    # the corridor of the paper with a larger zone
    assert table["strategy"].iloc[2] != "goes ahead"
    assert table["min_h"].iloc[[0, 2]].min() >= 0


@pytest.mark.parametrize(
    "wrong", [{"scene": "hall"}, {"scene": "corridor", "width": 0}]
)
def test_invalid_cells_are_rejected(wrong):
    with pytest.raises(szlib.SolverError, match="must be"):
        AtlasCell(**wrong)  # type: ignore[arg-type]


def test_the_controller_decides_again_at_each_time_of_a_run():
    log = AtlasCell("corridor", size=0.5).run(REFERENCE)
    controller = szlib.MPCCBF(log.zones[0], walls=log.scenario.walls)
    for time in (0.0, 3.0):
        controller.reset()
        control = controller.step(*log.controller_inputs(time)).control
        assert control == pytest.approx(log.controls[round(10 * time)], abs=1e-3)
    with pytest.raises(
        szlib.DataError, match="time must be a time of the run, from 0 to"
    ):
        log.controller_inputs(1e3)
