"""The summary of a run as text: a table for a terminal, Markdown for GitHub, JUnit XML for other services."""

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
_ELEMENTS = {"error": "error", "refused": "error"}


def format_summary(summary: Mapping[str, Any]) -> str:
    """Format the `summary` of a run: a row for each notebook, each result that does not hold, the verdict."""
    rows, notes = list_results(summary)
    line = "{:<24} {:>7} {:>11} {:>9}  {}".format
    return "\n".join([*(line(*row) for row in rows), *notes])


def list_results(summary: Mapping[str, Any]) -> tuple[list[tuple[str, ...]], list[str]]:
    """List rows of a table of the `summary` of a run, the first its head, and notes, the last its result."""
    rows: list[tuple[str, ...]] = [
        ("notebook", "seconds", "checks", "observed", "key figures")
    ]
    notes, undecided = [], []
    for name, outcome in summary["notebooks"].items():
        status, seconds = outcome["status"], f"{outcome['seconds']:.1f}"
        checks = _count_passed(outcome, "check") if status == "done" else status
        observed = _count_passed(outcome, "observation")
        figures = outcome["key_figures"].items()
        key = ", ".join(f"{label} {format_value(value)}" for label, value in figures)
        rows.append((name, seconds, checks, observed, key))
        notes += [
            f"{name}: {c['name']}: {c['result']} ({c['value']})"
            for c in outcome["checks"]
            if not c["passed"]
        ]
        if status == "undecided":
            undecided.append(name)
        elif "error" in outcome:
            notes.append(f"{name}: {outcome['error']}")
    if undecided:
        names = ", ".join(undecided)
        notes.append(f"not decidable on this data, see the report: {names}")
    notes += [f"data: {text}" for text in summary.get("warnings", ())]
    notes += [f"area: {summary['area']}"] if "area" in summary else []
    end = f"all checks {'that were made ' if undecided else ''}hold"
    return rows, [*notes, end if summary["passed"] else "NOT ALL CHECKS HOLD"]


def _count_passed(outcome: Mapping[str, Any], kind: str) -> str:
    """How many of a kind hold, of how many, such as "3/4"; "-" if there are none."""
    passed = [c["passed"] for c in outcome["checks"] if c["kind"] == kind]
    return f"{sum(passed)}/{len(passed)}" if passed else "-"


def append_markdown(summary: Mapping[str, Any]) -> None:
    """Append the results of a run to the file that GitHub names, if it does.

    A file that cannot be written is a warning, and does not fail the run.
    """
    if not (file := os.environ.get(GITHUB)):
        return
    rows, (*notes, last) = list_results(summary)
    head, *body = [f"| {' | '.join(map(_escape, row))} |" for row in rows]
    items = [f"- {_escape(note)}" for note in notes]
    lines = [
        head,
        "|---" * len(rows[0]) + "|",
        *body,
        "",
        *items,
        "",
        f"**{last}**",
        "",
    ]
    try:
        with Path(file).open("a", encoding="utf-8") as stream:
            stream.write("\n".join(lines))
    except OSError as error:
        reason = error.strerror or error
        warn(f"${GITHUB}: {printable(file)} cannot be written ({reason})")


def _escape(text: str) -> str:
    """A text that Markdown shows as it is, in a cell of a table."""
    return printable(text).replace("|", "\\|").replace("<", "&lt;")


def require_junit(file: Path) -> Path:
    """The `file`, if JUnit XML can be written there without replacing anything else; else StorageError."""
    if file.suffix != ".xml":
        raise StorageError(f"{printable(file)}: expected a file that ends in .xml")
    require_place(file)
    if file.exists() and b"<testsuites" not in read_small(file)[:100]:
        what = "exists, and is no JUnit XML of szlib; choose another name"
        raise StorageError(f"{printable(file)}: {what}")
    return file


def write_junit(summary: Mapping[str, Any], file: Path) -> None:
    """Write the `summary` of a run as JUnit XML to `file`: a suite for each notebook, a case for each check.

    The first case of a suite is the notebook itself.  Raises StorageError.
    """
    root = ET.Element("testsuites")
    for name, outcome in summary["notebooks"].items():
        checks = [check for check in outcome["checks"] if check["kind"] == "check"]
        status = outcome["status"]
        own = "" if status == "done" else _ELEMENTS.get(status, "skipped")
        kinds = [own, *("" if check["passed"] else "failure" for check in checks)]
        counts = {"tests": len(kinds), "failures": kinds.count("failure")}
        counts |= {"errors": kinds.count("error"), "skipped": kinds.count("skipped")}
        suite = ET.SubElement(root, "testsuite", name=name)
        suite.attrib |= {key: str(count) for key, count in counts.items()}
        suite.set("time", f"{outcome['seconds']:.3f}")
        texts = [outcome.get("error", ""), *(c["result"] for c in checks)]
        titles = [name, *(check["name"] for check in checks)]
        for title, kind, text in zip(titles, kinds, texts, strict=True):
            label = printable(title)
            case = ET.SubElement(suite, "testcase", classname=name, name=label)
            if kind:
                ET.SubElement(case, kind, message=printable(text))
    content = io.BytesIO()
    ET.ElementTree(root).write(content, encoding="utf-8", xml_declaration=True)
    write_file(file, content.getvalue())
