"""Navigation and maps of the course: links, reading times, and words explained at their first use."""

import importlib.util
import re
from collections import Counter

import jupytext
import nbformat
import pytest
from judges import ESSAY_MINUTES, SHEETS

import szlib
from szlib.workbook import folders


def _course():
    spec = importlib.util.spec_from_file_location(
        "course", folders.NOTEBOOKS / "tools" / "course.py"
    )
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


course = _course()
STORY = course.pages()
WEEKS = course.weeks(STORY)
REFERENCE = course.REFERENCE.read_text(encoding="utf-8")
FOLDERS = tuple(
    folders.NOTEBOOKS / part for part in ("", "deeper", "exercises", "solutions")
)
TIME = re.compile(r"(\d+ h )?\d+\s(#\s)?min\b")


def without_times(text):
    """The text on one line without reading times, which may differ a little."""
    return " ".join(TIME.sub("T min", text).replace("\n#", " ").split())


@pytest.fixture(scope="module")
def scripts():
    return course.make_scripts()


# --- navigation and maps -----------------------------------------------------------------------------


def test_navigation_and_maps_are_up_to_date(scripts):
    stale = [
        s.name
        for s, text in scripts.items()
        if without_times(text) != without_times(s.read_text(encoding="utf-8"))
    ]
    assert stale == [], "python notebooks/tools/course.py"


@pytest.mark.parametrize("page", STORY, ids=lambda p: p.source.stem)
def test_navigation_states_reading_time_and_aim(page):
    (navigation,) = [c.source for c in page.cells if course.HEADING in c.source]
    assert page.cells[1].source == navigation
    (minutes,) = re.findall(r"·\s(\d+)\smin\b", navigation)
    assert abs(int(minutes) - page.minutes) <= 5, "python notebooks/tools/course.py"
    assert re.search(
        r"\[paper\]\(https://arxiv.org/abs/2405.15101\):\s(all|sec)", navigation
    )


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda f: f.name)
def test_every_link_has_a_target(folder):
    for source in folder.glob("*[0-9]*_*.py"):
        prose = [
            c.source for c in jupytext.read(source).cells if c.cell_type == "markdown"
        ]
        links = re.findall(r"\]\(([^)#]+)[)#]", "\n".join(prose))
        files = [(folder / link) for link in links if not link.startswith("http")]
        # copies without a script
        recorded = [file for file in files if file.parent.name == "real_day"]
        files = [
            f.with_suffix(".py") if f.suffix == ".ipynb" and f not in recorded else f
            for f in files
        ]
        missing = [file.name for file in files if not file.exists()]
        assert missing == [], source.name


def test_the_course_reads_every_notebook_and_does_every_task_once():
    numbers = Counter(number for _, numbers, _ in WEEKS for number in numbers)
    assert set(numbers.values()) == {1}
    assert set(numbers) == {page.number for page in STORY if page.is_chapter} - {"00"}
    done = Counter(
        task
        for _, _, ranges in WEEKS
        for part in ranges
        for task in course.expand(part)
    )
    assert done == dict.fromkeys(course.tasks(), 1)
    assert len(WEEKS) == 6


def test_every_task_belongs_to_one_notebook_and_comes_after_it():
    owners = {
        n: [t for part in parts for t in course.expand(part)]
        for n, parts in ((p.number, p.front.get("exercises", ())) for p in STORY)
        if parts
    }
    belongs = Counter(task for tasks in owners.values() for task in tasks)
    assert belongs == dict.fromkeys(course.tasks(), 1)
    assert set(owners) <= {page.number for page in STORY}
    unread = {page.number for page in STORY if page.is_chapter}
    for _, numbers, ranges in WEEKS:
        unread -= set(numbers)
        early = {
            n
            for n, tasks in owners.items()
            for part in ranges
            if set(tasks) & set(course.expand(part))
        }
        assert not early & unread


