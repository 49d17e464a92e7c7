"""The command line: `szlib run` the workbook, `inspect` a file, `extract` encounters from many days.

Nothing heavy is imported before a command needs it, so that `--version`, `--help` and a typo answer at once.
Exit codes: 0; 1 where a check does not hold or a day failed; 2 where something was asked that cannot be
done, explained in one line; 130 after Ctrl-C.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import warnings
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from .. import __version__
from ..errors import DataError, DataWarning, SzlibError

WORKBOOK_PACKAGES = ("ipykernel", "jupytext", "papermill")
"""What `szlib run` needs beside the library: the extra `workbook`."""


def main(arguments: Sequence[str] | None = None) -> int:
    """The command line `szlib`; returns the exit code."""
    options = _parser().parse_args(arguments)
    try:
        return int(options.command(options))
    except (SzlibError, OSError) as error:
        print(f"szlib: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("\nszlib: stopped; what was finished stays in the results", file=sys.stderr)
        return 130


def inspect(file: str | Path) -> str:
    """The funnel of a file down to its encounters, one line for each count, as a table to read."""
    from ..encounters.pipeline import Chain
    from ..tracks import datasets, funnels

    files = datasets.find([file])
    if len(files) != 1:
        raise DataError(f"{file}: are {len(files)} files; expected one: {', '.join(map(str, files[:5]))}")
    with warnings.catch_warnings():  # the table shows what a warning would
        warnings.simplefilter("ignore", DataWarning)
        samples = Chain().encounters(files)
    table = funnels.table(funnels.of(samples))
    table["stage"] = table["stage"].where(~table["stage"].duplicated(), "")
    wide = {name: int(table[name].str.len().max()) for name in ("stage", "what")}
    return "\n".join(
        f"{row.stage:<{wide['stage']}}  {row.what:<{wide['what']}} {row.rows:>12,}"
        for row in table.itertuples()
    )


def _inspect(options: argparse.Namespace) -> int:
    print(inspect(options.file))
    return 0


def _extract(options: argparse.Namespace) -> int:
    from ..encounters.days import extract_days
    from ..parallel import cluster

    with cluster(options.scheduler):
        done = extract_days(options.data, out=options.out, n_jobs=options.jobs, exclude=options.exclude)
    print(done)
    return 1 if len(done.failed) else 0


def _run(options: argparse.Namespace) -> int:
    parameters = dict(_assignment(text) for text in options.parameter)
    _check_workbook()
    from .runner import render, run

    summary = run(
        options.data[0] if len(options.data) == 1 else options.data,
        out=options.out,
        jobs=options.jobs,
        only=options.only,
        parameters=parameters,
        scheduler=options.scheduler,
    )
    print(render(summary))
    return 0 if summary["passed"] else 1


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


def _jobs(text: str) -> int:
    """A number of processes of a command line, at least 1."""
    if not text.isascii() or not text.isdigit() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"expected a whole number >= 1; got {text!r}")
    return int(text)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="szlib", description="Social zones from pedestrian tracks, and a robot that respects them."
    )
    parser.add_argument("--version", action="version", version=f"szlib {__version__}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    run = commands.add_parser("run", help="execute the notebooks, headless, and check their results")
    run.add_argument(
        "--data", nargs="+", default=["synthetic"], metavar="DATA",
        help="synthetic (default), atc-1hz, atc-10-days, or files, folders or globs of tracks",
    )  # fmt: skip
    run.add_argument("--out", default="results", metavar="FOLDER", help="where results go (default: results)")
    run.add_argument(
        "--jobs", type=_jobs, default=min(os.cpu_count() or 1, 4), metavar="N",
        help="notebooks at a time (default: the cores, at most 4)",
    )  # fmt: skip
    run.add_argument(
        "--only", nargs="+", default=[], metavar="NN", help="run these notebooks only, such as 07"
    )
    run.add_argument(
        "-p", "--parameter", action="append", default=[], metavar="NAME=VALUE",
        help="set a notebook parameter, such as seed=1",
    )  # fmt: skip
    run.set_defaults(command=_run)

    inspect = commands.add_parser("inspect", help="print what becomes of the rows of a file")
    inspect.add_argument("file", help="a file of tracks: ATC, EWAP, or tidy; plain or .gz")
    inspect.set_defaults(command=_inspect)

    extract = commands.add_parser("extract", help="find the encounters of many days, resumably")
    extract.add_argument("data", nargs="+", metavar="PATH", help="files, folders or globs of tracks")
    extract.add_argument("--out", default="results/days", metavar="FOLDER", help="a Parquet file a day")
    extract.add_argument(
        "--jobs", type=_jobs, default=None, metavar="N", help="days at a time (default: one)"
    )
    extract.add_argument("--exclude", nargs="+", default=[], metavar="DAY", help="days to leave out")
    extract.set_defaults(command=_extract)

    for command in (run, extract):
        command.add_argument("--scheduler", metavar="ADDRESS", help="hand the work to a Dask cluster")
    return parser
