"""The report of a folder from another person: nothing in it runs, and what is malformed is named."""

import json
import os
import re
import shutil

import nbformat
import pytest
from bs4 import BeautifulSoup
from helpers.hostile_results import make_hostile_results

from szlib.core.errors import DataError, SzlibError
from szlib.core.files import claim_folder
from szlib.workbook.report import write_report

HARMLESS = ("#", "http://", "https://", "mailto:")


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    home = make_hostile_results(tmp_path_factory.mktemp("hostile"))
    return BeautifulSoup(write_report(home).read_text(encoding="utf-8"), "html.parser")


def test_nothing_of_a_foreign_folder_runs_or_asks_a_server(page):
    (script,) = page.select("script")  # the player's
    assert "attack()" not in re.sub(r'"[^"\n]*"', "", script.text), (
        "it is in the data only"
    )
    policy = page.select_one("head > meta[http-equiv]")["content"]
    assert (
        policy.startswith("default-src 'none'; script-src 'sha256-")
        and policy.count("script-src") == 1
    )
    assert not page.select(
        "svg, iframe, object, form, base, link, embed, button, input, template, body style"
    )
    assert len(page.select("meta[http-equiv]")) == 1
    for tag in page.find_all(True):
        assert not [name for name in tag.attrs if name.startswith("on")], tag
        assert "style" not in tag.attrs
        assert tag.get("href", "#").startswith(HARMLESS)
        assert tag.get("src", "data:image/").startswith("data:image/")


def test_files_outside_the_notebooks_are_not_embedded(page):
    assert not page.select("img[alt=p][src], img[alt=q][src]")


def test_what_a_foreign_folder_says_is_shown_as_text(page):
    front = page.select_one("h1").text
    assert front.startswith('Social zones of "><img src=x onerror=attack()><script>')
    assert len(page.find_all(string=re.compile(r"onerror=attack"))) > 20


@pytest.fixture
def results(tmp_path):
    """Results of one notebook."""
    home = claim_folder(tmp_path / "mine", "results of mine")
    cells = [
        nbformat.v4.new_markdown_cell("# 1\n\n$h$"),
        nbformat.v4.new_code_cell("1"),
    ]
    nbformat.write(nbformat.v4.new_notebook(cells=cells), home / "01_a.ipynb")
    outcome = {"status": "done", "seconds": 1, "checks": []}
    (home / "summary.json").write_text(
        json.dumps({"data": "mine", "notebooks": {"01_a": outcome}})
    )
    write_report(home)
    return home


def notebook(**changes):
    cell = {
        "cell_type": "code",
        "source": "",
        "metadata": {},
        "outputs": [],
        "execution_count": None,
    } | changes
    return json.dumps(
        {"cells": [cell], "metadata": {}, "nbformat": 4, "nbformat_minor": 4}
    )


DISPLAY = {"output_type": "display_data", "metadata": {}}
MALFORMED = [
    ("01_a.ipynb", "{"), ("01_a.ipynb", "[]"), ("01_a.ipynb", "{}"),
    ("01_a.ipynb", '{"cells": 3, "nbformat": 4}'),
    ("01_a.ipynb", notebook(source=3)), ("01_a.ipynb", notebook(outputs=[3])),
    ("01_a.ipynb", notebook(outputs=[{**DISPLAY, "data": {"text/html": 3}}])),
    ("01_a.ipynb", notebook(outputs=[{"output_type": "stream", "name": "stdout", "text": {"a": 1}}])),
    ("01_a.ipynb", '{"cells": [], "metadata": {}, "nbformat": 4, "nbformat_minor": 4}'),
    ("01_a.ipynb", "[" * 100_000),
    ("summary.json", "[]"), ("summary.json", "{"), ("summary.json", '{"notebooks": [1]}'),
    ("summary.json", '{"notebooks": {"01_a": 3}}'), ("summary.json", '{"notebooks": {"01_a": {}}}'),
    ("summary.json", json.dumps({"notebooks": {"01_a": {"status": 1, "seconds": "1", "checks": []}}})),
    ("summary.json", json.dumps({"notebooks": {"01_a": {"status": 1, "seconds": 1, "checks": [3]}}})),
    ("parameters.json", "3"), ("parameters.json", '{"files": [3]}'),
    ("parameters.json", '{"files": [["a", "b"]]}'), ("parameters.json", '{"parameters": [3]}'),
    ("encounters.parquet", "PAR1"),
    ("zone.json", "{}"), ("zone.json", "["),
]  # fmt: skip


@pytest.mark.parametrize(("name", "content"), MALFORMED)
def test_malformed_results_are_refused_with_the_name_of_the_file(
    results, name, content
):
    report = (results / "report.html").read_bytes()
    (results / name).write_bytes(
        content.encode() if isinstance(content, str) else content
    )
    with pytest.raises(SzlibError, match=re.escape(str(results / name))):
        write_report(results)
    assert (results / "report.html").read_bytes() == report


def test_a_notebook_that_never_ends_is_refused(results):
    (results / "01_a.ipynb").unlink()
    os.mkfifo(results / "01_a.ipynb")
    with pytest.raises(DataError, match=r"01_a\.ipynb"):
        write_report(results)


def test_a_folder_that_szlib_did_not_mark_gets_no_report(results, tmp_path):
    shutil.copytree(
        results,
        tmp_path / "foreign",
        ignore=shutil.ignore_patterns(".szlib*", "report.html"),
    )
    with pytest.raises(DataError, match=r"foreign/\.szlib: .*`szlib run` makes"):
        write_report(tmp_path / "foreign")
    assert not (tmp_path / "foreign" / "report.html").exists()
