"""The report: one file with everything that the run found."""

import json
import re
import shutil

import nbformat
import pytest
from bs4 import BeautifulSoup

import szlib
from szlib.workbook.folders import NOTEBOOKS
from szlib.workbook.record import PAPER, parameters
from szlib.workbook.record.display import format_value
from szlib.workbook.report import write_report

PIXEL = "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNkYPhfDwAChwGA60e6kgAAAABJRU5ErkJggg=="
SLOWS = "The robot slows down while passing."
RUN = {
    "date": "2026-11-25 03:00 UTC",
    "command": "szlib run --jobs 2",
    "machine": "Linux x86_64, 2 cores",
    "versions": "Python 3.11.7, numpy 2.3.5",
}
ZONE = szlib.Ellipse((0.05, 0.0), (0.95, 0.75))
DONE = {"status": "done", "seconds": 1.2, "checks": []}


def summarise(*names, **facts):
    """The summary of a run of notebooks."""
    made = {"data": "hall", "files": [["hall.csv", 9, "x"]], "parameters": {}}
    return made | {"notebooks": dict.fromkeys(names, DONE)} | facts


def write(home, name, *texts, **options):
    """Write a notebook of markdown cells."""
    cells = [nbformat.v4.new_markdown_cell(text) for text in texts]
    notebook = nbformat.v4.new_notebook(cells=cells)
    nbformat.write(notebook, home / f"{name}.ipynb")


def parse(report):
    return BeautifulSoup(report.read_text(encoding="utf-8"), "html.parser")


pytestmark = pytest.mark.usefixtures("sentences_held_by_notebook_10")


@pytest.fixture(scope="module")
def movie():
    scenario = szlib.SCENARIOS["corridor"]
    log = szlib.simulate(
        scenario, szlib.MPCCBF(ZONE, walls=scenario.walls), max_time=1.0
    )
    return log.animate(every=1.0, width=2.0)


@pytest.fixture(scope="module")
def page(tmp_path_factory, movie):
    """The report of one made-up notebook."""
    home = tmp_path_factory.mktemp("run")
    table = parameters([("gamma", 0.05, PAPER, "sec. 4")]).to_html()
    output = nbformat.v4.new_output
    cells = [
        nbformat.v4.new_markdown_cell("# 10 - A corridor\n\nText."),
        nbformat.v4.new_markdown_cell(
            r"With $h \ge 0$:"
            "\n\n"
            r"$$\frac{r^2}{L} \tag{1}$$"
            "\n\n[next](11_waiting.ipynb), [here](10_corridor.ipynb)"
        ),
        nbformat.v4.new_code_cell(
            "x < 1",
            outputs=[
                output(
                    "display_data",
                    {"image/png": PIXEL},
                    metadata={"image/png": {"alt": 'h "over" time'}},
                ),
                output("display_data", {"image/png": PIXEL}),
                output("display_data", {"text/html": movie._repr_html_()}),
                output("display_data", {"text/html": table}),
            ],
        ),
    ]
    asks = {"szlib": {"asks": "Does it barge past?"}}
    notebook = nbformat.v4.new_notebook(cells=cells, metadata=asks)
    nbformat.write(notebook, home / "10_corridor.ipynb")
    checks = [
        {
            "kind": "check",
            "name": "h >= 0",
            "passed": False,
            "value": -0.25,
            "result": "FAILED",
        },
        {
            "kind": "claim",
            "name": SLOWS,
            "passed": True,
            "value": 0.123456,
            "result": "supported",
        },
        {
            "kind": "claim",
            "name": "gamma is tuned",
            "passed": True,
            "value": "yes",
            "result": "supported",
        },
    ]
    outcomes = {"10_corridor": DONE | {"checks": checks}}
    return parse(write_report(home, summarise(notebooks=outcomes, **RUN)))


def test_report_needs_no_other_file_and_no_network(page):
    asked = [
        tag.get(name)
        for tag in page.find_all(True)
        for name in ("src", "href")
        if tag.get(name)
    ]
    assert asked
    assert all(address.startswith(("data:", "#")) for address in asked), asked
    assert not re.search(
        r"@import|url\((?!['\"]?data:)",
        " ".join(style.text for style in page.select("style")),
    )


def test_every_link_has_a_target(page):
    places = {tag["id"] for tag in page.select("[id]")} | {"top"}
    assert {link["href"][1:] for link in page.select("td a[href], p a[href]")} <= places
    assert "next" in page.text and not [
        link for link in page.select("a") if link.text == "next"
    ]


