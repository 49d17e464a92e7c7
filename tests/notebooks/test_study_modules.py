"""What the tables of studies rest on: counts, means, and truths of each module that no other test imports."""

import numpy as np
import pandas as pd
import pytest
from studies import (
    comparison,
    crossings,
    differential_table,
    feasibility,
    gamma_table,
    hours,
    many_days,
    plazas,
    reference_zones,
    rollout_table,
    walkers,
)

import szlib
from szlib.simulation.scenario import Worlds
from szlib.zones.reference_zones import FILE

ROWS = pd.DataFrame(
    {
        "seed": range(10), "success": [True] * 8 + [False] * 2, "infeasible_steps": [0] * 9 + [3],
        "min_h": [0.1] * 9 + [-0.2], "time_to_goal": [10.0] * 5 + [12.0] * 3 + [np.nan] * 2,
        "flagged_steps": [0] * 9 + [4], "unflagged_violations": 0, "unflagged_overlaps": 0,
        "min_clearance_walls": np.inf, "min_clearance_people": 0.3, "min_clearance": 0.3,
        "outcome": ["success"] * 8 + ["timeout"] * 2, "solve_time_max": 0.01,
    }
)  # fmt: skip
"""Ten worlds: eight arrive, one has h < 0 and infeasible steps."""


def test_rollouts_count_worlds_and_what_happens_in_them():
    line = rollout_table.row([ROWS.iloc[:5], ROWS.iloc[5:]])
    assert line["worlds"] == 10 and line["worlds of blocks"] == "5 5"
    assert line["worlds h < 0"] == 1 and line["blocks h < 0"] == "0 1"
    assert line["low h < 0"] < line["share h < 0"] == 0.1 < line["high h < 0"]
    assert line["share overlap person"] == 0


def test_gamma_is_summarised_by_arrivals_infeasible_steps_and_time():
    line = gamma_table.summarise(0.05, ROWS)
    assert (line["arrived"], line["infeasible steps"]) == (0.8, 3)
    assert line["worlds with h < 0"] == 1 and line["median time to goal [s]"] == 10


def test_the_cells_of_feasibility_drive_in_the_same_worlds():
    cell = (0.1, 4, 1.0)
    few, more = (
        feasibility.drive_cells([cell], n, progress=False)
        for n in (1, feasibility.FIRST)
    )
    assert few["probe"].item() < more["probe"].item(), "more worlds, a longer path"
    rows = szlib.rollouts(
        1,
        szlib.simulation.monte_carlo.RolloutSetup(worlds=feasibility.CROWD),
        settings=szlib.MPCSettings(gamma=0.1, N_h=4, time_limit=np.inf),
        progress=False,
    )
    assert few["probe"].item() == rows["path_length"].item()


@pytest.mark.parametrize("robot", differential_table.ROBOTS)
def test_the_disc_is_followed_to_where_the_robot_is(robot):
    scenario = Worlds()(3)
    controller = differential_table.ROBOTS[robot](scenario, szlib.MPCSettings())
    log = szlib.simulate(scenario, controller, max_time=3.0)
    centres = differential_table.along(log)
    assert centres.shape[1] == differential_table.SUBSTEPS
    assert centres[:, -1] == pytest.approx(log.states[1:, :2], abs=1e-9)
    steps = np.diff(np.r_[log.states[:1, :2], centres.reshape(-1, 2)], axis=0)
    assert np.hypot(*steps.T).max() <= 1.01 * 0.1 / differential_table.SUBSTEPS


def test_the_nearest_distance_of_two_paths_is_that_of_brute_force():
    offsets = np.random.default_rng(0).normal(0, 2, (6, 3, 2))
    share = np.linspace(0, 1, 2001)[:, None, None]
    brute = min(
        np.hypot(*np.moveaxis(a + share * (b - a), 2, 0)).min()
        for a, b in zip(offsets, offsets[1:], strict=False)
    )
    assert crossings.nearest(offsets) == pytest.approx(brute, abs=1e-3)
    at = crossings.place_people(4)
    gaps = np.linalg.norm(at[:, None] - at, axis=2)[~np.eye(len(at), dtype=bool)]
    assert gaps.min() >= 2 * crossings.RADIUS, "nobody starts in somebody else"


def test_the_visits_of_all_hours_are_the_people_of_the_plaza():
    found = hours.of_plaza()
    assert found["visits"].sum() == 2 * hours.SMALL.n_encounters
    assert (found["standing"] >= 0).all()


def test_a_fit_of_many_days_has_as_many_samples_as_asked():
    n = 400
    rng = np.random.default_rng(0)
    one_day = pd.DataFrame(
        {
            "encounter": np.arange(n) // 10, "ref_id": np.arange(n) // 10,
            "other_id": 1000 + np.arange(n) // 10,
            "los_angle": rng.uniform(-np.pi, np.pi, n), "distance": rng.uniform(0.8, 2.0, n),
            "speed": rng.uniform(0.5, 1.5, n),
        }
    )  # fmt: skip
    with pytest.warns(szlib.DataWarning):
        found = many_days.fit("quantile, 1000 samples", one_day)
    assert (found["samples"], found["days"]) == (1000, 3)


def test_a_case_is_the_plaza_that_its_row_names():
    for case in plazas.CASES:
        settings = plazas.build(case)
        assert (settings.n_encounters, settings.intruders, settings.clearance) == case[
            :3
        ]
        assert settings.true_zone(plazas.SPEED).center[0] == pytest.approx(case[3])


@pytest.mark.slow
def test_an_interval_of_a_plaza_holds_the_truth_or_not():
    samples, null = plazas.find_both(plazas.SMALL, plazas.FIRST_SEED)
    truth = plazas.build(plazas.SMALL).true_zone(plazas.SPEED)
    for row in plazas.compare(samples, null, truth):
        assert (abs(row["error"]) > row["width"]) <= (row["held"] == 0.0)


def test_shipped_zones_are_rounded_and_pooled_as_the_study_does():
    ellipse = szlib.Ellipse((0.12345, 0.0), (1.00049, 0.7), 0.1)
    assert reference_zones.round_ellipse(ellipse)["semi_axes"] == [1.0, 0.7]
    strangers, everybody = (
        szlib.reference_zone(name) for name in ("atc-paper-strangers", "atc-paper")
    )
    assert strangers.ellipse.area > everybody.ellipse.area, "companions come nearer"
    assert (everybody.n_encounters, strangers.n_encounters) == (252, 151)
    assert FILE.exists() and everybody.method == "paper"


def test_each_change_of_the_controller_halves_or_doubles_one_number():
    ours = walkers.OURS
    for name, settings in walkers.changed().items():
        differing = [
            each
            for each in ours.__dataclass_fields__
            if getattr(settings, each) != getattr(ours, each)
        ]
        assert len(differing) == (name != "as it is")
        for each in differing:
            assert getattr(settings, each) / getattr(ours, each) in (0.5, 2.0)


def test_a_comparison_has_the_mean_and_the_world_that_is_driven_again():
    metric, seeds = "time_to_goal", range(6)
    rows = pd.DataFrame(
        {
            "controller": "MPC-CBF",
            "zone": "fitted",
            "formulation": "ours",
            "behaviour": "as expected",
            "seed": seeds,
        }
    ).assign(**dict.fromkeys(comparison.summaries.METRICS, 1.0))
    rows[metric] = np.arange(6.0)
    line = comparison.summarise(rows).set_index("metric").loc[metric]
    assert (line["mean"], line["probe"]) == (2.5, comparison.PROBE)
