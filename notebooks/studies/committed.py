"""The studies: their tables, the notebooks that show them, and how a table is written.

A table has the command, the seed and the commit that made it. `STUDIES` has every table of a module that was imported.
"""

from __future__ import annotations

import argparse
import json
import shlex
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from szlib.core.files import claim_folder, write_file
from szlib.workbook.record import TABLES


@dataclass(frozen=True)
class Study:
    """A committed table: its name, the number of the notebook that shows it, and the module of the study.

    `probe` computes a row again, or is None where a row takes too long.
    """

    table: str
    notebook: str
    module: str
    probe: Callable[..., Any] | None


STUDIES: dict[str, Study] = {}
NULL_MODELS = Path("../results/null")
"""Where null models are kept from one run of a study to the next."""
WORLDS = Path("../results/rollouts")
"""Where finished worlds are kept, so that a study that was stopped goes on."""


def study(*tables: str, notebook: str, has_probe: bool = True) -> Callable[[Any], Any]:
    """Register `tables` of a module, shown in `notebook`, by the function that computes a row of them again.

    Without `has_probe` it is the function that makes them.
    """

    def register(function: Any) -> Any:
        """Add the tables to `STUDIES`, and return the function as it is."""
        module, probe = Path(function.__code__.co_filename).stem, function if has_probe else None
        STUDIES.update({name: Study(name, notebook, module, probe) for name in tables})
        return function

    return register


def write_table(table: pd.DataFrame, name: str, *, seed: int = 0) -> None:
    """Write `table` as `name`.csv to `TABLES`, with the command that runs, the `seed` and the commit."""
    if name not in STUDIES:
        raise KeyError(
            f"{name}: register the table with @study, as studies.committed says; known are {[*STUDIES]}"
        )
    script, *arguments = sys.argv
    command = shlex.join(["python", "-m", f"studies.{Path(script).stem}", *arguments])
    header = json.dumps({"command": command, "seed": seed, "commit": _describe_commit()})
    text = table.to_csv(index=False, float_format="%.6g", lineterminator="\n")
    write_file(TABLES / f"{name}.csv", f"# {header}\n{text}")


def claim_new_folder(folder: Path, purpose: str) -> None:
    """Make `folder`, and mark it as szlib's, if it does not exist: then `szlib run` may write beside it."""
    if not folder.exists():
        claim_folder(folder, purpose)


def read_arguments(description: str | None, **options: Any) -> argparse.Namespace:
    """Read the arguments of a study's command, which `description` explains.

    An option ``--name`` has its default, or several in a list. A type or a tuple of choices is an argument by place.
    """
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawTextHelpFormatter)
    for name, value in options.items():
        if isinstance(value, type):
            parser.add_argument(name, type=value)
        elif isinstance(value, tuple):
            parser.add_argument(name, choices=value)
        else:
            first = value[0] if isinstance(value, list) else value
            many = "+" if isinstance(value, list) else None
            flag = "--" + name.replace("_", "-")
            parser.add_argument(flag, default=value, type=type(first), nargs=many, help=f"default: {value}")
    return parser.parse_args()


def _describe_commit() -> str:
    asked = ["git", "-C", str(TABLES), "rev-parse", "--short", "HEAD"]
    return subprocess.run(asked, capture_output=True, text=True, check=True).stdout.strip()
