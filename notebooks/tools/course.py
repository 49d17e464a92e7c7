"""Write the navigation cell of every notebook, the routes in 00, and the tables of README.md and reference.md.

    python notebooks/tools/course.py

Titles, questions and reading times come from the notebooks. The rest is in the front matter of each notebook, `szlib`
in the header of its script: label, the section of the paper, aim (what a reader can do afterwards), needs (the chapters
that it builds on), exercises, week, asks (its question in the README) or row (the chapter whose row there it shares).
The words are in glossary.toml. A test checks that everything is up to date.
"""

import math
import os
import re
import textwrap
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import jupytext
import nbformat

from szlib.workbook import folders

HERE = Path(__file__).parents[1]
START = "00_start_here"
REFERENCE, README = HERE / "reference.md", HERE.parent / "README.md"
PAPER = "https://arxiv.org/abs/2405.15101"
WORDS, LINES = 120, 8
"""Words of prose, and lines of visible code, that are read in a minute (assumed)."""
PER_FIGURE, PER_TABLE = 1.5, 1.0
"""Time for a figure or an animation, and for a table or a displayed formula [min] (assumed)."""
FOLD = re.compile(r"<details.*?</details>", re.DOTALL)
FORMULA = re.compile(r"\$\$.+?\$\$", re.DOTALL)
RULED = re.compile(r"^\|[ :|-]+\|$", re.MULTILINE)
"""The line below the header of a Markdown table."""
TASK = re.compile(r"^# ## ((\d\.\d) .*\b(\d+) min\))$", re.MULTILINE)
"""The heading of a task in an exercise sheet."""
TABLE = re.compile(r"^\| notebook \| question \|\n(?:\|.*\n)*\|.*", re.MULTILINE)
"""The table of notebooks in the README."""
HEADING = "**Afterwards you can** "

GLOSSARY: dict[str, dict[str, Any]] = tomllib.loads((HERE / "glossary.toml").read_text(encoding="utf-8"))
LABORATORY, FIRST_SCENE = "13", "07"
"""The laboratory, and the first chapter that links to it."""


TASKS: list[tuple[str, tuple[str, ...]]] = [
    ("Tracks, encounters, and which of them to believe", ("1.1-1.5", "2.1-2.5")),
    ("From samples to a zone; respect or emptiness", ("3.1-3.8",)),
    ("A zone of your own, and a barrier around it", ("4.1-4.3",)),
    ("A controller of your own", ("5.1-5.8",)),
    ("MPC with barriers, and the first meetings", ("6.1-6.5",)),
    ("The robot yields, and drives among people", ("7.1-7.5",)),
]
"""Topic, and tasks of the exercise sheets, of each week; its chapters say so themselves."""
ROUTES: list[tuple[str, tuple[str, ...]]] = [
    ("The idea", ("05", "06", "07", "09", "10", "13")),
    ("The method", ("01", "02", "03", "04", "05", "06", "07", "08", "09", "10", "11", "12")),
]
"""Shorter routes, by number of the notebook."""


# --- reading the notebooks ----------------------------------------------------------------------------