def test_tasks_and_times_are_those_of_the_judges():
    for sheet, tasks in SHEETS.items():
        found = [
            minutes for name, _, minutes in course.tasks().values() if name == sheet
        ]
        assert found == [*(task.minutes for task in tasks), ESSAY_MINUTES]


def test_weeks_take_about_the_same_time():
    minutes = {page.number: page.minutes for page in STORY}
    times = [
        sum(minutes[n] for n in numbers)
        + sum(
            course.tasks()[task][2] for part in ranges for task in course.expand(part)
        )
        for _, numbers, ranges in WEEKS
    ]
    assert max(times) <= 1.6 * min(times), times


def test_what_a_notebook_needs_is_an_earlier_chapter():
    order = [page.number for page in STORY]
    for page in STORY:
        for needed in page.front.get("needs", ()):
            assert order.index(needed) < order.index(page.number)


# --- reading times -----------------------------------------------------------------------------------


def write_page(folder, *cells, outputs=()):
    """A page with these cells, and an executed copy whose one code cell has these outputs."""
    script = "\n\n".join(["# %% [markdown]\n# # 1 - A", *cells])
    (folder / "01_a.py").write_text(script, encoding="utf-8")
    if outputs:
        copy = nbformat.v4.new_notebook()
        shown = [nbformat.v4.new_output("display_data", data=data) for data in outputs]
        copy.cells = [nbformat.v4.new_code_cell("x = 1", outputs=shown)]
        nbformat.write(copy, folder / "01_a.ipynb")
    return course.Page(
        folder / "01_a.py", tuple(jupytext.reads(script, fmt="py:percent").cells)
    )


CODE = "\n".join(["x = 1"] * 79)
IMAGE, TABLE = (
    {"image/png": "aGk="},
    {"text/html": "<div><table><tr><td>1</td></tr></table></div>"},
)
FOLDED = {"text/html": f"<details><summary>All</summary>{TABLE['text/html']}</details>"}


@pytest.mark.parametrize(
    ("cell", "minutes"),
    [
        ("# %% [markdown]\n# " + "word " * 1190, 10),
        (f"# %%\n{CODE}", 10),
        (f'# %% jupyter={{"source_hidden": true}}\n{CODE}', 5),
        ("# %%\n" + "record.figure(axes, 'a')\n" * 6, 10),
        ("# %% [markdown]\n" + "# | a |\n# |---|\n# | 1 |\n#\n" * 9, 10),
        (
            "# %% [markdown]\n# <details>\n#\n"
            + "# | a |\n# |---|\n# | 1 |\n#\n" * 9
            + "# </details>",
            5,
        ),
        ("# %% [markdown]\n" + "# $$\n# h = d - r\n# $$\n#\n" * 9, 10),
    ],
    ids=[
        "words",
        "code",
        "hidden code",
        "figures",
        "tables",
        "folded tables",
        "formulas",
    ],
)
def test_reading_time_of_cells(cell, minutes, tmp_path):
    assert write_page(tmp_path, cell).minutes == minutes


@pytest.mark.parametrize(
    ("output", "minutes"),
    [
        (IMAGE, 15),
        ({"text/html": "<video src='a'></video>"}, 15),
        ({"text/html": '<img src="data:image/gif;base64,R0"/>'}, 15),
        (TABLE, 10),
        (FOLDED, 5),
        ({"text/markdown": "word " * 110}, 10),
    ],
    ids=["figure", "video", "animation", "table", "folded table", "words"],
)
def test_reading_time_of_nine_outputs(output, minutes, tmp_path):
    assert write_page(tmp_path, outputs=[output] * 9).minutes == minutes


def test_figures_are_counted_in_the_executed_copy(tmp_path):
    code = "# %%\n" + "record.figure(axes, 'a')\n" * 8
    assert write_page(tmp_path, code).minutes == 15
    assert write_page(tmp_path, code, outputs=[IMAGE]).minutes == 5


# --- words, symbols, references ----------------------------------------------------------------------


