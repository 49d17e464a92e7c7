"""Each committed table belongs to one study, which names its notebook, its module and its probe."""

import importlib
import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from studies import committed, paper_matrix, respect

from szlib.workbook import folders
from szlib.workbook.record import TABLES
from szlib.workbook.record.notebook_record import find_differences, read_table

FOLDER = Path(committed.__file__).parent
for module in sorted(FOLDER.glob("[a-z]*.py")):
    importlib.import_module(f"studies.{module.stem}")
TEXTS = {script.stem[:2]: script.read_text() for script in folders.list_notebooks()}


def test_the_tables_are_those_of_the_studies():
    assert {file.stem for file in TABLES.glob("*.csv")} == set(committed.STUDIES)


@pytest.mark.parametrize("name", sorted(committed.STUDIES))
def test_a_table_is_made_by_its_module_and_shown_in_its_notebook(name):
    study = committed.STUDIES[name]
    header = json.loads((TABLES / f"{name}.csv").read_text().splitlines()[0][2:])
    assert header["command"].split()[2] == f"studies.{study.module}"
    assert name.startswith(f"{study.notebook}_")
    text = TEXTS[study.notebook]
    assert name in text or f"{study.module}.TABLE" in text or "coverage" in name
    if study.probe:
        assert study.probe.__name__ in text


MODEL_CROWDS = "crowd in ('orca', 'social force')"
TABLES_OF_ROBOTS = {
    "09_gamma": "",
    "21_feasibility": "",
    "21_rollouts": "",
    "26_meetings": "",
    "29_crossings": "",
    "29_crowds": MODEL_CROWDS,
    "29_differential": "",
    "29_safety_claims": MODEL_CROWDS,
    "29_walkers": "crowd == 'plaza'",
}
"""Tables of robots, and the rows that need no real data."""


@pytest.mark.slow
@pytest.mark.parametrize("name", TABLES_OF_ROBOTS)
def test_rows_from_all_parts_of_a_table_of_robots_are_reproduced(name):
    """A notebook recomputes one fixed row; this test recomputes up to eight of each table."""
    rows = read_table(name).query(TABLES_OF_ROBOTS[name] or "index >= 0")
    chosen = rows.iloc[np.linspace(0, len(rows) - 1, 8).round()]
    for _, row in chosen.drop_duplicates().iterrows():
        again = committed.STUDIES[name].probe(row)
        assert not find_differences(row, again), row.to_dict()


def test_a_table_that_no_study_registered_is_not_written():
    with pytest.raises(KeyError, match="16_claims: register the table with @study"):
        committed.write_table(pd.DataFrame(), "16_claims")


def test_the_arguments_of_a_study_have_their_defaults_and_types(monkeypatch):
    options = {
        "study": ("claims", "zones"),
        "n": int,
        "sites": ["a", "b"],
        "first_seed": 2,
    }
    typed = ["zones", "5", "--sites", "c", "d", "--first-seed", "7"]
    monkeypatch.setattr("sys.argv", ["python", *typed])
    asked = vars(committed.read_arguments("", **options))
    assert asked == {"study": "zones", "n": 5, "sites": ["c", "d"], "first_seed": 7}
    monkeypatch.setattr("sys.argv", ["python", "claims", "5"])
    assert committed.read_arguments("", **options).sites == ["a", "b"]


def test_szlib_run_may_write_beside_what_studies_store(tmp_path, monkeypatch):
    asked = SimpleNamespace(cache=tmp_path / "results" / "null")
    assert respect.stored(asked, "site", lambda: 7) == 7
    monkeypatch.setattr(paper_matrix, "FOLDER", tmp_path / "results" / "paper_matrix")
    zones = pd.DataFrame(columns=["chain", "draw", "source", "a"])
    assert list(paper_matrix.list_robots(zones, 1)) == []
    folders.claim_results(tmp_path / "results", "synthetic")
