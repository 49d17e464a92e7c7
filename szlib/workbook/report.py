"""The report of a run: a front page and every executed notebook in one HTML file that needs no network.

nbconvert, with which Jupyter itself exports, makes the page. The template and the renderer of this module
leave out scripts of other servers, draw formulas as MathML, and fold the code.

A folder may come from anybody. So its HTML goes through nbconvert's `SanitizeHTML`, and the content security
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
from html import unescape
from pathlib import Path
from typing import Any

import nbformat
import pandas as pd
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from latex2mathml.converter import convert
from nbconvert import HTMLExporter
from nbconvert.filters.markdown_mistune import IPythonRenderer, MarkdownWithMath
from nbconvert.preprocessors.sanitize import SanitizeHTML

from ..core.errors import DataError, SzlibError
from ..core.files import MARKER, folder_purpose, write_file
from ..core.input_files import open_regular, printable, read_json_object, read_small
from ..plaza.settings import PlazaSettings
from ..simulation import SCENARIOS
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
# The kinds of outputs that are shown.
_OUTPUTS = [
    "text/html",
    "text/markdown",
    "text/plain",
    "text/latex",
    "image/png",
    "image/jpeg",
]
_SCRIPT_OR_STYLE = re.compile(r"<(script|style)\b.*?</\1>", re.DOTALL)
# The data of a player, and its name, in the script of `static/player.html`.
_RUN = re.compile(
    r"(?m)^const run = (\{.*\});\nconst figures = .*\[data-run=(szlib-[0-9a-f]{8})\]"
)
# A picture of the notebooks' own folder.
_PICTURE = re.compile(r'src="(figures/\w+\.(png|gif))"')
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
        marker = printable(home / MARKER)
        raise DataError(
            f"{marker}: does not mark results of szlib; `szlib run` makes them"
        )
    names = [file.stem for file in sorted(home.glob("[0-9][0-9]*_*.ipynb"))]
    run = read_json_object(home / "summary.json").get("notebooks")
    names = [name for name in names if not isinstance(run, dict) or name in run]
    if not names:
        what = "holds no executed notebooks; `szlib run` makes them"
        raise DataError(f"{printable(home)}: {what}")
    notebooks, runs = {}, dict[str, Any]()
    for name in names:
        with _reading(home / f"{name}.ipynb"):
            notebooks[name] = _read_notebook(home / f"{name}.ipynb", names, runs)
    page = nbformat.v4.new_notebook()
    pages = _render_front_page(home, notebooks)
    front, back = map(nbformat.v4.new_markdown_cell, pages)
    cells = [cell for notebook in notebooks.values() for cell in notebook.cells]
    page.cells = [front, *cells, back]
    for i, cell in enumerate(page.cells):
        cell["id"] = f"cell-{i}"
    data = json.dumps(runs, separators=(",", ":")).replace("<", "\\u003c")
    scripts = read_scripts("scene", "player", "report")
    script = f"(() => {{\n{scripts}\nplayAll({data});\n}})()"
    checksum = b64encode(sha256(script.encode()).digest()).decode()
    page.metadata |= {"script": script, "script_checksum": f"sha256-{checksum}"}
    exporter = HTMLExporter(
        extra_loaders=[FileSystemLoader(_STATIC)],
        extra_template_basedirs=[],  # not the current folder, which is the default
        template_file="report.html.j2",
    )
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
    """The notebook in a `file`, its texts as harmless HTML.

    Links to the notebooks `names` lead into the report. The runs that its players show are added to `runs`.
    """
    notebook = nbformat.reads(read_small(file, _LARGEST_NOTEBOOK), as_version=4)
    nbformat.validate(notebook)
    question = _find_question(notebook)
    notebook.metadata |= {"question": question, "html": []}
    for cell in notebook.cells:
        cell.metadata.clear()
        if cell.cell_type == "markdown":
            cell.source = _render_markdown(cell.source, names)
        elif cell.cell_type == "raw":
            cell.source = sanitize(cell.source)
        for output in cell.get("outputs", ()):
            if "data" not in output:
                continue
            data = {kind: output.data[kind] for kind in _OUTPUTS if kind in output.data}
            if "text/markdown" in data:
                data["text/markdown"] = _render_markdown(data["text/markdown"], names)
            if html := data.get("text/html"):
                runs |= {name: json.loads(run) for run, name in _RUN.findall(html)}
                data["text/html"] = sanitize(_SCRIPT_OR_STYLE.sub("", html))
                notebook.metadata["html"].append(data["text/html"])
            alt = str(output.metadata.get("image/png", {}).get("alt", ""))
            output.data = data or {"text/plain": ""}
            output.metadata = nbformat.from_dict({"image/png": {"alt": alt}})
    return notebook


def sanitize(html: str) -> str:
    """The same `html` with harmless tags and attributes only; pictures of the notebooks are embedded.

    Nothing in it can run, or ask another server.
    """
    tags = _HARMLESS["tags"].split()
    cleaner = SanitizeHTML(tags=tags, attributes=_is_harmless, strip=True)
    return _PICTURE.sub(_embed, str(cleaner.sanitize_html_tags(html)))


def _is_harmless(tag: str, name: str, value: str) -> bool:
    """Whether the attribute `name` of a `tag` may have this `value`."""
    if name == "src":
        return tag == "img" and bool(_PICTURE.fullmatch(f'src="{value}"'))
    return name in _HARMLESS["attributes"].split() or name == "href"


def _embed(found: re.Match[str]) -> str:
    """The attribute of a picture of the notebooks with its content; none without the file."""
    file = folders.NOTEBOOKS / found[1]
    if not file.is_file():
        return ""
    return f'src="data:image/{found[2]};base64,{b64encode(file.read_bytes()).decode()}"'


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
    """Render markdown as harmless HTML; links to the notebooks `names` lead into the report."""
    linked = _FILE_LINK.sub(
        lambda x: f"[{x[1]}](#{x[2]})" if x[2] in names else x[1], source
    )
    renderer = MathRenderer(escape=False)
    return sanitize(MarkdownWithMath(renderer=renderer).render(linked))


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
    facts = _read_run(home)
    with _reading(home / "summary.json"):
        summary = _read_json(home / "summary.json")
        stored = summary.get("notebooks", {}).items()
        outcomes = {name: _format_outcome(name, outcome) for name, outcome in stored}
    for name, notebook in notebooks.items():
        question, outcome = notebook.metadata["question"], outcomes.get(name)
        fold = {"name": name, "question": question, "outcome": outcome}
        notebook.cells[0].metadata["fold"] = fold
        notebook.cells[-1].metadata["is_last"] = True
    zone, speed, texts = home / "zone.json", facts["speed"], dict[str, Any]()
    with _reading(zone):
        if zone.exists():
            texts = _show_zone(zone, speed, is_synthetic=facts["is_synthetic"])
    checks = [check for outcome in outcomes.values() for check in outcome["checks"]]
    verdict = str(summary.get("verdict", ""))
    described = {name: str(summary.get(name, "")) for name in _DESCRIBED}
    html = pages.get_template("front_page.html.j2").render(
        **facts,
        **described,
        data=str(summary.get("data", home.name)),
        data_sets=datasets.NAMES,
        verdict=verdict.removeprefix(f"zone at {speed:g} m/s: "),
        outcomes=outcomes,
        checks=checks,
        not_run=NOT_RUN,
        claims=_list_claims(checks),
        notebooks=list(notebooks),
        funnel=_show_funnel(home / "encounters.parquet"),
        zone=texts,
        players={
            s.name.replace("_", " "): _find_player(s.title, outputs)
            for s in SCENARIOS.values()
        },
        rows=_list_parameters(outputs),
    )
    return html.rpartition("<!-- notebooks -->")[::2]


# What the summary of a run says of it in one line each.
_DESCRIBED = ("area", "date", "command", "machine", "versions")


def _read_run(home: Path) -> dict[str, Any]:
    """The data and the parameters of the run in `home`, as its file of parameters has them."""
    with _reading(home / folders.PARAMETERS):
        run = _read_json(home / folders.PARAMETERS)
        given = dict(run.get("parameters", {}).items())
        speed = float(given.get("zone_speed", METHOD_DEFAULTS["zone_speed"]))
        files = [f"{name} ({size:,} bytes)" for name, size, *_ in run.get("files", ())]
    return {
        "is_synthetic": run.get("data") == datasets.SYNTHETIC,
        "files": files,
        "changed": [f"{name} = {value}" for name, value in given.items()],
        "version": run.get("szlib", ""),
        "speed": speed,
    }


def _show_funnel(samples: Path) -> str:
    """The stages of the encounters in the file `samples` as a table; "" without a file."""
    with _reading(samples):
        if not samples.exists():
            return ""
        with open_regular(samples) as stream:
            stages = funnels.table(funnels.get(pd.read_parquet(stream, columns=[])))
        # each is named once
        stages["stage"] = stages["stage"].where(~stages["stage"].duplicated(), "")
        rows = {"rows": "{:,}".format}
        return sanitize(stages.to_html(index=False, border=0, formatters=rows))


def _list_claims(checks: Sequence[Mapping[str, Any]]) -> Any:
    """The claims of the paper, each with its verdict and the `checks` of this run that it rests on."""
    named = {check["key"]: check for check in checks}
    claims: Any = load_sentences().query("kind == 'claim'")
    held_by = claims["held_by"]
    claims["verdict"] = [judge("claim", names, named) for names in held_by]
    claims["checks"] = [[named[n] for n in names if n in named] for names in held_by]
    return claims.to_dict("records")


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
        "table": sanitize(shown.round(2).to_html(index=False, border=0)),
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


def _list_parameters(
    outputs: Sequence[tuple[str, str]],
) -> dict[tuple[str, ...], str]:
    """Each row of the tables of `szlib.workbook.record.parameters`, and the first notebook that shows it."""
    found: dict[tuple[str, ...], str] = {}
    for name, html in outputs:
        table = html.partition(">badge<")[2]
        for row in re.findall(r"<tr>(.*?)</tr>", table, re.DOTALL):
            cells = re.findall(r"<td[^>]*>(.*?)</td>", row, re.DOTALL)
            found.setdefault(tuple(unescape(cell.strip()) for cell in cells), name)
    return {cells: name for cells, name in found.items() if len(cells) == 4}


def _read_json(file: Path) -> dict[str, Any]:
    """The object in a JSON file; empty if the file is missing."""
    return dict(json.loads(read_small(file)).items()) if file.exists() else {}