def test_every_picture_has_an_alt_text(page):
    alts = [image.get("alt") for image in page.select("img")]
    assert 'h "over" time' in alts
    assert all(alts)


def test_formulas_are_drawn_by_the_browser(page):
    assert len(page.select("math")) == 2
    assert page.select("math[display=block] mfrac")


def test_front_page_lists_checks(page):
    assert "0 of 1 checks hold" in page.text
    assert "Failed in notebook 10: h >= 0: -0.25." in page.text
    rows = [[cell.text for cell in row.select("td")] for row in page.select("tr")]
    assert ["h >= 0: -0.25. (notebook 10)", "FAILED"] in rows
    (summary,) = page.select("details.notebook > summary")
    text = " ".join(summary.text.split())
    assert text == "10 corridor Does it barge past? 0 of 1 checks hold, 1 s, done"


def test_claims_of_the_paper_stand_apart_from_those_of_the_workbook(page):
    paper, own = page.select_one("#claims"), page.select_one("#checks")
    claims = {row.td.text: row for row in paper.find_next("table").select("tbody tr")}
    (slows,) = (
        row
        for text, row in claims.items()
        if text.startswith("CBF enables natural behaviors")
    )
    assert [cell.text for cell in slows.select("td")][1:] == [
        "supported",
        "The robot slows down while passing: 0.123. (notebook 10)",
    ]
    assert [row.td.text for row in own.find_next("table").select("tbody tr")] == [
        "gamma is tuned: yes. (notebook 10)"
    ]


def test_sections_stand_in_their_order_and_none_is_empty(page):
    sections = [heading["id"] for heading in page.select("h2[id]")]
    # no zone, no funnel
    assert sections == ["claims", "checks", "notebooks", "run"]
    assert "Not part of this run" not in page.text
    assert page.h1.text == page.title.text == "Social zones of hall.csv"
    menus = [[link["href"] for link in menu.select("a")] for menu in page.select("nav")]
    assert (
        menus
        == [
            [
                "#top",
                "#claims",
                "#checks",
                "#notebooks",
                "#10_corridor",
                "#run",
            ]
        ]
        * 2
    )
    order = [
        tag.get("id") or tag["class"][0]
        for tag in page.select("div.first, h2[id], details.notebook")
    ]
    assert order == [
        "first",
        "claims",
        "checks",
        "notebooks",
        "10_corridor",
        "run",
    ]


def test_movie_is_in_its_notebook_and_the_front_page_has_room_for_it(page, movie):
    name = re.search("data-run=.(szlib-[0-9a-f]{8})", movie._repr_html_())[1]
    (figure,) = page.select("figure.szlib-player")
    assert figure["data-run"] == name
    assert figure.find_parent("details")["id"] == "10_corridor"
    assert figure.img["alt"] == movie.run["alt"]
    shown = json.loads(page.select_one(".players")["data-scenarios"])
    (title,) = (title for title, name in shown.items() if name == "corridor")
    assert figure.img["alt"].startswith(f"{title}:"), "so report.js finds it"
    script = figure.find_next("script").text
    run = json.loads(re.search(r"^const run = (.*);$", script, re.MULTILINE)[1])
    assert run == json.loads(json.dumps(movie.run))
    assert len(run["snapshots"]) == 11
    assert run["snapshots"][0]["robot"] == [-4, 0]
    assert run["snapshots"][10]["people"] == [[3.5, 0, 3.142]]


def test_the_report_says_when_how_and_where_it_was_made(page):
    rows = [[cell.text for cell in row.select("td")] for row in page.select("tr")]
    for name, value in RUN.items():
        assert [name, value] in rows


def test_code_is_folded(page):
    (code,) = page.select("details.code")
    assert "x < 1" in code.text and not code.has_attr("open")


def test_pictures_of_the_notebooks_are_embedded(tmp_path):
    text = '![a zone](figures/zone.png)\n\n<img src="figures/making_room.gif" alt="a robot">'
    write(tmp_path, "00_pictures", f"# 0 - Pictures\n\n{text}")
    page = parse(write_report(tmp_path, summarise("00_pictures")))
    shown = {picture["alt"]: picture["src"][:14] for picture in page.select("img[alt]")}
    assert shown["a zone"] == "data:image/png"
    assert shown["a robot"] == "data:image/gif"


