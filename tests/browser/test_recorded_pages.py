"""The recorded laboratory in a real browser, from a file: no kernel, no network, wide and narrow screens."""

import pytest
from helpers.recorded_worlds import AXES, make_world
from laboratory import Recording

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    file = tmp_path_factory.mktemp("page") / "recorded.html"
    head = '<meta charset="utf-8"><meta name="viewport" content="width=device-width">'
    recording = Recording("Passing", make_world, AXES, longest=6.0)
    file.write_text(f"<!doctype html>{head}<body>{recording._repr_html_()}", "utf-8")
    return file


@pytest.mark.parametrize("width", [1300, 390])
def test_a_recording_is_operated_by_keys_sliders_and_touch(browser, file, width):
    page, faults = browser.new_page(), []
    page.on("pageerror", lambda error: faults.append(str(error)))
    page.on("request", lambda r: r.url.startswith("file:") or faults.append(r.url))
    page.set_viewport_size({"width": width, "height": 900})
    page.goto(file.as_uri())
    page.wait_for_selector(".szlib-recorded-why")
    status, why = ".szlib-recorded-status", ".szlib-recorded-why"
    page.focus(".szlib-recorded")
    for _ in range(3):
        page.keyboard.press("ArrowRight")
    assert page.text_content(status).startswith("t = 0.6 s")
    page.keyboard.press("ArrowLeft")
    assert page.text_content(status).startswith("t = 0.4 s")
    page.click(".szlib-recorded-step")
    assert page.text_content(status).startswith("t = 0.6 s")
    reasons = set()
    for value in range(0, 31, 3):
        page.fill(".szlib-recorded-time", str(value))
        reasons.add(page.text_content(why))
    assert len(reasons) > 3
    before = page.text_content(status)
    page.fill(".szlib-axis-gamma", "1")
    assert page.text_content(status) != before
    label = page.get_attribute(".szlib-recorded-scene", "aria-label")
    assert label.startswith("Passing: t = ")
    page.fill(".szlib-recorded-time", "0")
    page.click(".szlib-recorded-play")
    page.wait_for_function(
        f"!document.querySelector('{status}').textContent.startsWith('t = 0.0')"
    )
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert not faults
    page.close()
