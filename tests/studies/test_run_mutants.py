"""The text of each mutant stands once in the code of today."""

import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "tests" / "studies" / "run_mutants.toml").read_text(encoding="utf-8")
MUTANTS = [each for part in tomllib.loads(TEXT).values() for each in part]


@pytest.mark.parametrize("mutant", MUTANTS, ids=lambda each: each["after"][:40])
def test_a_mutant_changes_one_place_of_the_package(mutant):
    source = (ROOT / "szlib" / mutant["file"]).read_text(encoding="utf-8")
    assert source.count(mutant["before"]) == 1 and mutant["after"] != mutant["before"]
