"""Slides: which cells start one, what of a cell is shown, and decks that ask no server."""

import importlib.util
import re

import nbformat
import pytest
from bs4 import BeautifulSoup
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook, new_output

from szlib.workbook import folders


def _slides():
    spec = importlib.util.spec_from_file_location(
        "slides", folders.NOTEBOOKS / "tools" / "slides.py"
    )
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


slides = _slides()
PNG = (  # one pixel
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNk+M9QDwADhgGAWjR9awAAAABJRU5ErkJggg=="
)
FIGURE = new_output("display_data", {"image/png": PNG})
SENTENCE = new_output("display_data", {"text/markdown": "**What we know now.** 1 m."})
CHECK = new_output("stream", text="check: the zone has a size [m]: holds (1 m)\n")
TABLE = new_output(
    "execute_result", {"text/html": "<table><tr><td>1</td></tr></table>"}
)
HIDDEN = {"jupyter": {"source_hidden": True}}


def make(*cells):
    """The parts of the slides of these cells: kind and cell."""
    made = slides.make_slides(
        new_notebook(cells=[new_markdown_cell("# 7 - Barriers"), *cells])
    )
    return [(cell.metadata.slideshow.slide_type, cell) for cell in made.cells[1:]]


def test_the_title_and_each_heading_start_a_slide():
    cells = [
        new_markdown_cell("# T\n\n**Question.** Why?"),
        new_markdown_cell("## A\n\none\n\n## B\n### C\n\ntwo"),
    ]
    made = slides.make_slides(new_notebook(cells=cells))
    kinds = [
        (cell.metadata.slideshow.slide_type, cell.source.splitlines()[0])
        for cell in made.cells
    ]
    starts = [
        ("slide", "# T"),
        ("-", "**Question.** Why?"),
        ("slide", "## A"),
        ("-", "one"),
        ("slide", "## B"),
    ]
    assert kinds == [*starts, ("-", "### C"), ("-", "two")]


def test_a_hidden_cell_shows_its_figures_and_sentences_without_its_code():
    code = new_code_cell(
        "draw()", metadata=HIDDEN, outputs=[CHECK, TABLE, FIGURE, SENTENCE]
    )
    (_, figure), (_, sentence) = make(code)
    assert figure.outputs == [FIGURE] and figure.metadata.transient.remove_source
    assert sentence.source == "**What we know now.** 1 m."


@pytest.mark.parametrize(("lines", "is_shown"), [(12, True), (13, False)])
def test_visible_code_is_shown_up_to_twelve_lines(lines, is_shown):
    parts = make(
        new_code_cell("\n".join(["x = 1"] * lines), outputs=[CHECK, FIGURE, TABLE])
    )
    shown = [cell for _, cell in parts if cell.source]
    assert bool(shown) == is_shown
    assert [FIGURE] in [cell.outputs for _, cell in parts], (
        "the figure is shown in any case"
    )
    assert ([TABLE] in [cell.outputs for _, cell in parts]) == is_shown
    assert not is_shown or shown[0].outputs == [CHECK]


def test_parameters_long_tables_and_long_prints_are_left_out():
    table = new_output(
        "execute_result", {"text/html": "<table>" + "<tr></tr>" * 10 + "</table>"}
    )
    prints = new_output("stream", text="a\n" * 13)
    ((_, cell),) = make(
        new_code_cell("seed = 0", metadata={"tags": ["parameters"]}),
        new_code_cell("f()", outputs=[table, prints]),
    )
    assert cell.source == "f()" and cell.outputs == []


def test_the_text_of_a_fold_appears_at_a_key_press():
    text = "Guess.\n\n<details><summary>Answer</summary>\n\nOne.\n\nTwo.\n\n</details>\n\nSo."
    expected = [("-", "Guess."), ("fragment", "**Answer.** One.\n\nTwo."), ("-", "So.")]
    assert [
        (kind, cell.source) for kind, cell in make(new_markdown_cell(text))
    ] == expected
    output = new_output("display_data", {"text/markdown": text})
    parts = make(new_code_cell("f()", metadata=HIDDEN, outputs=[output]))
    assert [(kind, cell.source) for kind, cell in parts] == expected, (
        "also where a hidden cell has made it"
    )


def test_the_table_of_a_fold_stays_a_table():
    table = "| a |\n|---|\n| 1 |"
    ((_, cell),) = make(
        new_markdown_cell(
            f"<details><summary>Answer</summary>\n\n{table}\n\n</details>"
        )
    )
    assert cell.source == f"**Answer.**\n\n{table}"


