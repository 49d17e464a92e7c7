"""The guide for lecturers agrees with the course: its weeks, chapters, commands and links."""

import importlib.util
import re

import pytest

from szlib.workbook import folders

GUIDE = (folders.NOTEBOOKS / "for_lecturers.md").read_text(encoding="utf-8")
WEEKS = re.findall(r"^## Week (\d): ([^\n]+)\n(.*?)(?=^## )", GUIDE, flags=re.M | re.S)


def _tool(name):
    spec = importlib.util.spec_from_file_location(
        name, folders.NOTEBOOKS / "tools" / f"{name}.py"
    )
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


course = _tool("course")


def test_the_weeks_are_those_of_the_course():
    for (number, topic, text), (expected, chapters, _) in zip(
        WEEKS, course.weeks(course.pages()), strict=True
    ):
        assert topic == expected, f"week {number}"
        first = text.strip().splitlines()[0]
        assert tuple(re.findall(r"\[(\d\d)\]", first)) == chapters, f"week {number}"


def test_every_week_takes_about_as_long_as_the_guide_says():
    assert "about three hours beside the lecture" in GUIDE
    minutes, pages = (
        course.tasks(),
        {page.number: page.minutes for page in course.pages()},
    )
    for topic, chapters, ranges in course.weeks(course.pages()):
        tasks = [task for each in ranges for task in course.expand(each)]
        work = sum(pages[chapter] for chapter in chapters) + sum(
            minutes[task][2] for task in tasks
        )
        assert 150 <= work <= 225, f"{topic}: {work} min"


@pytest.mark.parametrize("week", WEEKS, ids=lambda week: week[0])
def test_each_week_has_goals_misconceptions_of_each_chapter_and_questions(week):
    number, _, text = week
    assert "**Goals.**" in text
    rows = re.findall(
        r"^\| (?!misconception|---)([^|]+) \| ([^|]+) \| ([^|]+) \|$", text, flags=re.M
    )
    assert {where[:2] for _, _, where in rows} == set(
        course.weeks(course.pages())[int(number) - 1][1]
    )
    assert 2 <= len(re.findall(r"^\d\. \*.+\?\*", text, flags=re.M)) <= 3


@pytest.mark.parametrize("week", WEEKS, ids=lambda week: week[0])
def test_a_misconception_is_corrected_in_a_section_that_exists(week):
    rows = re.findall(
        r"^\| (?!\d)[^|]+ \| [^|]+ \| (\d\d), ([^|;]+?)(?:;[^|]*)? \|$", week[2], re.M
    )
    sources = {page.number: page.source for page in course.pages()}
    for number, section in rows:
        text = sources[number].read_text(encoding="utf-8")
        headings = [each.lower() for each in re.findall(r"^# ##+ (.+)$", text, re.M)]
        assert section in headings, f"{number}, {section}"


@pytest.mark.slow
@pytest.mark.parametrize("week", WEEKS, ids=lambda week: week[0])
def test_each_week_has_a_plan_of_90_minutes(week):
    """Minutes follow each other; a scene is a section of a chapter of the week, a task or the project."""
    number, _, text = week
    chapters = course.weeks(course.pages())[int(number) - 1][1]
    rows = re.findall(
        r"^\| (\d+)-(\d+) \| ([^|]+) \| ([^|]+\?[^|]*) \| ([^|]+) \|$", text, re.M
    )
    ends = [(int(start), int(end)) for start, end, *_ in rows]
    assert [start for start, _ in ends] == [0, *(end for _, end in ends[:-1])]
    assert ends[-1][1] == 90
    headings = {
        f"{page.number}, {line.lstrip('# ')}"
        for page in course.pages()
        for prose in page.prose
        for line in prose.splitlines()
        if line.startswith("##") and page.number in chapters
    }
    tasks = {
        task
        for part in course.TASKS[int(number) - 1][1]
        for task in course.expand(part)
    }
    others = {f"sheet {task[0]}, task {task}" for task in tasks}
    others |= {"00, the two pictures", "the project"}
    assert {place for _, _, place, *_ in rows} <= headings | others


def test_links_lead_somewhere_and_tasks_exist():
    links = re.findall(r"\]\((?!http)([^)#]+)\)", GUIDE)
    assert [link for link in links if not (folders.NOTEBOOKS / link).exists()] == []
    sheets = "".join(
        file.read_text("utf-8")
        for file in (folders.NOTEBOOKS / "solutions").glob("*.py")
    )
    for task in re.findall(
        r"\b([1-7]\.\d)(?:-\d\.\d)?\b(?= and|, a zone|,\n| and|\. What)", GUIDE
    ):
        assert f"# ## {task} " in sheets, task
    assert (
        sheets.count("# **Rubric**")
        == 7
        == len(list((folders.NOTEBOOKS / "exercises").glob("sheet*.py")))
    )


def test_commands_exist():
    sheets = folders.NOTEBOOKS / "tools" / "sheets.py"
    assert '"--class"' in sheets.read_text("utf-8")
    makefile = (folders.NOTEBOOKS.parent / "Makefile").read_text("utf-8")
    assert set(re.findall(r"`make (\w+)", GUIDE)) <= set(
        re.findall(r"^(\w+):", makefile, flags=re.M)
    )
    assert f"of at most\n   {_tool('slides').MAX_CODE} lines" in GUIDE
