"""An adversary: modules among the data, other people's kernels and temporary folders, foreign results.

Every command is called as an installed script is, in a folder of data that also holds a module for each name
that Python, szlib or Jupyter imports, and settings of other programs.  Each module would leave a mark.
Reports are made of results that somebody else has changed: scripts in every text, other types, links, pipes.
"""

from __future__ import annotations

import json
import os
import random
import shutil
import subprocess
import sys
import tempfile
from base64 import b64encode
from collections import Counter
from collections.abc import Iterator
from hashlib import sha256
from pathlib import Path
from typing import Any

from bs4 import BeautifulSoup
from commands import execute, import_slow_modules, in_a_fork, judge
from processes import contents, environment, furnish, make_reference

REPORTS = 1000
PLANTED = [
    *sys.stdlib_module_names, "joblib", "numpy", "pandas", "scipy", "sklearn", "matplotlib", "casadi", "daqp",
    "polars", "pyarrow", "shapely", "filelock", "psutil", "pooch", "tqdm", "threadpoolctl", "lazy_loader",
    "cloudpickle", "loky", "jupytext", "papermill", "nbformat", "nbclient", "nbconvert", "ipykernel",
    "IPython", "ipykernel_launcher", "jupyter_client", "jupyter_core", "zmq", "tornado", "traitlets",
    "anywidget", "ipywidgets", "jinja2", "bs4", "latex2mathml", "distributed", "dask", "szlib", "studies",
    "laboratory", "helpers", "sitecustomize", "usercustomize", "conftest", "ipython_config",
    "ipython_kernel_config", "jupyter_config", "typing_extensions", "matplotlib_inline", "debugpy", "comm",
    "decorator",
]  # fmt: skip
KERNEL = {"display_name": "python3", "language": "python"}
SCRIPTS = [
    "<script>pwned()</script>", '"><img src=x onerror=pwned()>', "<svg/onload=pwned()>", "{{ pwned() }}",
    "</style><script>pwned()", "[x](javascript:pwned())", "<iframe srcdoc='<script>pwned()</script>'>",
    "$<script>pwned()$", "--><script>pwned()</script>", "\u2028<a href=javascript:pwned()>",
]  # fmt: skip
OTHERS = [
    None,
    True,
    -1,
    1e308,
    "",
    [],
    {},
    [[]],
    {"a": 1},
    "x" * 100_000,
    float("nan"),
    10**400,
]


def attack(long: bool, seed: int = 0) -> dict[str, int]:
    """Count what ran that must not, and, in the long form, reports that are not as they should be."""
    tally = Counter(
        {
            "broken: foreign code ran": 0,
            "broken: other results": 0,
            "broken: reports": 0,
        }
    )
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        commands = (
            furnish(place, days=4) if long else furnish(place, days=2, encounters=10)
        )
        if not long:
            del commands["run"]
        references = {
            name: make_reference(name, command, place)
            for name, command in commands.items()
            if long
        }
        plant(place)
        for name, command in commands.items():
            among_data(name, command, place, references.get(name), tally)
        if long:
            attack_reports(REPORTS, place, random.Random(seed), tally)
    return dict(tally)


# foreign code


def plant(place: Path) -> None:
    """Put modules and settings into a folder of downloads, and a kernel and folders where szlib looks."""
    mark = f"open({str(place / 'mark')!r}, 'a').write(__file__ + chr(10))\nraise ImportError(__file__)\n"
    (place / "downloads").mkdir()
    for name in PLANTED:
        (place / "downloads" / f"{name}.py").write_text(mark)
    rules = "figure.facecolor: red\nsavefig.dpi: 7\nbackend: module://joblib\n"
    (place / "downloads" / "matplotlibrc").write_text(rules)
    (place / "precious").mkdir()
    (place / "precious" / "thesis.txt").write_text("not yours")
    (place / "precious" / ".szlib-lock").write_text("not a lock")
    (place / "tmp" / "szlib-link").symlink_to(place / "precious")
    (place / "tmp" / "szlib-locked").mkdir()
    (place / "tmp" / "szlib-locked" / ".szlib-lock").symlink_to(
        place / "precious" / "thesis.txt"
    )
    kernel = place / "jupyter" / "kernels" / "python3"
    kernel.mkdir(parents=True)
    argv = [sys.executable, str(place / "downloads" / "joblib.py")]
    (kernel / "kernel.json").write_text(json.dumps(KERNEL | {"argv": argv}))


def among_data(
    name: str,
    command: list[str],
    place: Path,
    reference: dict[str, bytes] | None,
    tally: Counter[str],
) -> None:
    """Call a command in the folder of downloads; its results are those of before, where these are known."""
    out, data = place / f"{name}-among", place / "downloads"
    done = subprocess.run(
        [*command, "--out", str(out)], cwd=data, capture_output=True, text=True, check=False,
        env=environment(place) | {"JUPYTER_PATH": str(place / "jupyter"), "PWD": str(data)},
    )  # fmt: skip
    tally["commands among planted modules"] += 1
    found = contents(out)
    if done.returncode or not found or found != (reference or found):
        print(
            f"{name}: exit code {done.returncode}, {sorted(found)}: {done.stderr[-1500:]}",
            file=sys.stderr,
        )
        tally["broken: other results"] += 1
    if (place / "mark").exists():
        print(
            f"{name}: ran {sorted(set((place / 'mark').read_text().split()))}",
            file=sys.stderr,
        )
        tally["broken: foreign code ran"] += 1
        (place / "mark").unlink()
    if (place / "precious" / "thesis.txt").read_text() != "not yours":
        print(f"{name}: a link in the temporary folder was followed", file=sys.stderr)
        tally["broken: other people's files"] += 1