@dataclass(frozen=True)
class Page:
    """A notebook or an exercise sheet: its script, its cells, and its front matter."""

    source: Path
    cells: tuple[nbformat.NotebookNode, ...]
    front: Mapping[str, Any] = field(default_factory=dict)

    @property
    def number(self) -> str:
        """The number, such as "06b"; for an exercise sheet its name."""
        return self.source.stem.split("_")[0] if self.source.stem[0].isdigit() else self.source.stem

    @property
    def is_chapter(self) -> bool:
        """Whether it belongs to the story; others go deeper."""
        return self.source.parent == HERE

    @property
    def title(self) -> str:
        """The title, such as "6 - Barriers"."""
        return self.cells[0].source.splitlines()[0].removeprefix("# ")

    @property
    def question(self) -> str:
        """The question of the notebook, up to the first question mark."""
        text = self.cells[0].source.partition("**Question.**")[2].partition("**Expectation.**")[0]
        asked, mark, _ = " ".join(text.split()).partition("?")
        return asked + mark

    @property
    def prose(self) -> list[str]:
        """The texts of the markdown cells, without the navigation."""
        texts = [cell.source for cell in self.cells if cell.cell_type == "markdown"]
        return [text for text in texts if HEADING not in text]

    @property
    def outputs(self) -> list[dict[str, str]]:
        """The outputs of the executed copy, by type; without a copy the figures that the code stores."""
        copy = self.source.with_suffix(".ipynb")
        if copy.exists():
            cells = nbformat.read(copy, as_version=4).cells
            return [each.get("data", {}) for cell in cells for each in cell.get("outputs", ())]
        code = " ".join(cell.source for cell in self.cells if cell.cell_type == "code")
        return [{"image/png": ""}] * len(re.findall(r"record\.(?:figure|animation)\(", code))

    @property
    def minutes(self) -> int:
        """Reading time, rounded up to 5 minutes [min]; hidden code and folded tables take none."""
        outputs = self.outputs
        texts = [*self.prose, *(each.get("text/markdown", "") for each in outputs)]
        shown = [FOLD.sub("", each.get("text/html", "")) for each in outputs]
        words = sum(len(re.findall(r"[^\W_]\S*", FORMULA.sub("", text))) for text in texts)
        figures = sum("image/png" in each for each in outputs)
        figures += sum(text.count("<video") + text.count("data:image/gif") for text in shown)
        tables = sum(text.count("<table") for text in shown)
        tables += sum(len(RULED.findall(FOLD.sub("", text))) + len(FORMULA.findall(text)) for text in texts)
        needed = words / WORDS + self._visible_lines / LINES + PER_FIGURE * figures + PER_TABLE * tables
        return 5 * math.ceil(needed / 5)

    @property
    def _visible_lines(self) -> int:
        code = [cell for cell in self.cells if cell.cell_type == "code"]
        shown = [cell.source for cell in code if not cell.metadata.get("jupyter", {}).get("source_hidden")]
        return sum(bool(line.strip()) for text in shown for line in text.splitlines())


def pages() -> list[Page]:
    """The notebooks in reading order."""
    return [_page(source) for source in folders.list_notebooks(HERE)]


def _page(source: Path) -> Page:
    notebook = jupytext.read(source)
    return Page(source, tuple(notebook.cells), notebook.metadata.get("szlib", {}))


def first_uses(story: list[Page]) -> dict[str, str]:
    """The number of the first notebook that uses each word of the glossary; unused words are left out."""
    found: dict[str, str] = {}
    for page in story:
        if page.source.stem == START:
            continue
        code = [cell.source for cell in page.cells if cell.cell_type == "code"]
        text = " ".join(" ".join([*page.prose, *code]).split())
        for word, entry in GLOSSARY.items():
            pattern = entry.get("pattern", rf"\b{re.escape(word)}\b")
            if re.search(pattern, text, 0 if word[:2].isupper() else re.I):
                found.setdefault(word, page.number)
    return found


# --- making the cells ---------------------------------------------------------------------------------


def make_navigation(page: Page, story: list[Page], uses: dict[str, str]) -> str:
    """The navigation cell of a notebook: a line of facts, then what it gives, and its new words."""
    at = [each.number for each in story].index(page.number)
    before, after = (
        [p for p in part if p.is_chapter == page.is_chapter] for part in (story[:at], story[at + 1 :])
    )
    places = [f"[Start]({'' if page.is_chapter else '../'}{START}.ipynb)"] if at > 1 else []
    places += [f"before: {_number_link(each, page)}" for each in before[-1:]]
    places += [f"next: {_link(each, page)}" for each in after[:1]]
    places += [f"[paper]({PAPER}): {page.front['paper']}", f"{page.minutes} min"]
    places += [f"needs {_number_link(p, page)}" for p in story if p.number in page.front.get("needs", ())]
    tasks = [_task_link(each, page) for each in page.front.get("exercises", ())]
    places += [f"exercises: {', '.join(tasks)}"] if tasks else []
    if page.is_chapter and FIRST_SCENE <= page.number < LABORATORY:
        places += [f"laboratory: {_number_link(p, page)}" for p in after if p.number == LABORATORY]
    new = sorted(
        (word for word, number in uses.items() if number == page.number and GLOSSARY[word].get("new", True)),
        key=str.lower,
    )
    words = "; ".join(f"*{word}*: {GLOSSARY[word]['means']}" for word in new)
    gives = f"{HEADING}{page.front['aim']}" + (f" **Words.** {words}." if new else "")
    return f"{_wrapped(' · '.join(places))}\n\n{_wrapped(gives)}"


