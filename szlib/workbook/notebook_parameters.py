"""The parameters of the notebooks, as their cells tagged "parameters" give them: defaults and meanings."""

from __future__ import annotations

import ast
import re
import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

OPTIONS = {
    "data": "--data",
    "results": "--out",
}  # parameters that are options of the command line


def read_defaults(notebook: Path) -> dict[str, Any]:
    """Read the default parameters from the cell tagged "parameters" of a `notebook` (a percent script)."""
    return {name: value for name, value, _ in read_parameters(notebook)}


def read_parameters(notebook: Path) -> list[tuple[str, Any, str]]:
    """Name, default and comment of each parameter of a `notebook` (a percent script)."""
    cells = re.split(r"^# %%", notebook.read_text(encoding="utf-8"), flags=re.MULTILINE)
    return [
        (node.targets[0].id, ast.literal_eval(node.value), _comment(body, node))
        for head, _, body in (cell.partition("\n") for cell in cells)
        if re.search(r'tags=\[[^]]*"parameters"', head)
        for node in ast.parse(body).body
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name)
    ]


def _comment(body: str, node: ast.Assign) -> str:
    """The comment behind an assignment."""
    return (
        body.splitlines()[(node.end_lineno or 1) - 1]
        .encode()[node.end_col_offset :]
        .decode()
        .strip(" #")
    )


def describe_parameters(notebooks: Sequence[Path], meanings: Mapping[str, str]) -> str:
    """List the parameters of the `notebooks` for a terminal: default, meaning, and numbers of notebooks.

    `meanings` replace missing and short comments.  Parameters that many notebooks have come first.
    """
    rows: dict[tuple[str, str], tuple[list[str], list[str]]] = {}
    for notebook in notebooks:
        for name, value, comment in (
            each for each in read_parameters(notebook) if each[0] not in OPTIONS
        ):
            numbers, comments = rows.setdefault((name, repr(value)), ([], []))
            numbers.append(notebook.stem.partition("_")[0])
            comments += [comment] if comment else []
    lines = []
    for (name, value), (numbers, comments) in sorted(
        rows.items(), key=lambda row: -len(row[1][0])
    ):
        where = "all" if len(numbers) == len(notebooks) else ", ".join(numbers)
        meaning = meanings.get(name) or "".join(comments[:1])
        text = f"{name} = {value}  {meaning} ({where})"
        lines += textwrap.wrap(
            text, 108, initial_indent="  ", subsequent_indent=" " * 6
        )
    return "\n".join(["parameters (-p NAME=VALUE):", *lines])
