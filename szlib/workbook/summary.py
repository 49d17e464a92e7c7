"""The summary of a run as text: a table for a terminal, and JUnit XML for services that run tests."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..core.files import write_file
from ..core.input_files import printable
from .record.display import format_value

# The element of JUnit for a notebook of each status; others are skipped.
_ELEMENTS = {"done": "", "error": "error", "refused": "error"}


def format_summary(summary: Mapping[str, Any]) -> str:
    """Format the `summary` of a run: a row for each notebook, each result that does not hold, the verdict."""
    line = "{:<24} {:>7} {:>11} {:>9}  {}".format
    rows = [line("notebook", "seconds", "checks", "observed", "key figures")]
    notes, undecided = [], []
    for name, outcome in summary["notebooks"].items():
        status, figures = outcome["status"], outcome["key_figures"].items()
        checks = _count_passed(outcome, "check") if status == "done" else status
        observed = _count_passed(outcome, "observation")
        key = ", ".join(f"{label} {format_value(value)}" for label, value in figures)
        rows.append(line(name, f"{outcome['seconds']:.1f}", checks, observed, key))
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
    return "\n".join(
        [*rows, *notes, end if summary["passed"] else "NOT ALL CHECKS HOLD"]
    )


def _count_passed(outcome: Mapping[str, Any], kind: str) -> str:
    """How many of a kind hold, of how many, such as "3/4"; "-" if there are none."""
    passed = [c["passed"] for c in outcome["checks"] if c["kind"] == kind]
    return f"{sum(passed)}/{len(passed)}" if passed else "-"


def write_junit(summary: Mapping[str, Any], file: Path) -> None:
    """Write the `summary` of a run as JUnit XML to `file`: a suite for each notebook, a case for each check.

    The first case of a suite is the notebook itself.  Raises StorageError.
    """
    root = ET.Element("testsuites")
    for name, outcome in summary["notebooks"].items():
        own = _ELEMENTS.get(outcome["status"], "skipped")
        cases = [(name, own, outcome.get("error", ""))]
        cases += [
            (check["name"], "" if check["passed"] else "failure", check["result"])
            for check in outcome["checks"]
            if check["kind"] == "check"
        ]
        kinds = [kind for _, kind, _ in cases]
        suite = ET.SubElement(
            root,
            "testsuite",
            name=name,
            time=f"{outcome['seconds']:.3f}",
            tests=str(len(cases)),
            failures=str(kinds.count("failure")),
            errors=str(kinds.count("error")),
            skipped=str(kinds.count("skipped")),
        )
        for title, kind, text in cases:
            label = printable(title)
            case = ET.SubElement(suite, "testcase", classname=name, name=label)
            if kind:
                ET.SubElement(case, kind, message=printable(text))
    write_file(file, ET.tostring(root, encoding="utf-8", xml_declaration=True))
