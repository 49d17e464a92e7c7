"""The summary of a run for machines: JUnit XML for continuous integration, Markdown for GitHub."""

from __future__ import annotations

import io
import os
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..core.errors import StorageError, warn
from ..core.files import write_file
from ..core.input_files import printable, read_small
from .folders import require_place
from .record.display import format_value

# The environment variable in which GitHub names the file for the summary of a step.
GITHUB = "GITHUB_STEP_SUMMARY"
# The element of JUnit for a notebook of each status that is not "done".
_ELEMENTS = {
    "error": "error",
    "refused": "error",
    "undecided": "skipped",
    "not started": "skipped",
}


def require_junit(file: Path) -> Path:
    """The `file`, if JUnit XML can be written there without replacing anything else; else StorageError."""
    if file.suffix != ".xml":
        raise StorageError(f"{printable(file)}: expected a file that ends in .xml")
    if require_place(file).exists() and b"<testsuites" not in read_small(file)[:100]:
        raise StorageError(
            f"{printable(file)}: exists, and is no JUnit XML of szlib; choose another name"
        )
    return file


def write_junit(summary: Mapping[str, Any], file: str | Path) -> None:
    """Write the `summary` of a run as JUnit XML to `file`: a suite for each notebook, a case for each check.

    The first case of a suite is the notebook itself.  Raises StorageError.
    """
    root = ET.Element("testsuites")
    for name, outcome in summary["notebooks"].items():
        cases = [
            (
                name,
                _ELEMENTS.get(outcome["status"]),
                outcome.get("error", outcome["status"]),
            )
        ]
        for check in (check for check in outcome["checks"] if check["kind"] == "check"):
            result = f"{check['result']} ({format_value(check['value'])})"
            cases.append(
                (check["name"], None if check["passed"] else "failure", result)
            )
        kinds = [kind for _, kind, _ in cases]
        seconds = f"{outcome['seconds']:.3f}"
        suite = ET.SubElement(
            root, "testsuite", name=name, tests=str(len(cases)), time=seconds
        )
        for kind, plural in (
            ("failure", "failures"),
            ("error", "errors"),
            ("skipped", "skipped"),
        ):
            suite.set(plural, str(kinds.count(kind)))
        for number, (title, element, text) in enumerate(cases):
            case = ET.SubElement(
                suite, "testcase", classname=name, name=printable(title)
            )
            case.set("time", "0" if number else seconds)
            if element:
                ET.SubElement(case, element, message=printable(text))
    content = io.BytesIO()
    ET.ElementTree(root).write(content, encoding="utf-8", xml_declaration=True)
    write_file(file, content.getvalue())


def append_markdown(rows: list[tuple[str, ...]], notes: list[str]) -> None:
    """Append a table of `rows`, the first its head, and `notes`, to the file that GitHub names, if it does.

    A file that cannot be written is a warning, and does not fail the run.
    """
    if not (file := os.environ.get(GITHUB)):
        return
    head, *body = [f"| {' | '.join(map(_escape, row))} |" for row in rows]
    *listed, last = map(_escape, notes)
    items = "".join(f"- {note}\n" for note in listed)
    lines = [head, "|---" * len(rows[0]) + "|", *body, "", items, f"**{last}**"]
    try:
        with Path(file).open("a", encoding="utf-8") as stream:
            stream.write("\n".join([*lines, ""]))
    except OSError as error:
        warn(
            f"${GITHUB}: {printable(file)} cannot be written ({error.strerror or error})"
        )


def _escape(text: str) -> str:
    """A text that Markdown shows as it is, in a cell of a table."""
    return printable(text).replace("|", "\\|").replace("<", "&lt;")
