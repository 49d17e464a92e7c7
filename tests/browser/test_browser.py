"""The notebooks in a real browser: run, moved by hand, saved; and the report made of them."""

import subprocess

import jupytext
import nbformat
import pytest

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
        """Save, and what is in the file then."""
        self.command("docmanager:save")
        self.page.wait_for_function("!window.jupyterapp.shell.currentWidget.context.model.dirty")
        return nbformat.read(self.file, as_version=4)


@pytest.fixture
def notebook(browser, lab, copy):
    """Opens a notebook by its name."""
    page = browser.new_page(viewport={"width": 1400, "height": 1000})
    page.set_default_timeout(MINUTES)
    yield lambda name: Notebook(page, lab, copy, name)
    page.evaluate("window.jupyterapp.serviceManager.sessions.shutdownAll()")
    page.close()


def errors(saved):
    return [
        out.evalue for cell in saved.cells for out in cell.get("outputs", ()) if out.output_type == "error"
    ]


def in_step(file, saved):
    """The pair says the same, and nothing but outputs has changed since the commit."""
    script = jupytext.read(file.with_suffix(".py"))
    for a, b in zip(saved.cells, script.cells, strict=True):
        assert (a.cell_type, a.source, a.metadata.get("tags")) == (
            b.cell_type,
            b.source,
            b.metadata.get("tags"),
        )
    changed = subprocess.run(
        ["git", "diff", "--stat", "--", "*.py", "pyproject.toml"],
        cwd=file.parent,
        capture_output=True,
        text=True,
    )
    assert changed.stdout == ""


def test_the_laboratory_runs_and_is_dragged(notebook):
    opened = notebook("20_laboratory")
    opened.run()
    page = opened.page
    told = page.locator(".szlib-told")
    assert told.count() == 2
    page.locator(".szlib-run").click()
    page.wait_for_function("parseFloat(document.querySelector('.szlib-told').textContent.slice(4)) > 2")
    page.screenshot(path="/tmp/lab_live.png")
    print(page.locator(".szlib-rate").text_content())
    saved = opened.save()
    assert errors(saved) == []
    in_step(opened.file, saved)
