"""What each command does."""

from __future__ import annotations

import argparse
import json
import os
import warnings
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from ...errors import DataError, DataWarning, SzlibError
from ...files import printable

WORKBOOK_PACKAGES = ("anywidget", "ipykernel", "jupytext", "latex2mathml", "nbconvert", "papermill")
"""What `szlib run` needs beside the library: the extra `workbook`."""


def inspect(file: str | Path, *, area: str = "") -> str:
    """The funnel of a file down to its encounters in the area, a line for each count, as a table to read."""
    from ...encounters.one_day import Chain
    from ...tracks import datasets, funnels

    files = datasets.find([file])
    if len(files) != 1:
        raise DataError(f"{file}: are {len(files)} files; expected one: {', '.join(map(str, files[:5]))}")
    with warnings.catch_warnings():  # the table shows what a warning would
        warnings.simplefilter("ignore", DataWarning)
        samples = Chain(square=area or None).encounters(files)
    where = f"area {samples.attrs['area']}\n" if "area" in samples.attrs else ""
    return where + funnels.text(funnels.get(samples))


def inspect_command(options: argparse.Namespace) -> int:
    """Print the funnel of a file."""
    print(inspect(options.file, area=_area(options)))
    return 0


def extract_command(options: argparse.Namespace) -> int:
    """Extract the encounters of many days."""
    from ...encounters.days import extract_days
    from ...parallel import cluster

    with cluster(options.scheduler):
        done = extract_days(
            options.data,
            out=options.out,
            n_jobs=options.jobs,
            exclude=options.exclude,
            square=_area(options) or None,
        )
    print(done)
    return 1 if len(done.failed) else 0


def run_command(options: argparse.Namespace) -> int:
    """Execute the notebooks."""
    parameters = dict(_assignment(text) for text in options.parameter)
    if area := _area(options):
        parameters["area"] = area
    _check_workbook()
    from ..record import places
    from ..runner.execution import run
    from ..runner.summary import render

    summary = run(
        options.data[0] if len(options.data) == 1 else options.data,
        out=options.out or places.RESULTS,
        jobs=options.jobs,
        only=options.only,
        parameters=parameters,
        scheduler=options.scheduler,
    )
    print(render(summary))
    if "report" in summary:
        print(f"report: {printable(os.path.relpath(summary['report']))}")
    refused = [name for name, record in summary["notebooks"].items() if record["status"] == "refused"]
    if refused:
        error = summary["notebooks"][refused[0]]["error"]
        raise SzlibError(f"{', '.join(refused)}: could not be run: {error}; what was finished stays")
    return 0 if summary["passed"] else 1


def report_command(options: argparse.Namespace) -> int:
    """Make the report of a run anew."""
    _check_workbook()
    from ..record import places
    from ..report import document

    home = Path(options.folder) if options.folder else places.root(places.RESULTS) / "synthetic"
    print(printable(os.path.relpath(file := document.write(home))))
    if options.open:
        import webbrowser

        if not webbrowser.open(file.resolve().as_uri()):
            raise SzlibError("no browser could be opened here; open that file in one")
    return 0


def _area(options: argparse.Namespace) -> str:
    """The area that was asked for, as it is recorded: "" for the data's own, "auto", numbers or a polygon."""
    if options.auto or not (options.square or options.polygon):
        return "auto" if options.auto else ""
    from ...encounters.areas import as_area

    return str(as_area(options.square or Path(options.polygon)))


def _check_workbook() -> None:
    """Raise SzlibError where packages are missing that execute the notebooks."""
    missing = [name for name in WORKBOOK_PACKAGES if find_spec(name) is None]
    if missing:
        raise SzlibError(
            f"`szlib run` needs {', '.join(missing)}: pip install 'szlib[workbook]'; and it needs the "
            "notebooks, which come with the repository: get a copy of it, and there `make run`"
        )


def _assignment(text: str) -> tuple[str, Any]:
    name, equals, value = text.partition("=")
    if not equals or not name:
        raise DataError(f"parameter {text!r} must be NAME=VALUE, such as seed=1")
    try:
        return name, json.loads(value)
    except json.JSONDecodeError:
        return name, value
    except (ValueError, RecursionError) as error:  # a number of too many digits, too many brackets
        raise DataError(f"parameter {name}: cannot be read ({error})") from error
