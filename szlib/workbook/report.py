"""The report of a run: a front page and every executed notebook in one HTML file that needs no network.

The summary of a run is also text for a terminal, and JUnit XML for services that run tests.

nbconvert, with which Jupyter itself exports, makes the page. The template and the renderer of this module
draw formulas as MathML, and fold the code. The outputs of notebooks that an earlier run left in the folder
are shown as they are, with their scripts: run in no folder that somebody else made.
"""

from __future__ import annotations

import io
import re
from base64 import b64encode
from collections.abc import Mapping, Sequence
from os.path import relpath
from pathlib import Path
from typing import Any

import nbformat
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from latex2mathml.converter import convert
from nbconvert import HTMLExporter
from nbconvert.filters.markdown_mistune import IPythonRenderer, MarkdownWithMath
from traitlets.config import Config

from ..core.files import write_file
from ..core.input_files import printable
from ..plaza.settings import PlazaSettings
from ..simulation import SCENARIOS
from ..tracks import datasets
from . import folders
from .claims import NOT_RUN, judge_sentences
from .figures.movies import read_scripts
from .record.data_cache import read_stored_zone
from .record.display import format_value
from .record.parameters import ZoneMethod

STATIC = Path(__file__).parent / "static"  # templates, and what a browser shows
# The kinds of outputs that are shown, the first of them that an output has.
_OUTPUTS = ["text/html", "text/markdown", "image/png", "image/jpeg", "text/plain"]
# The text of a link to another file, and the name of the file without folder and ending.
_FILE_LINK = re.compile(
    r"(?<!!)\[([^]\n]+)\]\((?!https?:|#|mailto:|data:)(?:[^)\s]*/)?([^)\s/.]*)(?:\([^)\s]*\)|[^)\s/])*\)"
)


def write_report(home: Path, summary: Mapping[str, Any]) -> Path:
    """Write the report of a run into its results folder, and return the path of the report.

    Parameters
    ----------
    home : the folder, with the executed notebooks, the encounters and the zone.
    summary : of the run, as `szlib.workbook.runner.run` writes it to summary.json.
    """
    names = [name for name in summary["notebooks"] if (home / f"{name}.ipynb").exists()]
    notebooks = {name: _read_notebook(home / f"{name}.ipynb", names) for name in names}
    front, back = _render_front_page(home, summary, notebooks)
    page = nbformat.v4.new_notebook()
    page.cells = [
        nbformat.v4.new_markdown_cell(front),
        *(cell for notebook in notebooks.values() for cell in notebook.cells),
        nbformat.v4.new_markdown_cell(back),
    ]
    for i, cell in enumerate(page.cells):
        cell["id"] = f"cell-{i}"
    exporter = HTMLExporter(
        config=Config(NbConvertBase={"display_data_priority": _OUTPUTS}),
        extra_loaders=[FileSystemLoader(STATIC)],
        extra_template_basedirs=[],  # not the current folder, which is the default
        template_file="report.html.j2",
    )
    html, _ = exporter.from_notebook_node(page, {"script": read_scripts("report")})
    write_file(home / folders.REPORT, html)
    return home / folders.REPORT


def _read_notebook(file: Path, names: Sequence[str]) -> nbformat.NotebookNode:
    """The notebook in a `file`, its texts as HTML; links to the notebooks `names` lead into the report."""
    notebook = nbformat.read(file, as_version=4)
    question = notebook.metadata.get("szlib", {}).get("asks", "")
    for cell in notebook.cells:
        cell.metadata.clear()
        if cell.cell_type == "markdown":
            cell.source = _render_markdown(cell.source, names)
        for output in cell.get("outputs", ()):
            data = output.get("data", {})
            if "text/markdown" in data:
                data["text/markdown"] = _render_markdown(data["text/markdown"], names)
    notebook.cells[0].metadata["fold"] = {"name": file.stem, "question": question}
    notebook.cells[-1].metadata["is_last"] = True
    return notebook


class MathRenderer(IPythonRenderer):
    """Markdown with formulas as MathML, which browsers draw without a script."""

    def block_math(self, body: str) -> str:
        """Draw the formula `body` on a line of its own."""
        return f"<p>{convert(body, display='block')}</p>"

    def multiline_math(self, text: str) -> str:
        """Draw a formula of several lines; `text` includes its marks."""
        return self.block_math(text.strip("$"))

    def inline_math(self, body: str) -> str:
        """Draw the formula `body` within a line."""
        return convert(body)


def _render_markdown(source: str, names: Sequence[str]) -> str:
    """Render markdown as HTML with its pictures; links to the notebooks `names` lead into the report."""
    linked = _FILE_LINK.sub(
        lambda x: f"[{x[1]}](#{x[2]})" if x[2] in names else x[1], source
    )
    renderer = MathRenderer(
        escape=False,
        embed_images=True,
        exclude_anchor_links=True,
        path=str(folders.NOTEBOOKS),
    )
    return str(MarkdownWithMath(renderer=renderer).render(linked))


