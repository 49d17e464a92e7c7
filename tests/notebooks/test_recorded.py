"""The recorded laboratory holds the runs of the laboratory, and says why it is too large."""

import base64
import doctest
import json
import re
import zlib

import laboratory
import numpy as np
import pytest
from helpers.recorded_worlds import AXES, make_world
from laboratory import Recording, explain

import szlib
from szlib.workbook import folders


@pytest.fixture(scope="module")
def recording():
    return Recording("Passing", make_world, AXES, longest=4.0)


def test_a_recording_holds_the_steps_and_reasons_of_the_laboratory(recording):
    data = json.loads(zlib.decompress(base64.b64decode(recording.packed)))
    assert [(row["gamma"], row["y"]) for row in recording.table] == [
        (0.05, 0.0),
        (0.05, 0.5),
        (0.3, 0.0),
        (0.3, 0.5),
    ]
    world, run = make_world(0.3, 0.5), data["runs"][3]
    for row in run["rows"]:
        robot, speed, people, h, _, control, *_, sentence, safety = row
        step, reasons = world.steps[0], explain(world.steps[0])
        assert np.allclose(np.array(robot) / 100, step.scene.state[:2], atol=0.0051)
        assert abs(speed / 100 - np.hypot(*step.scene.state[2:])) <= 0.0051
        assert abs(h / 100 - step.h.min()) <= 0.0051
        assert np.allclose(np.array(control) / 100, step.control, atol=0.0051)
        assert people == [[0, 50, 314]]
        assert data["texts"][sentence] == reasons.sentence
        assert data["texts"][safety] == reasons.safety
        for _ in range(data["every"]):
            world.advance()


def test_the_page_needs_no_network_and_has_a_table_of_all_runs(recording):
    page = recording._repr_html_()
    assert len(re.findall("<tr>", page)) == 1 + len(recording.table)
    assert not re.search(r"https?://|<link|src=", page)
    assert "does not arrive" in page


def test_a_recording_that_is_too_large_says_so(monkeypatch):
    monkeypatch.setattr(laboratory.recorded, "LARGEST", 100)
    with pytest.raises(szlib.DataError, match="expected at most 100: record fewer"):
        Recording("Passing", make_world, AXES, longest=0.5)


def test_the_example_runs():
    assert doctest.testmod(laboratory.recorded).failed == 0


@pytest.mark.parametrize("number", ["07", "08", "09", "10", "11", "12"])
def test_a_recording_follows_a_prediction_in_each_chapter(number):
    (script,) = folders.NOTEBOOKS.glob(f"{number}_*.py")
    text = script.read_text(encoding="utf-8")
    place = text.index("# The recorded laboratory")
    assert "**What do you think?**" in text[text.rindex("## Try it", 0, place) : place]
    assert "<summary>Answer</summary>" in text[place : place + 2500]
