"""Make slides and handouts of the executed copies of the notebooks, and one folder of their figures: `make slides`.

    python notebooks/tools/slides.py                       all notebooks but the map, 00, to results/slides
    python notebooks/tools/slides.py 07 08                 some of them

The rules: the title and each heading `##` start a slide. Code is shown if it is visible in the notebook and has at
most 12 lines. Hidden cells, and longer ones, show their figures and sentences only. The text of a fold appears at a
key press. The navigation is a note for the speaker. A slide that is half full ends before the next idea: a paragraph
that begins in bold, such as a question. What does not fit goes on below it.

A handout is the chapter as PDF: hidden code and the text of folds, which are the answers, are left out. Chromium prints
it, by nbconvert's webpdf; where there is none, a line says so. Decks hold reveal.js (reveal.js-4.6.1, MIT licence) and
need no network.
"""

import argparse
import math
import re
import shutil
import struct
from base64 import b64decode
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from copy import deepcopy
from pathlib import Path

import nbformat
from jinja2 import FileSystemLoader
from nbconvert import SlidesExporter, WebPDFExporter
from nbconvert.filters.markdown_mistune import MarkdownWithMath
from nbformat import NotebookNode
from nbformat.v4 import new_code_cell, new_markdown_cell

from szlib.core.files import claim_folder, write_file
from szlib.workbook import folders
from szlib.workbook.report import MathRenderer

REVEAL = Path(__file__).with_suffix("") / "reveal.js-4.6.1"
BROWSERS = "chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "microsoft-edge"
OUT = Path(__file__).parents[2] / "results" / "slides"
MAX_CODE, MAX_ROWS, MAX_TEXT = 12, 8, 12
"""Lines of code, rows of a table, and lines of printed text that a slide shows."""
LINES, WIDTH = 20, 95
"""Lines of text on a slide, and letters in a line."""
SLIDE, FIGURE, PIXELS = 1200, 560, 33
"""Width of a slide, largest height of a figure, and height of a line [pixels]."""
MARGINS = "top", "bottom", "left", "right"
NAVIGATION = "**Afterwards you can**"
FOLD = re.compile(r"<details>\s*<summary>(.*?)</summary>(.*?)</details>", re.DOTALL)
LINK = re.compile(r"(?<!!)\[([^\]]+)\]\((?!https?:|#)([^)]*)\)")
NAME = re.compile(r'record\.(?:figure|animation)\([^"]*"([\w-]+)"')


# --- from a notebook to slides ------------------------------------------------------------------------


def make_slides(notebook: NotebookNode) -> NotebookNode:
    """The slides of an executed notebook: its parts as cells with the tags of nbconvert."""
    slides, heading, used = nbformat.v4.new_notebook(), "", 0.0
    for kind, part in split_notebook(notebook):
        height = 0.0 if kind == "notes" else measure_height(part)
        if kind == "slide":
            heading, used = part.source.splitlines()[0].lstrip("# "), 0.0
        elif used + height > LINES or (used > LINES / 2 and is_idea(part)):
            slides.cells.append(_tag(new_markdown_cell(f"## {heading} (continued)"), "subslide"))
            used = measure_height(slides.cells[-1])
            kind = "-"  # a slide of its own is a key press already
        used += height
        slides.cells.append(_tag(part, kind))
    for number, cell in enumerate(slides.cells):
        cell.id = f"slide-{number}"
    return slides


def is_idea(part: NotebookNode) -> bool:
    """Whether a part is a paragraph that begins in bold."""
    return part.cell_type == "markdown" and part.source.startswith("**")


def _tag(cell: NotebookNode, kind: str) -> NotebookNode:
    cell.metadata["slideshow"] = {"slide_type": kind}
    return cell


def split_notebook(notebook: NotebookNode) -> Iterator[tuple[str, NotebookNode]]:
    """The parts of a notebook that slides show, each with its kind, the `slide_type` of nbconvert."""
    for cell in notebook.cells:
        if cell.cell_type == "code":
            yield from split_code(cell)
        elif NAVIGATION in cell.source:
            yield "notes", new_markdown_cell(cell.source)
        elif cell.cell_type == "markdown":
            yield from split_text(cell.source)


def split_text(text: str) -> Iterator[tuple[str, NotebookNode]]:
    """The paragraphs of a Markdown text; a fold is one part, a fragment, which appears at a key press."""
    outside, *folds = FOLD.split(text)
    for block in split_blocks(outside):
        yield ("slide" if block.startswith(("# ", "## ")) else "-"), new_markdown_cell(block)
    for summary, inside, after in zip(folds[::3], folds[1::3], folds[2::3], strict=True):
        gap = " " if inside.strip()[:1].isalnum() else "\n\n"  # before a table, a list or a formula
        yield "fragment", new_markdown_cell(f"**{summary.strip()}.**{gap}{inside.strip()}")
        yield from split_text(after)


