"""The notebooks in a real browser: executed, operated by hand and saved; and their report."""

import subprocess

import jupytext
import nbformat
import pytest
from helpers.hostile_results import make_hostile_results

from szlib.files import claim_folder
from szlib.workbook.report import write_report

MINUTES = 60_000
COMMANDS = "window.jupyterapp.commands"


class Notebook:
    """A notebook in a page of JupyterLab."""

    def __init__(self, page, address, copy, name):
        self.page, self.file = page, copy / "notebooks" / f"{name}.ipynb"
        page.goto(f"{address}/doc/tree/notebooks/{name}.ipynb?token=szlib")
        page.wait_for_selector(".jp-Notebook .jp-CodeCell", timeout=2 * MINUTES)
        page.wait_for_function("window.jupyterapp?.shell.currentWidget?.sessionContext?.isReady")

    def command(self, name):
        self.page.evaluate(f"{COMMANDS}.execute('{name}')")

    def run(self):
        """Run all cells, to the end."""
        session = "window.jupyterapp.shell.currentWidget.sessionContext.session"
        self.page.wait_for_function(f"{session}?.kernel?.status === 'idle'", timeout=MINUTES)
        self.page.evaluate("() => { window.done = false; }")
        finished = ".then(() => { window.done = true; })"
        self.page.evaluate(f"() => {{ {COMMANDS}.execute('notebook:run-all-cells'){finished}; }}")
        self.page.wait_for_function("window.done", timeout=4 * MINUTES)

    def save(self):
        """Save, and return the content of the file."""
        self.command("docmanager:save")
        self.page.wait_for_function("!window.jupyterapp.shell.currentWidget.context.model.dirty")
        return nbformat.read(self.file, as_version=4)


@pytest.fixture
def notebook(browser, lab, copy):
    """Open a notebook by its name."""
    page = browser.new_page()
    page.set_default_timeout(MINUTES)
    yield lambda name: Notebook(page, lab, copy, name)
    page.evaluate("window.jupyterapp.serviceManager.sessions.shutdownAll()")
    page.close()


def errors(saved):
    return [
        out.evalue for cell in saved.cells for out in cell.get("outputs", ()) if out.output_type == "error"
    ]


def check_pair(file, saved):
    """Check that the pair agrees, and that only outputs have changed since the commit."""
    script = jupytext.read(file.with_suffix(".py"))
    for a, b in zip(saved.cells, script.cells, strict=True):
        assert (a.cell_type, a.source, a.metadata.get("tags")) == (
            b.cell_type,
            b.source,
            b.metadata.get("tags"),
        )
    changed = subprocess.run(
        ["git", "diff", "--stat", "--", file.with_suffix(".py").name],
        cwd=file.parent,
        capture_output=True,
        text=True,
    )
    assert changed.stdout == ""


def picture(locator):
    """The picture on a canvas."""
    return locator.evaluate("canvas => canvas.toDataURL()")


def test_an_exercise_is_solved(notebook, copy):
    """An answer is checked, and saved into both files of the pair."""
    solved = jupytext.read(copy / "notebooks" / "solutions" / "sheet5_barriers.py")
    (answer,) = (c.source for c in solved.cells if c.source.startswith("def focal_distance"))
    opened = notebook("exercises/sheet5_barriers")
    opened.page.locator(".jp-CodeCell .cm-content", has_text="def focal_distance").click()
    opened.page.keyboard.press("Control+a")
    opened.page.keyboard.insert_text(answer)
    opened.run()
    saved = opened.save()
    assert errors(saved) == []
    outputs = {c.source: str(c.outputs) for c in saved.cells if c.cell_type == "code"}
    assert "passed - focal_distance" in outputs['judges.check("focal_distance", focal_distance)']
    assert "not yet - wall_distance" in outputs['judges.check("wall_distance", wall_distance)']
    assert answer in [cell.source for cell in jupytext.read(opened.file.with_suffix(".py")).cells]


def test_a_slider_of_the_zones_draws_another_speed(notebook):
    opened = notebook("05_zones")
    opened.run()
    shown = opened.page.locator(
        ".jupyter-widgets.widget-output img, .jupyter-widgets .jp-OutputArea img"
    ).last
    shown.wait_for(timeout=MINUTES)
    before = shown.get_attribute("src")
    opened.page.locator(".widget-slider .noUi-handle").last.press("ArrowRight")
    opened.page.wait_for_function(
        "before => [...document.querySelectorAll('.jupyter-widgets img')].some((i) => i.src !== before)",
        arg=before,
    )
    saved = opened.save()
    assert errors(saved) == []
    check_pair(opened.file, saved)