def test_the_navigation_is_a_note():
    assert (
        make(new_markdown_cell("35 min\n\n**Afterwards you can** see."))[0][0]
        == "notes"
    )


def test_what_does_not_fit_goes_on_below_under_the_same_heading():
    text = "## Theory\n\n" + "\n\n".join(
        f"Paragraph {i}. " + "word " * 60 for i in range(9)
    )
    parts = make(new_markdown_cell(text))
    more = [cell.source for kind, cell in parts if kind == "subslide"]
    assert more and set(more) == {"## Theory (continued)"}
    assert sum("Paragraph" in cell.source for _, cell in parts) == 9, "nothing is lost"


def test_blocks_keep_code_and_formulas_whole():
    blocks = ["a\nb", "$$\nx\n\ny\n$$", "```python\nx\n\ny\n```", "$$z$$", "- 1\n- 2"]
    assert slides.split_blocks("\n\n".join(blocks)) == blocks


def test_figures_have_the_names_of_the_run():
    code = new_code_cell(
        'record.figure(fig, "zone")\nrecord.figure(ax.figure, "hull")',
        outputs=[FIGURE, FIGURE],
    )
    notebook = new_notebook(cells=[code, new_code_cell("plot()", outputs=[FIGURE])])
    names = ["05_zones-zone.png", "05_zones-hull.png", "05_zones-figure-3.png"]
    assert list(slides.list_figures(notebook, "05_zones")) == names


def test_a_chapter_becomes_a_deck_that_asks_no_server():
    stem = "07_barriers"
    notebook = nbformat.read(folders.NOTEBOOKS / f"{stem}.ipynb", as_version=4)
    made = slides.make_slides(notebook)
    deck = slides.export(made, stem, {stem, "08_build_a_controller"})
    page = BeautifulSoup(deck, "html.parser")
    asked = [
        tag.get("src") or tag.get("href")
        for tag in page.select("script[src], link[href], img[src]")
    ]
    assert [each for each in asked if not each.startswith("data:")] == []
    assert "@import" not in deck and "Reveal.initialize" in deck
    headings = [
        c.source
        for c in notebook.cells
        if c.cell_type == "markdown" and c.source.startswith("#")
    ]
    assert len(page.select(".slides > section")) == len(headings)
    assert len(page.select(".slides img")) == len(slides.list_figures(notebook, stem))
    assert page.select("math") and "$$" not in page.select_one(".slides").get_text()
    links = {
        link["href"]
        for link in page.select(".slides a[href]")
        if ".html" in link["href"]
    }
    assert links <= {"07_barriers.html", "08_build_a_controller.html"}


def test_a_half_full_slide_ends_before_the_next_idea():
    filler = "\n\n".join("word " * 60 for _ in range(3))
    question = "**What do you think?** Which one?"
    parts = make(new_markdown_cell(f"## Theory\n\n{filler}\n\n{question}"))
    kinds = [kind for kind, _ in parts]
    assert kinds[-2:] == ["subslide", "-"] and parts[-1][1].source == question


def test_a_handout_has_no_hidden_code_and_no_answers(monkeypatch):
    printed = []
    monkeypatch.setattr(
        slides.HandoutExporter,
        "run_playwright",
        lambda self, html: printed.append(html) or b"%PDF",
    )
    fold = "Guess.\n\n<details><summary>Answer</summary>\n\nOne.\n\n</details>"
    text = new_output("display_data", {"text/markdown": fold})
    hidden = new_code_cell("draw()", metadata=HIDDEN, outputs=[CHECK, FIGURE, text])
    cells = [new_markdown_cell(f"# T\n\n{fold}"), hidden, new_code_cell("x = 1")]
    notebook = new_notebook(cells=cells)
    assert slides.make_handout(notebook, "07_barriers") == b"%PDF"
    page = BeautifulSoup(printed[0], "html.parser").select_one("main")
    shown = page.get_text()
    assert "Guess." in shown and "x = 1" in shown and page.select("img")
    assert not re.search(r"Answer|One\.|draw|check:", shown)


@pytest.mark.slow
def test_decks_and_figures_are_written_to_one_folder(tmp_path):
    slides.main(["10", "--out", str(tmp_path / "slides")])
    made = {file.name for file in (tmp_path / "slides").glob("10_*")}
    handout = {"10_corridor.pdf"} if slides.find_browser() else set()
    assert made == {"10_corridor.html"} | handout
    figures = list((tmp_path / "slides" / "figures").iterdir())
    assert figures and all(file.name.startswith("10_corridor-") for file in figures)
    assert all(file.read_bytes().startswith(b"\x89PNG") for file in figures)
