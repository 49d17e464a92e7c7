"""How a study writes its table: with the command, the seed and the commit that made it."""

from __future__ import annotations

import json
import shlex
import subprocess
import sys
from pathlib import Path

import pandas as pd

from szlib.core.files import write_file
from szlib.workbook.record import TABLES


def write_table(table: pd.DataFrame, name: str, *, seed: int = 0) -> None:
    """Write `table` as `name`.csv to `TABLES`, with the command that runs, the `seed` and the commit."""
    script, *arguments = sys.argv
    command = shlex.join(["python", "-m", f"studies.{Path(script).stem}", *arguments])
    header = json.dumps({"command": command, "seed": seed, "commit": _describe_commit()})
    text = table.to_csv(index=False, float_format="%.6g", lineterminator="\n")
    write_file(TABLES / f"{name}.csv", f"# {header}\n{text}")


def _describe_commit() -> str:
    asked = ["git", "-C", str(TABLES), "rev-parse", "--short", "HEAD"]
    return subprocess.run(asked, capture_output=True, text=True, check=True).stdout.strip()
