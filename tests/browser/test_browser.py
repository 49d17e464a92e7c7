"""The notebooks in a real browser: executed, operated by hand and saved; and their report."""

import json
import subprocess

import jupytext
import nbformat
import pytest
from laboratory import Laboratory

import szlib
from szlib.workbook.report import write_report

pytestmark = pytest.mark.slow

MINUTES = 60_000
COMMANDS = "window.jupyterapp.commands"


class Notebook:
    """A notebook in a page of JupyterLab."""

    def __init__(self, page, address, copy, name):
        self.page, self.file = page, copy / "notebooks" / f"{name}.ipynb"
        page.goto(f"{address}/doc/tree/notebooks/{name}.ipynb?token=szlib")
        page.wait_for_selector(".jp-Notebook .jp-CodeCell", timeout=2 * MINUTES)
        page.wait_for_function(
            "window.jupyterapp?.shell.currentWidget?.sessionContext?.isReady"
        )

    def command(self, name):
        self.page.evaluate(f"{COMMANDS}.execute('{name}')")

    def run(self):
        """Run all cells, to the end."""
        session = "window.jupyterapp.shell.currentWidget.sessionContext.session"
        self.page.wait_for_function(
            f"{session}?.kernel?.status === 'idle'", timeout=MINUTES
        )
        self.page.evaluate("() => { window.done = false; }")
        finished = ".then(() => { window.done = true; })"
        self.page.evaluate(
            f"() => {{ {COMMANDS}.execute('notebook:run-all-cells'){finished}; }}"
        )
        self.page.wait_for_function("window.done", timeout=4 * MINUTES)

    def save(self):
        """Save, and return the content of the file."""
        self.command("docmanager:save")
        self.page.wait_for_function(
            "!window.jupyterapp.shell.currentWidget.context.model.dirty"
        )
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
        out.evalue
        for cell in saved.cells
        for out in cell.get("outputs", ())
        if out.output_type == "error"
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


WIDTH, HEIGHT = 1300, 900
FIRST_PICTURE = """async (path) => {
    const { commands, shell } = window.jupyterapp;
    const kernelPreference = { shouldStart: false, canStart: false, autoStartDefault: false };
    const { node, content } = await commands.execute("docmanager:open", { path, kernelPreference });
    const shown = () => [...node.querySelectorAll(".jp-Notebook img, .jp-Notebook canvas")]
        .filter((each) => (each.complete ?? true) && each.getBoundingClientRect().width > 100);
    const wait = () => new Promise((done) => setTimeout(done, 150));
    const measure = () => [shown()[0], node].flatMap((each) => {
        const { top, bottom } = each.getBoundingClientRect();
        return [top, bottom];
    });
    for (let i = 0; i < 100 && !shown().length; i++) await wait();
    let place = measure();
    for (let i = 0, before = []; i < 50 && String(place) !== String(before); i++) {
        before = place;
        await wait();
        place = measure();
    }
    await commands.execute("application:close");
    return place;
}"""


def test_the_first_picture_of_each_chapter_is_in_the_first_screen(browser, lab, copy):
    """At 1300 x 900, with the file browser open, 95 % of the first picture are seen without scrolling."""
    page = browser.new_page()
    page.set_viewport_size({"width": WIDTH, "height": HEIGHT})
    page.goto(f"{lab}/lab/tree/chapters?token=szlib")
    page.wait_for_function(
        "window.jupyterapp?.shell.currentWidget", timeout=2 * MINUTES
    )
    chapters = sorted((copy / "chapters").glob("*.ipynb"))
    places = {
        each.stem: page.evaluate(FIRST_PICTURE, f"chapters/{each.name}")
        for each in chapters
    }
    print({name: [round(at) for at in place] for name, place in places.items()})
    page.close()
    shown = {
        name: (screen - top) / (bottom - top)
        for name, (top, bottom, _, screen) in places.items()
    }
    assert {
        name: round(share, 2) for name, share in shown.items() if share < 0.95
    } == {}


def picture(locator):
    """The picture on a canvas."""
    return locator.evaluate("canvas => canvas.toDataURL()")


def natural_size(image):
    return image.evaluate("image => [image.naturalWidth, image.naturalHeight]")


