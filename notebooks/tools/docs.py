"""Write the site of `make docs`: the decision page, the notebooks, and a page for each public name of szlib.

    python notebooks/tools/docs.py FOLDER

pdoc turns docstrings into HTML; the template and the style beside this file, in `docs`, make pages of them.
The report of the last run on the plaza, if there is one, is copied and linked.
"""

import inspect
import re
import shutil
import sys
import unicodedata
from functools import cached_property
from pathlib import Path

import yaml
from markupsafe import Markup
from pdoc.doc import Module
from pdoc.render import configure, env
from pdoc.render_helpers import to_html

import szlib
from szlib.files import claim_folder, write_file
from szlib.workbook.folders import list_notebooks
from szlib.workbook.report import write_report

ROOT = Path(__file__).resolve().parents[2]
# Each room, and the notebook of its names that no notebook uses.
ROOMS = {"tracks": "01", "encounters": "02", "zones": "05", "plaza": "05", "control": "08", "simulation": "09",
         "workbook": "00", "errors": "00", "files": "24", "memory": "24", "parallel": "24"}  # fmt: skip
NOTEBOOKS = {each.stem: each.read_text(encoding="utf-8") for each in list_notebooks()}
SECTION = re.compile(r"^(\w[\w ]*)\n-{3,}$", re.MULTILINE)
ENTRY = re.compile(r"^(\*{0,2}\w+(?:, \*{0,2}\w+)*) :(?: |$)(.*(?:\n(?: +.*|$))*)", re.MULTILINE)
MODULE = re.compile(r"^(\w[\w, ]*?) {2,}(?=\S)", re.MULTILINE)  # in the list at the top of a room
NOTEBOOK = re.compile(r"\]\((?:deeper/)?(\d\w+)\.ipynb\)")
CODE = re.compile(r"<code>(?:szlib\.)?(?:[a-z]+\.)?((?:\w+\.)?\w+)(?:\([^<]*\))?</code>")


def list_exports(module):
    """What a package imports, or another module defines: its public names."""
    home = "szlib" if hasattr(module, "__path__") else module.__name__
    public = ((n, value) for n, value in vars(module).items() if n[0] != "_" and not inspect.ismodule(value))
    return {name: value for name, value in public if getattr(value, "__module__", home).startswith(home)}


def find_notebooks(name, room):
    """The notebooks that use a name most, at most three; else the one of its room."""
    uses = {stem: len(re.findall(rf"\b{name}\b", text)) for stem, text in NOTEBOOKS.items()}
    used = [stem for stem in sorted(uses, key=uses.get, reverse=True) if uses[stem] and stem[:2] != "00"]
    return used[:3] or [stem for stem in NOTEBOOKS if stem.split("_")[0] == ROOMS[room]]


def read_docstring(value, name):
    """The docstring of a value, with that of its constructor; of a constant the text below it."""
    if callable(value) or inspect.ismodule(value) or isinstance(value, property | cached_property):
        own = vars(value).get("__init__") if inspect.isclass(value) else None
        return "\n\n".join(filter(None, (inspect.getdoc(value), own and inspect.getdoc(own))))
    homes = [m for key, m in sys.modules.items() if key[:6] == "szlib." and vars(m).get(name) is value]
    found = [Module(home).members[name].docstring for home in homes if name in Module(home).members]
    return max(found, key=len, default="")


