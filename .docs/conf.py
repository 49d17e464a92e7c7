"""The site of `make docs`: README, notebooks, the page of decisions, every public name, changes.

Sphinx with myst-nb makes it without a network. `copy_pages` makes the copies that it reads, in `.docs/pages`.

Environment variables: $SZLIB_REPOSITORY, such as OWNER/szlib on GitHub, adds links to Binder and Colab;
$SZLIB_DOCS_NOTEBOOKS, such as "07*", makes a site of these notebooks only, for a test.
"""

import importlib
import inspect
import os
import re
import shutil
import unicodedata
from pathlib import Path

import nbformat
import yaml
from docutils import nodes
from latex2mathml.converter import convert

import szlib
from szlib.core.files import claim_folder

HERE = Path(__file__).parent
ROOT, PAGES = HERE.parent, HERE / "pages"
NOTEBOOKS = ROOT / "notebooks"
ONLY = os.environ.get("SZLIB_DOCS_NOTEBOOKS", "*")
ROOMS = (
    "core.errors",
    "tracks",
    "encounters",
    "zones",
    "plaza",
    "control",
    "simulation",
    "workbook",
)
# The fields of CITATION.cff, and those of BibTeX.
FIELDS = {
    "journal": "journal",
    "collection-title": "booktitle",
    "volume": "volume",
    "issue": "number",
}
FIELDS |= {"version": "version", "doi": "doi", "url": "url"}
REPOSITORY = os.environ.get("SZLIB_REPOSITORY", "")

project, html_title, release = "szlib", "szlib", szlib.__version__
author = "the authors of szlib"
extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
exclude_patterns = ["README.md"]  # the first page includes it
html_theme = "furo"
html_math_renderer = "mathml"
html_show_search_summary = False  # a page from a file may not read others
nb_execution_mode = "off"
nb_ipywidgets_js = {}  # no scripts of other servers
nb_render_image_options = {"width": "100%"}
myst_enable_extensions = ["dollarmath", "amsmath"]
myst_heading_anchors = 3
autodoc_member_order = "bysource"
autodoc_typehints = "none"
autodoc_preserve_defaults = True
napoleon_use_param = False
napoleon_use_rtype = False
napoleon_use_ivar = True
suppress_warnings = ["myst.xref_missing", "myst.header", "mystnb.unknown_mime_type"]
# The anchor of a link to a heading of a notebook.
ANCHOR = re.compile(r"(?<=\.ipynb)#(?:[^()\s]|\([^()\s]*\))+(?=\))")
# Links of a page that has another place in the site.
MOVED = {
    "README.md": {"](.github/CONTRIBUTING.md": "](CONTRIBUTING.md"},
    "CONTRIBUTING.md": {"](../README.md": "](index.md", "](../": "]("},
}


def copy_pages(*_):
    """Copy the pages of the site to where Sphinx reads them, and write its first page and its navigation."""
    shutil.rmtree(PAGES, ignore_errors=True)
    for source in sorted(NOTEBOOKS.glob("**/*.ipynb")):
        if source.match(ONLY) and ".ipynb_checkpoints" not in source.parts:
            copy_notebook(source, PAGES / "notebooks" / source.relative_to(NOTEBOOKS))
    shutil.copytree(NOTEBOOKS / "figures", PAGES / "notebooks" / "figures")
    names = ("which_settings", "reference", "for_lecturers", "project/README")
    texts = [f"notebooks/{name}" for name in names]
    for name in ("README", "CHANGELOG", *texts):
        (PAGES / name).parent.mkdir(exist_ok=True)
        shutil.copy(ROOT / f"{name}.md", PAGES / f"{name}.md")
    shutil.copy(ROOT / ".github" / "CONTRIBUTING.md", PAGES)
    for name, links in MOVED.items():
        text = (PAGES / name).read_text(encoding="utf-8")
        for before, after in links.items():
            text = text.replace(before, after)
        (PAGES / name).write_text(text, encoding="utf-8")
    (PAGES / "cite.md").write_text(
        f"# Cite\n\n```bibtex\n{make_bibtex()}```\n", encoding="utf-8"
    )
    (PAGES / "api").mkdir()
    for room in ROOMS:
        (PAGES / "api" / f"{room}.rst").write_text(
            describe_room(room), encoding="utf-8"
        )
    parts = {
        "Chapters": find_pages("notebooks/[0-9]*.ipynb"),
        "Deeper": find_pages("notebooks/deeper/*.ipynb"),
        "Exercises": [
            *find_pages("notebooks/exercises/*.ipynb"),
            *find_pages("notebooks/solutions/*.ipynb"),
        ],
        "The real day": find_pages("notebooks/real_day/*.ipynb"),
        "Look up": texts,
        "Package": [f"api/{room}" for room in ROOMS],
        "Project": ["CHANGELOG", "CONTRIBUTING", "cite"],
    }
    lines = []
    for name, pages in parts.items():
        lines += [
            "```{toctree}",
            f":caption: {name}",
            ":hidden:",
            "",
            *pages,
            "```",
            "",
        ]
    lines += ["```{include} README.md", "```", ""]
    (PAGES / "index.md").write_text("\n".join(lines), encoding="utf-8")


def claim_site(app, _):
    """Mark the folder of the site, which lies among the results of `szlib run`."""
    if not any(Path(app.outdir).iterdir()):
        claim_folder(app.outdir, "site of the docs")


