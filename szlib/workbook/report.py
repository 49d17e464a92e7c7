"""The report of a run: a front page and every executed notebook in one HTML file that needs no network.

nbconvert, with which Jupyter itself exports, makes the page. The template and the renderer of this module
leave out scripts of other servers, draw formulas as MathML, fold the code, and describe every picture.
"""

from __future__ import annotations

import io
import json
import re
from base64 import b64encode
from collections.abc import Iterator, Mapping
from html import escape
from pathlib import Path
from typing import Any

import nbformat
import pandas as pd
from bs4 import BeautifulSoup
from jinja2 import FileSystemLoader, pass_context
from latex2mathml.converter import convert
from nbconvert import HTMLExporter
from nbconvert.filters.markdown_mistune import IPythonRenderer, MarkdownWithMath

from ..control.settings import MPCSettings
from ..errors import DataError, ZoneError
from ..files import write_file
from ..plaza.settings import PlazaSettings
from ..simulation.scenarios.paper import SCENARIOS
from ..tracks import datasets, funnels
from ..zones.social_zone import SocialZone
from . import folders
from .record.display import format_value

REPORT = "report.html"
"""The file of the report, in the folder of a run."""
TEMPLATE = Path(__file__).parent / "static" / "report.html.j2"
"""Extends the template `lab` of nbconvert."""
_FILE_LINK = re.compile(r"(?<!!)\[([^\]\n]+)\]\((?!https?:|#|mailto:|data:)([^)\s]+)\)")
_NOT_IN_RUN = "*Not part of this run.*"


def write_report(home: Path) -> Path:
    """Write the report of the notebooks that were executed in the results folder `home`, and return its path.

    Raises DataError if there are none, or if one cannot be read.
    """
    notebooks = {file.stem: _read_notebook(file) for file in sorted(home.glob("[0-9][0-9]*_*.ipynb"))}
    if not notebooks:
        raise DataError(f"{home}: holds no executed notebooks; `szlib run` makes them")
    try:
        front_page = list(make_front_page(home, notebooks))
    except (LookupError, TypeError, ValueError, AttributeError) as error:
        raise DataError(
            f"{home}: the results are damaged or of another version of szlib ({error!r}); `szlib run` writes "
            "them again"
        ) from error
    page = nbformat.v4.new_notebook(cells=front_page)
    page.metadata["title"] = f"szlib: {home.name}"
    page.metadata["language_info"] = {"name": "python", "pygments_lexer": "ipython3"}
    for name, notebook in notebooks.items():
        page.cells += [_markdown(f'<a id="{name}"></a>[to the front page](#top)'), *notebook.cells]
    for i, cell in enumerate(page.cells):
        cell["id"] = f"cell-{i}"
        if cell.cell_type == "markdown":
            cell.source = _FILE_LINK.sub(lambda link: _local_link(link, notebooks), cell.source)
    exporter = _Exporter(
        extra_loaders=[FileSystemLoader(TEMPLATE.parent)],
        template_file=TEMPLATE.name,
        exclude_input_prompt=True,
        exclude_output_prompt=True,
    )
    write_file(home / REPORT, exporter.from_notebook_node(page)[0])
    return home / REPORT


def _read_notebook(file: Path) -> nbformat.NotebookNode:
    try:
        return nbformat.read(file, as_version=4)
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


class _Exporter(HTMLExporter):
    @pass_context
    def markdown2html(self, context: Any, source: str) -> str:
        """Render a markdown cell with its pictures embedded."""
        renderer = _Renderer(escape=False, path=str(folders.NOTEBOOKS), embed_images=True)
        return MarkdownWithMath(renderer=renderer).render(source)


