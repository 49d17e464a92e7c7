"""The report of a run: a front page and every executed notebook in one HTML file that needs no network.

nbconvert, with which Jupyter itself exports, makes the page. The template and the renderer of this module
leave out scripts of other servers, draw formulas as MathML, fold the code, and describe every picture.
"""

from __future__ import annotations

import io
import json
import re
from base64 import b64encode
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import nbformat
import pandas as pd
from bs4 import BeautifulSoup
from jinja2 import Environment, FileSystemLoader, StrictUndefined, TemplateError
from latex2mathml.converter import convert
from nbconvert import HTMLExporter
from nbconvert.filters.markdown_mistune import IPythonRenderer, MarkdownWithMath

from ..control.settings import MPCSettings
from ..errors import DataError, ZoneError
from ..files import open_regular, read_small, reading, write_file
from ..plaza.settings import PlazaSettings
from ..simulation.scenario import Scenario
from ..simulation.scenarios.paper import SCENARIOS
from ..tracks import datasets, funnels
from ..zones.social_zone import SocialZone
from . import folders
from .record.display import format_value

REPORT = "report.html"  # the file of the report, in the folder of a run
_LARGEST_NOTEBOOK = 100_000_000  # of an executed notebook, with its animations [bytes]
_STATIC = Path(__file__).parent / "static"
_FILE_LINK = re.compile(r"(?<!!)\[([^\]\n]+)\]\((?!https?:|#|mailto:|data:)([^)\s]+)\)")


def write_report(home: Path) -> Path:
    """Write the report of the notebooks that were executed in the results folder `home`, and return its path.

    Raises DataError if there are none, or if one cannot be read.
    """
    notebooks = {file.stem: _read_notebook(file) for file in sorted(home.glob("[0-9][0-9]*_*.ipynb"))}
    if not notebooks:
        raise DataError(f"{home}: holds no executed notebooks; `szlib run` makes them")
    try:
        front_page = _render_front_page(home, notebooks)
    except (LookupError, TypeError, ValueError, AttributeError, OSError, TemplateError) as error:
        raise DataError(
            f"{home}: the results are damaged or of another version of szlib ({error!r}); `szlib run` writes "
            "them again"
        ) from error
    output = nbformat.v4.new_output("display_data", {"text/html": front_page})
    page = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell("", outputs=[output])])
    page.metadata["title"] = f"szlib: {home.name}"
    page.metadata["language_info"] = {"name": "python", "pygments_lexer": "ipython3"}
    for name, notebook in notebooks.items():
        link = f'<a id="{name}"></a>[to the front page](#top)'
        page.cells += [nbformat.v4.new_markdown_cell(link), *notebook.cells]
    for i, cell in enumerate(page.cells):
        cell["id"] = f"cell-{i}"
        if cell.cell_type == "markdown":
            cell.source = _FILE_LINK.sub(lambda link: _local_link(link, notebooks), cell.source)
    exporter = HTMLExporter(
        extra_loaders=[FileSystemLoader(_STATIC)],
        template_file="report.html.j2",
        exclude_input_prompt=True,
        exclude_output_prompt=True,
    )
    exporter.register_filter("markdown2html", _render_markdown)
    write_file(home / REPORT, exporter.from_notebook_node(page)[0])
    return home / REPORT


def _read_notebook(file: Path) -> nbformat.NotebookNode:
    try:
        return nbformat.reads(read_small(file, _LARGEST_NOTEBOOK), as_version=4)
    except (OSError, ValueError, nbformat.reader.NotJSONError) as error:
        raise DataError(f"{file}: cannot be read as a notebook ({error}); run it again") from error


def _local_link(link: re.Match[str], notebooks: Mapping[str, Any]) -> str:
    """A link to a notebook inside the report; the text alone if the report does not hold that notebook."""
    name = Path(link[2]).stem
    return f"[{link[1]}](#{name})" if name in notebooks else link[1]


class _Renderer(IPythonRenderer):
    """Markdown with formulas as MathML, which browsers draw without a script."""

    def block_math(self, body: str) -> str:
        """Draw a formula on a line of its own."""
        return f"<p>{convert(body, display='block')}</p>"

    def multiline_math(self, text: str) -> str:
        """Draw a formula of several lines, which includes its marks."""
        return self.block_math(text.strip("$"))

    def inline_math(self, body: str) -> str:
        """Draw a formula within a line."""
        return convert(body)


def _render_markdown(source: str) -> str:
    """Render a markdown cell with its pictures embedded."""
    renderer = _Renderer(escape=False, path=str(folders.NOTEBOOKS), embed_images=True)
    return MarkdownWithMath(renderer=renderer).render(source)