def split_blocks(text: str) -> list[str]:
    """The headings, paragraphs, lists, formulas and code blocks of a Markdown text."""
    blocks, is_open = [""], False
    for line in text.splitlines():
        is_heading = not is_open and line.startswith("#")
        if is_heading or (not is_open and (not line.strip() or blocks[-1].startswith("#"))):
            blocks.append("")
        is_open ^= line.startswith("```") or line.count("$$") % 2 == 1
        blocks[-1] += f"{line}\n"
    return [block.strip("\n") for block in blocks if block.strip()]


def split_code(cell: NotebookNode) -> Iterator[tuple[str, NotebookNode]]:
    """What slides show of a code cell: its code with what it prints, then each figure, table and sentence."""
    is_hidden = cell.metadata.get("jupyter", {}).get("source_hidden", False)
    is_hidden |= "parameters" in cell.metadata.get("tags", ())
    is_hidden |= len(cell.source.strip().splitlines()) > MAX_CODE
    if not is_hidden:
        prints = [each for each in cell.outputs if 0 < count_lines(each) <= MAX_TEXT]
        yield "-", new_code_cell(cell.source, outputs=deepcopy(prints))
    for output in cell.outputs:
        data = output.get("data", {})
        html = data.get("text/html", "")
        is_table = not is_hidden and 0 < html.count("<tr") <= MAX_ROWS + 1
        if "image/png" in data or "szlib-player" in html or is_table:
            alone = new_code_cell("", outputs=[deepcopy(output)])
            alone.metadata["transient"] = {"remove_source": True}
            yield "-", alone
        elif "text/markdown" in data:
            yield from split_text(data["text/markdown"])


def count_lines(output: NotebookNode) -> int:
    """The lines of an output that is text only; 0 of another one."""
    text = output.get("text", "")
    if set(data := output.get("data", {})) == {"text/plain"}:
        text = data["text/plain"]
    return len(text.splitlines())


def measure_height(part: NotebookNode) -> float:
    """The height of a part of a slide, in lines of text: an estimate."""
    if part.cell_type == "markdown":
        lines = re.sub(r"(?<=[^\n|$])\n(?=[\w(\"*`])", " ", part.source).splitlines()  # a paragraph is one
        return 0.5 + sum(
            1.5 if line.startswith(("#", "$$")) else math.ceil(len(line) / WIDTH) for line in lines
        )
    height = 0.75 * len(part.source.splitlines()) + 0.5
    for output in part.outputs:
        html = output.get("data", {}).get("text/html", "")
        if picture := output.get("data", {}).get("image/png"):
            width, high = struct.unpack(">II", b64decode(picture)[16:24])  # of the header of a PNG
            height += min(high * min(1.0, SLIDE / width), FIGURE) / PIXELS
        else:
            height += FIGURE / PIXELS if "szlib-player" in html else html.count("<tr")
        height += 0.75 * count_lines(output)
    return height


# --- writing ------------------------------------------------------------------------------------------


def list_figures(notebook: NotebookNode, stem: str) -> dict[str, bytes]:
    """The figures of a notebook as PNG, by the name of the file: that of the figures of a run."""
    figures: dict[str, bytes] = {}
    for cell in notebook.cells:
        names = NAME.findall(cell.source)
        for output in cell.get("outputs", ()):
            if (picture := output.get("data", {}).get("image/png")) is not None:
                name = names.pop(0) if names else f"figure-{len(figures) + 1}"
                figures[f"{stem}-{name}.png"] = b64decode(picture)
    return figures


def render(text: str, stems: set[str]) -> str:
    """The HTML of a Markdown text with MathML and pictures in it; links lead to the decks `stems`."""
    targets = {link: Path(link[1].partition("#")[0]).stem for link in LINK.findall(text)}
    for (label, path), target in targets.items():
        link = f"[{label}]({target}.html)" if target in stems else label
        text = text.replace(f"[{label}]({path})", link)
    renderer = MathRenderer(escape=False, path=str(folders.NOTEBOOKS), embed_images=True)
    return MarkdownWithMath(renderer=renderer).render(text)