def make_sheet_navigation(name: str) -> str:
    """The navigation cell of an exercise sheet, the same in both folders."""
    names = sorted({sheet for sheet, _, _ in tasks().values()})
    at = names.index(name)
    places = [f"[Start](../{START}.ipynb)"]
    places += [f"before: [sheet {each[5]}]({each}.ipynb)" for each in names[max(at - 1, 0) : at]]
    places += [f"next: [sheet {each[5]}]({each}.ipynb)" for each in names[at + 1 : at + 2]]
    places += [f"[to do](../exercises/{name}.ipynb)", f"[solved](../solutions/{name}.ipynb)"]
    places += [_time(sum(minutes for sheet, _, minutes in tasks().values() if sheet == name))]
    here = _page(HERE / "solutions" / f"{name}.py")
    owners = [p for p in pages() if any(each[0] == name[5] for each in p.front.get("exercises", ()))]
    places += [f"belongs to {', '.join(_number_link(each, here) for each in owners)}"]
    return _wrapped(" · ".join(places))


@cache
def tasks() -> dict[str, tuple[str, str, int]]:
    """The sheet, the heading and the time [min] of each task, by its number, such as "5.1"."""
    found = {}
    for sheet in sorted((HERE / "solutions").glob("sheet*.py")):
        for heading, number, minutes in TASK.findall(sheet.read_text(encoding="utf-8")):
            found[number] = sheet.stem, heading, int(minutes)
    return found


def expand(tasks_of: str) -> list[str]:
    """The numbers of the tasks in a range: "5.1-5.3" is 5.1, 5.2 and 5.3."""
    first, _, last = tasks_of.partition("-")
    sheet, start = first.split(".")
    return [f"{sheet}.{number}" for number in range(int(start), int((last or first).split(".")[1]) + 1)]


def _task_link(tasks_of: str, start: Page) -> str:
    """A range of tasks as a link to the first of them."""
    sheet, heading, _ = tasks()[expand(tasks_of)[0]]
    folder = Path(os.path.relpath(HERE / "exercises", start.source.parent)).as_posix()
    return f"[{tasks_of}]({folder}/{sheet}.ipynb#{heading.replace(' ', '-')})"


def _number_link(page: Page, start: Page) -> str:
    return f"[{page.number}]({_path(page, start)})"


def _wrapped(text: str) -> str:
    return textwrap.fill(text, 106, break_long_words=False, break_on_hyphens=False)


def _link(page: Page, start: Page) -> str:
    return f"[{page.title}]({_path(page, start)})"


def _path(page: Page, start: Page) -> str:
    """The path of a page, as a link in the page `start` names it."""
    return Path(os.path.relpath(page.source.with_suffix(".ipynb"), start.source.parent)).as_posix()


def make_map(story: list[Page]) -> str:
    """The section of the reference that lists every notebook."""
    rows = ["## The map", "", "| notebook | question | to read |", "|---|---|---|"]
    rows += [
        f"| {_link(p, story[0])} | {p.question} | {p.minutes} min |" for p in story if p.source.stem != START
    ]
    return "\n".join(rows)


def weeks(story: list[Page]) -> list[tuple[str, tuple[str, ...], tuple[str, ...]]]:
    """Topic, chapters and tasks of the exercise sheets of each week."""
    return [
        (topic, tuple(page.number for page in story if page.front.get("week") == week), ranges)
        for week, (topic, ranges) in enumerate(TASKS, 1)
    ]


def make_table(story: list[Page]) -> str:
    """The table of the README: a row for each notebook that asks a question, with those that share the row."""
    lines = ["| notebook | question |", "|---|---|"]
    owners = {page.number: page for page in story if "asks" in page.front}
    for page in story:
        row = page.front.get("row")
        if (row or page.number) not in owners and page.source.stem != START:
            expected = f"`asks`, or as `row` one of {', '.join(map(repr, owners))}"
            raise ValueError(f"{page.source.name}: row is {row!r}; expected {expected}")
    for page in owners.values():
        sharing = [each for each in story if each.front.get("row") == page.number]
        names = [f"[{p.number} {p.front['label']}](notebooks/{_path(p, story[0])})" for p in [page, *sharing]]
        lines.append(f"| {', '.join(names)} | {page.front['asks']} |")
    return "\n".join(lines)


