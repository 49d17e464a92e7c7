"""The summary of a run as text: a table for a terminal, and JUnit XML for services that run tests."""

from __future__ import annotations

from collections.abc import Mapping
from os.path import relpath
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from ..core.files import write_file
from ..core.input_files import printable
from .record.display import format_value

STATIC = Path(__file__).parent / "static"  # templates, and what a browser shows


def format_summary(summary: Mapping[str, Any]) -> str:
    """Format the `summary` of a run: a row for each notebook, what does not hold, the report, the verdict."""
    return fill_template("summary.txt.j2", **summary)


def write_junit(summary: Mapping[str, Any], file: Path) -> None:
    """Write the `summary` of a run as JUnit XML to `file`: a suite for each notebook, a case for each check.

    The first case of a suite is the notebook itself.  Raises StorageError.
    """
    write_file(file, fill_template("junit.xml.j2", **summary))


def fill_template(name: str, **variables: Any) -> str:
    """The template of this `name` in the folder `static`, with `variables`; HTML and XML are escaped."""
    pages = Environment(
        loader=FileSystemLoader(STATIC),
        autoescape=not name.endswith(".txt.j2"),
        undefined=StrictUndefined,
    )
    pages.filters |= {
        "printable": printable,
        "value": format_value,
        "relative": relpath,
    }
    return pages.get_template(name).render(variables)