# foreign results


def attack_reports(
    count: int, place: Path, rng: random.Random, tally: Counter[str]
) -> None:
    """Reports of changed results: refused by the name of a file, or without their scripts."""
    genuine = next((place / "run-reference").glob("*/summary.json")).parent
    home = place / "results" / "day"
    if in_a_fork(lambda: write_genuine(genuine)):
        raise RuntimeError("the report of genuine results could not be written")
    import_slow_modules()
    for _ in range(count):
        shutil.rmtree(home, ignore_errors=True)
        shutil.copytree(genuine, home)
        (home / "report.html").unlink(missing_ok=True)
        changes = [change(home, rng) for _ in range(rng.choice([1, 1, 2, 5]))]
        code, printed = execute(["report", str(home)], place)
        wrong = judge(code, printed)
        if not wrong and code == 2 and str(home) not in printed:
            wrong = "it names no file"
        if not wrong and code == 0:
            wrong = ", ".join(active(home / "report.html"))
        tally[f"reports that end with {code}"] += 1
        if wrong:
            print(
                f"report after {changes}: {code}: {wrong}: {printed[-1500:]}",
                file=sys.stderr,
            )
            tally["broken: reports"] += 1


def write_genuine(genuine: Path) -> None:
    """Write the report of genuine results once."""
    from szlib.workbook.report import write_report

    write_report(genuine)


def change(home: Path, rng: random.Random) -> str:
    """Change one file of the results; return what was done."""
    files = [f for f in home.rglob("*") if f.is_file() and not f.name.startswith(".")]
    if not files:
        return "nothing is left"
    file = rng.choice(sorted(files))
    kind = rng.choice(
        [
            "text",
            "text",
            "text",
            "type",
            "bytes",
            "link",
            "pipe",
            "folder",
            "gone",
            "huge",
        ]
    )
    texts = rng.choice(SCRIPTS) if kind == "text" else None
    if kind in ("text", "type") and file.suffix in (".json", ".ipynb"):
        try:
            tree = json.loads(file.read_text())
            where = rng.choice(list(places_in(tree)))
        except (ValueError, IndexError):  # damaged before, or no container any more
            return f"{file.name}: not again"
        step = tree
        for key in where[:-1]:
            step = step[key]
        step[where[-1]] = texts if kind == "text" else rng.choice(OTHERS)
        file.write_text(json.dumps(tree))
        return f"{file.name}: {where}: {str(step[where[-1]])[:60]}"
    if kind == "text":
        file.write_text(texts or "")
    elif kind == "bytes":
        content = bytearray(file.read_bytes() or b"x")
        content[rng.randrange(len(content))] ^= 1 << rng.randrange(8)
        file.write_bytes(content)
    else:
        file.unlink()
        {"link": lambda: file.symlink_to(file.name), "pipe": lambda: os.mkfifo(file), "folder": file.mkdir,
         "huge": lambda: file.write_bytes(b" " * (12 << 20))}.get(kind, str)()  # fmt: skip
    return f"{file.name}: {kind}"


def places_in(tree: Any, here: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """The path of every value in a JSON file."""
    items = (
        tree.items()
        if isinstance(tree, dict)
        else enumerate(tree)
        if isinstance(tree, list)
        else ()
    )
    for key, value in items:
        yield (*here, key)
        yield from places_in(value, (*here, key))


def active(page: Path) -> Iterator[str]:
    """What in a page runs foreign code, by its elements and its content security policy."""
    soup = BeautifulSoup(page.read_text(encoding="utf-8"), "html.parser")
    tag = soup.find("meta", attrs={"http-equiv": "Content-Security-Policy"})
    policy = str(tag["content"]).split(";") if tag else []
    rules = dict(rule.split(maxsplit=1) for rule in policy if " " in rule.strip())
    allowed = rules.get("script-src", rules.get("default-src", "'unsafe-inline'"))
    inline = "'unsafe-inline'" in allowed
    for script in soup.find_all("script"):
        hashed = b64encode(sha256((script.string or "").encode()).digest()).decode()
        if "pwned" in script.text and (inline or hashed in allowed):
            yield "a script runs"
    for element in soup.find_all(True):
        for name, value in element.attrs.items():
            text = " ".join(value) if isinstance(value, list) else str(value)
            runs = name.startswith("on") or text.strip().lower().startswith(
                "javascript:"
            )
            if "pwned" in text and inline and runs:
                yield f"{name} of {element.name} runs"
    if soup.find("iframe") and "frame-src" not in rules and "default-src" not in rules:
        yield "a frame is shown"
