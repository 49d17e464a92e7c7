"""Verdicts on claims by condition: planted data whose answer is known."""

import numpy as np
import pandas as pd
import pytest
from scipy.stats import binomtest

import szlib
from szlib.workbook.claims import (
    VERDICTS,
    find_interval,
    judge_claims,
    judge_share,
)

SOURCES, CONDITIONS = ("mall", "station", "plazas"), [f"gamma {k}" for k in range(6)]


def plant(probability, draws=40, seed=0):
    """A claim that holds in each cell with a probability, by source, condition and control."""
    rng = np.random.default_rng(seed)
    rows = [
        {
            "claim": "It waits.",
            "scenario": "waiting",
            "source": source,
            "condition": condition,
            "draws": draws,
            "held": rng.binomial(draws, probability(source, condition)),
            "is_control": condition == "control",
        }
        for source in SOURCES
        for condition in [*CONDITIONS, "control"]
    ]
    return judge_claims(pd.DataFrame(rows)).iloc[0]


def test_a_claim_that_is_true_by_construction_is_supported():
    found = plant(lambda source, condition: 1.0)
    assert found["verdict"] == "supported" and found["share"] == 1
    assert found["decides"] == "" and found["zones"] == 120
    assert found["conditions"] == len(SOURCES) * len(CONDITIONS)


def test_a_claim_that_is_false_by_construction_is_not_supported():
    assert plant(lambda source, condition: 0.0)["verdict"] == "not supported"
    assert plant(lambda source, condition: 0.2)["verdict"] == "mostly not supported"


@pytest.mark.parametrize(
    ("draws", "verdict"), [(5, "not decidable"), (40, "depends on the condition")]
)
def test_chance_is_undecided_and_called_so_by_the_number_of_zones(draws, verdict):
    assert plant(lambda source, condition: 0.5, draws)["verdict"] == verdict


def test_the_condition_that_decides_is_named_with_its_shares():
    found = plant(lambda source, condition: float(condition != "gamma 5"))
    assert found["decides"] == "condition: 0 % with gamma 5, 100 % with gamma 0", (
        "one condition of six"
    )
    found = plant(lambda source, condition: float(source == "mall"))
    assert found["decides"].startswith("source: 0 % with station, 100 % with mall")


def test_controls_do_not_count():
    found = plant(lambda source, condition: float(condition != "control"))
    assert found["share"] == 1 and found["control"] == 0


def test_the_interval_is_that_of_clopper_and_pearson():
    for count, n in ((0, 7), (3, 7), (7, 7), (39, 160)):
        exact = binomtest(count, n).proportion_ci(method="exact")
        assert find_interval(count, n) == pytest.approx((exact.low, exact.high))
    assert find_interval(3, 7) < find_interval(3.5, 7) < find_interval(4, 7)
    with pytest.raises(szlib.DataError, match="count"):
        find_interval(8, 7)


def test_the_interval_holds_the_share_of_correlated_conditions():
    """A zone holds in all conditions or in none: the conditions are one trial, not six."""
    rng, held, share = np.random.default_rng(1), 0, 0.7
    for _ in range(400):
        zones = rng.binomial(40, share)
        rows = [
            {
                "claim": "c", "scenario": "s", "source": "mall", "condition": condition,
                "draws": 40, "held": zones, "is_control": False,
            }
            for condition in CONDITIONS
        ]  # fmt: skip
        found = judge_claims(pd.DataFrame(rows)).iloc[0]
        held += found["low"] <= share <= found["high"]
    assert held >= 0.95 * 400


def test_the_verdict_grows_with_the_share():
    found = [
        VERDICTS.index(judge_share(*find_interval(k, 160), 160)) for k in range(161)
    ]
    assert found == sorted(found) and {*found} == {0, 1, 2, 4, 5}


def test_a_missing_column_is_named():
    with pytest.raises(szlib.DataError, match="is_control"):
        judge_claims(pd.DataFrame({"claim": []}))