def make_routes(story: list[Page]) -> str:
    """The cell of 00 with the three routes."""
    rows = ["## Three routes", ""]
    for name, numbers in ROUTES:
        links, minutes = _links_and_time(story, numbers)
        rows.append(f"- **{name}.** {links}: {minutes} to read.")
    rows.append(
        "- **The course, in six weeks.** Reading and exercises; running and looking around come on top."
    )
    rows += ["", "| week | topic | notebooks | to read | exercises | to do |", "|---|---|---|---|---|---|"]
    for week, (topic, numbers, ranges) in enumerate(weeks(story), 1):
        links, minutes = _links_and_time(story, numbers)
        work = _time(sum(tasks()[each][2] for part in ranges for each in expand(part)))
        to_do = ", ".join(_task_link(each, story[0]) for each in ranges)
        rows.append(f"| {week} | {topic} | {links} | {minutes} | {to_do} | {work} |")
    return "\n".join(rows)


def _links_and_time(story: list[Page], numbers: tuple[str, ...]) -> tuple[str, str]:
    """Links to notebooks, and the time to read them."""
    chosen = [page for page in story if page.number in numbers]
    links = ", ".join(_number_link(page, story[0]) for page in chosen)
    return links, _time(sum(page.minutes for page in chosen))


def _time(minutes: int) -> str:
    """A time as text, in minutes or in hours and minutes."""
    hours, left = divmod(minutes, 60)
    return f"{hours} h {left:02} min" if hours else f"{left} min"


def make_glossary(story: list[Page], uses: dict[str, str]) -> str:
    """The section of the reference with every word in use, its meaning, and the first notebook that uses it."""
    by_number = {page.number: page for page in story}
    rows = ["## Words", "", "| word | meaning | first used in |", "|---|---|---|"]
    for word in sorted(uses, key=str.lower):
        page = by_number[uses[word]]
        rows.append(f"| {word} | {GLOSSARY[word]['means']} | {_number_link(page, story[0])} |")
    return "\n".join(rows)


# --- writing the scripts ------------------------------------------------------------------------------


def replace_cells(script: str, cells: dict[str, str], navigation: str) -> str:
    """Replace the navigation of a notebook, its second cell, and the cells with these headings.

    `script` is the notebook as a percent script, `cells` the new text by heading, `navigation` the new
    navigation. Returns the script.
    """
    header, title, *rest = re.split(r"^(?=# %%)", script, flags=re.MULTILINE)
    if rest and (HEADING in rest[0] or f"[Start](../{START}" in rest[0]):
        rest = rest[1:]
    for heading, text in cells.items():
        (at,) = [i for i, cell in enumerate(rest) if cell.startswith(f"# %% [markdown]\n# {heading}\n")]
        rest[at] = _cell(text)
    return "".join([header, title, _cell(navigation), *rest])


def replace_section(text: str, section: str) -> str:
    """Replace the section of the Markdown `text` that has the heading of the new `section`."""
    heading = re.escape(section.partition("\n")[0])
    old = re.compile(rf"^{heading}\n.*?(?=^## |\Z)", re.MULTILINE | re.DOTALL)
    if len(old.findall(text)) != 1:
        raise ValueError(f"{heading} must be a heading once in {REFERENCE.name}")
    return old.sub(lambda _: f"{section}\n\n", text)


def _cell(text: str) -> str:
    return "\n".join(["# %% [markdown]", *(f"# {line}".rstrip() for line in text.split("\n"))]) + "\n\n"


def make_scripts() -> dict[Path, str]:
    """The text of every script of the course, and of the reference, with up-to-date navigation and lists."""
    story = pages()
    uses, scripts = first_uses(story), {}
    scripts[REFERENCE] = REFERENCE.read_text(encoding="utf-8")
    for section in (make_map(story), make_glossary(story, uses)):
        scripts[REFERENCE] = replace_section(scripts[REFERENCE], section)
    readme = README.read_text(encoding="utf-8")
    scripts[README] = TABLE.sub(lambda _: make_table(story), readme)
    routes = {"## Three routes": make_routes(story)}
    for page in story:
        own = routes if page.source.stem == START else {}
        text = page.source.read_text(encoding="utf-8")
        scripts[page.source] = replace_cells(text, own, make_navigation(page, story, uses))
    for source in sorted((HERE / "solutions").glob("*.py")):
        scripts[source] = replace_cells(
            source.read_text(encoding="utf-8"), {}, make_sheet_navigation(source.stem)
        )
    return scripts


def write_scripts() -> None:
    """Update every script; twice, since the lists in 00 add to the time to read 00."""
    for _ in range(2):
        for source, text in make_scripts().items():
            if source.read_text(encoding="utf-8") != text:
                print(source.name)
                source.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    write_scripts()
