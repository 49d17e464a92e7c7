"""The whole report: a front page and every executed notebook, one HTML file made by nbconvert.

nbconvert is what Jupyter itself exports with, and comes with JupyterLab; Quarto and MyST need programs of
their own beside Python, and make sites of many files.  It is told what it leaves open here: no script from
another server, formulas as MathML, code folded, an alternative text for every picture.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import nbformat
from jinja2 import FileSystemLoader, pass_context
from latex2mathml.converter import convert
from nbconvert import HTMLExporter
from nbconvert.filters.markdown_mistune import IPythonRenderer, MarkdownWithMath

from ...errors import DataError
from ...files import write_file
from ..record import places
from . import front_page

REPORT = "report.html"
LINK = re.compile(r"(?<!!)\[([^\]\n]+)\]\((?!https?:|#|mailto:|data:)([^)\s]+)\)")
"""A link of a markdown cell to a file."""
TEMPLATE = Path(__file__).parents[1] / "static" / "report.html.j2"
"""What is added to nbconvert's template `lab`."""


def write(home: Path) -> Path:
    """Make the report of what was executed in a folder of results, ``report.html`` in it; returns its path.

    Raises
    ------
    DataError : nothing was executed there, or a notebook cannot be read.
    """
    notebooks = {file.stem: _read(file) for file in executed(home)}
    if not notebooks:
        raise DataError(f"{home}: holds no executed notebooks; `szlib run` makes them")
    whole = nbformat.v4.new_notebook(cells=front_page.cells(home, notebooks))
    whole.metadata["title"] = f"szlib: {home.name}"
    whole.metadata["language_info"] = {"name": "python", "pygments_lexer": "ipython3"}
    for name, notebook in notebooks.items():
        top = f'<a id="{name}"></a>[to the front page](#top)'
        whole.cells += [nbformat.v4.new_markdown_cell(top), *notebook.cells]
    for i, cell in enumerate(whole.cells):
        cell["id"] = f"cell-{i}"
        if cell.cell_type == "markdown":
            cell.source = LINK.sub(lambda link: _here(link, notebooks), cell.source)
    body, _ = _exporter().from_notebook_node(whole)
    write_file(home / REPORT, body)
    return home / REPORT


def executed(home: Path) -> list[Path]:
    """The executed notebooks in a folder of results, in order."""
    return sorted(home.glob("[0-9][0-9]*_*.ipynb"))


def _read(file: Path) -> nbformat.NotebookNode:
    try:
        return nbformat.read(file, as_version=4)
    except (OSError, ValueError, nbformat.reader.NotJSONError) as error:
        raise DataError(f"{file}: cannot be read as a notebook ({error}); run it again") from error


def _here(link: re.Match[str], notebooks: Mapping[str, Any]) -> str:
    """A link within the report where it holds that notebook, and else the words alone."""
    name = Path(link[2]).stem
    return f"[{link[1]}](#{name})" if name in notebooks else link[1]


class _Renderer(IPythonRenderer):
    """Markdown whose formulas are MathML, which browsers draw without a script."""

    def block_math(self, body: str) -> str:
        """A formula on a line of its own."""
        return f"<p>{convert(body, display='block')}</p>"

    def inline_math(self, body: str) -> str:
        """A formula within a line."""
        return convert(body)

    def multiline_math(self, text: str) -> str:
        """A formula of several lines, its marks included."""
        return self.block_math(text.strip("$"))


class _Exporter(HTMLExporter):
    @pass_context
    def markdown2html(self, context: Any, source: str) -> str:
        """A markdown cell, its pictures embedded."""
        renderer = _Renderer(escape=False, path=str(places.NOTEBOOKS), embed_images=True)
        return MarkdownWithMath(renderer=renderer).render(source)


def _exporter() -> HTMLExporter:
    return _Exporter(
        extra_loaders=[FileSystemLoader(TEMPLATE.parent)],
        template_file=TEMPLATE.name,
        exclude_input_prompt=True,
        exclude_output_prompt=True,
    )
