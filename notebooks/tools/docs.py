"""Write the site of `make docs`: the decision page, the reference, the notebooks, and a page for each public name of szlib.

    python notebooks/tools/docs.py FOLDER

pdoc turns docstrings into HTML; the template and the style beside this file, in `docs`, make pages of them.
The report of the last run on the plaza, if there is one, is copied and linked.
"""

import inspect
import re
import shutil
import sys
from pathlib import Path
from unicodedata import normalize

import yaml
from pdoc.doc import Module
from pdoc.render import configure, env
from pdoc.render_helpers import to_html

import szlib
from szlib.core.files import claim_folder, write_file
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
CODE = re.compile(r"<code>(?:szlib\.)?(?:[a-z]+\.)?((?:\w+\.)?\w+)(?:\([^<]*\))?</code>")


def list_exports(module):
    """What a package imports, or another module defines: its public names."""
    home = "szlib" if hasattr(module, "__path__") else module.__name__
    # a lazy package lists its names by `dir`
    named = ((n, getattr(module, n)) for n in dir(module) if n[0] != "_")
    public = ((n, value) for n, value in named if not inspect.ismodule(value))
    return {name: value for name, value in public if getattr(value, "__module__", home).startswith(home)}


def find_notebooks(name, room):
    """The notebooks that use a name most, at most three; else the one of its room."""
    uses = {n: len(re.findall(rf"\b{name}\b", text)) for n, text in NOTEBOOKS.items() if n[:2] > "00"}
    used = [stem for stem in sorted(uses, key=uses.get, reverse=True)[:3] if uses[stem]]
    return used or [stem for stem in NOTEBOOKS if stem.split("_")[0] == ROOMS[room]]


def read_docstring(value, name):
    """The docstring of a value, with that of its constructor; of a constant the text below it."""
    if inspect.getdoc(value) != inspect.getdoc(type(value)):
        own = vars(value).get("__init__") if inspect.isclass(value) else None
        return f"{inspect.getdoc(value)}\n\n{inspect.cleandoc(getattr(own, '__doc__', None) or '')}"
    homes = [Module(m) for k, m in sys.modules.items() if k[:6] == "szlib." and vars(m).get(name) is value]
    return max((home.members[name].docstring for home in homes if name in home.members), key=len, default="")


def describe(name, value):
    """What the template shows of a value and, of a class, its methods and properties."""
    intro, *parts = SECTION.split(MODULE.sub(r"- **\1**: ", read_docstring(value, name)))
    sections, tables, members = dict(zip(parts[::2], parts[1::2], strict=True)), {}, []
    for title, text in sections.items():
        if title == "Parameters" or not ENTRY.sub("", text).strip():
            rows = ENTRY.findall(text)
            tables[title] = {each.strip("* "): row for names, row in rows for each in names.split(",")}
    # An error, which has args, takes a text only.
    given = inspect.signature(value).parameters if callable(value) and not hasattr(value, "args") else {}
    for each in inspect.classify_class_attrs(value) if inspect.isclass(value) else ():
        found = getattr(each.object, "__func__", each.object)  # of a class method
        is_shown = type(found).__name__ in ("function", "property", "cached_property")
        if is_shown and each.name[0] != "_" and each.defining_class.__module__.startswith("szlib"):
            members.append(describe(f"{name}.{each.name}", found))
    return {"name": name, "value": value, "intro": intro, "sections": sections, "tables": tables,
            "members": members, "fields": getattr(value, "__dataclass_fields__", {}),
            "parameters": [each for key, each in given.items() if key not in ("self", "cls")],
            "bases": [describe(b.__name__, b) for b in getattr(value, "__mro__", ())[1:] if "szlib" in b.__module__]}  # fmt: skip


def write_site(site):
    """Write every page but the notebooks and the report into the folder `site`."""
    rooms = {room: [describe(*each) for each in list_exports(getattr(szlib, room)).items()] for room in ROOMS}
    pages = {"index": ("", []), "which_settings": ("", []), "reference": ("", [])}
    for room, entries in rooms.items():
        pages |= {f"szlib.{e['name']}": (room, [e]) for e in entries if e["name"] in szlib.__all__}
        others = [entry for entry in entries if entry["name"] not in szlib.__all__]
        pages[f"szlib.{room}"] = room, [describe(room, getattr(szlib, room)), *others]
    links = {each["name"]: f'<a href="{page}.html#{each["name"]}">{{}}</a>' for page, (_, shown) in pages.items()
             for entry in shown for each in (entry, *entry["members"])}  # fmt: skip

    def render(text):
        text = re.sub(r"\]\((?:deeper/)?(\d\w+)\.ipynb\)", r"](notebooks/report.html#\1)", text)
        text = re.sub(r"\]\((\w+)\.md\)", r"](\1.html)", text)
        return CODE.sub(lambda code: links.get(code[1], "{}").format(code[0]), to_html(text))

    configure(template_directory=Path(__file__).parent / "docs")
    env.filters |= {"html": render, "yaml": yaml.safe_load}
    known = {"rooms": rooms, "pages": pages, "notebooks": NOTEBOOKS, "find_notebooks": find_notebooks,
             "public": szlib.__all__, "root": ROOT, "site": site, "normalize": normalize}  # fmt: skip
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
