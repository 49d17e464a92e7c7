"""JupyterLab on a copy of the repository, and a Chromium of this machine to open it in."""

import json
import os
import shutil
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
from pathlib import Path

import jupytext
import nbformat
import pytest
from jupytext.config import load_jupytext_config

ROOT = Path(__file__).parents[2]
BROWSERS = (
    "chromium",
    "chromium-browser",
    "google-chrome",
    "google-chrome-stable",
    "microsoft-edge",
)
CHAPTERS = "chapters"
"""A folder of the copy with the executed chapters."""
REQUIRED = "SZLIB_BROWSER"
"""Set where a browser is required, as in CI: the tests fail without one."""
SETTINGS = {
    "notebook-extension/tracker": {"windowingMode": "none"},
    "apputils-extension/notification": {"fetchNews": "false", "checkForUpdates": False},
}
"""Show every cell on the page, and ask nothing of other servers."""
ELLIPSE = "szlib.Ellipse((0.05, 0.0), (0.97, 0.75))"
GIVEN = {
    "05_zones": f"""from szlib.zones.ellipses import EllipseZone
shape = EllipseZone({{v: {ELLIPSE}.scaled(v) for v in (0.7, 1.1, 1.5)}})
zone = szlib.SocialZone(shape, 2.0, shape.ellipses)""",
    "10_corridor": f"""settings, scenario = szlib.MPCSettings(), szlib.SCENARIOS["corridor"]
zone = {ELLIPSE}
controller = szlib.MPCCBF(zone, walls=scenario.walls, settings=settings)
log = szlib.simulate(scenario, controller)""",
    "13_laboratory": f"zone = {ELLIPSE}",
}
"""A cell in place of those that fit the zone and simulate."""
OPERATED = {
    "05_zones": ("show_sliders(",),
    "10_corridor": ("record.animation(",),
    "13_laboratory": ("Laboratory(zone=zone)",),
}
"""Cells that are operated in the browser, and what they need; `make run` executes the whole notebooks."""


def chromium():
    found = next((path for name in BROWSERS if (path := shutil.which(name))), None)
    if found is None:
        reason = f"no browser on this machine: looked for {', '.join(BROWSERS)}"
        if os.environ.get(REQUIRED):
            pytest.fail(f"{reason}, and {REQUIRED} is set")
        pytest.skip(reason)
    return found


@pytest.fixture(scope="session")
def browser():
    """A context of Chromium, whose pages share what they have loaded."""
    executable = chromium()
    playwright = pytest.importorskip("playwright.sync_api")
    with playwright.sync_playwright() as driver:
        launched = driver.chromium.launch(
            executable_path=executable, args=["--no-sandbox"]
        )
        yield launched.new_context(viewport={"width": 1400, "height": 1000})
        launched.close()


@pytest.fixture(scope="session")
def copy(browser, tmp_path_factory):
    """The package, the notebooks and their settings, as a git repository of their own."""
    folder = tmp_path_factory.mktemp("copy") / "szlib"
    for name in ("szlib", "notebooks"):
        shutil.copytree(
            ROOT / name,
            folder / name,
            ignore=shutil.ignore_patterns("__pycache__", ".*"),
        )
    shutil.copy(ROOT / "pyproject.toml", folder)
    for chapter in (ROOT / "notebooks").glob("*.ipynb"):
        (folder / CHAPTERS).mkdir(exist_ok=True)
        shutil.copy(chapter, folder / CHAPTERS)
    for name in OPERATED:
        shorten(folder / "notebooks" / f"{name}.py")
    for arguments in (["init", "-q"], ["add", "-A"]):
        subprocess.run(["git", *arguments], cwd=folder, check=True)
    author = ["-c", "user.name=szlib", "-c", "user.email=szlib@localhost"]
    subprocess.run(
        ["git", *author, "commit", "-q", "-m", "copy"], cwd=folder, check=True
    )
    return folder


def shorten(script):
    """Leave in a pair its set-up, a given zone, and the cells that are operated."""
    notebook, kept = jupytext.read(script), []
    for cell in notebook.cells:
        is_operated = any(text in cell.source for text in OPERATED[script.stem])
        is_set_up = (
            "parameters" in cell.metadata.get("tags", [])
            or "import" in cell.source.split()
        )
        is_record = "= NotebookRecord(" in cell.source
        if is_record:  # the figure of the set-up takes long
            before, call, rest = cell.source.partition("record = NotebookRecord(")
            cell.source = before + call + rest.partition("\n")[0]
        if is_operated or is_set_up or is_record:
            kept.append(cell)
        if is_record:
            kept.append(nbformat.v4.new_code_cell(GIVEN[script.stem]))
    notebook.cells = [cell for cell in kept if cell.cell_type == "code"]
    settings = load_jupytext_config(str(script))
    for suffix in (".py", ".ipynb"):
        jupytext.write(notebook, script.with_suffix(suffix), config=settings)


@pytest.fixture(scope="session")
def lab(copy):
    """The address of a JupyterLab whose files are those of the copy."""
    home = copy.parent / "jupyter"
    for name, content in SETTINGS.items():
        file = home / "settings" / "@jupyterlab" / f"{name}.jupyterlab-settings"
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(json.dumps(content))
    folders = {
        f"JUPYTER_{name}_DIR": str(home / name.lower())
        for name in ("CONFIG", "RUNTIME")
    }
    folders |= {
        "JUPYTERLAB_SETTINGS_DIR": str(home / "settings"),
        "IPYTHONDIR": str(home / "ipython"),
    }
    folders |= {
        "JUPYTERLAB_WORKSPACES_DIR": str(home / "workspaces"),
        "PYTHONPATH": str(copy),
    }
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    command = [
        sys.executable, "-m", "jupyterlab", "--no-browser", "--allow-root", "--expose-app-in-browser",
        "--ip=127.0.0.1", f"--port={port}", "--ServerApp.port_retries=0", "--IdentityProvider.token=szlib",
        f"--ServerApp.root_dir={copy}",
    ]  # fmt: skip
    log = (copy.parent / "lab.log").open("wb")
    server = subprocess.Popen(
        command, env=os.environ | folders, stdout=log, stderr=log, cwd=copy
    )
    address = f"http://127.0.0.1:{port}"
    try:
        _wait(server, f"{address}/api/status?token=szlib", copy.parent / "lab.log")
        yield address
    finally:
        server.terminate()
        server.wait(30)
        log.close()


def _wait(server, address, log):
    for _ in range(600):
        if server.poll() is not None:
            break
        try:
            with urllib.request.urlopen(address, timeout=5):
                return
        except (urllib.error.URLError, OSError):
            time.sleep(0.2)
    pytest.fail(f"JupyterLab did not start: {log.read_text(errors='replace')[-2000:]}")
