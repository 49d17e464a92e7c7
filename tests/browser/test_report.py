"""The report in a real browser: what a first screen shows, at 1300 and at 390 pixels, by day and by night."""

import nbformat
import numpy as np
import pandas as pd
import pytest

import szlib
from szlib.workbook.report import write_report

VERDICT = "undecided: no null model"
WIDE, NARROW = (1300, 900), (390, 844)


pytestmark = [
    pytest.mark.slow,
    pytest.mark.usefixtures("sentences_held_by_notebook_10"),
]


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    """The report of four short runs and a zone, with a wide table in the first notebook."""
    home = tmp_path_factory.mktemp("run")
    n, rng = 3000, np.random.default_rng(0)
    samples = pd.DataFrame(
        {
            "encounter": np.arange(n),
            "los_angle": rng.uniform(-3.1, 3.1, n),
            "speed": rng.uniform(0.5, 1.5, n),
        }
    )
    samples["distance"] = rng.uniform(0.9, 2.5, n)
    szlib.SocialZone.fit(samples, speeds=[1.1], n_resamples=0).save(home / "zone.json")
    outputs = {}
    for number, scenario in enumerate(szlib.SCENARIOS.values(), 9):
        controller = szlib.MPCCBF(
            szlib.Ellipse((0.05, 0.0), (0.95, 0.75)), walls=scenario.walls
        )
        movie = szlib.simulate(scenario, controller, max_time=1.0).animate(
            every=1.0, width=2.0
        )
        outputs[f"{number:02d}_{scenario.name}"] = [movie._repr_html_()]
    wide = pd.DataFrame({f"a column of numbers, {i}": [1.5, 2.0] for i in range(20)})
    outputs["09_passing"] += [
        wide.assign(name=["first", "second"]).to_html(index=False)
    ]
    for name, shown in outputs.items():
        data = [
            nbformat.v4.new_output("display_data", {"text/html": html})
            for html in shown
        ]
        cells = [
            nbformat.v4.new_markdown_cell("# A notebook\n\n**Question.** Which?"),
            nbformat.v4.new_code_cell("x = 1  # " + "long " * 60, outputs=data),
        ]
        nbformat.write(nbformat.v4.new_notebook(cells=cells), home / f"{name}.ipynb")
    slows = {
        "kind": "claim",
        "name": "The robot slows down while passing.",
        "passed": True,
    }
    slows |= {"value": "to 12 % of its greatest speed", "result": "supported"}
    outcome = {"status": "done", "seconds": 1, "checks": [slows]}
    summary = {
        "data": "hall",
        "files": [["hall.csv", 9, "x"]],
        "parameters": {},
        "verdict": f"zone at 1.1 m/s: {VERDICT}",
        "notebooks": {
            name: outcome | ({} if name == "10_corridor" else {"checks": []})
            for name in outputs
        },
    }
    return write_report(home, summary).as_uri()


@pytest.fixture(params=["light", "dark"])
def open_report(browser, report, request):
    """Open the report in a window of a size, without any request or error."""
    pages, messages = [], []

    def at(size):
        page = browser.new_page()
        pages.append(page)
        page.emulate_media(color_scheme=request.param)
        page.set_viewport_size(dict(zip(("width", "height"), size, strict=True)))
        page.on("pageerror", lambda error: messages.append(str(error)))
        page.on(
            "request",
            lambda r: messages.append(r.url) if r.url.startswith("http") else None,
        )
        page.goto(report)
        page.locator(".players canvas").first.wait_for()
        return page

    yield at
    for page in pages:
        page.close()
    assert messages == []


def top(locator):
    return locator.bounding_box()["y"]


def fits(page):
    return page.evaluate("document.documentElement.scrollWidth <= window.innerWidth")


def test_the_first_screen_is_the_answer(open_report):
    page = open_report(WIDE)
    assert VERDICT in page.locator(".answer").text_content()
    players = page.locator(".players figure[data-ready]")
    assert players.count() == 4
    first = [
        page.locator("h1").first,
        page.locator(".answer"),
        page.locator(".first img").first,
    ]
    assert all(0 <= top(each) < WIDE[1] for each in [*first, *players.all()])
    assert top(page.locator("#claims")) > max(map(top, players.all()))
    assert page.locator(".side").is_visible() and not page.locator(".menu").is_visible()
    page.locator(".side a", has_text="This run").click()
    assert top(page.locator(".side")) == 0, "it stays where it is"


def test_a_phone_shows_all_without_scrolling_to_the_side(open_report):
    page = open_report(NARROW)
    assert not page.locator(".side").is_visible()
    menu = page.locator(".menu")
    menu.locator("summary").click()
    menu.get_by_text("09 passing").click()
    assert menu.get_attribute("open") is None
    table = page.locator("[id='09_passing'] table").first
    assert table.is_visible() and fits(page)
    assert table.evaluate("table => table.scrollWidth > table.clientWidth"), (
        "it scrolls in its own box"
    )
    page.evaluate(
        "document.querySelectorAll('details').forEach((each) => { each.open = true; })"
    )
    assert fits(page)


def test_a_notebook_opens_from_the_menu_and_its_run_plays(open_report):
    page = open_report(WIDE)
    fold = page.locator("[id='10_corridor']")
    assert not fold.locator("figure").is_visible()
    page.locator(".side a", has_text="10 corridor").click()
    fold.locator("figure[data-ready] canvas").first.wait_for()
    assert (
        fold.locator("canvas").nth(1).is_visible()
        and not page.locator(".players canvas").nth(1).is_visible()
    )


def test_headers_are_aligned_with_their_cells(open_report):
    page = open_report(WIDE)
    page.locator(".side a", has_text="09 passing").click()
    sides = page.evaluate("""() => [...document.querySelectorAll('table')].flatMap((table) => {
        const side = (cell) => getComputedStyle(cell).textAlign;
        const [head, row] = [table.tHead?.rows[0], table.tBodies[0].rows[0]];
        return [...head?.cells ?? []].map((cell, i) => [cell.textContent, side(cell), side(row.cells[i])]);
    })""")
    assert all(head == cell for _, head, cell in sides)
    by_name = {name: head for name, head, _ in sides}
    assert (by_name["speed"], by_name["verdict"], by_name["name"]) == (
        "right",
        "left",
        "left",
    )
    assert by_name["a column of numbers, 0"] == "right"


def test_figures_have_a_white_card_at_night(open_report):
    page = open_report(WIDE)
    shades = [
        page.locator(name).first.evaluate(
            "each => getComputedStyle(each).backgroundColor"
        )
        for name in (".first img", ".players figure", "body")
    ]
    is_dark = page.evaluate("matchMedia('(prefers-color-scheme: dark)').matches")
    assert shades[:2] == ["rgb(255, 255, 255)"] * 2
    assert (shades[2] != "rgb(255, 255, 255)") == is_dark
