"""Numbers in the texts of chapters 03 to 12 are made by a cell of the chapter, or computed here."""

import math
import re

import jupytext
import nbformat
import numpy as np
import pytest

from szlib.plaza.settings import WINDOW
from szlib.workbook import folders

CHAPTERS = [
    source
    for source in folders.list_notebooks()
    if "03" <= source.stem[:2] <= "12" and source.parent == folders.NOTEBOOKS
]
NUMBER = re.compile(r"(?<![\w.])\d[\d,]*(?:\.\d+)?")
NO_QUANTITY = re.compile(
    r"\[\d\d\]\([^)]*\)|\]\([^)]*\)"  # a link to a notebook, or the target of another one
    r"|\b(?:chapters?|notebooks?|eq\.|sec\.|fig\.|tasks?|ch\.) [\d., \[\]and-]*\d"
    r"|\b(?:19|20)\d\d(?:-\d\d-\d\d)?\b"  # years and dates
)
BY_HAND = {
    "03": {
        "80": 100 * 8 / 10,
        "7": 10 - 3,
        "8": 10 - 2,
        "40": 8 / 0.2,  # 8 samples are 20 % of them
        "16,181": 16_181,  # of the paper, sec. 2
    },
    "04": {"0.6": 2 - 1.4, "0.8": 2 - 1.2, "1.2": 1.2, "1.4": 1.4},  # r_max - r
    "05": {
        **{f"{each:.2f}": each for each in (0.28, 0.31, 0.73, 0.74, 0.75, 0.76, 0.77)},
        "0.80": 0.8,  # nearest approaches: see the last test
        "80": 40 + 40,
        "12": 12,  # hours of the day: the train file of hour 12 is thinned
        "13": 13,
        "92": 92,  # days of the paper
    },
    "06": {
        "0.6": 0.6,
        "3.4": WINDOW,
        "4.58": math.sqrt(100 * 0.3 * 0.7),
        "4.4": 20 / math.sqrt(100 * 0.3 * 0.7),
        "40": 2 / 0.05,
        "80": 80,  # minutes of the video of Grand Central
    },
    "07": {"0.37": math.exp(-1)},
    "08": {"1.41": math.sqrt(2), "1.5": 2 * (1 - 0.25)},
    "12": {"1,024": 2**10, "1.3": 0.75 + 0.5 + 0.05},  # zone to a side, robot, margin
}
"""Numbers of worked examples and of sources: as the text states them, and their values."""


def read_numbers(text):
    return {float(each.replace(",", "")) for each in NUMBER.findall(text)}


def read_made(source):
    """The numbers in the code of a chapter and in what its executed copy shows; also as shares in percent."""
    texts = [c.source for c in jupytext.read(source).cells if c.cell_type == "code"]
    copy = nbformat.read(source.with_suffix(".ipynb"), as_version=4)
    for output in (out for cell in copy.cells for out in cell.get("outputs", ())):
        data = output.get("data", {})
        texts += [output.get("text", ""), data.get("text/plain", "")]
        texts += [data.get("text/markdown", ""), data.get("text/html", "")[:20_000]]
    made = read_numbers(re.sub(r"<[^>]*>", " ", "\n".join(texts)))
    return {round(factor * each, 6) for each in made for factor in (0.01, 1, 100)}


@pytest.mark.parametrize("source", CHAPTERS, ids=lambda source: source.stem)
def test_each_number_in_the_text_of_a_chapter_has_a_source(source):
    made, by_hand = read_made(source), BY_HAND.get(source.stem[:2], {})
    texts = [
        NO_QUANTITY.sub("", cell.source)
        for cell in jupytext.read(source).cells
        if cell.cell_type == "markdown" and "**Afterwards you can**" not in cell.source
    ]
    found = {each for text in texts for each in NUMBER.findall(text)}
    unknown = [
        each
        for each in sorted(found)
        if (value := float(each.replace(",", ""))) not in made
        and not (value <= 3 and value.is_integer())
        and each not in by_hand
    ]
    assert unknown == []


@pytest.mark.parametrize("chapter", BY_HAND)
def test_numbers_by_hand_are_rounded_correctly(chapter):
    for stated, value in BY_HAND[chapter].items():
        digits = len(stated.partition(".")[2])
        assert round(value, digits) == float(stated.replace(",", ""))


def test_the_quantile_of_the_worked_example_stays():
    """Chapter 05: forty people, then forty more; the radius is that of the second, then of the fourth."""
    first = [0.31, 0.74, 0.75, 0.77, 0.80] + [1.0] * 35
    more = [0.28, 0.73, 0.76] + [1.0] * 37
    found = [
        np.quantile(each, 0.05, method="inverted_cdf") for each in (first, first + more)
    ]
    assert found == [0.74, 0.74]