def _render_front_page(home: Path, notebooks: Mapping[str, Any]) -> str:
    """The front page as HTML, made from the results in `home` and the executed `notebooks`."""
    pages = Environment(loader=FileSystemLoader(_STATIC), autoescape=True, undefined=StrictUndefined)
    pages.filters["format_value"] = format_value
    summary, run = _read_json(home / "summary.json"), _read_json(home / "parameters.json")
    outcomes: dict[str, Any] = summary.get("notebooks", {})
    outputs = [(name, html) for name, notebook in notebooks.items() for html in _html_outputs(notebook)]
    is_synthetic, area = run.get("data") == datasets.SYNTHETIC, home / "area.txt"
    zone, samples, funnel = _show_zone(home, is_synthetic=is_synthetic), home / "encounters.parquet", ""
    if samples.exists():
        with open_regular(samples) as stream:
            stages = funnels.table(funnels.get(pd.read_parquet(stream)))
        stages["stage"] = stages["stage"].where(~stages["stage"].duplicated(), "")  # each is named once
        funnel = _to_html(stages.assign(rows=stages["rows"].map("{:,}".format)))
    return pages.get_template("front_page.html.j2").render(
        title="the synthetic plaza" if is_synthetic else summary.get("data", home.name),
        outcomes=outcomes,
        checks=[c | {"notebook": name} for name, outcome in outcomes.items() for c in outcome["checks"]],
        run=run,
        area=read_small(area).decode("utf-8") if area.exists() else "",
        questions={name: _find_question(notebook) for name, notebook in notebooks.items()},
        funnel=funnel,
        zone=zone,
        players={scenario.title: _find_player(scenario, outputs) for scenario in SCENARIOS.values()},
        parameters=_list_parameters(outputs),
    )


def _find_question(notebook: Any) -> str:
    """The question in the first cell of a notebook."""
    found = re.search(r"\*\*Question\.\*\*(.*?)(\n\n|\*\*|$)", notebook.cells[0].source, re.DOTALL)
    return " ".join(found[1].replace("*", "").split()) if found else ""


def _show_zone(home: Path, *, is_synthetic: bool) -> dict[str, str]:
    """The zone's method, table and picture; empty if there is no zone."""
    from matplotlib.figure import Figure

    from . import figures

    try:
        zone = SocialZone.load(home / "zone.json")
    except (OSError, ZoneError):
        return {}
    table = zone.table()
    bounds = [f"{name}{end}" for name in ("a", "b") for end in ("", "_low", "_high")]
    shown = [c for c in ("speed", "center_x", *bounds, "encounters", "adequate") if c in table]
    texts = {"method": zone.method, "table": _to_html(table[shown].round(2)), "picture": ""}
    speed = MPCSettings().zone_speed
    if speed in zone.ellipses:
        figure, content = Figure(figsize=(6, 4.5), layout="constrained"), io.BytesIO()
        truth = PlazaSettings().true_zone(speed) if is_synthetic else None
        figures.plot_zone(zone, speed, truth=truth, ax=figure.subplots())
        figure.savefig(content, format="png", dpi=100)
        texts |= {"picture": b64encode(content.getvalue()).decode(), "alt": figures.alt_text(figure)}
    return texts


def _find_player(scenario: Scenario, outputs: Sequence[tuple[str, str]]) -> str:
    """The first player of a `scenario` among the outputs; "" if there is none."""
    mark = f'alt="{scenario.title}:'
    return next((html for _, html in outputs if "szlib-player" in html and mark in html), "")


def _list_parameters(outputs: Sequence[tuple[str, str]]) -> dict[tuple[str, ...], str]:
    """Each row of the tables of `szlib.workbook.record.parameters`, and the first notebook that shows it."""
    rows: dict[tuple[str, ...], str] = {}
    for name, html in outputs:
        if ">badge<" in html:
            for row in BeautifulSoup(html, "html.parser").select("tbody tr"):
                rows.setdefault(tuple(cell.get_text(strip=True) for cell in row.select("td")), name)
    return rows


def _html_outputs(notebook: Any) -> Iterator[str]:
    """The HTML of every output of a notebook."""
    for cell in notebook.cells:
        for output in cell.get("outputs", ()):
            yield output.get("data", {}).get("text/html", "")


def _read_json(file: Path) -> dict[str, Any]:
    """The object in a JSON file; empty if the file is missing."""
    with reading(file, "as results", "an object of JSON, as `szlib run` writes it"):
        return dict(json.loads(read_small(file))) if file.exists() else {}


def _to_html(table: pd.DataFrame) -> str:
    return str(table.to_html(index=False, border=0, justify="left", classes="front"))
