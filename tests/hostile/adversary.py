"""An adversary: modules among the data, other people's kernels and temporary folders.

Every command is called as an installed script is, in a folder of data that also holds a module for each name
that Python, szlib or Jupyter imports, and settings of other programs.  Each module would leave a mark.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path

from processes import contents, environment, furnish, make_reference

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


def attack(long: bool, seed: int = 0) -> dict[str, int]:
    """Count what ran that must not."""
    tally = Counter(
        {
            "broken: foreign code ran": 0,
            "broken: other results": 0,
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