def make_front_page(home: Path, notebooks: Mapping[str, Any]) -> Iterator[Any]:
    """Yield the cells of the front page, made from the results in `home` and the executed `notebooks`."""
    zone, funnel = _load_results(home)
    summary, run = _read_json(home / "summary.json"), _read_json(home / "parameters.json")
    outcomes: dict[str, Any] = summary.get("notebooks", {})
    is_synthetic = run.get("data") == datasets.SYNTHETIC
    yield _markdown(
        f"# Results for {'the synthetic plaza' if is_synthetic else summary.get('data', home.name)}"
    )
    yield from _describe_run(home, run, outcomes)
    yield _markdown("## The notebooks")
    yield _table(_list_notebooks(notebooks, outcomes))
    yield _markdown("## From rows to encounters")
    yield _table(funnel)
    yield _markdown("## The social zone")
    yield from _show_zone(zone, is_synthetic=is_synthetic) if zone else [_markdown(_NOT_IN_RUN)]
    yield _markdown("## Claims of the paper, measured")
    yield _table(_list_claims(outcomes))
    yield _markdown("## The four scenarios")
    outputs = {name: list(_html_outputs(notebook)) for name, notebook in notebooks.items()}
    yield from _show_scenarios(outputs)
    yield _markdown("## Parameters and their sources")
    yield _table(_list_parameters(outputs))


def _load_results(home: Path) -> tuple[SocialZone | None, pd.DataFrame]:
    """The zone if there is one, and the funnel of the encounters with each stage named once."""
    try:
        zone = SocialZone.load(home / "zone.json")
    except (OSError, ZoneError):
        zone = None
    if not (home / "encounters.parquet").exists():
        return zone, pd.DataFrame()
    funnel = funnels.table(funnels.get(pd.read_parquet(home / "encounters.parquet")))
    funnel["stage"] = funnel["stage"].where(~funnel["stage"].duplicated(), "")
    funnel["rows"] = [f"{rows:,}" for rows in funnel["rows"]]
    return zone, funnel


def _describe_run(home: Path, run: Mapping[str, Any], outcomes: Mapping[str, Any]) -> Iterator[Any]:
    """How many checks hold, which do not, and what the run was made from."""
    checks = [(name, c) for name, outcome in outcomes.items() for c in outcome["checks"]]
    passed = [c["passed"] for _, c in checks if c["kind"] == "check"]
    observed = [c["passed"] for _, c in checks if c["kind"] == "observation"]
    text = f"**{sum(passed)} of {len(passed)} checks hold."
    if observed:
        text += f" {sum(observed)} of {len(observed)} checks that assume the default parameters hold as well."
    problems = [
        f"{name}: {c['name']} ({format_value(c['value'])})"
        for name, c in checks
        if c["kind"] == "check" and not c["passed"]
    ]
    problems += [
        f"{name}: {o.get('error', o['status'])}" for name, o in outcomes.items() if o["status"] != "done"
    ]
    yield _markdown("\n".join([f"{text}**", *(f"\n- {escape(problem)}" for problem in problems)]))
    area = home / "area.txt"
    rows = {
        "data": ", ".join(f"{name} ({size:,} bytes)" for name, size, *_ in run.get("files", [])),
        "area": area.read_text(encoding="utf-8") if area.exists() else "",
        "changed parameters": ", ".join(f"{k} = {v}" for k, v in run.get("parameters", {}).items()) or "none",
        "szlib": run.get("szlib", ""),
    }
    yield _table(pd.DataFrame([(k, escape(str(v))) for k, v in rows.items() if v], columns=["", " "]))


def _list_notebooks(notebooks: Mapping[str, Any], outcomes: Mapping[str, Any]) -> pd.DataFrame:
    rows = []
    for name, notebook in notebooks.items():
        outcome = outcomes.get(name, {"checks": [], "status": "", "seconds": None})
        checks = [c["passed"] for c in outcome["checks"] if c["kind"] == "check"]
        found = re.search(r"\*\*Question\.\*\*(.*?)(\n\n|\*\*|$)", notebook.cells[0].source, re.DOTALL)
        question = " ".join(found[1].replace("*", "").split()) if found else ""
        seconds = "" if outcome["seconds"] is None else f"{outcome['seconds']:.0f}"
        link = f'<a href="#{name}">{name.replace("_", " ")}</a>'
        rows.append((link, escape(question), f"{sum(checks)}/{len(checks)}", seconds, outcome["status"]))
    return pd.DataFrame(rows, columns=["notebook", "question", "checks", "seconds", "status"])


