"""The matrix of claims by condition: zones of people drawn anew, and what robots do with them."""

import numpy as np
import pandas as pd
import pytest
from studies import paper_matrix
from studies.atlas import REFERENCE
from studies.plaza_truth import true_kinds

import szlib
from szlib.plaza import precision_and_recall
from szlib.workbook.claims import judge_claims
from szlib.workbook.record import read_table
from szlib.zones import outliers
from szlib.zones.outliers import pair_numbers

ZONES, MATRIX = read_table("28_zones"), read_table("28_matrix")


@pytest.fixture(scope="module")
def samples():
    """Samples of forty pairs; of each the other one is seen at the same distance."""
    rng, rows = np.random.default_rng(0), 40 * 31
    pair = np.arange(rows) // 31
    return pd.DataFrame(
        {
            "day": "d", "encounter": pair, "ref_id": 2 * pair, "other_id": 2 * pair + 1,
            "los_angle": rng.uniform(-np.pi, np.pi, rows), "distance": rng.uniform(0.7, 2.0, rows),
            "speed": rng.uniform(0.5, 1.6, rows), "t": 0.1 * np.arange(rows),
        }
    )  # fmt: skip


def test_pairs_are_drawn_whole_and_a_pair_drawn_twice_is_two_encounters(samples):
    drawn = paper_matrix.draw_people(samples, 1)
    sizes = drawn.groupby("encounter").size()
    assert (sizes == 31).all() and len(sizes) == 40
    assert 20 <= drawn["ref_id"].nunique() < 40, "63 % of the pairs, on average"
    assert len(np.unique(pair_numbers(drawn))) == drawn["ref_id"].nunique()
    assert drawn.equals(paper_matrix.draw_people(samples, 1))
    assert not drawn.equals(paper_matrix.draw_people(samples, 2))


def test_the_chain_of_the_paper_is_that_of_the_library(samples):
    found = paper_matrix.fit_chain(samples, "the paper's")
    zone = szlib.SocialZone.fit(samples, method="paper", speeds=(1.1,), n_resamples=0)
    assert found["a"] == pytest.approx(zone.ellipse(1.1).semi_axes[0], rel=2e-3)
    few = samples[samples["los_angle"].abs() < 1.0]  # nobody behind
    assert np.isnan(paper_matrix.fit_chain(few, "the paper's")["a"]), (
        "no zone, no error"
    )


def test_each_condition_changes_one_thing():
    base = paper_matrix.PAPER
    for name, settings in paper_matrix.ROBOTS.items():
        differing = {
            each
            for each in base.__dataclass_fields__
            if getattr(settings, each) != getattr(base, each)
        }
        if name == "ours":
            continue
        assert len(differing) <= 1 or "code" in name, name
    assert len(paper_matrix.ROBOTS) >= 5 <= len(paper_matrix.CHAINS)


def test_a_robot_without_the_barrier_drives_through_the_person():
    scenario = szlib.SCENARIOS["passing"]
    settings = paper_matrix.PAPER
    run = paper_matrix.drive(scenario, REFERENCE, settings, paper_matrix.NO_BARRIER)
    assert run.success and run.metrics()["min_h"] < -0.5
    answers = paper_matrix.judge_run(run, REFERENCE, settings, paper_matrix.NO_BARRIER)
    assert not answers["The robot navigates around the person."]
    run = paper_matrix.drive(scenario, REFERENCE, settings)
    assert paper_matrix.judge_run(run, REFERENCE, settings)[
        "The robot navigates around the person."
    ]


def test_a_zone_that_fills_the_corridor_is_not_counted_there():
    wide = szlib.Ellipse((0.0, 0.0), (1.4, 1.2))
    assert not paper_matrix.has_room(szlib.SCENARIOS["corridor"], wide)
    assert paper_matrix.has_room(szlib.SCENARIOS["waiting"], wide)
    assert list(paper_matrix.judge_zone(wide, ["corridor"], ["ours"])) == []


def test_cells_are_counted():
    rows = pd.DataFrame(
        {
            "claim": "c", "scenario": "s", "source": "a", "draw": [1, 2, 3, 1],
            "condition": ["x", "x", "x", "gamma = 1"], "holds": [False, True, True, True],
        }
    )  # fmt: skip
    found = paper_matrix.count(rows).set_index("condition")
    assert found.loc["x", ["draws", "held", "probe", "draw"]].tolist() == [3, 2, 0, 1]
    assert found["is_control"].to_dict() == {"x": False, "gamma = 1": True}


def test_the_table_has_forty_zones_a_source_and_five_conditions_a_claim():
    zones = ZONES.query('chain == "the paper\'s"').groupby("source")["draw"].nunique()
    assert zones.to_dict() == dict.fromkeys(paper_matrix.SOURCES, paper_matrix.DRAWS)
    counted = MATRIX[~MATRIX["is_control"]]
    assert counted.groupby("claim")["condition"].nunique().min() >= 5
    verdicts = judge_claims(MATRIX)
    assert (verdicts["zones"] >= 40).all() and len(verdicts) >= 15


def test_the_papers_robot_stays_safe_and_the_gamma_of_its_code_does_not():
    """What the table says where the paper gives no number."""
    cells = MATRIX[MATRIX["claim"] == "The robot remains within the safety set."]
    sums = cells.groupby("condition")[["held", "draws"]].sum()
    share = sums["held"] / sums["draws"]
    assert share["the paper's"] == share["weights of its code"] == 1.0
    assert share["weights and gamma of its code"] == 0.0


@pytest.mark.slow
def test_outliers_of_a_plaza_are_judged_by_its_truth():
    samples = paper_matrix.read_source(paper_matrix.PLAZAS, 3)
    close = samples[samples["distance"] <= 2.0]
    removed = outliers.is_outlier(close, fraction=0.002, n_neighbours=20)
    truth = true_kinds(close, seed=3) == "intruder"
    found = paper_matrix.judge_outliers(samples, "the paper's", 3)
    precision = precision_and_recall(removed, truth)[0]
    assert found["intruders_removed"] == pytest.approx(precision, abs=5e-4)
    near = (close["distance"] < 1.0).to_numpy()
    assert found["edge_removed"] == (removed & near & ~truth).sum()
    assert 0 < found["edge_removed_plain"] <= removed.sum()
    assert paper_matrix.judge_outliers(samples, "no outliers removed", 3) == {}
