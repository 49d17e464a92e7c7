"""The report of a run: a front page and every executed notebook in one HTML file that needs no network.

nbconvert, with which Jupyter itself exports, makes the page. The template and the renderer of this module
leave out scripts of other servers, draw formulas as MathML, fold the code, and describe every picture.

A folder may come from anybody. So everything in it is reduced to harmless HTML, and the content security
policy of the page lets no script run but the player of this package.
"""

from __future__ import annotations

import io
import json
import re
import tomllib
from base64 import b64encode
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from hashlib import sha256
from pathlib import Path
from typing import Any

import bleach  # type: ignore[import-untyped]
import nbformat
import pandas as pd
from bs4 import BeautifulSoup
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from latex2mathml.converter import convert
from nbconvert import HTMLExporter
from nbconvert.filters.markdown_mistune import IPythonRenderer, MarkdownWithMath

from ..core.errors import DataError, SzlibError
from ..core.files import MARKER, folder_purpose, write_file
from ..core.input_files import open_regular, printable, read_json_object, read_small
from ..plaza.settings import PlazaSettings
from ..simulation.scenarios.paper import SCENARIOS
from ..tracks import datasets, funnels
from ..zones.social_zone import SocialZone
from . import folders
from .figures.movies import read_scripts
from .paper_sentences import NOT_RUN, judge, load_sentences
from .record.display import format_value
from .record.parameters import METHOD_DEFAULTS

REPORT = folders.REPORT
_LARGEST_NOTEBOOK = 100_000_000  # of an executed notebook, with its animations [bytes]
_STATIC = Path(__file__).parent / "static"
_HARMLESS = tomllib.loads((_STATIC / "harmless.toml").read_text(encoding="utf-8"))
_OUTPUTS, _TAGS, _ATTRIBUTES = (
    {*_HARMLESS[name].split()} for name in ("outputs", "tags", "attributes")
)
_SCRIPT_OR_STYLE = re.compile(r"<(script|style)\b.*?</\1>", re.DOTALL)
# The data of a player, and its name, in the script of `static/player.html`.
_RUN = re.compile(
    r"(?m)^const run = (\{.*\});\nconst figures = .*\[data-run=(szlib-[0-9a-f]{8})\]"
)
# The picture of a player, which is shown on the front page only.
_GIF = re.compile(r'<img src="data:image/gif;base64,[^"]*" alt="([^"]*)">')
# The text of a link to another file, and the name of the file without folder and ending.
_FILE_LINK = re.compile(
    r"(?<!!)\[([^]\n]+)\]\((?!https?:|#|mailto:|data:)(?:[^)\s]*/)?([^)\s/.]*)(?:\([^)\s]*\)|[^)\s/])*\)"
)


def write_report(home: Path) -> Path:
    """Write the report of the notebooks that were executed in the results folder `home`, and return its path.

    Notebooks that are not in the summary of the last run are left out: an earlier version wrote them.
    Raises DataError if the folder is not marked as results, holds no notebooks, or holds a damaged file.
    """
    if not (folder_purpose(home) or "").startswith(folders.RESULTS_OF):
        raise DataError(
            f"{printable(home / MARKER)}: does not mark results of szlib; `szlib run` makes them"
        )
    names = [file.stem for file in sorted(home.glob("[0-9][0-9]*_*.ipynb"))]
    if isinstance(
        run := read_json_object(home / "summary.json").get("notebooks"), dict
    ):
        names = [name for name in names if name in run]
    if not names:
        raise DataError(
            f"{printable(home)}: holds no executed notebooks; `szlib run` makes them"
        )
    notebooks, runs = {}, dict[str, Any]()
    for name in names:
        with _reading(home / f"{name}.ipynb"):
            notebooks[name] = _read_notebook(home / f"{name}.ipynb", names, runs)
    front, back = map(
        nbformat.v4.new_markdown_cell, _render_front_page(home, notebooks)
    )
    page = nbformat.v4.new_notebook()
    page.cells = [
        front,
        *(cell for notebook in notebooks.values() for cell in notebook.cells),
        back,
    ]
    for i, cell in enumerate(page.cells):
        cell["id"] = f"cell-{i}"
    data = json.dumps(runs, separators=(",", ":")).replace("<", "\\u003c")
    script = f"(() => {{\n{read_scripts('scene', 'player', 'report')}\nplayAll({data});\n}})()"
    checksum = b64encode(sha256(script.encode()).digest()).decode()
    page.metadata |= {"script": script, "script_checksum": f"sha256-{checksum}"}
    exporter = HTMLExporter(
        extra_loaders=[FileSystemLoader(_STATIC)],
        extra_template_basedirs=[],  # not the current folder, which is the default
        template_file="report.html.j2",
    )
    exporter.register_filter("without_gif", lambda html: _GIF.sub(r"\1", html))
    exporter.register_filter("harmless", _remove_harmful)
    write_file(home / REPORT, exporter.from_notebook_node(page)[0])
    return home / REPORT