def test_a_run_plays_in_its_notebook_and_in_the_report(notebook, browser, copy):
    opened = notebook("10_corridor")
    opened.run()
    check_player(opened.page)
    saved = opened.save()
    assert errors(saved) == []
    check_pair(opened.file, saved)
    home = claim_folder(copy.parent / "run", "results of mine")
    nbformat.write(saved, home / "10_corridor.ipynb")
    page, messages = browser.new_page(), []
    page.on("console", lambda message: messages.append(message.text))
    page.on("pageerror", lambda error: messages.append(str(error)))
    page.on("request", lambda r: messages.append(r.url) if r.url.startswith("http") else None)
    page.goto(write_report(home).as_uri())
    check_player(page)
    broken = page.evaluate("[...document.images].filter((i) => !i.complete || !i.naturalWidth).length")
    assert (messages, broken) == ([], 0)
    page.close()


def test_nothing_of_a_hostile_folder_runs_in_its_report(browser, tmp_path):
    report, page, asked = write_report(make_hostile_results(tmp_path)), browser.new_page(), []
    page.add_init_script("window.attack = () => { window.attacked = true; }")
    page.on("request", lambda request: asked.append(request.url))
    page.goto(report.as_uri())
    page.evaluate("document.querySelectorAll('a, button, summary').forEach((each) => each.click())")
    page.wait_for_timeout(200)
    assert page.evaluate("window.attacked") is None
    assert [url for url in asked if not url.startswith(("data:", report.as_uri()))] == []
    assert page.url.partition("#")[0] == report.as_uri()
    page.close()


def check_player(page):
    """Check that the first player starts, stops, and shows the time it is set to."""
    player = page.locator("figure.szlib-player").first
    player.scroll_into_view_if_needed()
    slider, canvas = player.locator("input[type=range]"), player.locator("canvas").first
    begin, shown = slider.input_value(), picture(canvas)
    player.get_by_role("button").click()
    page.wait_for_function(
        "begin => Number(document.querySelector('figure.szlib-player input').value) > Number(begin)",
        arg=begin,
    )
    player.get_by_role("button").click()
    assert picture(canvas) != shown
    slider.fill("0")
    assert "t = 0.0 s" in player.text_content()


def test_the_laboratory_is_dragged_set_run_and_shared(notebook):
    opened = notebook("13_laboratory")
    opened.run()
    page, status = opened.page, opened.page.locator(".szlib-status")
    page.wait_for_function("[...document.querySelectorAll('.szlib-status')].every(e => e.textContent)")
    scenes = [panel.locator("canvas").first for panel in page.locator(".szlib-panel").all()]
    before = [picture(scene) for scene in scenes]
    scenes[0].scroll_into_view_if_needed()
    box = scenes[0].bounding_box()

    def drag(start, end):
        """With the mouse, from one place of the scene to another [m]; 29.7 pixels are a metre."""
        (x0, y0), (x1, y1) = (
            (box["x"] + 200.2 + 29.7 * x, box["y"] + 90 - 29.7 * y) for x, y in (start, end)
        )
        page.mouse.move(x0, y0)
        page.mouse.down()
        page.mouse.move(x1, y1, steps=5)
        page.mouse.up()

    drag((4, 0), (1.34, -0.33))  # the person, who stands before the goal
    drag((4, 0), (5, -1))  # the goal
    drag((7, 2.3), (6, 1.5))  # a wall's end
    slider = page.locator("input[name=gamma]").first
    slider.click(position={"x": 60, "y": 8})
    gamma = float(slider.input_value())
    assert gamma > 0.1
    assert all(picture(scene) != shown for scene, shown in zip(scenes, before, strict=True))
    page.locator(".szlib-share").click()
    page.wait_for_function("document.querySelector('.szlib-cell').value.length")
    shared = {}
    exec(page.locator(".szlib-cell").input_value(), shared)
    assert shared["gamma"] == gamma
    assert shared["person"][:2] == pytest.approx([1.34, -0.33], abs=0.1)
    assert shared["goal"] == pytest.approx([5, -1], abs=0.1)
    assert shared["walls"][:4] == pytest.approx([-6, 2.3, 6, 1.5], abs=0.1)
    page.locator(".szlib-run").click()
    page.wait_for_function("parseFloat(document.querySelector('.szlib-status').textContent.slice(4)) > 2")
    print(page.locator(".szlib-rate").text_content())
    page.locator(".szlib-run").click()
    assert page.locator(".szlib-error").text_content() == "" and status.count() == 2
    saved = opened.save()
    assert errors(saved) == []
    check_pair(opened.file, saved)
