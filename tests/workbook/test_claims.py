"""Verdicts on claims by condition, and on sentences: planted data whose answer is known, names that exist."""

import importlib
import json
import os
import re
from functools import cache
from pathlib import Path

import jupytext
import nbformat
import numpy as np
import pandas as pd
import pytest
from scipy.stats import binomtest

import szlib
from szlib.workbook import claims, folders
from szlib.workbook.claims import (
    NOT_RUN,
    VERDICTS,
    find_interval,
    judge_claims,
    judge_share,
)
from szlib.workbook.record import NotebookRecord

ROOT = Path(__file__).parents[2]
SENTENCES = claims.load_sentences().to_dict("records")
NAMES = {name for row in SENTENCES for name in row["held_by"]}
CHECKS = {name for name in NAMES if not name.startswith("tests/")}
FIELDS = {"place", "sentence", "kind", "how", "code", "notebook", "cell", "held_by"}
KINDS = {"implemented", "altered", "claim", "stress", "untestable", "open"}
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


def find_notebook(number):
    (script,) = (s for s in folders.list_notebooks() if s.stem.split("_")[0] == number)
    return script


@cache
def read_copy(script):
    """Whether the executed copy has the cells of the script, and what it printed."""
    copy = nbformat.read(script.with_suffix(".ipynb"), as_version=4)
    same = [c.source for c in copy.cells] == [
        c.source for c in jupytext.read(script).cells
    ]
    outputs = [out for cell in copy.cells for out in cell.get("outputs", ())]
    return same, "\n".join(out.text for out in outputs if out.output_type == "stream")


# --- what a row names exists --------------------------------------------------------------------------


def test_rows_are_complete_and_hold_no_verdict():
    assert len(SENTENCES) > 100
    for row in SENTENCES:
        assert set(row) == FIELDS, row
        assert row["kind"] in KINDS, row
        assert 0 < len(row["sentence"].split()) <= 25, row
        assert row["held_by"] or row["kind"] == "untestable", row
        assert row["how"] or row["kind"] in {"implemented", "claim", "stress"}, row


def plain(text):
    """Words of LaTeX or of a quotation, without commands, citations and punctuation."""
    text = re.sub(r"\\cite[pt]?\{[^}]*\}|~?\\ref\{[^}]*\}", "", text)
    text = re.sub(r"\\(jwc|textbf|textcolor\{black\}|mbox)\{", " ", text)
    text = re.sub(r"[$\\{}~,;:.\u2019'%]", " ", text.replace("---", " - "))
    return " ".join(text.lower().split())


@pytest.mark.skipif(
    "SZLIB_PAPER" not in os.environ,
    reason="the paper is not shipped: name its LaTeX file in $SZLIB_PAPER",
)
def test_sentences_are_quotations_of_the_paper():
    paper = plain(Path(os.environ["SZLIB_PAPER"]).read_text(encoding="utf-8"))
    missing = [
        row["sentence"]
        for row in SENTENCES
        if "eq." not in row["place"] and row["kind"] != "stress"
        for part in row["sentence"].split("...")
        if plain(part) not in paper
    ]
    assert missing == []


def test_code_of_every_sentence_can_be_imported():
    for code in {row["code"] for row in SENTENCES}:
        module, _, name = code.partition(":")
        found = importlib.import_module(module)
        for part in name.split("."):
            found = getattr(found, part)


def test_cell_of_every_sentence_is_in_its_notebook():
    missing = []
    for row in SENTENCES:
        (found,) = (s for s in folders.list_notebooks() if s.stem == row["notebook"])
        script = found.read_text(encoding="utf-8")
        if row["cell"] not in {line.removeprefix("# ") for line in script.splitlines()}:
            missing.append((row["notebook"], row["cell"]))
    assert missing == []


def test_verdict_of_every_claim_comes_from_the_run():
    typed = [
        row["sentence"]
        for row in SENTENCES
        if row["kind"] == "claim" and not {*row["held_by"]} & CHECKS
    ]
    assert typed == []