@contextmanager
def _reading(file: Path) -> Iterator[None]:
    """Raise DataError with the name of the `file` if the block cannot read it."""
    try:
        yield
    except SzlibError:
        raise
    except Exception as error:  # whatever another program wrote
        raise DataError(
            f"{printable(file)}: is damaged or of another version of szlib ({error!a:.200}); `szlib run` "
            "writes it again"
        ) from error


def _read_notebook(
    file: Path, names: Sequence[str], runs: dict[str, Any]
) -> nbformat.NotebookNode:
    """The notebook in a `file`, its texts as HTML.

    Links to the notebooks `names` lead into the report. The runs that its players show are added to `runs`.
    """
    notebook = nbformat.reads(read_small(file, _LARGEST_NOTEBOOK), as_version=4)
    nbformat.validate(notebook)
    notebook.metadata |= {"question": _find_question(notebook), "html": []}
    for cell in notebook.cells:
        cell.metadata.clear()
        if cell.cell_type == "markdown":
            cell.source = _render_markdown(cell.source, names)
        for output in cell.get("outputs", ()):
            if "data" not in output:
                continue
            data = {
                kind: text for kind, text in output.data.items() if kind in _OUTPUTS
            }
            data = data or {"text/plain": ""}
            if "text/markdown" in data:
                data["text/markdown"] = _render_markdown(data["text/markdown"], names)
            if "text/html" in data:
                runs |= {
                    found[2]: json.loads(found[1])
                    for found in _RUN.finditer(data["text/html"])
                }
                data["text/html"] = _SCRIPT_OR_STYLE.sub("", data["text/html"])
                notebook.metadata["html"].append(data["text/html"])
            alt = output.metadata.get("image/png", {}).get("alt", "")
            output.data, output.metadata = (
                data,
                nbformat.from_dict({"image/png": {"alt": str(alt)}}),
            )
    return notebook


def _remove_harmful(html: str) -> str:
    """The same HTML with harmless tags and attributes only: nothing in it can run, or ask another server."""
    protocols = [*bleach.ALLOWED_PROTOCOLS, "data"]
    return str(
        bleach.clean(
            html, tags=_TAGS, attributes=_is_harmless, protocols=protocols, strip=True
        )
    )


def _is_harmless(tag: str, name: str, value: str) -> bool:
    """Whether the attribute `name` of a `tag` may have this `value`."""
    if name == "src":
        return tag == "img" and value.startswith("data:image/")
    return name in _ATTRIBUTES or (name == "href" and not value.startswith("data:"))


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
    """Render markdown with its pictures embedded; links to the notebooks `names` lead into the report."""
    renderer = MathRenderer(
        escape=False, path=str(folders.NOTEBOOKS), embed_images=True
    )
    source = _FILE_LINK.sub(
        lambda x: f"[{x[1]}](#{x[2]})" if x[2] in names else x[1], source
    )
    return MarkdownWithMath(renderer=renderer).render(source)


def _render_front_page(home: Path, notebooks: Mapping[str, Any]) -> Sequence[str]:
    """The pages before and after the executed `notebooks` as HTML, made from the results in `home`."""
    pages = Environment(
        loader=FileSystemLoader(_STATIC), autoescape=True, undefined=StrictUndefined
    )
    outputs = [
        (name, html)
        for name, notebook in notebooks.items()
        for html in notebook.metadata["html"]
    ]
    samples, zone, funnel = home / "encounters.parquet", home / "zone.json", ""
    with _reading(home / "parameters.json"):
        run = _read_json(home / "parameters.json")
        is_synthetic = run.get("data") == datasets.SYNTHETIC
        files = [f"{name} ({size:,} bytes)" for name, size, *_ in run.get("files", ())]
        given = dict(run.get("parameters", {}).items())
        speed = float(given.get("zone_speed", METHOD_DEFAULTS["zone_speed"]))
    with _reading(home / "summary.json"):
        summary = _read_json(home / "summary.json")
        outcomes = {
            name: _format_outcome(name, o)
            for name, o in summary.get("notebooks", {}).items()
        }
    for name, notebook in notebooks.items():
        fold = {
            "name": name,
            "question": notebook.metadata["question"],
            "outcome": outcomes.get(name),
        }
        notebook.cells[0].metadata["fold"], notebook.cells[-1].metadata["is_last"] = (
            fold,
            True,
        )
    with _reading(samples):
        if samples.exists():
            with open_regular(samples) as stream:
                stages = funnels.table(funnels.get(pd.read_parquet(stream, columns=[])))
            # each is named once
            stages["stage"] = stages["stage"].where(~stages["stage"].duplicated(), "")
            funnel = stages.to_html(
                index=False, border=0, formatters={"rows": "{:,}".format}
            )
    with _reading(zone):
        texts = (
            _show_zone(zone, speed, is_synthetic=is_synthetic) if zone.exists() else {}
        )
    checks = [check for outcome in outcomes.values() for check in outcome["checks"]]
    named = {check["key"]: check for check in checks}
    claims = load_sentences().query("kind == 'claim'")
    claims["verdict"] = [judge("claim", names, named) for names in claims["held_by"]]
    claims["checks"] = [
        [named[n] for n in names if n in named] for names in claims["held_by"]
    ]
    html = pages.get_template("front_page.html.j2").render(
        data=str(summary.get("data", home.name)),
        data_sets=datasets.NAMES,
        is_synthetic=is_synthetic,
        speed=speed,
        verdict=str(summary.get("verdict", "")).removeprefix(
            f"zone at {speed:g} m/s: "
        ),
        outcomes=outcomes,
        checks=checks,
        not_run=NOT_RUN,
        claims=claims.to_dict("records"),
        files=files,
        changed=[f"{name} = {value}" for name, value in given.items()],
        version=run.get("szlib", ""),
        area=str(summary.get("area", "")),
        notebooks=list(notebooks),
        funnel=funnel,
        zone=texts,
        players={
            s.name.replace("_", " "): _find_player(s.title, outputs)
            for s in SCENARIOS.values()
        },
        parameters=_list_parameters(outputs),
    )
    return html.rpartition("<!-- notebooks -->")[::2]