def describe(name, value):
    """What the template shows of a value and, of a class, its methods and properties."""
    intro, *parts = SECTION.split(MODULE.sub(r"- **\1**: ", read_docstring(value, name)))
    entry = {"name": name, "value": value, "intro": intro, "parameters": [], "tables": {}, "members": []}
    entry["fields"] = getattr(value, "__dataclass_fields__", {})
    entry["sections"] = dict(zip(parts[::2], parts[1::2], strict=True))
    for base in value.__mro__[1:] if inspect.isclass(value) and "Parameters" not in entry["sections"] else ():
        found = SECTION.split(inspect.getdoc(base) or "") if base.__module__.startswith("szlib") else []
        entry["sections"] |= dict(zip(found[1::2], found[2::2], strict=True)) | entry["sections"]
    for title, text in entry["sections"].items():
        if title == "Parameters" or not ENTRY.sub("", text).strip():
            found = ENTRY.findall(text)
            entry["tables"][title] = {n.strip("* "): row for names, row in found for n in names.split(",")}
    if callable(value) and not (inspect.isclass(value) and issubclass(value, Exception)):
        given = inspect.signature(value).parameters.values()
        entry["parameters"] = [each for each in given if each.name not in ("self", "cls")]
    for each in inspect.classify_class_attrs(value) if inspect.isclass(value) else ():
        found = getattr(each.object, "__func__", each.object)  # of a class method
        is_shown = inspect.isfunction(found) or isinstance(found, property | cached_property)
        if is_shown and each.name[0] != "_" and each.defining_class.__module__.startswith("szlib"):
            entry["members"].append(describe(f"{name}.{each.name}", found))
    return entry


def make_bibtex(citation):
    """Entries for the paper, szlib and the data, from CITATION.cff."""
    kinds = {"article": "article", "conference-paper": "inproceedings"}
    copied = {
        "journal": "journal",
        "volume": "volume",
        "issue": "number",
        "version": "version",
        "doi": "doi",
        "url": "url",
    }
    text = ""
    for each in (citation["preferred-citation"], citation, *citation["references"]):
        names = [", ".join((a["family-names"], a["given-names"])) if "given-names" in a else f"{{{a['name']}}}"
                 for a in each["authors"]]  # fmt: skip
        year = each.get("year") or each["date-released"].year
        first = unicodedata.normalize("NFKD", each["authors"][0].get("family-names", "szlib"))
        fields = {"author": " and ".join(names), "title": f"{{{each['title']}}}", "year": year}
        fields |= {name: each[key] for key, name in copied.items() if key in each}
        fields |= {"booktitle": each["conference"]["name"]} if "conference" in each else {}
        lines = "".join(f",\n  {name} = {{{value}}}" for name, value in fields.items())
        text += f"@{kinds.get(each['type'], 'misc')}{{{first.encode('ascii', 'ignore').decode()}{year}{lines}\n}}\n"
    return text


def write_site(site):
    """Write every page but the notebooks and the report into the folder `site`."""
    rooms = {room: [describe(*each) for each in list_exports(getattr(szlib, room)).items()] for room in ROOMS}
    pages = {"index": ("", []), "which_settings": ("", [])}
    for room, entries in rooms.items():
        pages |= {
            f"szlib.{each['name']}": (room, [each]) for each in entries if each["name"] in szlib.__all__
        }
        others = [each for each in entries if each["name"] not in szlib.__all__]
        pages[f"szlib.{room}"] = room, [describe(room, getattr(szlib, room)), *others]
    links = {each["name"]: f"{page}.html#{each['name']}" for page, (_, entries) in pages.items()
             for entry in entries for each in (entry, *entry["members"])}  # fmt: skip

    def link(code):
        return f'<a href="{links[code[1]]}">{code[0]}</a>' if code[1] in links else code[0]

    def render(text):
        return Markup(CODE.sub(link, to_html(NOTEBOOK.sub(r"](notebooks/report.html#\1)", text))))

    configure(template_directory=Path(__file__).parent / "docs")
    env.filters |= {"html": render}
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    known = {"rooms": rooms, "pages": pages, "notebooks": NOTEBOOKS, "find_notebooks": find_notebooks, "public": szlib.__all__, "citation": citation, "bibtex": make_bibtex(citation),
             "root": ROOT, "site": site}  # fmt: skip
    template = env.get_template("page.html.jinja2")
    for page, (room, entries) in pages.items():
        write_file(site / f"{page}.html", template.render(known, page=page, room=room, entries=entries))


if __name__ == "__main__":
    home = claim_folder(Path(sys.argv[1]) / "notebooks", "results of the committed notebooks")
    for script in list_notebooks():
        shutil.copy(script.with_suffix(".ipynb"), home)
    write_report(home)
    if (report := ROOT / "results" / "synthetic" / "report.html").exists():
        shutil.copy(report, sys.argv[1])
    write_site(Path(sys.argv[1]))