def test_a_notebook_that_is_not_in_the_summary_is_left_out(tmp_path):
    for name in ("07_now", "19_before"):
        write(tmp_path, name, "# 19 - Renamed since")
    report = write_report(tmp_path, summarise("07_now", "08_failed_to_start"))
    text = report.read_text(encoding="utf-8")
    assert "07_now" in text and "19_before" not in text


@pytest.mark.filterwarnings("ignore::szlib.DataWarning")
def test_a_zone_of_other_files_is_not_shown(tmp_path):
    """The verdict is left out where `zone.json` was made of other files than those of the run."""
    settings = szlib.PlazaSettings(n_encounters=100)
    tracks = szlib.read_tracks(szlib.make_plaza(tmp_path / "p.csv", settings=settings))
    samples = szlib.find_encounters(tracks)
    zone = szlib.SocialZone.fit(samples, method="paper", n_resamples=0)
    zone.save(tmp_path / "zone.json")
    row = f"<td>{zone.table()['a'].iloc[0]:.2f}</td>"
    write(tmp_path, "07_now", "# 7 - Now")
    for facts, is_shown in (
        ({"verdict": "zone at 1.1 m/s: usable"}, True),
        ({}, False),
    ):
        report = write_report(tmp_path, summarise("07_now", **facts))
        assert (row in report.read_text(encoding="utf-8")) == is_shown


def test_links_to_files_outside_of_the_report_leave_their_text(tmp_path):
    text = "exercises: [5.1](exercises/sheet5.ipynb#5.1-Focal-distance-(15-min)), "
    text += "[5.2](exercises/sheet5.ipynb)"
    write(tmp_path, "00_links", f"# 0 - Links\n\n{text}")
    page = parse(write_report(tmp_path, summarise("00_links")))
    assert "exercises: 5.1, 5.2" in [each.get_text() for each in page.find_all("p")]


def test_names_from_elsewhere_are_text(tmp_path):
    """Of files, and of what an error says."""
    write(tmp_path, "01_one", "# 1")
    bad = '"><script>attack()</script>'
    outcome = DONE | {"status": "error", "error": bad}
    files = [[f"{bad}.csv", 9, "x"]]
    summary = summarise(notebooks={"01_one": outcome}, files=files, data=bad, area=bad)
    page = parse(write_report(tmp_path, summary))
    assert page.h1.text == page.title.text == f"Social zones of {bad}.csv"
    assert not [each for each in page.select("script") if "attack" in each.text]


LONG = re.compile(r"(?<![\w.,])[-+]?(?:0\.0*)?((?:\d[\d,]*)(?:\.\d+)?)")
"""A number without the zeros that begin it."""


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.08682, "0.0868"),
        (-0.0, "0"),
        (1234.567, "1235"),
        (float("nan"), "nan"),
        ({"a": 0.12345, "b": True}, "a: 0.123, b: True"),
        (None, ""),
    ],
)
def test_numbers_have_three_digits(value, text):
    assert format_value(value) == text


def test_no_claim_has_more_than_four_digits_and_each_is_a_sentence():
    """The claims of the committed notebooks, as their last cells show them."""
    claims = []
    for file in (*NOTEBOOKS.glob("*.ipynb"), *NOTEBOOKS.glob("deeper/*.ipynb")):
        for cell in nbformat.read(file, as_version=4).cells:
            printed = "".join(each.get("text", "") for each in cell.get("outputs", ()))
            claims += re.findall(r"^claim: (.*)", printed, re.MULTILINE)
    assert len(claims) > 90
    for claim in claims:
        digits = [
            number.replace(",", "").replace(".", "") for number in LONG.findall(claim)
        ]
        assert all(len(number.rstrip("0")) <= 4 for number in digits), claim
        assert not re.match(
            r"(and|so|nor|which|there|it|its|the others|then)\b", claim, re.IGNORECASE
        ), claim


def test_the_report_of_all_notebooks_has_at_most_6_mb(tmp_path):
    """The committed notebooks have the outputs of the default run."""
    files = [*NOTEBOOKS.glob("*.ipynb"), *NOTEBOOKS.glob("deeper/*.ipynb")]
    for file in files:
        shutil.copy(file, tmp_path)
    report = write_report(tmp_path, summarise(*sorted(file.stem for file in files)))
    print(f"{report.stat().st_size / 1e6:.2f} MB")
    assert report.stat().st_size <= 6_000_000