def test_every_named_test_exists():
    missing = []
    for name in NAMES - CHECKS:
        file, _, function = name.partition("::")
        if f"def {function}(" not in (ROOT / file).read_text(encoding="utf-8"):
            missing.append(name)
    assert missing == []


def test_every_named_check_is_made():
    """In the executed copies; one that is older than its script is left to another test."""
    missing = []
    for name in CHECKS:
        number, _, check = name.partition(": ")
        is_current, printed = read_copy(find_notebook(number))
        if is_current and not any(
            f"\n{kind}: {check}: " in f"\n{printed}" for kind in ("check", "claim")
        ):
            missing.append(name)
    assert missing == []


# --- verdicts -----------------------------------------------------------------------------------------

RUN = {
    "07: arrives": {"passed": True, "result": "holds", "value": None},
    "07: is right": {"passed": True, "result": "supported", "value": 0.5},
    "07: is left": {"passed": False, "result": "not supported here", "value": 0.5},
    "07: is neither": {
        "passed": False,
        "result": "not decidable here",
        "value": "n = 3",
    },
    "07: is mostly right": {
        "passed": False,
        "result": "mostly supported",
        "value": "0.8",
    },
    "07: breaks": {"passed": False, "result": "FAILED", "value": 1},
}


@pytest.mark.parametrize(
    ("kind", "names", "verdict"),
    [
        ("claim", ["07: is right", "07: arrives"], "supported"),
        ("claim", ["07: is right", "07: is left"], "not supported"),
        ("claim", ["07: is right", "07: is neither"], "not decidable"),
        ("claim", ["07: is left", "07: is neither"], "not supported"),
        ("claim", ["07: is right", "07: is mostly right"], "mostly supported"),
        ("claim", ["07: is right", "07: breaks"], "not supported"),
        ("claim", ["07: is right", "08: is right"], NOT_RUN),
        ("claim", ["07: is right", "tests/test_a.py::test_a"], "supported"),
        ("implemented", ["07: arrives"], "implemented"),
        ("implemented", ["tests/test_a.py::test_a"], "implemented, by test"),
        (
            "implemented",
            ["07: arrives", "07: breaks"],
            "implemented, but a check fails",
        ),
        ("altered", ["08: arrives"], NOT_RUN),
        ("altered", ["07: breaks"], "altered, but a check fails"),
        ("stress", ["07: is left"], "not supported"),
        ("untestable", ["07: breaks"], "untestable here"),
        ("open", ["08: arrives"], "not done here"),
    ],
)
def test_verdict_follows_from_the_checks(kind, names, verdict):
    assert claims.judge(kind, names, RUN) == verdict


def test_checks_come_from_the_records_of_the_run(tmp_path, monkeypatch):
    file = tmp_path / "mine.csv"
    file.write_text("t,id,x,y\n0,1,0,0\n1,1,1,0\n")
    record = NotebookRecord(
        "16_test", {"data": str(file), "results": tmp_path / "results"}
    )
    made = {
        "name": "arrives",
        "kind": "check",
        "passed": True,
        "value": 0.25,
        "result": "holds",
    }
    (record.out / "records" / "07_test.json").write_text(json.dumps({"checks": [made]}))
    record.claim("is right", None, "n = 3")
    names = [
        ["07: arrives"],
        ["16: is right", "07: arrives"],
        ["07: stops"],
        ["08: arrives"],
    ]
    rows = claims.load_sentences().head(4).assign(kind="claim", held_by=names)
    monkeypatch.setattr(claims, "load_sentences", rows.copy)
    table = claims.judge_sentences(claims.read_checks(record))
    assert table["verdict"].tolist() == [
        "supported",
        "not decidable",
        *2 * [NOT_RUN],
    ]
    assert table["numbers"].iloc[0] == "07: arrives: holds (0.25)"
    assert table["unknown"].tolist() == [[], [], ["07: stops"], []]
