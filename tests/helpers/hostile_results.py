"""A folder of results that another person has made to harm the reader of its report."""

from __future__ import annotations

import json
from html import escape
from pathlib import Path

import nbformat
import pandas as pd

from szlib.core.files import claim_folder

BAD = (
    '"><img src=x onerror=attack()><script>attack()</script><svg onload=attack()>'
    '<a href="javascript:attack()">'
)
"""Text that runs a script in each of these ways, if any place lets it through."""
MARKUP = f"""{BAD}<iframe src="http://127.0.0.1:9/x" srcdoc="<script>parent.attack()</script>"></iframe>
<style>@import "http://127.0.0.1:9/style.css"; * {{ background: url(http://127.0.0.1:9/b) }}</style>
<meta http-equiv="refresh" content="0;url=http://127.0.0.1:9/m"><base href="http://127.0.0.1:9/">
<link rel="stylesheet" href="http://127.0.0.1:9/l.css"><img src="http://127.0.0.1:9/i.png" style="width:99px">
<object data="http://127.0.0.1:9/o"></object><form action="http://127.0.0.1:9/f"><button onclick=attack()>
<math><mtext><table><mglyph><style><!--</style><img title="--&gt;&lt;img src=1 onerror=attack()&gt;">
<a href="data:text/html,<script>attack()</script>">x</a><body onload=attack()>
<div id=top autofocus onfocus=attack() tabindex=1>
<figure class="szlib-player" data-run="constructor"></figure>"""
PLAYER = """<figure class="szlib-player" data-run="szlib-00000000"><img alt="x"></figure><script>(() => {
const run = {"alt":"</script><img src=x onerror=attack()>","snapshots":3};
const figures = document.querySelectorAll('[data-run=szlib-00000000]:not([data-ready])');
})()</script>"""


def make_hostile_results(folder: Path) -> Path:
    """Make such a folder, marked as results."""
    home = claim_folder(folder / f"run{BAD.replace('/', '')}", "results of mine")
    output, stream = nbformat.v4.new_output, {"name": "stdout", "text": BAD}
    data = {
        "text/html": MARKUP + PLAYER, "text/markdown": MARKUP, "text/plain": BAD, "text/latex": BAD,
        "image/svg+xml": f"<svg xmlns='http://www.w3.org/2000/svg' onload='attack()'>{BAD}</svg>",
        "image/jpeg": BAD, "image/png": BAD, "application/javascript": "attack()",
        "text/vnd.mermaid": BAD, "application/vnd.jupyter.widget-view+json": {"model_id": BAD},
    }  # fmt: skip
    spoiled = {
        "image/png": {"alt": BAD, "width": BAD},
        "image/jpeg": {"width": "1 onerror=attack()"},
    }
    outputs = [
        output("display_data", {kind: data[kind]}, metadata=spoiled) for kind in data
    ]
    outputs += [
        output("stream", **stream),
        output("error", ename=BAD, evalue=BAD, traceback=[BAD]),
    ]
    formula = r"$\text{<img/src=x/onerror=attack()>}$"
    cells = [
        nbformat.v4.new_markdown_cell(
            f"# 8\n\n**Question.** {BAD}\n\n{formula}\n\n{MARKUP}\n\n![{BAD}](x)"
        ),
        nbformat.v4.new_markdown_cell(
            "![p](/etc/passwd) ![q](../../../../../../etc/passwd) [x](javascript:attack())"
        ),
        nbformat.v4.new_raw_cell(MARKUP, metadata={"raw_mimetype": "text/html"}),
        nbformat.v4.new_code_cell(
            BAD, outputs=outputs, metadata={"tags": [BAD.replace(",", "")]}
        ),
    ]
    page = nbformat.v4.new_notebook(
        cells=cells, metadata={"title": BAD, "widgets": {"x": BAD}}
    )
    nbformat.write(page, home / f"10_corridor{BAD.replace('/', '')}.ipynb")
    rows = f"<table><th>badge<tbody><tr><td>{escape(BAD)}</td><td>{BAD}</td></tr></tbody></table>".replace(
        "<th>badge<", "<th>badge</th><"
    )
    cell = nbformat.v4.new_code_cell(
        "", outputs=[output("display_data", {"text/html": rows})]
    )
    nbformat.write(nbformat.v4.new_notebook(cells=[cell]), home / "11_waiting.ipynb")
    kinds = ("check", "claim", "observation")
    checks = [
        {"kind": kind, "name": BAD, "passed": False, "value": {BAD: BAD}, "result": BAD}
        for kind in kinds
    ]
    outcome = {
        "status": BAD,
        "error": BAD,
        "seconds": 1.2,
        "checks": checks,
        "key_figures": {BAD: BAD},
    }
    summary = {
        "data": BAD,
        "area": BAD,
        "passed": False,
        "notebooks": {BAD: outcome, "11_waiting": {**outcome, "status": BAD}},
    }
    (home / "summary.json").write_text(json.dumps(summary))
    parameters = {
        "szlib": BAD,
        "data": BAD,
        "files": [[BAD, 3, BAD]],
        "parameters": {BAD: BAD},
    }
    (home / "parameters.json").write_text(json.dumps(parameters))
    samples = pd.DataFrame({"encounter": [0]})
    samples.attrs["funnel"] = [
        {"stage": BAD, "entered": 1, "kept": 0, "rejected": {BAD: 1}}
    ]
    samples.to_parquet(home / "encounters.parquet")
    return home
