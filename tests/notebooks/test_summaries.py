"""What notebooks 25 and 26 show first: the rows that decide, the worst outcome, and folded tables."""

import numpy as np
import pandas as pd
import pytest
from studies import claims as claims_study
from studies.folds import fold_table
from studies.meetings import OUTCOMES, find_outcomes

from szlib.workbook.record import read_table


def test_answers_hold_each_claim_once_for_each_data_set():
    answers = claims_study.select_answers(read_table("25_claims"))
    assert not answers.duplicated(["claim", "data"]).any()
    assert "mean of sites" not in set(answers["data"])
    assert {*claims_study.CLAIMS} <= {*answers["claim"]}
    assert {verdict.partition(" with")[0] for verdict in answers["verdict"]} <= {
        *claims_study.VERDICTS
    }


NOTHING = {
    "success": 1.0,
    "time_to_goal": 12.0,
    "violations": 0,
    "robot_on_person": 0,
    "person_on_robot": 0,
}


@pytest.mark.parametrize(
    ("found", "outcome"),
    [
        ({}, "arrives, enters no zone"),
        ({"violations": 3.0}, "enters a zone (h < 0)"),
        (
            {"violations": 3.0, "success": 0.0, "time_to_goal": np.nan},
            "does not always arrive",
        ),
        (
            {"violations": 3.0, "success": 0.5, "person_on_robot": 0.1},
            "body touches body",
        ),
        ({"robot_on_person": 0.1}, "body touches body"),
    ],
)
def test_the_worst_outcome_is_shown(found, outcome):
    means = NOTHING | found
    rows = [
        {"meeting": "door", "controller": "c", "metric": name, "mean": value}
        for name, value in means.items()
    ]
    (row,) = find_outcomes(pd.DataFrame(rows)).to_dict("records")
    assert row["outcome"] == outcome and outcome in OUTCOMES
    assert row["time_to_goal"] == pytest.approx(means["time_to_goal"], nan_ok=True)


def test_a_folded_table_is_closed_and_its_summary_is_text():
    shown = fold_table("a < b", pd.DataFrame({"x [m]": [1 / 3, np.nan]}), 1).data
    assert shown.startswith("<details><summary>a &lt; b</summary>") and shown.endswith(
        "</details>"
    )
    assert "0.3<" in shown and "nan" not in shown.lower()
