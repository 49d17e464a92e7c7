"""The site of `make docs`: pages of all public names, tables of all parameters, links that lead somewhere."""

import importlib.util
import inspect
import re
from pathlib import Path

import pytest
import yaml
from bs4 import BeautifulSoup

import szlib
from szlib.workbook import cli

ROOT = Path(__file__).parent.parent
PAGE = (ROOT / "notebooks" / "which_settings.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> dict[str, BeautifulSoup]:
    """Every page but the report, by name."""
    spec = importlib.util.spec_from_file_location("docs", ROOT / "notebooks" / "tools" / "docs.py")
    docs = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(docs)
    folder = tmp_path_factory.mktemp("site")
    docs.write_site(folder)
    return {
        file.stem: BeautifulSoup(file.read_text("utf-8"), "html.parser") for file in folder.glob("*.html")
    }


def test_each_public_name_has_a_page_in_the_index(site):
    linked = {link["href"] for link in site["index"].select("main table a")}
    for name in (each for each in szlib.__all__ if not inspect.ismodule(getattr(szlib, each))):
        assert f"szlib.{name}" in site, name
        assert f"szlib.{name}.html" in linked, name


def test_each_table_has_every_parameter_with_its_meaning(site):
    lacking = []
    for name in szlib.__all__:
        value = getattr(szlib, name)
        if not callable(value) or (inspect.isclass(value) and issubclass(value, Exception)):
            continue
        expected = [each for each in inspect.signature(value).parameters if each not in ("self", "cls")]
        rows = site[f"szlib.{name}"].select_one("section").select("table.parameters")[:1]
        cells = [
            [cell.get_text(strip=True) for cell in row.select("td")]
            for table in rows
            for row in table("tr")[1:]
        ]
        shown = {row[0]: row[3] for row in cells}
        lacking += [f"{name}: {each}" for each in expected if not shown.get(each)]
    assert lacking == []


def test_pages_show_examples_and_lead_to_notebooks(site):
    for name in ("read_tracks", "find_encounters", "SocialZone", "MPCCBF", "simulate"):
        page = site[f"szlib.{name}"]
        assert "&gt;&gt;&gt;" in str(page) or ">>>" in page.get_text(), name
        assert page.select('a[href^="notebooks/report.html#"]'), name


def test_links_lead_to_pages_and_places(site):
    broken = []
    for name, page in site.items():
        for link in page.select("a[href]"):
            file, _, anchor = link["href"].partition("#")
            if file.startswith(("http", "notebooks/report", "report")) or not file:
                continue
            target = site.get(file.removesuffix(".html"))
            if target is None or (anchor and not target.find(id=anchor)):
                broken.append(f"{name}: {link['href']}")
    assert broken == []


def test_no_page_asks_a_server(site):
    asked = [tag for page in site.values() for tag in page.select("script[src], link[href], img[src]")]
    assert [tag for tag in asked if str(tag.get("src") or tag.get("href")).startswith(("http", "//"))] == []


def test_the_page_of_decisions_links_files_and_names_what_exists():
    for target in re.findall(r"\]\((?!http)([^)#]+)\)", PAGE):
        assert (ROOT / "notebooks" / target).exists(), target
    for name in re.findall(r"szlib\.(\w+)", PAGE):
        assert hasattr(szlib, name), name


@pytest.mark.filterwarnings("ignore:.*fewer than 20 encounters:szlib.DataWarning")
def test_the_commands_and_programs_of_the_page_of_decisions_run(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    tracks = szlib.read_tracks(szlib.make_plaza("plaza.csv", settings=szlib.PlazaSettings(n_encounters=120)))
    hall = tracks.assign(Frame=(25 * (tracks["t"] - tracks["t"].min())).round().astype(int))
    hall = hall.assign(X=1000 * hall["x"], Y=1000 * hall["y"], Ped=hall["id"])
    columns = ["--columns", "frame=Frame,id=Ped,x=X,y=Y", "--frame-rate", "25", "--unit", "mm"]
    hall[["Frame", "Ped", "X", "Y"]].to_csv("hall.csv", index=False)
    (tmp_path / "map.pgm").write_bytes(b"P5 10 10 255\n" + bytes(50) + b"\xfe" * 50)
    text = "image: map.pgm\nresolution: 0.1\norigin: [0, 0, 0]\noccupied_thresh: 0.65\nfree_thresh: 0.2\n"
    (tmp_path / "map.yaml").write_text(text)
    for command in re.findall(r"```sh\nszlib (.*?)\n```", PAGE):
        given = command.split()
        assert cli.main(given if "--columns" in given else [*given, *columns]) == 0
    found = {"szlib": szlib, "zone": szlib.reference_zone("grand-central-strangers").ellipse}
    for program in re.findall(r"```python\n(.*?)```", PAGE, flags=re.DOTALL):
        if "tracks" in found:
            found["samples"] = szlib.find_encounters(found["tracks"])
        exec(compile(program, "which_settings.md", "exec"), found)
    assert len(found["walls"]) > 0
    assert "respect" in capsys.readouterr().out


def test_a_citation_has_what_bibtex_needs(site):
    """Each entry, of szlib, the paper and the data, has a key, a title, authors, a year and an address."""
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    entries = re.findall(r"^@(\w+)\{([^,\s]+),\n(.*?)^\}$", site["index"].get_text(), flags=re.M | re.S)
    assert len(entries) == 2 + len(citation["references"])
    assert len({key for _, key, _ in entries}) == len(entries)
    for kind, key, fields in entries:
        assert kind in ("article", "inproceedings", "misc")
        assert re.fullmatch(r"[A-Za-z]+\d{4}", key)
        assert {"author", "title", "year"} <= set(re.findall(r"^  (\w+) = \{", fields, flags=re.M))
        assert kind == "misc" or re.search(r"^  (url|doi) = \{", fields, flags=re.M), key
