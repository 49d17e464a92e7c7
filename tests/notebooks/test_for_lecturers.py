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
        r"^\| (?!misconception|---)(.+) \| (.+) \| (.+) \|$", text, flags=re.M
    )
    assert {where[:2] for _, _, where in rows} == set(
        course.weeks(course.pages())[int(number) - 1][1]
    )
    assert 2 <= len(re.findall(r"^\d\. \*.+\?\*", text, flags=re.M)) <= 3


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
    sheets, slides = (
        folders.NOTEBOOKS / "tools" / f"{name}.py" for name in ("sheets", "slides")
    )
    assert '"--class"' in sheets.read_text(
        "utf-8"
    ) and '"--reveal"' in slides.read_text("utf-8")
    makefile = (folders.NOTEBOOKS.parent / "Makefile").read_text("utf-8")
    assert "$(SLIDES_FLAGS)" in makefile
    assert set(re.findall(r"`make (\w+)", GUIDE)) <= set(
        re.findall(r"^(\w+):", makefile, flags=re.M)
    )
    version = re.findall(r"reveal\.js@([\d.]+)", slides.read_text("utf-8"))
    assert f"reveal.js@{version[0]} && tar xf reveal.js-{version[0]}.tgz" in GUIDE
    assert f"of at most\n   {_tool('slides').MAX_CODE} lines" in GUIDE