def _show_zone(zone: SocialZone, *, is_synthetic: bool) -> Iterator[Any]:
    speed = MPCSettings().zone_speed
    if speed in zone.ellipses:
        yield _draw_zone(zone, speed, PlazaSettings().true_zone(speed) if is_synthetic else None)
    table = zone.table()
    bounds = [f"{name}{end}" for name in ("a", "b") for end in ("", "_low", "_high")]
    shown = [c for c in ("speed", "center_x", *bounds, "encounters", "adequate") if c in table]
    yield _markdown(f"By `{zone.method}`, with 95 % intervals [m]; `adequate`: enough people on every side.")
    yield _table(table[shown].round(2))


def _draw_zone(zone: SocialZone, speed: float, truth: Any) -> Any:
    from matplotlib.figure import Figure

    from . import figures

    figure = Figure(figsize=(6, 4.5), layout="constrained")
    figures.plot_zone(zone, speed, truth=truth, ax=figure.subplots())
    content = io.BytesIO()
    figure.savefig(content, format="png", dpi=100)
    alt = escape(figures.alt_text(figure), quote=True)
    return _html(f'<img src="data:image/png;base64,{b64encode(content.getvalue()).decode()}" alt="{alt}">')


def _list_claims(outcomes: Mapping[str, Any]) -> pd.DataFrame:
    rows = [
        (_short_link(name), *(escape(format_value(c[key])) for key in ("name", "result", "value")))
        for name, outcome in outcomes.items()
        for c in outcome["checks"]
        if c["kind"] == "claim"
    ]
    return pd.DataFrame(rows, columns=["notebook", "claim", "verdict", "effect, or value"])


def _show_scenarios(outputs: Mapping[str, list[str]]) -> Iterator[Any]:
    players = [html for each in outputs.values() for html in each if "szlib-player" in html]
    for scenario in SCENARIOS.values():
        player = next((html for html in players if f'alt="{scenario.title}:' in html), None)
        yield _markdown(f"**{scenario.title}**" + ("" if player else f"\n\n{_NOT_IN_RUN}"))
        if player:
            yield _html(player)


def _list_parameters(outputs: Mapping[str, list[str]]) -> pd.DataFrame:
    """The tables of parameters (`szlib.workbook.record.parameters`) of all notebooks as one."""
    columns = ["parameter", "value", "badge", "why"]
    rows = []
    for name, html in outputs.items():
        for table in BeautifulSoup("".join(h for h in html if ">badge<" in h), "html.parser").select("table"):
            if [th.get_text(strip=True) for th in table.select("thead th")] == columns:
                cells = (tr.select("td") for tr in table.select("tbody tr"))
                rows += [
                    (_short_link(name), *(escape(td.get_text(strip=True)) for td in row)) for row in cells
                ]
    return pd.DataFrame(rows, columns=["notebook", *columns]).drop_duplicates(columns)


def _short_link(name: str) -> str:
    """A link to a notebook of the report by its number."""
    return f'<a href="#{name}">{name.split("_")[0]}</a>'


def _html_outputs(notebook: Any) -> Iterator[str]:
    """The HTML of every output of a notebook."""
    for cell in notebook.cells:
        for output in cell.get("outputs", ()):
            yield output.get("data", {}).get("text/html", "")


def _read_json(file: Path) -> dict[str, Any]:
    """The object in a JSON file; empty if the file is missing."""
    return dict(json.loads(file.read_text(encoding="utf-8"))) if file.exists() else {}


def _markdown(text: str) -> Any:
    return nbformat.v4.new_markdown_cell(text)


def _html(html: str) -> Any:
    output = nbformat.v4.new_output("display_data", {"text/html": html})
    return nbformat.v4.new_code_cell("", outputs=[output])


def _table(table: pd.DataFrame) -> Any:
    """A cell with a table whose entries are HTML; a remark if the table is empty."""
    if table.empty:
        return _markdown(_NOT_IN_RUN)
    with pd.option_context("display.max_colwidth", None):
        return _html(table.to_html(index=False, escape=False, border=0, justify="left", classes="front"))
