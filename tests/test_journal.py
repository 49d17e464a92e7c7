"""The paper for a journal: its fields, references, numbers and length; and what only the owner knows."""

import re
import shutil
import subprocess
import tomllib
from datetime import datetime
from pathlib import Path

import pytest
import yaml

import szlib
from szlib.workbook.claims import judge_claims
from szlib.workbook.record import read_table

ROOT = Path(__file__).parents[1]
PAPER, BIB = ROOT / ".paper" / "paper.md", ROOT / ".paper" / "paper.bib"
_, HEADER, BODY = PAPER.read_text(encoding="utf-8").split("---\n", 2)
FRONT = yaml.safe_load(HEADER)
SECTIONS = dict(re.findall(r"^# ([^\n]+)\n(.*?)(?=^# |\Z)", BODY, re.M | re.S))
ENTRIES = {
    key: (kind, dict(re.findall(r"^  (\w+) = \{(.*)\},?$", fields, re.M)))
    for kind, key, fields in re.findall(
        r"^@(\w+)\{(\w+),\n(.*?)^\}$", BIB.read_text(encoding="utf-8"), re.M | re.S
    )
}
CITATION = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
README = (ROOT / "README.md").read_text(encoding="utf-8")
CONTRIBUTING = (ROOT / ".github" / "CONTRIBUTING.md").read_text(encoding="utf-8")
REQUIRED = [
    "Summary", "Statement of need", "State of the field", "Software design", "Research impact statement",
    "AI usage disclosure", "Acknowledgements", "References",
]  # fmt: skip
"""Sections that JOSS asks for, in its order."""
MISSING = {
    "pyproject.toml: project.authors": ("authors",),
    "pyproject.toml: project.license": ("license",),
    "pyproject.toml: project.urls.Repository": ("urls", "Repository"),
}
"""Fields that only the owner can add, and their place below [project]."""


def find_owner(value, path=""):
    """The places of the word "owner" in nested lists and mappings."""
    if isinstance(value, dict):
        for key, part in value.items():
            yield from find_owner(part, f"{path}.{key}".strip("."))
    elif isinstance(value, list):
        for part in value:
            yield from find_owner(part, path)
    elif value == "owner":
        yield path


def find_placeholders():
    """Every place that waits for the owner, as CONTRIBUTING names it."""
    found = {f".paper/paper.md: {each}" for each in find_owner(FRONT)}
    found |= {f"CITATION.cff: {each}" for each in find_owner(CITATION)}
    found |= {
        f".paper/paper.md: {title}"
        for title, text in SECTIONS.items()
        if re.search(r"^owner: ", text, re.M)
    }
    sources = [
        each
        for pattern in ("*.md", "*.py", "*.toml", "*.yml", "*.ipynb")
        for folder in ("notebooks", "szlib")
        for each in (ROOT / folder).rglob(pattern)
        if ".ipynb_checkpoints" not in each.parts
    ]
    for file in [ROOT / "README.md", ROOT / "pyproject.toml", *sources]:
        if re.search(r"\bOWNER\b", file.read_text(encoding="utf-8")):
            found.add(f"{file.relative_to(ROOT).as_posix()}: OWNER")
    if "no licence yet" in README:
        found.add("README.md: no licence yet")
    if not (ROOT / "LICENSE").exists():
        found.add("LICENSE")
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    for name, keys in MISSING.items():
        value = project["project"]
        for key in keys:
            value = value.get(key, {})
        if not value:
            found.add(name)
    return found


def test_the_paper_has_the_fields_that_joss_asks_for():
    assert set(FRONT) >= {"title", "tags", "authors", "affiliations", "date"}
    assert FRONT["title"] == CITATION["title"]
    assert FRONT["tags"][0] == "Python" and len(FRONT["tags"]) >= 3
    assert datetime.strptime(FRONT["date"], "%d %B %Y").year >= 2026
    assert FRONT["bibliography"] == BIB.name
    for author in FRONT["authors"]:
        assert author["name"] and author["orcid"]
    indices = {each["index"] for each in FRONT["affiliations"] if each["name"]}
    assert {each["affiliation"] for each in FRONT["authors"]} <= indices


def test_the_paper_has_the_sections_and_the_length_that_joss_asks_for():
    assert list(SECTIONS) == REQUIRED
    assert [name for name in REQUIRED if not SECTIONS[name].strip()] == ["References"]
    assert "## What is new" in SECTIONS["Software design"]
    assert 750 <= len(re.sub(r"\[@[^\]]*\]", "", BODY).split()) <= 1750