def export(slides: NotebookNode, stem: str, stems: set[str]) -> str:
    """The deck as HTML with reveal.js in it; links lead to the decks `stems`."""
    exporter = SlidesExporter(
        extra_loaders=[FileSystemLoader(Path(__file__).with_suffix(""))],
        extra_template_basedirs=[],  # not the current folder, which is the default
        template_file="deck.html.j2",
        reveal_url_prefix=REVEAL.name,
        reveal_theme="white",
        exclude_input_prompt=True,
        exclude_output_prompt=True,
    )
    exporter.register_filter("markdown2html", lambda text: render(text, stems))
    html, _ = exporter.from_notebook_node(slides, resources={"metadata": {"name": stem}})
    return embed_reveal(html)


def embed_reveal(html: str) -> str:
    """The deck with the files of reveal.js in it; its theme then has the fonts of the system."""

    def read(path: str) -> str:
        text = (REVEAL / Path(path).name).read_text(encoding="utf-8")
        return re.sub(r"@import [^;]+;", "", text).replace("</script", "<\\/script")

    html = re.sub(
        rf'<link [^>]*href="{REVEAL.name}/([^"]+)"[^>]*>', lambda m: f"<style>{read(m[1])}</style>", html
    )
    return re.sub(
        rf'<script src="{REVEAL.name}/([^"]+)"></script>', lambda m: f"<script>{read(m[1])}</script>", html
    )


class HandoutExporter(WebPDFExporter):
    """nbconvert's webpdf with the Chromium of this machine, whose pages ask no server."""

    def run_playwright(self, html: str) -> bytes:
        """The page as PDF; a thread of its own has no loop of a notebook."""
        with ThreadPoolExecutor(1) as pool:
            return pool.submit(self.print_page, html).result()

    def print_page(self, html: str) -> bytes:
        """The page as PDF, in a thread without a loop."""
        from playwright.sync_api import sync_playwright

        with sync_playwright() as driver:
            browser = driver.chromium.launch(executable_path=find_browser(), args=["--no-sandbox"])
            page = browser.new_page(offline=True)
            page.set_content(html)
            page.add_style_tag(content="pre { white-space: pre-wrap !important; }")
            content = page.pdf(format="A4", print_background=True, margin=dict.fromkeys(MARGINS, "12mm"))
            browser.close()
        return content


def find_browser() -> str | None:
    """The path of a Chromium on this machine."""
    return next((path for name in BROWSERS if (path := shutil.which(name))), None)


def make_handout(notebook: NotebookNode, stem: str) -> bytes:
    """The chapter as PDF, without hidden code, checks and answers."""
    handout = deepcopy(notebook)
    for cell in handout.cells:
        if cell.cell_type == "markdown":
            _, aims, text = cell.source.rpartition(NAVIGATION)  # its links lead nowhere on paper
            cell.source = FOLD.sub("", aims + text)
            continue
        if is_hidden := cell.metadata.get("jupyter", {}).get("source_hidden", False):
            cell.outputs = [each for each in cell.outputs if each.output_type != "stream"]
        cell.metadata["transient"] = {"remove_source": is_hidden}
        for data in (each.data for each in cell.outputs if "text/markdown" in each.get("data", {})):
            data["text/markdown"] = FOLD.sub("", data["text/markdown"])
    exporter = HandoutExporter(exclude_input_prompt=True, exclude_output_prompt=True, embed_images=True)
    exporter.register_filter("markdown2html", lambda text: render(text, set()))
    content, _ = exporter.from_notebook_node(handout, resources={"metadata": {"name": stem}})
    return content


def main(arguments: list[str] | None = None) -> None:
    """Write the decks and the figures that the command line names."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("names", nargs="*", help="numbers of notebooks; default: all")
    parser.add_argument("--out", type=Path, default=OUT)
    given = parser.parse_args(arguments)
    (claim_folder(given.out, "slides of the notebooks") / "figures").mkdir(exist_ok=True)
    sources = [source for source in folders.list_notebooks() if not folders.has_name(source, "00")]
    stems = {source.stem for source in sources}
    for source in sources:
        if given.names and not any(folders.has_name(source, name) for name in given.names):
            continue
        notebook = nbformat.read(source.with_suffix(".ipynb"), as_version=4)
        figures = list_figures(notebook, source.stem)
        for name, content in figures.items():
            write_file(given.out / "figures" / name, content, durable=False)
        html = export(make_slides(notebook), source.stem, stems)
        write_file(given.out / f"{source.stem}.html", html, durable=False)
        if has_browser := find_browser() is not None:
            write_file(given.out / f"{source.stem}.pdf", make_handout(notebook, source.stem), durable=False)
        made = "deck and handout" if has_browser else "deck; no handout, since there is no Chromium"
        print(f"{given.out / source.stem}: {made}, {len(figures)} figures")


if __name__ == "__main__":
    main()