def _render_front_page(
    home: Path, summary: Mapping[str, Any], notebooks: Mapping[str, Any]
) -> Sequence[str]:
    """The pages before and after the executed `notebooks` as HTML, made from the results in `home`."""
    given = summary["parameters"]
    speed = ZoneMethod.from_variables(given).zone_speed
    is_synthetic = summary["data"] == datasets.SYNTHETIC
    outcomes = {
        name: _complete_outcome(name, outcome)
        for name, outcome in summary["notebooks"].items()
    }
    for name, notebook in notebooks.items():
        notebook.cells[0].metadata["fold"]["outcome"] = outcomes[name]
    checks = [check for outcome in outcomes.values() for check in outcome["checks"]]
    named = {check["key"]: check for check in checks}
    verdict = str(summary.get("verdict", ""))
    html = fill_template(
        "front_page.html.j2",
        **{name: str(summary.get(name, "")) for name in _DESCRIBED},
        speed=speed,
        is_synthetic=is_synthetic,
        files=[f"{name} ({size:,} bytes)" for name, size, *_ in summary["files"]],
        changed=[f"{name} = {value}" for name, value in given.items()],
        data_sets=datasets.NAMES,
        verdict=verdict.removeprefix(f"zone at {speed:g} m/s: "),
        outcomes=outcomes,
        checks=checks,
        not_run=NOT_RUN,
        claims=judge_sentences(named).query("kind == 'claim'").to_dict("records"),
        named=named,
        notebooks=list(notebooks),
        stages=summary.get("stages", []),
        # the verdict is that of a zone of these files
        zone=_show_zone(home / "zone.json", speed, is_synthetic=is_synthetic)
        if verdict.startswith("zone")
        else {},
        scenarios={each.title: name for name, each in SCENARIOS.items()},
    )
    return html.rpartition("<!-- notebooks -->")[::2]


# What the summary of a run says of it in one line each.
_DESCRIBED = ("data", "area", "date", "command", "machine", "szlib", "versions")


def _complete_outcome(name: str, outcome: Mapping[str, Any]) -> dict[str, Any]:
    """The outcome of the notebook `name`; each check has its notebook and its key, "NN: name"."""
    checks = [
        {"notebook": name, "key": f"{name.split('_')[0]}: {check['name']}", **check}
        for check in outcome["checks"]
    ]
    return {"error": outcome["status"], **outcome, "checks": checks}


def _show_zone(file: Path, speed: float, *, is_synthetic: bool) -> dict[str, Any]:
    """The method and table of the zone in a `file`; its size and picture at a `speed`, if it was fitted."""
    from matplotlib.figure import Figure

    from . import figures

    zone = read_stored_zone(file)
    if zone is None:
        return {}
    table = zone.table()
    names = "^(speed|center_x|[ab](_low|_high)?|encounters|adequate|verdict)$"
    shown = table.filter(regex=names).round(2).to_html(index=False, border=0)
    texts: dict[str, Any] = {"meaning": zone.meaning, "table": shown}
    if speed in zone.ellipses:
        figure = Figure(figsize=(4.8, 4.5), layout="constrained")
        content = io.BytesIO()
        truth = PlazaSettings().true_zone(speed) if is_synthetic else None
        figures.plot_zone(zone, speed, truth=truth, ax=figure.subplots())
        figure.savefig(content, format="png", dpi=100)
        texts |= {
            "picture": b64encode(content.getvalue()).decode(),
            "alt": figures.alt_text(figure),
            "size": table.set_index("speed").loc[speed].to_dict(),
        }
    return texts


def format_summary(summary: Mapping[str, Any]) -> str:
    """Format the `summary` of a run: a row for each notebook, what does not hold, the report, the verdict."""
    return fill_template("summary.txt.j2", **summary)


def write_junit(summary: Mapping[str, Any], file: Path) -> None:
    """Write the `summary` of a run as JUnit XML to `file`: a suite for each notebook, a case for each check.

    The first case of a suite is the notebook itself.  Raises StorageError.
    """
    write_file(file, fill_template("junit.xml.j2", **summary))


def fill_template(name: str, **variables: Any) -> str:
    """The template of this `name` in the folder `static`, with `variables`; HTML and XML are escaped."""
    pages = Environment(
        loader=FileSystemLoader(STATIC),
        autoescape=not name.endswith(".txt.j2"),
        undefined=StrictUndefined,
    )
    pages.filters |= {
        "printable": printable,
        "value": format_value,
        "relative": relpath,
    }
    return pages.get_template(name).render(variables)