def test_each_citation_has_an_entry_and_each_entry_is_cited():
    cited = set(re.findall(r"(?<![\w.])@(\w+)", BODY))
    assert cited == set(ENTRIES)


def test_each_entry_has_what_its_kind_needs():
    assert len(ENTRIES) == BIB.read_text(encoding="utf-8").count("\n@") + 1
    needed = {
        "article": {"journal", "volume", "pages", "doi"},
        "inproceedings": {"booktitle"},
        "techreport": {"institution", "number"},
        "misc": set(),
    }
    for key, (kind, fields) in ENTRIES.items():
        assert set(fields) >= {"author", "title", "year"} | needed[kind], key
        assert kind != "misc" or {"doi", "url"} & set(fields), key
        doi = fields.get("doi", "10.0000/none")
        assert re.fullmatch(r"10\.\d{4,5}/\S+", doi) and "doi.org" not in doi, key
    dois = [fields["doi"] for _, fields in ENTRIES.values() if "doi" in fields]
    assert len(dois) == len(set(dois))


def test_the_same_work_has_the_same_doi_everywhere():
    reference = (ROOT / "notebooks" / "reference.md").read_text(encoding="utf-8")
    keys = (
        "jang2024social brscic2013person zeng2021safety ames2019control breunig2000lof"
    )
    for doi in (ENTRIES[key][1]["doi"] for key in keys.split()):
        assert doi in reference
    known = {fields.get("doi") for _, fields in ENTRIES.values()}
    assert len(known & {each["doi"] for each in CITATION["references"]}) >= 2


def test_the_numbers_of_the_paper_are_those_of_the_readme():
    """`test_docs.py` compares those of the README with the tables."""
    results = " ".join(README.split("## Five results")[1].split("\n## ")[0].split())
    text = re.sub(r"\[@[^\]]*\]|@\w+|\(https?:[^)]*\)", "", BODY)
    numbers = re.findall(
        r"\d[\d.,]*(?<![.,])(?: (?:%|[a-z]+))?", " ".join(text.split())
    )
    assert len(numbers) > 10
    for number in numbers:
        assert re.search(rf"(?<![\d.,]){re.escape(number)}(?![\d\w])", results), number


def test_the_claims_that_the_paper_names_have_the_verdicts_it_gives():
    verdicts = judge_claims(read_table("28_matrix")).set_index("claim")
    waits = verdicts.loc["The robot waits."]
    ahead = verdicts.loc["The zone is larger in front of the person."]
    assert waits["verdict"] == "supported" and "the robot waits is supported" in BODY
    assert ahead["verdict"] == "mostly not supported"
    assert ahead["decides"].startswith("source")
    text = " ".join(BODY.split())
    assert (
        "larger in front of the person is mostly not supported, and depends on the place"
        in text
    )


def test_citation_asks_to_cite_this_software():
    preferred = CITATION["preferred-citation"]
    assert CITATION["cff-version"] == "1.2.0"
    assert CITATION["type"] == preferred["type"] == "software"
    assert preferred["title"] == CITATION["title"]
    assert preferred["version"] == CITATION["version"] == szlib.__version__
    assert preferred["year"] == CITATION["date-released"].year
    names = ("family-names", "given-names")
    assert [[each[name] for name in names] for each in preferred["authors"]] == [
        [each[name] for name in names] for each in CITATION["authors"]
    ]
    followed = CITATION["references"][0]
    assert followed["doi"] == ENTRIES["jang2024social"][1]["doi"]
    assert followed["title"] == ENTRIES["jang2024social"][1]["title"]


def test_what_only_the_owner_knows_is_listed_in_contributing():
    section = CONTRIBUTING.split("## What only the owner knows")[1].split("\n## ")[0]
    listed = re.findall(r"^- `([^`]+)`", section, re.M)
    assert len(listed) == len(set(listed))
    assert set(listed) == find_placeholders()


@pytest.mark.skipif(not shutil.which("pandoc"), reason="pandoc is not installed")
def test_pandoc_builds_the_paper(tmp_path):
    page = tmp_path / "paper.html"
    command = ["pandoc", PAPER.name, "--citeproc", "--standalone", "--output", page]
    made = subprocess.run(command, cwd=PAPER.parent, capture_output=True, text=True)
    assert made.returncode == 0, made.stderr
    assert not made.stderr
    text = page.read_text(encoding="utf-8")
    assert "???" not in text and FRONT["title"] in text
    assert set(re.findall(r'id="ref-(\w+)"', text)) == set(ENTRIES)