@pytest.mark.parametrize("word", ["class K", "SQP", "exact penalty", "EWAP", "tidy"])
def test_word_is_explained_at_its_first_use(word):
    first = course.first_uses(STORY)[word]
    (page,) = [page for page in STORY if page.number == first]
    means = course.GLOSSARY[word]["means"]
    assert f"*{word}*: {means}" in " ".join(page.cells[1].source.split())
    before = STORY[1 : STORY.index(page)]
    assert not any(
        re.search(rf"\b{word}\b", text) for each in before for text in each.prose
    )


def test_every_symbol_has_its_name_in_code():
    table = REFERENCE.partition("## Symbols")[2].partition("\n## ")[0]
    names = re.findall(r"`szlib\.([\w.]+)`", table)
    assert len(names) > 15
    for name in names:
        found = szlib
        for part in name.split("."):
            found = getattr(found, part)


def test_parameters_in_the_reference_are_those_of_szlib():
    ours, paper = szlib.MPCSettings(), szlib.MPCSettings.paper()
    stated = [
        (
            "limit (Euclidean) | 0.1 s; 8; 2; 1 m/s | paper",
            ("dt", "N", "N_h", "v_max"),
            (0.1, 8, 2, 1),
        ),
        ("| 0.5 m; 0.05 m; `MPCSettings()` keeps", ("r_robot", "eps"), (0.5, 0.05)),
        ("| gamma | 0.05 | tuned", ("gamma",), (0.05,)),
        (
            "| diag(10, 10, 1, 1); I; 10 Q |",
            ("Q", "R", "P"),
            ((10, 10, 1, 1), (1, 1), (100, 100, 10, 10)),
        ),
        ("axis | 1 m/s² | assumed", ("a_max",), (1,)),
        ("passed | right |", ("pass_side",), ("right",)),
    ]
    for text, names, values in stated:
        assert text in REFERENCE
        assert tuple(getattr(ours, name) for name in names) == values
        if text.endswith("paper") or "eps" in names:
            assert tuple(getattr(paper, name) for name in names) == values


def test_every_link_of_the_reference_has_a_target():
    for link in re.findall(r"\]\((?!http)([^)#]+)", REFERENCE):
        assert (folders.NOTEBOOKS / link).exists(), link


def test_a_section_that_is_missing_is_named():
    with pytest.raises(ValueError, match="must be a heading once"):
        course.replace_section("# A\n", "## The map\n")


def test_every_reference_has_a_doi_or_says_that_there_is_none():
    entries = (
        REFERENCE.partition("## References")[2].partition("\n## ")[0].split("\n- ")[1:]
    )
    assert len(entries) >= 10
    for entry in entries:
        assert "https://doi.org/10." in entry or "(no DOI)" in entry, entry
        for shown, link in re.findall(
            r"\[(10\.[^\]]+)\]\(https://doi\.org/([^)]+)\)", entry
        ):
            assert shown == link


def test_only_the_navigation_is_replaced():
    script = "# ---\n# ---\n\n# %% [markdown]\n# # 1 - A\n\n# %%\nx = 1\n"
    navigation = f"5 min\n\n{course.HEADING}x"
    once = course.replace_cells(script, {}, navigation)
    cell = f"# %% [markdown]\n# 5 min\n#\n# {course.HEADING}x\n\n"
    assert once == script.replace("# %%\nx", f"{cell}# %%\nx")
    assert course.replace_cells(
        once, {}, navigation.replace("5", "10")
    ) == once.replace("5 min", "10 min")


@pytest.mark.parametrize("front", [{"row": "29"}, {"row": "29", "asks": "Why?"}, {}])
def test_a_notebook_without_a_row_in_the_readme_is_refused(front):
    """It asks a question of its own, or names the number of a notebook that does."""
    source = folders.NOTEBOOKS / "deeper" / "30_topic.py"
    page = course.Page(source, STORY[1].cells, {"label": "topic"} | front)
    found = f"30_topic.py: row is {front.get('row')!r}; expected `asks`, or as `row`"
    with pytest.raises(ValueError, match=f"{found} one of '01', '02', "):
        course.make_table([*STORY, page])
