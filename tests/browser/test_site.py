"""The site of `make docs`: every public name, links that lead somewhere, no network; it opens in Chromium."""

import inspect
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from bs4 import BeautifulSoup

import szlib
from szlib.core.files import claim_folder

ROOT = Path(__file__).parents[2]
pytest.importorskip("myst_nb")
pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The site with one notebook."""
    folder = tmp_path_factory.mktemp("site")
    (ROOT / ".docs" / "pages").mkdir(exist_ok=True)
    options = [
        "-q",
        "-c",
        ".docs",
        "-d",
        str(folder / "html" / ".doctrees"),
        ".docs/pages",
    ]
    built = subprocess.run(
        [sys.executable, "-m", "sphinx", *options, str(folder / "html")],
        cwd=ROOT, env=os.environ | {"SZLIB_DOCS_NOTEBOOKS": "07*", "SZLIB_REPOSITORY": "me/szlib"},
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    faults = re.findall(r".*(?:WARNING|ERROR): .*\[docutils\]", built.stderr)
    assert not faults, "a docstring is no reStructuredText"
    return folder / "html"


@pytest.fixture(scope="module")
def pages(folder):
    """Every page, by its path."""
    return {
        file.relative_to(folder).as_posix(): BeautifulSoup(
            file.read_text(encoding="utf-8"), "html.parser"
        )
        for file in folder.glob("**/*.html")
    }


def test_the_site_may_lie_among_the_results_of_runs(folder):
    claim_folder(folder.parent, "results of the workbook")
    assert not (folder.parent / "jupyter_execute").exists()


def test_each_public_name_has_an_entry_and_each_parameter_a_meaning(pages):
    entries = {
        tag["id"]: tag.find_parent("dl")
        for page in pages.values()
        for tag in page.select("dt.sig[id]")
    }
    for name in szlib.__all__:
        value = getattr(szlib, name)
        if not inspect.isclass(value) and not inspect.isroutine(value):
            continue
        keys = [key for key in entries if key.endswith(f".{name}")]
        assert keys, name
        entry = entries[min(keys, key=len)]  # not a method of the same name
        if inspect.isclass(value) and issubclass(value, Exception):
            continue  # it takes a text only
        text = entry.get_text(" ")
        for parameter in set(inspect.signature(value).parameters) - {"self", "options"}:
            assert re.search(rf"\b{parameter}\b", text), f"{name}: {parameter}"


def test_links_lead_to_pages_and_places(pages):
    broken = []
    for name, page in pages.items():
        for link in page.select("article a.internal[href]"):
            target, _, anchor = link["href"].partition("#")
            path = os.path.normpath(os.path.join(os.path.dirname(name), target))  # noqa: PTH118, PTH120
            found = page if not target else pages.get(path)
            if found is None or (anchor and not found.find(id=anchor)):
                broken.append(f"{name}: {link['href']}")
    assert broken == []


def test_no_page_asks_a_server(pages):
    asked = [
        str(tag.get("src") or tag.get("href"))
        for page in pages.values()
        for tag in page.select("script[src], link[rel=stylesheet], img[src]")
    ]
    assert asked and not [each for each in asked if each.startswith(("http", "//"))]


def test_formulas_are_mathml_pictures_have_alt_texts_and_notebooks_can_be_launched(
    pages,
):
    page = pages["notebooks/07_barriers.html"]
    assert page.select("math mfrac") or page.select("math msub")
    alts = [image.get("alt", "") for image in page.select("article img")]
    assert alts and all(re.search(r"\w+ \[m|over|:", alt) for alt in alts)
    targets = [link["href"] for link in page.select("article a[href^=http]")]
    for host in (
        "https://mybinder.org/v2/gh/me/szlib",
        "https://colab.research.google.com/github/me",
    ):
        assert any(target.startswith(host) for target in targets)


def test_a_citation_has_what_bibtex_needs(pages):
    """Each entry, of szlib, the paper and the data, has a key, a title, authors, a year and an address."""
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    text = pages["cite.html"].get_text()
    entries = re.findall(r"^@(\w+)\{([^,\s]+),\n(.*?)^\}$", text, flags=re.M | re.S)
    assert len(entries) == 1 + len(citation["references"])
    assert len({key for _, key, _ in entries}) == len(entries)
    for kind, key, fields in entries:
        assert kind in ("article", "inproceedings", "misc")
        assert re.fullmatch(r"[A-Za-z]+\d{4}", key)
        named = set(re.findall(r"^  (\w+) = \{", fields, flags=re.M))
        assert {"author", "title", "year"} <= named
        assert kind == "misc" or named & {"url", "doi"}, key


def test_the_site_is_navigated_and_searched_in_a_browser(browser, folder):
    page, messages = browser.new_page(), []
    page.on("pageerror", lambda error: messages.append(str(error)))
    page.on(
        "request",
        lambda r: messages.append(r.url) if r.url.startswith("http") else None,
    )
    page.goto((folder / "index.html").as_uri())
    page.locator(".sidebar-tree a", has_text="Barriers").first.click()
    assert "how fast may the robot approach" in page.locator("h1").text_content()
    shown = page.locator("article img").first
    shown.scroll_into_view_if_needed()
    assert shown.evaluate("image => image.naturalWidth") > 100
    page.goto((folder / "search.html").as_uri() + "?q=MPCCBF")
    page.locator("#search-results li a").first.wait_for()
    assert messages == []
    page.close()
