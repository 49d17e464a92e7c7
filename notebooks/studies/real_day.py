"""The first numbers of a chapter, and how other data differs from the plaza.

The committed copy of a chapter on the plaza shows a line of numbers. With other data the same cell shows these
numbers beside those of that line.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from pathlib import Path

from IPython.display import Markdown

from szlib.workbook import folders
from szlib.workbook.record import NotebookRecord

BEGINS = "**On this data:** "
_RESERVED = re.compile(r"[:;|\n]")  # separate names and numbers in the line and in the table


def compare_with_plaza(record: NotebookRecord, numbers: Mapping[str, str], note: str = "") -> Markdown:
    """Show the numbers of this data; with other data than the plaza, beside those of the plaza.

    Parameters
    ----------
    record : of the chapter.
    numbers : what is measured, and the number with its unit: {"walking speed, median": "1.02 m/s"}.
    note : what the difference means; shown with other data than the plaza, before the table.

    Raises
    ------
    ValueError : a name or a number holds a character that separates them: colon, semicolon, bar, new line.
    """
    if reserved := [text for pair in numbers.items() for text in pair if _RESERVED.search(text)]:
        raise ValueError(f"expected names and numbers without : ; | and new line, got {reserved[0]!r}")
    if record.cache.is_synthetic:
        return Markdown(BEGINS + "; ".join(f"{name}: {value}" for name, value in numbers.items()))
    plaza = read_numbers(folders.NOTEBOOKS / f"{record.name}.ipynb")
    rows = [f"| {name} | {value} | {plaza.get(name, '-')} |" for name, value in numbers.items()]
    table = "\n".join(["| | this data | the plaza |", "|---|---|---|", *rows])
    return Markdown(f"**On this data.** {note}\n\n{table}")


def read_numbers(copy: Path) -> dict[str, str]:
    """The numbers that an executed `copy` of a chapter on the plaza shows; none if there is no copy."""
    if not copy.exists():
        return {}
    cells = json.loads(copy.read_text(encoding="utf-8"))["cells"]
    shown = [out.get("data", {}) for cell in cells for out in cell.get("outputs", ())]
    texts = ["".join(data.get("text/markdown", "")) for data in shown]
    lines = [text.removeprefix(BEGINS) for text in texts if text.startswith(BEGINS)]
    return dict(pair.split(": ", 1) for line in lines for pair in line.split("; "))
