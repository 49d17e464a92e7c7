"""The paper for a journal: its fields, references and length; and what only the owner can fill in."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parents[1]
PAPER, BIB = ROOT / ".paper" / "paper.md", ROOT / ".paper" / "paper.bib"
_, HEADER, BODY = PAPER.read_text(encoding="utf-8").split("---\n", 2)
FRONT = yaml.safe_load(HEADER)
CITATION = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
CONTRIBUTING = (ROOT / ".github" / "CONTRIBUTING.md").read_text(encoding="utf-8")
SECTIONS = [
    "Summary", "Statement of need", "State of the field", "Software design", "Research impact statement",
    "AI usage disclosure", "Acknowledgements", "References",
]  # fmt: skip
"""Sections that JOSS asks for, in its order."""


def find_owner(value, path=""):
    """The places of the word "owner" in nested lists and mappings."""
    if isinstance(value, dict):
        return {
            each
            for key, part in value.items()
            for each in find_owner(part, f"{path}.{key}".strip("."))
        }
    if isinstance(value, list):
        return {each for part in value for each in find_owner(part, path)}
    return {path} if value == "owner" else set()


def test_the_paper_has_the_fields_and_sections_of_joss():
    assert {"title", "tags", "authors", "affiliations", "date", "bibliography"} <= set(
        FRONT
    )
    assert re.findall(r"^# (.+)$", BODY, re.M) == SECTIONS
    assert 750 <= len(re.sub(r"\[@[^\]]*\]", "", BODY).split()) <= 1750
    indices = {each["index"] for each in FRONT["affiliations"]}
    assert {each["affiliation"] for each in FRONT["authors"]} <= indices


def test_each_reference_is_cited_and_each_citation_has_a_reference():
    entries = set(re.findall(r"^@\w+\{(\w+),", BIB.read_text(encoding="utf-8"), re.M))
    assert entries == set(re.findall(r"@(\w+)", BODY))


def test_the_software_is_what_citation_asks_to_cite():
    assert CITATION["type"] == CITATION["preferred-citation"]["type"] == "software"
    assert (
        CITATION["preferred-citation"]["title"] == CITATION["title"] == FRONT["title"]
    )
    titles = [each["title"] for each in CITATION["references"]]
    assert any(
        title.startswith("Social Zone as a Barrier Function") for title in titles
    )


def test_what_only_the_owner_knows_is_listed_once():
    found = {f".paper/paper.md: {each}" for each in find_owner(FRONT)}
    found |= {f"CITATION.cff: {each}" for each in find_owner(CITATION)}
    found |= {
        f".paper/paper.md: {section}"
        for section, text in re.findall(r"^# (.+)\n\n(\w+)", BODY, re.M)
        if text == "owner"
    }
    listed = CONTRIBUTING.split("## What only the owner knows")[1].split("\n## ")[0]
    names = set(re.findall(r"^- `([^`]+)`", listed, re.M))
    assert {each for each in names if each.startswith((".paper", "CITATION"))} == found
    assert "OWNER" in (ROOT / "README.md").read_text(encoding="utf-8")
    assert any(each.startswith("README.md") for each in names)


@pytest.mark.skipif(not shutil.which("pandoc"), reason="pandoc is not installed")
def test_pandoc_builds_the_paper(tmp_path):
    page = tmp_path / "paper.html"
    command = [
        "pandoc",
        PAPER.name,
        "--citeproc",
        "--standalone",
        "--output",
        str(page),
    ]
    made = subprocess.run(command, cwd=PAPER.parent, capture_output=True, text=True)
    assert made.returncode == 0 and "[WARNING]" not in made.stderr
    assert "???" not in page.read_text(encoding="utf-8")