def show_text(app, doctree, name):
    """Show a link to a file that is no page of the site as its text."""
    elements = doctree.findall(nodes.Element)
    anchors = {each for element in elements for each in element["ids"]}
    for link in list(doctree.findall(nodes.reference)):
        target = link.get("refuri") or f"#{link.get('refid')}"
        if target[0] == "#" and target[1:] not in anchors:
            link.replace_self(link.children)


def finish_site(app, _):
    """Remove the pictures that myst-nb leaves beside the site, and copy those that pages show by HTML."""
    site = Path(app.outdir)
    shutil.rmtree(site.parent / "jupyter_execute", ignore_errors=True)
    figures = site / "notebooks" / "figures"
    shutil.copytree(NOTEBOOKS / "figures", figures, dirs_exist_ok=True)


def find_pages(pattern):
    """The names of the copied pages that match a pattern, in their order."""
    return [
        file.relative_to(PAGES).with_suffix("").as_posix()
        for file in sorted(PAGES.glob(pattern))
    ]


def copy_notebook(source, target):
    """Copy an executed notebook; the alternative text of its pictures goes where myst-nb looks for it."""
    notebook = nbformat.read(source, as_version=4)
    for cell in notebook.cells:
        if cell.cell_type == "markdown":
            # JupyterLab and MyST make anchors of headings each in their own way
            cell.source = ANCHOR.sub(
                lambda link: re.sub(r"[^\w#-]", "", link[0].lower()), cell.source
            )
        for output in cell.get("outputs", ()):
            if alt := output.get("metadata", {}).get("image/png", {}).get("alt"):
                cell.metadata["mystnb"] = {"image": {"alt": alt}}
    if REPOSITORY:
        place = source.relative_to(ROOT).as_posix()
        binder = f"https://mybinder.org/v2/gh/{REPOSITORY}/main?labpath={place}"
        colab = (
            f"https://colab.research.google.com/github/{REPOSITORY}/blob/main/{place}"
        )
        links = f"[Open in Binder]({binder}) · [Open in Colab]({colab})"
        notebook.cells.insert(1, nbformat.v4.new_markdown_cell(links))
    target.parent.mkdir(parents=True, exist_ok=True)
    nbformat.write(notebook, target)


def make_bibtex():
    """The entries of CITATION.cff for BibTeX: szlib, the paper, and the data."""
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    text = ""
    for work in [citation, *citation["references"]]:
        kind = {"article": "article", "conference-paper": "inproceedings"}.get(
            work["type"], "misc"
        )
        people = [
            f"{a['family-names']}, {a['given-names']}"
            if "family-names" in a
            else f"{{{a['name']}}}"
            for a in work["authors"]
        ]
        first = unicodedata.normalize(
            "NFKD", work["authors"][0].get("family-names", "szlib")
        )
        year = work.get("year") or work["date-released"].year
        fields = {
            "author": " and ".join(people),
            "title": f"{{{work['title']}}}",
            "year": year,
        }
        fields |= {field: work[key] for key, field in FIELDS.items() if key in work}
        lines = "".join(f"  {name} = {{{value}}},\n" for name, value in fields.items())
        text += (
            f"@{kind}{{{first.encode('ascii', 'ignore').decode()}{year},\n{lines}}}\n\n"
        )
    return text


def describe_room(room):
    """The page of a room: its own text, and a directive for each of its public names."""
    title = f"szlib.{room}"
    module = importlib.import_module(title)
    lines = [
        title,
        "=" * len(title),
        "",
        f".. automodule:: {title}",
        "   :no-members:",
        "",
    ]
    for name in sorted(each for each in dir(module) if each[0] != "_"):
        value = getattr(module, name)
        if inspect.isclass(value) and "szlib" in value.__module__:
            lines += [f".. autoclass:: {title}.{name}", "   :members:", ""]
        elif inspect.isroutine(value) and "szlib" in value.__module__:
            lines += [f".. autofunction:: {title}.{name}", ""]
    return "\n".join(lines)


def adapt_docstring(app, what, name, obj, options, lines):
    """Turn the docstrings of szlib into those that napoleon and docutils expect.

    The meaning of a parameter goes below its name, a list of modules gets bullets, and names in single
    backticks are code.
    """
    for at in reversed(range(len(lines))):
        lines[at] = re.sub(r"(?<!`)`([^`\n]+)`(?!`)", r"``\1``", lines[at])
        lines[at] = re.sub(r"\|(\w+)\|", r"\\|\1\\|", lines[at])
        if entry := re.match(r"(\*{0,2}\w+(?:, \*{0,2}\w+)*) : (.*)$", lines[at]):
            lines[at : at + 1] = [entry[1], f"    {entry[2]}"]
        elif what == "module" and (
            entry := re.match(r"(\w[\w, ]*?) {2,}(\S.*)$", lines[at])
        ):
            lines[at : at + 1] = [f"- **{entry[1]}**: {entry[2]}", ""]


def draw_formula(translator, node):
    """Draw a formula as MathML, which browsers show without a script."""
    display = "block" if node.tagname == "math_block" else "inline"
    translator.body.append(
        convert(re.sub(r"\\(tag|label)\{.*?\}", "", node.astext()), display=display)
    )
    raise nodes.SkipNode


def setup(app):
    """Connect what this file defines."""
    app.add_html_math_renderer("mathml", (draw_formula, None), (draw_formula, None))
    app.connect("config-inited", claim_site)
    app.connect("config-inited", copy_pages)
    app.connect("build-finished", finish_site)
    app.connect("doctree-resolved", show_text)
    app.connect("autodoc-process-docstring", adapt_docstring, priority=400)