def _format_outcome(name: str, outcome: Mapping[str, Any]) -> dict[str, Any]:
    """The outcome of the notebook `name` as texts; an ordinary Python error where it is malformed."""
    checks = [
        {part: str(check[part]) for part in ("kind", "name", "result")}
        for check in outcome["checks"]
    ]
    for text, check in zip(checks, outcome["checks"], strict=True):
        text |= {
            "passed": check["passed"],
            "value": format_value(check["value"]),
            "notebook": name,
        }
        text["key"] = f"{name.split('_')[0]}: {text['name']}"
    texts = {
        "status": str(outcome["status"]),
        "error": str(outcome.get("error", outcome["status"])),
    }
    return {**texts, "seconds": f"{outcome['seconds']:.0f}", "checks": checks}


def _find_question(notebook: Any) -> str:
    """The question in the first cell of a notebook."""
    found = re.search(
        r"\*\*Question\.\*\*(.*?)(\n\n|\*\*|$)", notebook.cells[0].source, re.DOTALL
    )
    return " ".join(found[1].replace("*", "").split()) if found else ""


def _show_zone(file: Path, speed: float, *, is_synthetic: bool) -> dict[str, Any]:
    """The method and table of the zone in a `file`; its size and picture at a `speed`, if it was fitted."""
    from matplotlib.figure import Figure

    from . import figures

    zone = SocialZone.load(file)
    table = zone.table()
    shown = table.filter(
        regex="^(speed|center_x|[ab](_low|_high)?|encounters|adequate|verdict)$"
    )
    texts: dict[str, Any] = {
        "method": zone.method,
        "table": shown.round(2).to_html(index=False, border=0),
    }
    if speed in zone.ellipses:
        figure, content = Figure(figsize=(4.8, 4.5), layout="constrained"), io.BytesIO()
        truth = PlazaSettings().true_zone(speed) if is_synthetic else None
        figures.plot_zone(zone, speed, truth=truth, ax=figure.subplots())
        figure.savefig(content, format="png", dpi=100)
        texts |= {
            "picture": b64encode(content.getvalue()).decode(),
            "alt": figures.alt_text(figure),
        }
        texts |= {"size": table.set_index("speed").loc[speed].to_dict()}
    return texts


def _find_player(title: str, outputs: Sequence[tuple[str, str]]) -> str:
    """The first player of the scenario with a `title` among the outputs; "" if there is none."""
    return next(
        (h for _, h in outputs if "szlib-player" in h and f'alt="{title}:' in h), ""
    )


def _list_parameters(outputs: Sequence[tuple[str, str]]) -> dict[tuple[str, ...], str]:
    """Each row of the tables of `szlib.workbook.record.parameters`, and the first notebook that shows it."""
    rows: dict[tuple[str, ...], str] = {}
    for name, html in outputs:
        if ">badge<" in html:
            for row in BeautifulSoup(html, "html.parser").select("tbody tr"):
                rows.setdefault(
                    tuple(cell.get_text(strip=True) for cell in row.select("td")), name
                )
    return rows


def _read_json(file: Path) -> dict[str, Any]:
    """The object in a JSON file; empty if the file is missing."""
    return dict(json.loads(read_small(file)).items()) if file.exists() else {}