def test_an_exercise_is_solved(notebook, copy):
    """An answer is checked, and saved into both files of the pair."""
    solved = jupytext.read(copy / "notebooks" / "solutions" / "sheet5_barriers.py")
    (answer,) = (
        c.source for c in solved.cells if c.source.startswith("def focal_distance")
    )
    opened = notebook("exercises/sheet5_barriers")
    opened.page.locator(
        ".jp-CodeCell .cm-content", has_text="def focal_distance"
    ).click()
    opened.page.keyboard.press("Control+a")
    opened.page.keyboard.insert_text(answer)
    opened.run()
    saved = opened.save()
    assert errors(saved) == []
    outputs = {c.source: str(c.outputs) for c in saved.cells if c.cell_type == "code"}
    assert (
        "passed - focal_distance"
        in outputs['judges.check("focal_distance", focal_distance)']
    )
    assert (
        "not yet - wall_distance"
        in outputs['judges.check("wall_distance", wall_distance)']
    )
    assert answer in [
        cell.source for cell in jupytext.read(opened.file.with_suffix(".py")).cells
    ]


def test_a_slider_of_the_zones_draws_another_speed(notebook):
    opened = notebook("05_zones")
    opened.run()
    shown = opened.page.locator("img.widget-image")
    shown.wait_for(timeout=MINUTES)
    opened.page.wait_for_function(
        "document.querySelector('img.widget-image').naturalWidth > 0"
    )
    before, size = shown.get_attribute("src"), natural_size(shown)
    opened.page.locator(".widget-slider .noUi-handle").last.press("ArrowRight")
    opened.page.wait_for_function(
        "before => document.querySelector('img.widget-image').src !== before",
        arg=before,
    )
    opened.page.wait_for_function(
        "document.querySelector('img.widget-image').naturalWidth > 0"
    )
    assert shown.count() == 1 and natural_size(shown) == size, (
        "one picture, which keeps its size"
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
    home = copy.parent / "run"
    home.mkdir()
    nbformat.write(saved, home / "10_corridor.ipynb")
    outcome = {"status": "done", "seconds": 1.0, "checks": []}
    summary = {"data": "hall", "files": [], "parameters": {}}
    summary["notebooks"] = {"10_corridor": outcome}
    page, messages = browser.new_page(), []
    page.on("console", lambda message: messages.append(message.text))
    page.on("pageerror", lambda error: messages.append(str(error)))
    page.on(
        "request",
        lambda r: messages.append(r.url) if r.url.startswith("http") else None,
    )
    page.goto(write_report(home, summary).as_uri())
    check_player(page)
    broken = page.evaluate(
        "[...document.images].filter((i) => !i.complete || !i.naturalWidth).length"
    )
    assert (messages, broken) == ([], 0)
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


def open_laboratory(page, lab):
    """The page of a `Laboratory` without JupyterLab: its messages are answered by this process."""
    page.expose_function(
        "answer",
        lambda request: json.loads(json.dumps(lab.answer(request), allow_nan=False)),
    )
    page.set_content("<div id=lab></div>")
    page.evaluate(
        """async ([script, content]) => {
            const file = new Blob([script], { type: "text/javascript" });
            const { default: widget } = await import(URL.createObjectURL(file));
            let receive;
            const send = (request) => answer(request).then((found) => receive(found));
            const model = { get: () => content, on: (_, f) => { receive = f; }, off: () => {}, send };
            widget.render({ model, el: document.getElementById("lab") });
        }""",
        [lab._esm, lab.content],
    )
    page.wait_for_function("document.querySelector('.szlib-why').textContent")


@pytest.fixture
def lab_page(browser):
    """A laboratory, and its page, which must report no error."""
    page, problems = browser.new_page(), []
    page.set_default_timeout(MINUTES)
    page.on("console", lambda message: problems.append(message.text))
    page.on("pageerror", lambda error: problems.append(str(error)))
    lab = Laboratory(zone=szlib.Ellipse((0.05, 0.0), (0.97, 0.75)))
    open_laboratory(page, lab)
    yield lab, page
    assert problems == []
    page.close()


def drag(page, start, end):
    """With the mouse, from one place of the corridor to another [m]."""
    box = page.locator(".szlib-lab-scene").bounding_box()
    scale = (600 - 40) / 14.6  # the corridor with its margins is 14.6 m long
    (x0, y0), (x1, y1) = (
        (
            box["x"] + 300 + scale * (x - 0.5),
            box["y"] + (box["height"] - 20) / 2 - scale * y,
        )
        for x, y in (start, end)
    )
    page.mouse.move(x0, y0)
    page.mouse.down()
    page.mouse.move((x0 + x1) / 2, (y0 + y1) / 2)
    page.mouse.move(x1, y1)
    page.mouse.up()


def settle(page, condition):
    page.wait_for_function(f"() => {condition}")


def take_steps(page, n):
    for _ in range(n):
        before = page.locator(".szlib-time").get_attribute("max")
        page.locator(".szlib-step").click()
        settle(page, f"document.querySelector('.szlib-time').max !== '{before}'")


def test_the_laboratory_goes_back_and_on(lab_page):
    lab, page = lab_page
    take_steps(page, 25)
    assert "It keeps its speed" in page.locator(".szlib-why").text_content()
    shown = picture(page.locator(".szlib-lab-scene"))
    page.locator(".szlib-time").fill("0")
    settle(
        page,
        "document.querySelector('.szlib-why').textContent.startsWith('It sets off')",
    )
    assert lab.world.n == 25, "to look at the past changes nothing"
    page.locator(".szlib-step").click()
    settle(
        page,
        "document.querySelector('.szlib-status').textContent.startsWith('t = 0.1 s')",
    )
    page.locator(".szlib-time").fill("25")
    settle(
        page,
        "document.querySelector('.szlib-status').textContent.startsWith('t = 2.5 s')",
    )
    assert picture(page.locator(".szlib-lab-scene")) == shown
    page.locator(".szlib-time").fill("10")
    page.locator("input[name=gamma]").fill("0.2")
    settle(page, "document.querySelector('.szlib-time').max === '10'")
    assert (lab.world.n, lab.world.robots[0].changes) == (10, {"gamma": 0.2})
    page.locator(".szlib-play").click()
    settle(page, "Number(document.querySelector('.szlib-time').max) > 14")
    page.locator(".szlib-reset").click()
    settle(page, "document.querySelector('.szlib-time').max === '0'")


def test_the_laboratory_is_dragged_and_shared(lab_page):
    lab, page = lab_page
    take_steps(page, 3)
    drag(page, (3.85, 0.0), (1.0, -0.5))
    page.wait_for_timeout(300)
    person = lab.world.people[0]
    assert person.position == pytest.approx((1.0, -0.5), abs=0.1)
    x, y = person.position
    drag(page, (x - 1.0, y), (x, y + 1.5))
    page.wait_for_timeout(300)
    assert lab.world.people[0].velocity == pytest.approx((0.0, 1.0), abs=0.1)
    page.locator(".szlib-add").click()
    settle(
        page,
        "document.querySelector('.szlib-remove').textContent === 'remove person 1'",
    )
    page.locator(".szlib-second").select_option("MPCSettings.among_people")
    settle(
        page,
        "document.querySelector('.szlib-rival').textContent.startsWith('Second robot')",
    )
    take_steps(page, 2)
    page.locator(".szlib-share").click()
    settle(page, "document.querySelector('.szlib-code').value.length")
    shared = {}
    exec(page.locator(".szlib-code").input_value(), shared)
    controls = [shared[name].controls[-1].tolist() for name in ("log", "log_b")]
    assert controls == [step.control.tolist() for step in lab.world.steps]
    page.locator(".szlib-remove").click()
    settle(
        page,
        "document.querySelector('.szlib-remove').textContent === 'remove person 0'",
    )


def test_a_goal_beside_a_wall_is_named_and_a_13th_person_refused(lab_page):
    lab, page = lab_page
    before = picture(page.locator(".szlib-lab-scene"))
    drag(page, (7.0, 2.3), (7.0, 2.3))
    page.locator(".szlib-remove").click()  # the person, who stands on the goal
    settle(page, "document.querySelector('.szlib-remove').disabled")
    drag(page, (4.0, 0.0), (4.0, 2.2))
    notes = "document.querySelector('.szlib-notes').textContent"
    settle(page, f"{notes}.includes('cannot be reached')")
    assert lab.world.scenario.goal == pytest.approx([4.0, 2.2], abs=0.1)
    page.locator(".szlib-reset").click()
    settle(page, f"!{notes}.includes('cannot be reached')")
    assert picture(page.locator(".szlib-lab-scene")) == before
    for n in range(1, 12):
        page.locator(".szlib-add").click()
        settle(
            page,
            f"document.querySelector('.szlib-remove').textContent === 'remove person {n}'",
        )
    full = picture(page.locator(".szlib-lab-scene"))
    assert full != before
    page.locator(".szlib-add").click()
    settle(
        page,
        "document.querySelector('.szlib-error').textContent.includes('number of people')",
    )
    assert len(lab.world.people) == 12
    assert picture(page.locator(".szlib-lab-scene")) == full


def test_the_laboratory_runs_in_its_notebook(notebook):
    opened = notebook("13_laboratory")
    opened.run()
    page = opened.page
    settle(page, "document.querySelector('.szlib-why')?.textContent")
    page.locator(".szlib-play").click()
    settle(
        page,
        "parseFloat(document.querySelector('.szlib-status').textContent.slice(4)) > 1",
    )
    page.locator(".szlib-play").click()
    assert page.locator(".szlib-error").text_content() == ""
    saved = opened.save()
    assert errors(saved) == []
    check_pair(opened.file, saved)
